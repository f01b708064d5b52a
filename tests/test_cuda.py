"""A CUDA device agrees with the CPU bit for bit: ``pytest -m cuda`` on a machine with one.

Without one, the same blocks are compared on the CPU (``tests/worlds/test_*_lanes.py``), and the
functions below are tried with the CPU in place of the device.
"""

import numpy as np
import pytest
import warp as wp

from conevo.controllers.registry import CONTROLLERS, controller, genome_of
from conevo.rng import fold
from conevo.runs.config import resolve
from conevo.runs.start import start
from conevo.worlds import rollout
from conevo.worlds.checks import random_teams_of
from conevo.worlds.registry import world
from contracts.test_worlds import assert_same_bits
from runs.tiny import TASKS, content, evolve_tiny, tiny_settings

WORLDS = [
    "rover/simple-3", "rover/complex-5", "rover/extended-10", "pursuit/team-3", "pursuit/team-10",
    "prey/shaping-3", "prey/shaping-6", "gacc/simple-2", "gacc/complex-9",
]  # fmt: skip
OPTIONS = {"sensor_noise": 0.05, "action_noise": 0.1, "failure": 0.01}
with_a_card = [
    pytest.mark.cuda,
    pytest.mark.skipif(not wp.is_cuda_available(), reason="no CUDA device on this machine"),
]


def has_the_bits_of_the_cpu(path, name="srn", iterations=200, **options):
    """Compare a whole evaluation, in rounds, and a record."""
    a_world = world(path, iterations=iterations, **options)
    mind = controller(name, world=a_world)
    pool, teams = random_teams_of(genome_of(mind, a_world), a_world.n_robots, 12)
    teams[:, :, ::3] = -1  # empty slots
    heuristic = np.full(teams.shape[:2], -1, np.int32)
    heuristic[2, ::2] = 0
    heuristic[3] = len(a_world.heuristics) - 1
    scenarios = a_world.scenarios([fold(8, "cuda", k) for k in range(6)])
    cpu, card = (rollout.Rollout(a_world, mind, device=device) for device in ("cpu", "cuda"))
    assert cpu.fingerprint == card.fingerprint
    assert_same_bits(*(one.evaluate(pool, teams, scenarios, heuristic, 3) for one in (cpu, card)))
    one = a_world.scenarios([1])
    seen, there = (each.record(pool, teams[2], one, heuristic[2]) for each in (cpu, card))
    assert seen.keys() == there.keys()
    for array, values in seen.items():
        assert values.tobytes() == there[array].tobytes(), array


def continues_elsewhere(task, folder):
    """Compare runs that change between devices with one that does not."""
    whole = content(evolve_tiny(folder / "whole", task=task).path)
    for first, then in (("cpu", "cuda"), ("cuda", "cpu")):
        config = resolve(task, "cone", "smoke", overrides=tiny_settings("cone", task))
        run = start(config, folder / first, threads=1, device=first)
        run.resume(time_limit=1e-9, threads=1).resume(device=then, threads=1)
        assert content(run.path) == whole


def marked(values):
    return [pytest.param(value, marks=with_a_card) for value in values]


@pytest.mark.parametrize("path", marked(WORLDS))
def test_a_device_agrees_with_the_cpu_bit_for_bit(path):
    has_the_bits_of_the_cpu(path)
    has_the_bits_of_the_cpu(path, **OPTIONS)


@pytest.mark.parametrize("name", marked(CONTROLLERS))
def test_a_device_agrees_for_every_controller_bit_for_bit(name):
    has_the_bits_of_the_cpu("rover/complex-5", name)


@pytest.mark.parametrize("task", marked(TASKS))
def test_a_run_continues_on_another_device(task, tmp_path):
    continues_elsewhere(task, tmp_path)


def test_all_of_this_works_with_the_cpu_in_place_of_a_device(two_cards, tmp_path):
    has_the_bits_of_the_cpu("rover/complex-1", iterations=5)
    continues_elsewhere("rover/complex-1", tmp_path)
