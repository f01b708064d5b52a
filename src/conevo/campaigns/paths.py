"""Paths of the files of a campaign; ``campaign`` describes their contents."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from conevo.runs.directory import CAMPAIGN

__all__ = ["Paths"]


@dataclass(frozen=True)
class Paths:
    """Paths in the directory of a campaign."""

    root: Path

    @property
    def plan(self) -> Path:
        """The plan, resolved."""
        return self.root / CAMPAIGN

    @property
    def runs(self) -> Path:
        """The list of runs, one JSON object per line."""
        return self.root / "runs.jsonl"

    @property
    def code(self) -> Path:
        """The versions of the code that may continue the campaign."""
        return self.root / "code.json"

    @property
    def extension(self) -> Path:
        """Another plan, while it replaces the old one."""
        return self.root / "extension.json"

    @property
    def ledger(self) -> Path:
        """The state of every run, as the coordinator knows it."""
        return self.root / "ledger.sqlite"

    @property
    def stop(self) -> Path:
        """Makes the coordinator stop, which removes it."""
        return self.root / "STOP"

    @property
    def tables(self) -> Path:
        """Parquet files for queries and reports."""
        return self.root / "tables"

    @property
    def report(self) -> Path:
        """Pages, figures and numbers."""
        return self.root / "report"

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
