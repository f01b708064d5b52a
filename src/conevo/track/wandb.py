"""Runs of Weights & Biases: online if its user is logged in, else offline, to be uploaded later.

The id of a run there is that of ``RunProfile``, so a series that is sent again is the same run.
Online it is continued after its last step. Offline a new directory has the whole series, and the
previous ones are removed once the new one is on the disk; uploading it replaces what was there.
"""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, ClassVar

from conevo.errors import EnvironmentFailure
from conevo.terms import quoted
from conevo.track.series import Row, RunProfile

__all__ = ["begin", "refuse"]

PATIENCE = 30.0  # seconds for a server to answer first


def refuse() -> None:
    """Any configuration is fine."""


def begin(about: RunProfile, folder: Path) -> WandbRun:
    """Begin or continue the run with this id."""
    return WandbRun(about, folder)


class WandbRun:
    """A run there.

    ``finish`` returns before all is on the disk; only the end of W&B's process, which all runs
    share, makes it sure. So previous directories are removed when no run is open any more.
    """

    _open: ClassVar[list[WandbRun]] = []
    _replaced: ClassVar[list[Path]] = []  # directories that are to be removed

    def __init__(self, about: RunProfile, folder: Path) -> None:
        import wandb

        mode = os.environ.get("WANDB_MODE") or ("online" if _is_logged_in() else "offline")
        self._earlier = sorted((folder / "wandb").glob(f"offline-run-*-{about.id}*"))
        with _refusals():
            self._run: Any = wandb.init(
                project=os.environ.get("WANDB_PROJECT", "conevo"),
                name=about.name,
                id=about.id,
                group=about.group or None,
                tags=[about.tags["task"][:64], about.tags["method"][:64]],
                config={**about.tags, **about.settings},
                allow_val_change=True,
                dir=str(folder),
                mode=mode,
                resume="allow",
                reinit="create_new",
                settings=wandb.Settings(
                    console="off",
                    silent=True,
                    x_disable_stats=True,
                    disable_git=True,
                    init_timeout=PATIENCE,
                ),
            )
        self._open.append(self)
        self.next_step = int(self._run.starting_step)
        if mode == "online":
            self.place = self.see = str(self._run.url)
        else:
            self.place = str(Path(self._run.dir).parent)
            self.see = f"wandb sync {quoted(folder.parent)}/*/wandb/offline-run-*"

    def put(self, rows: Sequence[Row]) -> None:
        """Log each row at its step."""
        with _refusals():
            for row in rows:
                self._run.log(dict(row.values), step=row.step)

    def conclude(self, values: Mapping[str, float], last: Row) -> None:
        """Put the results of the testing phase in the run's summary."""
        with _refusals():
            self._run.summary.update(dict(values))

    def close(self, is_finished: bool) -> None:
        """End the run; remove previous directories when all new ones are on the disk."""
        import wandb

        self._open.remove(self)
        with _refusals():
            self._run.finish(exit_code=0)
            self._replaced.extend(self._earlier)
            if self._replaced and not self._open:
                wandb.teardown()
                while self._replaced:
                    shutil.rmtree(self._replaced.pop(), ignore_errors=True)


def _is_logged_in() -> bool:
    import wandb

    with redirect_stdout(sys.stderr):
        try:
            return bool(wandb.login(verify=False, timeout=1))
        except wandb.Error:
            return False


@contextmanager
def _refusals() -> Iterator[None]:
    """Convert the errors of wandb, and those of the system, to one clear line."""
    try:
        yield
    except Exception as error:
        own = any(one.__module__.partition(".")[0] == "wandb" for one in type(error).__mro__)
        if not (own or isinstance(error, OSError)):
            raise
        reason = " ".join(str(error).split())[:300]
        raise EnvironmentFailure(f"Weights & Biases: {reason}") from error
