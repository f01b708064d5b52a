"""Epochs of a JaxMARL task in jax: WIDTH of them side by side, step by step or whole.

A whole epoch is one scan: controllers, actions and the task's step are one compiled program. It
returns every iteration, so that an epoch is recorded by the program by which it was evaluated.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt

from conevo.controllers.srn import Srn
from conevo.kernels.outputs import sigmoid_of
from conevo.simulators.actions import Continuous, Discrete
from conevo.simulators.jaxmarl.facts import JaxMarlFacts, facts_of, made

if TYPE_CHECKING:
    from conevo.simulators.jaxmarl.world import JaxMarlWorld

__all__ = ["WIDTH", "begin", "key_of", "on_cpu", "step", "weights_of", "whole"]

# Choice: always this many epochs, so that all phases of a run use one program. 256 are faster by a
# tenth to a quarter, but then a few epochs, as those of a test, cost as much as 256.
WIDTH = 64

Function = Callable[..., Any]


class _Task:
    """One epoch of a task, as functions that jax can trace.

    Arrays of all agents come first: A agents, with actions of W numbers.
    """

    def __init__(self, task: str, options: str, prefixes: str) -> None:
        self.env = made(task, options)
        self.facts: JaxMarlFacts = facts_of(task, options, prefixes)
        self.agents, self.team = self.facts.agents, list(self.facts.team)
        self._widest = max(agent.n_inputs for agent in self.agents)

    def begin(self, key: Any) -> tuple[Any, Any]:
        """Return what agents observe first [A, S], and the state."""
        observed, state = self.env.reset(jax.random.fold_in(key, 0))
        return self._seen(observed), state

    def step(self, key: Any, t: Any, state: Any, actions: Any) -> tuple[Any, ...]:
        """Execute actions [A, W]; return observations, the state, rewards [A], whether it ends."""
        of_agents = {
            agent.name: actions[k, 0].astype(jnp.int32)
            if isinstance(agent.space, int)
            else actions[k, : len(agent.space[0])]
            for k, agent in enumerate(self.agents)
        }
        key = jax.random.fold_in(key, t + 1)
        # Not env.step, which begins a new epoch by itself.
        observed, state, rewards, ended, _ = self.env.step_env(key, state, of_agents)
        own = [jnp.asarray(rewards[agent.name], jnp.float32).reshape(()) for agent in self.agents]
        done = jnp.asarray(ended["__all__"]).reshape(()) > 0
        return self._seen(observed), state, jnp.stack(own), done

    def places(self, state: Any) -> Any:
        """Return the positions of agents and landmarks [K, 2], none if unknown."""
        return state.p_pos if self.facts.has_places else jnp.zeros((0, 2), jnp.float32)

    def _seen(self, observed: Any) -> Any:
        """Return the observations of all agents [A, S], filled up with 0."""
        flat = [jnp.asarray(observed[one.name], jnp.float32).reshape(-1) for one in self.agents]
        return jnp.stack([jnp.pad(one, (0, self._widest - len(one))) for one in flat])


@functools.lru_cache(maxsize=16)
def _task(task: str, options: str, prefixes: str) -> _Task:
    return _Task(task, options, prefixes)


def _of(world: JaxMarlWorld) -> tuple[str, str, str]:
    return world.environment, world.params.options, world.params.team


def begin(world: JaxMarlWorld) -> Function:
    """Return the compiled start of epochs: ``begin(keys [B, 2])``."""
    return _begin(*_of(world))


def step(world: JaxMarlWorld) -> Function:
    """Return a compiled iteration: ``step(keys [B, 2], t, state, actions [B, A, W])``.

    It returns observations [B, A, S], the state, rewards [B, A], ends [B] and places [B, K, 2].
    """
    return _step(*_of(world))


def whole(world: JaxMarlWorld, controller: Srn) -> Function:
    """Return compiled epochs: ``whole(weights, active, keys, given, is_given)``.

    It returns what happened in every iteration: outputs [T, B, R, O], hidden [T, B, R, U], seen
    [T, B, R, S] before it; rewards [T, B, R], ended [T, B] and places [T, B, K, 2] after it.

    Its arguments: weights [B, G, R, U] (``weights_of``), active [B, R, U], keys [B, 2]; actions
    that are given [T, B, A, W], and to which agents [B, A].
    """
    params = world.params
    return _whole(*_of(world), params.constant_input, params.iterations, controller)


@functools.lru_cache(maxsize=16)
def _begin(task: str, options: str, prefixes: str) -> Function:
    return jax.jit(jax.vmap(_task(task, options, prefixes).begin))  # type: ignore[no-any-return]


@functools.lru_cache(maxsize=16)
def _step(task: str, options: str, prefixes: str) -> Function:
    one = _task(task, options, prefixes)

    def stepped(key: Any, t: Any, state: Any, actions: Any) -> Any:
        seen, state, rewards, done = one.step(key, t, state, actions)
        return seen, state, rewards, done, one.places(state)

    return jax.jit(jax.vmap(stepped, (0, None, 0, 0)))  # type: ignore[no-any-return]


@functools.lru_cache(maxsize=16)
def _whole(
    task: str, options: str, prefixes: str, constant: bool, iterations: int, controller: Srn
) -> Function:
    one = _task(task, options, prefixes)
    facts, team = one.facts, one.team
    n_inputs = facts.n_inputs + constant

    def epoch(weights: Any, active: Any, key: Any, given: Any, is_given: Any) -> Any:
        robots, slots = active.shape

        def iteration(carry: Any, now: Any) -> Any:
            seen, state, hidden = carry
            t, actions = now
            own = seen[jnp.array(team), : facts.n_inputs]
            inputs = jnp.pad(own, ((0, 0), (0, int(constant))), constant_values=1)
            hidden, outputs = _think(
                controller, weights, active, hidden, inputs, n_inputs + controller.n_context
            )
            mine = _actions(facts, outputs)
            width = mine.shape[1]
            for i, k in enumerate(team):
                chosen = jnp.where(is_given[k], actions[k, :width], mine[i])
                actions = actions.at[k, :width].set(chosen)
            after, state, rewards, done = one.step(key, t, state, actions)
            happened = {
                "outputs": outputs,
                "hidden": hidden,
                "seen": own,
                "rewards": rewards[jnp.array(team)],
                "ended": done,
                "places": one.places(state),
            }
            return (after, state, hidden), happened

        seen, state = one.begin(key)
        first = seen, state, jnp.zeros((robots, slots), jnp.float32)
        return jax.lax.scan(iteration, first, (jnp.arange(iterations), given))[1]

    return jax.jit(jax.vmap(epoch, (0, 0, 0, 1, 0), 1))  # type: ignore[no-any-return]


def _think(
    controller: Srn, weights: Any, active: Any, hidden: Any, inputs: Any, n_feeds: int
) -> tuple[Any, Any]:
    """Return hidden activations [R, U] and outputs [R, O], in the order of ``Srn.forward``."""
    bias = jnp.float32(controller.bias)
    feeds = [*inputs.T, *hidden.T[: controller.n_context]]
    sums = jnp.full(active.shape, bias)
    for own, feed in zip(weights, feeds, strict=False):
        sums = sums + own * feed[:, None]
    hidden = sigmoid_of(sums) * active
    outputs = jnp.full((len(weights) - n_feeds, len(active)), bias)
    for k in range(active.shape[1]):
        outputs = outputs + weights[n_feeds:, :, k] * hidden[:, k]
    return hidden, outputs.T


def _actions(facts: JaxMarlFacts, outputs: Any) -> Any:
    """Return the actions of robots [R, W], given their outputs [R, O], as ``actions`` does."""
    actions = facts.actions
    if isinstance(actions, Discrete):
        own = np.arange(len(actions.outputs)) < actions.sizes[:, None]
        return jnp.where(own, outputs, -jnp.inf).argmax(axis=1)[:, None].astype(jnp.float32)
    assert isinstance(actions, Continuous)
    low, high = actions.low, actions.high
    chosen = jnp.clip(low + (high - low) * sigmoid_of(outputs), low, high)
    return jnp.where(jnp.isfinite(chosen), chosen, actions.nothing(1)[0])


def weights_of(
    controller: Srn, genes: npt.NDArray[np.float32], teams: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return the weights [B, G, R, U] of teams [B, R, U] and their filled slots, 0 or 1."""
    active = teams >= 0
    weights = np.float32(controller.weight_scale) * genes[teams]
    weights[~active] = 0
    return np.ascontiguousarray(weights.transpose(0, 3, 1, 2)), active.astype(np.float32)


def key_of(keys: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint32]:
    """Return jax' random keys [B, 2] of the keys of scenarios [B]."""
    halves = keys >> np.uint64(32), keys & np.uint64(0xFFFFFFFF)
    return np.stack(halves, axis=1).astype(np.uint32)


def on_cpu() -> Any:
    """Return a context in which jax computes on the CPU."""
    return jax.default_device(jax.devices("cpu")[0])
