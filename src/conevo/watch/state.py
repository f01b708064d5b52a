"""The state that a live page shows: runs, shapings and campaigns, from their files alone.

Nothing is written and no link is followed. A problem with a run is one line of that run.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from conevo.errors import UsageError
from conevo.evolution.methods.registry import METHODS, title_of
from conevo.palette import caste_colours, method_looks, several
from conevo.runs.directory import kind_of, kinds_in
from conevo.watch.groups import Experiment, Followed, FollowedRuns, Names
from conevo.watch.subjects import Subject
from conevo.watch.tail import readable
from conevo.worlds.registry import colours_of

__all__ = ["FORMAT", "Watched"]

FORMAT = 1


class Watched:
    """The runs, shapings and campaigns that are followed.

    Args:
        paths: their directories.
        folders: all directories in these are followed, also those that appear later.

    Raises:
        UsageError: a path is none of the three.
    """

    def __init__(self, paths: Sequence[Path] = (), folders: Sequence[Path] = ()) -> None:
        named = [Path(path).resolve() for path in paths]
        self._folders = [Path(folder).resolve() for folder in folders]
        for path in named:
            if not kind_of(path):
                raise UsageError(f"{path} is not a run, a shaping or a campaign")
        self.title = readable(", ".join(path.name for path in (*named, *self._folders)))
        self._lock = threading.Lock()
        self._names = Names()
        self._groups: dict[Path, Followed] = {}
        runs = [path for path in named if kind_of(path) != "campaign"]
        if runs:
            self._groups[Path()] = group = FollowedRuns(None, "runs", self._names)
            group.listing = runs
        for path in named:
            if path not in runs:
                prefix = "" if named == [path] and not self._folders else path.name
                self._groups[path] = Experiment(path, self._names, prefix)
        self._by_label: dict[str, Subject] = {}
        self._state: dict[str, Any] = {}
        self._version = 0

    def snapshot(self, patience: float = math.inf) -> dict[str, Any]:
        """Return the state as JSON has it: the same object until something changes.

        Args:
            patience: seconds after which further reading is left for the next time (``reading``
                counts the runs with unread parts).
        """
        with self._lock:
            until = time.monotonic() + patience
            state = self._look(lambda: time.monotonic() < until)
            if state != {key: value for key, value in self._state.items() if key != "version"}:
                self._version += 1
                self._state = state | {"version": self._version}
            return self._state

    def details(self, label: str) -> dict[str, Any]:
        """Return all generations of a run, as JSON has them.

        Raises:
            UsageError: no run has this label.
        """
        with self._lock:
            return self._subject(label).details()

    def champion(self, label: str) -> tuple[Path, int]:
        """Return the run directory and the generation of a label's fittest team so far.

        Raises:
            UsageError: no run has this label, or no generation has finished yet.
        """
        with self._lock:
            found = self._subject(label).champion
        if found is None:
            raise UsageError(f"{label} has no finished generation yet, so it has no team to show")
        return found

    @property
    def labels(self) -> Mapping[str, Subject]:
        """The runs of the last snapshot by their labels."""
        return self._by_label

    def _subject(self, label: str) -> Subject:
        if label not in self._by_label:
            raise UsageError(f"no run here is called {label!r}")
        return self._by_label[label]

    def _look(self, go_on: Callable[[], bool]) -> dict[str, Any]:
        for folder in self._folders:
            self._list(folder)
        for group in self._groups.values():
            group.look_safely(go_on)
        groups = [group for group in self._groups.values() if group.subjects or group.is_named]
        subjects = [subject for group in groups for subject in group.subjects]
        self._by_label = {subject.label: subject for subject in subjects}
        runs = [subject.summary for subject in subjects]
        return {
            "format": FORMAT,
            "title": self.title,
            "reading": sum(subject.is_behind for subject in subjects),
            "groups": [group.about for group in groups],
            "runs": runs,
            "panels": [panel.look(len(runs)) for group in groups for panel in group.panels],
            "methods": _methods(run["method"] for run in runs),
            "castes": _castes(runs),
            "palette": list(several(16)),
        }

    def _list(self, folder: Path) -> None:
        """Find the runs and campaigns that are in a folder now."""
        kinds = {
            path: "" if path.is_symlink() else kind for path, kind in kinds_in(folder).items()
        }  # links have no kind
        group = self._groups.setdefault(folder, FollowedRuns(folder, folder.name, self._names))
        assert isinstance(group, FollowedRuns)
        group.listing = [path for path, kind in kinds.items() if kind != "campaign"]
        for path in [one for one in self._groups if one.parent == folder]:
            if kinds.get(path) != "campaign" and path not in self._folders:
                del self._groups[path]
        for path, kind in kinds.items():
            if kind == "campaign" and path not in self._groups:
                self._groups[path] = Experiment(path, self._names, path.name)


def _methods(names: Iterable[str]) -> dict[str, dict[str, str]]:
    """Return the title and the colour of methods, those of the registry first."""
    titles = {entry.name: entry.title for entry in METHODS.values()}
    titles |= {name: title_of(name) for name in sorted(set(names) - set(METHODS) - {""})}
    looks = method_looks(titles)
    return {name: {"title": title, "colour": looks[name].line} for name, title in titles.items()}


def _castes(runs: Iterable[Mapping[str, Any]]) -> dict[str, dict[str, str]]:
    """Return the colour of every caste of every world, the same as in a replay."""
    seen: dict[str, set[str]] = {}
    for run in runs:
        seen.setdefault(run["task"].partition("/")[0], set()).update(run["castes"])
    return {world: caste_colours(colours_of(world), names) for world, names in seen.items()}
