"""Scenarios of another world, and impossible threads: refused before a kernel uses them."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import conevo
from conevo.errors import UsageError
from conevo.worlds.checks import random_teams
from conevo.worlds.rollout import Rollout

SPREAD = Path(__file__).parents[2] / "examples" / "spread.py"


@pytest.mark.parametrize(
    ("path", "robots", "words"),
    [
        ("rover/complex-1", 10, "start_x has shape [10] in a scenario, and [20] in this world"),
        ("rover/complex-1", 40, "start_x has shape [40] in a scenario, and [20] in this world"),
        ("gacc/complex-1", 10, "start_x has shape [10] in a scenario, and [30] in this world"),
    ],
)
def test_scenarios_for_another_number_of_robots(path, robots, words):
    world = conevo.world(path, iterations=5)
    rollout, (genes, teams) = Rollout(world, n_threads=1), random_teams(world, 1)
    others = conevo.world(path, n_robots=robots, iterations=5).scenarios([1])
    with pytest.raises(UsageError, match=re.escape(words)):
        rollout.evaluate(genes, teams, others)
    with pytest.raises(UsageError, match=re.escape(words)):
        rollout.record(genes, teams[0], others)


def test_shared_arrays_of_another_world():
    world = conevo.world("pursuit/team-3", iterations=5)
    rollout, (genes, teams) = Rollout(world, n_threads=1), random_teams(world, 1)
    scenarios = world.scenarios([1])
    object.__setattr__(scenarios, "clamp", np.full((2, 3), np.nan, np.float32))
    with pytest.raises(UsageError, match=re.escape("clamp has shape [2, 3] in a scenario")):
        rollout.evaluate(genes, teams, scenarios)


def test_no_scenario_at_all():
    world = conevo.world("rover/complex-1", iterations=5)
    genes, teams = random_teams(world, 1)
    with pytest.raises(UsageError, match="at least one scenario"):
        Rollout(world, n_threads=1).evaluate(
            genes, teams, SimpleNamespace(seed=np.zeros(0, np.uint64))
        )


@pytest.mark.parametrize("threads", [0, -1, 1.5, "two", True, 5000])
def test_impossible_threads_leave_no_run(threads, tmp_path):
    words = re.escape(f"threads = {threads!r}: must be an integer from 1 to 4096")
    for path in ("rover/complex-1", f"{SPREAD}:open-1"):
        with pytest.raises(UsageError, match=words):
            conevo.evolve(path, preset="smoke", out=tmp_path / "run", threads=threads)
    assert list(tmp_path.iterdir()) == []


def test_a_world_that_is_not_written_in_warp():
    with pytest.raises(UsageError, match="is not written in Warp"):
        Rollout(conevo.world(f"{SPREAD}:open-1"))
