"""Claims R1 to R28: multi-rover.

Nitschke 2009, sections 5.4 and 5.5, appendix C.

- Choice: "in complex than in simple environments" compares environments of the same number, which
  have the same canals (table C-11).
- Choice: "most environments" are more than half of them, each with all ten pairs of methods.
- Choice: castes of rovers specialized to moving do not count (5.5.2).
- Choice: clones are those of CONE's champions (5.5.4), of each run the best team of clones stands
  for all; "of one specialist" leaves out the non-specialized.
- Choice: "multiple castes" are two or more of low, med, hi and non-specialized.
- Choice: a caste that tables 5.11 to 5.15 give no number for (NA) is one that most champions have
  not.
- Choice: "environments [7, 10]" are 7 to 10, as in 5.5.3; environments in a list are these alone.
- Choice: what is highest in environment 10 is significantly above each of the others.
- Choice: an axis of a figure is the range in which the mean of every environment lies.
"""

from __future__ import annotations

from itertools import combinations

from conevo.report.claims.statements import Claim, Part, above, across, alike, within
from conevo.report.claims.vocabulary import (
    BY_WORLD,
    CNE,
    COEVOLUTION,
    COMPLEX,
    EXTENDED,
    ISOLATED,
    METHODS,
    OTHERS,
    SIMPLE,
    VARIANTS,
    as_cloned,
    changes_little,
    cloned,
    has_castes,
    has_only_in,
    lacks_castes,
    lesioned,
)

__all__ = ["ROVER"]

