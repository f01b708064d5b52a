"""Random numbers of VMAS that have an address, in place of the next ones of a shared state.

VMAS draws for all environments of a batch at once from one random state. So the scenario of one
environment would depend on the size of the batch, and on the random events of the others. Here a
number depends on the key of its scenario and on its place alone: iteration, request, element.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from vmas.simulator.utils import ScenarioUtils

from conevo.errors import ConevoError, UsageError
from conevo.rng import fold_all, numbers, uniforms

__all__ = ["Draws", "SharedDraw"]

OTHERS = {  # of torch: not answered
    torch: ("multinomial", "normal", "poisson"),
    torch.Tensor: (
        *("cauchy_", "exponential_", "geometric_", "log_normal_", "multinomial", "random_"),
    ),
}


class SharedDraw(ConevoError):
    """A task draws a number that is common to all environments of its batch."""


class Draws:
    """Answers the requests of a task for random numbers.

    A request for B numbers, or B rows, is for one in each environment. Another one is for all of
    them together, which is possible if they play the same scenario.

    Args:
        keys: of the scenario of each environment [B].
    """

    def __init__(self, keys: npt.NDArray[np.uint64]) -> None:
        self._keys, row = np.unique(keys, return_inverse=True)
        self._row, self._n = torch.from_numpy(row.astype(np.int64)), len(keys)
        self._place = [0, 0, 0]  # iteration, search, request
        self._searches = 0

    @contextmanager
    def at(self, t: int) -> Iterator[None]:
        """Answer the requests of iteration t; 0 is the start.

        Choice: torch's functions are replaced for this time. A mode of torch, which sees all calls,
        adds a third to half to the time of a step.
        """
        self._place, self._searches = [t, 0, 0], 0
        with ExitStack() as replaced:
            for owner, answers in ANSWERS.items():
                for name, answer in answers.items():
                    replaced.enter_context(_replaced(owner, name, self, answer))
            for owner, names in OTHERS.items():
                for name in names:
                    replaced.enter_context(_replaced(owner, name, self, _refuse))
            replaced.enter_context(_replaced(ScenarioUtils, SEARCH, self, _search))
            yield

    @contextmanager
    def searching(self) -> Iterator[None]:
        """Count requests from 0 again.

        VMAS searches for a free place in a loop that ends when all environments have found one. So
        its length must not affect later requests.
        """
        before, self._searches = self._place, self._searches + 1
        self._place = [before[0], self._searches, 0]
        try:
            yield
        finally:
            self._place = before

    def _bits(self, shape: torch.Size, draw: Callable[..., Any]) -> torch.Tensor:
        """Return what ``draw(keys, t, a, b)`` gives for each environment, or for all together."""
        keys = fold_all(self._keys.copy(), "draw", *self._place)
        self._place[2] += 1
        is_own = len(shape) > 0 and shape[0] == self._n
        if not is_own and len(self._keys) > 1:
            raise SharedDraw("the task draws numbers that all environments share")
        size = math.prod(shape[1:] if is_own else shape)
        drawn = torch.from_numpy(draw(keys[:, None], 0, 0, np.arange(size)))
        return (drawn[self._row] if is_own else drawn[0]).reshape(shape)

    def uniform(self, shape: torch.Size) -> torch.Tensor:
        """Return numbers in [0, 1)."""
        return self._bits(shape, uniforms)

    def normal(self, shape: torch.Size) -> torch.Tensor:
        """Return normal numbers (Box and Muller 1958)."""
        radius, angle = (self._bits(shape, _doubles) for _ in range(2))
        numbers = torch.sqrt(-2 * torch.log1p(-radius)) * torch.cos(2 * math.pi * angle)
        return numbers.to(torch.float32)

    def whole(self, shape: torch.Size, low: int, high: int) -> torch.Tensor:
        """Return whole numbers from low to high - 1."""
        return low + (self._bits(shape, _doubles) * (high - low)).to(torch.int64)


@contextmanager
def _replaced(owner: Any, name: str, draws: Draws, answer: Callable[..., Any]) -> Iterator[None]:
    """Replace a function by an answer, which gets the function and its arguments."""
    own, is_own = getattr(owner, name), name in vars(owner)

    def answered(*args: Any, **named: Any) -> Any:
        return answer(draws, own, args, named)

    setattr(owner, name, staticmethod(answered) if owner is ScenarioUtils else answered)
    try:
        yield
    finally:
        if is_own:
            setattr(owner, name, staticmethod(own) if owner is ScenarioUtils else own)
        else:
            delattr(owner, name)  # torch.Tensor inherits it


def _search(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> Any:
    with draws.searching():
        return func(*args, **named)


def _refuse(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    raise UsageError(f"a VMAS scenario that calls torch's {func.__name__} cannot be played")


def _doubles(keys: Any, t: int, a: int, b: Any) -> npt.NDArray[np.float64]:
    """Return numbers in [0, 1) of 53 bits."""
    bits = numbers(keys, t, a, b) >> np.uint64(11)
    result: npt.NDArray[np.float64] = bits.astype(np.float64) * 2.0**-53
    return result


def _empty(func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    """Return a tensor without data that has the shape and type of a result."""
    found: torch.Tensor = func(*args, **{**named, "device": "meta", "generator": None})
    return found


def _uniform_(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    x, low, high = _values(args, named, ("from", 0.0), ("to", 1.0))
    found: torch.Tensor = x.copy_(low + (high - low) * draws.uniform(x.shape))
    return found


def _normal_(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    x, mean, std = _values(args, named, ("mean", 0.0), ("std", 1.0))
    found: torch.Tensor = x.copy_(mean + std * draws.normal(x.shape))
    return found


def _bernoulli_(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    x, p = _values(args, named, ("p", 0.5))
    found: torch.Tensor = x.copy_(draws.uniform(x.shape) < p)
    return found


def _bernoulli(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    (p,) = args
    return (draws.uniform(p.shape) < p).to(p.dtype)


def _rand(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    empty = _empty(func, args, named)
    return draws.uniform(empty.shape).to(empty.dtype)


def _randn(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    empty = _empty(func, args, named)
    return draws.normal(empty.shape).to(empty.dtype)


def _randint(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    empty = _empty(func, args, named)
    ends = [one for one in args if isinstance(one, int)]
    high = named["high"] if "high" in named else ends.pop()
    low = named["low"] if "low" in named else (ends or [0])[0]
    return draws.whole(empty.shape, low, high).to(empty.dtype)


def _randperm(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    return torch.argsort(draws.uniform(torch.Size((args[0],))))


def _like(draws: Draws, func: Any, args: Any, named: dict[str, Any]) -> torch.Tensor:
    (x,) = args
    is_normal = func.__name__ == "randn_like"
    drawn = draws.normal(x.shape) if is_normal else draws.uniform(x.shape)
    return drawn.to(x.dtype)


def _values(args: Any, named: dict[str, Any], *wanted: tuple[str, Any]) -> list[Any]:
    """Return a tensor and the values of arguments that are given by place, name or default."""
    x, *given = args
    rest = [named.get(name, default) for name, default in wanted[len(given) :]]
    return [x, *given, *rest]


SEARCH = "find_random_pos_for_entity"
ANSWERS: dict[Any, dict[str, Callable[..., torch.Tensor]]] = {
    torch: {
        "bernoulli": _bernoulli,
        "rand": _rand,
        "rand_like": _like,
        "randint": _randint,
        "randn": _randn,
        "randn_like": _like,
        "randperm": _randperm,
    },
    torch.Tensor: {"bernoulli_": _bernoulli_, "normal_": _normal_, "uniform_": _uniform_},
}
