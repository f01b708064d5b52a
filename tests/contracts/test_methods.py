"""What every method promises; a registry entry enrols it."""

import io
import json
from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest

from conevo.evolution import METHODS, Layout, Scores, State, method

LAYOUT = Layout(n_robots=3, n_hidden=3, max_hidden=5, n_genes=4)
GENOTYPES = 6
ROUNDS = 4


def variants():
    """Return (name, config) for every method and evaluation scheme, with short windows."""
    for name, entry in METHODS.items():
        names = {field.name for field in fields(entry.config_class)}
        windows = {"stagnation_v", "stagnation_w", "stagnation_y"} & names
        config = dict.fromkeys(sorted(windows), 1)
        if "evaluation" not in names:
            yield name, config
            continue
        for evaluation in ("systematic", "shared"):
            yield name, {**config, "evaluation": evaluation, "rounds": ROUNDS}
        if name == "cone":
            for type_c in ("team", "off"):
                yield name, {**config, "evaluation": "shared", "rounds": ROUNDS, "type_c": type_c}


VARIANTS = list(variants())
IDS = [
    "-".join([name, config.get("evaluation", "single"), *filter(None, [config.get("type_c")])])
    for name, config in VARIANTS
]
every_variant = pytest.mark.parametrize(("name", "config"), VARIANTS, ids=IDS)


def build(name, config):
    return method(name, genotypes=GENOTYPES, elite_portion=0.5, **config)


def judge(trials):
    """Return scores that depend on the networks and fall with time: controllers stagnate."""
    networks = trials.networks().astype(np.float64)
    fitness = np.sin(5 * networks).sum(axis=(2, 3)) - 5 * trials.generation
    return Scores(fitness, np.abs(networks[:, :, 0, 0]))


def run(learner, generations, root=3, score=judge, state=None):
    """Return all states on the way."""
    state = learner.init(LAYOUT, root) if state is None else state
    states = [state]
    while state.generation < generations:
        trials = learner.ask(state)
        state = learner.tell(state, trials, score(trials))
        states.append(state)
    return states


def assert_same(a, b):
    for field in fields(a):
        left, right = getattr(a, field.name), getattr(b, field.name)
        assert type(left) is type(right), field.name
        if isinstance(left, np.ndarray):
            assert left.dtype == right.dtype, field.name
        np.testing.assert_array_equal(left, right, err_msg=field.name)


def copied(state):
    return replace(
        state,
        **{
            f.name: getattr(state, f.name).copy()
            for f in fields(state)
            if isinstance(getattr(state, f.name), np.ndarray)
        },
    )


@every_variant
def test_state_is_plain_and_keeps_its_types(name, config):
    states = run(build(name, config), 6)
    dtypes = {
        f.name: getattr(states[0], f.name).dtype for f in fields(State) if f.type.endswith("Array")
    }
    for state in states:
        for field in fields(state):
            value = getattr(state, field.name)
            if field.name in dtypes:
                assert value.dtype == dtypes[field.name], field.name
                assert value.ndim == getattr(states[0], field.name).ndim, field.name
            else:
                assert type(value).__name__ == field.type, field.name


@every_variant
def test_genotypes_stay_in_range_and_empty_slots_empty(name, config):
    sizes = set()
    for state in run(build(name, config), 8):
        assert np.abs(state.genes).max() <= 1
        assert not state.genes[~state.active].any()
        assert state.active.sum(axis=1).tolist() == state.n_hidden.tolist()
        sizes.update(state.n_hidden.tolist())
    adapts = "stagnation_y" in config
    assert (sizes == {3}) == (not adapts)
    assert min(sizes) >= 2


@every_variant
def test_every_genotype_is_tried_exactly_as_often_as_promised(name, config):
    learner = build(name, config)
    for state in run(learner, 5):
        trials = learner.ask(state)
        n, r = np.indices(trials.teams.shape[:2])
        in_range = (trials.teams >= -1) & (trials.teams < len(trials.genes))
        assert in_range.all()
        if state.phase != "genotypes":
            continue
        own = np.arange(state.genes[..., 0].size).reshape(state.genes.shape[:3])
        if config.get("evaluation") == "shared":
            played = np.bincount(trials.teams[trials.teams >= 0], minlength=own.size)
            expected = np.where(state.active[:, :, None], ROUNDS, 0)
            np.testing.assert_array_equal(played.reshape(own.shape), expected + 0 * own)
            assert len(trials.teams) == ROUNDS * GENOTYPES
            continue
        # Robot r of team n scores n + r / 8: fitness tells which robot of which team was on trial.
        told = learner.tell(state, trials, Scores(n + r / 8, 0.0 * n))
        tried = told.fitness[np.isfinite(told.fitness)]
        team = np.floor(tried).astype(int)
        assert sorted(team) == list(range(len(trials.teams)))
        if told.fitness.ndim == 3:
            assert np.isfinite(told.fitness).all(axis=2).tolist() == state.active.tolist()
            row = own[np.isfinite(told.fitness)]
        else:
            row = own[:, 0].ravel()
        robot = np.round((tried - team) * 8).astype(int)
        assert (trials.teams[team, robot] == row[:, None]).any(axis=1).all()
        if told.fitness.ndim == 3:  # the robot on trial is that of the genotype's own population
            np.testing.assert_array_equal(robot, np.nonzero(np.isfinite(told.fitness))[0])


