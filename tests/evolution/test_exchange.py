"""How populations begin and exchange genes: each option against a small case worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from conevo.evolution import Layout, method

LAYOUT = Layout(n_robots=3, n_hidden=2, max_hidden=3, n_genes=4)


@pytest.mark.parametrize("name", ["ccga", "mesp", "cone", "cone-1", "cone-2", "cone-3"])
def test_populations_may_begin_as_copies_of_the_first(name: str) -> None:
    apart = method(name, genotypes=4).init(LAYOUT, root=5)
    alike = method(name, genotypes=4, common_start=True).init(LAYOUT, root=5)
    assert alike.genes.shape == apart.genes.shape
    for population in alike.genes:
        np.testing.assert_array_equal(population, apart.genes[0])
    assert len(np.unique(apart.genes[:, 0, 0, 0])) == 3
    assert len(np.unique(alike.genes[:, :2])) == 2 * 4 * 4  # slots, genotypes and genes differ
    np.testing.assert_array_equal(alike.active, apart.active)
