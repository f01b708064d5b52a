"""The trackers that series can be sent to, and what each of them must offer.

Adding one is one file and one line. A file imports its package only when a series is begun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

from conevo.errors import UsageError, unknown_name
from conevo.track.series import Row, RunProfile

__all__ = ["TRACKERS", "Tracker", "Target", "kind_named"]


class Target(Protocol):
    """A series that is being sent to a tracker.

    Attributes:
        next_step: rows of fewer team-steps are there already, and must not be sent again.
        place: where the series is, for messages.
        see: a command or an address that shows it and those next to it.
    """

    next_step: int
    place: str
    see: str

    def put(self, rows: Sequence[Row]) -> None:
        """Send rows, in the order of their steps.

        Raises:
            EnvironmentFailure: a full disk, a server that does not answer.
        """

    def conclude(self, values: Mapping[str, float], last: Row) -> None:
        """Send the results of the testing phase; ``last`` is the last row."""

    def close(self, is_finished: bool) -> None:
        """Send what is left, and end."""


class Module(Protocol):
    """A file of this package with a tracker."""

    def refuse(self) -> None:
        """Raise UsageError if it cannot be used as it is configured; imports nothing."""

    def begin(self, about: RunProfile, folder: Path) -> Target:
        """Begin or continue the series of a run.

        Args:
            about: the run.
            folder: of this run and tracker alone; it exists.

        Raises:
            EnvironmentFailure: a full disk, a server that does not answer.
        """


@dataclass(frozen=True)
class Tracker:
    """A tracker.

    Attributes:
        name: of its option, its file and its extra.
        title: as its authors write it.
        package: that it needs.
    """

    name: str
    title: str
    package: str

    def refuse(self) -> None:
        """Raise UsageError if its package is not installed, or if it is not configured."""
        if find_spec(self.package) is None:
            raise UsageError(
                f"tracking to {self.title} needs {self.package}: pip install 'conevo[{self.name}]'"
            )
        self.module.refuse()

    @property
    def module(self) -> Module:
        """Its file."""
        module: Module = import_module(f"conevo.track.{self.name}")
        return module


TRACKERS = {
    one.name: one
    for one in (
        Tracker("tensorboard", "TensorBoard", "tensorboardX"),
        Tracker("wandb", "Weights & Biases", "wandb"),
        Tracker("mlflow", "MLflow", "mlflow"),
    )
}


def kind_named(name: str) -> Tracker:
    """Return a tracker by its name.

    Raises:
        UsageError: there is none of this name.
    """
    if name not in TRACKERS:
        raise unknown_name("tracker", name, TRACKERS)
    return TRACKERS[name]
