"""Shaping: a task learned in stages, each a run that starts from the previous one's populations.

Nitschke 2009, sections 4.3 (prey) and 6.4.2 (construction). If the method changes between stages,
populations are bred from the champion of the previous stage (``runs.first``)::

    shaping.toml    the resolved configuration of every stage; never changes
    inputs/         copies of its files: of a world, a method, prey
    stage-1/ ...    ordinary runs; a stage appears when the previous one is sealed
    generations.jsonl   every generation of all stages with its environment; written when a stage is
                    sealed
    prey.npz        the world's product of these stages, if it has one: here evolved prey
    DONE            the seal of a finished shaping: digests of all files
    lock            locked (flock) by the process that writes here
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from conevo.errors import UsageError, without_team
from conevo.kernels.devices import CPU
from conevo.reading import check, read_bytes, read_toml
from conevo.runs.code import last_code, refuse_other_code, sessions_of
from conevo.runs.directory import CONFIG, SHAPING, Directory, appearing, refuse_existing
from conevo.runs.durable import is_there, replace_file
from conevo.runs.outline import Outline, flattened, identify, outline_of
from conevo.runs.provenance import device_of
from conevo.runs.run import RUNS, Run, Watch
from conevo.runs.start import start
from conevo.runs.time_limit import TimeLimit
from conevo.terms import quoted
from conevo.typing import Record
from conevo.worlds.registry import product_of

if TYPE_CHECKING:
    from pandas import DataFrame

    from conevo.evolution.protocol import State
    from conevo.runs.champions import Team
    from conevo.runs.config import RunConfig

__all__ = ["Shaping", "label", "start_shaping", "start_stages", "stand_ins", "tasks_up_to"]

FORMAT = 1
GENERATIONS = "generations.jsonl"


def tasks_up_to(task: str) -> list[str]:
    """Return a task and the previous ones of its family: complex-1, -2, -3 for "rover/complex-3".

    Raises:
        UsageError: no such task, or the first of its family.
    """
    from conevo.worlds.registry import resolve as resolve_world

    entry, environment = resolve_world(task)
    family, _, number = environment.rpartition("-")
    if not (family and number.isdecimal() and int(number) > 1):
        raise UsageError(f"there is nothing to shape: no environment comes before {task}")
    return [entry.address(f"{family}-{k}") for k in range(1, int(number) + 1)]


def start_shaping(
    tasks: Sequence[str],
    method: str | None = None,
    preset: str | None = None,
    seed: int | None = None,
    out: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    *,
    config: str | Path | None = None,
    threads: int | None = None,
    device: str = "cpu",
    command: str = "conevo.runs.shaping.start_shaping",
    place: str = "in overrides",
) -> Shaping:
    """Create the directory of a shaping; ``Shaping.resume`` then evolves it.

    Args:
        tasks: worlds and environments in the order in which they are learned.
        method: of all stages, like the following settings.
        preset: "smoke", "desk" (default), "night", "thesis".
        seed: the same seed gives the same stages, bit for bit.
        out: the directory; by default a new one under ``runs/``.
        overrides: single settings, for example ``{"run.generations": 5}``.
        config: a TOML file with settings; ``tasks`` take precedence over its world.
        threads: CPU threads, all by default; results do not depend on it.
        device: "cpu", "cuda", or "auto": "cuda" if there is one; results do not depend on it.
        command: that started the stages, for the provenance.
        place: where ``overrides`` came from, for error messages.

    Raises:
        UsageError: no task, a name or value that is not allowed in any stage, populations that do
            not fit the next stage, or ``out`` exists; nothing was written.
        EnvironmentFailure: no such device, full disk, no permission.
    """
    from conevo.runs.config import resolve

    configs = [resolve(task, method, preset, seed, config, overrides, place) for task in tasks]
    return start_stages(configs, out, threads=threads, device=device, command=command)


def start_stages(
    configs: Sequence[RunConfig],
    out: str | Path | None = None,
    *,
    threads: int | None = None,
    device: str = "cpu",
    command: str = "conevo.runs.shaping.start_stages",
) -> Shaping:
    """Create the directory of a shaping whose stages have these configurations.

    Args:
        configs: of every stage, in order.
        out, threads, device, command: as for ``start_shaping``.

    Raises:
        UsageError, EnvironmentFailure: as ``start_shaping``.
    """
    from conevo.runs.ancestry import refuse_other_controllers
    from conevo.runs.inputs import keep_inputs
    from conevo.runs.lab import Lab

    if not configs:
        raise UsageError("a shaping needs at least one task")
    path = Path(out) if out is not None else RUNS / label(configs)
    refuse_existing(path)
    if makes := product_of([stage.task for stage in configs]):
        makes.refuse(configs)
    state: State | None = None
    on: list[str] = []
    stand_in_of = stand_ins(configs)
    for before, stage, stand_in in zip([configs[0], *configs], configs, stand_in_of, strict=False):
        lab = Lab.equip(stage, threads, device)
        try:
            state = lab.rehearsed(lab.first_state(stand_in or state))
        except UsageError as error:  # two stages may share the length of one run
            which = f"stage {len(on) + 1} ({stage.method}): " if any(stand_in_of) else ""
            raise UsageError(f"{which}{error}") from error
        on.append(lab.device)
        refuse_other_controllers("a stage", before, stage)
    refuse_existing(path, is_new=True)
    with appearing(path) as draft:
        about = {
            "format": FORMAT,
            "command": command,
            "device": CPU if CPU in on else on[0],
            "tasks": [stage.task for stage in configs],
            "run_ids": [stage.run_id for stage in configs],
            "stages": [keep_inputs(stage, draft).tables(draft) for stage in configs],
        }
        replace_file(draft / SHAPING, tomli_w.dumps(about).encode())
    return Shaping(path)


def stand_ins(configs: Sequence[RunConfig]) -> list[Team | None]:
    """Return for each stage a team in place of the champion from which it will be bred.

    None for a stage that starts from the previous one's populations, or from random ones.
    """
    from conevo.runs.lab import first_team

    return [
        first_team(before) if before.method != stage.method else None
        for before, stage in zip([configs[0], *configs], configs, strict=False)
    ]


class Shaping:
    """A shaping on disk, finished or not.

    Args:
        path: its directory.

    Raises:
        UsageError: ``path`` is not a shaping, or its file has changed.
    """

    def __init__(self, path: str | Path) -> None:
        self._directory = Directory(Path(path), "shaping")
        self.path = self._directory.path
        about = _read(self.path / SHAPING)
        self._command, self._device = str(about["command"]), str(about["device"])
        self.settings: list[Record] = about["settings"]
        self.run_ids: tuple[str, ...] = tuple(about["run_ids"])
        self.outlines: list[Outline] = about["outlines"]

    @cached_property
    def configs(self) -> list[RunConfig]:
        """The settings of every stage; this loads its world.

        Raises:
            UsageError: a world's file is missing, or has changed.
        """
        from conevo.runs.config import resolve

        place, folder = f"in {self.path / SHAPING}", self.path.resolve()
        return [resolve(overrides=one, place=place, folder=folder) for one in self.settings]

    def __repr__(self) -> str:
        return f"Shaping({str(self.path)!r})"

    @property
    def status(self) -> str:
        """Return "finished", "running" or "interrupted"."""
        if self._directory.is_finished:
            return "finished"
        return "running" if self._directory.is_in_use else "interrupted"

    @property
    def tasks(self) -> list[str]:
        """World and environment of every stage, in order."""
        return [outline.task for outline in self.outlines]

    @property
    def methods(self) -> list[str]:
        """The method of every stage, in order."""
        return [outline.method for outline in self.outlines]

    @property
    def stages(self) -> list[Run]:
        """The stages that have begun, in order.

        Raises:
            UsageError: a stage differs from the plan.
        """
        begun: list[Run] = []
        for number, run_id in enumerate(self.run_ids, start=1):
            if not is_there(self._stage_path(number) / CONFIG):
                break
            run = Run(self._stage_path(number))
            if run.provenance["run_id"] != run_id:
                raise UsageError(f"{run.path} is not stage {number} of {self.path / SHAPING}")
            begun.append(run)
        return begun

    def generations(self) -> list[Record]:
        """Return the record of every finished generation of all stages, each with its task.

        A record begins with the generation's ``number`` through all stages, its ``stage`` (from 1)
        and its ``task``: world and environment. The run's own record follows.
        """
        found: list[Record] = []
        for stage, run in enumerate(self.stages, start=1):
            found += [
                {"number": number, **self.place(stage), **record}
                for number, record in enumerate(run.generations(), start=len(found))
            ]
        return found

    def frame(self) -> DataFrame:
        """Return ``generations`` as a pandas DataFrame, with the columns of ``Run.frame``.

        Raises:
            EnvironmentFailure: pandas is not installed.
        """
        from conevo.runs.frames import generations_frame, header_of

        stages = self.stages
        header = header_of(stages[0].provenance if stages else {}, lambda: self.configs[0])
        first = {"number": "int64", "stage": "int64", "task": "str"}
        return generations_frame(self.generations(), header, first)

    @property
    def sessions(self) -> list[Mapping[str, Any]]:
        """The sessions of all stages, with generations numbered through all stages."""
        found: list[Mapping[str, Any]] = []
        before = 0
        for run in self.stages:
            found += sessions_of(run.provenance, before)
            before += len(run.generations())
        return found

    def place(self, stage: int) -> Record:
        """Return a stage's number and its task."""
        return {"stage": stage, "task": self.tasks[stage - 1]}

    def test(
        self,
        scenarios: int | None = None,
        seed: int | None = None,
        *,
        threads: int | None = None,
        device: str | None = None,
    ) -> list[Record]:
        """Re-execute the last stage's fittest team in the environment of every stage begun.

        Args:
            scenarios: number for each stage, by default that of the stage's own testing phase.
            seed: of other scenarios than those.
            threads, device: as for ``resume``.

        Returns:
            A result for each stage: ``stage``, its ``task``, the stage of the team (``team_of``),
            then the result of ``Run.test``.

        Raises:
            UsageError: no generation has finished yet, the stages have teams of different sizes,
                or other kernels than those of a stage.
        """
        stages = self.stages
        of, champion = len(stages), None
        while of and (champion := stages[of - 1].champion) is None:
            of -= 1
        if champion is None:
            raise without_team(self.path, self.generations())
        return [
            self.place(stage)
            | {"team_of": of}
            | run.test(scenarios, seed, threads=threads, device=device, team=champion)
            for stage, run in enumerate(stages, start=1)
        ]

    @property
    def product(self) -> Path | None:
        """The file that a finished shaping of these tasks produces, None without one."""
        makes = product_of(self.tasks) if self._directory.is_finished else None
        return self.path / makes.FILE if makes else None

    @property
    def changed_files(self) -> list[str]:
        """Files of a finished shaping that have changed since it was sealed."""
        return self._directory.check_seal() if self._directory.is_finished else []

    def refuse_finished(self) -> None:
        """Raise UsageError if the shaping is finished."""
        if self._directory.is_finished:
            show = f"conevo show {quoted(self.path)}"
            raise UsageError(f"{self.path} is finished; see it with '{show}'")

    def refuse_other_code(self, is_accepted: bool = False) -> None:
        """Raise UsageError for an earlier version of the world, or other code unless accepted."""
        if begun := self.stages:
            code = last_code(begun[-1].provenance)
            refuse_other_code(self.path, self.outlines[0].task, code, is_accepted)

    def resume(
        self,
        *,
        time_limit: float | TimeLimit | None = None,
        threads: int | None = None,
        device: str | None = None,
        progress: bool | None = None,
        watch: Watch | None = None,
        remark: Callable[[str], None] | None = None,
        accept_other_code: bool = False,
    ) -> Shaping:
        """Continue to the end of the last stage, bit for bit as without interruption.

        Choice: stages keep their length. A shaping that was planned longer has longer first
        stages, so that all that follows would be another; what a last stage may go on with is a
        run of its own that begins with its populations.

        Args:
            time_limit: seconds after which it stops at a checkpoint, as for ``Run.resume``.
            threads: CPU threads, all by default.
            device: by default the one of the last session, or the CPU if that is missing.
            progress: of every stage, as for ``Run.resume``.
            watch: called with the stage and the record of each finished generation.
            remark: called with a message about an unusable checkpoint.
            accept_other_code: continue results of another version; the runs record both.

        Raises:
            UsageError: finished, in use, made by other code, or a stage cannot be resumed.
            EnvironmentFailure: the machine refused; resume when it no longer does.
        """
        limit = time_limit if isinstance(time_limit, TimeLimit) else TimeLimit(time_limit)

        def carry(run: Run, _: int) -> None:
            run.resume(
                time_limit=limit,
                threads=threads,
                device=device,
                progress=progress,
                watch=watch,
                remark=remark,
                accept_other_code=accept_other_code,
            )

        return self.carry_on(carry, threads, device, accept_other_code)

    def carry_on(
        self,
        carry: Callable[[Run, int], object],
        threads: int | None = None,
        device: str | None = None,
        accept_other_code: bool = False,
    ) -> Shaping:
        """Begin one stage after another; ``carry`` resumes each to its end.

        Args:
            carry: called with each unfinished stage and its number, from 1. If the stage is still
                unfinished afterwards, the shaping stops there.
            threads, device, accept_other_code: as for ``resume``.

        Raises:
            UsageError: finished, in use, or made by other code.
        """
        self.refuse_finished()
        self.refuse_other_code(accept_other_code)
        with self._directory.locked():
            self.refuse_finished()
            for number in range(1, len(self.outlines) + 1):
                run = self._stage(number, threads, device)
                if run.status != "finished":
                    carry(run, number)
                if run.status != "finished":
                    return self
                self._write_generations()
            if makes := product_of(self.tasks):
                makes.save(self.stages, self.path / makes.FILE)
            self._directory.seal()
        return self

    def _write_generations(self) -> None:
        """Write the records of all generations so far, one per line."""
        lines = "".join(f"{json.dumps(one, allow_nan=False)}\n" for one in self.generations())
        path = self.path / GENERATIONS
        if not os.path.lexists(path) or read_bytes(path) != lines.encode():
            replace_file(path, lines.encode())

    def _stage(self, number: int, threads: int | None, device: str | None) -> Run:
        """Return a stage, which is begun if necessary; the previous ones are finished."""
        begun = self.stages
        if number <= len(begun):
            return begun[number - 1]
        about = begun[-1].provenance if begun else {"device": self._device, "sessions": []}
        return start(
            self.configs[number - 1],
            self._stage_path(number),
            threads=threads,
            device=device_of(about, device),
            command=self._command,
            origin=begun[-1] if begun else None,
            of_champion=bool(begun) and begun[-1].outline.method != self.methods[number - 1],
        )

    def _stage_path(self, number: int) -> Path:
        return self.path / f"stage-{number}"


