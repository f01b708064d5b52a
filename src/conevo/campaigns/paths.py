"""Where the files of a campaign are; see ``campaign`` for what is in them."""

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
        """Which code may carry the campaign on."""
        return self.root / "code.json"

    @property
    def extension(self) -> Path:
        """Another plan, while it takes the place of the old one."""
        return self.root / "extension.json"

    @property
    def ledger(self) -> Path:
        """What the coordinator knows of every run."""
        return self.root / "ledger.sqlite"

    @property
    def stop(self) -> Path:
        """Tells the coordinator to stop; it removes it."""
        return self.root / "STOP"

    @property
    def tables(self) -> Path:
        """Parquet files for questions and reports."""
        return self.root / "tables"

    @property
    def report(self) -> Path:
        """Pages, figures and numbers."""
        return self.root / "report"

    def run(self, name: str) -> Path:
        """The directory of a run, a shaping or, "LABEL/stage-1", a stage of one."""
        return self.root / "runs" / name

    def study(self, name: str, kind: str = "teams") -> Path:
        """A study of a run or stage: "teams" is what its fittest team does."""
        folder = self.root / "studies" if kind == "teams" else self.root / "studies" / kind
        return folder / f"{name.replace('/', '-')}.json"

    def ended(self, label: str) -> Path:
        """How the last worker of a run ended."""
        return self.root / "ended" / f"{label}.json"

    def log(self, label: str) -> Path:
        """What the workers of a run said."""
        return self.root / "logs" / f"{label}.txt"
