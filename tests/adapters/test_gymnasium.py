"""Teams as a vector environment: spaces, the three modes of autoreset, infos, masks, wrappers."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest

from adapters.champions import LIGHT, TASKS, tiny_champion
from conevo.errors import UsageError
from conevo.rng import fold
from extras import need

need("gymnasium")

from gymnasium.spaces import Box, Discrete, MultiDiscrete  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402
from gymnasium.wrappers.vector import (  # noqa: E402
    NormalizeObservation,
    NormalizeReward,
    RecordEpisodeStatistics,
)

from conevo.adapters.gymnasium import TeamVectorEnv  # noqa: E402

EASY = partial(TeamVectorEnv, "pursuit/team-3", prey="heuristic", threads=1)  # four robots
MODES = ("discrete", "continuous", "outputs")
AUTORESETS = (*AutoresetMode,)


@pytest.mark.parametrize("per", ["robot", "team"])
@pytest.mark.parametrize("autoreset", AUTORESETS)
@pytest.mark.parametrize(
    ("task", "mode"), [*((t, m) for t in TASKS for m in MODES), (LIGHT, "outputs")]
)
def test_everything_is_in_its_space(task: str, mode: Any, autoreset: Any, per: Any) -> None:
    env = TeamVectorEnv(
        task, 3, per=per, actions=mode, autoreset_mode=autoreset, threads=1, iterations=9
    )
    robots = len(env.teams.agents)
    assert env.num_envs == (3 * robots if per == "robot" else 3)
    assert env.metadata["autoreset_mode"] is autoreset
    observations, infos = env.reset(seed=1)
    assert observations in env.observation_space
    assert observations[0] in env.single_observation_space
    assert infos == {}
    env.action_space.seed(2)
    for t in range(8):
        actions = env.action_space.sample()
        assert actions[0] in env.single_action_space
        observations, rewards, terminations, truncations, infos = env.step(actions)
        assert observations in env.observation_space
        assert (rewards.dtype, rewards.shape) == (np.float64, (env.num_envs,))
        assert (terminations.dtype, truncations.dtype) == (bool, bool)
        assert not np.concatenate([terminations, truncations]).any(), t
        assert infos == {}
    assert env.step(actions)[3].all()
    env.close()


def test_spaces_are_those_of_robots_or_teams() -> None:
    robots, teams = EASY(2), EASY(2, per="team")
    assert robots.single_action_space == Discrete(5)
    assert teams.single_action_space == MultiDiscrete([5] * 4)
    assert robots.action_space == MultiDiscrete([5] * 8)
    assert teams.observation_space == Box(0.0, 1.0, (2, 64), np.float32)
    wheels = EASY(2, actions="continuous", per="team").single_action_space
    assert wheels == Box(-1.0, 1.0, (8,), np.float32)


def test_a_step_of_many_teams_is_that_of_each_robot() -> None:
    """Teams are rows, robots of a team are next to each other; a team's reward is the mean."""
    robots = TeamVectorEnv("rover/complex-5", 3, iterations=250, scenarios=8, threads=1)
    teams = TeamVectorEnv("rover/complex-5", 3, iterations=250, scenarios=8, per="team")
    assert np.array_equal(robots.reset(seed=4)[0].reshape(3, -1), teams.reset(seed=4)[0])
    rng, is_paid = np.random.default_rng(0), False
    for _ in range(150):
        actions = rng.integers(3, size=60)
        seen, rewards, *_ = robots.step(actions)
        together, means, *_ = teams.step(actions.reshape(3, 20))
        assert np.array_equal(seen.reshape(3, -1), together)
        assert np.array_equal(rewards.reshape(3, 20).mean(axis=1), means)
        is_paid |= bool(rewards.any())
        place = 20 + 7  # robot 7 of team 1
        assert np.array_equal(seen[place], robots.teams.observations[1, 7])
    assert is_paid


def ending(autoreset: AutoresetMode) -> TeamVectorEnv:
    """Return two teams with epochs of six iterations: one has played two, the other none."""
    env = EASY(2, iterations=6, autoreset_mode=autoreset, scenarios=3)
    env.reset(seed=5)
    for _ in range(2):
        env.step(np.ones(8, int))
    env.teams.reset(np.array([False, True]))
    return env


