"""A run's directory: what is written when, so that a kill at any moment leaves a run to resume.

::

    config.toml                 the resolved configuration; never changes
    provenance.json             versions, kernel hash, machine, sessions; replaced whole
    generations.jsonl           one line per generation, on the disk before the next begins
    champion.npz                the fittest team so far
    teams/generation-0000.npz   the fittest team of some generations
    checkpoint-a.npz, -b.npz    the method's state, written in turn
    test.json                   the testing phase
    DONE                        the seal of a finished run: digests of all files
    lock                        held (flock) by the process that is at work here

Within a generation teams are written first, then the log line, then the checkpoint. What is newer
than the checkpoint is written again, to the bit, when the run is resumed. A directory appears under
its name only when the first three files are in it; a kill before that leaves at most a hidden
directory beside it, which nothing reads.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from conevo.errors import EnvironmentFailure, UsageError
from conevo.evolution.protocol import State
from conevo.runs import checkpoint
from conevo.runs.champions import Team
from conevo.runs.config import RunConfig, resolve
from conevo.runs.durable import append_line, replace_file, sync_directory, writing

__all__ = ["Store", "create"]

Record = dict[str, Any]
CONFIG, PROVENANCE, GENERATIONS = "config.toml", "provenance.json", "generations.jsonl"
TEST, SEAL, LOCK, CHAMPION = "test.json", "DONE", "lock", "champion.npz"
CHECKPOINTS = ("checkpoint-a.npz", "checkpoint-b.npz")


def create(path: Path, config: RunConfig, provenance: Record) -> Store:
    """Make a run's directory appear at ``path``, all at once.

    Raises:
        UsageError: something is there already; it is left as it is.
        EnvironmentFailure: the directory cannot be written.
    """
    refuse_existing(path)
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    try:
        replace_file(draft / CONFIG, config.to_toml().encode())
        replace_file(draft / PROVENANCE, _json(provenance))
        replace_file(draft / GENERATIONS, b"")
        with writing(path):
            draft.chmod(0o777 & ~_umask())
            _appear(draft, path)
            sync_directory(path.parent)
    except EnvironmentFailure as error:
        raise EnvironmentFailure(str(error).replace(str(draft), str(path))) from error
    finally:
        shutil.rmtree(draft, ignore_errors=True)  # gone by now if all went well
    return Store(path)


def _appear(draft: Path, path: Path) -> None:
    """Give a finished draft its name, unless another process was faster."""
    try:
        draft.rename(path)
    except OSError:
        refuse_existing(path)
        raise


def refuse_existing(path: Path) -> None:
    """Say what is at ``path`` and what can be done with it, if anything is."""
    if not (path.is_symlink() or path.exists()) or (path.is_dir() and not any(path.iterdir())):
        return
    if not (path / CONFIG).is_file():
        raise UsageError(f"{path} exists and is no run; choose another place with --out")
    store = Store(path)
    if store.is_finished:
        advice = f"finished: see it with 'conevo show {path}', or choose another --seed or --out"
    elif store.is_in_use:
        advice = f"in use by {store.user}; watch it with 'conevo show {path}'"
    else:
        advice = f"unfinished: continue it with 'conevo resume {path}'"
    raise UsageError(f"{path} already holds a run, {advice}")


class Store:
    """The files of one run.

    Args:
        path: the run's directory.

    Raises:
        UsageError: there is no run at ``path``.
    """

    def __init__(self, path: Path) -> None:
        if not (path / CONFIG).is_file():
            raise UsageError(f"{path} is no run (it has no {CONFIG})")
        self.path = path
        self._next_checkpoint = 0

    # --- who is at work ---------------------------------------------------------------------------

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep every other process from writing here.

        Raises:
            UsageError: another process is at work in this directory.
        """
        path = self.path / LOCK
        with writing(path):
            handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _try_lock(handle, fcntl.LOCK_EX):
                raise UsageError(f"{self.path} is in use by {self.user}; wait for it or end it")
            with writing(path):
                os.truncate(handle, 0)
                os.pwrite(handle, f"process {os.getpid()}".encode(), 0)
            yield
        finally:
            os.close(handle)

    @property
    def is_in_use(self) -> bool:
        """Whether a process is at work here now."""
        try:
            handle = os.open(self.path / LOCK, os.O_RDONLY)
        except OSError:
            return False
        try:
            return not _try_lock(handle, fcntl.LOCK_SH)
        finally:
            os.close(handle)

    @property
    def user(self) -> str:
        """The process that is or was last at work here."""
        path = self.path / LOCK
        return (path.read_text() if path.is_file() else "") or "another process"

    # --- what the run is --------------------------------------------------------------------------

    def read_config(self) -> RunConfig:
        """Return the run's configuration.

        Raises:
            UsageError: it is not the one the run was started with.
        """
        config = resolve(file=self.path / CONFIG)
        if config.run_id != self.read_provenance().get("run_id"):
            raise UsageError(
                f"{self.path / CONFIG} was changed after the run was started; start another run "
                f"with --config {self.path / CONFIG} --out DIR"
            )
        return config

    def read_provenance(self) -> Record:
        """Return versions, machine and sessions."""
        return _read_json(self.path / PROVENANCE)

    def write_provenance(self, provenance: Record) -> None:
        """Replace the provenance."""
        replace_file(self.path / PROVENANCE, _json(provenance))

    # --- generations ------------------------------------------------------------------------------

    def append(self, record: Record) -> None:
        """Add a generation's line to the log."""
        append_line(self.path / GENERATIONS, json.dumps(record, allow_nan=False))

    def read_generations(self) -> list[Record]:
        """Return the log's whole lines; a torn last one does not count.

        Raises:
            UsageError: a line in the middle is damaged.
        """
        path = self.path / GENERATIONS
        whole = path.read_bytes().split(b"\n")[:-1] if path.is_file() else []
        records: list[Record] = []
        for number, line in enumerate(whole):
            try:
                record = json.loads(line)
                if record["generation"] != number:
                    raise ValueError(f"generation {number} expected")
            except (ValueError, KeyError, TypeError) as error:
                raise UsageError(f"{path} is damaged in line {number + 1}: {error}") from error
            records.append(record)
        return records

    def cut_generations(self, count: int) -> list[Record]:
        """Keep the log's first ``count`` lines and return them.

        Raises:
            UsageError: there are fewer.
        """
        path = self.path / GENERATIONS
        lines = path.read_bytes().split(b"\n")[:-1] if path.is_file() else []
        kept = b"".join(line + b"\n" for line in lines[:count])
        if path.is_file() and path.read_bytes() != kept:
            replace_file(path, kept)
        records = self.read_generations()
        if len(records) != count:
            raise UsageError(
                f"{path} has {len(records)} generations, the checkpoint is at {count}: "
                f"the run cannot be resumed"
            )
        return records

    # --- teams ------------------------------------------------------------------------------------

    def save_champion(self, team: Team) -> None:
        """Replace the fittest team so far."""
        checkpoint.save(self.path / CHAMPION, team, self._identity())

    def save_team(self, team: Team) -> None:
        """Keep the fittest team of a generation."""
        path = self._team_path(team.generation)
        with writing(path):
            path.parent.mkdir(exist_ok=True)
        checkpoint.save(path, team, self._identity())

    def load_champion(self) -> Team | None:
        """Return the fittest team so far, None before the first generation's end."""
        return self._load_team(self.path / CHAMPION)

    def load_team(self, generation: int) -> Team | None:
        """Return the fittest team of a generation, None if it was not kept."""
        return self._load_team(self._team_path(generation))

    def _team_path(self, generation: int) -> Path:
        return self.path / "teams" / f"generation-{generation:04d}.npz"

    def _load_team(self, path: Path) -> Team | None:
        return checkpoint.load(path, Team, self._identity()) if path.is_file() else None

    # --- checkpoints ------------------------------------------------------------------------------

    def save_checkpoint(self, state: State, method: str) -> None:
        """Write the method's state over the older of the two checkpoints."""
        path = self.path / CHECKPOINTS[self._next_checkpoint]
        checkpoint.save(path, state, self._identity() | {"method": method})
        self._next_checkpoint = 1 - self._next_checkpoint

    def load_checkpoint(self, method: str) -> tuple[State | None, str]:
        """Return the newest usable state and a remark on those that are not usable.

        Returns:
            The state, None if no checkpoint was written yet; the remark is empty if all is well.

        Raises:
            UsageError: there are checkpoints, but none is usable.
        """
        states: dict[int, State] = {}
        problems: list[str] = []
        for slot, name in enumerate(CHECKPOINTS):
            path = self.path / name
            if path.is_file():
                try:
                    identity = self._identity() | {"method": method}
                    states[slot] = checkpoint.load(path, State, identity)
                except checkpoint.UnusableFile as error:
                    problems.append(str(error))
        if problems and not states:
            raise UsageError(
                f"no usable checkpoint: {'; '.join(problems)}; to evolve again from the start, "
                f"remove the checkpoints and resume"
            )
        if not states:
            return None, ""
        newest = max(states, key=lambda slot: states[slot].generation)
        self._next_checkpoint = 1 - newest
        return states[newest], "; ".join(problems)

    def _identity(self) -> dict[str, str]:
        return {"run_id": self.read_provenance()["run_id"]}

    # --- the end ----------------------------------------------------------------------------------

    def write_test(self, result: Record) -> None:
        """Write the testing phase."""
        replace_file(self.path / TEST, _json(result))

    def read_test(self) -> Record | None:
        """Return the testing phase, None if the run has not come to it."""
        return _read_json(self.path / TEST) if (self.path / TEST).is_file() else None

    @property
    def is_finished(self) -> bool:
        """Whether the run is sealed."""
        return (self.path / SEAL).is_file()

    def seal(self) -> None:
        """Close the run: drop the older checkpoint, write the digests of all files."""
        (self.path / CHECKPOINTS[self._next_checkpoint]).unlink(missing_ok=True)
        replace_file(self.path / SEAL, _json({"files": self._digests()}))

    def check_seal(self) -> list[str]:
        """Return the names of files that are not as they were when the run was sealed."""
        sealed: Mapping[str, str] = _read_json(self.path / SEAL)["files"]
        found = self._digests()
        return sorted(name for name in sealed if found.get(name) != sealed[name])

    def _digests(self) -> dict[str, str]:
        files = sorted(p for p in self.path.rglob("*") if p.is_file() and p.suffix != ".tmp")
        return {
            p.relative_to(self.path).as_posix(): hashlib.blake2b(
                p.read_bytes(), digest_size=16
            ).hexdigest()
            for p in files
            if p.name not in (SEAL, LOCK)
        }


def _try_lock(handle: int, kind: int) -> bool:
    """Take a lock if it is free; the tries outlast another process that only looks."""
    for _ in range(5):
        try:
            fcntl.flock(handle, kind | fcntl.LOCK_NB)
        except OSError:
            time.sleep(0.02)
        else:
            return True
    return False


def _json(value: Record) -> bytes:
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def _read_json(path: Path) -> Record:
    try:
        found: Record = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise EnvironmentFailure(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise UsageError(f"{path} is damaged: {error}") from error
    return found


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
