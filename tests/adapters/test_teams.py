"""Stepped teams: rewards add up to fitness, an evolved team is replayed, pictures are a film's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import conevo
from adapters.champions import LIGHT, TASKS, tiny_champion
from conevo.adapters.picture import Camera
from conevo.adapters.teams import SteppedTeams, length_in, versioned
from conevo.errors import UsageError
from conevo.replay.drawing.scene import Scene
from conevo.replay.playback import playback_of
from conevo.rng import fold


def teams_of(task: str, n: int = 1, actions: Any = "outputs", **params: Any) -> SteppedTeams:
    return SteppedTeams(task, n, actions, params, scenarios=4, threads=1)


@pytest.mark.parametrize(("task", "is_on_cpu"), [*((task, True) for task in TASKS), (LIGHT, False)])
def test_an_evolved_team_is_replayed_bit_for_bit(task: str, is_on_cpu: bool) -> None:
    """Its controllers in numpy see what they saw, and rewards add up to its fitness.

    ``is_on_cpu=False`` takes the path of a device whose arrays are copied.
    """
    one = tiny_champion(task)
    teams = teams_of(task, **one.params)
    teams._is_on_cpu = is_on_cpu
    teams.play(one.key)
    context, returns = one.team.first_context, np.zeros(len(one.fitness))
    for seen in one.inputs:
        now = teams.observations[0]
        assert now.tobytes() == seen.tobytes()
        assert not teams.has_ended.any()
        outputs, context = one.team.step(now, context)
        returns += teams.step(outputs[None])[0]
    assert teams.has_ended.all()
    assert returns.astype(np.float32).tobytes() == one.fitness.tobytes()
    reached = {name: float(values[0]) for name, values in teams.performance().items()}
    assert reached == one.performance
    assert not teams.step(outputs[None]).any()  # the epoch has ended


def test_returns_are_exact_in_double_precision() -> None:
    """Rover fitness has fractions: its growth, added up, is the number itself."""
    teams = teams_of("rover/complex-5", 3, "discrete", iterations=100)
    teams.reset(seed=2)
    rng = np.random.default_rng(1)
    returns, steps = np.zeros((3, 20)), 0
    while not teams.has_ended.all():
        returns += teams.step(rng.integers(len(teams.actions.names), size=(3, 20)))
        steps += 1
    assert steps == 100
    assert (returns % 1 != 0).any()
    assert np.array_equal(returns, teams.stepper.fitness.numpy().astype(np.float64))


def test_a_reset_of_some_teams_starts_their_returns_again() -> None:
    teams = teams_of("rover/complex-5", 2, "discrete", iterations=200)
    teams.reset(seed=2)
    rng = np.random.default_rng(1)
    returns = np.zeros((2, 20))
    for step in range(150):
        if step == 100:
            teams.reset(np.array([False, True]))
            returns[1] = 0.0
        returns += teams.step(rng.integers(3, size=(2, 20)))
        assert np.array_equal(returns, teams.stepper.fitness.numpy())
    assert teams.clock.tolist() == [150, 50]
    assert returns[0].any()


def test_a_seed_gives_the_scenarios_of_a_run_and_none_gives_others() -> None:
    first, second = teams_of("pursuit/team-3"), teams_of("pursuit/team-3")
    first.reset(seed=7)
    assert first.stepper.keys == tuple(fold(7, "epoch", 0, k) for k in range(4))
    first.reset()
    assert first.stepper.keys[0] == fold(7, "epoch", 0, 0)  # it goes on in the pool
    second.reset()
    keys = second.stepper.keys
    second.reset()
    assert second.stepper.keys == keys != first.stepper.keys


@pytest.mark.parametrize("task", [*TASKS, LIGHT])
def test_a_picture_is_the_world_of_a_film(task: str) -> None:
    """Positions in a recording have 16 bits, so a few pixels may differ a little."""
    one = tiny_champion(task)
    film = playback_of(one.trajectory)
    scene = Scene(film, (480, 480), "action")
    teams = teams_of(task, 2, **one.params)
    camera = Camera(teams, 1)
    teams.stepper.draw([one.key])
    teams.stepper.reset()
    camera.look()
    start = camera.picture()
    context, pictures = one.team.first_context, []
    for t in range(60):
        outputs, context = one.team.step(teams.observations[1], context)
        teams.step(np.stack([np.zeros_like(outputs), outputs]))
        camera.look()
        if t in (0, 30, 59):
            pictures.append((t, camera.picture()))
    assert start.shape == (480, 480, 3)
    assert start.dtype == np.uint8
    assert (start != pictures[-1][1]).any()
    for t, picture in pictures:
        expected = np.asarray(scene.at(t)).astype(int)
        apart = np.abs(picture.astype(int) - expected).max(axis=-1)
        assert (apart > 40).mean() < 2e-4, t


def test_a_new_epoch_is_a_new_picture() -> None:
    teams = teams_of("pursuit/team-3", actions="discrete", iterations=5)
    camera = Camera(teams)
    pictures = []
    for _ in range(2):
        teams.play(3)
        camera.look()
        start = camera.picture()
        for _ in range(7):  # two more than the epoch has
            teams.step(np.ones((1, len(teams.agents)), int))
            camera.look()
        pictures.append((start, camera.picture()))
    (first, moved), (second, again) = pictures
    assert np.array_equal(first, second)
    assert np.array_equal(moved, again)
    assert (first != moved).any()


def test_a_world_that_cannot_be_drawn_is_refused_in_one_line() -> None:
    teams = teams_of("pursuit/team-3", actions="discrete", iterations=5)
    teams.play(3)
    camera = Camera(teams)
    camera.look()
    teams.stepper._view("x").fill_(np.nan)
    with pytest.raises(UsageError, match="pursuit-v2/team-3 cannot be drawn: only finite numbers"):
        camera.picture()


def test_names_have_the_version_at_the_end() -> None:
    assert versioned(conevo.world("pursuit/team-3")) == "pursuit_team_3_v2"
    assert versioned(conevo.world("rover-v2/complex-5")) == "rover_complex_5_v2"
    assert versioned(conevo.world(LIGHT)) == "light_dark_1_v1"


@pytest.mark.parametrize(
    ("task", "params", "message"),
    [
        ("pursuit/team-33", {}, r"unknown environment 'team-33' .*did you mean 'team-10'\?"),
        ("persuit/team-3", {}, r"unknown world 'persuit'.*did you mean 'pursuit'\?"),
        ("pursuit-v1/team-3", {}, "this version of conevo plays pursuit-v2, no longer pursuit-v1"),
        (3, {}, "task = 3: must be a name, 'WORLD/ENVIRONMENT'"),
        ("vmas:balance", {}, "vmas:balance is a task of another package: use its environment"),
        ("pursuit/team-3", {"pray": "heuristic"}, r"unknown argument 'pray' .*mean 'prey'\?"),
        ("pursuit/team-3", {"render_mod": 1}, r"'render_mod' .*did you mean 'render_mode'\?"),
        ("pursuit/team-3", {"iterations": 0}, r"world.iterations = 0: must be"),
    ],
)
def test_bad_inputs_are_one_line(task: Any, params: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message) as refused:
        SteppedTeams(task, 1, "discrete", params, scenarios=1, arguments=("render_mode",))
    assert "\n" not in str(refused.value)


def test_a_world_with_a_simulator_of_its_own_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("conevo.adapters.teams.world", lambda task, **params: object())
    with pytest.raises(UsageError, match="has a simulator of its own, which cannot be stepped"):
        teams_of("pursuit/team-3")


def test_the_length_of_an_epoch_is_given_once() -> None:
    assert length_in({"prey": "heuristic"}, 5) == {"prey": "heuristic", "iterations": 5}
    assert length_in({"iterations": 5}, 5) == {"iterations": 5}
    with pytest.raises(UsageError, match="max_cycles = 5 and iterations = 6: give one of them"):
        length_in({"iterations": 6}, 5)
