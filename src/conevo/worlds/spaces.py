"""Inputs and actions of robots, for programs outside: their bounds and names, and three modes.

A world declares what it knows as attributes of its class. Each is optional:

- ``group``: the word for one robot of the team, "predator". By default "robot".
- ``input_bounds``: least and largest value of each input [S]. By default any real number.
- ``output_bounds``: least and largest physical value of each output [O], such as the command of a
  wheel or the length of a step: ``low + (high - low) * sigmoid(output)``. By default (0, 1).
- ``discrete_actions``: outputs [O] of each named action. By default none.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError, unknown_name
from conevo.kernels.outputs import EXTREME
from conevo.worlds.protocol import World

__all__ = [
    "MODES",
    "ActionMode",
    "Bounds",
    "Choices",
    "Mode",
    "discrete_actions_of",
    "group_of",
    "input_bounds_of",
    "n_signed",
    "one_output_each",
    "output_bounds_of",
    "space_faults",
]

Mode = Literal["discrete", "continuous", "outputs"]
MODES: tuple[Mode, ...] = get_args(Mode)
Bounds = tuple[tuple[float, float], ...]
Choices = Mapping[str, Sequence[float]]
Floats = npt.NDArray[np.float32]

COMPASS = {  # steps in the plane, counter-clockwise
    "+x": (1, 0), "+x +y": (1, 1), "+y": (0, 1), "-x +y": (-1, 1),
    "-x": (-1, 0), "-x -y": (-1, -1), "-y": (0, -1), "+x -y": (1, -1),
}  # fmt: skip


def group_of(world: World) -> str:
    """Return the word for a robot of a world's team."""
    return str(getattr(world, "group", "robot"))


def input_bounds_of(world: World) -> Bounds:
    """Return the least and largest value of each input [S]."""
    anything = ((-np.inf, np.inf),) * len(world.inputs)
    return tuple(getattr(world, "input_bounds", anything))


def n_signed(world: World) -> int:
    """Return how many inputs may be below 0; a world has them first."""
    return sum(low < 0 for low, _ in input_bounds_of(world))


def output_bounds_of(world: World) -> Bounds:
    """Return the least and largest physical value of each output [O]."""
    return tuple(getattr(world, "output_bounds", ((0.0, 1.0),) * len(world.outputs)))


def discrete_actions_of(world: World) -> Choices:
    """Return the outputs [O] of each named action."""
    found: Choices = getattr(world, "discrete_actions", {})
    return found


def space_faults(world: World) -> Iterator[str]:
    """Yield the faults of a world's declarations for programs outside."""
    group: Any = getattr(world, "group", "robot")
    if not isinstance(group, str) or not group:
        yield f"group must be a word for a robot, as in 'rover', not {group!r}"
    for what, names in (("input_bounds", world.inputs), ("output_bounds", world.outputs)):
        given: Any = getattr(world, what, ((0.0, 1.0),) * len(names))
        try:
            bounds = np.array(given, float).reshape(-1, 2)
            is_right = len(bounds) == len(names) and bool((bounds[:, 0] < bounds[:, 1]).all())
        except (TypeError, ValueError):
            is_right = False
        if not is_right:
            yield (
                f"{what} must have (low, high) for each of {len(names)} {what.partition('_')[0]}s, "
                f"low below high, not {given!r:.80}"
            )
    choices: Any = getattr(world, "discrete_actions", {})
    if not isinstance(choices, Mapping):
        yield f"discrete_actions must be a dict of names and outputs, not {choices!r:.80}"
        return
    for name, row in choices.items():
        try:
            is_right = np.array(row, float).shape == (len(world.outputs),)
            is_right = is_right and isinstance(name, str) and bool(np.isfinite(row).all())
        except (TypeError, ValueError):
            is_right = False
        if not is_right:
            n = len(world.outputs)
            yield f"discrete_actions[{name!r}] must be {n} finite numbers, not {row!r:.80}"


