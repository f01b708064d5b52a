"""The signal of a method: the part of its fitness that is the genotypes' own.

A method whose state is ``evolution.generation.Populations`` tries the same genotypes over and over:
their genes stay the same, every trial has its own root, and so its own partners, and is played in
its own scenario, which all genotypes meet. The method's own ask and tell compute the fitness of a
trial. ``repeatability`` computes the numbers.

- Choice: one trial is one team evaluation of one epoch; a scheme has rounds x epochs of them.
  Elite trials (type C) are left out: they rank a few genotypes again.
- Choice: a sample of genotypes is tried, which are each other's partners: twenty of each slot, of
  a single population three for every robot. Under "systematic" they are tried as under "shared",
  R or R x U at once, since partners are drawn alike; but one by one, and five of each slot, where
  partners come from an elite.
- Choice: scenarios are fresh even where those of a run are fixed.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.evolution.generation import Populations
from conevo.evolution.protocol import Method, Scores, State, Trials
from conevo.rng import fold, stream
from conevo.runs.config import RunConfig
from conevo.runs.evaluation import play
from conevo.runs.lab import Lab
from conevo.runs.run import Run
from conevo.runs.store import Store
from conevo.studies.repeatability import Repeatability, repeatability, spearman_brown, trials_for
from conevo.terms import counted
from conevo.typing import Record

__all__ = ["TRIALS", "Unmeasured", "measure_signal", "signal_study"]

GENOTYPES, PER_ROBOT, ALONE, TRIALS = 20, 3, 5, 50
BATCH = 1000  # teams that are played at once
MOST_TRIALS = 10_000  # whose fitness fits into memory in any world; reliability needs far fewer
Announce = Callable[[str], None]
Advance = Callable[[int, int], None]


class Unmeasured(UsageError):
    """A method has no signal that could be measured with any number of trials."""


@dataclass(frozen=True)
class _Subject:
    """Populations to be measured.

    Attributes:
        generation: "first" or "last".
        method: with the genotypes that are tried, one trial each.
        state: with these genotypes, before they are tried.
        of: genotypes of each slot in all.
    """

    generation: str
    method: Method
    state: Populations
    of: int

    @property
    def n_teams(self) -> int:
        """Team evaluations of one trial of all genotypes."""
        return len(self.method.ask(self.state).teams)

    def trial(self, seed: int, k: int) -> tuple[Populations, Trials]:
        """Return the state of the k-th trial and what its method asks for."""
        root = fold(seed, "signal", k)
        progress = dataclasses.replace(self.state.progress, root=root)
        state = dataclasses.replace(self.state, progress=progress)
        return state, self.method.ask(state)


def measure_signal(
    of: Run | RunConfig,
    units: int | None = None,
    trials: int = TRIALS,
    *,
    threads: int | None = None,
    device: str | None = None,
    announce: Announce | None = None,
    advance: Advance | None = None,
) -> Record:
    """Measure the signal of the first and the last populations of a run; writes nothing.

    Args:
        of: a run, finished or not; its last populations are those of its newest checkpoint. Or the
            configuration of a run, which has first populations only.
        units: genotypes that are tried of each population or, of neurons, each sub-population.
        trials: of each genotype.
        threads, device: as for ``Run.resume`` and ``conevo.evolve``; they change no result.
        announce: called with the cost before the start.
        advance: called with the trials that are done, and those of the whole measurement.

    Returns:
        Plain data: task, method, credit, and signal, a row for each of the two:

        unit: what is tried: "neuron", "network" or "clone team".
        generation: "first" or "last"; number: of the generation.
        populations, slots, genotypes, trials: how many were tried; of: genotypes there are.
        icc, standard_error, low, high: see ``Repeatability``; of one trial.
        scheme: trials that the method gives each genotype, rounds x epochs.
        icc_of_scheme, low_of_scheme, high_of_scheme: the reliability of their mean.
        rounds_for_half: rounds (of ``epochs`` trials) whose mean has reliability .5.
        left_out: genotypes with a fitness that was not finite.

    Raises:
        Unmeasured: the method has no populations.
        UsageError: these numbers are not allowed, or the run was made with other kernels.
    """
    lab = (
        of.equip(threads, device)
        if isinstance(of, Run)
        else Lab.equip(of, threads, device or "cpu")
    )
    if not 2 <= trials <= MOST_TRIALS:
        raise UsageError(f"trials = {trials}: a signal takes 2 to {MOST_TRIALS:,} trials")
    if units is not None and units < 2:
        raise UsageError(f"units = {units}: a signal takes two genotypes to compare, or more")
    states = _states(of, lab) if isinstance(of, Run) else {"first": lab.first_state()}
    subjects = [_subject(lab, name, state, units) for name, state in states.items()]
    if announce is not None:
        announce(_price(lab, subjects, trials))
    return {
        "task": lab.config.task,
        "method": lab.config.method,
        "credit": lab.config.run.credit,
        "signal": [
            _row(lab, one, trials, _part_of(advance, k * trials, len(subjects) * trials))
            for k, one in enumerate(subjects)
        ],
    }


def _part_of(advance: Advance | None, before: int, of: int) -> Callable[[int], None]:
    """Return a function of the trials of one subject, which follow those of others."""
    return lambda done: advance(before + done, of) if advance is not None else None


def signal_study(run: Run, *, threads: int | None = None) -> Record:
    """Return the signal of a run in the form that a campaign keeps.

    Returns:
        Of a method without a signal that could be measured: no rows, and why as not_measured.
    """
    config = run.config
    about = {"task": config.task, "method": config.method, "credit": config.run.credit}
    try:
        return measure_signal(run, threads=threads) | {"not_measured": ""}
    except Unmeasured as error:
        return about | {"signal": [], "not_measured": str(error)}


def _states(run: Run, lab: Lab) -> dict[str, State]:
    """Return the states with the first populations of a run, and with its last if it has others."""
    store, name, blank = Store(run.path), lab.config.method, lab.blank_state()
    states = {"first": store.load_origin(name, blank) or blank}
    last, _ = store.load_checkpoint(name, blank)
    if last is not None and last.progress.generation:
        states["last"] = last
    return states


def _subject(lab: Lab, generation: str, state: State, units: int | None) -> _Subject:
    """Return a sample of the genotypes of a state, and the method that tries each of them once."""
    config, title = lab.config.method_config, lab.method.title
    if not isinstance(state, Populations):
        raise Unmeasured(
            f"{title} has no populations whose genotypes could be tried one by one (its state is "
            f"not a {Populations.__module__}.{Populations.__name__}), so its signal cannot be "
            f"measured; see 'conevo show RUN' for the method's own measures, if it has any"
        )
    of, there = state.genes.shape[2], {field.name for field in dataclasses.fields(config)}
    is_alone = "evaluation" in there and getattr(state, "partners", np.empty(0)).size > 0
    usual = GENOTYPES
    if is_alone:
        usual = ALONE
    elif len(state.genes) == 1:
        usual = max(GENOTYPES, PER_ROBOT * lab.world.n_robots)
    n = min(units or usual, of) if "genotypes" in there else of
    changes: dict[str, Any] = {"genotypes": n, "rounds": 1}
    if "evaluation" in there and not is_alone:
        changes |= {"evaluation": "shared", "partners": "any"}
    known = {name: value for name, value in changes.items() if name in there}
    method = lab.config.method_entry.build(dataclasses.replace(config, **known))
    blank: Any = method.init(lab.layout, state.root)
    chosen = np.sort(stream(state.root, "signal").permutation(of)[:n])
    sample = dataclasses.replace(
        state, genes=state.genes[:, :, chosen], fitness=blank.fitness, elite=blank.elite
    )
    if problem := sample.problem(blank):
        raise Unmeasured(
            f"{title}: {problem} of its state belongs to all {of} genotypes, so no sample of them "
            f"can be tried: ask for {of}"
        )
    return _Subject(generation, method, sample, of)


def _price(lab: Lab, subjects: list[_Subject], trials: int) -> str:
    """Return the genotypes and trials, and their cost in team evaluations."""
    one = subjects[0]
    n_populations, _, n, _ = one.state.genes.shape
    plays = lab.config.run.plays(lab.world.n_robots)
    teams = trials * plays * sum(subject.n_teams for subject in subjects)
    slots = int(one.state.active.sum())
    parts = n_populations if one.state.fitness.ndim == 2 else slots
    kind = "population" if one.state.fitness.ndim == 2 else "sub-population"
    when = "at first and at last, " if len(subjects) > 1 else ""
    return (
        f"{counted(n, 'genotype')} of {one.of:,} in {counted(parts, kind)}, {when}"
        f"{trials:,} trials each: {counted(teams, 'team evaluation')} of "
        f"{counted(lab.world.params.iterations, 'iteration')}"
    )


def _row(lab: Lab, subject: _Subject, trials: int, advance: Callable[[int], None]) -> Record:
    """Return the results of one subject."""
    state, run = subject.state, lab.config.run
    fitness, is_clones = _try(lab, subject, trials, advance)
    if state.fitness.ndim == 2:
        fitness, unit = fitness[:, :, None], "clone team" if is_clones else "network"
        active = np.ones((len(state.genes), 1), dtype=np.bool_)
    else:
        unit, active = "neuron", state.active
    found = repeatability(np.where(active[:, :, None], fitness, np.nan))
    n_genotypes = fitness.shape[-1]
    method = lab.config.method_config
    is_shared = getattr(method, "evaluation", "") == "shared"
    rounds = method.rounds if is_shared else 1
    needed = trials_for(found.icc)
    return {
        "unit": unit,
        "generation": subject.generation,
        "number": state.generation,
        "populations": len(state.genes),
        "slots": int(active.sum()),
        "genotypes": n_genotypes,
        "of": subject.of,
        "trials": trials,
        "icc": found.icc,
        "standard_error": found.standard_error,
        "low": found.low,
        "high": found.high,
        **_of_scheme(found, rounds * run.epochs),
        "rounds_for_half": None if needed is None else needed / run.epochs,
        "left_out": int(active.sum()) * n_genotypes - found.n_units,
    }


def _of_scheme(found: Repeatability, n_trials: int) -> Record:
    """Return the reliability of the mean of a scheme's trials, with its interval."""
    named = {"icc_of_scheme": found.icc, "low_of_scheme": found.low, "high_of_scheme": found.high}
    return {"scheme": n_trials} | {
        name: None if value is None else spearman_brown(min(value, 1.0), n_trials)
        for name, value in named.items()
    }


