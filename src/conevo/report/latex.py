"""Tables and figures of a report for LaTeX: booktabs, captions that a paper can take.

A table is at most as wide as ``TEXT_WIDTH``, in letters of Computer Modern. Headings are broken
into lines, sentences into paragraphs. A table that is still too wide is split by columns, and each
part repeats the columns that name its rows. Tables need the packages array and booktabs, figures
graphicx, and the document of all of them hyperref.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from conevo.report.exhibits import Column, Figure, Section, Table

__all__ = ["document", "figures_to_latex", "to_latex"]

TEXT_WIDTH = 345.0  # points: of the class article at 10 points, narrower than most journals'
MOST_LINES = 40  # of a table that fit on a page with its caption
MOST_FLOATS = 12  # that LaTeX can hold back at a time
LEAST = 58.0  # points that a paragraph in a cell needs
# Letters, how wide they are (small ones are wider for their height), half a gap between columns.
SIZES = ((r"\footnotesize", 8.9, 3.0), (r"\scriptsize", 8.4, 2.0))
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
    "|": r"\textbar{}",
    "<": "$<$",
    ">": "$>$",
    "±": r"$\pm$",
    "–": "--",
    "—": "---",
    "−": "$-$",
    "≤": r"$\le$",
    "≥": r"$\ge$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "→": r"$\to$",
    "…": r"\ldots{}",
    "“": "``",
    "”": "''",
    "‘": "`",
    "’": "'",
}
WIDTHS = {  # thousandths of the letters' height, in Computer Modern
    **dict.fromkeys("il.,;:'!|", 0.278),
    **dict.fromkeys("fjrst()[]-/ ", 0.39),
    **dict.fromkeys("cez", 0.444),
    **dict.fromkeys("mwMW%", 0.87),
    **dict.fromkeys("<>±−≤≥×=+", 0.778),
    **dict.fromkeys("ABCDEFGHJKLNOPQRSTUVXYZ", 0.75),
}


class _Part(NamedTuple):
    """Columns of a table that fit side by side: which, how each is set, and in which letters."""

    columns: list[int]
    specs: list[str]
    size: str
    gap: float
    heads: list[str]
    lines: list[int]  # of every row


def to_latex(table: Table) -> str:
    """Return a table, in parts that fit on a page: by columns, then by rows."""
    cells = table.cells()
    made: list[str] = []
    floats = 0
    for part in _parts(table, cells):
        for rows in _pages(part.lines):
            floats += 1
            if floats % MOST_FLOATS == 0:
                made.append(r"\clearpage")
            caption = (
                f"{table.title}. {table.note}" if floats == 1 else f"{table.title}, continued."
            )
            made += [
                r"\begin{table}[htbp]",
                r"\centering",
                rf"\caption[{_escaped(table.title)}]{{{_escaped(caption)}}}",
                *([rf"\label{{tab:{table.name}}}"] if floats == 1 else []),
                rf"{part.size}\setlength{{\tabcolsep}}{{{part.gap:g}pt}}",
                rf"\begin{{tabular}}{{@{{}}{''.join(part.specs)}@{{}}}}",
                r"\toprule",
                " & ".join(part.heads) + r" \\",
                r"\midrule",
                *_body([cells[row] for row in rows], part.columns),
                r"\bottomrule",
                r"\end{tabular}",
                r"\end{table}",
                "",
            ]
    return "\n".join(made)


def figures_to_latex(figures: Sequence[Figure]) -> str:
    """Return all figures with their captions; those as wide as a page span both of its columns."""
    made: list[str] = []
    for one in figures:
        kind, width = ("figure*", "textwidth") if one.drawing.is_wide else ("figure", "columnwidth")
        made += [
            rf"\begin{{{kind}}}[htbp]",
            r"\centering",
            rf"\includegraphics[width=\{width}]{{figures/{one.name}.pdf}}",
            rf"\caption[{_escaped(one.title)}]{{{_escaped(f'{one.title}. {one.note}')}}}",
            rf"\label{{fig:{one.name}}}",
            rf"\end{{{kind}}}",
            "",
        ]
    return "\n".join(made)


def document(title: str, sections: Sequence[Section]) -> str:
    """Return a document of all tables and figures, to be compiled next to them.

    In the order of the page and under its headings, which are in the contents and the bookmarks.
    """
    return "\n".join([
        r"\documentclass[10pt]{article}",
        r"\usepackage{array,booktabs,graphicx}",
        r"\usepackage[hidelinks]{hyperref}",
        r"\begin{document}",
        rf"\section*{{{_escaped(title)}}}",
        r"\tableofcontents",
        r"\clearpage",
        *(line for section in sections for line in _inside(section, 0)),
        r"\end{document}",
        "",
    ])  # fmt: skip


def _inside(section: Section, level: int) -> Iterator[str]:
    """Yield a heading and what is below it; nothing without a table or figure."""
    shown = [one for one in section.exhibits if one.rows]
    if not any(one.rows for one in section.all_exhibits()):
        return
    yield rf"\{'sub' * level}section{{{_escaped(section.title)}}}"
    yield r"\suppressfloats[t]"  # none above its heading
    for one in shown:
        if isinstance(one, Table):
            yield rf"\input{{tables/{one.name}.tex}}\clearpage"
        elif isinstance(one, Figure):
            yield figures_to_latex([one])
    if shown:
        yield r"\clearpage"
    for part in section.sections:
        yield from _inside(part, level + 1)


def _parts(table: Table, cells: Sequence[Sequence[str]]) -> list[_Part]:
    """Return how the columns of a table are set: all together, or in parts that are narrow."""
    every = list(range(len(table.columns)))
    for letters in SIZES:
        part = _set(table, cells, every, letters)
        if part:
            return [part]
    keys = _keys(table.columns)
    parts: list[_Part] = []
    rest = [k for k in every if k not in keys]
    while rest:
        taken = [rest.pop(0)]
        while rest and _set(table, cells, [*keys, *taken, rest[0]], SIZES[0]):
            taken.append(rest.pop(0))
        columns = [*keys, *taken]
        part = _set(table, cells, columns, SIZES[0]) or _set(
            table, cells, columns, SIZES[1], force=True
        )
        if part:
            parts.append(part)
    return parts


def _keys(columns: Sequence[Column]) -> list[int]:
    """Return the columns that name a row: the text at its beginning, three at most."""
    keys: list[int] = []
    for k, column in enumerate(columns[:-1]):
        if not column.is_text or column.is_wide or len(keys) == 3:
            break
        keys.append(k)
    return keys


def _set(
    table: Table,
    cells: Sequence[Sequence[str]],
    columns: Sequence[int],
    letters: tuple[str, float, float],
    *,
    force: bool = False,
) -> _Part | None:
    """Return how columns are set in letters of a size; None if they are too wide together.

    Text wider than ``LEAST`` may become a paragraph; with ``force`` paragraphs may be narrower.
    """
    size, points, gap = letters
    natural = [
        max((_width(row[k], points) for row in cells), default=0.0) for k in columns
    ]  # fmt: skip
    heads = [_broken(table.columns[k].title, max(w, 5 * points), points) for k, w in
             zip(columns, natural, strict=True)]  # fmt: skip
    needed = [
        max(w, max(_width(line, points) for line in head))
        for w, head in zip(natural, heads, strict=True)
    ]
    room = TEXT_WIDTH - 2 * gap * (len(columns) - 1)
    soft = [
        i
        for i, k in enumerate(columns)
        if needed[i] > LEAST and (table.columns[k].is_wide or table.columns[k].is_text)
    ]
    widths: dict[int, float] = {}
    if sum(needed) > room:
        left = room - sum(w for i, w in enumerate(needed) if i not in soft)
        least = 30.0 if force else LEAST
        if not soft or left < least * len(soft):
            return None
        widths = _shared(left, {i: needed[i] for i in soft}, least)
        for i in soft:
            texts_of = [table.columns[columns[i]].title, *(row[columns[i]] for row in cells)]
            longest = max(_width(word, points) for text in texts_of for word in _words(text))
            if longest > widths[i] + 1 and not force:
                return None
    specs, texts = [], []
    for i, k in enumerate(columns):
        side = "l" if table.columns[k].is_text or table.columns[k].is_wide else "r"
        if i in widths:
            specs.append(rf">{{\raggedright\arraybackslash}}p{{{widths[i]:.1f}pt}}")
            texts.append(_escaped(table.columns[k].title))
        else:
            specs.append(side)
            lines = r"\\".join(map(_escaped, heads[i]))
            texts.append(rf"\shortstack[{side}]{{{lines}}}" if len(heads[i]) > 1 else lines)
    lines_of = [
        max([1, *(math.ceil(1.15 * _width(row[columns[i]], points) / w)
                  for i, w in widths.items())])
        for row in cells
    ]  # fmt: skip
    return _Part(list(columns), specs, size, gap, texts, lines_of)


def _shared(room: float, needed: dict[int, float], least: float) -> dict[int, float]:
    """Return widths of paragraphs: ``least`` each, what is left by the root of their lengths."""
    widths = {i: min(least, w) for i, w in needed.items()}
    growing = set(widths)
    while growing and room - sum(widths.values()) > 0.5:
        left = room - sum(widths.values())
        total = sum(math.sqrt(needed[i]) for i in growing)
        for i in sorted(growing):
            widths[i] = min(needed[i], widths[i] + left * math.sqrt(needed[i]) / total)
        growing = {i for i in growing if widths[i] < needed[i]}
    return widths


def _pages(lines: Sequence[int]) -> list[range]:
    """Return the rows of each page."""
    pages, start, used = [], 0, 0
    for row, n in enumerate(lines):
        if used + n > MOST_LINES and row > start:
            pages.append(range(start, row))
            start, used = row, 0
        used += n
    return [*pages, range(start, len(lines))]


def _body(rows: Sequence[Sequence[str]], columns: Sequence[int]) -> list[str]:
    """Return rows: a repeated first cell is left out, with room between its groups."""
    lines: list[str] = []
    last = None
    groups = len({row[columns[0]] for row in rows}) < len(rows)
    for row in rows:
        shown = [_escaped(row[k]) for k in columns]
        if groups and row[columns[0]] == last:
            shown[0] = ""
        elif groups and lines:
            lines.append(r"\addlinespace")
        last = row[columns[0]]
        lines.append(" & ".join(shown) + r" \\")
    return lines


def _broken(title: str, room: float, points: float) -> list[str]:
    """Return a heading in lines that are about as wide as its column."""
    lines = [""]
    for word in title.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and _width(longer, points) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _words(text: str) -> list[str]:
    return text.replace("-", "- ").split()


def _width(text: str, points: float) -> float:
    """Return about how wide text is."""
    return points * sum(WIDTHS.get(letter, 0.52) for letter in text)


def _escaped(text: str) -> str:
    """Return text for LaTeX; letters beyond Latin become "?"."""
    return "".join(LATEX.get(letter, letter if ord(letter) < 0x180 else "?") for letter in text)
