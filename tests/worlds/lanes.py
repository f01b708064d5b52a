"""Numbers of lanes that tests of the CUDA form try, on the CPU."""

import pytest

LANES = (32, 64, 96, 128, 256)


def lanes_in(*numbers):
    """Return all numbers as parameters of a test, of which CI tries some.

    Each number of each world is a kernel to compile: CI tries each number in some world.
    """
    rare = pytest.mark.exhaustive
    return [pytest.param(n, marks=[] if n in numbers else [rare]) for n in LANES]
