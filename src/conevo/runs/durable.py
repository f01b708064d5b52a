"""Writing that survives a crash; a refusal names the path and the reason."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from conevo.errors import EnvironmentFailure, UsageError

__all__ = ["append_line", "replace_file", "sync_directory", "write_new", "writing"]


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn the operating system's refusal to write ``path`` into one clear line.

    Raises:
        EnvironmentFailure: full disk, no permission, read-only file system and the like.
    """
    try:
        yield
    except OSError as error:
        raise EnvironmentFailure(f"cannot write {path}: {error.strerror or error}") from error


def replace_file(path: Path, data: bytes) -> None:
    """Put ``data`` in place of the file at ``path``: after a crash it is the old or the new one."""
    draft = path.with_name(path.name + ".tmp")
    with writing(path):
        try:
            with draft.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            draft.replace(path)
        except BaseException:
            draft.unlink(missing_ok=True)
            raise
        sync_directory(path.parent)


def write_new(path: Path, data: bytes) -> None:
    """Write a file, all at once; one that is there already is left as it is.

    Raises:
        UsageError: something else is there; the same bytes are no reason.
        EnvironmentFailure: it cannot be written.
    """
    if path.is_symlink() or path.exists():
        if path.is_file() and path.read_bytes() == data:
            return
        raise UsageError(f"{path} exists and is something else; choose another place with --out")
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, data)


def append_line(path: Path, line: str) -> None:
    """Add one line to the file and wait until it is on the disk."""
    with writing(path), path.open("ab") as file:
        file.write(line.encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def sync_directory(path: Path) -> None:
    """Wait until the names in a directory are on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
