"""Claims G1 to G16: gathering and collective construction.

Nitschke 2009, sections 6.4 and 6.5, appendix D.

- Choice: "in complex than in simple environments" compares environments of the same number (table
  D-15), by the share of what could be delivered: they have not the same number of objects.
- Choice: "several castes" are at least two, as in R9.
- Choice: clones are those of CONE's champions (6.5.5), the non-specialized among them; of each run
  the best team of clones stands for all.
- Choice: castes of a type are those that all of tables 6.11 to 6.13 have a number for; where they
  have none (NA), most champions have no robot specialized to the type.
- Choice: direct evolution fails where teams that learned the environments in turn deliver more. In
  the first one both are the same.
"""

from __future__ import annotations

from conevo.report.claims.statements import Claim, Compare, Part, Sample, above, across, alike
from conevo.report.claims.vocabulary import (
    BY_WORLD,
    CNE,
    COEVOLUTION,
    COMPLEX,
    COMPLEX_9,
    ISOLATED,
    METHODS,
    OTHERS,
    SIMPLE,
    VARIANTS,
    about,
    as_cloned,
    changes_little,
    cloned,
    has_castes,
    lacks_castes,
)

__all__ = ["GACC"]

TYPES = ("C", "BC", "AB", "AC", "ABC", "ABC", "AB", "ABC", "ABC")  # with castes, complex-1 to -9
NO_CONSTRUCTORS = {("complex-6", "C"): COEVOLUTION, ("complex-9", "C"): ("ccga",)}


def _castes_of_types() -> tuple[Part, ...]:
    """Return: there are castes of some types, and none of the others."""
    parts: list[Part] = []
    for place, types in zip(COMPLEX_9, TYPES, strict=True):
        for kind in "ABC":
            if kind not in types:
                parts += lacks_castes(f"any of {kind}", (place,), COEVOLUTION)
                continue
            without = NO_CONSTRUCTORS.get((place, kind), ())
            builders = tuple(method for method in COEVOLUTION if method not in without)
            parts += has_castes(f"detectors and gatherers of {kind}", (place,), COEVOLUTION)
            parts += has_castes(f"constructors of {kind}", (place,), builders) if builders else ()
    return tuple(parts)


GACC: tuple[Claim, ...] = (
    Claim(
        "G1",
        "complex 1-9: CONE delivers more in correct order than all others",
        "6.4.3",
        (Part(above("delivered", COMPLEX_9, ("cone",), OTHERS)),),
    ),
    Claim(
        "G2",
        "CCGA, MESP, CONE reach a larger share of the optimum in complex than in simple "
        "environments",
        "6.4.3",
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
        (Part(alike("delivered", SIMPLE + COMPLEX_9, [CNE])),),
    ),
    Claim(
        "G4",
        "share of optimum, complex: .29 / .32 / .71 / .79 / .93 (HomCNE, HetCNE, CCGA, MESP, CONE)",
        "6.4.3",
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
        has_castes("several castes", COMPLEX_9, ("cone",)),
        caution="table 6.13 has no non-specialized caste in environment 9",
    ),
    Claim(
        "G7",
        "lesioning castes costs CONE teams more than CCGA and MESP teams (tables 6.9-6.13)",
        "6.5.4",
        (Part(above("loss", COMPLEX_9, ("cone",), ISOLATED)),),
    ),
    Claim(
        "G8",
        "cloned teams deliver less than evolved teams of every method",
        "6.5.5",
        (Part(cloned("clones", COMPLEX_9, METHODS)),),
        contradiction="6.5.5 ends with non-specialized clones alike to HomCNE and HetCNE",
    ),
    Claim(
        "G9",
        "CONE above CONE-1, CONE-2, CONE-3 in all complex environments",
        "6.5.6",
        (Part(above("delivered", COMPLEX_9, ("cone",), VARIANTS)),),
    ),
    Claim(
        "G10",
        "fittest HomCNE and HetCNE teams: all non-specialized in complex 1-9, one caste in simple "
        "environments",
        "6.5.2, 6.5.4",
        (
            *has_castes("only non-specialized", COMPLEX_9, CNE),
            *has_castes("one caste", SIMPLE, CNE),
        ),
    ),
    Claim(
        "G11",
        "fittest CCGA, MESP, CONE teams, complex: detectors, gatherers and constructors of types "
        "B and C in 2, A and B in 3 and 7, A and C in 4, C alone in 1, all in 5, 6, 8, 9",
        "6.5.4",
        _castes_of_types(),
        caution="constructors of C are not claimed in 6, nor of CCGA in 9, as tables 6.11 to 6.13 "
        "have none",
    ),
    Claim(
        "G12",
        "complex: direct evolution fails, shaping does not",
        "6.4.2",
        (
            Part(
                tuple(
                    Compare(
                        "above",
                        Sample("delivered after shaping", (method,), (place,)),
                        Sample("delivered directly", (method,), (place,)),
                    )
                    for place in COMPLEX[1:8]
                    for method in METHODS
                )
            ),
        ),
        caution="judged by plans as gacc-shaping, in which direct runs have the budget of a stage",
    ),
    Claim(
        "G13",
        "lesioning castes costs HomCNE and HetCNE teams least",
        "6.5.4",
        (Part(above("loss", COMPLEX_9, COEVOLUTION, CNE)),),
    ),
    Claim(
        "G14",
        "settings changed by a fifth: objects delivered change by 9 % at most",
        "6.3.2",
        changes_little(COMPLEX[0], 0.09),
        caution="the thesis names no environment: judged by plans as gacc-sensitivity, at each "
        "combination of levels by itself",
    ),
    Claim(
        "G15",
        "clones of the non-specialized deliver as much as HomCNE and HetCNE teams",
        "6.5.5",
        tuple(as_cloned("clones of the non-specialized", COMPLEX_9, method) for method in CNE),
        contradiction="6.5.5 begins with all teams of clones below all evolved ones",
    ),
    Claim(
        "G16",
        "complex: multiple castes of CCGA, MESP, CONE, one caste of HomCNE and HetCNE",
        "6.4.3, 6.5.2",
        (
            *has_castes("two castes", COMPLEX_9, COEVOLUTION),
            *has_castes("one caste", COMPLEX_9, CNE),
        ),
    ),
)
