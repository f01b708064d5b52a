"""A directory of results: it appears all at once, has one writer and is never overwritten.

::

    config.toml, shaping.toml      shows its kind: a run, a shaping with a run per stage, or a
      or plan.toml                   campaign with many runs
    lock                           locked (flock) by the process that writes here
    DONE                           the seal of finished results: digests of all files
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from conevo.errors import EnvironmentFailure, UsageError
from conevo.reading import read_bytes, read_json, read_text
from conevo.runs import locks
from conevo.runs.drafts import draft_of, remove_abandoned, remove_torn
from conevo.runs.durable import (
    is_there,
    refuse_inside_file,
    replace_file,
    sync_directory,
    writing,
)
from conevo.terms import quoted

__all__ = [
    "CAMPAIGN",
    "CONFIG",
    "SHAPING",
    "UNREADABLE",
    "Directory",
    "appearing",
    "as_json",
    "kind_of",
    "kinds_in",
    "refuse_existing",
    "refuse_unreadable",
]

CONFIG, SHAPING, CAMPAIGN, LOCK, SEAL = "config.toml", "shaping.toml", "plan.toml", "lock", "DONE"
LONGEST_WRITE = 3600.0  # seconds, of a file that other processes may be writing
KINDS = {CONFIG: "run", SHAPING: "shaping", CAMPAIGN: "campaign"}
UNREADABLE = "unreadable"


def kind_of(path: Path) -> str:
    """Return the kind of a directory: "run", "shaping", "campaign", UNREADABLE or none ("").

    Only the name of its file counts; readers report damage, and a directory that may not be read.
    """
    try:
        return next((kind for name, kind in KINDS.items() if is_there(path / name)), "")
    except PermissionError:
        return UNREADABLE


def refuse_unreadable(path: Path) -> None:
    """Raise EnvironmentFailure if this process may not read a directory."""
    if kind_of(path) == UNREADABLE:
        raise EnvironmentFailure(f"{path}: this process may not read the directory")


def kinds_in(folder: Path) -> dict[Path, str]:
    """Return the runs, shapings and campaigns in a folder by name, each with its kind."""
    try:
        paths = sorted(folder.iterdir())
    except OSError:  # it does not exist yet, or was just removed
        return {}
    return {p: kind for p in paths if not p.name.startswith(".") and (kind := kind_of(p))}


@contextmanager
def appearing(path: Path) -> Iterator[Path]:
    """Yield a hidden directory to be filled; it then takes the name ``path``, all at once.

    Raises:
        UsageError: the path exists; it is left unchanged.
        EnvironmentFailure: the directory cannot be written, or its file system has no locks.
    """
    refuse_existing(path)
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with draft_of(path, must_lock=True) as draft:
            draft.mkdir()
            try:
                yield draft
            except EnvironmentFailure as error:
                raise EnvironmentFailure(str(error).replace(str(draft), str(path))) from error
            _appear(draft, path)
            sync_directory(path.parent)


def _appear(draft: Path, path: Path) -> None:
    """Give a finished draft its name, unless another process was faster."""
    try:
        draft.rename(path)
    except OSError:
        refuse_existing(path, is_new=True)
        raise


def refuse_existing(path: Path, *, is_new: bool = False) -> None:
    """Raise UsageError, with advice, if a path is inside a file, or is not an empty directory.

    Args:
        path: of a directory.
        is_new: whether it did not exist a moment ago, so that another process is creating it.
    """
    refuse_inside_file(path)
    if not is_there(path) or (path.is_dir() and not any(path.iterdir())):
        return
    kind = kind_of(path)
    if not kind:
        raise UsageError(
            f"{path} already exists and is not a run; choose another directory with --out"
        )
    directory = Directory(path, kind)
    if is_new:
        raise UsageError(
            f"another conevo has just begun a {kind} at {path}; leave it to that one, or choose "
            f"another directory with --out"
        )
    if kind == "campaign":
        raise UsageError(
            f"{path} already holds a campaign; see 'conevo campaign status {quoted(path)}'"
        )
    if directory.is_finished:
        show = f"conevo show {quoted(path)}"
        advice = f"finished: see it with '{show}', or choose another --seed or --out"
    elif directory.is_in_use:
        advice = f"in use by {directory.user}; watch it with 'conevo show {quoted(path)}'"
    else:
        advice = f"unfinished: continue it with 'conevo resume {quoted(path)}'"
    raise UsageError(f"{path} already holds a {kind}, {advice}")


class Directory:
    """A directory of results, with one writer at a time, and a seal when it is finished.

    Args:
        path: the directory.
        kind: "run", "shaping" or "campaign".

    Raises:
        UsageError: it is not of this kind.
        EnvironmentFailure: it may not be read.
    """

    def __init__(self, path: Path, kind: str) -> None:
        refuse_unreadable(path)
        name = next(name for name in KINDS if KINDS[name] == kind)
        if not is_there(path / name):
            raise UsageError(f"{path} is not a {kind} (it has no {name})")
        self.path = path

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes from writing here, and remove the remains of killed ones.

        Raises:
            UsageError: another process is writing in this directory.
            EnvironmentFailure: it cannot be written, or its file system has no locks.
        """
        path = self.path / LOCK
        with writing(path):
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            try:
                is_ours = locks.take(handle)
            except OSError as error:
                raise locks.no_locks(self.path, error) from error
            if not is_ours:
                raise UsageError(f"{self.path} is in use by {self.user}; wait for it or end it")
            with writing(path):
                os.truncate(handle, 0)
                os.pwrite(handle, f"process {os.getpid()}".encode(), 0)
            self._tidy()
            yield
        finally:
            os.close(handle)

    @property
    def is_in_use(self) -> bool:
        """Whether a process is writing here now."""
        return locks.is_held(self.path / LOCK)

    def _tidy(self) -> None:
        """Remove the remains of killed processes; in a campaign's runs their workers do so."""
        remove_abandoned(self.path.resolve().parent)  # of one killed just when this had appeared
        remove_abandoned(self.path)
        for folder in (self.path, self.path / "teams", self.path / "inputs"):
            remove_torn(folder)
        remove_abandoned(self.path / "runs")
        for folder in (self.path / "studies", self.path / "ended"):
            remove_torn(folder, older_than=time.time() - LONGEST_WRITE)

    @property
    def user(self) -> str:
        """The process that is writing here, or was the last to do so."""
        path = self.path / LOCK
        return (read_text(path) if path.is_file() else "") or "another process"

    @property
    def is_finished(self) -> bool:
        """Whether it is sealed."""
        return is_there(self.path / SEAL)  # its content is checked when it is read

    def seal(self) -> None:
        """Close the directory: write the digests of all files."""
        replace_file(self.path / SEAL, as_json({"files": self._digests()}))

    def unseal(self) -> None:
        """Open a finished directory again."""
        with writing(self.path / SEAL):
            (self.path / SEAL).unlink(missing_ok=True)
            sync_directory(self.path)

    def read_seal(self) -> dict[str, str]:
        """Return the digests of all files when the directory was sealed, by name."""
        from conevo.runs.records import Seal

        files: dict[str, str] = read_json(self.path / SEAL, Seal)["files"]
        return files

    def check_seal(self, names: Collection[str] | None = None) -> list[str]:
        """Return the names of files that are not as they were when the directory was sealed.

        Args:
            names: files to check, all by default.
        """
        sealed = self.read_seal()
        asked = sealed if names is None else sealed.keys() & names
        found = self._digests(asked)
        return sorted(name for name in asked if found.get(name) != sealed[name])

    def _digests(self, names: Collection[str] | None = None) -> dict[str, str]:
        """Return the digests of the existing files with these names; by default of all."""
        if names is None:
            names = [
                p.relative_to(self.path).as_posix()
                for p in self.path.rglob("*")
                if p.suffix != ".tmp" and p.name not in (SEAL, LOCK)
            ]
        return {
            name: hashlib.blake2b(read_bytes(self.path / name), digest_size=16).hexdigest()
            for name in sorted(names)
            if (self.path / name).is_file()
        }


def as_json(value: Mapping[str, Any]) -> bytes:
    """Return the text of a JSON file."""
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()
