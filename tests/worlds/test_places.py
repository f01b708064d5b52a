"""Random places of many scenarios at once, against one place after another in plain Python."""

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.worlds.places import draw_places
from oracles import splitmix

KEYS = np.array([3, 2**40, 5, 77, 2**63 + 1, 6], np.uint64)


def one_after_another(key, n, separation, is_free, is_there):
    """Return places [n, 2] of one key, and how many candidates were refused for each reason."""
    places, refused = np.zeros((n, 2), np.float32), [0, 0]
    for k in range(n):
        attempt = 0
        while is_there[k]:
            place = np.array([splitmix.uniform(int(key), attempt, k, b) for b in (0, 1)])
            place = place.astype(np.float32)
            others = places[:k][is_there[:k]]
            is_close = (((place - others) ** 2).sum(axis=1) < separation**2).any()
            refused[0] += not is_free(k, *place)
            refused[1] += bool(is_close)
            if is_free(k, *place) and not is_close:
                places[k] = place
                break
            attempt += 1
    return places, refused


@pytest.mark.parametrize("separation", [0.0, 0.002, 0.12, 0.2])
@pytest.mark.parametrize("half", [False, True], ids=["everywhere", "in half of the square"])
@pytest.mark.parametrize("some", [False, True], ids=["all", "some"])
def test_places_are_the_first_that_fit(separation, half, some):
    n = 9
    is_there = np.ones((len(KEYS), n), np.bool_)
    if some:
        is_there = np.random.default_rng(2).random(is_there.shape) < 0.7

    def is_free(e, k, xy):
        """Left of a border that every scenario and place has for itself."""
        return xy[:, :, 0] < 0.5 + 0.01 * e[:, None] - 0.02 * k[:, None]

    found = draw_places(KEYS, n, separation, is_free if half else None, is_there if some else None)
    assert found.dtype == np.float32
    total = np.zeros(2, int)
    for e, key in enumerate(KEYS):
        borders = [0.5 + 0.01 * e - 0.02 * k for k in range(n)]
        expected, refused = one_after_another(
            key, n, separation, lambda k, x, y, b=borders: not half or x < b[k], is_there[e]
        )
        assert found[e].tolist() == expected.tolist(), e
        total += refused
    assert (total[0] > 20) == half
    assert (total[1] > 0) == (separation > 0.1)  # the case is one in which something is refused


def test_what_has_no_room_is_refused_in_one_line():
    with pytest.raises(UsageError, match=r"the square has no room for 40 places, 0\.3 apart"):
        draw_places(KEYS, 40, 0.3)
    with pytest.raises(UsageError, match="no room for 2 places"):
        draw_places(KEYS, 2, 0.0, lambda e, k, xy: np.zeros(xy.shape[:2], np.bool_))


def test_nobody_needs_no_room():
    assert draw_places(KEYS, 0, 0.1).shape == (6, 0, 2)
    assert draw_places(KEYS[:0], 3, 0.1).shape == (0, 3, 2)
    assert not draw_places(KEYS, 3, 2.0, is_there=np.zeros((6, 3), np.bool_)).any()
