"""Epochs of a VMAS scenario, side by side in torch."""

from __future__ import annotations

import functools
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from vmas import make_env
from vmas.simulator.environment import Environment

from conevo.errors import ConevoError, UsageError, in_a_line, unknown_name
from conevo.reading import parse_toml
from conevo.simulators.tasks import TaskFacts
from conevo.simulators.vmas.draws import Draws
from conevo.simulators.vmas.things import places_of, scenario_text

__all__ = ["Batch", "VmasEpochs", "flattened", "made", "policy_of"]

Floats = npt.NDArray[np.float32]
Keys = npt.NDArray[np.uint64]
Bools = npt.NDArray[np.bool_]
# Choice: environments in multiples of 64. torch computes the elements that its vector instructions
# leave over by other functions, so an environment would depend on the size of its batch.
WIDTH = 64
KEYWORD = re.compile(r"""kwargs\.(?:pop|get)\(\s*["'](\w+)["']""")


class VmasEpochs:
    """B epochs of a scenario; see ``playing.Epochs``.

    Args:
        task: name of the scenario.
        options: its keyword arguments, as a TOML table.
        facts: about it.
        n: B.
        is_shared: whether it draws numbers for all environments together: then each batch plays
            one scenario.
    """

    def __init__(self, task: str, options: str, facts: TaskFacts, n: int, is_shared: bool) -> None:
        self._task, self._facts, self._n, self._is_shared = (task, options), facts, n, is_shared
        self._batches: list[tuple[Batch, npt.NDArray[np.int64]]] = []  # each with its epochs

    def begin(self, keys: Keys) -> Floats:
        """Start an epoch for each key [B], and return what robots observe [B, R, S]."""
        every = np.arange(self._n)
        groups = [every]
        if self._is_shared:
            groups = [every[keys == key] for key in np.unique(keys)]
        self._batches = [
            (Batch(made(*self._task, _wide(len(rows)), k), keys[rows], self._facts.n_inputs), rows)
            for k, rows in enumerate(groups)
        ]
        return self._joined([batch.begin() for batch, _ in self._batches])

    def step(self, actions: npt.NDArray[Any]) -> tuple[Floats, Floats, Bools]:
        """Execute the actions [B, R, A] of all robots; see ``playing.Epochs``."""
        found = [batch.step(actions[rows]) for batch, rows in self._batches]
        observed, rewards, ended = (self._joined([one[k] for one in found]) for k in range(3))
        return observed, rewards, ended

    def heuristic(self, k: int, observed: Floats) -> Floats:
        """Return the actions of VMAS' own controller of the scenario."""
        found = [batch.heuristic(observed[rows]) for batch, rows in self._batches]
        ends: Any = self._facts.actions
        actions: Floats = np.clip(self._joined(found), ends.low, ends.high)
        return actions

    def measured(self) -> Floats:
        """Return the measures [B, measures] of this iteration, means of VMAS' reports on robots."""
        names = [one.name for one in self._facts.measures]
        return self._joined([batch.measured(names) for batch, _ in self._batches])

    def places(self) -> dict[str, npt.NDArray[Any]]:
        """Return positions in the first epoch: of robots, and of things."""
        for batch, rows in self._batches:
            if rows[0] == 0:
                return places_of(batch.env)
        raise AssertionError("no epoch has begun")

    def _joined(self, parts: list[npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """Return what batches give, in the order of epochs."""
        if len(parts) == 1:
            return parts[0]
        whole = np.empty((self._n, *parts[0].shape[1:]), parts[0].dtype)
        for part, (_, rows) in zip(parts, self._batches, strict=True):
            whole[rows] = part
        return whole


class Batch:
    """Environments of VMAS that are stepped together.

    Args:
        env: VMAS' environments, as many as keys or more.
        keys: of their scenarios.
        n_inputs: S.
    """

    def __init__(self, env: Environment, keys: Keys, n_inputs: int) -> None:
        self.env, self._n, self._n_inputs = env, len(keys), n_inputs
        whole = np.concatenate([keys, np.repeat(keys[:1], env.num_envs - len(keys))])
        self._draws, self._t = Draws(whole), 0
        self.seed = int(keys[0] % 2**31)  # of random numbers that have no address
        self._infos: list[dict[str, torch.Tensor]] = []
        self._random: list[Any] = []
        self._sizes: list[int] = []  # of each robot's observation

    def begin(self) -> Floats:
        """Start the epochs and return what robots observe [B, R, S]."""
        with _one_thread(), self._draws.at(0):
            observed = self.env.reset(seed=self.seed)
        self._random = list(Environment.vmas_random_state)
        return self._observed(observed)

    def step(self, actions: npt.NDArray[Any]) -> tuple[Floats, Floats, Bools]:
        """Execute actions [B, R, A]; return observations, rewards and which epochs end."""
        agents, n = self.env.agents, self.env.num_envs
        given = np.zeros((n, *actions.shape[1:]), np.float32)
        given[: self._n] = actions
        of_agents = [
            torch.from_numpy(np.ascontiguousarray(given[:, i, : self.env.get_agent_action_size(a)]))
            for i, a in enumerate(agents)
        ]
        self._t += 1
        Environment.vmas_random_state[:] = self._random
        with _one_thread(), self._draws.at(self._t):
            observed, rewards, ended, self._infos = self.env.step(of_agents)
        self._random = list(Environment.vmas_random_state)
        found = np.stack([one.reshape(n).numpy()[: self._n] for one in rewards], axis=1)
        done = ended.reshape(n).numpy()[: self._n] > 0
        return self._observed(observed), found.astype(np.float32), done

    @property
    def used(self) -> list[Any]:
        """The states of random numbers without an address, which shows whether any was drawn."""
        return self._random

    def heuristic(self, observed: Floats) -> Floats:
        """Return the actions [B, R, A] of VMAS' controller of the scenario."""
        policy = policy_of(self.env)
        sizes = [self.env.get_agent_action_size(agent) for agent in self.env.agents]
        found = np.zeros((*observed.shape[:2], max(sizes)), np.float32)
        wide = np.zeros((self.env.num_envs, *observed.shape[1:]), np.float32)
        wide[: self._n] = observed
        with _one_thread(), torch.no_grad():
            for i, agent in enumerate(self.env.agents):
                seen = torch.from_numpy(np.ascontiguousarray(wide[:, i, : self._sizes[i]]))
                action = policy.compute_action(seen, u_range=agent.u_range).numpy()
                found[:, i, : action.shape[1]] = action[: self._n]
        return found

    def measured(self, names: list[str]) -> Floats:
        """Return the mean over robots [B, measures] of VMAS' reports."""
        found = np.zeros((self._n, len(names)), np.float32)
        for k, name in enumerate(names):
            own = [info[name] for info in self._infos if name in info]
            for one in own:
                found[:, k] += one.reshape(self.env.num_envs)[: self._n].to(torch.float32).numpy()
            found[:, k] /= np.float32(len(own))
        return found

    @property
    def infos(self) -> list[dict[str, torch.Tensor]]:
        """VMAS' reports on each robot in the last iteration."""
        return self._infos

    def _observed(self, of_agents: list[Any]) -> Floats:
        """Return observations as one array [B, R, S], filled up with 0."""
        found = np.zeros((self._n, len(of_agents), self._n_inputs), np.float32)
        parts = [flattened(one, self.env.num_envs)[: self._n] for one in of_agents]
        self._sizes = [flat.shape[1] for flat in parts]
        for i, flat in enumerate(parts):
            found[:, i, : flat.shape[1]] = flat
        return found


def flattened(observation: Any, n: int) -> Floats:
    """Return a robot's observations in n environments, [n, S]; named parts follow each other."""
    if isinstance(observation, dict):
        return np.concatenate([flattened(one, n) for one in observation.values()], axis=1)
    found: Floats = observation.reshape(n, -1).to(torch.float32).numpy()
    return found


def policy_of(env: Environment) -> Any:
    """Return VMAS' own controller of a scenario, None if it has none."""
    module = type(env.scenario).make_world.__globals__
    kind = module.get("HeuristicPolicy")
    return None if kind is None else kind(continuous_action=True)


@functools.lru_cache(maxsize=8)
def made(task: str, options: str, n: int, number: int = 0) -> Environment:
    """Return n environments of a scenario; they are used again.

    Args:
        task: name of the scenario.
        options: its keyword arguments, as a TOML table.
        n: number of environments.
        number: of a batch, since several are in use together.

    Raises:
        UsageError: an option that the scenario does not have, or refuses.
    """
    given = parse_toml(f"options = {{{options}}}", "options")["options"]
    draws = Draws(np.zeros(n, np.uint64))
    try:
        with warnings.catch_warnings(), _one_thread(), draws.at(0):
            warnings.simplefilter("ignore")
            env = make_env(task, num_envs=n, continuous_actions=True, seed=0, **given)
    except ConevoError:
        raise
    except Exception as error:
        raise UsageError(
            f"vmas:{task} cannot be made with options {options!r}: {in_a_line(error)}"
        ) from error
    _refuse_unknown(env, task, given)
    _touch_alone(env)
    return env


def _touch_alone(env: Environment) -> None:
    """Compute the contacts of two things in every environment, near or not.

    VMAS leaves out two things that are far from each other in all environments of a batch. Just
    outside this distance they still push each other a little, if they are near in another one.
    """
    world = env.world
    shapes = [set(pair) for pair in world._collidable_pairs]

    def collides(a: Any, b: Any) -> bool:
        can_move = a.movable or a.rotatable or b.movable or b.rotatable
        wants = a is not b and can_move and a.collides(b) and b.collides(a)
        return bool(wants and {type(a.shape), type(b.shape)} in shapes)

    world.collides = collides


def _refuse_unknown(env: Environment, task: str, given: dict[str, Any]) -> None:
    """Raise UsageError for an option that a scenario does not read."""
    known = set(KEYWORD.findall(scenario_text(env)))
    for key in given:
        if key not in known:
            raise unknown_name("option", key, known, f"of vmas:{task}")


def _wide(n: int) -> int:
    return -(-n // WIDTH) * WIDTH


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let torch use one thread: its operations here are too small for more."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
