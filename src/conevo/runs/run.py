"""A run: one seeded experiment on disk, finished or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from conevo.errors import UsageError, without_team
from conevo.runs import provenance
from conevo.runs.code import last_code, refuse_other_code, refuse_other_kernels
from conevo.runs.outline import Outline
from conevo.runs.store import Store
from conevo.runs.time_limit import TimeLimit
from conevo.terms import quoted
from conevo.typing import Record

# A run is shown more often than continued: the simulator is loaded where it is used.
if TYPE_CHECKING:
    from pandas import DataFrame

    from conevo.runs.champions import Team
    from conevo.runs.config import RunConfig
    from conevo.runs.lab import Lab

__all__ = ["RUNS", "Run"]

RUNS = Path("runs")  # default folder of runs
Watch = Callable[["Run", Record], None]


class Run:
    """A run on disk, finished or not.

    Args:
        path: its directory, or its store.

    Raises:
        UsageError: ``path`` is not a run.
    """

    def __init__(self, path: str | Path | Store, lab: Lab | None = None) -> None:
        self._store = path if isinstance(path, Store) else Store(Path(path))
        self._lab = lab
        self.path = self._store.path
        self.outline: Outline = self._store.read_outline()

    @cached_property
    def config(self) -> RunConfig:
        """All its settings; this loads its world.

        Raises:
            UsageError: the world's file is missing, or has changed.
        """
        return self._store.read_config()

    def __repr__(self) -> str:
        return f"Run({str(self.path)!r})"

    def _repr_html_(self) -> str:
        from conevo.runs.html import run_card

        return run_card(self)

    @property
    def status(self) -> str:
        """Return "finished", "running" or "interrupted"."""
        if self._store.is_finished:
            return "finished"
        return "running" if self._store.is_in_use else "interrupted"

    @property
    def provenance(self) -> Record:
        """Versions, kernel hash, machine and sessions."""
        return self._store.read_provenance()

    @property
    def champion(self) -> Team | None:
        """The run's best team, None before the end of the first generation.

        For a finished run it is the finalist that validation chose, else the fittest so far in the
        scenarios that the fittest teams of all generations meet.
        """
        return self._store.load_champion()

    @property
    def test_result(self) -> Record | None:
        """The testing phase of a finished run, else None.

        "champion" and "generation_0" are tests of these teams, "validation" records how the
        champion was chosen; runs of conevo 0.1.0 have none.
        """
        return self._store.read_test()

    @property
    def changed_files(self) -> list[str]:
        """Files of a finished run that have changed since it was sealed."""
        return self._store.check_seal() if self._store.is_finished else []

    @property
    def run_ids(self) -> tuple[str, ...]:
        """Its only id; a shaping has one for every stage."""
        return (self.provenance["run_id"],)

    def done(self) -> tuple[int, int]:
        """Return the number of finished generations, and of their team evaluations."""
        return self._store.count_generations()

    def tables(self) -> dict[str, Any]:
        """Return the three tables of its configuration as they are written; loads no world."""
        return self._store.read_tables()

    def generations(self) -> list[Record]:
        """Return the record of every finished generation."""
        return self._store.read_generations()

    def frame(self, table: str = "generations") -> DataFrame:
        """Return "generations", "tests", "robots" or "finalists" as a pandas DataFrame.

        Raises:
            UsageError: no such table.
            EnvironmentFailure: pandas is not installed.
        """
        from conevo.runs.frames import frame_of

        return frame_of(self, table)

    def team(self, generation: int) -> Team | None:
        """Return the fittest team of a generation, None if it was not kept."""
        return self._store.load_team(generation)

    def team_again(
        self, generation: int, lab: Lab, progress: Callable[[int, int], None] | None = None
    ) -> Team:
        """Return the fittest team of a finished generation; one that was not kept is evolved again.

        Args:
            generation: of the team.
            lab: this run's.
            progress: called with the numbers of finished and of all generations to evolve again.

        Raises:
            UsageError: no such generation, or the result differs from the log.
        """
        records = self.generations()
        if not 0 <= generation < len(records):
            last = f"0 to {len(records) - 1}" if records else "none yet"
            raise UsageError(f"{self.path} has no generation {generation} (it has {last})")
        if (kept := self.team(generation)) is not None:
            return kept
        from conevo.runs.session import evolve_again

        return evolve_again(self._store, lab, generation, progress)

    def resume(
        self,
        *,
        generations: int | None = None,
        budget_evaluations: int | None = None,
        target: float | Literal["none"] | None = None,
        time_limit: float | TimeLimit | None = None,
        threads: int | None = None,
        device: str | None = None,
        progress: bool | None = None,
        watch: Watch | None = None,
        remark: Callable[[str], None] | None = None,
        accept_other_code: bool = False,
    ) -> Run:
        """Continue from the last checkpoint to the end, bit for bit as without interruption.

        With another length (see ``extend``), a finished run is continued, too.

        Args:
            generations, budget_evaluations, target: another length, if any of them is given.
            time_limit: seconds after which it stops at a checkpoint; its status is then
                "interrupted", and it can be resumed again.
            threads: CPU threads, all by default.
            device: by default the one of the last session, or the CPU if that is missing.
            progress: None: a bar in a notebook, nothing elsewhere; True: a printed line per
                generation elsewhere; False: nothing.
            watch: called with the run and the record of each finished generation.
            remark: called with a message about an unusable checkpoint.
            accept_other_code: continue results of another version; the run records both.

        Raises:
            UsageError: finished (without another length), in use, made by other code or with other
                kernels, no usable checkpoint, or a length shorter than the finished part.
            EnvironmentFailure: the machine refused; the run can be resumed later.
        """
        from conevo.runs.notebook import showing
        from conevo.runs.session import evolve_on, finish

        limit = time_limit if isinstance(time_limit, TimeLimit) else TimeLimit(time_limit)
        if any(given is not None for given in (generations, budget_evaluations, target)):
            self.extend(
                generations,
                budget_evaluations,
                target,
                threads=threads,
                device=device,
                accept_other_code=accept_other_code,
            )
        self.refuse_finished()
        self.refuse_other_code(accept_other_code)
        with self._open(), showing(self, progress, watch) as show:
            self.refuse_finished()
            lab = self.equip(threads, device)
            stopped_by = evolve_on(self._store, lab, limit, watch=show, remark=remark)
            if stopped_by != "time":
                finish(self._store, lab, stopped_by)
        return self

    def extend(
        self,
        generations: int | None = None,
        budget_evaluations: int | None = None,
        target: float | Literal["none"] | None = None,
        *,
        threads: int | None = None,
        device: str | None = None,
        accept_other_code: bool = False,
    ) -> Run:
        """Change the length of the run, finished or not; ``resume`` then continues it.

        The result equals, bit for bit, that of a run planned that long, including ``config.toml``
        and the run's id. The provenance keeps the former end.

        Args:
            generations: new number of generations.
            budget_evaluations: new limit of team evaluations; 0: no limit.
            target: new main task performance at which the run ends; "none" removes it.
            threads, device, accept_other_code: as for ``resume``.

        Raises:
            UsageError: shorter than the finished part; a finished run that would not continue, or
                was changed; part of a shaping or campaign, in use, or made by other code.
            EnvironmentFailure: the machine refused.
        """
        from conevo.runs.length import length_of, refuse_parts

        length = length_of(generations, budget_evaluations, target)
        refuse_parts(self.path, length)
        self.refuse_other_code(accept_other_code)
        with self._open():
            self._extend(self.config.of_length(length), threads, device, is_later=True)
        return self

    def extend_as(
        self,
        config: RunConfig,
        *,
        threads: int | None = None,
        device: str | None = None,
        accept_other_code: bool = False,
    ) -> Run:
        """Give the run the length of another configuration; ``resume`` continues it.

        With this length the run may end where it has already ended.

        Args:
            config: the run's own with another length.
            threads, device, accept_other_code: as for ``resume``.

        Raises:
            UsageError: as ``extend``, or the configuration is of another run.
            EnvironmentFailure: the machine refused.
        """
        self.refuse_other_code(accept_other_code)
        with self._open():
            self._extend(config, threads, device)
        return self

    def _extend(
        self, config: RunConfig, threads: int | None, device: str | None, is_later: bool = False
    ) -> None:
        """Give the run the length of a configuration; see ``give_length``."""
        from conevo.runs.length import give_length

        lab = give_length(self._store, config, lambda: self.equip(threads, device), is_later)
        self.outline, self.config, self._lab = config.outline, config, lab

    @contextmanager
    def _open(self) -> Iterator[None]:
        """Lock the run, and read its settings again, which other processes may have changed."""
        with self._store.locked():
            self._store.settle()
            self.outline, self.config = self._store.read_outline(), self._store.read_config()
            yield

    def test(
        self,
        scenarios: int | None = None,
        seed: int | None = None,
        *,
        threads: int | None = None,
        device: str | None = None,
        team: Team | None = None,
    ) -> Record:
        """Re-execute the fittest team so far in fresh scenarios; writes nothing.

        Args:
            scenarios: number of scenarios, by default that of the run's own testing phase.
            seed: of other scenarios than those of the run's own testing phase.
            threads, device: as for ``resume``.
            team: another run's team with the same numbers of robots and genes.

        Raises:
            UsageError: no generation has finished yet, other kernels, or a number of scenarios or a
                seed out of bounds.
        """
        from conevo.runs.testing import refuse_numbers

        refuse_numbers(scenarios, seed)
        champion = team or self.champion
        if champion is None:
            raise without_team(self.path, self.generations())
        return self._test(self.equip(threads, device), champion, scenarios, seed)

    def test_under(
        self,
        on: str | None = None,
        world: Mapping[str, Any] | None = None,
        robots: int | None = None,
        scenarios: int | None = None,
        seed: int | None = None,
        *,
        rotate: int = 0,
        threads: int | None = None,
        device: str | None = None,
    ) -> Record:
        """Test the champion under changed conditions; see ``conevo.runs.conditions.test_under``.

        Args:
            on: another environment, of this world or of one with controllers of the same sizes.
            world: settings of the world, for example ``{"world.iterations": 500}``.
            robots: in the team.
            rotate: places that controllers move on: robot r has that of robot r - rotate.
            scenarios, seed, threads, device: as for ``test``.
        """
        from conevo.runs.conditions import test_under

        return test_under(self, on, world or {}, robots, rotate, scenarios, seed, threads, device)

    def _test(
        self, lab: Lab, team: Team, scenarios: int | None = None, seed: int | None = None
    ) -> Record:
        from conevo.runs.testing import test_team

        lab.refuse_other_team(team, self.path)
        return test_team(
            lab.simulator,
            lab.world,
            team,
            n_scenarios=scenarios or self.config.run.n_tests,
            seed=self.config.run.seed if seed is None else seed,
        )

    def refuse_finished(self) -> None:
        """Raise UsageError if the run is finished."""
        if self._store.is_finished:
            path = quoted(self.path)
            raise UsageError(
                f"{self.path} is finished; see it with 'conevo show {path}', or continue it "
                f"with 'conevo resume {path} --generations N', N above {self.done()[0]}"
            )

    def refuse_other_code(self, is_accepted: bool = False) -> None:
        """Raise UsageError for an earlier version of the world, or other code unless accepted."""
        refuse_other_code(self.path, self.outline.task, last_code(self.provenance), is_accepted)

    def equip(self, threads: int | None, device: str | None) -> Lab:
        """Return the run's lab, after checking that its kernels are those of the start."""
        from conevo.runs.lab import Lab

        lab, self._lab = self._lab, None
        about = self.provenance
        if lab is None or device not in (None, lab.device):
            lab = Lab.equip(self.config, threads, provenance.device_of(about, device))
        refuse_other_kernels(self.path, about, lab.simulator.fingerprint)
        return lab
