"""The Khepera robot inside a kernel: what its sensors see, where its wheels take it.

Nitschke 2009, section 4.1 and table 4.1. Lengths in cm, angles in rad counter-clockwise, positions
relative to the robot are in its own frame (x ahead, y to its left).

Eight sensors sit on the rim, SI-0 to SI-7 counter-clockwise from the front, at 13, 43, 68, 158
degrees to either side, looking at 10, 45, 90 and 180 degrees: the real robot's geometry. A sensor
sees a cone; it is 1 in contact with the nearest thing there and falls linearly to 0 at its range.
Choice: linearly, for the thesis' "inversely proportional" without its constants.
"""

import math
from typing import TYPE_CHECKING, Any

import warp as wp

from conevo.kernels.trigonometry import cosine_sine

__all__ = [
    "AXLE",
    "N_SENSORS",
    "RADIUS",
    "drive",
    "eight",
    "see_disc",
    "see_wall",
    "steer",
    "wrap",
]

RADIUS = wp.constant(2.75)
AXLE = wp.constant(5.3)
N_SENSORS = wp.constant(8)
PI = wp.constant(math.pi)

if TYPE_CHECKING:
    eight = Any  # a Warp type that only Warp can read
else:
    eight = wp.types.vector(length=8, dtype=float)

_PLACE = [math.radians(a) for a in (13, 43, 68, 158, -158, -68, -43, -13)]
_LOOK = [math.radians(a) for a in (10, 45, 90, 180, -180, -90, -45, -10)]
PLACE_X = wp.constant(eight(*(RADIUS * math.cos(a) for a in _PLACE)))
PLACE_Y = wp.constant(eight(*(RADIUS * math.sin(a) for a in _PLACE)))
LOOK_X = wp.constant(eight(*(math.cos(a) for a in _LOOK)))
LOOK_Y = wp.constant(eight(*(math.sin(a) for a in _LOOK)))


@wp.func
def see_disc(seen: eight, x: float, y: float, radius: float, cone: wp.vec2f, reach: float) -> eight:
    """Return the eight activations after a disc has been looked at too.

    Args:
        seen: activations so far.
        x: the disc's centre, ahead of the robot's.
        y: to the left of it.
        radius: of the disc.
        cone: cosine and sine of the half angle that a sensor sees.
        reach: range of a sensor, from its place on the rim.
    """
    for k in range(N_SENSORS):
        dx = x - PLACE_X[k]
        dy = y - PLACE_Y[k]
        along = dx * LOOK_X[k] + dy * LOOK_Y[k]
        across = wp.abs(LOOK_X[k] * dy - LOOK_Y[k] * dx)
        miss = across * cone[0] - along * cone[1]
        d = float(reach)
        if miss <= 0.0:  # the centre lies in the cone
            d = wp.sqrt(dx * dx + dy * dy) - radius
        else:  # the nearest point in the cone lies on its edge, if anywhere
            ahead = along * cone[0] + across * cone[1]
            if ahead > 0.0 and miss < radius:
                d = ahead - wp.sqrt(radius * radius - miss * miss)
        seen[k] = wp.max(seen[k], 1.0 - wp.max(d, 0.0) / reach)
    return seen


@wp.func
def see_wall(seen: eight, h: float, nx: float, ny: float, cone: wp.vec2f, reach: float) -> eight:
    """Return the eight activations after an endless wall has been looked at too.

    Args:
        seen: activations so far.
        h: distance of the robot's centre from the wall.
        nx: unit vector from the robot to the wall.
        ny: its other component, to the left.
        cone: cosine and sine of the half angle that a sensor sees.
        reach: range of a sensor.
    """
    for k in range(N_SENSORS):
        d = h - (PLACE_X[k] * nx + PLACE_Y[k] * ny)
        q = LOOK_X[k] * nx + LOOK_Y[k] * ny
        if q < cone[0]:  # the wall's normal lies outside the cone: along the edge nearest to it
            q = q * cone[0] + wp.abs(LOOK_X[k] * ny - LOOK_Y[k] * nx) * cone[1]
            d = wp.where(q > 1.0e-6, d / wp.max(q, 1.0e-6), reach)
        seen[k] = wp.max(seen[k], 1.0 - wp.max(d, 0.0) / reach)
    return seen


@wp.func
def wrap(angle: float) -> float:
    """Return an angle between -3 pi and 3 pi as the same one in [-pi, pi)."""
    a = float(angle)
    if a >= PI:
        a = a - 2.0 * PI
    if a < -PI:
        a = a + 2.0 * PI
    return a


@wp.func
def drive(x: float, y: float, heading: float, left: float, right: float) -> wp.vec3f:
    """Return the pose (x, y, heading) after one iteration: the exact arc of a differential drive.

    Args:
        x: the pose before.
        y: the pose before.
        heading: the pose before.
        left: distance that the left wheel rolls.
        right: distance that the right wheel rolls.
    """
    half = (right - left) / (2.0 * AXLE)
    chord = 0.5 * (left + right)
    if wp.abs(half) > 1.0e-3:
        turned = cosine_sine(half)
        chord = chord * turned[1] / half
    else:
        chord = chord * (1.0 - half * half / 6.0)
    ahead = cosine_sine(heading + half)
    return wp.vec3f(x + chord * ahead[0], y + chord * ahead[1], wrap(heading + 2.0 * half))


@wp.func
def steer(error: float, speed: float) -> wp.vec2f:
    """Return wheel commands in [-1, 1] that turn by ``error`` and drive ahead with what is left.

    Args:
        error: angle to turn, in [-pi, pi).
        speed: distance that a wheel rolls at command 1.
    """
    w = wp.clamp(error * AXLE / (2.0 * speed), -1.0, 1.0)
    f = 1.0 - wp.abs(w)
    return wp.vec2f(f - w, f + w)