def one_output_each(outputs: Sequence[str], x: str, y: str) -> dict[str, tuple[float, ...]]:
    """Return the actions of a robot that does what its highest output stands for.

    Each output is an action, except for two that move it together: in their place are eight full
    steps, each component at an extreme or 0.

    Args:
        outputs: names of the outputs.
        x: name of the one that moves it along the first axis.
        y: along the second axis, the next one.
    """
    found = {}
    for k, name in enumerate(outputs):
        if name == x:
            for way, (dx, dy) in COMPASS.items():
                row = dict.fromkeys(outputs, -2.0 * EXTREME) | {x: dx * EXTREME, y: dy * EXTREME}
                found[f"move {way}"] = tuple(row.values())
        elif name != y:
            found[name] = tuple(EXTREME if j == k else 0.0 for j in range(len(outputs)))
    return found


class ActionMode:
    """Turns the actions of one mode into outputs, as ``Stepper.outputs`` takes them.

    - "discrete": an action is the number of a named one, an integer [...].
    - "continuous": an action is a physical value for each output [..., O], within its bounds; one
      beyond them counts as the bound.
    - "outputs": an action is the outputs themselves [..., O], any real numbers. Only this mode
      replays an evolved team bit for bit: a physical value is rounded.

    Args:
        world: the world.
        mode: one of ``MODES``.

    Attributes:
        names: of the actions in the mode "discrete", else of the outputs.
        low, high: [O] float32, bounds of an action in the mode "continuous", else infinite.
        table: [A, O] float32, outputs of each action in the mode "discrete", else without rows.

    Raises:
        UsageError: an unknown mode, or a world without discrete actions.
    """

    def __init__(self, world: World, mode: Mode = "discrete") -> None:
        if mode not in MODES:
            raise unknown_name("mode of actions", str(mode), MODES)
        self.world, self.mode = world, mode
        n_outputs = len(world.outputs)
        named = discrete_actions_of(world) if mode == "discrete" else {}
        if mode == "discrete" and not named:
            raise UsageError(
                f"{world.name} declares no discrete actions: use the mode 'continuous' or 'outputs'"
            )
        self.names = tuple(named) or world.outputs
        self.table = np.array([*named.values()], np.float32).reshape(-1, n_outputs)
        anything = ((-np.inf, np.inf),) * n_outputs
        bounds = output_bounds_of(world) if mode == "continuous" else anything
        self._bounds = np.array(bounds, np.float64)
        self.low, self.high = (self._bounds[:, k].astype(np.float32) for k in range(2))

    def outputs(self, actions: Any) -> Floats:
        """Return the outputs [..., O] of actions.

        Raises:
            UsageError: numbers of actions that do not exist, or values of another shape.
        """
        given = np.asarray(actions)
        if self.mode == "discrete":
            return self._of_numbers(given)
        n_outputs = len(self.world.outputs)
        if given.shape[-1:] != (n_outputs,):
            raise UsageError(
                f"an action in {self.world.name} has {n_outputs} values, one for each output; got "
                f"shape {list(given.shape)}"
            )
        if self.mode == "outputs":
            return given.astype(np.float32)
        low, high = self._bounds[:, 0], self._bounds[:, 1]
        share = (given.astype(np.float64) - low) / (high - low)
        with np.errstate(divide="ignore"):
            logits = np.log(np.clip(share, 0.0, 1.0)) - np.log1p(-np.clip(share, 0.0, 1.0))
        return np.clip(logits, -EXTREME, EXTREME).astype(np.float32)

    def _of_numbers(self, given: npt.NDArray[Any]) -> Floats:
        n = len(self.names)
        if given.dtype.kind not in "iu":
            raise UsageError(f"an action must be an integer from 0 to {n - 1}, not {given.dtype}")
        try:
            if given.size and given.min() < 0:
                raise IndexError
            found: Floats = self.table.take(given, axis=0)
        except IndexError:
            bad = given[(given < 0) | (given >= n)].flat[0]
            raise UsageError(
                f"action {bad}: must be from 0 to {n - 1} ({', '.join(self.names)})"
            ) from None
        return found
