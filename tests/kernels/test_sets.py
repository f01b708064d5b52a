"""Sets as the bits of a word, against Python's own."""

import numpy as np
import pytest
import warp as wp

from conevo.kernels import engine
from conevo.kernels.sets import (
    all_below,
    all_of,
    has,
    lowest,
    one,
    part_of,
    parts,
    without_lowest,
)

engine.start()
wp.set_module_options(engine.options)  # without adjoints, as in the worlds


@wp.kernel
def walk(
    some: wp.uint64,
    numbers: wp.array[int],
    inside: wp.array[int],
    joined: wp.array[wp.uint64],
):
    rest = some
    n = wp.int32(0)
    while rest != wp.uint64(0):
        numbers[n] = lowest(rest)
        joined[0] = joined[0] | one(lowest(rest))
        rest = without_lowest(rest)
        n += 1
    for k in range(64):
        inside[k] = int(has(some, k))
    for q in range(parts(64)):
        joined[1] = joined[1] | part_of(some, q)


@wp.kernel
def count_up(first: wp.array[wp.uint64], below: wp.array[wp.uint64]):
    for n in range(64):
        first[n] = all_of(n + 1)
        below[n] = all_below(n)


@pytest.mark.parametrize("members", [[], [0], [63], [0, 63], [5, 6, 31, 32, 40], range(64)])
def test_a_set_is_walked_from_its_lowest_number_on(members):
    some = sum(1 << k for k in members)
    numbers = wp.full(64, -1, dtype=int, device="cpu")
    inside = wp.zeros(64, dtype=int, device="cpu")
    joined = wp.zeros(2, dtype=wp.uint64, device="cpu")
    wp.launch(walk, dim=1, inputs=[wp.uint64(some), numbers, inside, joined], device="cpu")
    assert numbers.numpy().tolist() == [*members, *[-1] * (64 - len(members))]
    assert np.flatnonzero(inside.numpy()).tolist() == list(members)
    assert joined.numpy().tolist() == [some, some]


def test_the_sets_of_the_first_things():
    first, below = (wp.zeros(64, dtype=wp.uint64, device="cpu") for _ in range(2))
    wp.launch(count_up, dim=1, inputs=[first, below], device="cpu")
    assert first.numpy().tolist() == [(1 << n) - 1 for n in range(1, 65)]
    assert below.numpy().tolist() == [(1 << n) - 1 for n in range(64)]
