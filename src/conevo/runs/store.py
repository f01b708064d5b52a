"""A run's directory: a kill at any moment leaves a run that can be resumed.

::

    config.toml                 the resolved configuration; changes only with the run's length
    inputs/                     copies of its files: of a world, a method, prey
    provenance.json             versions, kernel hash, machine, sessions; replaced whole
    origin.npz                  the first state, if it is from another run
    generations.jsonl           one line per generation, on the disk before the next begins
    finalists.npz               the fittest teams so far
    champion.npz                the fittest; of a finished run the choice of the validation
    teams/generation-0000.npz   the fittest team of some generations
    checkpoint-a.npz, -b.npz    the method's state, written in turn
    test.json                   the testing phase
    DONE                        the seal of a finished run: digests of all files
    extension.json              only while the length of a run changes: the changes
    lock                        locked (flock) by the process that writes here

Within a generation teams are written first, then the log line, then the checkpoint. Everything
newer than the checkpoint is written again, bit for bit, when the run is resumed. A directory gets
its name only when it contains the files down to ``generations.jsonl``.

The length of a run changes in one step: ``extension.json`` is written, and takes effect when
``DONE`` is removed, or at once if the run is unfinished. Its content is then written into
``config.toml`` and ``provenance.json``, by the same process or by the next one that has the lock.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError
from conevo.reading import (
    MOST_LOG,
    MOST_TOML,
    DamagedFile,
    parse_json,
    read_bytes,
    read_json,
    read_toml,
    whole_lines,
)
from conevo.runs import checkpoint
from conevo.runs.code import version
from conevo.runs.directory import CONFIG, Directory, appearing, as_json
from conevo.runs.durable import append_line, replace_file, writing
from conevo.runs.outline import LENGTH, Outline, digest_of, read_outline
from conevo.terms import counted
from conevo.typing import Record

if TYPE_CHECKING:
    from conevo.evolution.protocol import State
    from conevo.runs.champions import Team
    from conevo.runs.config import RunConfig

__all__ = ["Store", "create"]

PROVENANCE, GENERATIONS, TEST = "provenance.json", "generations.jsonl", "test.json"
CHAMPION, FINALISTS, ORIGIN = "champion.npz", "finalists.npz", "origin.npz"
EXTENSION = "extension.json"
CHECKPOINTS = ("checkpoint-a.npz", "checkpoint-b.npz")


def create(path: Path, config: RunConfig, provenance: Record, first: State | None = None) -> Store:
    """Create a run's directory, which appears at ``path`` all at once.

    Args:
        path: the directory.
        config: the resolved configuration.
        provenance: versions and machine; has an ``origin`` if there is a first state.
        first: the initial state, if it is not the method's own.

    Raises:
        UsageError: the path exists; it is left unchanged.
        EnvironmentFailure: the directory cannot be written.
    """
    from conevo.runs.inputs import keep_inputs

    with appearing(path) as draft:
        kept = keep_inputs(config, draft)
        text = kept.to_toml(draft).encode()
        replace_file(draft / CONFIG, text)
        replace_file(draft / PROVENANCE, as_json(provenance | {"config_digest": digest_of(text)}))
        if first is not None:
            identity = _identity(provenance) | {"method": config.method}
            checkpoint.save(draft / ORIGIN, first, identity)
        replace_file(draft / GENERATIONS, b"")
    return Store(path, keep_inputs(config, path))


class Store(Directory):
    """The files of one run.

    Args:
        path: the run's directory.
        config: the configuration that has just been written there.

    Raises:
        UsageError: there is no run at ``path``.
    """

    def __init__(self, path: Path, config: RunConfig | None = None) -> None:
        super().__init__(path, "run")
        self._next_checkpoint = 0
        self._config = (config.to_toml(path).encode(), config) if config else None

    # --- configuration and provenance -------------------------------------------------------------

    def read_outline(self) -> Outline:
        """Return the run's task, method, preset, seed and length, without loading its world.

        Raises:
            UsageError: the configuration is not the one the run was started with.
        """
        content = read_bytes(self.path / CONFIG, MOST_TOML)
        if extension := self._read_extension():
            content = extension["config"].encode()
        return read_outline(content, self.read_provenance(), str(self.path / CONFIG))

    def read_tables(self) -> dict[str, Any]:
        """Return the tables of the configuration as they are written."""
        return read_toml(self.path / CONFIG)

    def read_config(self) -> RunConfig:
        """Return the run's configuration; this loads its world, once for each text of the file.

        Raises:
            UsageError: it is not the one the run was started with, or its world is missing.
        """
        self.read_outline()
        text, extension = read_bytes(self.path / CONFIG, MOST_TOML), self._read_extension()
        if self._config is None or self._config[0] != text:
            self._config = text, self._resolve()
        config = self._config[1]
        return config.of_length(extension["length"]) if extension else config

    def _resolve(self) -> RunConfig:
        """Return the configuration in the file; errors name the version that wrote it."""
        from conevo.runs.config import resolve
        from conevo.worlds.registry import refuse_earlier

        refuse_earlier(self.read_outline().task, self.path)
        try:
            return resolve(file=self.path / CONFIG)
        except UsageError as error:
            made_by, here = self.read_provenance()["conevo"], version("conevo")
            if made_by == here:
                raise
            raise UsageError(
                f"{self.path} was made by conevo {made_by} and this is conevo {here}: {error}"
            ) from error

    def read_provenance(self) -> Record:
        """Return versions, machine and sessions.

        Raises:
            DamagedFile: it is lost or damaged, or lacks the end of a run that is sealed.
        """
        from conevo.runs.records import Provenance

        if not os.path.lexists(self.path / PROVENANCE):
            raise DamagedFile(f"{self.path} is damaged: it has lost its {PROVENANCE}")
        ending = ("finished", "stopped_by") if self.is_finished else ()  # written before the seal
        about, extension = read_json(self.path / PROVENANCE, Provenance), self._read_extension()
        for key in ending:
            if key not in about:
                raise DamagedFile(f"{self.path / PROVENANCE} is damaged: {key} is missing")
        if extension is None or about.get("run_id") == extension["run_id"]:
            return about
        kept = {k: v for k, v in about.items() if k not in ("finished", "stopped_by")}
        return kept | {
            "run_id": extension["run_id"],
            "changed": extension["changed"],
            "config_digest": digest_of(extension["config"].encode()),
            "extended": [*about.get("extended", []), extension["former"]],
        }

    def write_provenance(self, provenance: Record) -> None:
        """Replace the provenance."""
        replace_file(self.path / PROVENANCE, as_json(provenance))

    def refuse_changed(self) -> None:
        """Refuse a finished run whose records have changed since it was sealed.

        Raises:
            DamagedFile: its settings, generations or testing phase were changed.
        """
        if changed := self.check_seal((CONFIG, PROVENANCE, GENERATIONS, TEST)):
            raise DamagedFile(
                f"{self.path} was changed since it was finished: {', '.join(changed)}"
            )

    # --- another length ---------------------------------------------------------------------------

    def extend(self, config: RunConfig, former: Record, at: str) -> None:
        """Change the run's length; a finished run is unsealed.

        Args:
            config: the run's own with another length.
            former: its former end.
            at: the present time.
        """
        extension = {
            "run_id": config.run_id,
            "length": {name: getattr(config.run, name) for name in LENGTH},
            "config": config.to_toml(self.path),
            "changed": list(config.changed),
            "former": {"at": at} | former,
        }
        replace_file(self.path / EXTENSION, as_json(extension))
        self.unseal()
        self.settle()

    def settle(self) -> None:
        """Complete an interrupted ``extend``, or remove its file if it has not taken effect."""
        if extension := self._read_extension():
            about = self.read_provenance()
            replace_file(self.path / CONFIG, extension["config"].encode())
            self.write_provenance(about)
        with writing(self.path / EXTENSION):
            (self.path / EXTENSION).unlink(missing_ok=True)

    def _read_extension(self) -> Record | None:
        """Return an extension in effect that is not in all files yet, None if there is none."""
        path = self.path / EXTENSION
        if not os.path.lexists(path) or self.is_finished:
            return None
        from conevo.runs.records import Extension

        return read_json(path, Extension)

    # --- generations ------------------------------------------------------------------------------

    def append(self, record: Record) -> None:
        """Add a generation's line to the log."""
        append_line(self.path / GENERATIONS, json.dumps(record, allow_nan=False))

    def read_generations(self) -> list[Record]:
        """Return the records of the log's whole lines, without a torn last one.

        Raises:
            UsageError: a line in the middle is damaged.
        """
        path, is_finished = self.path / GENERATIONS, self.is_finished
        records = self._parse_log(self._read_log())
        if is_finished and not records:
            raise DamagedFile(f"{path} is damaged: it has lost its generations")
        return records

    def _read_log(self) -> bytes:
        path = self.path / GENERATIONS
        return read_bytes(path, MOST_LOG) if os.path.lexists(path) else b""

    def _parse_log(self, content: bytes) -> list[Record]:
        from conevo.runs.records import Generation

        path = str(self.path / GENERATIONS)
        records = []
        for number, line in enumerate(whole_lines(content)):
            where = f" in line {number + 1}"
            records.append(parse_json(line, path, Generation, where))
            if records[-1]["generation"] != number:
                raise DamagedFile(f"{path} is damaged{where}: generation {number} expected")
        return records

    def count_generations(self) -> tuple[int, int]:
        """Return the number of finished generations, and of their team evaluations.

        Only the last line is parsed, unless one looks wrong.

        Raises:
            UsageError: a line is cut, damaged or out of order.
        """
        from conevo.runs.records import Generation

        path = self.path / GENERATIONS
        lines = whole_lines(self._read_log())
        for number, line in enumerate(lines):
            if not (line.startswith(b'{"generation": %d,' % number) and line.endswith(b"}")):
                self.read_generations()
        last = parse_json(lines[-1], str(path), Generation) if lines else {"team_evaluations": 0}
        return len(lines), last["team_evaluations"]

    def cut_generations(self, count: int) -> list[Record]:
        """Keep the log's first ``count`` lines and return them.

        Raises:
            UsageError: it has fewer.
        """
        path, content = self.path / GENERATIONS, self._read_log()
        kept = b"".join(line + b"\n" for line in whole_lines(content)[:count])
        records = self._parse_log(kept)  # before anything is cut
        if len(records) != count:
            raise UsageError(
                f"{path} has {counted(len(records), 'generation')}, the checkpoint is at {count}: "
                f"the run cannot be resumed"
            )
        if content != kept:
            replace_file(path, kept)
        return records

    # --- teams ------------------------------------------------------------------------------------

    def save_champion(self, team: Team) -> None:
        """Replace the run's champion."""
        checkpoint.save(self.path / CHAMPION, team, self._identity())

    def save_finalists(self, teams: Sequence[Team]) -> None:
        """Replace the fittest teams so far; they are ranked."""
        from conevo.runs.champions import Finalists

        checkpoint.save(self.path / FINALISTS, Finalists.of(teams), self._identity())

    def load_finalists(self) -> list[Team]:
        """Return the fittest teams so far, the fittest first; none before the first generation."""
        from conevo.runs.champions import Finalists

        path = self.path / FINALISTS
        if not os.path.lexists(path):
            return []
        found = checkpoint.load(path, Finalists, self._identity())
        if found.problem:
            raise DamagedFile(f"{path} is damaged: {found.problem}")
        return found.teams()

    def save_team(self, team: Team) -> None:
        """Keep the fittest team of a generation."""
        path = self._team_path(team.generation)
        with writing(path):
            path.parent.mkdir(exist_ok=True)
        checkpoint.save(path, team, self._identity())

    def thin_teams(self, generations: Collection[int]) -> None:
        """Remove the kept teams of all but these generations."""
        kept = {self._team_path(generation) for generation in generations}
        for path in set((self.path / "teams").glob("generation-*.npz")) - kept:
            with writing(path):
                path.unlink()

    def load_champion(self) -> Team | None:
        """Return the run's champion, None before the first generation's end."""
        return self._load_team(self.path / CHAMPION)

    def load_team(self, generation: int) -> Team | None:
        """Return the fittest team of a generation, None if it was not kept."""
        return self._load_team(self._team_path(generation))

    def _team_path(self, generation: int) -> Path:
        return self.path / "teams" / f"generation-{generation:04d}.npz"

    def _load_team(self, path: Path) -> Team | None:
        from conevo.runs.champions import Team

        if not os.path.lexists(path):
            return None
        team = checkpoint.load(path, Team, self._identity())
        if team.problem:
            raise DamagedFile(f"{path} is damaged: {team.problem}")
        return team

    # --- checkpoints ------------------------------------------------------------------------------

    def save_checkpoint(self, state: State, method: str) -> None:
        """Write the method's state over the older of the two checkpoints."""
        path = self.path / CHECKPOINTS[self._next_checkpoint]
        checkpoint.save(path, state, self._identity() | {"method": method})
        self._next_checkpoint = 1 - self._next_checkpoint

    def load_checkpoint(self, method: str, blank: State) -> tuple[State | None, str]:
        """Return the newest usable state, and a message about unusable ones.

        Args:
            method: of the run.
            blank: a state of that method; the file must have the same fields.

        Returns:
            The state, None if no checkpoint was written yet; the message is empty without problems.

        Raises:
            UsageError: there are checkpoints, but none is usable.
        """
        states: dict[int, State] = {}
        problems: list[str] = []
        for slot, name in enumerate(CHECKPOINTS):
            path = self.path / name
            if os.path.lexists(path):
                try:
                    identity = self._identity() | {"method": method}
                    states[slot] = checkpoint.load_like(blank, path, identity)
                except checkpoint.UnusableFile as error:
                    problems.append(str(error))
        if problems and not states:
            raise UsageError(
                f"no usable checkpoint: {'; '.join(problems)}; to evolve again from the start, "
                f"remove the checkpoints and resume"
            )
        if not states:
            return None, ""
        newest = max(states, key=lambda slot: states[slot].progress.generation)
        self._next_checkpoint = 1 - newest
        return states[newest], "; ".join(problems)

    def load_origin(self, method: str, blank: State) -> State | None:
        """Return the run's first state if it is from another run, else None.

        Args:
            method, blank: as for ``load_checkpoint``.

        Raises:
            UsageError: the file is lost, damaged or foreign.
        """
        if "origin" not in self.read_provenance():
            return None
        identity = self._identity() | {"method": method}
        return checkpoint.load_like(blank, self.path / ORIGIN, identity)

    def load_final(self, method: str, blank: State) -> tuple[State, str]:
        """Return the last state of a finished run, and the digest of its checkpoint.

        Args:
            method, blank: as for ``load_checkpoint``.

        Raises:
            UsageError: the checkpoint is lost or unusable.
        """
        state, _ = self.load_checkpoint(method, blank)
        if state is None:
            raise UsageError(f"{self.path} has lost its last checkpoint")
        file = self.path / CHECKPOINTS[1 - self._next_checkpoint]
        return state, checkpoint.content_digest(file)

    def load_final_champion(self) -> tuple[Team, str]:
        """Return the champion of a finished run, and the digest of its file.

        Raises:
            UsageError: the file is lost or unusable.
        """
        team = self.load_champion()
        if team is None:
            raise UsageError(f"{self.path} has lost its {CHAMPION}")
        return team, checkpoint.content_digest(self.path / CHAMPION)

    def _identity(self) -> dict[str, str]:
        return _identity(self.read_provenance())

    # --- the end ----------------------------------------------------------------------------------

    def write_test(self, result: Record) -> None:
        """Write the testing phase."""
        replace_file(self.path / TEST, as_json(result))

    def read_test(self) -> Record | None:
        """Return the testing phase, None before it."""
        from conevo.runs.records import Testing, contradiction

        path = self.path / TEST
        if not os.path.lexists(path):
            return None
        found = read_json(path, Testing)
        if problem := contradiction(found):
            raise DamagedFile(f"{path} is damaged: {problem}")
        return found

    def seal(self) -> None:
        """Close the run: drop the older checkpoint, write the digests of all files."""
        (self.path / CHECKPOINTS[self._next_checkpoint]).unlink(missing_ok=True)
        super().seal()


def _identity(provenance: Record) -> dict[str, str]:
    """Return the identity that a run's files must have."""
    # Runs that differ only in length may share files; those of conevo 0.1.0 may not.
    key = "stem_id" if "stem_id" in provenance else "run_id"
    identity = {key: provenance[key]}
    if "origin" in provenance:  # the same settings on other populations are another run
        identity["origin"] = provenance["origin"]["checkpoint"]
    return identity
