"""Teams as a batched environment of TorchRL: specs, ends, resets, seeds, rewards, bits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import conevo
from conevo.errors import UsageError
from conevo.rng import fold
from conevo.worlds.checks import random_teams
from conevo.worlds.measures import measures_of
from extras import need

need("torch", "torchrl")

import torch  # noqa: E402
from torchrl.data import Unbounded  # noqa: E402
from torchrl.envs.utils import check_env_specs  # noqa: E402

from conevo.adapters.torchrl import TeamBatchEnv  # noqa: E402

LIGHT = f"{Path(__file__).resolve().parents[2]}/examples/light.py:dark-1"
TASKS = ("pursuit/team-3", "rover/complex-5", "gacc/complex-9")
KEY = fold(5, "epoch", 0, 1)


def an_env(task: str = "pursuit/team-3", n: int = 6, **settings: Any) -> TeamBatchEnv:
    return TeamBatchEnv(task, n, **{"iterations": 20, "scenarios": 8, "threads": 1} | settings)


def stepped(env: TeamBatchEnv, steps: int, action: Any = None, seen: Any = None) -> Any:
    """Return what is seen after some steps, from a reset by default, at random by default."""
    seen = env.reset() if seen is None else seen
    for _ in range(steps):
        if action is None:
            env.rand_action(seen)
        else:
            seen.set((env.group, "action"), action)
        seen = env.step(seen)["next"]
    return seen


def fixed(env: TeamBatchEnv, steps: int) -> Any:
    """Return a policy that plays the same random actions each time."""
    drawn = torch.Generator().manual_seed(3)
    shape = (steps, *env.action_spec[env.group, "action"].shape)
    actions = iter(torch.randint(len(env.action_names), shape, generator=drawn))
    return lambda td: td.set((env.group, "action"), next(actions))


@pytest.mark.parametrize("mode", ["discrete", "continuous", "outputs"])
@pytest.mark.parametrize("task", TASKS)
def test_specs_hold_and_all_epochs_are_truncated(task: str, mode: Any) -> None:
    env = an_env(task, actions=mode)
    check_env_specs(env)
    played = env.rollout(45, break_when_any_done=False)["next"]
    for team in range(6):
        assert played["truncated"][team, :, 0].nonzero().ravel().tolist() == [19, 39]
    assert not played["terminated"].any()
    assert torch.equal(played["done"], played["truncated"])
    r, s = env.teams.world.n_robots, len(env.teams.world.inputs)
    assert played[env.group, "observation"].shape == (6, 45, r, s)
    assert played[env.group, "reward"].shape == (6, 45, r, 1)
    assert env.group_map == {env.group: env.teams.agents}


def test_groups_are_named_after_the_robots() -> None:
    assert [an_env(task).group for task in TASKS] == ["predators", "rovers", "robots"]


def test_a_world_in_a_file_without_bounds_is_an_environment() -> None:
    env = an_env(LIGHT, actions="continuous")
    check_env_specs(env)
    assert env.group_map == {"robots": ["robot_0", "robot_1", "robot_2"]}
    assert isinstance(env.observation_spec["robots", "observation"], Unbounded)
    with pytest.raises(UsageError, match="declares no discrete actions"):
        an_env(LIGHT)


def test_a_reset_of_some_teams_leaves_the_others() -> None:
    env = an_env(seed=1)
    before = stepped(env, 7)
    mask = torch.tensor([True, False, False, True, False, False])[:, None]
    after = env.reset(before.clone().set("_reset", mask))
    assert env.teams.stepper.clock.numpy().tolist() == [0, 7, 7, 0, 7, 7]
    same = (after["predators", "observation"] == before["predators", "observation"]).flatten(1)
    assert same.all(dim=1).tolist() == [False, True, True, False, True, True]
    assert not after["done"].any()


def test_teams_that_have_ended_stay_done_until_they_are_reset() -> None:
    env = an_env(iterations=3)
    seen = stepped(env, 4)
    assert seen["done"].all()
    assert not seen["predators", "reward"].any()
    mask = torch.arange(6)[:, None] < 2
    after = env.reset(seen.set("_reset", mask))
    assert after["done"].ravel().tolist() == [False] * 2 + [True] * 4


def test_a_seed_gives_the_same_epochs_again_and_another_one_others() -> None:
    def played(env: TeamBatchEnv, seed: int | None = None) -> Any:
        if seed is not None:
            env.set_seed(seed)
        return env.rollout(50, fixed(env, 50), break_when_any_done=False)["next"]

    env = an_env()
    first, on, again = played(env, 4), played(env), played(env, 4)
    seeded, other = played(an_env(seed=4)), played(an_env(seed=5))
    key = "predators", "observation"
    assert torch.equal(first[key], again[key])
    assert torch.equal(first[key], seeded[key])
    assert not torch.equal(first[key], on[key])
    assert not torch.equal(first[key], other[key])
    assert not torch.equal(played(an_env())[key], played(an_env())[key])  # of the system


def test_a_new_seed_waits_for_a_reset_of_all_teams() -> None:
    env = an_env(seed=1)
    seen = env.reset()
    keys = env.teams.stepper.keys
    env.set_seed(2)
    env.reset(seen.clone().set("_reset", torch.arange(6)[:, None] < 2))
    assert env.teams.stepper.keys == keys
    env.reset(seen.clone().set("_reset", torch.ones(6, 1, dtype=torch.bool)))
    assert env.teams.stepper.keys == tuple(fold(2, "epoch", 0, k) for k in range(8))


def test_observations_are_copies() -> None:
    env = an_env()
    seen = env.reset()["predators", "observation"]
    kept = seen.clone()
    after = stepped(env, 5)
    assert torch.equal(seen, kept)
    assert not torch.equal(after["predators", "observation"], kept)


@pytest.mark.parametrize("task", TASKS)
def test_outputs_of_a_recorded_epoch_give_its_inputs_and_its_fitness(task: str) -> None:
    world = conevo.world(task, iterations=200)
    genes, teams = random_teams(world, 1)
    rollout = conevo.Rollout(world, n_threads=1)
    seen = rollout.record(genes, teams[0], world.scenarios([KEY]))
    env = an_env(task, 2, actions="outputs", iterations=200, scenarios=[KEY])
    outputs = iter(torch.from_numpy(seen["outputs"]))
    replay = lambda td: td.set((env.group, "action"), next(outputs).repeat(2, 1, 1))  # noqa: E731
    played = env.rollout(200, replay)
    for b in range(2):
        inputs = played[b][env.group, "observation"].numpy()
        assert inputs.tobytes() == seen["inputs"].tobytes()
        rewards = played[b]["next", env.group, "reward"][..., 0]
        returns = rewards.double().sum(dim=0).float().numpy()
        assert returns.tobytes() == seen["fitness"][-1].tobytes()
    reached = env.teams.performance()
    assert [values[0] for values in reached.values()] == seen["performance"][-1].tolist()


@pytest.mark.parametrize(
    ("task", "params"),
    [
        ("pursuit/team-3", {"prey": "heuristic", "iterations": 600}),
        ("rover/complex-5", {"iterations": 400}),
        (LIGHT, {"actions": "outputs"}),
    ],
)
def test_performance_as_reward_sums_to_the_first_measure(task: str, params: dict[str, Any]) -> None:
    """Also after a reset of some teams."""
    torch.manual_seed(1)
    env = an_env(task, 16, reward="performance", scale=0.5, seed=1, **params)
    shape = (16, len(env.teams.agents))
    seen, returns = env.reset(), torch.zeros(shape, dtype=torch.float64)
    for t in range(5 + env.teams.iterations):
        if t == 5:
            seen = env.reset(seen.set("_reset", torch.arange(16)[:, None] < 8))
            returns[:8] = 0.0
        seen = stepped(env, 1, seen=seen)
        returns += seen[env.group, "reward"][..., 0]
    assert seen["done"].all()
    reached = env.teams.performance()[measures_of(env.teams.world)[0].name]
    assert reached.any()
    for robot in range(shape[1]):
        assert returns[:, robot].numpy() == pytest.approx(0.5 * reached, rel=1e-5)


def test_a_measure_that_should_be_small_is_a_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    env = an_env(LIGHT, 4, actions="outputs", reward="performance", scenarios=[KEY])
    action = torch.tensor([0.0, 9.0, 3.0, -3.0]).expand(4, 3, 4)
    gains = stepped(env, 1, action)["robots", "reward"]
    small = [replace(one, larger_is_better=False) for one in measures_of(env.teams.world)]
    monkeypatch.setattr("conevo.adapters.torchrl.measures_of", lambda _: small)
    assert torch.equal(stepped(env, 1, action)["robots", "reward"], -gains)
    assert gains.any()


def test_actions_are_those_of_the_world() -> None:
    """Full speed of both wheels is the named action "forward"; a number beyond is refused."""
    env, other = (an_env(n=1, scenarios=[KEY], actions=one) for one in ("discrete", "continuous"))
    forward = torch.full((1, 4), env.action_names.index("forward"))
    seen = stepped(env, 10, forward), stepped(other, 10, torch.ones(1, 4, 2))
    named, driven = (one["predators", "observation"] for one in seen)
    assert torch.allclose(named, driven, atol=1e-5)
    assert not torch.allclose(named, env.reset()["predators", "observation"], atol=1e-5)
    with pytest.raises(UsageError, match=r"action 5: must be from 0 to 4 \(stop, forward"):
        env.step(env.reset().set(("predators", "action"), torch.full((1, 4), 5)))


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"reward": "performence"}, "reward 'performence'; did you mean 'performance'"),
        ({"scale": "big"}, "scale = 'big': must be a finite number"),
        ({"scale": float("nan")}, "scale = nan: must be a finite number"),
        ({"actions": "discreet"}, "mode of actions 'discreet'; did you mean 'discrete'"),
        ({"scenarios": 0}, "scenarios = 0: must be an integer from 1"),
        ({"device": "abacus"}, "abacus"),
        ({"pray": "heuristic"}, "unknown argument 'pray' for .* did you mean 'prey'"),
        ({"rewards": "fitness"}, "unknown argument 'rewards' for .* did you mean 'reward'"),
        ({"seed": -1}, "seed = -1: must be an integer from 0"),
        ({"n": 0}, "num_envs = 0: must be an integer from 1"),
    ],
)
def test_bad_settings_are_one_line(settings: dict[str, Any], line: str) -> None:
    with pytest.raises(UsageError, match=line) as error:
        an_env(**settings)
    assert "\n" not in str(error.value)


def test_bad_seeds_and_devices_are_refused() -> None:
    env = an_env()
    with pytest.raises(UsageError, match="seed = -1"):
        env.set_seed(-1)
    assert env.to("cpu") is env
    with pytest.raises(UsageError, match="make the environment with device='cuda:0'"):
        env.to("cuda:0")
