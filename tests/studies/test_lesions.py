"""Castes replaced and robots cloned: each team played again, one by one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.runs.champions import Team
from conevo.studies.lesions import Original, replacement
from conevo.worlds.rollout import Rollout

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "light.py"
LABELS = ["low", "hi", "low", "non-specialized", "move", "hi"]
NOTHING = [0.0] * 6  # fitness


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    world = conevo.world("rover/complex-5", n_robots=6, iterations=400)
    return Rollout(world, n_threads=1)


@pytest.fixture(scope="module")
def team(rollout: Rollout) -> Team:
    """Random controllers, some with more neurons than others."""
    genome, rng = rollout.genome, np.random.default_rng(4)
    genes = rng.uniform(-1, 1, (6, genome.max_parts, genome.n_genes)).astype(np.float32)
    active = np.arange(genome.max_parts) < rng.integers(5, 12, (6, 1))
    return Team(0, genes, active, np.zeros(6), np.zeros(6))


def play(rollout: Rollout, team: Team, scenarios, modes: list[int] | None = None):
    """Return the performance [E] of one team."""
    heuristic = None if modes is None else np.array([modes], dtype=np.int32)
    outcome = rollout.evaluate(*team.as_trial(), scenarios, heuristic)
    return {name: values[0].tolist() for name, values in outcome.performance.items()}


def of(found, name: str):
    k = found.teams.index(name)
    return {measure: values[k].tolist() for measure, values in found.performance.items()}


def test_a_lesion_replaces_all_robots_of_a_caste_and_no_others(rollout, team) -> None:
    scenarios = rollout.world.scenarios(range(3))
    castes = ["low", "hi", "move", "non-specialized"]
    found = Original(rollout, team, LABELS, NOTHING).lesion(castes, scenarios)
    assert found.teams == ("whole", *castes)
    assert of(found, "whole") == play(rollout, team, scenarios)
    by_hand = {  # heuristics low 0, med 1, hi 2, non-specialized 3
        "low": [0, -1, 0, -1, -1, -1],
        "hi": [-1, 2, -1, -1, -1, 2],
        "move": [-1, -1, -1, -1, 3, -1],
        "non-specialized": [-1, -1, -1, 3, -1, -1],
    }
    for caste, modes in by_hand.items():
        assert of(found, caste) == play(rollout, team, scenarios, modes), caste
    assert len({tuple(of(found, caste)["area"]) for caste in found.teams}) == 5


def test_clones_are_all_the_fittest_robot_of_their_caste(rollout, team) -> None:
    scenarios = rollout.world.scenarios(range(3))
    fitness = [1.0, 5.0, 2.0, 0.0, 9.0, 5.0]
    found = Original(rollout, team, LABELS, fitness).clone(
        ["low", "hi", "non-specialized"], scenarios
    )
    assert found.teams == ("whole", "low", "hi", "non-specialized")
    assert of(found, "whole") == play(rollout, team, scenarios)
    for caste, robot in (("low", 2), ("hi", 1), ("non-specialized", 3)):
        same = np.full(6, robot)
        clones = Team(0, team.genes[same], team.active[same], team.fitness, team.specialization)
        assert of(found, caste) == play(rollout, clones, scenarios), caste
    assert len({tuple(of(found, caste)["area"]) for caste in found.teams}) == 4


def test_a_robot_without_a_finite_fitness_is_cloned_last(rollout, team) -> None:
    scenarios = rollout.world.scenarios([7])
    castes = ["low"]
    expected = Original(rollout, team, LABELS, [0, 0, 1, 0, 0, 0]).clone(castes, scenarios)
    for worst in (np.nan, np.inf, -np.inf):
        found = Original(rollout, team, LABELS, [worst, 0, -3, 0, 0, 0]).clone(castes, scenarios)
        assert of(found, "low") == of(expected, "low")
    nobody = Original(rollout, team, LABELS, [np.nan] * 6).clone(castes, scenarios)
    first = Original(rollout, team, LABELS, [1, 0, 0, 0, 0, 0]).clone(castes, scenarios)
    assert of(nobody, "low") == of(first, "low")


def test_without_castes_only_the_whole_team_plays(rollout, team) -> None:
    scenarios = rollout.world.scenarios([1])
    for found in (
        Original(rollout, team, LABELS, NOTHING).lesion([], scenarios),
        Original(rollout, team, LABELS, NOTHING).clone([], scenarios),
    ):
        assert found.teams == ("whole",)
        assert of(found, "whole") == play(rollout, team, scenarios)


@pytest.mark.parametrize(
    ("task", "stands_in"),
    [
        ("rover/simple-1", {"low": "low", "med": "med", "hi": "hi", "move": "non-specialized"}),
        ("rover/simple-1", {"non-specialized": "non-specialized"}),
        ("gacc/complex-1", {"B-detector": "B-detector", "A-constructor": "A-constructor"}),
        ("gacc/complex-1", {"C-gatherer": "C-gatherer", "non-specialized": "non-specialized"}),
        ("pursuit/team-3", {"pursuer": "heuristic", "idle": "heuristic"}),
        (f"{EXAMPLE}:dark-1", {"move": "idler", "rest": "idler"}),
    ],
)
def test_the_heuristic_controller_that_replaces_a_caste(task, stands_in) -> None:
    world = conevo.world(task)
    for caste, heuristic in stands_in.items():
        assert world.heuristics[replacement(world, caste)] == heuristic


@pytest.mark.parametrize("task", ["rover/simple-1", "gacc/complex-1"])
def test_all_castes_of_the_thesis_have_their_own_heuristic(task: str) -> None:
    """Tables 5.3 and 6.3 name a controller for every caste that sections 5.5 and 6.5 replace."""
    world = conevo.world(task)
    castes = [caste for caste in world.castes if caste != "move"]
    assert [world.heuristics[replacement(world, caste)] for caste in castes] == castes


def test_controllers_change_places_with_all_others_in_turn(rollout, team) -> None:
    scenarios = rollout.world.scenarios(range(3))
    found = Original(rollout, team, LABELS, NOTHING).rotate(scenarios)
    assert found.teams == ("whole", "moved")
    assert of(found, "whole") == play(rollout, team, scenarios)
    moved = []
    for k in range(1, 6):
        order = [(robot - k) % 6 for robot in range(6)]
        one = replace(team, genes=team.genes[order], active=team.active[order])
        moved.append(play(rollout, one, scenarios)["area"])
    assert of(found, "moved")["area"] == pytest.approx(np.mean(moved, axis=0), rel=1e-6)
    assert of(found, "moved")["area"] != of(found, "whole")["area"]


def test_clones_lose_nothing_by_changing_places(rollout, team) -> None:
    first = [0] * 6
    clones = replace(team, genes=team.genes[first], active=team.active[first])
    found = Original(rollout, clones, LABELS, NOTHING).rotate(rollout.world.scenarios(range(3)))
    for measure, values in of(found, "moved").items():
        assert values == pytest.approx(of(found, "whole")[measure], rel=1e-6)
