"""Sine, cosine and arc tangent of kernels against float64, and bit for bit against numpy's twin."""

import math

import numpy as np
import pytest
import warp as wp

from conevo.kernels import engine
from conevo.kernels.trigonometry import (
    arc_tangent,
    arc_tangent_of,
    cosine_sine,
    cosine_sine_of,
)

engine.start()


@wp.kernel(module="unique", module_options=engine.options)
def turn(angle: wp.array[float], ahead: wp.array[wp.vec2f]):
    k = wp.tid()
    ahead[k] = cosine_sine(angle[k])


@wp.kernel(module="unique", module_options=engine.options)
def aim(y: wp.array[float], x: wp.array[float], angle: wp.array[float]):
    k = wp.tid()
    angle[k] = arc_tangent(y[k], x[k])


def turned(angles):
    ahead = wp.zeros(len(angles), dtype=wp.vec2f, device="cpu")
    wp.launch(turn, len(angles), [wp.array(angles, dtype=float, device="cpu"), ahead], device="cpu")
    return ahead.numpy()


def aimed(y, x):
    angle = wp.zeros(len(y), dtype=float, device="cpu")
    given = [wp.array(v, dtype=float, device="cpu") for v in (y, x)]
    wp.launch(aim, len(y), [*given, angle], device="cpu")
    return angle.numpy()


def around(values, n=3):
    """Return float32 values and their nearest neighbours."""
    found = [np.asarray(values, np.float32)]
    for _ in range(n):
        found += [np.nextafter(found[-1], np.float32(9e9))]
        found += [np.nextafter(found[0], np.float32(-9e9))]
    return np.concatenate(found)


# Headings and directions of steps lie within two turns, including the ends of a step's arc.
USED = np.concatenate(
    [np.linspace(-4 * math.pi, 4 * math.pi, 400_001), np.geomspace(1e-30, 1, 1000)]
).astype(np.float32)
FAR = np.linspace(-200 * math.pi, 200 * math.pi, 400_001).astype(np.float32)
EDGES = around(np.arange(-64, 65) * math.pi / 8)  # where quarters and signs change


@pytest.mark.parametrize("angles", [USED, FAR, EDGES], ids=["used", "far", "edges"])
def test_cosine_and_sine_are_right_to_1e_7(angles):
    exact = angles.astype(np.float64)
    error = turned(angles) - np.stack([np.cos(exact), np.sin(exact)], axis=1)
    assert np.abs(error).max() < 1e-7


def test_the_sine_of_a_small_angle_keeps_its_last_places():
    small = np.geomspace(1e-30, math.pi / 4, 100_001).astype(np.float32)
    sine = turned(np.concatenate([small, -small]))[:, 1]
    exact = np.sin(small.astype(np.float64))
    assert np.abs(sine[: len(small)] / exact - 1).max() < 1.2e-7  # a unit in the last place
    assert (sine[len(small) :] == -sine[: len(small)]).all()


def pairs():
    """Vectors in all directions and of many lengths, on axes and diagonals, and next to them."""
    rng = np.random.default_rng(1)
    directions = rng.uniform(-math.pi, math.pi, 200_000)
    lengths = 10.0 ** rng.uniform(-12, 12, len(directions))
    y, x = lengths * np.sin(directions), lengths * np.cos(directions)
    edge = around([0.0, 1.0, -1.0, math.tan(math.pi / 8), -math.tan(math.pi / 8), 5e-30])
    ys, xs = (v.ravel() for v in np.meshgrid(edge, edge))
    return np.concatenate([y, ys]).astype(np.float32), np.concatenate([x, xs]).astype(np.float32)


def test_the_arc_tangent_is_right_to_3e_7():
    y, x = pairs()
    exact = np.arctan2(*(v.astype(np.float64) + 0.0 for v in (y, x)))  # -0 counts as 0
    assert np.abs(aimed(y, x) - exact).max() < 3e-7


def test_axes_have_the_right_angles():
    y = np.array([0, 0, 1, -1, 0, 1e-20, -1e-20], np.float32)
    x = np.array([0, 3, 0, 0, -2, -1, -1], np.float32)
    pi = math.pi
    expected = np.array([0, 0, pi / 2, -pi / 2, pi, pi, -pi], np.float32)
    assert aimed(y, x).tolist() == expected.tolist()


def test_numpy_agrees_bit_for_bit():
    for angles in (USED, FAR, EDGES):
        both = np.stack(cosine_sine_of(angles), axis=1)
        assert both.dtype == np.float32
        assert both.tobytes() == turned(angles).tobytes()
    y, x = pairs()
    assert arc_tangent_of(y, x).tobytes() == aimed(y, x).tobytes()