def is_of(team: int) -> np.ndarray:
    return np.repeat(np.arange(2) == team, 4)


def test_same_step_returns_the_next_epoch_and_keeps_the_last_of_this_one() -> None:
    env = ending(AutoresetMode.SAME_STEP)
    for t in range(2, 10):
        seen, _, _, truncations, infos = env.step(np.ones(8, int))
        team = {5: 0, 7: 1}.get(t)
        assert np.array_equal(truncations, is_of(team) if team is not None else np.zeros(8, bool))
        if team is None:
            assert infos == {}
            continue
        assert env.teams.clock[team] == 0
        assert np.array_equal(infos["_final_obs"], is_of(team))
        last = np.stack(infos["final_obs"][infos["_final_obs"]])
        assert last.shape == (4, 16)
        assert (last != seen[is_of(team)]).any()
        assert all(one is None for one in infos["final_obs"][~is_of(team)])
        reached = infos["final_info"]["performance"]
        assert np.array_equal(reached["_captures"], is_of(team))
        assert reached["first_capture"][is_of(team)].tolist() == [6.0] * 4
        assert np.array_equal(infos["_final_info"], is_of(team))


def test_next_step_resets_with_the_next_call_whose_actions_have_no_effect() -> None:
    env = ending(AutoresetMode.NEXT_STEP)
    for t in range(2, 10):
        _, rewards, _, truncations, infos = env.step(np.ones(8, int))
        team = {5: 0, 7: 1}.get(t)
        assert np.array_equal(truncations, is_of(team) if team is not None else np.zeros(8, bool))
        assert ("performance" in infos) == (team is not None)
        if team is not None:
            assert env.teams.clock[team] == 6
            assert np.array_equal(infos["_performance"], is_of(team))
        elif t in (6, 8):
            team = {6: 0, 8: 1}[t]
            assert env.teams.clock[team] == 0
            assert not rewards[is_of(team)].any()


def test_disabled_waits_for_a_reset_of_those_that_have_ended() -> None:
    env = ending(AutoresetMode.DISABLED)
    for _ in range(4):
        seen, _, _, truncations, infos = env.step(np.ones(8, int))
    assert np.array_equal(truncations, is_of(0))
    assert np.array_equal(infos["_performance"], is_of(0))
    with pytest.raises(UsageError, match="1 of 2 teams have ended: reset them before the next"):
        env.step(np.ones(8, int))
    fresh, _ = env.reset(options={"reset_mask": truncations})
    assert env.teams.clock.tolist() == [0, 4]
    assert np.array_equal(fresh[is_of(1)], seen[is_of(1)])
    assert (fresh[is_of(0)] != seen[is_of(0)]).any()
    env.step(np.ones(8, int))
    assert env.teams.clock.tolist() == [1, 5]


