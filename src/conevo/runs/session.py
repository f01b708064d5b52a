"""A session of a run: from its last checkpoint to its end or the time limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from conevo.errors import UsageError
from conevo.evolution.protocol import State
from conevo.runs import provenance
from conevo.runs.champions import Team, finalists, fittest_team, sampled_generations
from conevo.runs.evaluation import describe
from conevo.runs.lab import Lab, refuse_other_state
from conevo.runs.loop import evolve_generations
from conevo.runs.store import Store
from conevo.runs.testing import test_team, validate
from conevo.runs.time_limit import TimeLimit
from conevo.typing import Record
from conevo.worlds.measures import measures_of

__all__ = ["evolve_again", "evolve_on", "finish"]


def evolve_on(
    store: Store,
    lab: Lab,
    limit: TimeLimit,
    *,
    watch: Callable[[Record], object],
    remark: Callable[[str], None] | None,
) -> str:
    """Evolve and record one generation after another, and return why it stopped.

    Args:
        store: of the run, which this process has locked.
        lab: the run's.
        limit: the time that is left.
        watch: called with the record of each finished generation.
        remark: called with a message about an unusable checkpoint.

    Returns:
        "generations", "target" or "budget" at the end; "time" if the run has none left.

    Raises:
        UsageError: a file is lost or damaged.
        EnvironmentFailure: the machine refused.
    """
    settings, method, blank = lab.config.run, lab.config.method, lab.blank_state()
    state, problem = store.load_checkpoint(method, blank)
    if state is None:
        state = store.load_origin(method, blank) or lab.first_state()
    refuse_other_state(state, blank, store.path)
    del blank  # as large as the state
    generation = state.progress.generation
    if problem and remark is not None:
        remark(f"{problem}; going on from generation {generation} instead")
    records = store.cut_generations(generation)
    champion, best = store.load_champion(), _best_so_far(store) if records else []
    best = [team for team in best if team.generation < generation]  # others are evolved again
    newest = saved = state
    seconds: list[float] = []  # of the generations of this session
    about = store.read_provenance()
    session = {
        "started": provenance.now(),
        "from_generation": generation,
        "threads": lab.simulator.n_threads,
        **provenance.describe_machine(lab.device),
    }
    store.write_provenance(about | {"sessions": [*about["sessions"], session]})

    def keep(state: State, record: Record) -> None:
        nonlocal champion, best, newest, saved
        progress = state.progress
        team = fittest_team(progress, record["generation"])
        best = finalists(best, team, settings.n_finalists)
        if any(one is team for one in best):
            store.save_finalists(best)
        if champion is None or champion.generation != best[0].generation:
            champion = best[0]
            store.save_champion(champion)
        if team.generation in sampled_generations(progress.generation):
            store.save_team(team)
        store.append(record)
        newest = state
        seconds.append(record["seconds"])
        if progress.generation % settings.checkpoint_every == 0:
            store.save_checkpoint(state, method)
            saved = state
        watch(record)

    try:
        return evolve_generations(
            lab.method,
            state,
            lab.evaluate,
            settings=settings,
            main=measures_of(lab.world)[0],
            portray=partial(describe, world=lab.world),
            iterations=lab.world.params.iterations,
            last=records[-1] if records else None,
            on_generation=keep,
            has_time=lambda: not seconds or limit.has_time(max(seconds)),
        )
    finally:
        if newest is not saved:
            store.save_checkpoint(newest, method)


def finish(store: Store, lab: Lab, stopped_by: str) -> None:
    """Choose the champion among the finalists, test it, and seal the run."""
    settings, records = lab.config.run, store.read_generations()
    champion, validation = validate(
        lab.simulator,
        lab.world,
        _best_so_far(store),
        n_scenarios=settings.n_validations,
        seed=settings.seed,
        credit=settings.credit,
        selected={one["generation"]: one["performance"] for one in records},
    )
    store.save_champion(champion)
    tested = {"champion": champion, "generation_0": store.load_team(0) or champion}
    scenarios = {"n_scenarios": settings.n_tests, "seed": settings.seed}
    result = {
        name: test_team(lab.simulator, lab.world, team, **scenarios)
        for name, team in tested.items()
    }
    store.write_test(result | {"validation": validation})
    store.thin_teams(sampled_generations(len(records)))
    about = store.read_provenance() | {"finished": provenance.now(), "stopped_by": stopped_by}
    store.write_provenance(about)
    store.seal()


def evolve_again(
    store: Store,
    lab: Lab,
    generation: int,
    progress: Callable[[int, int], None] | None = None,
) -> Team:
    """Return the fittest team of a finished generation that was not kept.

    Args:
        store: of the run.
        lab: the run's.
        generation: of the team.
        progress: called with the numbers of finished and of all generations.

    Raises:
        UsageError: the result differs from the log.
    """
    records = store.read_generations()
    teams: list[Team] = []

    def keep(state: State, record: Record) -> None:
        if record["team_fitness"] != records[record["generation"]]["team_fitness"]:
            raise UsageError(
                f"{store.path}: generation {record['generation']} evolves differently from its "
                f"log, so the team of generation {generation} is lost"
            )
        teams[:] = [fittest_team(state.progress, record["generation"])]
        if progress is not None:
            progress(record["generation"] + 1, generation + 1)

    evolve_generations(
        lab.method,
        store.load_origin(lab.config.method, lab.blank_state()) or lab.first_state(),
        lab.evaluate,
        settings=replace(lab.config.run, generations=generation + 1, target=None),
        main=measures_of(lab.world)[0],
        portray=partial(describe, world=lab.world),
        iterations=lab.world.params.iterations,
        on_generation=keep,
    )
    return teams[0]


def _best_so_far(store: Store) -> list[Team]:
    """Return the finalists of a run with at least one generation."""
    teams = store.load_finalists()
    if not teams and "code" not in store.read_provenance():  # conevo 0.1.0 kept the champion alone
        teams = [team for team in [store.load_champion()] if team is not None]
    if not teams:
        raise UsageError(f"{store.path} has lost its finalists.npz: it cannot be resumed")
    return teams
