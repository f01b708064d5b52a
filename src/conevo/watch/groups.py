"""Groups of runs on a live page: the runs of a folder, or those of a campaign."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path
from typing import Any

from conevo.campaigns.campaign import Campaign
from conevo.campaigns.inputs import shown_as
from conevo.campaigns.ledger import Entry
from conevo.campaigns.progress import remaining_seconds
from conevo.errors import UsageError
from conevo.evolution.methods.registry import name_in
from conevo.kernels.threads import usable_cores
from conevo.runs.growing import Stamp, stamp
from conevo.runs.outline import span
from conevo.watch.comparisons import CurvePanel, panels_of
from conevo.watch.settings import free_label
from conevo.watch.subjects import Subject
from conevo.watch.tail import problem_of, readable

__all__ = ["Experiment", "Followed", "Names", "FollowedRuns"]

GoOn = Callable[[], bool]
PLACES = ("task", "preset", "method", "variant")  # these decide in which panel a run is


class Names:
    """Labels of runs: no two are the same, and a run keeps its label."""

    def __init__(self) -> None:
        self._of: dict[Path, str] = {}
        self._taken: set[str] = set()

    def of(self, path: Path, wanted: str) -> str:
        """Return the label of the run at ``path``, the one wanted if it is free."""
        if path not in self._of:
            self._of[path] = free_label(readable(wanted), self._taken)
            self._taken.add(self._of[path])
        return self._of[path]


class Followed:
    """Runs that belong together.

    Attributes:
        subjects: the runs, in order.
        panels: their comparisons.
        is_running: whether any of them is running.
        ends_at: time when all will be finished, seconds since 1970; None if it is not known.
        problem: what is wrong with the group, "" if nothing is.
        is_named: whether it is shown while it has no runs.
    """

    is_named = False

    def __init__(self, kind: str, path: Path | None, name: str) -> None:
        self._about: dict[str, Any] = {
            "kind": kind,
            "path": readable(str(path or "")),
            "name": readable(name),
            "title": readable(name),
        }
        self.subjects: list[Subject] = []
        self.panels: list[CurvePanel] = []
        self.is_running = False
        self.ends_at: float | None = None
        self.problem = ""
        self._places: Hashable = ()

    @property
    def about(self) -> dict[str, Any]:
        """The description of the group on the page."""
        return self._about | {
            "counts": dict(Counter(one.summary["status"] for one in self.subjects)),
            "running": self.is_running,
            "ends_at": self.ends_at,
            "problem": self.problem,
        }

    def look_safely(self, go_on: GoOn) -> None:
        """Read what has changed; an error is this group's problem, and others are shown."""
        try:
            self.look(go_on)
        except Exception as error:
            line = " ".join(str(error).split())[:200]
            self.problem = readable(f"cannot be shown: {type(error).__name__}: {line}")

    def look(self, go_on: GoOn) -> None:
        """Read what has changed, while ``go_on`` returns true."""
        raise NotImplementedError

    def _arrange(self) -> None:
        """Make the panels again if the runs, or what is known of them, have changed."""
        places = tuple(
            (one.label, one.apart, *(one.summary[name] for name in PLACES)) for one in self.subjects
        )
        if places != self._places:
            self._places = places
            self.panels = panels_of(self.subjects, self._about["name"])


class FollowedRuns(Followed):
    """Runs and shapings.

    Attributes:
        listing: their directories, which may be replaced between two looks.
    """

    def __init__(self, path: Path | None, name: str, names: Names) -> None:
        super().__init__("runs", path, name)
        self.listing: Sequence[Path] = ()
        self._names = names
        self._known: dict[Path, Subject] = {}

    def look(self, go_on: GoOn) -> None:
        """Read what has changed, while ``go_on`` returns true."""
        self.problem = ""
        self._known = {
            path: self._known.get(path) or Subject(self._names.of(path, path.name), path)
            for path in self.listing
        }
        self.subjects = list(self._known.values())
        for one in self.subjects:
            one.look(None, go_on)
        shown = [one.summary for one in self.subjects]
        self.is_running = any(one["status"] == "running" for one in shown)
        self.ends_at = max((one["ends_at"] for one in shown if one["ends_at"]), default=None)
        self._arrange()


class Experiment(Followed):
    """A campaign: its plan, its ledger, and the files of its runs."""

    is_named = True

    def __init__(self, path: Path, names: Names, prefix: str) -> None:
        super().__init__("campaign", path, path.name)
        self._path, self._names, self._prefix = path, names, prefix
        self._campaign: Campaign | None = None
        self._plan: tuple[Stamp | None, ...] = ()
        self._ledger: Hashable = None
        self._entries: dict[str, Entry] = {}
        self._by_label: dict[str, Subject] = {}

    def look(self, go_on: GoOn) -> None:
        """Read what has changed, while ``go_on`` returns true."""
        self.problem = problem_of(self._read)
        for label, one in self._by_label.items():
            one.look(self._entries.get(label, Entry(label)), go_on)
        self._arrange()

    def _read(self) -> None:
        files = (stamp(self._path / "plan.toml"), stamp(self._path / "runs.jsonl"))
        if self._campaign is None or files != self._plan:
            self._open()
            self._plan, self._ledger = files, None
        assert self._campaign is not None
        self.is_running = self._campaign.is_running
        versions = sum(one.version for one in self.subjects)
        ledger = (stamp(self._campaign.ledger.path), self.is_running, versions)
        if ledger != self._ledger:
            self._entries = self._campaign.standings()
            self._ledger = ledger
            self.ends_at = None
            if self.is_running:  # judged by the cores in use now: runs may be on other machines
                cores = sum(one.threads for one in self._entries.values() if one.state == "running")
                at, cores = time.time(), cores or usable_cores()
                left = remaining_seconds(self._campaign, self._entries, cores, at)
                self.ends_at = None if left is None else round(at + left, 1)

    def _open(self) -> None:
        """Read the plan.

        Raises:
            UsageError: it is damaged, or its runs are elsewhere.
        """
        campaign = Campaign(self._path)
        folder = campaign.path / "runs"
        if folder.is_symlink():
            raise UsageError(f"{folder} is a link, and links are not followed")
        self._campaign = campaign
        self._about |= {
            "title": campaign.plan.title or campaign.plan.name,
            "preset": campaign.plan.preset,
        }
        known, self._by_label = self._by_label, {}
        for label, run in campaign.planned.items():
            path = folder / Path(label).name
            about = {name: getattr(run, name) for name in ("preset", "seed", "variant")}
            about |= {"task": span([shown_as(task) for task in run.tasks])}
            about |= {"method": name_in(run.method)}
            name = f"{self._prefix}/{label}" if self._prefix else label
            self._by_label[label] = known.get(label) or Subject(
                self._names.of(path, name), path, about
            )
        self.subjects = list(self._by_label.values())