ROVER: tuple[Claim, ...] = (
    Claim(
        "R1",
        "complex 1-10: value detected by CONE above each of HomCNE, HetCNE, CCGA, MESP",
        "5.4.2",
        (Part(above("value", COMPLEX, ("cone",), OTHERS)),),
        caution="value only; 5.4.2 names task performance, which is value and area",
    ),
    Claim(
        "R2",
        "complex: CCGA and MESP alike in value (at least 9 of 10 environments)",
        "5.4.2",
        (Part(alike("value", COMPLEX, [ISOLATED]), need=9),),
    ),
    Claim(
        "R3",
        "complex: each of CCGA, MESP, CONE above HomCNE and HetCNE in value",
        "5.4.2",
        (Part(above("value", COMPLEX, COEVOLUTION, CNE)),),
    ),
    Claim(
        "R4",
        "HomCNE and HetCNE alike in value, simple and complex",
        "5.4.1",
        (Part(alike("value", SIMPLE + COMPLEX, [CNE])),),
    ),
    Claim(
        "R5",
        "CCGA, MESP, CONE detect more value in complex than in simple environments",
        "5.4.1",
        (Part(across("value", COEVOLUTION, zip(COMPLEX, SIMPLE, strict=True))),),
        decided=BY_WORLD,
    ),
    Claim(
        "R6",
        "area covered alike among the five methods in most simple and complex environments",
        "5.4.1",
        (Part(alike("area", SIMPLE + COMPLEX, combinations(METHODS, 2)), need=11),),
        contradiction="5.4.1 has it alike in most environments, 5.4.2 in some of 7 to 10 only",
    ),
    Claim(
        "R7",
        "extended 1-10: CONE above all others in value",
        "5.4.3",
        (Part(above("value", EXTENDED, ("cone",), OTHERS)),),
    ),
    Claim(
        "R8",
        "extended: CCGA and MESP alike (9 of 10), both above HomCNE and HetCNE",
        "5.4.3",
        (
            Part(alike("value", EXTENDED, [ISOLATED]), need=9),
            Part(above("value", EXTENDED, ISOLATED, CNE)),
        ),
    ),
    Claim(
        "R9",
        "fittest CONE teams, complex: one non-specialized and at least two specialized castes",
        "5.5.2",
        has_castes("several castes", COMPLEX, ("cone",)),
        caution="tables 5.15 and 5.16 show three specialized castes in all ten, as R23 has it",
    ),
    Claim(
        "R10",
        "fittest HomCNE and HetCNE teams consist of one caste",
        "5.4.1",
        has_castes("one caste", SIMPLE + COMPLEX, CNE),
        caution="tables 5.7 and 5.8 name the caste, med or hi, as R17 does; here any one counts",
    ),
    Claim(
        "R11",
        "replacing a caste by heuristic rovers lowers value; loss CONE > CCGA, MESP > HomCNE, "
        "HetCNE",
        "5.5.3",
        (
            Part(lesioned(COMPLEX)),
            Part(above("loss", COMPLEX, ("cone",), ISOLATED)),
            Part(above("loss", COMPLEX, ISOLATED, CNE)),
        ),
    ),
    Claim(
        "R12",
        "teams of clones of one specialist detect less than CCGA, MESP, CONE teams",
        "5.5.4",
        (Part(cloned("clones of a specialist", COMPLEX, COEVOLUTION)),),
    ),
    Claim(
        "R13",
        "complex: CONE above CONE-1, CONE-2, CONE-3 in value",
        "5.5.5",
        (Part(above("value", COMPLEX, ("cone",), VARIANTS)),),
    ),
    Claim(
        "R14",
        "CCGA, MESP, CONE: multiple castes in complex environments, not in simple ones",
        "5.4.1",
        (
            *has_castes("two castes", COMPLEX, COEVOLUTION),
            *lacks_castes("two castes", SIMPLE, COEVOLUTION),
        ),
    ),
    Claim(
        "R15",
        "fittest CCGA and MESP teams, complex: one non-specialized caste, and low, med or hi",
        "5.5.2",
        has_castes("mixed castes", COMPLEX, ISOLATED),
    ),
    Claim(
        "R16",
        "complex: low castes of CCGA in 1-4 only and of MESP in 1-3 only, med castes of CCGA in 1-8"
        " only and of MESP in all, hi castes of both in all",
        "5.5.3",
        (
            *has_only_in("some low", range(1, 5), COMPLEX, "ccga"),
            *has_only_in("some low", range(1, 4), COMPLEX, "mesp"),
            *has_only_in("some med", range(1, 9), COMPLEX, "ccga"),
            *has_castes("some med", COMPLEX, ("mesp",)),
            *has_castes("some hi", COMPLEX, ISOLATED),
        ),
    ),
    Claim(
        "R17",
        "fittest teams, complex: HomCNE med only in 1-6 and hi only in 7-10, HetCNE hi only",
        "5.5.3",
        (
            *has_castes("only med", COMPLEX[:6], ("homcne",)),
            *has_castes("only hi", COMPLEX[6:], ("homcne",)),
            *has_castes("only hi", COMPLEX, ("hetcne",)),
        ),
    ),
    Claim(
        "R18",
        "complex: every method detects most in environment 10",
        "5.4.3",
        (Part(across("value", METHODS, [(COMPLEX[9], place) for place in COMPLEX[:9]])),),
        decided="heuristic teams, which nothing evolved, detect most in environment 10 as well",
    ),
    Claim(
        "R19",
        "complex: value of CONE, CONE-1, CONE-2, CONE-3 between 1,000 and 4,500, the axis of "
        "figure 5.16",
        "5.5.5",
        (
            Part(
                tuple(
                    within("value", method, (place,), 1000, 4500)
                    for place in COMPLEX
                    for method in ("cone", *VARIANTS)
                )
            ),
        ),
    ),
    Claim(
        "R20",
        "complex, value: clones of the non-specialized and of med (1-6) or hi (7-10) alike to "
        "HomCNE; of hi (1-6) or the non-specialized (7-10) alike to HetCNE",
        "5.5.4",
        (
            as_cloned("clones of the non-specialized", COMPLEX, "homcne"),
            as_cloned("clones of med", COMPLEX[:6], "homcne"),
            as_cloned("clones of hi", COMPLEX[6:], "homcne"),
            as_cloned("clones of hi", COMPLEX[:6], "hetcne"),
            as_cloned("clones of the non-specialized", COMPLEX[6:], "hetcne"),
        ),
        contradiction="5.5.4 concludes that such clones do not achieve what HomCNE and HetCNE do",
    ),
    Claim(
        "R21",
        "complex, area alike: HomCNE and CCGA in 7, 9; HomCNE and MESP in 7-10; HetCNE and CCGA in "
        "7, 8; HetCNE and MESP in 7, 9",
        "5.4.2",
        (
            Part(alike("area", (COMPLEX[6], COMPLEX[8]), [("homcne", "ccga")])),
            Part(alike("area", COMPLEX[6:], [("homcne", "mesp")])),
            Part(alike("area", COMPLEX[6:8], [("hetcne", "ccga")])),
            Part(alike("area", (COMPLEX[6], COMPLEX[8]), [("hetcne", "mesp")])),
        ),
        caution="that area differs in all others is not claimed here: 5.4.1 has it alike in most",
    ),
    Claim(
        "R22",
        "settings changed by a fifth (learning), a quarter (generations, epochs) or 30 % (world): "
        "value changes by 25 % at most",
        "5.3.2",
        changes_little(COMPLEX[4], 0.25),
        caution="the thesis names no environment: judged by plans as rover-sensitivity, at each "
        "combination of levels by itself",
    ),
    Claim(
        "R23",
        "fittest CONE teams, complex: a non-specialized, a low, a med and a hi caste in all ten",
        "5.5.3",
        has_castes("all castes", COMPLEX, ("cone",)),
    ),
    Claim(
        "R24",
        "extended, area: CCGA above HomCNE in 3, 6, 7 and HetCNE in 6, 7; MESP above HomCNE in 3 "
        "and HetCNE in 7, 8",
        "5.4.3",
        (
            Part(above("area", (EXTENDED[2], *EXTENDED[5:7]), ("ccga",), ("homcne",))),
            Part(above("area", EXTENDED[5:7], ("ccga",), ("hetcne",))),
            Part(above("area", EXTENDED[2:3], ("mesp",), ("homcne",))),
            Part(above("area", EXTENDED[6:8], ("mesp",), ("hetcne",))),
        ),
        caution="left out: CCGA and MESP differ in 1, 3, 5, 7, 10, but not which is above; "
        "and a second environment of MESP and HomCNE, which is lost",
    ),
    Claim(
        "R25",
        "replacing a caste by heuristic rovers lowers area; loss CONE > CCGA, MESP > HomCNE, "
        "HetCNE",
        "5.5.3",
        (
            Part(lesioned(COMPLEX, " area")),
            Part(above("loss of area", COMPLEX, ("cone",), ISOLATED)),
            Part(above("loss of area", COMPLEX, ISOLATED, CNE)),
        ),
    ),
    Claim(
        "R26",
        "extended: multiple castes of CCGA, MESP, CONE, one caste of HomCNE and HetCNE",
        "5.4.3",
        (
            *has_castes("two castes", EXTENDED, COEVOLUTION),
            *has_castes("one caste", EXTENDED, CNE),
        ),
    ),
    Claim(
        "R27",
        "complex: CONE above CONE-1, CONE-2, CONE-3 in area",
        "5.5.5",
        (Part(above("area", COMPLEX, ("cone",), VARIANTS)),),
    ),
    Claim(
        "R28",
        "complex: every method covers most in environment 10",
        "5.4.3",
        (Part(across("area", METHODS, [(COMPLEX[9], place) for place in COMPLEX[:9]])),),
    ),
)
