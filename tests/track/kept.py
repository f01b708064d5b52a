"""A tracker that keeps what it is sent, in place of one that needs a package or a server."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from conevo.errors import EnvironmentFailure
from conevo.track.series import Row, RunProfile


class Kept:
    """The module of a tracker; ``first`` is the step from which it wants rows."""

    def __init__(self) -> None:
        self.targets: list[KeptSeries] = []
        self.first = 0
        self.fails_at: int | None = None
        self.on_put: Callable[[], None] = lambda: None

    def refuse(self) -> None:
        pass

    def begin(self, about: RunProfile, folder: Path) -> KeptSeries:
        self.targets.append(KeptSeries(self, about, folder))
        return self.targets[-1]

    def steps(self) -> dict[str, list[int]]:
        """Return the steps that were sent, by the names of the runs."""
        found: dict[str, list[int]] = {}
        for one in self.targets:
            found.setdefault(one.about.name, []).extend(row.step for row in one.rows)
        return found


class KeptSeries:
    """The series of one run."""

    def __init__(self, of: Kept, about: RunProfile, folder: Path) -> None:
        self.of, self.about, self.folder = of, about, folder
        self.next_step, self.place, self.see = of.first, f"memory of {about.name}", "look around"
        self.rows: list[Row] = []
        self.test: dict[str, float] = {}
        self.ended: list[bool] = []

    def put(self, rows: Sequence[Row]) -> None:
        assert not self.ended
        self.of.on_put()
        for row in rows:
            if row.step == self.of.fails_at:
                raise EnvironmentFailure("cannot write memory: No space left on device")
            self.rows.append(row)

    def conclude(self, values: Mapping[str, float], last: Row) -> None:
        assert last == self.rows[-1]
        self.test = dict(values)

    def close(self, is_finished: bool) -> None:
        self.ended.append(is_finished)
