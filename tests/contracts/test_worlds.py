"""The contract of worlds, for each environment family of the registry."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from conevo.controllers.registry import controller
from conevo.rng import fold
from conevo.worlds.checks import mixed_teams, random_teams
from conevo.worlds.contract import shapes_of
from conevo.worlds.measures import measures_of
from conevo.worlds.protocol import setting_columns
from conevo.worlds.registry import WORLDS, resolve, world
from conevo.worlds.rollout import Rollout
from conevo.worlds.simulators import has_own_simulator, simulator
from conevo.worlds.trial import Trial

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
OUTSIDE = {
    "outside-light": f"{EXAMPLES}/light.py:dark-1",
    "outside-ball": f"{EXAMPLES}/ball.py:far-1",
    "outside-spread": f"{EXAMPLES}/spread.py:open-1",
    "outside-poles": f"{EXAMPLES}/poles.py:full-2",
}
ITERATIONS = 25
TOPICS = ("sensors", "values", "counts", "order", "reset", "heuristics")
CASES = [
    f"{entry.name}/{environment}"
    for entry in WORLDS.values()
    for environment in sorted({e.rpartition("-")[0]: e for e in entry.environments}.values())
]


def keys(n, root=7):
    return [fold(root, "epoch", 0, e) for e in range(n)]


@pytest.fixture(params=[*CASES, *OUTSIDE.values()], ids=[*CASES, *OUTSIDE], scope="module")
def path(request):
    return request.param


@pytest.fixture(scope="module")
def some_world(path):
    return world(path, iterations=ITERATIONS)


@pytest.fixture(scope="module")
def warp_world(some_world):
    """Return a world that the engine plays: only such worlds have phases, lanes and rows."""
    if has_own_simulator(some_world):
        pytest.skip("has a simulator of its own")
    return some_world


def played(a_world, n_threads=None):
    """Return the simulator of a world."""
    return simulator(a_world, controller(world=a_world), n_threads)


def outcome_arrays(outcome):
    return {
        "fitness": outcome.fitness,
        "counts": outcome.counts,
        "switches": outcome.switches,
        **outcome.performance,
    }


def assert_same_bits(a, b):
    for name, values in outcome_arrays(a).items():
        assert values.tobytes() == outcome_arrays(b)[name].tobytes(), name


def test_a_scenario_depends_on_its_key_alone(some_world):
    many = keys(40)
    whole, turned = some_world.scenarios(many), some_world.scenarios(many[::-1])
    assert (len(whole), len(turned)) == (40, 40)
    player = played(some_world)
    for field in fields(whole):
        of_all = getattr(whole, field.name)
        for e in (0, 17, 39):
            (alone,) = many[e : e + 1]
            own = getattr(some_world.scenarios([alone]), field.name)
            if player.is_shared(field.name):
                assert np.array_equal(own, of_all, equal_nan=own.dtype.kind == "f"), field.name
            else:
                assert own[0].tobytes() == of_all[e].tobytes(), field.name
                assert own[0].tobytes() == getattr(turned, field.name)[39 - e].tobytes()


def test_a_world_agrees_with_its_entry(path, some_world):
    entry, environment = resolve(path)
    assert (some_world.name, some_world.environment) == (entry.name, environment)
    own = entry.defaults.get(environment, {})
    assert some_world.params == entry.params_class(**{**own, "iterations": ITERATIONS})
    given = (some_world.inputs, some_world.outputs, some_world.actions, some_world.heuristics)
    for names in (*given, measures_of(some_world)):
        assert isinstance(names, tuple)
        assert len(set(names)) == len(names) > 0
    assert len(some_world.castes) >= len(some_world.actions)
    chosen = [some_world.castes[column] for column in setting_columns(some_world)]
    assert chosen == [name for name in some_world.castes if name in chosen] != []
    assert resolve(entry.address(environment)) == (entry, environment)


def test_outcome_has_the_promised_shapes_and_ranges(some_world):
    genes, teams = random_teams(some_world, 3)
    out = played(some_world).evaluate(genes, teams, some_world.scenarios(keys(2)))
    r, c = some_world.n_robots, len(some_world.castes)
    assert out.fitness.shape == (3, 2, r)
    assert out.counts.shape == (3, 2, r, c)
    assert out.switches.shape == (3, 2, r)
    assert list(out.performance) == [one.name for one in measures_of(some_world)]
    assert all(values.shape == (3, 2) for values in out.performance.values())
    assert np.isfinite(out.fitness).all()
    executed = out.counts.sum(axis=-1)
    assert (executed <= ITERATIONS).all()
    assert (executed > 0).all()
    assert (out.switches >= 0).all()
    assert (out.switches < executed).all()


def test_threads_slices_and_other_teams_do_not_change_a_bit(some_world):
    genes, teams = random_teams(some_world, 5)
    scenarios = some_world.scenarios(keys(2))
    whole = played(some_world, n_threads=1).evaluate(genes, teams, scenarios)
    assert_same_bits(whole, played(some_world, n_threads=3).evaluate(genes, teams, scenarios))
    rollout = played(some_world, n_threads=2)
    rollout.evaluate(genes, teams[::-1], scenarios)  # no trace of it is left in the workspace
    for n in range(5):
        alone = rollout.evaluate(genes, teams[n : n + 1], scenarios)
        for name, values in outcome_arrays(whole).items():
            assert values[n].tobytes() == outcome_arrays(alone)[name][0].tobytes(), name


def test_one_scenario_is_the_same_alone_and_among_others(some_world):
    genes, teams = random_teams(some_world, 2)
    rollout = played(some_world)
    three = rollout.evaluate(genes, teams, some_world.scenarios(keys(3)))
    last = rollout.evaluate(genes, teams, some_world.scenarios(keys(3)[2:]))
    for name, values in outcome_arrays(three).items():
        assert values[:, 2].tobytes() == outcome_arrays(last)[name][:, 0].tobytes(), name
    assert not np.array_equal(three.counts[:, 0], three.counts[:, 1])  # scenarios differ


def test_record_equals_evaluate_bit_for_bit(some_world):
    genes, teams = random_teams(some_world, 2)
    heuristic = np.full((2, some_world.n_robots), -1, dtype=np.int32)
    heuristic[1, ::2] = len(some_world.heuristics) - 1
    scenarios = some_world.scenarios(keys(1))
    rollout = played(some_world)
    out = rollout.evaluate(genes, teams, scenarios, heuristic)
    for n in range(2):
        seen, outcome = rollout.record_with_outcome(genes, teams[n], scenarios, heuristic[n])
        for name, values in outcome_arrays(outcome).items():
            assert values.tobytes() == outcome_arrays(out)[name][n : n + 1].tobytes(), name
        assert seen["fitness"].shape == (ITERATIONS, some_world.n_robots)
        for name in ("inputs", "outputs"):
            width = len(getattr(some_world, name))
            assert seen[name].shape == (ITERATIONS, some_world.n_robots, width)
        assert seen["fitness"][-1].tobytes() == out.fitness[n, 0].tobytes()
        ended = np.array([out.performance[one.name][n, 0] for one in measures_of(some_world)])
        assert seen["performance"][-1].tobytes() == ended.tobytes()
        shorter = replace(some_world.params, iterations=10)
        early = played(replace(some_world, params=shorter)).evaluate(
            genes, teams[n : n + 1], scenarios, heuristic[n : n + 1]
        )
        ended = np.array([early.performance[one.name][0, 0] for one in measures_of(some_world)])
        assert seen["performance"][9].tobytes() == ended.tobytes()
        if not has_own_simulator(some_world):
            simulation = some_world.simulation()
            for name in simulation.recorded_at_end:
                assert seen[name].shape == shapes_of(some_world, simulation)[name]
        action, counts = seen["action"], out.counts[n, 0]
        assert action.max() < len(some_world.actions)
        assert np.array_equal((action >= 0).sum(axis=0), counts.sum(axis=-1))
        if some_world.castes == some_world.actions:
            for a in range(len(some_world.actions)):
                assert np.array_equal((action == a).sum(axis=0), counts[:, a])


def test_the_order_of_robots_within_a_phase_does_not_change_a_bit(warp_world):
    genes, teams, heuristic = mixed_teams(warp_world)
    scenarios = warp_world.scenarios(keys(1))  # two: in conevo check, and its tests
    trial = Trial(warp_world, genes, teams, heuristic, scenarios)
    assert sum(1 for _ in trial.run()) > warp_world.params.iterations
    seen = {topic: problems for topic, problems, _ in trial.seen()}
    assert seen == {topic: [] for topic in TOPICS}
    out = Rollout(warp_world).evaluate(genes, teams, scenarios, heuristic)
    stepped = trial.plain.arrays()
    for name in ("fitness", "counts", "switches"):
        assert stepped[name].tobytes() == getattr(out, name).tobytes(), name


def test_every_heuristic_controller_plays(some_world):
    genes, teams = random_teams(some_world, 1)
    scenarios = some_world.scenarios(keys(1))
    rollout = played(some_world)
    seen = {
        rollout.evaluate(
            genes, teams, scenarios, np.full(teams.shape[:2], h, np.int32)
        ).counts.tobytes()
        for h in range(-1, len(some_world.heuristics))
    }
    assert len(seen) == len(some_world.heuristics) + 1


def test_the_cuda_form_on_cpu_blocks_agrees_bit_for_bit(warp_world, cpu_blocks):
    genes, teams = random_teams(warp_world, 2)
    heuristic = np.full((2, warp_world.n_robots), -1, dtype=np.int32)
    heuristic[0, 1::2] = 0
    scenarios = warp_world.scenarios(keys(2))
    serial = Rollout(warp_world, n_threads=1).evaluate(genes, teams, scenarios, heuristic)
    with cpu_blocks():
        block = Rollout(warp_world, n_threads=1, lanes=8)
        assert_same_bits(serial, block.evaluate(genes, teams, scenarios, heuristic))


def test_wrong_shapes_and_rows_are_refused_in_one_line(warp_world):
    genes, teams = random_teams(warp_world, 1)
    rollout, scenarios = Rollout(warp_world), warp_world.scenarios(keys(1))
    outside = teams.copy()
    outside[0, 0, 0] = len(genes)
    for bad_genes, bad_teams, match in (
        (genes[:, 1:], teams, "genes must be"),
        (genes, teams[:, 1:], "teams must be"),
        (genes, outside, "rows"),
        (genes, teams[:0], "at least one team"),
    ):
        with pytest.raises(ValueError, match=match):
            rollout.evaluate(bad_genes, bad_teams, scenarios)
    with pytest.raises(ValueError, match="heuristic must be"):
        rollout.evaluate(genes, teams, scenarios, np.full(teams.shape[:2], 99, np.int32))
    with pytest.raises(ValueError, match="one scenario"):
        rollout.record(genes, teams[0], warp_world.scenarios(keys(2)))
