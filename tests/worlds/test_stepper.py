"""A world that is stepped from outside has the bits of a recorded one, alone and among others."""

from __future__ import annotations

import gc
import os
import threading
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest
import warp as wp

import conevo
from conevo.errors import UsageError
from conevo.rng import fold
from conevo.worlds.checks import random_teams
from conevo.worlds.stepper import Stepper

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
LIGHT = f"{EXAMPLES}/light.py:dark-1"
WORLDS = (
    "rover/complex-5",
    "pursuit/team-3",
    "pursuit/team-10",
    "prey/shaping-6",
    "gacc/complex-9",
    LIGHT,
    f"{EXAMPLES}/ball.py:far-1",
)
NOISE = {"sensor_noise": 0.05, "action_noise": 0.1, "failure": 0.01}
with_a_card = [
    pytest.mark.cuda,
    pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device on this machine"),
]
DEVICES = ["cpu", pytest.param("cuda", marks=with_a_card)]


def recorded(world: Any, key: int) -> dict[str, Any]:
    """Return an epoch of a random team, as it is recorded."""
    genes, teams = random_teams(world, 1)
    return conevo.Rollout(world, n_threads=1).record(genes, teams[0], world.scenarios([key]))


def equals_the_record(world: Any, device: str = "cpu", lanes: int | None = None) -> None:
    """Step a world with the outputs of a recorded epoch, and compare everything."""
    key = fold(5, "epoch", 0, 1)
    seen = recorded(world, key)
    iterations, last = world.params.iterations, {}
    stepper = Stepper(world, 1, 2, seed=5, device=device, lanes=lanes)
    assert stepper.keys == (fold(5, "epoch", 0, 0), key)
    stepper.reset(scenario=1)
    for t in range(iterations):
        assert stepper.inputs.numpy()[0].tobytes() == seen["inputs"][t].tobytes(), t
        stepper.outputs.assign(seen["outputs"][t][None])
        stepper.step()
        assert stepper.fitness.numpy()[0].tobytes() == seen["fitness"][t].tobytes(), t
        if t % 7 == 0 or t + 1 == iterations:
            stepper.finish()
            assert stepper.performance.numpy()[0].tobytes() == seen["performance"][t].tobytes(), t
    assert stepper.clock.numpy().tolist() == [iterations]
    simulation = world.simulation()
    ahead = {"inputs", "outputs"} | ({"detected"} if world.name.startswith("gacc") else set())
    for name in {*simulation.recorded, *simulation.recorded_at_end} - ahead:
        last = seen[name] if name in simulation.recorded_at_end else seen[name][-1]
        assert stepper.read(name)[0].tobytes() == last.tobytes(), name


Trace = list[tuple[bytes, ...]]


def traces(stepper: Stepper, plan: np.ndarray, outputs: np.ndarray) -> list[Trace]:
    """Step worlds with partial resets, and return what each world shows after every step.

    ``plan`` [steps, n] is the scenario with which a world starts before the step, -1 for none; a
    world's outputs are those of ``outputs`` [T, R, O] at its clock.
    """
    stepper.reset(scenario=plan[0])
    found: list[Trace] = [[] for _ in range(stepper.n)]
    arrays = stepper.inputs, stepper.fitness, stepper.clock, stepper.scenario
    for row in plan[1:]:
        stepper.outputs.assign(outputs[np.minimum(stepper.clock.numpy(), len(outputs) - 1)])
        stepper.step()
        stepper.finish()
        for b, values in enumerate(zip(*(one.numpy() for one in arrays), strict=True)):
            found[b].append((*(value.tobytes() for value in values),))
            found[b][-1] += (stepper.performance.numpy()[b].tobytes(),)
        if (row >= 0).any():
            stepper.reset(row >= 0, np.maximum(row, 0))
    return found


