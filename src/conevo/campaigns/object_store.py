"""Runs copied to and from an object store, for machines that share no file system.

An object store has neither locks nor renaming, and copying may stop between any two files. So a
run's files are stored in an order that leaves a run to resume after each of them: checkpoints after
the files that they refer to, seals last. They are read in the opposite order, since the run may be
running meanwhile: a resumed run writes again what is newer than its checkpoint.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from conevo.campaigns.paths import Paths
from conevo.campaigns.plan_file import STUDIES
from conevo.campaigns.worker import planned_runs
from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs.directory import appearing, kind_of
from conevo.runs.durable import replace_file
from conevo.runs.inputs import INPUTS

__all__ = ["ObjectStore"]


class ObjectStore:
    """The store of one campaign's files, under their names in its directory.

    Args:
        uri: "s3://BUCKET/PATH", "gs://BUCKET/PATH", "file:///PATH" or others that pyarrow.fs knows.

    Raises:
        UsageError: pyarrow is not installed, or does not know the address.

    All methods raise EnvironmentFailure if the store cannot be reached or refuses. Messages show
    the address without its password and options.
    """

    def __init__(self, uri: str) -> None:
        try:
            fs: Any = import_module("pyarrow.fs")
        except ImportError as error:
            raise UsageError("an object store needs pyarrow: pip install 'conevo[ray]'") from error
        try:
            self._files, base = fs.FileSystem.from_uri(uri)
        except (OSError, ValueError) as error:
            raise UsageError(f"object store {uri!r}: {error}") from error
        self._folder = fs.FileSelector
        self.uri, self._base = uri, base.rstrip("/")
        self._shown = f"{uri.partition(':')[0]}://{self._base}"
        if not self._base:
            raise UsageError(f"object store {uri!r}: it has no bucket")

    def put_plan(self, root: Path) -> None:
        """Store the files of a plan that a worker reads: its runs, its inputs, and its codes."""
        paths = Paths(root)
        inputs = sorted((root / INPUTS).glob("*"))
        for path in (paths.runs, paths.code, *inputs):
            if path.is_file():
                self._put(root, path, path.read_bytes())

    def get_plan(self, root: Path) -> None:
        """Write these files into a directory."""
        paths = Paths(root)
        self._get(root, paths.runs)
        for name in self._names(INPUTS):
            self._get(root, root / INPUTS / name)
        if self._has(root, paths.code):
            self._get(root, paths.code)

    def put_run(self, root: Path, label: str) -> None:
        """Store a run, running or not, its studies, its log and how it ended."""
        run = Paths(root).run(label)
        contents: dict[Path, bytes] = {}
        for path in sorted(_results(run), key=lambda path: (_rank(path), path)):
            try:
                contents[path] = path.read_bytes()
            except FileNotFoundError:  # gone since it was listed
                continue
        seal = run / "DONE"
        if self._has(root, seal) and self._read(f"runs/{label}/DONE") != contents.get(seal):
            self._delete(f"runs/{label}/DONE")  # the run has another length now
        for path in reversed(contents):
            self._put(root, path, contents[path])
        there = {path.relative_to(run).as_posix() for path in contents}
        for name in set(self._names(f"runs/{label}")) - there if there else ():
            self._delete(f"runs/{label}/{name}")
        for path in _beside(root, label):
            if path.is_file():
                self._put(root, path, path.read_bytes())
            elif "studies" in path.relative_to(root).parts and self._has(root, path):
                self._delete(path.relative_to(root).as_posix())

    def get_run(self, root: Path, label: str) -> None:
        """Replace a run in a directory by the stored one."""
        run = Paths(root).run(label)
        if names := self._names(f"runs/{label}"):
            shutil.rmtree(run, ignore_errors=True)
            with appearing(run) as draft:
                for name in names:
                    path = draft / name
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(self._read(f"runs/{label}/{name}"))
        for path in _beside(root, label):
            if self._has(root, path):
                self._get(root, path)

    def has_run(self, label: str) -> bool:
        """Whether any file of a run is stored."""
        return bool(self._names(f"runs/{label}"))

    def forget_ending(self, root: Path, label: str) -> None:
        """Remove the record of a run's last end, since it is tried again."""
        path = Paths(root).ended(label)
        if self._has(root, path):
            self._delete(path.relative_to(root).as_posix())

    def _has(self, root: Path, path: Path) -> bool:
        """Whether a file of a campaign's directory is stored."""
        name = path.relative_to(root).as_posix()
        with self._asked("read", name):
            return bool(self._files.get_file_info(f"{self._base}/{name}").is_file)

    def _names(self, folder: str) -> list[str]:
        """Return the names of all files in a folder, relative to it."""
        place = f"{self._base}/{folder}"
        below = self._folder(place, recursive=True, allow_not_found=True)
        with self._asked("list", folder):
            found = self._files.get_file_info(below)
        return sorted(one.path.rpartition(f"{place}/")[2] for one in found if one.is_file)

    def _put(self, root: Path, path: Path, content: bytes) -> None:
        name = path.relative_to(root).as_posix()
        place = f"{self._base}/{name}"
        with self._asked("write", name):
            self._files.create_dir(place.rpartition("/")[0], recursive=True)
            with self._files.open_output_stream(place) as stream:
                stream.write(content)

    def _get(self, root: Path, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, self._read(path.relative_to(root).as_posix()))

    def _read(self, name: str) -> bytes:
        with self._asked("read", name), self._files.open_input_stream(f"{self._base}/{name}") as it:
            return bytes(it.read())

    def _delete(self, name: str) -> None:
        with self._asked("remove", name):
            self._files.delete_file(f"{self._base}/{name}")

    @contextmanager
    def _asked(self, what: str, name: str) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            reason = " ".join(str(error).split())
            raise EnvironmentFailure(f"cannot {what} {self._shown}/{name}: {reason}") from error


def _results(run: Path) -> list[Path]:
    """Return the files of a run or shaping, without drafts and locks."""
    if not kind_of(run):
        return []
    return [
        path
        for path in run.rglob("*")
        if path.is_file()
        and path.name != "lock"
        and path.suffix != ".tmp"
        and not any(part.startswith(".") for part in path.relative_to(run).parts)
    ]


def _rank(path: Path) -> int:
    """Return the rank of a file, which is read in ascending order, and written in descending."""
    if path.name == "DONE":
        return 0
    return 1 if path.name.startswith("checkpoint-") else 2


def _beside(root: Path, label: str) -> list[Path]:
    """Return the paths of a run's studies, its log and its last end, in this order."""
    paths = Paths(root)
    names = planned_runs(root)[label].courses
    studies = [paths.study(name, kind) for name in names for kind in STUDIES]
    return [*studies, paths.log(label), paths.ended(label)]
