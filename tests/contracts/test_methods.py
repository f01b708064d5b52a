"""The contract of methods; a registry entry enrols a method, and so does a file in examples/.

The first part applies to any genotype: it may be a neuron, a network or a whole team.
The second part is for methods that have populations of neurons or networks.
"""

import re
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from conevo.controllers.registry import controller
from conevo.evolution import METHODS, Layout, Scores, method
from conevo.evolution.generation import Populations
from conevo.evolution.methods.registry import name_in, resolve
from conevo.runs.checkpoint import difference, load_like, refuse_unkept, save

LAYOUT = Layout(n_robots=3, n_hidden=3, max_hidden=5, n_genes=4)
SIZES = {
    "graph": {"max_hidden": 2},
    "srn": {"n_hidden": 3, "max_hidden": 4},
}  # of controllers that some methods need
GENOTYPES = 6
ROUNDS = 4
EXCHANGE = {  # every option of the exchange between populations
    "evaluation": "systematic",
    "common_start": True,
    "migration_every": 2,
    "pairing": "all",
    "sd": "shares",
    "exchange_slots": "same",
    "exchange_share": 0.5,
    "gst": 1.0,
    "sst": 1.0,
}


def in_files():
    """Return "FILE.py:NAME" of every method in examples/ that is not also in the package."""
    for path in sorted((Path(__file__).parents[2] / "examples").glob("*.py")):
        found = re.search(
            r'^ENTRY = MethodEntry\(\n    name="(.*)"', path.read_text(), re.MULTILINE
        )
        if found and found[1] not in METHODS:
            yield f"{path}:{found[1]}"


def variants():
    """Return (name, config) for every method and evaluation scheme, with short windows."""
    for name in (*METHODS, *in_files()):
        entry = resolve(name)
        names = {field.name for field in fields(entry.config_class)}
        small = {"genotypes": GENOTYPES, "elite_portion": 0.5, "pairs": 2 * ROUNDS}
        small |= dict.fromkeys(("stagnation_v", "stagnation_w", "stagnation_y", "stagnation"), 1)
        small |= {"new_node": 0.5, "new_connection": 0.5, "blueprints": 20}
        config = {key: value for key, value in small.items() if key in names}
        if "evaluation" not in names:
            config |= {"rounds": ROUNDS} if "rounds" in names else {}
            yield name, config
            if "team" in names:
                yield name, config | {"team": "whole"}
            continue
        for evaluation in ("systematic", "shared"):
            yield name, {**config, "evaluation": evaluation, "rounds": ROUNDS}
        if name == "cone":
            for type_c in ("team", "off"):
                yield name, {**config, "evaluation": "shared", "rounds": ROUNDS, "type_c": type_c}
            yield name, config | EXCHANGE


VARIANTS = list(variants())
IDS = [
    "-".join(
        filter(
            None,
            [
                name_in(name),
                config.get("evaluation", config.get("team", "single")),
                config.get("type_c"),
                config.get("sd"),
            ],
        )
    )
    for name, config in VARIANTS
]
every_variant = pytest.mark.parametrize(("name", "config"), VARIANTS, ids=IDS)


ADAPTS = ("stagnation_y", "stagnation")  # settings of methods whose controllers change size


def adapts(config):
    return any(name in config for name in ADAPTS)


def build(name, config):
    return method(name, **config)


def layout_of(learner):
    """Return sizes that the method accepts: those of its own controller if it needs one."""
    entry = METHODS.get(learner.name)
    if entry is None or not entry.controllers:
        return LAYOUT
    name, (inputs, outputs) = entry.controllers[0], (10, 2)
    genome = controller(name, **SIZES.get(name, {})).genome(inputs, outputs)
    return Layout(3, genome.n_parts, genome.max_parts, genome.n_genes, inputs, outputs)


def judge(trials):
    """Return scores that depend on the networks and fall with time: controllers stagnate."""
    networks = trials.networks().astype(np.float64)
    fitness = np.sin(5 * networks).sum(axis=(2, 3)) - 5 * trials.generation
    return Scores(fitness, np.abs(networks[:, :, 0, 0]), np.abs(networks[:, :, :2, 1]) / 2)


def run(learner, generations, root=3, score=judge, state=None):
    """Return the states after every request."""
    state = learner.init(layout_of(learner), root) if state is None else state
    states = [state]
    while state.progress.generation < generations:
        trials = learner.ask(state)
        state = learner.tell(state, trials, score(trials))
        states.append(state)
    return states


def is_end(before, after):
    """Whether a generation has ended between two states."""
    return after.progress.generation > before.progress.generation


def contents(record, prefix=""):
    """Return the fields of a dataclass, by name."""
    found = {}
    for field in fields(record):
        value, name = getattr(record, field.name), prefix + field.name
        found |= contents(value, f"{name}.") if is_dataclass(value) else {name: value}
    return found


