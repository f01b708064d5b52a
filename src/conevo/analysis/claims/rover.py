"""Claims R1 to R13: multi-rover.

Nitschke 2009, sections 5.4 and 5.5, appendix C.

- Choice: "in complex than in simple environments" compares environments of the same number, which
  have the same canals (table C-11).
- Choice: "most environments" are more than half of them, each with all ten pairs of methods.
- Choice: castes of rovers specialized to moving do not count (5.5.2).
- Choice: clones are those of CONE's champions (5.5.4), of each run the best team of clones stands
  for all; "of one specialist" leaves out the non-specialized.
"""

from __future__ import annotations

from itertools import combinations

from conevo.analysis.claims.cases import (
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
    cloned,
    has_castes,
    lesioned,
)
from conevo.analysis.claims.statements import Claim, Part, above, across, alike

__all__ = ["ROVER"]

ROVER: tuple[Claim, ...] = (
    Claim(
        "R1",
        "complex 1-10: value detected by CONE above each of HomCNE, HetCNE, CCGA, MESP",
        "5.4.2",
        "rover",
        (Part(above("value", COMPLEX, ("cone",), OTHERS)),),
        caution="value only; 5.4.2 names task performance, which is value and area",
    ),
    Claim(
        "R2",
        "complex: CCGA and MESP alike in value (at least 9 of 10 environments)",
        "5.4.2",
        "rover",
        (Part(alike("value", COMPLEX, [ISOLATED]), need=9),),
    ),
    Claim(
        "R3",
        "complex: each of CCGA, MESP, CONE above HomCNE and HetCNE in value",
        "5.4.2",
        "rover",
        (Part(above("value", COMPLEX, COEVOLUTION, CNE)),),
    ),
    Claim(
        "R4",
        "HomCNE and HetCNE alike in value, simple and complex",
        "5.4.1",
        "rover",
        (Part(alike("value", SIMPLE + COMPLEX, [CNE])),),
    ),
    Claim(
        "R5",
        "CCGA, MESP, CONE detect more value in complex than in simple environments",
        "5.4.1",
        "rover",
        (Part(across("value", COEVOLUTION, zip(COMPLEX, SIMPLE, strict=True))),),
        decided=BY_WORLD,
    ),
    Claim(
        "R6",
        "area covered alike among the five methods in most simple and complex environments",
        "5.4.1",
        "rover",
        (Part(alike("area", SIMPLE + COMPLEX, combinations(METHODS, 2)), need=11),),
        contradiction="5.4.1 has it alike in most environments, 5.4.2 in some of 7 to 10 only",
    ),
    Claim(
        "R7",
        "extended 1-10: CONE above all others in value",
        "5.4.3",
        "rover",
        (Part(above("value", EXTENDED, ("cone",), OTHERS)),),
    ),
    Claim(
        "R8",
        "extended: CCGA and MESP alike (9 of 10), both above HomCNE and HetCNE",
        "5.4.3",
        "rover",
        (
            Part(alike("value", EXTENDED, [ISOLATED]), need=9),
            Part(above("value", EXTENDED, ISOLATED, CNE)),
        ),
    ),
    Claim(
        "R9",
        "fittest CONE teams, complex: one non-specialized and at least two specialized castes",
        "5.5.2",
        "rover",
        has_castes("several castes", COMPLEX, ("cone",)),
        caution="tables 5.15 and 5.16 show three specialized castes in all ten environments",
    ),
    Claim(
        "R10",
        "fittest HomCNE and HetCNE teams consist of one caste",
        "5.4.1",
        "rover",
        has_castes("one caste", SIMPLE + COMPLEX, CNE),
        caution="tables 5.7 and 5.8 name the caste: med or hi; here any one caste counts",
    ),
    Claim(
        "R11",
        "replacing a caste by heuristic rovers lowers value; loss CONE > CCGA, MESP > HomCNE, "
        "HetCNE",
        "5.5.3",
        "rover",
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
        "rover",
        (Part(cloned("clones of a specialist", COMPLEX, COEVOLUTION)),),
    ),
    Claim(
        "R13",
        "complex: CONE above CONE-1, CONE-2, CONE-3 in value",
        "5.5.5",
        "rover",
        (Part(above("value", COMPLEX, ("cone",), VARIANTS)),),
    ),
)
