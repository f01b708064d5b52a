"""Claims C1 to C3: what CONE exchanges, and whether it specializes without need, in each world.

Nitschke 2009, section 7.1.2. The last letter of an id is that of the world.

- Choice: recombination between populations is rare where at most a tenth of the pairs of
  sub-populations that could recombine do so, in the mean of a run's generations.
- Choice: genotypes had to be very similar where the mean threshold of their distance (GST) was at
  most a quarter; those of independent populations are about a third apart.
- Choice: rare and similar it is in an environment if it is so in more than half of the runs.
- Choice: "no specialization" is that most champions have not two castes, in environments that 5.4.1
  and 6.4.1 say do not encourage any.
"""

from __future__ import annotations

from conevo.report.claims.statements import Claim, Part, above
from conevo.report.claims.vocabulary import (
    COMPLEX,
    COMPLEX_9,
    SIMPLE,
    TEAMS,
    has_castes,
    lacks_castes,
)

__all__ = ["GENERAL"]

WORLDS = {"R": ("rover", COMPLEX), "P": ("pursuit", TEAMS), "G": ("gacc", COMPLEX_9)}
NEEDLESS = {"R": ("rover", "5.4.1"), "G": ("gacc", "6.4.1")}

GENERAL: tuple[Claim, ...] = (
    *(
        Claim(
            f"C1{letter}",
            f"{world}: CONE's populations recombine rarely, and genotypes had to be very similar",
            "7.1.2",
            (
                *has_castes("rare exchange", environments, ("cone",)),
                *has_castes("similar genotypes", environments, ("cone",)),
            ),
        )
        for letter, (world, environments) in WORLDS.items()
    ),
    *(
        Claim(
            f"C2{letter}",
            f"{world}: CONE develops no castes in simple environments, which need none",
            f"{section}, 7.1.2",
            lacks_castes("two castes", SIMPLE, ("cone",)),
        )
        for letter, (world, section) in NEEDLESS.items()
    ),
    *(
        Claim(
            f"C3{letter}",
            f"{world}: with both metrics populations recombine less than without one of them",
            "7.1.2",
            (Part(above("exchange", environments, ("cone-1", "cone-2"), ("cone",))),),
        )
        for letter, (world, environments) in WORLDS.items()
    ),
)
