"""Paths of the files of a campaign; ``campaign`` describes their contents."""

from __future__ import annotations

from pathlib import Path

from conevo.runs.directory import CAMPAIGN

__all__ = ["Paths"]


class Paths:
    """Paths in the directory of a campaign."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.plan = root / CAMPAIGN
        self.runs = root / "runs.jsonl"
        self.code = root / "code.json"
        self.extension = root / "extension.json"  # another plan, while it replaces the old one
        self.ledger = root / "ledger.sqlite"
        self.stop = root / "STOP"  # makes the coordinator stop, which removes it
        self.tables = root / "tables"
        self.report = root / "report"  # pages, figures and numbers

    def run(self, name: str) -> Path:
        """The directory of a run, a shaping or, "LABEL/stage-1", a stage of one."""
        return self.root / "runs" / name

    def study(self, name: str, kind: str = "teams") -> Path:
        """A study of a run or stage: "teams" is that of its fittest team."""
        folder = self.root / "studies" if kind == "teams" else self.root / "studies" / kind
        return folder / f"{name.replace('/', '-')}.json"

    def ended(self, label: str) -> Path:
        """How the last worker of a run ended."""
        return self.root / "ended" / f"{label}.json"

    def log(self, label: str) -> Path:
        """Output of a run's workers."""
        return self.root / "logs" / f"{label}.txt"