def assert_same(a, b):
    assert type(a) is type(b)
    left, right = contents(a), contents(b)
    assert left.keys() == right.keys()
    for name, value in left.items():
        assert type(value) is type(right[name]), name
        if isinstance(value, np.ndarray):
            assert value.dtype == right[name].dtype, name
        np.testing.assert_equal(value, right[name], err_msg=name)


def copied(record):
    """Return a dataclass with copies of its arrays."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return replace(
        record,
        **{k: copied(v) for k, v in values.items() if is_dataclass(v)},
        **{k: v.copy() for k, v in values.items() if isinstance(v, np.ndarray)},
    )


# --- every method ---------------------------------------------------------------------------------


@every_variant
def test_state_is_plain_and_keeps_its_types(name, config):
    states = run(build(name, config), 6)
    first = contents(states[0])
    for state in states:
        refuse_unkept(state, name)
        assert difference(state, states[0]) == ""
        found = contents(state)
        assert found.keys() == first.keys()
        assert {k: type(v) for k, v in found.items()} == {k: type(v) for k, v in first.items()}
    for before, after in pairwise(states):
        if is_end(before, after):  # such states are stored, and checked when they are read
            assert after.progress.problem(states[0].progress) == ""
            assert getattr(after, "problem", lambda _: "")(states[0]) == ""


@every_variant
def test_teams_are_rows_of_a_pool_of_genotypes_in_range(name, config):
    learner = build(name, config)
    layout = layout_of(learner)
    for state in run(learner, 8):
        trials = learner.ask(state)
        assert trials.generation == state.progress.generation
        assert trials.teams.dtype == np.int32
        assert trials.genes.dtype == np.float32
        assert trials.teams.shape[1:] == (layout.n_robots, layout.max_hidden)
        assert trials.genes.shape[1:] == (layout.n_genes,)
        assert ((trials.teams >= -1) & (trials.teams < len(trials.genes))).all()
        assert (trials.teams >= 0).any(axis=2).all()  # nobody is without a neuron
        assert np.abs(trials.genes).max() <= 1
        assert len(trials.teams) % trials.rounds == 0
        assert trials.scenarios in ("fresh", "fixed")


@every_variant
def test_every_team_evaluated_is_counted(name, config):
    learner = build(name, config)
    spent = 0
    for before, after in pairwise(run(learner, 6)):
        spent += len(learner.ask(before).teams)
        assert after.progress.team_evaluations == spent
        assert after.progress.generation - before.progress.generation in (0, 1)


@every_variant
def test_ask_and_tell_are_pure(name, config):
    learner = build(name, config)
    for state in run(learner, 4):
        before = copied(state)
        trials = learner.ask(state)
        assert_same(trials, learner.ask(state))
        asked, scores = copied(trials), judge(trials)
        told = copied(scores)
        assert_same(learner.tell(state, trials, scores), learner.tell(state, trials, scores))
        assert_same(state, before)
        assert_same(scores, told)
        assert_same(trials, asked)


@every_variant
def test_the_seed_determines_everything(name, config):
    learner = build(name, config)
    first, second, other = (run(learner, 5, root)[-1] for root in (3, 3, 4))
    assert_same(first, second)
    genes = [learner.ask(state).networks() for state in (first, other)]
    assert (genes[0][:1] != genes[1][:1]).mean() > 0.3


@every_variant
def test_a_stored_state_resumes_bit_for_bit(name, config, tmp_path):
    learner = build(name, config)
    states = run(learner, 6)
    for stop in (1, len(states) // 2):
        save(tmp_path / "state.npz", states[stop], {"method": name})
        stored = load_like(
            learner.init(layout_of(learner), 3), tmp_path / "state.npz", {"method": name}
        )
        assert_same(stored, states[stop])
        assert_same(run(learner, 6, state=stored)[-1], states[-1])


@every_variant
def test_every_generation_has_a_portrait_of_its_fittest_team(name, config):
    learner = build(name, config)
    states = run(learner, 5)
    shown = 0
    for before, after in pairwise(states):
        trials = learner.ask(before)
        if trials.portrait:
            shown += 1
            team, scores = trials.teams[0], judge(trials)
        if is_end(before, after):
            ended = after.progress
            assert shown == ended.generation
            np.testing.assert_array_equal(ended.fittest_active, team >= 0)
            np.testing.assert_array_equal(ended.fittest_fitness, scores.fitness[0])
            np.testing.assert_array_equal(ended.fittest_specialization, scores.specialization[0])
            assert not ended.fittest_genes[~ended.fittest_active].any()
            assert ended.best_fitness >= ended.mean_fitness
    assert shown == 5


@every_variant
def test_the_fittest_team_is_kept_with_its_genes(name, config):
    learner = build(name, config)
    kept = None
    for before, after in pairwise(run(learner, 5)):
        trials = learner.ask(before)
        kept = trials.networks()[0] if trials.portrait else kept
        if is_end(before, after):
            np.testing.assert_array_equal(after.progress.fittest_genes, kept)


@every_variant
def test_scores_that_are_not_finite_are_counted_and_do_no_harm(name, config):
    def spoiled(trials):
        scores = judge(trials)
        fitness = scores.fitness.copy()
        fitness[0] = [np.nan, np.inf, -np.inf]
        return replace(scores, fitness=fitness)

    learner = build(name, config)
    count = 0
    for before, after in pairwise(run(learner, 5, score=spoiled)):
        count += 3
        assert after.progress.n_nonfinite == count
        assert np.isfinite(after.progress.best_fitness)
        assert np.isfinite(after.progress.mean_fitness)
        assert np.isfinite(learner.ask(after).genes).all()
        if is_end(before, after):
            count = 0


# --- methods with populations of neurons or networks ----------------------------------------------

populations = pytest.mark.parametrize(
    ("name", "config"),
    [
        pytest.param(name, config, id=label)
        for (name, config), label in zip(VARIANTS, IDS, strict=True)
        if isinstance(build(name, config).init(layout_of(build(name, config)), 1), Populations)
    ],
)


@populations
def test_genotypes_stay_in_range_and_empty_slots_empty(name, config):
    sizes = set()
    for state in run(build(name, config), 8):
        assert np.abs(state.genes).max() <= 1
        assert not state.genes[~state.active].any()
        assert state.active.sum(axis=1).tolist() == state.progress.n_hidden.tolist()
        sizes.update(state.progress.n_hidden.tolist())
    assert (sizes == {3}) == (not adapts(config))
    assert min(sizes) >= 2


@populations
def test_every_genotype_is_tried_the_promised_number_of_times(name, config):
    learner = build(name, config)
    for state in run(learner, 5):
        trials = learner.ask(state)
        n, r = np.indices(trials.teams.shape[:2])
        if state.phase != "genotypes":
            continue
        if "blueprints" in config:  # a neuron is tried as often as blueprints list it
            assert len(trials.teams) == config["blueprints"]
            continue
        own = np.arange(state.genes[..., 0].size).reshape(state.genes.shape[:3])
        if config.get("evaluation", "shared" if "rounds" in config else "") == "shared":
            played = np.bincount(trials.teams[trials.teams >= 0], minlength=own.size)
            clones = LAYOUT.n_robots // len(state.active)  # R if all robots have one network
            expected = np.where(state.active[:, :, None], ROUNDS * clones, 0)
            np.testing.assert_array_equal(played.reshape(own.shape), expected + 0 * own)
            assert len(trials.teams) == ROUNDS * GENOTYPES
            continue
        # Robot r of team n scores n + r / 8: fitness identifies the robot and the team on trial.
        told = learner.tell(state, trials, Scores(n + r / 8, 0.0 * n, np.zeros((*n.shape, 2))))
        if config.get("team") == "whole":  # a genotype is one of each population
            np.testing.assert_array_equal(trials.teams[:, :, 0], own[:, 0].T)
            np.testing.assert_array_equal(told.fitness, [np.arange(GENOTYPES) + 1 / 8] * 3)
            continue
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


@populations
def test_the_phases_of_a_generation(name, config):
    states = run(build(name, config), 6)
    for before, after in pairwise(states):
        assert is_end(before, after) == (after.phase == "genotypes")
    phases = {state.phase for state in states}
    has_type_c = name.startswith("cone") and config.get("type_c") != "off"
    assert ("elites" in phases) == has_type_c
    assert ("lesion" in phases) == adapts(config)


@populations
def test_the_finished_generation_is_described(name, config):
    learner = build(name, config)
    for before, after in pairwise(run(learner, 5)):
        if before.phase == "genotypes":
            tried = after.fitness[np.isfinite(after.fitness)]
            told = after.progress
            assert (told.best_fitness, told.mean_fitness) == (tried.max(), tried.mean())
        trials = learner.ask(before)
        assert trials.portrait == (before.phase == "fittest")
        assert (trials.scenarios == "fixed") == (before.phase in ("fittest", "lesion"))


@populations
def test_scores_that_are_not_finite_rank_last(name, config):
    def spoiled(trials):
        scores = judge(trials)
        fitness = scores.fitness.copy()
        fitness[0] = [np.nan, np.inf, -np.inf]
        return replace(scores, fitness=fitness)

    for before, after in pairwise(run(build(name, config), 5, score=spoiled)):
        if before.phase == "genotypes":
            bad = ~np.isfinite(after.fitness)
            n_good = (~bad).sum(axis=-1)
            in_elite = np.take_along_axis(bad, after.elite.astype(int), axis=-1).sum(axis=-1)
            expected = np.maximum(after.elite.shape[-1] - n_good, 0)
            assert in_elite.tolist() == expected.tolist()
