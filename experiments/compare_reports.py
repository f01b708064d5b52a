"""Compare two folders of reports: which files are missing, and which numbers or words differ.

CSV, JSON, LaTeX and HTML files must be the same byte for byte; drawings only have to exist. With
``--numbers`` words may differ: only the columns and numbers of CSV files are compared.
"""

from __future__ import annotations

import csv
import re
import sys
from pathlib import Path

import click

TEXT = {".csv", ".json", ".tex", ".html"}
NUMBER = re.compile(r"-?[\d.]+(e[-+]?\d+)?")
DIGESTS = "manifest.json"  # of the other files, drawings too


def content(path: Path, only_numbers: bool) -> object:
    """Return what must be the same in a file and its counterpart."""
    if path.suffix not in TEXT or path.name == DIGESTS:
        return None
    if not only_numbers:
        return path.read_bytes()
    if path.suffix != ".csv":
        return None
    names, *rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
    return names, [[cell for cell in row if NUMBER.fullmatch(cell)] for row in rows]


@click.command()
@click.argument("before", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.argument("after", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--numbers", is_flag=True, help="Words may differ.")
def main(before: Path, after: Path, numbers: bool) -> None:
    """Compare the reports below BEFORE with those below AFTER."""
    old, new = (
        {path.relative_to(root) for path in root.rglob("*") if path.is_file()}
        for root in (before, after)
    )
    differing = [
        name
        for name in sorted(old & new)
        if content(before / name, numbers) != content(after / name, numbers)
    ]
    for name in sorted(old ^ new):
        print(f"only in {before if name in old else after}: {name}")
    for name in differing:
        print(f"differs: {name}")
    print(f"{len(old & new)} files compared, {len(old ^ new) + len(differing)} differ")
    sys.exit(bool(old ^ new or differing))


if __name__ == "__main__":
    main()