def a_plan(n: int, steps: int, pool: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    plan = np.where(rng.random((steps, n)) < 0.05, rng.integers(pool, size=(steps, n)), -1)
    plan[0] = rng.integers(pool, size=n)
    return plan


def random_outputs(world: Any) -> np.ndarray:
    shape = (world.params.iterations, world.n_robots, len(world.outputs))
    return np.random.default_rng(4).normal(0.0, 3.0, shape).astype(np.float32)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("path", WORLDS)
def test_stepping_equals_recording_for_whole_epochs(path: str, device: str) -> None:
    equals_the_record(conevo.world(path), device)


@pytest.mark.parametrize(
    "path",
    [
        "pursuit/team-3",  # has all phases of disturbances; for the others no test has a kernel
        pytest.param("rover/complex-5", marks=pytest.mark.exhaustive),
        pytest.param("gacc/complex-9", marks=pytest.mark.exhaustive),
    ],
)
def test_noise_and_failures_are_those_of_a_recorded_epoch(path: str) -> None:
    equals_the_record(conevo.world(path, iterations=60, **NOISE))


@pytest.mark.parametrize("fitness", ["activation", "product", "value"])
def test_fitness_is_right_after_each_step_in_every_reading(fitness: str) -> None:
    world = conevo.world("rover/complex-5", iterations=300, fitness=fitness)
    assert recorded(world, fold(5, "epoch", 0, 1))["fitness"].any()
    equals_the_record(world)


@pytest.mark.parametrize("path", ["rover/complex-5", "gacc/complex-9", LIGHT])
def test_the_cuda_form_gives_the_same_bits(path: str, cpu_blocks: Any) -> None:
    with cpu_blocks():
        equals_the_record(conevo.world(path, iterations=30), lanes=8)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("path", ["rover/complex-5", "pursuit/team-3", "gacc/complex-9", LIGHT])
def test_partial_resets_do_not_disturb_other_worlds(path: str, device: str) -> None:
    """Six worlds with resets at random are those that each is alone, in pools of other sizes."""
    world = conevo.world(path, iterations=40)
    n, steps, keys = 6, 120, [fold(9, "epoch", 0, k) for k in range(8)]
    plan, outputs = a_plan(n, steps, len(keys)), random_outputs(world)
    together = traces(Stepper(world, n, keys, device=device, n_threads=2), plan, outputs)
    used = {int(k) for k in plan[plan >= 0]}
    assert len(used) == len(keys)
    for b in range(n):
        few = sorted({int(k) for k in plan[:, b] if k >= 0})
        alone = Stepper(world, 1, [keys[k] for k in few], n_threads=1)
        own = np.array([[few.index(k) if k >= 0 else -1] for k in plan[:, b]])
        (found,) = traces(alone, own, outputs)
        without_scenario = [[step[:3] + step[4:] for step in one] for one in (together[b], found)]
        assert without_scenario[0] == without_scenario[1], b
    assert len({inputs for inputs, *_ in together[0]}) > steps // 3


def test_a_world_that_has_ended_stays_as_it_is() -> None:
    world = conevo.world("pursuit/team-3", iterations=5)
    stepper = Stepper(world, 2, 4, n_threads=1)
    stepper.reset()
    stepper.outputs.fill_(9.0)
    for _ in range(3):
        stepper.step()
    stepper.reset(np.array([False, True]))
    seen = []
    for _ in range(4):
        stepper.step()
        seen.append((stepper.clock.numpy().tolist(), stepper.read("x")[0].tobytes()))
    assert [clock for clock, _ in seen] == [[4, 1], [5, 2], [5, 3], [5, 4]]
    assert seen[1][1] == seen[3][1] != seen[0][1]


def test_scenarios_are_those_of_a_run_and_each_world_draws_its_own() -> None:
    world = conevo.world(LIGHT)

    def played(n: int, seed: int, resets: int = 12) -> np.ndarray:
        stepper = Stepper(world, n, 5, seed=seed)
        drawn = []
        for _ in range(resets):
            stepper.reset()
            drawn.append(stepper.scenario.numpy().copy())
        return np.array(drawn)

    one = played(7, 2)
    assert np.array_equal(one[:, :3], played(3, 2))  # whatever the number of worlds
    assert not np.array_equal(one, played(7, 3))
    assert set(one.ravel()) == set(range(5))
    stepper = Stepper(world, 7, 5, seed=3)
    stepper.reset(seed=2)
    stepper.reset(np.arange(7) < 3)
    assert stepper.keys == tuple(fold(2, "epoch", 0, k) for k in range(5))
    assert stepper.scenario.numpy().tolist() == [*one[1, :3], *one[0, 3:]]


def test_a_reset_takes_masks_of_warp_and_another_pool() -> None:
    world = conevo.world(LIGHT, iterations=9)
    stepper = Stepper(world, 3, 2)
    stepper.reset()
    stepper.step()
    stepper.reset(wp.array([True, False, True], dtype=wp.bool))
    assert stepper.clock.numpy().tolist() == [0, 1, 0]
    before = stepper.inputs.numpy().copy()
    stepper.draw([4, 5, 6, 7])
    with pytest.raises(UsageError, match="reset the worlds before the first step"):
        stepper.step()
    with pytest.raises(UsageError, match="reset all worlds first"):
        stepper.reset(np.ones(3, bool))
    stepper.reset(scenario=3)
    places = world.scenarios([7]).places[0]
    assert np.allclose(stepper.inputs.numpy()[1], places[-1] - places[:-1])
    assert not np.array_equal(stepper.inputs.numpy(), before)


def test_a_nan_counts_as_zero_and_harms_nobody() -> None:
    world = conevo.world("rover/complex-5", iterations=20)
    shown = []
    for bad in (0.0, np.nan):
        stepper = Stepper(world, 1, 1)
        stepper.reset()
        for _ in range(20):
            stepper.outputs.numpy()[:] = [-9.0, -9.0, -9.0, bad, 1.0]
            stepper.step()
        shown.append((stepper.read("x").tobytes(), stepper.read("action").tolist()))
    assert shown[0] == shown[1]
    assert shown[0][1] == [[3] * 20]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"n": 0}, "n = 0: must be an integer from 1 to 1048576"),
        ({"scenarios": 0}, "scenarios = 0: must be an integer from 1"),
        ({"scenarios": []}, "the number of scenarios = 0"),
        ({"scenarios": [-1]}, "a scenario's key = -1"),
        ({"seed": -1}, "seed = -1"),
        ({"seed": True}, "seed = True"),
        ({"device": "gpu"}, "is not a device"),
        ({"n_threads": 0}, "threads = 0"),
    ],
)
def test_what_a_stepper_cannot_be_made_of_is_one_line(arguments: Any, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        Stepper(conevo.world(LIGHT), **arguments)


def test_what_does_not_fit_is_one_line() -> None:
    stepper = Stepper(conevo.world(LIGHT), 3, 2)
    for call in (stepper.step, stepper.finish):
        with pytest.raises(UsageError, match="reset the worlds before"):
            call()
    stepper.reset()
    for given, words in (
        ({"at": [True]}, r"at must be 3 truth values, not \[1\] of bool"),
        ({"at": [0, 1, 2]}, r"at must be 3 truth values, not \[3\] of int64"),
        ({"at": wp.zeros(3, dtype=int)}, r"at must be 3 truth values, not \[3\] of int32"),
        ({"scenario": 2}, "scenario = 2: must be from 0 to 1"),
        ({"scenario": [0, -1, 0]}, "scenario = -1"),
        ({"scenario": [0, 1]}, "scenario must be a whole number or 3 of them"),
        ({"at": [True] * 3, "seed": 1}, "leave out 'at'"),
    ):
        with pytest.raises(UsageError, match=words):
            stepper.reset(**given)
    with pytest.raises(UsageError, match="unknown array 'z' in light-v1"):
        stepper.read("z")
    with pytest.raises(UsageError, match="not written in Warp"):
        Stepper(conevo.world(f"{EXAMPLES}/spread.py:open-1"))


def test_threads_are_chosen_by_time_and_end_with_the_stepper() -> None:
    """The results are the same; a forked process gets threads of its own."""
    world = conevo.world(LIGHT)
    before = threading.active_count()
    stepper = Stepper(world, 4, 4)
    stepper._launches._to_try = [1, 2] * 2
    stepper.reset()
    for _ in range(5):
        stepper.step()
    assert stepper._launches.n_threads in (1, 2)
    assert stepper.clock.numpy().tolist() == [5] * 4
    both = Stepper(world, 4, 4, n_threads=2)
    both.reset()
    assert threading.active_count() > before
    child = os.fork()
    if not child:
        both.step()
        os._exit(0 if both.clock.numpy().tolist() == [1] * 4 else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    del stepper, both
    gc.collect()
    deadline = perf_counter() + 5
    while threading.active_count() > before and perf_counter() < deadline:
        pass
    assert threading.active_count() == before


@pytest.mark.timing
def test_a_step_of_one_world_takes_ten_microseconds_at_most() -> None:
    world = conevo.world("pursuit/team-3")
    stepper = Stepper(world)
    least = np.inf
    stepper.reset()
    for _ in range(20):  # fifty steps at a time: some of them are not interrupted
        start = perf_counter()
        for _ in range(50):
            stepper.step()
        least = min(least, (perf_counter() - start) / 50)
    assert least < 10e-6
