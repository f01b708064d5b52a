"""Random places of many scenarios at once, against one place after another in plain Python."""

import numpy as np
import pytest

from conevo.errors import UsageError
from conevo.worlds.places import draw_places, sectors
from oracles import splitmix

KEYS = np.array([3, 2**40, 5, 77, 2**63 + 1, 6], np.uint64)


def one_after_another(key, n, separation, is_free, is_there):
    """Return places [n, 2] of one key, and the number of refused candidates for each reason."""
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
        """Left of a border, which differs for every scenario and place."""
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
    assert (total[1] > 0) == (separation > 0.1)  # some places are refused in this case


def test_places_without_room_are_refused_in_one_line():
    with pytest.raises(UsageError, match=r"the square has no room for 40 places, 0\.3 apart"):
        draw_places(KEYS, 40, 0.3)
    with pytest.raises(UsageError, match="no room for 2 places"):
        draw_places(KEYS, 2, 0.0, lambda e, k, xy: np.zeros(xy.shape[:2], np.bool_))


def test_no_places_need_no_room():
    assert draw_places(KEYS, 0, 0.1).shape == (6, 0, 2)
    assert draw_places(KEYS[:0], 3, 0.1).shape == (0, 3, 2)
    assert not draw_places(KEYS, 3, 2.0, is_there=np.zeros((6, 3), np.bool_)).any()


@pytest.mark.parametrize(
    ("x", "y", "sectors_of_3", "sectors_of_4"),
    [
        # around the square once, from the lower left corner, in eighths
        (0.1, 0.1, 0, 0),  # 0
        (0.5, 0.1, 0, 0),  # 1
        (0.9, 0.1, 0, 1),  # 2
        (0.9, 0.3, 0, 1),  # 2.5; a third of the round is 2 2/3
        (0.9, 0.4, 1, 1),  # 2.75
        (0.9, 0.9, 1, 2),  # 4
        (0.6, 0.6, 1, 2),  # 4, on a smaller square
        (0.45, 0.9, 1, 2),  # 5.125; two thirds of the round are 5 1/3
        (0.3, 0.9, 2, 2),  # 5.5
        (0.1, 0.9, 2, 3),  # 6
        (0.1, 0.11, 2, 3),  # 7.975
    ],
)
def test_sectors_go_around_the_middle(x, y, sectors_of_3, sectors_of_4):
    xy = np.array([[x, y], [x, y]], np.float32)
    # A little further, away from the lines between sectors.
    xy[0] += np.float32(1e-6) * np.sign([0.5 - y, x - 0.5])
    assert sectors(xy, 3)[0] == sectors_of_3
    assert sectors(xy, 4)[0] == sectors_of_4


@pytest.mark.parametrize("n", range(1, 8))
def test_sectors_have_the_same_area_in_any_frame(n):
    line = (np.arange(420, dtype=np.float32) + np.float32(0.5)) / np.float32(420)
    xy = np.stack(np.meshgrid(line, line), axis=-1)
    found = sectors(xy, n)
    is_outside = (np.abs(xy - 0.5) > 0.35).any(axis=-1)
    for some in (found.ravel(), found[is_outside]):
        counts = np.bincount(some, minlength=n)
        assert len(counts) == n
        assert counts == pytest.approx(np.full(n, counts.mean()), rel=0.02)
