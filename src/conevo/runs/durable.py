"""Writing that survives a crash; a refusal names the path and the reason."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from conevo.errors import EnvironmentFailure, UsageError
from conevo.reading import read_bytes
from conevo.runs.drafts import draft_of

__all__ = [
    "append_line",
    "appearing_file",
    "refuse_file",
    "refuse_inside_file",
    "replace_file",
    "sync_directory",
    "sync_file",
    "write_new",
    "writing",
]


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Convert the operating system's refusal to write ``path`` to one clear line.

    Raises:
        EnvironmentFailure: full disk, no permission, read-only file system and the like.
    """
    try:
        yield
    except OSError as error:
        raise EnvironmentFailure(f"cannot write {path}: {error.strerror or error}") from error


def replace_file(path: Path, data: bytes) -> None:
    """Replace the file at ``path``: after a crash it has the old or the new content."""
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


def write_new(files: Mapping[Path, bytes], option: str = "--out") -> None:
    """Write files, each all at once; one that is there already is left as it is.

    Args:
        files: their contents.
        option: the name of the option that gives another place.

    Raises:
        UsageError: something else is in the place of one; none was written.
        EnvironmentFailure: one cannot be written.
    """
    missing = {p: data for p, data in files.items() if not (p.is_file() and read_bytes(p) == data)}
    for path in missing:
        refuse_file(path, option)
    for path, data in missing.items():
        with appearing_file(path) as draft:
            draft.write_bytes(data)


@contextmanager
def appearing_file(path: Path) -> Iterator[Path]:
    """Yield a hidden path; the file that is written there then becomes ``path``, all at once.

    Raises:
        UsageError: ``path`` exists; it is left as it is.
        EnvironmentFailure: it cannot be written.
    """
    refuse_file(path)
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with draft_of(path) as draft:
            yield draft
            sync_file(draft)
            refuse_file(path)
            draft.rename(path)
            sync_directory(path.parent)


def is_there(path: Path) -> bool:
    """Whether anything has this name: a file, a directory, a pipe, a link to nothing."""
    return path.exists() or path.is_symlink()


def refuse_file(path: Path, option: str = "--out") -> None:
    """Raise UsageError if there is something at ``path`` already, or it is inside a file.

    The message names the option that gives another place.
    """
    refuse_inside_file(path)
    if is_there(path):
        raise UsageError(f"{path} exists already; choose another place with {option}, or remove it")


def refuse_inside_file(path: Path) -> None:
    """Raise UsageError if a file is in the place of a directory that is to contain ``path``."""
    for folder in path.parents:
        if os.path.exists(folder) and not os.path.isdir(folder):
            raise UsageError(f"{folder} is a file, not a directory")


def append_line(path: Path, line: str) -> None:
    """Add one line to the file and wait until it is on the disk."""
    with writing(path), path.open("ab") as file:
        file.write(line.encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def sync_file(path: Path) -> None:
    """Wait until the content of a file is on the disk."""
    _sync(path)


def sync_directory(path: Path) -> None:
    """Wait until the names in a directory are on the disk."""
    _sync(path)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