def _try(
    lab: Lab, subject: _Subject, trials: int, advance: Callable[[int], None]
) -> tuple[npt.NDArray[np.float64], bool]:
    """Return the fitness of every trial [K, P, (U,) M], and whether all teams were clones."""
    seed, batch = lab.config.run.seed, max(1, BATCH // subject.n_teams)
    found: list[npt.NDArray[np.float64]] = []
    is_clones = lab.world.n_robots > 1
    for first in range(0, trials, batch):
        numbers = range(first, min(first + batch, trials))
        asked = [subject.trial(seed, k) for k in numbers]
        scores = _play(lab, [one for _, one in asked], numbers)
        for (state, trial), score_of in zip(asked, scores, strict=True):
            told: Any = subject.method.tell(state, trial, score_of)
            graded: Any = getattr(told, "fitness", 0.0)
            if np.shape(graded) != state.fitness.shape:
                raise Unmeasured(
                    f"{subject.method.title}: ask and tell leave no fitness "
                    f"{list(state.fitness.shape)} after one request, so its signal cannot be "
                    f"measured"
                )
            found.append(np.asarray(graded, dtype=np.float64))
            is_clones = is_clones and bool((trial.teams == trial.teams[:, :1]).all())
        advance(numbers.stop)
    return np.stack(found), is_clones


def _play(lab: Lab, asked: list[Trials], numbers: range) -> list[Scores]:
    """Return the scores of several trials, each played in the scenario of its number."""
    starts = np.cumsum([0, *(len(one.genes) for one in asked)])
    teams = np.concatenate(
        [
            np.where(one.teams < 0, -1, one.teams + start)
            for one, start in zip(asked, starts[:-1], strict=True)
        ]
    )
    genes = np.concatenate([one.genes for one in asked])
    keys = [fold(lab.config.run.seed, "signal scenario", k) for k in numbers]
    scores = play(
        lab.simulator,
        genes.astype(np.float32),
        teams.astype(np.int32),
        lab.world.scenarios(keys),
        len(asked),
        lab.config.run.credit,
    ).scores
    n = len(asked[0].teams)
    return [_rows_of(scores, slice(k * n, (k + 1) * n)) for k in range(len(asked))]


def _rows_of(scores: Scores, teams: slice) -> Scores:
    """Return the scores of some of the teams."""
    some: dict[str, Any] = {
        n: v[teams] for n, v in vars(scores).items() if isinstance(v, np.ndarray)
    }
    return dataclasses.replace(scores, **some)
