"""Arguments and rows of scripts that make tables from a campaign, or from its CSV file."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

from pages import Row, put, read, write

__all__ = ["PageParser"]


class PageParser(argparse.ArgumentParser):
    """A parser for [CAMPAIGN] [--write PAGE] [--again], to which a script adds its own."""

    def __init__(self, doc: str | None) -> None:
        """Take a script's docstring, whose first line describes it."""
        super().__init__(description=(doc or "").partition("\n")[0])
        self.add_argument("campaign", nargs="?", help="directory, or name in campaigns/")
        self.add_argument("--write", type=Path, help="page whose tables are replaced")
        self.add_argument("--again", action="store_true", help="from the CSV file, not a campaign")

    def parse(self, arguments: Sequence[str] | None) -> argparse.Namespace:
        """Return the arguments; end with one line if they do not go together."""
        args = self.parse_args(arguments)
        if args.write and not args.write.is_file():
            self.error(f"--write {args.write}: there is no such page")
        if args.again != (args.campaign is None) or (args.again and args.write is None):
            self.error("name a CAMPAIGN, or --again with --write PAGE, whose CSV file is read")
        return args


def rows_for(
    args: argparse.Namespace, rows_and_cost: Callable[[str], tuple[list[Row], str]]
) -> list[Row]:
    """Return a row per run, rounded as in the page's CSV file, which is written unless read.

    Args:
        args: of a `PageParser`. The cost of the runs is printed, and put into the page.
        rows_and_cost: makes both from a campaign's name.

    Raises:
        OSError: the CSV file cannot be read or written.
    """
    page: Path | None = args.write
    if not args.again:
        rows, cost = rows_and_cost(args.campaign)
        print(cost)
        if page is None:
            return rows
        put(cost, page, "cost")
        write(rows, page.with_suffix(".csv"))
    return read(args.write.with_suffix(".csv"))