def label(configs: Sequence[RunConfig]) -> str:
    """Return a readable, unique directory name."""
    first, last = configs[0], configs[-1]
    to = "" if first.task == last.task else f"-to-{last.environment}"
    methods = "-to-".join(dict.fromkeys(config.method for config in configs))
    ids = hashlib.blake2b("".join(config.run_id for config in configs).encode(), digest_size=3)
    task = f"{first.task}{to}".replace("/", "-")
    return f"{task}-{methods}-{first.preset}-s{first.run.seed}-{ids.hexdigest()}"


def _read(path: Path) -> dict[str, Any]:
    """Return the content of a shaping file, with settings and outlines; loads no world."""
    from conevo.runs.records import ShapingText

    try:
        about = read_toml(path)
        if about["format"] != FORMAT:
            raise UsageError(f"{path} was written by another version of conevo")
        check(about, ShapingText, f"{path} is damaged")
        stages, run_ids = about["stages"], about["run_ids"]
        tasks = about.get("tasks", ["" for _ in stages])
        settings = [flattened(stage) for stage in stages]
        found = {name: about[name] for name in ("command", "device")}
        outlines = [
            outline_of(stage, task, str(path)) for stage, task in zip(stages, tasks, strict=True)
        ]
        is_changed = len(run_ids) != len(stages) or any(
            identify(stage, one.task) != run_id
            for stage, one, run_id in zip(stages, outlines, run_ids, strict=True)
            if "/" in one.task  # conevo 0.1.0 did not write the name of a world in a file
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(f"{path} is damaged: {error}") from error
    if is_changed:
        raise UsageError(f"{path} was changed after the shaping was started; start another one")
    return found | {"settings": settings, "outlines": outlines, "run_ids": run_ids}
