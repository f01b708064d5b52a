"""A kernel's parameters are filled by name from those of the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import warp as wp

import conevo
from conevo.worlds.protocol import kernel_params


@wp.struct
class Params:
    wait: int
    step: float
    step_2: float
    ranges: wp.vec2f
    is_open: int
    n_robots: int


@dataclass(frozen=True)
class WorldParams:
    wait: int = 3
    step: float = 0.1
    is_open: bool = True
    mode: str = "fast"

    @property
    def ranges(self) -> tuple[float, float]:
        return self.step, 2 * self.step


@dataclass(frozen=True)
class AWorld:
    n_robots: int = 7
    step: float = 5.0  # the parameters come first


def test_fields_are_those_of_the_parameters_then_of_the_world_then_squares() -> None:
    p = kernel_params(Params, WorldParams(), AWorld())
    assert (p.wait, p.n_robots, int(p.is_open)) == (3, 7, 1)
    assert (p.step, p.step_2) == (0.1, 0.1**2)
    np.testing.assert_array_equal(np.array(p.ranges), np.float32([0.1, 0.2]))
    assert kernel_params(Params, WorldParams(), n_robots=9, step_2=0.5).step_2 == 0.5


def test_a_kernel_gets_these_values() -> None:
    out = wp.zeros(6, dtype=float, device="cpu")
    wp.launch(copy, 1, [kernel_params(Params, WorldParams(), AWorld()), out], device="cpu")
    expected = np.float32([3, 0.1, 0.1**2, 0.2, 1, 7])
    np.testing.assert_array_equal(out.numpy(), expected)


@wp.kernel
def copy(p: Params, out: wp.array[float]) -> None:
    out[0] = float(p.wait)
    out[1] = p.step
    out[2] = p.step_2
    out[3] = p.ranges[1]
    out[4] = float(p.is_open)
    out[5] = float(p.n_robots)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "Params.n_robots: WorldParams has no field or property of this name"),
        ({"n_robots": "two"}, "Params.n_robots: 'str' object cannot be"),
        ({"n_robot": 2}, "unknown field 'n_robot' of Params; did you mean 'n_robots'?"),
    ],
)
def test_a_parameter_without_a_source_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(conevo.UsageError) as caught:
        kernel_params(Params, WorldParams(), **given)
    assert words in str(caught.value)
