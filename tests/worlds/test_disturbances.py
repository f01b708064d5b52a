"""Noise of sensors and actions, and failing robots: from their addresses, number by number.

One kernel for each world serves all tests: other disturbances have a probability of 1e-12.
"""

import numpy as np
import pytest

import conevo
from conevo.rng import stream
from conevo.worlds.contract import stages_of
from conevo.worlds.gacc import dynamics as gacc
from conevo.worlds.pursuit import dynamics as pursuit
from conevo.worlds.registry import WORLDS
from conevo.worlds.rollout import Rollout
from conevo.worlds.rover import act
from conevo.worlds.rover import dynamics as rover
from oracles import splitmix

TASKS = ["rover/complex-5", "gacc/complex-2", "pursuit/team-5"]
T = 60
HARDLY = 1e-12
KEY = 11


def play(task, teams="networks", lanes=None, **options):
    """Return a world, the seed of a scenario, and the record of a team in it."""
    all_on = {"sensor_noise": HARDLY, "action_noise": HARDLY, "failure": HARDLY}
    a_world = conevo.world(task, iterations=T, **(all_on | options if options else {}))
    rollout = Rollout(a_world, n_threads=1, lanes=lanes)
    r, u = a_world.n_robots, rollout.genome.max_parts
    seed = 2 if teams == "others" else 1
    genes = stream(seed, "team").uniform(-1, 1, (r * u, rollout.genome.n_genes)).astype(np.float32)
    slots = np.arange(r * u, dtype=np.int32).reshape(r, u)
    heuristic = np.full(r, -1, np.int32)
    if teams == "heuristics":
        heuristic[:] = np.arange(r) % len(a_world.heuristics)
    scenarios = a_world.scenarios([KEY])
    return a_world, int(scenarios.seed[0]), rollout.record(genes, slots, scenarios, heuristic)


def draws(seed, counter, robots, times=range(T)):
    return np.array([[splitmix.uniform(seed, t, counter, i) for i in range(robots)] for t in times])


@pytest.mark.parametrize("task", TASKS)
def test_a_reading_differs_by_the_number_drawn_for_it(task):
    """Heuristic robots do not read their sensors: the rest of their record stays the same."""
    _, _, clean = play(task, "heuristics")
    a_world, seed, noisy = play(task, "heuristics", sensor_noise=0.3)
    for name in clean.keys() - {"inputs"}:
        assert clean[name].tobytes() == noisy[name].tobytes(), name
    signed = 8 if task.startswith("gacc") else 0
    for k in range(len(a_world.inputs)):
        u = draws(seed, 2**20 - 512 + k, a_world.n_robots)
        expected = clean["inputs"][:, :, k] + 0.3 * (2 * u - 1)
        expected = np.clip(expected, -1.0 if k < signed else 0.0, 1.0)
        np.testing.assert_allclose(noisy["inputs"][:, :, k], expected, atol=1e-6)
    assert np.count_nonzero(clean["inputs"]) > 20


@pytest.mark.parametrize("task", TASKS)
def test_an_action_is_replaced_by_one_from_random_outputs(task):
    a_world, seed, seen = play(task, action_noise=0.25)
    is_random = draws(seed, 2**20 - 320, a_world.n_robots) < 0.25
    assert 0.15 < is_random.mean() < 0.35
    for k in range(len(a_world.outputs)):
        drawn = 8 * draws(seed, 2**20 - 384 + k, a_world.n_robots) - 4
        np.testing.assert_allclose(seen["outputs"][:, :, k][is_random], drawn[is_random], atol=1e-5)
        assert (np.abs(seen["outputs"][:, :, k] - drawn)[~is_random] > 1e-5).mean() > 0.9


@pytest.mark.parametrize("task", TASKS)
def test_with_all_actions_replaced_any_team_is_the_same(task):
    """Also with heuristic robots; each chooses for itself when its action is not replaced."""
    plays = [play(task, t, action_noise=1.0)[2] for t in ("networks", "others", "heuristics")]
    for name in plays[0].keys() - {"hidden"}:
        assert plays[0][name].tobytes() == plays[1][name].tobytes() == plays[2][name].tobytes()