@pytest.mark.parametrize("autoreset", AUTORESETS)
def test_returns_of_an_epoch_are_fitness(autoreset: AutoresetMode) -> None:
    """Bit for bit those of the run's own evaluation, with the champion of a run in all teams."""
    one = tiny_champion("rover/complex-5")
    env = TeamVectorEnv(
        one.task, 2, actions="outputs", scenarios=[one.key], autoreset_mode=autoreset, **one.params
    )
    seen, _ = env.reset()
    returns, context = np.zeros(env.num_envs), one.team.first_context
    for expected in one.inputs:
        assert seen.tobytes() == np.stack([expected] * 2).tobytes()
        outputs, context = one.team.step(seen[: env.num_envs // 2], context)
        seen, rewards, _, truncations, infos = env.step(np.concatenate([outputs] * 2))
        returns += rewards
    assert truncations.all()
    assert returns.astype(np.float32).tobytes() == np.concatenate([one.fitness] * 2).tobytes()
    reached = infos.get("final_info", infos)["performance"]
    assert {name: reached[name].tolist() for name in one.performance} == {
        name: [value] * env.num_envs for name, value in one.performance.items()
    }


def test_a_seed_repeats_everything_and_none_goes_on() -> None:
    def play(seed: int | None) -> list[str]:
        given = [repr(env.reset(seed=seed))]
        given += [repr(env.step(np.full(8, k % 5))) for k in range(10)]
        return given

    env = EASY(2, iterations=4)
    first, other, again = play(3), play(4), play(3)
    assert first == again != other
    assert env.teams.stepper.keys[:2] == (fold(3, "epoch", 0, 0), fold(3, "epoch", 0, 1))
    assert play(None) != again
    given = EASY(2, iterations=4, scenarios=[5])
    given.reset(seed=3)
    assert given.teams.stepper.keys == (5,)


@pytest.mark.parametrize("autoreset", AUTORESETS)
def test_wrappers_of_gymnasium_take_it(autoreset: AutoresetMode) -> None:
    env = EASY(2, iterations=4, autoreset_mode=autoreset)
    if autoreset is AutoresetMode.NEXT_STEP:  # the one that these two take
        env = NormalizeReward(NormalizeObservation(env))
    env = RecordEpisodeStatistics(env)
    env.reset(seed=1)
    for _ in range(4):
        observations, _, _, truncations, infos = env.step(env.action_space.sample())
    assert truncations.all()
    assert np.isfinite(observations).all()
    assert infos["episode"]["l"].tolist() == [4] * 8
    assert np.isfinite(infos["episode"]["r"]).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"per": "teams"}, r"unknown sub-environment 'teams'; did you mean 'team'\?"),
        ({"actions": "continous"}, r"unknown mode of actions .* did you mean 'continuous'\?"),
        ({"autoreset_mode": "samestep"}, r"unknown autoreset mode .* did you mean 'SameStep'\?"),
        ({"num_teams": 0}, "num_teams = 0: must be an integer from 1 to 1048576"),
        ({"num_teams": 2.0}, "num_teams = 2.0: must be an integer"),
        ({"scenarios": 0}, "scenarios = 0: must be an integer from 1"),
        ({"thread": 3}, r"unknown argument 'thread' for .*; did you mean 'threads'\?"),
        ({"max_cycles": 3}, r"unknown argument 'max_cycles' for pursuit/team-3"),
    ],
)
def test_bad_arguments_are_one_line(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message) as refused:
        TeamVectorEnv("pursuit/team-3", **{"num_teams": 2, **settings})
    assert "\n" not in str(refused.value)


def test_bad_steps_and_resets_are_one_line() -> None:
    env = EASY(2, autoreset_mode="Disabled")
    half = np.arange(8) < 4
    with pytest.raises(UsageError, match="reset the worlds before the first step"):
        env.step(np.zeros(8, int))
    with pytest.raises(
        UsageError, match="the first reset, are for all teams: leave out reset_mask"
    ):
        env.reset(options={"reset_mask": half})
    env.reset(seed=1)
    for given, message in (
        ({"seed": [1, 2]}, r"seed = \[1, 2\]: must be an integer from 0 to 18446744073709551615"),
        ({"options": {"mask": half}}, r"unknown option 'mask' of reset; did you mean 'reset_mask'"),
        ({"options": {"reset_mask": half[:3]}}, r"reset_mask must be 8 truth values, not \[3\]"),
        ({"options": {"reset_mask": half.astype(int)}}, "must be 8 truth values, not .* of int64"),
        ({"options": {"reset_mask": np.arange(8) < 5}}, "its robots are reset together"),
        (
            {"seed": 1, "options": {"reset_mask": half}},
            "a seed, and the first reset, are for all teams",
        ),
    ):
        with pytest.raises(UsageError, match=message):
            env.reset(**given)
    for actions, message in (
        (np.zeros((2, 4), int), r"actions must be \[8\], not \[2, 4\]"),
        (np.zeros(7, int), r"actions must be \[8\], not \[7\]"),
        (np.zeros(8), "an action must be an integer from 0 to 4, not float64"),
        (np.full(8, 5), "action 5: must be from 0 to 4"),
    ):
        with pytest.raises(UsageError, match=message):
            env.step(actions)
