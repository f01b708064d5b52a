"""Red rocks: the values of the five types, and the number of each in the 40 environments.

Nitschke 2009, sections 5.1, 5.4 and table 5.1. The total red rock value of every environment is
5000 (table 5.4). A simple environment contains only type E, a complex one types A to D. The counts
of table 5.6 are lost.

``simple-e`` and ``complex-e`` use canal layout e. All extended environments use layout 10, the
least structured: they vary types, not places. Choice: the ten extended mixes, derived from 500 of
each type A to D, whole rocks, value exactly 5000:

============  ====================================  ====  ====  ====  ====
environment   rule                                     A     B     C     D
============  ====================================  ====  ====  ====  ====
extended-1    equal counts                           500   500   500   500
extended-2    value share of A doubled (10 to 20 %) 1000   444   444   445
extended-3    value share of B doubled (20 to 40 %)  375  1000   375   375
extended-4    value share of C doubled (30 to 60 %)  286   285  1000   286
extended-5    value share of D doubled (40 to 80 %)  167   166   167  1000
extended-6    no A, the others equal                   0   556   556   555
extended-7    no B, the others equal                 625     0   625   625
extended-8    no C, the others equal                 714   715     0   714
extended-9    no D, the others equal                 833   834   833     0
extended-10   A and D only, equal                   1000     0     0  1000
============  ====================================  ====  ====  ====  ====

Choice: ``apart-e`` is not in the thesis. It has the rocks and canals of ``complex-e`` and its own
defaults, ``APART``, with which a division of labour pays.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from conevo.errors import unknown_name

__all__ = ["APART", "DEFAULTS", "ENVIRONMENTS", "TYPES", "VALUES", "Mix", "layout", "mix"]

TYPES = ("A", "B", "C", "D", "E")
VALUES = (1, 2, 3, 4, 1)  # Nitschke 2009, table 5.1


class Mix(NamedTuple):
    """Number of rocks of each type."""

    A: int = 0
    B: int = 0
    C: int = 0
    D: int = 0
    E: int = 0


_EXTENDED = (
    Mix(500, 500, 500, 500),
    Mix(1000, 444, 444, 445),
    Mix(375, 1000, 375, 375),
    Mix(286, 285, 1000, 286),
    Mix(167, 166, 167, 1000),
    Mix(0, 556, 556, 555),
    Mix(625, 0, 625, 625),
    Mix(714, 715, 0, 714),
    Mix(833, 834, 833, 0),
    Mix(1000, 0, 0, 1000),
)

# environment -> (canal layout, mix)
_TABLE = (
    {f"simple-{e}": (e, Mix(E=5000)) for e in range(1, 11)}
    | {f"complex-{e}": (e, Mix(500, 500, 500, 500)) for e in range(1, 11)}
    | {f"extended-{e}": (10, counts) for e, counts in enumerate(_EXTENDED, 1)}
    | {f"apart-{e}": (e, Mix(500, 500, 500, 500)) for e in range(1, 11)}
)

ENVIRONMENTS = tuple(_TABLE)

# With these settings teams of castes by place surpass teams of generalists, without any evolution
# (docs/results/calibration.md). The gains of evolved teams are in docs/results/specialists.md.
APART: dict[str, Any] = {
    "segregation": 1.0,  # each type has a place: where types are mixed, switchers gain more
    "starts": "by_robot",  # a population learns for one place: with random starts for none
    "low_range": 0.10,  # the only ranges at which the best blind castes surpass the best switchers:
    "med_range": 0.08,  # with smaller ones no team finds more than a twentieth of the value, with
    "hi_range": 0.06,  # larger ones a contact lasts so long that a switcher finds all types in it
    "low_accuracy": 0.1,  # a contact lasts no longer than a detection takes, so that a specialist
    "med_accuracy": 0.2,  # is never idle: time with a rock is worth something
    "hi_accuracy": 0.3,
    "fitness": "value",  # eq. 5.4 also pays for the area covered, that is, for leaving one's place
}
DEFAULTS = {name: APART for name in ENVIRONMENTS if name.startswith("apart-")}


def mix(environment: str) -> Mix:
    """Return the number of rocks of each type A to E in an environment (total value 5000).

    Raises:
        UsageError: the environment is unknown.
    """
    return _look_up(environment)[1]


def layout(environment: str) -> int:
    """Return the number of an environment's canal layout, 1 to 10.

    Raises:
        UsageError: the environment is unknown.
    """
    return _look_up(environment)[0]


def _look_up(environment: str) -> tuple[int, Mix]:
    if environment not in _TABLE:
        raise unknown_name("rover environment", environment, ENVIRONMENTS)
    return _TABLE[environment]