def test_a_heuristic_rover_chooses_for_itself_afterwards():
    a_world, seed, seen = play(TASKS[0], "heuristics", action_noise=0.25)
    is_random = draws(seed, 2**20 - 320, a_world.n_robots) < 0.25
    is_low = np.arange(a_world.n_robots) % 4 == 0  # detects with low, or moves
    strange = np.isin(seen["action"], [1, 2]) & is_low
    assert (strange & is_random).any()
    assert not (strange & ~is_random).any()
    outputs = np.argmax(seen["outputs"], axis=2).clip(max=3)
    assert (seen["action"] == outputs)[is_random].all()


@pytest.mark.parametrize("options", [{"failure": 0.03}, {"failure": 0.5, "failure_at": 20}])
@pytest.mark.parametrize("task", TASKS)
def test_robots_fail_when_it_is_drawn_and_permanently(task, options):
    _, _, clean = play(task, failure=HARDLY)
    a_world, seed, seen = play(task, **options)
    r = a_world.n_robots
    is_drawn = draws(seed, 2**20 - 319, r) < options["failure"]
    if "failure_at" in options:
        is_drawn[np.arange(T) != 19] = False
    has_failed = np.maximum.accumulate(is_drawn, axis=0)
    assert has_failed[-1].sum() > 0
    first = int(is_drawn.any(axis=1).argmax())
    for name in ("x", "y", "action", "inputs"):
        assert clean[name][: first + 1].tobytes() == seen[name][: first + 1].tobytes(), name
    rests = has_failed[:-1]  # from the next iteration on
    for name in ("x", "y"):
        moved = np.diff(seen[name][:, :r], axis=0) != 0
        assert not (moved & rests).any()
        assert (moved & ~rests).any() or task.startswith("gacc")
    if task.startswith("pursuit"):
        for name in ("left", "right"):
            assert not seen[name][1:, :r][rests].any()
    else:
        assert (seen["energy"][has_failed] <= 0).all()
        assert (seen["energy"][~has_failed] > 0).all()
        assert (seen["action"][1:][rests] == -1).all()
        assert (seen["action"][1:][~rests] != -1).all()
    if task.startswith("gacc"):
        assert (seen["held"][has_failed] == -1).all()


def test_a_gatherer_that_fails_lets_go():
    """Robots that only grip and move hold objects when they fail."""
    options = {"failure": 0.5, "failure_at": 50, "grip_distance": 0.4, "object_range": 0.4}
    _, _, seen = play(TASKS[1], "heuristics", **options)
    held = seen["held"]
    lost = (held[48] >= 0) & (seen["energy"][49] == 0)
    assert lost.any()
    assert (held[49:][:, lost] == -1).all()


@pytest.mark.parametrize(  # one has all phases of disturbances
    "task", [pytest.param(t, marks=[] if t == TASKS[2] else pytest.mark.exhaustive) for t in TASKS]
)
def test_any_number_of_lanes_agrees_bit_for_bit(task, cpu_blocks):
    options = {"sensor_noise": 0.1, "action_noise": 0.1, "failure": 0.01}
    _, _, one = play(task, **options)
    with cpu_blocks():
        _, _, many = play(task, lanes=32, **options)
    for name, values in one.items():
        assert many[name].tobytes() == values.tobytes(), name


def test_disturbances_that_are_off_take_no_phase_and_no_memory():
    """No phase, and arrays of a single number."""
    for task, functions in zip(
        TASKS, (rover.FUNCTIONS, gacc.FUNCTIONS, pursuit.PURSUIT_FUNCTIONS), strict=True
    ):
        plain = conevo.world(task).simulation()
        assert plain.functions == functions
        assert (plain.sizes["kept_inputs"], plain.sizes["kept_robots"]) == (1, 1)
        assert plain.sizes.get("failing", 1) == plain.sizes.get("picks", 1) == 1
        noisy = stages_of(conevo.world(task, sensor_noise=0.1).simulation())
        before = stages_of(plain)
        assert len(noisy["sense"]) == len(before["sense"]) + 2
        assert all(noisy[one] == before[one] for one in before if one != "sense")


def test_no_world_draws_from_these_addresses():
    assert int(act.HEURISTIC) >= 2**20 - 256
    for entry in WORLDS.values():
        a_world = conevo.world(f"{entry.short_name}/{entry.environments[0]}")
        assert len(a_world.inputs) <= 128
        assert len(a_world.outputs) <= 64
