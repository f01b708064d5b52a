"""Tables and figures of a report, each with its numbers: as CSV, as LaTeX, as rows of text.

A number is formatted in one place, its column, so that page, LaTeX and CSV cannot disagree.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from conevo.analysis.drawing import Drawing

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
    "slug",
    "to_latex",
    "with_values",
]

Row = Mapping[str, Any]
NOTHING = "–"
LATEX_ROWS = 40  # that fit on a page
LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": "$<$",
    ">": "$>$",
    "±": r"$\pm$",
    "–": "--",
    "−": "$-$",
    "≤": r"$\le$",
    "≥": r"$\ge$",
    "×": r"$\times$",
    "·": r"$\cdot$",
}


def number(value: Any) -> str:
    """Return a number as people read it: about four digits; "–" for None and NaN."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return NOTHING
    if isinstance(value, int):
        return f"{value:,}"
    if value == 0:
        return "0"
    size = abs(value)
    digits = 0 if size >= 1000 else 1 if size >= 100 else 2 if size >= 1 else 3
    return f"{value:,.{digits}f}"


def p_value(value: float | None) -> str:
    """Return a probability of error: three digits, and never 0."""
    if value is None or math.isnan(value):
        return NOTHING
    return "<0.001" if value < 0.001 else f"{value:.3f}"


def interval(value: Sequence[float | None] | None) -> str:
    """Return a pair as "low to high"."""
    if value is None or value[0] is None or value[1] is None:
        return NOTHING
    return f"{number(value[0])} to {number(value[1])}"


def plain(value: Any) -> str:
    """Return text as it is; "–" for None."""
    return NOTHING if value is None else str(value)


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        key: of the rows, and its name in CSV (a pair gets two: KEY_low, KEY_high).
        title: above it.
        show: makes the text of a cell.
        is_wide: whether it holds sentences, which need a width of their own.
    """

    key: str
    title: str
    show: Callable[[Any], str] = number
    is_wide: bool = False

    @property
    def is_text(self) -> bool:
        """Whether it is set to the left."""
        return self.show is plain


@dataclass(frozen=True)
class Exhibit:
    """A table or a figure.

    Attributes:
        name: of its files, without an ending.
        title: what it shows.
        note: how to read it, with sizes and tests.
        columns: of its numbers.
        rows: its numbers; keys beyond those of the columns are written to CSV too.
        numbers: what CSV has if that is not the rows.
    """

    name: str
    title: str
    note: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    numbers: Sequence[Row] = field(default=(), kw_only=True)

    def cells(self) -> list[list[str]]:
        """Return the text of every cell."""
        return [[column.show(row.get(column.key)) for column in self.columns] for row in self.rows]

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
        is_open: whether the page shows it without being asked.
    """

    is_open: bool = True


@dataclass(frozen=True)
class Figure(Exhibit):
    """A figure.

    Attributes:
        drawing: its two formats.
    """

    drawing: Drawing = field(kw_only=True)


@dataclass(frozen=True)
class Section:
    """A part of a report: text, exhibits and parts of its own.

    Attributes:
        title: its heading.
        text: paragraphs.
        exhibits: tables and figures in order.
        sections: parts of it.
        preformatted: text that stands as it is, such as commands.
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


def with_values(columns: Sequence[Column], rows: Sequence[Row]) -> list[Column]:
    """Return the columns that have a value in one of the rows."""
    return [
        column
        for column in columns
        if any(row.get(column.key) not in (None, (None, None)) for row in rows)
    ]


def slug(text: str) -> str:
    """Return a name for files and links: small letters, digits, "-"."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def to_latex(table: Table) -> str:
    """Return a table for LaTeX without packages, in parts that fit on a page."""
    cells = table.cells()
    parts = [cells[k : k + LATEX_ROWS] for k in range(0, max(len(cells), 1), LATEX_ROWS)]
    wide = min(0.3, 0.7 / max(sum(column.is_wide for column in table.columns), 1))
    spec = "".join(
        rf"p{{{wide:.2f}\textwidth}}" if column.is_wide else "l" if column.is_text else "r"
        for column in table.columns
    )
    head = " & ".join(_escaped(column.title) for column in table.columns)
    size = r"\footnotesize" if len(table.columns) <= 8 else r"\scriptsize"
    lines = []
    for k, part in enumerate(parts):
        caption = f"{table.title}. {table.note}" if k == 0 else f"{table.title}, continued."
        lines += [
            r"\begin{table}[htbp]",
            rf"\caption{{{_escaped(caption)}}}",
            *([rf"\label{{tab:{table.name}}}"] if k == 0 else []),
            rf"\centering{size}\setlength{{\tabcolsep}}{{{3 if len(table.columns) <= 8 else 2}pt}}",
            rf"\begin{{tabular}}{{{spec}}}",
            r"\hline",
            rf"{head} \\",
            r"\hline",
            *(" & ".join(map(_escaped, row)) + r" \\" for row in part),
            r"\hline",
            r"\end{tabular}",
            r"\end{table}",
            "",
        ]
    return "\n".join(lines)


def _escaped(text: str) -> str:
    return "".join(LATEX.get(letter, letter) for letter in text)


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
