"""What claims are about: the methods, the environments, and statements that several claims make.

- Choice: "in about 80 % of runs" is a share between 70 and 90 %, and a share "of the optimum" is
  given to 0.1 as well.
"""

from __future__ import annotations

from itertools import product

from conevo.report.claims.statements import Compare, Part, comparison, within

__all__ = [
    "BY_WORLD",
    "CNE",
    "COEVOLUTION",
    "COMPLEX",
    "COMPLEX_9",
    "EXTENDED",
    "ISOLATED",
    "METHODS",
    "ONE_PREY",
    "OTHERS",
    "SIMPLE",
    "TEAMS",
    "TWO_PREY",
    "VARIANTS",
    "about",
    "as_cloned",
    "changes_little",
    "cloned",
    "has_castes",
    "has_only_in",
    "lacks_castes",
    "lesioned",
    "teams",
]

CNE = ("homcne", "hetcne")
ISOLATED = ("ccga", "mesp")  # populations that never share genes
COEVOLUTION = (*ISOLATED, "cone")
OTHERS = (*CNE, *ISOLATED)
METHODS = (*OTHERS, "cone")
VARIANTS = ("cone-1", "cone-2", "cone-3")

ABOUT = 0.1  # how far from a published share a share may be
MOST = 0.5  # of the runs
BY_WORLD = "heuristic teams, which nothing evolved, also differ between the two families"


def _named(family: str) -> tuple[str, ...]:
    return tuple(f"{family}-{n}" for n in range(1, 11))


def teams(*numbers: int) -> tuple[str, ...]:
    """Return team types of pursuit-evasion by number."""
    return tuple(f"team-{n}" for n in numbers)


SIMPLE = _named("simple")
COMPLEX = _named("complex")
EXTENDED = _named("extended")
COMPLEX_9 = COMPLEX[:9]  # of gathering and collective construction
ONE_PREY = teams(1, 2, 3, 4, 5)
TWO_PREY = teams(6, 7, 8, 9, 10)  # with as many predators, in the same order
TEAMS = ONE_PREY + TWO_PREY


def about(
    quantity: str, environments: tuple[str, ...], shares: dict[str, float]
) -> tuple[Part, ...]:
    """Return: each method's quantity over all environments together is about its share."""
    return tuple(
        Part((within(quantity, method, environments, share - ABOUT, share + ABOUT),))
        for method, share in shares.items()
    )


def changes_little(place: str, most: float) -> tuple[Part, ...]:
    """Return: of changed settings each method's main measure changes by a share at most."""
    return (Part(tuple(within("change", method, (place,), -most, most) for method in METHODS)),)


def lesioned(environments: tuple[str, ...], of: str = "") -> tuple[Compare, ...]:
    """Return: in each environment each method's teams lose by a caste's replacement, of a measure.

    Args:
        environments: of the teams.
        of: " area", say; empty is the world's main measure.
    """
    return tuple(
        comparison("above", (f"whole{of}", method), (f"lesioned{of}", method), place)
        for place, method in product(environments, METHODS)
    )


def cloned(
    clones: str, environments: tuple[str, ...], methods: tuple[str, ...]
) -> tuple[Compare, ...]:
    """Return: in each environment each method's teams are above clones of CONE's robots."""
    return tuple(
        comparison("above", ("evolved", method), (clones, "cone"), place)
        for place, method in product(environments, methods)
    )


def as_cloned(clones: str, environments: tuple[str, ...], method: str) -> Part:
    """Return: in each environment clones of CONE's robots are alike to a method's teams."""
    own = [comparison("alike", (clones, "cone"), ("evolved", method), p) for p in environments]
    return Part(tuple(own))


def has_castes(
    castes: str, environments: tuple[str, ...], methods: tuple[str, ...]
) -> tuple[Part, ...]:
    """Return: in each environment most champions of each method have these castes.

    Choice: "the fittest teams" have them if the champions of more than half of the runs do.
    """
    return _champions(castes, environments, methods, MOST, 1)


def lacks_castes(
    castes: str, environments: tuple[str, ...], methods: tuple[str, ...]
) -> tuple[Part, ...]:
    """Return: in each environment most champions of each method do not have these castes."""
    return _champions(castes, environments, methods, 0, MOST)


def has_only_in(
    castes: str, numbers: range, environments: tuple[str, ...], method: str
) -> tuple[Part, ...]:
    """Return: the champions of a method have these castes in some environments, in others not.

    Args:
        castes: that most champions have, or have not.
        numbers: of the environments where they do, from 1.
        environments: all of a family, in order.
        method: whose champions.
    """
    of = dict(enumerate(environments, start=1))
    there = tuple(place for n, place in of.items() if n in numbers)
    elsewhere = tuple(place for n, place in of.items() if n not in numbers)
    return (
        *has_castes(castes, there, (method,)),
        *(lacks_castes(castes, elsewhere, (method,)) if elsewhere else ()),
    )


def _champions(
    castes: str, environments: tuple[str, ...], methods: tuple[str, ...], low: float, high: float
) -> tuple[Part, ...]:
    pairs = product(environments, methods)
    return (Part(tuple(within(castes, method, (place,), low, high) for place, method in pairs)),)
