"""Shares of actions."""

import numpy as np

from conevo.specialization import shares


def test_shares_of_executed_actions():
    counts = np.array([[1, 0, 3, 0], [0, 0, 0, 0], [5, 5, 5, 5]])
    expected = [[0.25, 0, 0.75, 0], [0, 0, 0, 0], [0.25, 0.25, 0.25, 0.25]]
    assert shares(counts).tolist() == expected
    assert shares(counts[None])[0].tolist() == expected
    assert counts.dtype.kind == "i"
