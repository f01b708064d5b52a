"""Claims G1 to G9: gathering and collective construction.

Nitschke 2009, sections 6.4 and 6.5, appendix D.

- Choice: "in complex than in simple environments" compares environments of the same number (table
  D-15), by the share of what could be delivered: they have not the same number of objects.
- Choice: "several castes" are at least two, as in R9.
- Choice: clones are those of CONE's champions (6.5.5), the non-specialized among them; of each run
  the best team of clones stands for all.
"""

from __future__ import annotations

from conevo.analysis.claims.cases import (
    BY_WORLD,
    CNE,
    COEVOLUTION,
    COMPLEX_9,
    ISOLATED,
    METHODS,
    OTHERS,
    SIMPLE,
    VARIANTS,
    about,
    cloned,
    has_castes,
)
from conevo.analysis.claims.statements import Claim, Part, above, across, alike

__all__ = ["GACC"]

GACC: tuple[Claim, ...] = (
    Claim(
        "G1",
        "complex 1-9: CONE delivers more in correct order than all others",
        "6.4.3",
        "gacc",
        (Part(above("delivered", COMPLEX_9, ("cone",), OTHERS)),),
    ),
    Claim(
        "G2",
        "CCGA, MESP, CONE reach a larger share of the optimum in complex than in simple "
        "environments",
        "6.4.3",
        "gacc",
        (
            Part(
                across("share of the optimum", COEVOLUTION, zip(COMPLEX_9, SIMPLE[:9], strict=True))
            ),
        ),
        decided=BY_WORLD,
    ),
    Claim(
        "G3",
        "HomCNE and HetCNE alike, simple and complex",
        "6.4.3",
        "gacc",
        (Part(alike("delivered", SIMPLE + COMPLEX_9, [CNE])),),
    ),
    Claim(
        "G4",
        "share of optimum, complex: .29 / .32 / .71 / .79 / .93 (HomCNE, HetCNE, CCGA, MESP, CONE)",
        "6.4.3",
        "gacc",
        about(
            "share of the optimum",
            COMPLEX_9,
            {"homcne": 0.29, "hetcne": 0.32, "ccga": 0.71, "mesp": 0.79, "cone": 0.93},
        ),
    ),
    Claim(
        "G5",
        "share of optimum, simple: .48 / .47 / .51 / .54 / .55",
        "6.4.3",
        "gacc",
        about(
            "share of the optimum",
            SIMPLE,
            {"homcne": 0.48, "hetcne": 0.47, "ccga": 0.51, "mesp": 0.54, "cone": 0.55},
        ),
        decided=BY_WORLD,
    ),
    Claim(
        "G6",
        "fittest CONE teams, complex: one non-specialized and several specialized castes",
        "6.4.3",
        "gacc",
        has_castes("several castes", COMPLEX_9, ("cone",)),
    ),
    Claim(
        "G7",
        "lesioning castes costs CONE teams more than CCGA and MESP teams (tables 6.9-6.13)",
        "6.5.4",
        "gacc",
        (Part(above("loss", COMPLEX_9, ("cone",), ISOLATED)),),
    ),
    Claim(
        "G8",
        "cloned teams deliver less than evolved teams of every method",
        "6.5.5",
        "gacc",
        (Part(cloned("clones", COMPLEX_9, METHODS)),),
        contradiction="6.5.5 ends with non-specialized clones alike to HomCNE and HetCNE",
    ),
    Claim(
        "G9",
        "CONE above CONE-1, CONE-2, CONE-3 in all complex environments",
        "6.5.6",
        "gacc",
        (Part(above("delivered", COMPLEX_9, ("cone",), VARIANTS)),),
    ),
)
