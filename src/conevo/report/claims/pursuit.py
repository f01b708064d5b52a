"""Claims P1 to P17: pursuit-evasion.

Nitschke 2009, sections 4.3, 4.5 and 4.6, appendix A.

- Choice: one prey and two are compared between team types with equally many predators.
- Choice: a behaviour emerges in a run if its champion makes one capture by it; the share is that of
  a method's runs of all team types together. A run may show several: the thesis' shares sum to more
  than 100 %.
- Choice: idle predators appear in a team type if more than a fifth of CONE's champions have one,
  and do not if fewer have.
- Choice: an exception (types 1, 6, 7 of P4) claims nothing about what is excepted.
- Choice: complementary are evolved teams with predators of at least two behaviours; of each run's
  teams of clones the best stands for all, and methods are pooled (figure 4.12 names none).
- Choice: of a run's teams of clones the best stands for all in P13 too, methods pooled. Of type 1,
  where two predators are too few (4.5.2, 4.5.4), nothing is claimed.
- Choice: table 4.5 has one number for all team types, so P10 and P17 compare their runs together.
- Choice: table 4.4 shows one team of each method. Claimed are the collective behaviours with
  specialized members in most champions of teams with as many predators and one prey, not how many.
- Choice: a behaviour works better where champions make more captures by it in the same number of
  scenarios, counting those that make none.
- Choice: a behaviour fails with two predators if at most a fifth of the champions show it.
- Choice: prey are fitter by the length of their path, in each experiment; three hidden neurons have
  most of CONE's champions of those experiments whose prey predators were set on, 3 and 6.
"""

from __future__ import annotations

from conevo.report.claims.statements import (
    Claim,
    Compare,
    Part,
    Sample,
    above,
    across,
    alike,
    within,
)
from conevo.report.claims.vocabulary import (
    CNE,
    COEVOLUTION,
    ISOLATED,
    METHODS,
    ONE_PREY,
    OTHERS,
    TEAMS,
    TWO_PREY,
    VARIANTS,
    about,
    changes_little,
    has_castes,
    teams,
)

__all__ = ["PURSUIT"]

IDLE = teams(4, 5, 8, 9, 10)  # where the thesis saw idle predators, and CONE above the others
NOT_IDLE = teams(1, 2, 3, 6, 7)
SOME = 0.2  # of the runs
SHAPING = tuple(f"shaping-{n}" for n in range(1, 7))


def _suits(
    behaviour: str, methods: tuple[str, ...], best: tuple[int, ...], others: tuple[int, ...]
) -> Part:
    """Return: each method captures more by a behaviour in some team types than in others."""
    pairs = [(a, b) for a in teams(*best) for b in teams(*others)]
    return Part(across(f"captures by {behaviour}", methods, pairs))


def _lose_more(method: str, other: str) -> Compare:
    """Return: over all team types a method's teams lose more without a behaviour than another's."""
    return Compare("above", Sample("loss", (method,), TEAMS), Sample("loss", (other,), TEAMS))


