"""Locks (flock): one writer at a time, and whether the process that writes is still alive."""

from __future__ import annotations

import os
import time
from pathlib import Path

from conevo.errors import EnvironmentFailure

try:
    import fcntl
except ImportError as error:  # Windows
    raise EnvironmentFailure(
        "conevo needs Linux, on Windows WSL: this Python has no file locks (no module fcntl)"
    ) from error

__all__ = ["is_held", "is_taken", "no_locks", "take"]

TRIES = 5  # others may take a lock for a moment, only to check it


def take(handle: int, tries: int = TRIES) -> bool:
    """Take the lock of an open file for this process alone, until the file is closed.

    Returns:
        Whether it was free; if not, another process has it.

    Raises:
        OSError: the file system has no locks, or refuses for another reason.
    """
    return _flock(handle, fcntl.LOCK_EX, tries)


def is_taken(handle: int) -> bool:
    """Whether another process has taken the lock of an open file.

    A shared lock is refused only if another process has an exclusive one, so checks do not disturb
    each other. On a file system without locks, no process has one.
    """
    try:
        return not _flock(handle, fcntl.LOCK_SH, tries=1)
    except OSError:
        return False


def is_held(path: Path) -> bool:
    """Whether a process has locked the file at ``path``; False if it does not exist."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        return is_taken(handle)
    finally:
        os.close(handle)


def no_locks(directory: Path, error: OSError, advice: str = "") -> EnvironmentFailure:
    """Return the error for a directory whose file system has no locks.

    Args:
        directory: the directory that cannot be locked.
        error: the system's.
        advice: how to choose another place, if possible.
    """
    return EnvironmentFailure(
        f"cannot lock {directory}: {error.strerror or error}; without locks two processes could "
        f"write there at once, so choose a place on another file system{advice}"
    )


def _flock(handle: int, kind: int, tries: int) -> bool:
    for _ in range(tries):
        try:
            fcntl.flock(handle, kind | fcntl.LOCK_NB)
        except BlockingIOError:  # EWOULDBLOCK: in use; anything else is not
            time.sleep(0.02 if tries > 1 else 0.0)
        else:
            return True
    return False