@every_variant
def test_every_team_evaluated_is_counted(name, config):
    learner = build(name, config)
    states = run(learner, 6)
    spent = 0
    for before, after in pairwise(states):
        spent += len(learner.ask(before).teams)
        assert after.team_evaluations == spent
        assert after.generation - before.generation == (after.phase == "genotypes")
    phases = {state.phase for state in states}
    has_type_c = name.startswith("cone") and config.get("type_c") != "off"
    assert ("elites" in phases) == has_type_c
    assert ("lesion" in phases) == ("stagnation_y" in config)


@every_variant
def test_ask_and_tell_are_pure(name, config):
    learner = build(name, config)
    for state in run(learner, 4):
        before = copied(state)
        trials, again = learner.ask(state), learner.ask(state)
        np.testing.assert_array_equal(trials.teams, again.teams)
        np.testing.assert_array_equal(trials.genes, again.genes)
        assert trials.teams.dtype == np.int32
        assert trials.genes.dtype == np.float32
        scores = judge(trials)
        kept = scores.fitness.copy(), scores.specialization.copy(), trials.teams.copy()
        assert_same(learner.tell(state, trials, scores), learner.tell(state, trials, scores))
        assert_same(state, before)
        np.testing.assert_array_equal(scores.fitness, kept[0])
        np.testing.assert_array_equal(scores.specialization, kept[1])
        np.testing.assert_array_equal(trials.teams, kept[2])


@every_variant
def test_the_seed_decides_everything(name, config):
    learner = build(name, config)
    first, second, other = (run(learner, 5, root)[-1] for root in (3, 3, 4))
    assert_same(first, second)
    assert (first.genes != other.genes).mean() > 0.3


@every_variant
def test_a_stored_state_resumes_bit_for_bit(name, config):
    learner = build(name, config)
    states = run(learner, 6)
    for stop in (1, len(states) // 2):
        arrays, rest = io.BytesIO(), {}
        for field in fields(State):
            value = getattr(states[stop], field.name)
            if not isinstance(value, np.ndarray):
                rest[field.name] = value
        named = {f.name: getattr(states[stop], f.name) for f in fields(State) if f.name not in rest}
        np.savez(arrays, **named)
        arrays.seek(0)
        with np.load(arrays, allow_pickle=False) as loaded:
            resumed = State(**loaded, **json.loads(json.dumps(rest)))
        assert_same(run(learner, 6, state=resumed)[-1], states[-1])


@every_variant
def test_the_finished_generation_is_described(name, config):
    learner = build(name, config)
    finished = 0
    for before in run(learner, 5):
        trials = learner.ask(before)
        scores = judge(trials)
        after = learner.tell(before, trials, scores)
        if before.phase == "genotypes":
            tried = after.fitness[np.isfinite(after.fitness)]
            assert (after.best_fitness, after.mean_fitness) == (tried.max(), tried.mean())
        if before.phase == "fittest":
            finished += 1
            np.testing.assert_array_equal(after.fittest_genes, trials.networks()[0])
            np.testing.assert_array_equal(after.fittest_active, trials.teams[0] >= 0)
            np.testing.assert_array_equal(after.fittest_fitness, scores.fitness[0])
            np.testing.assert_array_equal(after.fittest_specialization, scores.specialization[0])
    assert finished == 5


@every_variant
def test_scores_that_are_not_finite_rank_last_and_are_counted(name, config):
    def spoiled(trials):
        scores = judge(trials)
        fitness = scores.fitness.copy()
        fitness[0] = [np.nan, np.inf, -np.inf]
        return replace(scores, fitness=fitness)

    learner = build(name, config)
    states = run(learner, 5, score=spoiled)
    rounds = 0
    for before, after in pairwise(states):
        rounds += 3
        assert after.n_nonfinite == rounds
        if before.phase == "genotypes":
            bad = ~np.isfinite(after.fitness)
            n_good = (~bad).sum(axis=-1)
            in_elite = np.take_along_axis(bad, after.elite.astype(int), axis=-1).sum(axis=-1)
            expected = np.maximum(after.elite.shape[-1] - n_good, 0)
            assert in_elite.tolist() == expected.tolist()
            assert np.isfinite(after.best_fitness)
            assert np.isfinite(after.mean_fitness)
        if after.phase == "genotypes":
            rounds = 0
