"""Functions for scripts that write results pages: numbers as CSV, tables between markers."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def write(rows: list[Row], path: Path) -> None:
    """Write rows of numbers as CSV, the first row's keys first; missing values are empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows
        )


def put(text: str, page: Path, name: str = "results") -> None:
    """Put text between the markers ``<!-- NAME -->`` and ``<!-- end -->`` of a page that exists.

    Raises:
        SystemExit: the page lacks the markers, or has them twice.
    """
    if not page.exists():
        return
    markers = re.compile(rf"(<!-- {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL)
    new, n = markers.subn(lambda m: m[1] + text + m[2], page.read_text())
    if n != 1:
        raise SystemExit(f"{page}: expected the markers <!-- {name} --> and <!-- end --> once")
    page.write_text(new)


def table(head: list[str], rows: list[list[Any]]) -> str:
    """Return a Markdown table."""
    lines = [f"| {' | '.join(map(str, line))} |\n" for line in [head, *rows]]
    return lines[0] + "|---" * len(head) + "|\n" + "".join(lines[1:])


def read(path: Path) -> list[Row]:
    """Return the rows written by ``write``, with numbers as numbers."""
    with path.open(newline="") as file:
        return [{k: _number(v) for k, v in row.items() if v != ""} for row in csv.DictReader(file)]


def _number(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text
