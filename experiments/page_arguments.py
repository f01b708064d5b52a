"""The arguments of scripts that make a page's tables from a campaign, or again from its numbers."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

__all__ = ["PageParser"]


class PageParser(argparse.ArgumentParser):
    """A parser for [CAMPAIGN] [--write PAGE] [--again], to which a script adds its own."""

    def __init__(self, doc: str | None) -> None:
        """Take a script's docstring, whose first line says what it does."""
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