PURSUIT: tuple[Claim, ...] = (
    Claim(
        "P1",
        "capture time of CONE above all others for team types 4, 5, 8, 9, 10",
        "4.5.6",
        (Part(above("capture_time", IDLE, ("cone",), OTHERS)),),
    ),
    Claim(
        "P2",
        "alike for team types 1, 2, 3, 6, 7",
        "4.5.6",
        (Part(alike("capture_time", NOT_IDLE, [("cone", other) for other in OTHERS])),),
    ),
    Claim(
        "P3",
        "two prey (types 6-10) are held shorter than one (1-5), every method",
        "4.5.5",
        (Part(across("capture_time", METHODS, zip(ONE_PREY, TWO_PREY, strict=True))),),
    ),
    Claim(
        "P4",
        "CONE above CONE-1, -2, -3 except for types 1, 6, 7",
        "4.5.7",
        (Part(above("capture_time", teams(2, 3, 4, 5, 8, 9, 10), ("cone",), VARIANTS)),),
    ),
    Claim(
        "P5",
        "entrapment emerges in about 80 % of HomCNE and HetCNE runs",
        "4.5.1",
        about("entrapment", TEAMS, {"homcne": 0.8, "hetcne": 0.8}),
    ),
    Claim(
        "P6",
        "pursuer-blocker in about 65 % (CCGA) and 70 % (MESP)",
        "4.5.2",
        about("pursuer-blocker", TEAMS, {"ccga": 0.65, "mesp": 0.7}),
    ),
    Claim(
        "P7",
        "spiders-fly in about 40 / 35 / 50 % (CCGA / MESP / CONE)",
        "4.5.3",
        about("spiders-fly", TEAMS, {"ccga": 0.4, "mesp": 0.35, "cone": 0.5}),
    ),
    Claim(
        "P8",
        "role-switcher in about 80 % of CONE runs; idle predators appear in types 4, 5, 8, 9, 10 "
        "only",
        "4.5.4, 4.5.6",
        (
            *about("role-switcher", TEAMS, {"cone": 0.8}),
            Part(tuple(within("idle predators", "cone", (e,), SOME, 1) for e in IDLE)),
            Part(tuple(within("idle predators", "cone", (e,), 0, SOME) for e in NOT_IDLE)),
        ),
    ),
    Claim(
        "P9",
        "teams of complementary behaviours hold the prey longer than cloned teams (types 1-5)",
        "4.6.5",
        (
            Part(
                tuple(
                    Compare(
                        "above",
                        Sample("complementary", METHODS, (e,)),
                        Sample("clones", METHODS, (e,)),
                    )
                    for e in ONE_PREY
                )
            ),
        ),
        caution="the teams of figure 4.12 were composed, as in P13; these evolved",
    ),
    Claim(
        "P10",
        "replacing specialized predators hurts CONE teams most (table 4.5)",
        "4.6.6",
        (Part(tuple(_lose_more("cone", other) for other in OTHERS)),),
        caution="its other half, least in HomCNE and HetCNE, is P17",
    ),
    Claim(
        "P11",
        "fittest teams: of 3 predators HomCNE and HetCNE non-specialized; of 4 CCGA and MESP in "
        "pursuer-blocker, spiders-fly and neither; of 5 CONE in spiders-fly, role-switcher and "
        "neither",
        "4.6.4",
        (
            *has_castes("members of nothing", teams(2), CNE),
            *has_castes("members of pursuer-blocker and spiders-fly", teams(3), ISOLATED),
            *has_castes("members of spiders-fly and role-switcher", teams(4), ("cone",)),
        ),
        contradiction="table 4.5 replaces specialized pursuers of HomCNE and HetCNE, and flankers "
        "of CCGA and MESP, of which table 4.4 has none",
    ),
    Claim(
        "P12",
        "entrapment and pursuer-blocker work best for types 2 and 3, spiders-fly for 1 to 3, "
        "role-switcher for 2 to 5 (one prey)",
        "4.5.1-4.5.4",
        (
            _suits("entrapment", CNE, (2, 3), (1, 4, 5)),
            _suits("pursuer-blocker", ISOLATED, (2, 3), (1, 4, 5)),
            _suits("spiders-fly", COEVOLUTION, (1, 2, 3), (4, 5)),
            _suits("role-switcher", ("cone",), (2, 3, 4, 5), (1,)),
        ),
        caution="that CONE's spiders-fly fails with types 4 to 6 up to generation 250 only cannot "
        "be judged: champions are watched, not generations",
    ),
    Claim(
        "P13",
        "composed pursuer-blocker, spiders-fly and role-switcher teams hold the prey longer than "
        "cloned teams (types 2-5)",
        "4.6.5",
        (
            Part(
                tuple(
                    Compare(
                        "above",
                        Sample(f"composed {name}", METHODS, (e,)),
                        Sample("clones", METHODS, (e,)),
                    )
                    for e in ONE_PREY[1:]
                    for name in ("pursuer-blocker", "spiders-fly", "role-switcher")
                )
            ),
        ),
        caution="type 1, in 4.6.5 too, is left out: by 4.5.2 and 4.5.4 two predators are too few",
    ),
    Claim(
        "P14",
        "CONE evolves fitter prey than all others; its prey have three hidden neurons",
        "4.3",
        (
            Part(above("path", SHAPING, ("cone",), OTHERS)),
            *has_castes("three hidden neurons", (SHAPING[2], SHAPING[5]), ("cone",)),
        ),
        other_world="prey",
    ),
    Claim(
        "P15",
        "settings changed by a fifth: capture time changes by 15 % at most",
        "4.2",
        changes_little(TEAMS[2], 0.15),
        caution="the thesis names no environment: judged by plans as pursuit-sensitivity, at each "
        "combination of levels by itself",
    ),
    Claim(
        "P16",
        "two predators are too few: pursuer-blocker (CCGA, MESP) and role-switcher (CONE) fail "
        "with type 1",
        "4.5.2, 4.5.4",
        (
            Part(
                tuple(
                    within(behaviour, method, teams(1), 0, SOME)
                    for behaviour, methods in (
                        ("pursuer-blocker", ISOLATED),
                        ("role-switcher", ("cone",)),
                    )
                    for method in methods
                )
            ),
        ),
        contradiction="4.6.5 has one pursuer and one blocker, or one flanker and one knocker, hold "
        "prey longer than clones",
    ),
    Claim(
        "P17",
        "replacing specialized predators hurts HomCNE and HetCNE teams least",
        "4.6.6",
        (Part(tuple(_lose_more(method, other) for method in COEVOLUTION for other in CNE)),),
        contradiction="in table 4.5 CCGA keeps 60 % without its blockers, HomCNE 46.9 % and "
        "HetCNE 43.7 %",
    ),
)
