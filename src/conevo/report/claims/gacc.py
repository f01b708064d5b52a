"""Claims G1 to G16: gathering and collective construction.

Nitschke 2009, sections 6.4 and 6.5, appendix D.

- Choice: "in complex than in simple environments" compares environments of the same number (table
  D-15), by the share of the objects delivered, because their numbers of objects differ.
- Choice: "several castes" are at least two, as in R9.
- Choice: clones are those of CONE's champions (6.5.5), including the non-specialized; the best team
  of clones represents its run.
- Choice: castes of a type are those with a number in all of tables 6.11 to 6.13. Where they have
  none (NA), most champions have no robot specialized to the type.
- Choice: direct evolution fails where teams that learned the environments in turn deliver more. In
  the first environment both are the same.
"""

from conevo.report.claims.vocabulary import read_claims

__all__ = ["GACC"]

GACC = read_claims("""
G1 (6.4.3) complex 1-9: CONE delivers more in correct order than all others
  above | delivered | cone : OTHERS | complex-1..9
G2 (6.4.3) CCGA, MESP, CONE reach a larger share of the optimum in complex than in simple
      environments
  above | share of the optimum | COEVOLUTION | complex-1..9 ~ simple-1..9
  decided: heuristic teams, which nothing evolved, also differ between the two families
G3 (6.4.3) HomCNE and HetCNE alike, simple and complex
  alike | delivered | homcne : hetcne | simple-1..10, complex-1..9
G4 (6.4.3) share of optimum, complex: .29 / .32 / .71 / .79 / .93 (HomCNE, HetCNE, CCGA, MESP,
      CONE)
  about | share of the optimum | ALL | {complex-1..9} | 0.29, 0.32, 0.71, 0.79, 0.93
G5 (6.4.3) share of optimum, simple: .48 / .47 / .51 / .54 / .55
  about | share of the optimum | ALL | {simple-1..10} | 0.48, 0.47, 0.51, 0.54, 0.55
  decided: heuristic teams, which nothing evolved, also differ between the two families
G6 (6.4.3) fittest CONE teams, complex: one non-specialized and several specialized castes
  has | several castes | cone | complex-1..9
  caution: table 6.13 has no non-specialized caste in environment 9
G7 (6.5.4) lesioning castes costs CONE teams more than CCGA and MESP teams (tables 6.9-6.13)
  above | loss | cone : ISOLATED | complex-1..9
G8 (6.5.5) cloned teams deliver less than evolved teams of every method
  above | evolved : clones | ALL : cone | complex-1..9
  contradiction: 6.5.5 ends with non-specialized clones alike to HomCNE and HetCNE
G9 (6.5.6) CONE above CONE-1, CONE-2, CONE-3 in all complex environments
  above | delivered | cone : VARIANTS | complex-1..9
G10 (6.5.2, 6.5.4) fittest HomCNE and HetCNE teams: all non-specialized in complex 1-9, one caste
      in simple environments
  has | only non-specialized | CNE | complex-1..9
  has | one caste | CNE | simple-1..10
G11 (6.5.4) fittest CCGA, MESP, CONE teams, complex: detectors, gatherers and constructors of
      types B and C in 2, A and B in 3 and 7, A and C in 4, C alone in 1, all in 5, 6, 8, 9
  lacks | any of A | COEVOLUTION | complex-1..2
  has | detectors and gatherers of A, constructors of A | COEVOLUTION | complex-3..9
  lacks | any of B | COEVOLUTION | complex-1, complex-4
  has | detectors and gatherers of B, constructors of B | COEVOLUTION | complex-2..3, complex-5..9
  lacks | any of C | COEVOLUTION | complex-3, complex-7
  has | detectors and gatherers of C | COEVOLUTION | complex-1..2, complex-4..6, complex-8..9
  has | constructors of C | COEVOLUTION | complex-1..2, complex-4..5, complex-8
  has | constructors of C | mesp, cone | complex-9
  caution: constructors of C are not claimed in 6, nor of CCGA in 9, as tables 6.11 to 6.13 have
      none
G12 (6.4.2) complex: direct evolution fails, shaping does not
  above | delivered after shaping : delivered directly | ALL | complex-2..8
  caution: judged by plans as gacc-shaping, in which direct runs have the budget of a stage
G13 (6.5.4) lesioning castes costs HomCNE and HetCNE teams least
  above | loss | COEVOLUTION : CNE | complex-1..9
G14 (6.3.2) settings changed by a fifth: objects delivered change by 9 % at most
  within | change | ALL | complex-1 | -0.09..0.09
  caution: the thesis names no environment: judged by plans as gacc-sensitivity, at each
      combination of levels by itself
G15 (6.5.5) clones of the non-specialized deliver as much as HomCNE and HetCNE teams
  alike | clones of the non-specialized : evolved | cone : homcne | complex-1..9
  alike | clones of the non-specialized : evolved | cone : hetcne | complex-1..9
  contradiction: 6.5.5 begins with all teams of clones below all evolved ones
G16 (6.4.3, 6.5.2) complex: multiple castes of CCGA, MESP, CONE, one caste of HomCNE and HetCNE
  has | two castes | COEVOLUTION | complex-1..9
  has | one caste | CNE | complex-1..9
""")
