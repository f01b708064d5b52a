"""Sine, cosine and arc tangent from + - * / alone: equal bit for bit on every target.

Libraries round them differently, so those of two targets differ in the last place. These are the
polynomials and the three-part pi / 2 of S. L. Moshier, Cephes mathematical library, single
precision (``sinf.c``, ``atanf.c``). They are here twice, with the same operations in float32: for
kernels and for numpy.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp

__all__ = ["arc_tangent", "arc_tangent_of", "cosine_sine", "cosine_sine_of"]

QUARTERS = wp.constant(2.0 / math.pi)  # quarter turns in a radian
# pi / 2 as a sum whose first parts have so few bits that their small multiples are exact
QUARTER_1 = wp.constant(1.5703125)
QUARTER_2 = wp.constant(4.837512969970703125e-4)
QUARTER_3 = wp.constant(7.54978995489188216e-8)
S3 = wp.constant(-1.6666654611e-1)
S5 = wp.constant(8.3321608736e-3)
S7 = wp.constant(-1.9515295891e-4)
C4 = wp.constant(4.166664568298827e-2)
C6 = wp.constant(-1.388731625493765e-3)
C8 = wp.constant(2.443315711809948e-5)
T3 = wp.constant(-3.33329491539e-1)
T5 = wp.constant(1.99777106478e-1)
T7 = wp.constant(-1.38776856032e-1)
T9 = wp.constant(8.05374449538e-2)
EIGHTH = wp.constant(math.pi / 4.0)
QUARTER = wp.constant(math.pi / 2.0)
HALF = wp.constant(math.pi)
TAN_SIXTEENTH = wp.constant(math.tan(math.pi / 8.0))


@wp.func
def cosine_sine(angle: float) -> wp.vec2f:
    """Return cosine and sine of an angle, in rad; errors below 1e-7 up to 100 turns."""
    turns = int(angle * QUARTERS + wp.where(angle < 0.0, -0.5, 0.5))
    k = float(turns)
    r = ((angle - k * QUARTER_1) - k * QUARTER_2) - k * QUARTER_3  # in [-pi / 4, pi / 4]
    q = r * r
    s = ((S7 * q + S5) * q + S3) * q * r + r
    c = ((C8 * q + C6) * q + C4) * q * q - 0.5 * q + 1.0
    quarter = turns & 3
    is_odd = (quarter & 1) != 0
    x = wp.where(is_odd, s, c)
    y = wp.where(is_odd, c, s)
    return wp.vec2f(wp.where(quarter == 1 or quarter == 2, -x, x), wp.where(quarter >= 2, -y, y))


def cosine_sine_of(
    angle: npt.NDArray[np.float32],
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return ``cosine_sine`` of every element, bit for bit: all cosines, all sines."""
    f: Any = np.float32
    turns = (angle * f(QUARTERS) + np.where(angle < 0, f(-0.5), f(0.5))).astype(np.int32)
    k = turns.astype(np.float32)
    r = ((angle - k * f(QUARTER_1)) - k * f(QUARTER_2)) - k * f(QUARTER_3)
    q = r * r
    s = ((f(S7) * q + f(S5)) * q + f(S3)) * q * r + r
    c = ((f(C8) * q + f(C6)) * q + f(C4)) * q * q - f(0.5) * q + f(1)
    quarter = turns & 3
    is_odd = (quarter & 1) != 0
    x, y = np.where(is_odd, s, c), np.where(is_odd, c, s)
    return np.where((quarter == 1) | (quarter == 2), -x, x), np.where(quarter >= 2, -y, y)


@wp.func
def arc_tangent(y: float, x: float) -> float:
    """Return the angle in [-pi, pi] of the vector (x, y), error below 3e-7; 0 for a zero vector."""
    a = wp.abs(x)
    b = wp.abs(y)
    large = wp.max(a, b)
    if large == 0.0:
        return 0.0
    v = wp.min(a, b) / large
    base = float(0.0)
    if v > TAN_SIXTEENTH:
        base = EIGHTH
        v = (v - 1.0) / (v + 1.0)
    q = v * v
    angle = base + ((((T9 * q + T7) * q + T5) * q + T3) * q * v + v)
    if b > a:
        angle = QUARTER - angle
    if x < 0.0:
        angle = HALF - angle
    return wp.where(y < 0.0, -angle, angle)


def arc_tangent_of(
    y: npt.NDArray[np.float32], x: npt.NDArray[np.float32]
) -> npt.NDArray[np.float32]:
    """Return ``arc_tangent`` of every pair, bit for bit."""
    f: Any = np.float32
    a, b = np.abs(x), np.abs(y)
    large = np.maximum(a, b)
    has_length = large != 0
    v = np.minimum(a, b) / np.where(has_length, large, f(1))
    is_wide = v > f(TAN_SIXTEENTH)
    v = np.where(is_wide, (v - f(1)) / (v + f(1)), v)
    q = v * v
    angle = (((f(T9) * q + f(T7)) * q + f(T5)) * q + f(T3)) * q * v + v
    angle = np.where(is_wide, f(EIGHTH), f(0)) + angle
    angle = np.where(b > a, f(QUARTER) - angle, angle)
    angle = np.where(x < 0, f(HALF) - angle, angle)
    angle = np.where(y < 0, -angle, angle)
    result: npt.NDArray[np.float32] = np.where(has_length, angle, f(0))
    return result
