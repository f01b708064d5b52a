"""How the last worker of a run ended: the file ``ended/LABEL.json``, written by the worker."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, cast

from typing_extensions import TypedDict

from conevo.errors import ConevoError
from conevo.reading import DamagedFile, read_json

__all__ = ["Ended", "failures", "read_ended"]


class Ended(TypedDict):
    """The fields of the file that are read again.

    status: whether the run is finished and studied. origin: of a failure: the "machine", the
    "request" or the "program". message: of a failure. core_seconds: of the attempt.
    """

    status: Literal["finished", "failed"]
    origin: str
    message: str
    core_seconds: float


def read_ended(path: Path) -> Ended | None:
    """Return how a worker ended; None if it has not written that, or the file is damaged.

    A damaged file counts as none: the run's directory has the results, and the next worker writes
    the file again.

    Raises:
        EnvironmentFailure: it cannot be read.
    """
    if not path.is_file():
        return None
    try:
        return cast("Ended", read_json(path, Ended))
    except DamagedFile:
        return None


def failures(folder: Path) -> tuple[dict[str, Ended], dict[str, str]]:
    """Return the runs whose last worker failed, and the files that cannot be read.

    Args:
        folder: with a file for each run that a worker has left.

    Returns:
        Label -> how it ended; name of a file -> why it cannot be read.
    """
    failed: dict[str, Ended] = {}
    unread: dict[str, str] = {}
    for path in sorted(folder.glob("*.json")):
        try:
            ended = cast("Ended", read_json(path, Ended))
        except ConevoError as error:
            unread[path.name] = str(error)
        else:
            if ended["status"] == "failed":
                failed[path.stem] = ended
    return failed, unread
