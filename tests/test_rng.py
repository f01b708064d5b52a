"""Addressed randomness of many keys at once."""

import math

import numpy as np

from conevo.rng import fold_all, numbers, uniforms
from oracles import splitmix

KEYS = np.array([0, 1, 2, 3, 2**63, 2**64 - 1], np.uint64)


def test_a_number_depends_on_its_key_and_place_alone():
    t, a, b = np.arange(4)[:, None], np.arange(5)[None], 7
    whole = numbers(KEYS[:, None, None], t, a, b)
    assert whole.shape == (6, 4, 5)
    assert len(np.unique(whole)) == whole.size
    for e, key in enumerate(KEYS):
        assert numbers(KEYS[e : e + 1], 3, 2, 7)[0] == whole[e, 3, 2]
        expected = splitmix.uniform(int(key), 3, 2, 7)
        assert uniforms(KEYS, 3, 2, 7)[e] == expected == (int(whole[e, 3, 2]) >> 40) / 2**24


def test_places_below_a_key_have_their_own_keys():
    keys = np.arange(1000, dtype=np.uint64)
    paths = [(), ("a",), ("b",), ("a", "b"), ("a", 1), ("a", "1")]
    found = np.stack([fold_all(keys, *path) for path in paths])
    assert len(np.unique(found)) == found.size
    assert found[0, 5] == fold_all(keys[5:6])[0]
    assert (keys == np.arange(1000)).all()  # arrays are not changed in place


def test_numbers_are_uniform_along_keys_places_and_bits():
    keys = fold_all(np.arange(300, dtype=np.uint64), "test")
    drawn = numbers(keys[:, None], 0, np.arange(300), 1)
    ones = np.unpackbits(drawn.view(np.uint8)).reshape(-1, 64).mean(axis=0)
    assert np.abs(ones - 0.5).max() < 5 * 0.5 / 300
    u = uniforms(keys[:, None], 0, np.arange(300), 1).astype(float)
    assert u.min() >= 0
    assert u.max() < 1
    counts = np.histogram(u, bins=100, range=(0, 1))[0]
    chi2 = ((counts - 900) ** 2 / 900).sum()
    assert 99 - 5 * math.sqrt(198) < chi2 < 99 + 5 * math.sqrt(198)
    for one, other in ((u[:-1], u[1:]), (u[:, :-1], u[:, 1:])):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 5 / 300
