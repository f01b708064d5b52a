"""Drafts: results are written under a hidden name until they are complete.

A draft of NAME is in a hidden folder next to it::

    .NAME.xxxxxxxx/owner    locked by the process that writes the draft; contains the folder's name
    .NAME.xxxxxxxx/NAME     the draft, a file or a directory

If the owner has ended, its folder is removed by the next process that makes a draft next to it, or
that takes the lock of the parent directory. Folders in use, or of other programs, are left alone.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from conevo.runs import locks

__all__ = ["draft_of", "remove_abandoned", "remove_torn"]

OWNER = "owner"
HIDDEN = re.compile(r"\.(.+)\.[a-z0-9_]{8}")
TORN = re.compile(r"(.+\.(toml|json|jsonl|npz|npy|py|sh|txt)|DONE|STOP)\.tmp")


@contextmanager
def draft_of(path: Path, *, must_lock: bool = False) -> Iterator[Path]:
    """Yield the hidden path of a draft that the caller then moves to ``path``.

    The hidden folder is removed afterwards.

    Args:
        path: final path of the draft; its folder must exist.
        must_lock: whether ``path`` becomes a directory of results, which needs locks.

    Raises:
        EnvironmentFailure: it needs locks and the file system has none.
        OSError: the folder cannot be written.
    """
    remove_abandoned(path.parent)
    folder, handle = _begin(path, must_lock)
    try:
        yield folder / path.name
    finally:
        os.close(handle)
        shutil.rmtree(folder, ignore_errors=True)


def remove_abandoned(folder: Path) -> None:
    """Remove the drafts in a folder whose owners have ended."""
    with suppress(OSError):  # not there, or not ours to read
        with os.scandir(folder) as entries:
            names = [e.name for e in entries if HIDDEN.fullmatch(e.name) and not e.is_symlink()]
        for name in names:
            with suppress(OSError):
                _remove_if_abandoned(folder / name)


def remove_torn(folder: Path, older_than: float | None = None) -> None:
    """Remove the temporary files that a killed ``durable.replace_file`` left in a folder.

    Args:
        folder: where no other process writes files.
        older_than: if others may write there, newer files are left alone; seconds since 1970.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if TORN.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                with suppress(OSError):
                    if older_than is None or entry.stat().st_mtime < older_than:
                        os.unlink(entry.path)


def _begin(path: Path, must_lock: bool) -> tuple[Path, int]:
    """Make a draft's folder; return it and the handle that keeps its owner locked."""
    while True:
        folder = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        handle = -1
        try:
            handle = os.open(folder / OWNER, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                is_ours = locks.take(handle)
            except OSError as error:
                if must_lock:
                    raise locks.no_locks(path.parent, error, " with --out") from error
                is_ours = True  # without locks nobody can see that it is in use; nobody removes it
            # Between two of these lines another process may have found it without an owner.
            if is_ours and os.path.samestat(os.fstat(handle), os.stat(folder / OWNER)):
                os.write(handle, folder.name.encode())
                return folder, handle
        except FileNotFoundError:
            pass
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            if handle >= 0:
                os.close(handle)
            raise
        if handle >= 0:
            os.close(handle)


def _remove_if_abandoned(folder: Path) -> None:
    """Remove a draft's folder if its owner has ended; other folders are left alone.

    Raises:
        OSError: it cannot be read or removed, or its file system has no locks.
    """
    try:
        handle = os.open(folder / OWNER, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        folder.rmdir()  # killed before it had an owner; refused unless empty
        return
    try:
        name = os.read(handle, 300)
        begun = not name and os.listdir(folder) == [OWNER]
        if (begun or name == folder.name.encode()) and locks.take(handle, tries=1):
            shutil.rmtree(folder, ignore_errors=True)
    finally:
        os.close(handle)
    with suppress(OSError):
        folder.rmdir()  # network file systems keep a file that is open until it is closed
