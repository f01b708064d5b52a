"""Building plans of the environments of gacc: complex objects and their parts.

Nitschke 2009, tables 6.6 to 6.8, section 6.4.2. The objects of an environment are exactly the parts
of its complex objects, ten each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["ENVIRONMENTS", "N_OBSTACLES", "PARTS", "TYPES", "BuildingPlan", "plan"]

TYPES = "ABC"
PARTS = 10  # of a complex object
N_OBSTACLES = 10  # in every complex environment but the first

# Choice: table 6.6 has lost its numbers: 10, 20, 30 objects of each type, then 40 of type A.
SIMPLE = ("A", "B", "C", "AA", "BB", "CC", "AAA", "BBB", "CCC", "AAAA")

# Table 6.8: build sequences; a disordered complex object takes its parts in any order (6.4.2).
COMPLEX = (
    ("CCACBCBCCC",),
    ("CAACBBBCBC",),
    ("BABAABCBBB",),
    ("BAABAACAAC", "ACCCCCCCCA"),
    ("BAABAABAAB", "CACACACACC"),
    ("BAAAAAAAAB", "CABBBBBBAC", "CBBBBBBBBC"),
    ("CACACBCBCB", "CABABABABB", "BABABABACC"),
    ("BABACABACB", "CACACABABC", "BABABABACB", "CABACABABC"),
    ("BABACABABB", "CACACABABB", "BABABABACB", "BABABBBABB"),
)
# Choice: the thesis does not state which of several is the disordered one: the last.
DISORDERED = {1: 0, 2: 0, 4: 1, 6: 2, 8: 3}

ENVIRONMENTS = tuple(f"simple-{n}" for n in range(1, len(SIMPLE) + 1)) + tuple(
    f"complex-{n}" for n in range(1, len(COMPLEX) + 1)
)


@dataclass(frozen=True)
class BuildingPlan:
    """The building plan of one environment.

    Attributes:
        parts: [C, 10] int32, type (0..2) of each part of each complex object, in order.
        is_ordered: for each complex object, whether its parts must come in that order.
        n_obstacles: obstacles in the environment.
    """

    parts: npt.NDArray[np.int32]
    is_ordered: tuple[bool, ...]
    n_obstacles: int

    @property
    def object_types(self) -> npt.NDArray[np.int32]:
        """Type of every object of the environment [K], all of A first."""
        return np.sort(self.parts.ravel())


def plan(environment: str) -> BuildingPlan:
    """Return the building plan of an environment like "complex-4"."""
    kind, _, number = environment.partition("-")
    n = int(number)
    is_simple = kind == "simple"
    sequences = [PARTS * letter for letter in SIMPLE[n - 1]] if is_simple else COMPLEX[n - 1]
    disordered = None if is_simple else DISORDERED.get(n)
    return BuildingPlan(
        parts=np.array([[TYPES.index(one) for one in each] for each in sequences], dtype=np.int32),
        is_ordered=tuple(c != disordered for c in range(len(sequences))),
        n_obstacles=0 if is_simple or n == 1 else N_OBSTACLES,
    )
