"""Claims P1 to P17: pursuit-evasion.

Nitschke 2009, sections 4.3, 4.5 and 4.6, appendix A.

- Choice: one prey and two are compared between team types with the same number of predators.
- Choice: a behaviour emerges in a run if its champion makes one capture by it. The share is that of
  a method's runs of all team types together. A run may show several behaviours: the thesis' shares
  sum to more than 100 %.
- Choice: idle predators appear in a team type if more than a fifth of CONE's champions have one,
  and do not if fewer have.
- Choice: an exception (types 1, 6, 7 of P4) claims nothing about these types.
- Choice: teams are complementary if their predators have at least two behaviours. The best team of
  clones represents its run, and methods are pooled (figure 4.12 names none).
- Choice: the same is true in P13. Nothing is claimed about type 1, where two predators are too few
  (4.5.2, 4.5.4).
- Choice: table 4.5 has one number for all team types, so P10 and P17 compare their runs together.
- Choice: table 4.4 shows one team of each method. The claim is about the collective behaviours with
  specialized members in most champions of teams with the same number of predators and one prey, not
  about the number of members.
- Choice: a behaviour works better where champions make more captures by it in the same number of
  scenarios, counting those that make none.
- Choice: a behaviour fails with two predators if at most a fifth of the champions show it.
- Choice: prey are fitter by the length of their path, in each experiment. Most of CONE's champions
  have three hidden neurons in experiments 3 and 6, whose prey the predators then met.
"""

from conevo.report.claims.vocabulary import read_claims

__all__ = ["PURSUIT"]

PURSUIT = read_claims("""
P1 (4.5.6) capture time of CONE above all others for team types 4, 5, 8, 9, 10
  above | capture_time | cone : OTHERS | team-4..5, team-8..10
P2 (4.5.6) alike for team types 1, 2, 3, 6, 7
  alike | capture_time | cone : OTHERS | team-1..3, team-6..7
P3 (4.5.5) two prey (types 6-10) are held shorter than one (1-5), every method
  above | capture_time | ALL | team-1..5 ~ team-6..10
P4 (4.5.7) CONE above CONE-1, -2, -3 except for types 1, 6, 7
  above | capture_time | cone : VARIANTS | team-2..5, team-8..10
P5 (4.5.1) entrapment emerges in about 80 % of HomCNE and HetCNE runs
  about | entrapment | CNE | {team-1..10} | 0.8
P6 (4.5.2) pursuer-blocker in about 65 % (CCGA) and 70 % (MESP)
  about | pursuer-blocker | ISOLATED | {team-1..10} | 0.65, 0.7
P7 (4.5.3) spiders-fly in about 40 / 35 / 50 % (CCGA / MESP / CONE)
  about | spiders-fly | COEVOLUTION | {team-1..10} | 0.4, 0.35, 0.5
P8 (4.5.4, 4.5.6) role-switcher in about 80 % of CONE runs; idle predators appear in types 4, 5,
      8, 9, 10 only
  about | role-switcher | cone | {team-1..10} | 0.8
  within | idle predators | cone | team-4..5, team-8..10 | 0.2..1
  within | idle predators | cone | team-1..3, team-6..7 | 0..0.2
P9 (4.6.5) teams of complementary behaviours hold the prey longer than cloned teams (types 1-5)
  above | complementary : clones | {ALL} | team-1..5
  caution: the teams of figure 4.12 were composed, as in P13; these evolved
P10 (4.6.6) replacing specialized predators hurts CONE teams most (table 4.5)
  above | loss | cone : OTHERS | {team-1..10}
  caution: its other half, least in HomCNE and HetCNE, is P17
P11 (4.6.4) fittest teams: of 3 predators HomCNE and HetCNE non-specialized; of 4 CCGA and MESP in
      pursuer-blocker, spiders-fly and neither; of 5 CONE in spiders-fly, role-switcher and
      neither
  has | members of nothing | CNE | team-2
  has | members of pursuer-blocker and spiders-fly | ISOLATED | team-3
  has | members of spiders-fly and role-switcher | cone | team-4
  contradiction: table 4.5 replaces specialized pursuers of HomCNE and HetCNE, and flankers of
      CCGA and MESP, of which table 4.4 has none
P12 (4.5.1-4.5.4) entrapment and pursuer-blocker work best for types 2 and 3, spiders-fly for 1 to
      3, role-switcher for 2 to 5 (one prey)
  above | captures by entrapment | CNE | team-2..3 : team-1, team-4..5
  above | captures by pursuer-blocker | ISOLATED | team-2..3 : team-1, team-4..5
  above | captures by spiders-fly | COEVOLUTION | team-1..3 : team-4..5
  above | captures by role-switcher | cone | team-2..5 : team-1
  caution: that CONE's spiders-fly fails with types 4 to 6 up to generation 250 only cannot be
      judged: champions are watched, not generations
P13 (4.6.5) composed pursuer-blocker, spiders-fly and role-switcher teams hold the prey longer
      than cloned teams (types 2-5)
  above | composed pursuer-blocker, composed spiders-fly, composed role-switcher : clones | {ALL}
      | team-2..5
  caution: type 1, in 4.6.5 too, is left out: by 4.5.2 and 4.5.4 two predators are too few
P14 (4.3) CONE evolves fitter prey than all others; its prey have three hidden neurons
  above | path | cone : OTHERS | shaping-1..6
  has | three hidden neurons | cone | shaping-3, shaping-6
  other_world: prey
P15 (4.2) settings changed by a fifth: capture time changes by 15 % at most
  within | change | ALL | team-3 | -0.15..0.15
  caution: the thesis names no environment: judged by plans as pursuit-sensitivity, at each
      combination of levels by itself
P16 (4.5.2, 4.5.4) two predators are too few: pursuer-blocker (CCGA, MESP) and role-switcher
      (CONE) fail with type 1
  within | pursuer-blocker | ISOLATED | team-1 | 0..0.2
  within | role-switcher | cone | team-1 | 0..0.2
  contradiction: 4.6.5 has one pursuer and one blocker, or one flanker and one knocker, hold prey
      longer than clones
P17 (4.6.6) replacing specialized predators hurts HomCNE and HetCNE teams least
  above | loss | COEVOLUTION : CNE | {team-1..10}
  contradiction: in table 4.5 CCGA keeps 60 % without its blockers, HomCNE 46.9 % and HetCNE 43.7
      %
""")
