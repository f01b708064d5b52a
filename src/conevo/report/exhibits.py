"""Tables and figures of a report, each with its numbers: as CSV and as rows of text.

A number is formatted in one place, its column, so that page, LaTeX and CSV cannot disagree.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic

from typing_extensions import TypeVar

from conevo import numbers
from conevo.numbers import decimals
from conevo.report.figures.style import Drawing

__all__ = [
    "Column",
    "Exhibit",
    "Figure",
    "Section",
    "Table",
    "interval",
    "number",
    "p_value",
    "plain",
    "rows_of",
    "slug",
    "with_values",
]

Item = TypeVar("Item", default=Any, contravariant=True)
Row = Mapping[str, Any]
NOTHING = "–"
MOST_OPEN = 12  # rows of a table that a page shows without being asked


def number(value: Any, digits: int | None = None) -> str:
    """Return a number with about four digits or with ``digits`` decimals, "–" for None and NaN."""
    return numbers.number(value, decimals(value or 0) if digits is None else digits, NOTHING)


def p_value(value: float | None) -> str:
    """Return a probability of error: three digits, and never 0."""
    if value is None or math.isnan(value):
        return NOTHING
    return "<0.001" if value < 0.001 else f"{value:.3f}"


def interval(value: Sequence[float | None] | None, digits: int | None = None) -> str:
    """Return a pair as "low to high"."""
    if value is None or value[0] is None or value[1] is None:
        return NOTHING
    return f"{number(value[0], digits)} to {number(value[1], digits)}"


def plain(value: Any) -> str:
    """Return text as it is; "–" for None."""
    return NOTHING if value is None else str(value)


@dataclass(frozen=True)
class Column(Generic[Item]):
    """A column of a table.

    Attributes:
        key: of the rows, and its name in CSV (a pair gets two: KEY_low, KEY_high).
        title: its heading; empty if only CSV has the column.
        show: makes the text of a cell.
        is_wide: whether it contains sentences, which need more width.
        of: returns its value for an item (``rows_of``), if that is not the attribute called key.
    """

    key: str
    title: str = ""
    show: Callable[[Any], str] = number
    is_wide: bool = False
    of: Callable[[Item], Any] | None = field(default=None, kw_only=True)

    def value(self, item: Item) -> Any:
        """Return its value for an item."""
        return self.of(item) if self.of else getattr(item, self.key)

    @property
    def is_text(self) -> bool:
        """Whether it is set to the left."""
        return self.show is plain

    def texts(self, values: Sequence[Any]) -> list[str]:
        """Return the texts of all cells: numbers with the same decimals unless sizes are far apart.

        Zeros do not count, and no number is left with less than its first two digits.
        """
        show = self.show
        flat = [x for value in values for x in (value if isinstance(value, tuple) else (value,))]
        sizes = [abs(x) for x in flat if isinstance(x, float) and math.isfinite(x) and x != 0]
        own = sorted(map(decimals, sizes))
        digits = own[len(own) // 2] if own else 0
        if not own or own[-1] - own[0] > 2 or min(sizes) < 10 ** (1 - digits):
            return [show(value) for value in values]
        if show is number:
            return [number(value, digits) for value in values]
        return [interval(v, digits) if show is interval else show(v) for v in values]


@dataclass(frozen=True)
class Exhibit:
    """A table or a figure.

    Attributes:
        name: of its files, without an ending.
        title: its subject.
        note: how to read it, with sizes and tests.
        columns: of a table's numbers.
        rows: its numbers; keys beyond those of the columns are written to CSV too.
        numbers: rows of the CSV file if they differ from those of the table.
    """

    name: str
    title: str
    note: str
    columns: Sequence[Column[Any]] = ()
    rows: Sequence[Row] = ()
    numbers: Sequence[Row] = field(default=(), kw_only=True)

    def cells(self) -> list[list[str]]:
        """Return the text of every cell."""
        shown = [
            column.texts([row.get(column.key) for row in self.rows]) for column in self.columns
        ]
        return [list(row) for row in zip(*shown, strict=True)]

    def to_csv(self) -> str:
        """Return all numbers, unrounded."""
        flat = [dict(_flat(row)) for row in self.numbers or self.rows]
        names = list(dict.fromkeys(name for row in flat for name in row))
        text = io.StringIO()
        writer = csv.DictWriter(text, names, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(flat)
        return text.getvalue()


@dataclass(frozen=True)
class Table(Exhibit):
    """A table.

    Attributes:
        is_folded: whether the page shows it only when asked; None: if it is long.
    """

    is_folded: bool | None = None

    @classmethod
    def of(
        cls,
        name: str,
        title: str,
        note: str,
        columns: Sequence[Column[Item]],
        items: Iterable[Item],
        is_folded: bool | None = None,
        numbers: Sequence[Row] = (),
    ) -> Table:
        """Return a table with a row per item."""
        shown = [column for column in columns if column.title]
        return cls(name, title, note, shown, rows_of(columns, items), is_folded, numbers=numbers)

    @property
    def is_open(self) -> bool:
        """Whether the page shows it without being asked."""
        return len(self.rows) <= MOST_OPEN if self.is_folded is None else not self.is_folded


@dataclass(frozen=True)
class Figure(Exhibit):
    """A figure.

    Attributes:
        drawing: its two formats.
    """

    drawing: Drawing = field(kw_only=True)


@dataclass(frozen=True)
class Section:
    """A part of a report: text, exhibits and subsections.

    Attributes:
        title: its heading.
        text: paragraphs.
        exhibits: tables and figures in order.
        sections: its subsections.
        preformatted: text shown unchanged, such as commands.
        name: where links go, if not after the title.
    """

    title: str
    text: Sequence[str] = ()
    exhibits: Sequence[Exhibit] = ()
    sections: Sequence[Section] = ()
    preformatted: str = ""
    name: str = ""

    @property
    def anchor(self) -> str:
        """Where links go."""
        return self.name or slug(self.title)

    def all_exhibits(self) -> list[Exhibit]:
        """Return the exhibits of the section and of its parts, in order."""
        return [*self.exhibits, *(one for part in self.sections for one in part.all_exhibits())]


def rows_of(columns: Sequence[Column[Item]], items: Iterable[Item]) -> list[dict[str, Any]]:
    """Return a row of numbers for each item: the value of every column."""
    return [{column.key: column.value(item) for column in columns} for item in items]


def with_values(columns: Sequence[Column[Item]], rows: Sequence[Row]) -> list[Column[Item]]:
    """Return the columns with a title that have a value in one of the rows."""
    return [
        column
        for column in columns
        if column.title and any(row[column.key] not in (None, (None, None)) for row in rows)
    ]


def slug(text: str) -> str:
    """Return a name for files and links: small letters, digits, "-"."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def _flat(row: Row) -> list[tuple[str, Any]]:
    """Return a row with pairs in two columns and None as nothing."""
    flat: list[tuple[str, Any]] = []
    for key, value in row.items():
        if isinstance(value, tuple):
            flat += [(f"{key}_low", _cell(value[0])), (f"{key}_high", _cell(value[1]))]
        else:
            flat.append((key, _cell(value)))
    return flat


def _cell(value: Any) -> Any:
    """Return a value as CSV has it: ten digits, which hide the last bits of a sum."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.10g}" if isinstance(value, float) else value
