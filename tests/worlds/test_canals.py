"""The ten canal layouts have the properties documented in conevo.worlds.rover.canals."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from conevo.errors import UsageError
from conevo.worlds.rover.canals import CELL, N_LAYOUTS, generate, load, sites

ENVIRONMENTS = range(1, N_LAYOUTS + 1)
every_layout = pytest.mark.parametrize("environment", ENVIRONMENTS)


def components(cells: np.ndarray) -> list[int]:
    """Sizes of the 4-connected components, largest first; a plain flood fill."""
    todo = {(int(r), int(c)) for r, c in np.argwhere(cells)}
    sizes = []
    while todo:
        stack, size = [todo.pop()], 0
        while stack:
            r, c = stack.pop()
            size += 1
            for neighbour in ((r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1)):
                if neighbour in todo:
                    todo.remove(neighbour)
                    stack.append(neighbour)
        sizes.append(size)
    return sorted(sizes, reverse=True)


@every_layout
def test_the_shipped_layout_is_the_generators(environment: int) -> None:
    shipped = load(environment)
    assert shipped.dtype == np.bool_
    assert shipped.shape == (200, 200)
    np.testing.assert_array_equal(shipped, generate(environment))


@every_layout
def test_every_rock_has_a_site(environment: int) -> None:
    assert 5000 <= load(environment).sum() <= 6000


@every_layout
def test_the_shortest_range_reaches_every_rock_from_a_free_cell(environment: int) -> None:
    mask = load(environment)
    for row, column in np.argwhere(mask):
        window = mask[row - 5 : row + 6, column - 5 : column + 6]  # the margin is wider than 5
        distance = np.hypot(*(np.argwhere(~window) - 5).T).min() * CELL
        assert distance <= 0.02 + CELL / 2 < 0.03


@every_layout
def test_every_canal_is_too_wide_to_jump(environment: int) -> None:
    mask = load(environment)
    thick = np.zeros_like(mask)
    for r, c in np.argwhere(sliding_window_view(mask, (4, 4)).all(axis=(2, 3))):
        thick[r : r + 4, c : c + 4] = True
    np.testing.assert_array_equal(thick, mask)


@every_layout
def test_no_rover_is_walled_in(environment: int) -> None:
    mask = load(environment)
    assert len(components(~mask)) == 1
    margin = np.ones_like(mask)
    margin[8:-8, 8:-8] = False
    assert not np.any(mask & margin)


@every_layout
def test_rovers_can_walk_between_the_pieces(environment: int) -> None:
    """Free space stays connected for a walker two cells wide."""
    free = ~load(environment)
    roomy = free[:-1, :-1] & free[1:, :-1] & free[:-1, 1:] & free[1:, 1:]
    large, *pockets = components(roomy)
    assert sum(pockets) < 0.001 * large


def test_structure_falls_from_1_to_10() -> None:
    pieces = [components(load(environment)) for environment in ENVIRONMENTS]
    count = [len(sizes) for sizes in pieces]
    largest = [sizes[0] / sum(sizes) for sizes in pieces]
    assert count[0] == 1
    assert count[-1] >= 40
    assert all(a < b for a, b in pairwise(count))
    assert all(a > b for a, b in pairwise(largest))
    assert largest[-1] < 0.05


def test_layouts_differ() -> None:
    masks = [load(environment) for environment in ENVIRONMENTS]
    for i, a in enumerate(masks):
        for b in masks[:i]:
            assert (a & b).sum() < 0.5 * a.sum()


@pytest.mark.parametrize("environment", [0, 11, -1])
def test_an_unknown_layout_is_a_usage_error(environment: int) -> None:
    with pytest.raises(UsageError, match="canal layout"):
        load(environment)


def test_sites_are_cell_centres_in_row_major_order() -> None:
    mask = np.zeros((200, 200), np.bool_)
    mask[0, 1] = mask[0, 199] = mask[3, 0] = True
    expected = np.array([[0.0075, 0.0025], [0.9975, 0.0025], [0.0025, 0.0175]], np.float32)
    got = sites(mask)
    assert got.dtype == np.float32
    np.testing.assert_array_equal(got, expected)


@every_layout
def test_a_site_lies_in_its_own_cell(environment: int) -> None:
    mask = load(environment)
    xy = sites(mask)
    again = np.zeros_like(mask)
    again[np.floor(xy[:, 1] / CELL).astype(int), np.floor(xy[:, 0] / CELL).astype(int)] = True
    np.testing.assert_array_equal(again, mask)
