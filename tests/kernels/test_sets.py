"""Sets of at most 64 things, against Python's."""

import numpy as np
import pytest
import warp as wp

from conevo.kernels import engine
from conevo.kernels.sets import has, lowest, one, without_lowest

engine.start()


@wp.kernel
def walk(some: wp.array[wp.uint64], members: wp.array[int], found: wp.array[int]):
    all_of_them = wp.uint64(0)
    for k in range(members.shape[0]):
        all_of_them = all_of_them | one(members[k])
    some[0] = all_of_them
    for k in range(64):
        found[k] = int(has(all_of_them, k))
    at = found.shape[0] // 2
    while all_of_them != wp.uint64(0):
        found[at] = lowest(all_of_them)
        all_of_them = without_lowest(all_of_them)
        at += 1


@pytest.mark.parametrize("members", [[], [0], [63], [5, 62, 7, 5], list(range(64))])
def test_a_set_is_walked_from_the_lowest(members):
    word = wp.zeros(1, dtype=wp.uint64)
    found = wp.full(128, -1, dtype=int)
    given = wp.array(np.array(members, dtype=np.int32), dtype=int)
    wp.launch(walk, 1, inputs=[word, given, found], device="cpu")
    ordered = sorted(set(members))
    assert int(word.numpy()[0]) == sum(1 << k for k in ordered)
    assert np.flatnonzero(found.numpy()[:64]).tolist() == ordered
    assert [k for k in found.numpy()[64:].tolist() if k >= 0] == ordered
