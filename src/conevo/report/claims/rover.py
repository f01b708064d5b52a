"""Claims R1 to R28: multi-rover.

Nitschke 2009, sections 5.4 and 5.5, appendix C.

- Choice: "in complex than in simple environments" compares environments of the same number, which
  have the same canals (table C-11).
- Choice: "most environments" are more than half of them, each with all ten pairs of methods.
- Choice: castes of rovers specialized to moving do not count (5.5.2).
- Choice: clones are those of CONE's champions (5.5.4), and the best team of clones represents its
  run. "Of one specialist" leaves out the non-specialized.
- Choice: "multiple castes" are two or more of low, med, hi and non-specialized.
- Choice: where tables 5.11 to 5.15 give no number for a caste (NA), most champions do not have it.
- Choice: "environments [7, 10]" are 7 to 10, as in 5.5.3; environments in a list are these alone.
- Choice: a measure that is highest in environment 10 is significantly above each of the others.
- Choice: an axis of a figure is the range in which the mean of every environment lies.
"""

from conevo.report.claims.vocabulary import read_claims

__all__ = ["ROVER"]

ROVER = read_claims("""
R1 (5.4.2) complex 1-10: value detected by CONE above each of HomCNE, HetCNE, CCGA, MESP
  above | value | cone : OTHERS | complex-1..10
  caution: value only; 5.4.2 names task performance, which is value and area
R2 (5.4.2) complex: CCGA and MESP alike in value (at least 9 of 10 environments)
  alike | value | ccga : mesp | complex-1..10 | need 9
R3 (5.4.2) complex: each of CCGA, MESP, CONE above HomCNE and HetCNE in value
  above | value | COEVOLUTION : CNE | complex-1..10
R4 (5.4.1) HomCNE and HetCNE alike in value, simple and complex
  alike | value | homcne : hetcne | simple-1..10, complex-1..10
R5 (5.4.1) CCGA, MESP, CONE detect more value in complex than in simple environments
  above | value | COEVOLUTION | complex-1..10 ~ simple-1..10
  decided: heuristic teams, which nothing evolved, also differ between the two families
R6 (5.4.1) area covered alike among the five methods in most simple and complex environments
  alike | area | two of ALL | simple-1..10, complex-1..10 | need 11
  contradiction: 5.4.1 has it alike in most environments, 5.4.2 in some of 7 to 10 only
R7 (5.4.3) extended 1-10: CONE above all others in value
  above | value | cone : OTHERS | extended-1..10
R8 (5.4.3) extended: CCGA and MESP alike (9 of 10), both above HomCNE and HetCNE
  alike | value | ccga : mesp | extended-1..10 | need 9
  above | value | ISOLATED : CNE | extended-1..10
R9 (5.5.2) fittest CONE teams, complex: one non-specialized and at least two specialized castes
  has | several castes | cone | complex-1..10
  caution: tables 5.15 and 5.16 show three specialized castes in all ten, as R23 has it
R10 (5.4.1) fittest HomCNE and HetCNE teams consist of one caste
  has | one caste | CNE | simple-1..10, complex-1..10
  caution: tables 5.7 and 5.8 name the caste, med or hi, as R17 does; here any one counts
R11 (5.5.3) replacing a caste by heuristic rovers lowers value; loss CONE > CCGA, MESP > HomCNE,
      HetCNE
  above | whole : lesioned | ALL | complex-1..10
  above | loss | cone : ISOLATED | complex-1..10
  above | loss | ISOLATED : CNE | complex-1..10
R12 (5.5.4) teams of clones of one specialist detect less than CCGA, MESP, CONE teams
  above | evolved : clones of a specialist | COEVOLUTION : cone | complex-1..10
R13 (5.5.5) complex: CONE above CONE-1, CONE-2, CONE-3 in value
  above | value | cone : VARIANTS | complex-1..10
R14 (5.4.1) CCGA, MESP, CONE: multiple castes in complex environments, not in simple ones
  has | two castes | COEVOLUTION | complex-1..10
  lacks | two castes | COEVOLUTION | simple-1..10
R15 (5.5.2) fittest CCGA and MESP teams, complex: one non-specialized caste, and low, med or hi
  has | mixed castes | ISOLATED | complex-1..10
R16 (5.5.3) complex: low castes of CCGA in 1-4 only and of MESP in 1-3 only, med castes of CCGA in
      1-8 only and of MESP in all, hi castes of both in all
  has | some low | ccga | complex-1..4
  lacks | some low | ccga | complex-5..10
  has | some low | mesp | complex-1..3
  lacks | some low | mesp | complex-4..10
  has | some med | ccga | complex-1..8
  lacks | some med | ccga | complex-9..10
  has | some med | mesp | complex-1..10
  has | some hi | ISOLATED | complex-1..10
R17 (5.5.3) fittest teams, complex: HomCNE med only in 1-6 and hi only in 7-10, HetCNE hi only
  has | only med | homcne | complex-1..6
  has | only hi | homcne | complex-7..10
  has | only hi | hetcne | complex-1..10
R18 (5.4.3) complex: every method detects most in environment 10
  above | value | ALL | complex-10 : complex-1..9
  decided: heuristic teams, which nothing evolved, detect most in environment 10 as well
R19 (5.5.5) complex: value of CONE, CONE-1, CONE-2, CONE-3 between 1,000 and 4,500, the axis of
      figure 5.16
  within | value | cone, VARIANTS | complex-1..10 | 1000..4500
R20 (5.5.4) complex, value: clones of the non-specialized and of med (1-6) or hi (7-10) alike to
      HomCNE; of hi (1-6) or the non-specialized (7-10) alike to HetCNE
  alike | clones of the non-specialized : evolved | cone : homcne | complex-1..10
  alike | clones of med : evolved | cone : homcne | complex-1..6
  alike | clones of hi : evolved | cone : homcne | complex-7..10
  alike | clones of hi : evolved | cone : hetcne | complex-1..6
  alike | clones of the non-specialized : evolved | cone : hetcne | complex-7..10
  contradiction: 5.5.4 concludes that such clones do not achieve what HomCNE and HetCNE do
R21 (5.4.2) complex, area alike: HomCNE and CCGA in 7, 9; HomCNE and MESP in 7-10; HetCNE and CCGA
      in 7, 8; HetCNE and MESP in 7, 9
  alike | area | homcne : ccga | complex-7, complex-9
  alike | area | homcne : mesp | complex-7..10
  alike | area | hetcne : ccga | complex-7..8
  alike | area | hetcne : mesp | complex-7, complex-9
  caution: that area differs in all others is not claimed here: 5.4.1 has it alike in most
R22 (5.3.2) settings changed by a fifth (learning), a quarter (generations, epochs) or 30 %
      (world): value changes by 25 % at most
  within | change | ALL | complex-5 | -0.25..0.25
  caution: the thesis names no environment: judged by plans as rover-sensitivity, at each
      combination of levels by itself
R23 (5.5.3) fittest CONE teams, complex: a non-specialized, a low, a med and a hi caste in all ten
  has | all castes | cone | complex-1..10
R24 (5.4.3) extended, area: CCGA above HomCNE in 3, 6, 7 and HetCNE in 6, 7; MESP above HomCNE in
      3 and HetCNE in 7, 8
  above | area | ccga : homcne | extended-3, extended-6..7
  above | area | ccga : hetcne | extended-6..7
  above | area | mesp : homcne | extended-3
  above | area | mesp : hetcne | extended-7..8
  caution: left out: CCGA and MESP differ in 1, 3, 5, 7, 10, but not which is above; and a second
      environment of MESP and HomCNE, which is lost
R25 (5.5.3) replacing a caste by heuristic rovers lowers area; loss CONE > CCGA, MESP > HomCNE,
      HetCNE
  above | whole area : lesioned area | ALL | complex-1..10
  above | loss of area | cone : ISOLATED | complex-1..10
  above | loss of area | ISOLATED : CNE | complex-1..10
R26 (5.4.3) extended: multiple castes of CCGA, MESP, CONE, one caste of HomCNE and HetCNE
  has | two castes | COEVOLUTION | extended-1..10
  has | one caste | CNE | extended-1..10
R27 (5.5.5) complex: CONE above CONE-1, CONE-2, CONE-3 in area
  above | area | cone : VARIANTS | complex-1..10
R28 (5.4.3) complex: every method covers most in environment 10
  above | area | ALL | complex-10 : complex-1..9
""")
