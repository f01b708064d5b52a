"""The language in which the claims of the thesis are written: a table as text.

::

    R16 (5.5.3) complex: low castes of CCGA in 1-4 only
      has | some low | ccga | complex-1..4
      lacks | some low | ccga | complex-5..10
      caution: not a sentence of the thesis

A claim starts with its id, its source and its words. Each row below is a part of it, and the claim
holds if all parts do. A row has a kind, quantities, methods, environments, and numbers if its kind
takes them. Other lines are attributes of the claim, or continue the previous line.

===================  =============================================================================
above, alike         the first of two samples is above the second, or they are alike; "need 9" is
                     the number of environments in which all of the row must hold, if not in every
within               a mean, or a share of the runs, is in a range such as 0.2..1
about                it is near a number; a number per method, or one for all
has, lacks           most champions have certain castes, or do not have them
a : b                every a compared with every b
a ~ b                the first a compared with the first b, the second with the second ...
two of a             every two of them compared
{a}                  their runs pooled; else each by itself
===================  =============================================================================

- Choice: "in about 80 % of runs" is a share between 70 and 90 %, and a share "of the optimum" is
  given to 0.1 as well.
- Choice: "the fittest teams" have castes if the champions of more than half of the runs have them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from itertools import combinations, product
from typing import TypeVar, get_args

from conevo.report.claims.statements import Claim, Compare, Expected, Part, Sample, Within

__all__ = ["part_of", "read_claims"]

ABOUT = 0.1  # the distance from a published share that still counts as near
MOST = 0.5  # of the runs
METHODS = {
    "CNE": ("homcne", "hetcne"),
    "ISOLATED": ("ccga", "mesp"),  # populations that never share genes
    "COEVOLUTION": ("ccga", "mesp", "cone"),
    "OTHERS": ("homcne", "hetcne", "ccga", "mesp"),
    "ALL": ("homcne", "hetcne", "ccga", "mesp", "cone"),
    "VARIANTS": ("cone-1", "cone-2", "cone-3"),
}
HEAD = re.compile(r"(\w+) \(([^)]+)\) (.+)")
ATTRIBUTE = re.compile(r"(contradiction|decided|caution|other_world): (.+)")
ROW = re.compile(r"(above|alike|within|about|has|lacks) \|")
RANGE = re.compile(r"([a-z]+)-(\d+)\.\.(\d+)")

T = TypeVar("T")
Names = tuple[str, ...]


def read_claims(table: str) -> tuple[Claim, ...]:
    """Return the claims of a table.

    Raises:
        ValueError: a line is not in the language.
    """
    whole: list[str] = []
    for line in table.strip().splitlines():
        text = line.strip()
        if text and (text == line or ROW.match(text) or ATTRIBUTE.fullmatch(text)):
            whole.append(text)
        elif text:
            whole[-1] += f" {text}"
    starts = [k for k, line in enumerate(whole) if not (ROW.match(line) or ATTRIBUTE.match(line))]
    return tuple(
        _claim(whole[start:end])
        for start, end in zip(starts, [*starts[1:], len(whole)], strict=True)
    )


def part_of(row: str) -> Part:
    """Return the part of a claim that a row of a table describes.

    Raises:
        ValueError: the row is not in the language.
    """
    kind, quantities, methods, places, *numbers = (cell.strip() for cell in row.split("|"))
    if kind not in get_args(Expected):
        return _shares(kind, _listed(quantities), _sets(methods), _sets(places), *numbers)
    statements = tuple(
        Compare("above" if kind == "above" else "alike", Sample(q, m, e), Sample(r, n, f))
        for (e, f), (q, r), (m, n) in product(
            _pairs(places, _sets), _pairs(quantities, _listed), _pairs(methods, _sets)
        )
    )
    return Part(statements, *(int(number.removeprefix("need ")) for number in numbers))


def _claim(lines: Sequence[str]) -> Claim:
    head, *rest = lines
    if not (found := HEAD.fullmatch(head)):
        raise ValueError(f"not a claim: {head}")
    identity, source, text = found.groups()
    attributes = {one[1]: one[2] for line in rest if (one := ATTRIBUTE.fullmatch(line))}
    parts = tuple(part_of(line) for line in rest if ROW.match(line))
    return Claim(identity, text, source, parts, **attributes)


def _shares(
    kind: str,
    quantities: Sequence[str],
    methods: Sequence[Names],
    places: Sequence[Names],
    numbers: str = "",
) -> Part:
    """Return that quantities are in a range, the same for all methods or one for each."""
    if kind == "has":
        ranges = [(MOST, 1.0)]
    elif kind == "lacks":
        ranges = [(0.0, MOST)]
    elif kind == "about":
        ranges = [(float(x) - ABOUT, float(x) + ABOUT) for x in _listed(numbers)]
    else:
        ranges = [(float(low), float(high)) for low, _, high in [numbers.partition("..")]]
    of_methods = zip(methods, ranges * len(methods) if len(ranges) == 1 else ranges, strict=True)
    return Part(
        tuple(
            Within(Sample(quantity, method, place), low, high)
            for place, quantity, (method, (low, high)) in product(places, quantities, of_methods)
        )
    )


def _pairs(cell: str, read: Callable[[str], Sequence[T]]) -> list[tuple[T, T]]:
    """Return the pairs that a cell compares; something with itself if it names no other."""
    if cell.startswith("two of "):
        return list(combinations(read(cell.removeprefix("two of ")), 2))
    if " ~ " in cell:
        return list(zip(*map(read, cell.split(" ~ ")), strict=True))
    if " : " in cell:
        first, second = map(read, cell.split(" : "))
        return list(product(first, second))
    return [(one, one) for one in read(cell)]


def _sets(cell: str) -> list[Names]:
    """Return the methods or environments of each sample: one by one, or pooled in braces."""
    names = [name for word in _listed(cell.strip("{}")) for name in _expanded(word)]
    return [tuple(names)] if cell.startswith("{") else [(name,) for name in names]


def _listed(cell: str) -> list[str]:
    return [word.strip() for word in cell.split(",")]


def _expanded(word: str) -> Names:
    """Return the methods of a group, the environments of a range, or the only name."""
    if found := RANGE.fullmatch(word):
        family, first, last = found.groups()
        return tuple(f"{family}-{n}" for n in range(int(first), int(last) + 1))
    return METHODS.get(word, (word,))
