"""The Khepera robot inside a kernel: its sensors and its wheels.

Nitschke 2009, section 4.1 and table 4.1. Lengths are in cm, angles in rad counter-clockwise.
Positions relative to the robot are in its own frame (x ahead, y to its left).

Eight sensors sit on the rim, SI-0 to SI-7 counter-clockwise from the front, at 13, 43, 68, 158
degrees to either side, looking at 10, 45, 90 and 180 degrees: the real robot's geometry. A sensor
sees a cone; it is 1 in contact with the nearest thing there and falls linearly to 0 at its range.
Choice: linearly, for the thesis' "inversely proportional" without its constants.
"""

import math

import warp as wp

from conevo.kernels.trigonometry import arc_tangent

__all__ = [
    "AXLE",
    "LOOK_X",
    "LOOK_Y",
    "N_SENSORS",
    "RADIUS",
    "activation",
    "disc_gap",
    "drive",
    "steer",
    "steer_to",
    "wall_gap",
    "wrap",
]

RADIUS = wp.constant(2.75)
AXLE = wp.constant(5.3)
N_SENSORS = wp.constant(8)
PI = wp.constant(math.pi)
EIGHTH = wp.constant(math.pi / 4.0)

# SI-0 to SI-3, on the left; SI-7 to SI-4 mirror them.
_PLACE = [math.radians(a) for a in (13, 43, 68, 158)]
_LOOK = [math.radians(a) for a in (10, 45, 90, 180)]
PLACE_X = wp.constant(wp.vec4f(*(RADIUS * math.cos(a) for a in _PLACE)))
PLACE_Y = wp.constant(wp.vec4f(*(RADIUS * math.sin(a) for a in _PLACE)))
LOOK_X = wp.constant(wp.vec4f(*(math.cos(a) for a in _LOOK)))
LOOK_Y = wp.constant(wp.vec4f(*(math.sin(a) for a in _LOOK)))

# Taylor's series of sin(a) / a and cos(a) up to a^10: errors below 2e-8 up to 1.2 rad
S2, S4, S6, S8, S10 = (wp.constant((-1.0) ** k / math.factorial(2 * k + 1)) for k in range(1, 6))
C2, C4, C6, C8, C10 = (wp.constant((-1.0) ** k / math.factorial(2 * k)) for k in range(1, 6))


@wp.func
def one_of(four: wp.vec4f, k: int) -> float:
    """Return the number for sensor ``k``, or for the one that it mirrors, without memory access."""
    m = wp.min(k, 7 - k)
    return wp.where(m < 2, wp.where(m == 0, four[0], four[1]), wp.where(m == 2, four[2], four[3]))


@wp.func
def disc_gap(k: int, x: float, y: float, radius: float, cone: wp.vec2f, reach: float) -> float:
    """Return how far sensor ``k`` is from a disc in its cone; ``reach`` if none of it is there.

    It has no branches, so that one lane computes all sensors at once.

    Args:
        k: number of the sensor.
        x: the disc's centre, ahead of the robot's.
        y: the disc's centre, to the left of the robot's.
        radius: of the disc.
        cone: cosine and sine of the half angle of a sensor's cone.
        reach: range of a sensor, from its place on the rim.
    """
    side = wp.where(k < 4, 1.0, -1.0)
    look_x = one_of(LOOK_X, k)
    look_y = side * one_of(LOOK_Y, k)
    dx = x - one_of(PLACE_X, k)
    dy = y - side * one_of(PLACE_Y, k)
    along = dx * look_x + dy * look_y
    across = wp.abs(look_x * dy - look_y * dx)
    miss = across * cone[0] - along * cone[1]
    ahead = along * cone[0] + across * cone[1]
    # The centre lies in the cone, or else the nearest point in it is on its edge, if anywhere.
    is_inside = miss <= 0.0
    square = wp.where(is_inside, dx * dx + dy * dy, wp.max(radius * radius - miss * miss, 0.0))
    root = wp.sqrt(square)
    edge = wp.where(miss < radius, wp.where(ahead > 0.0, ahead - root, reach), reach)
    return wp.where(is_inside, root - radius, edge)


@wp.func
def wall_gap(k: int, h: float, nx: float, ny: float, cone: wp.vec2f, reach: float) -> float:
    """Return how far sensor ``k`` is from an endless wall in its cone; ``reach`` if it sees none.

    Args:
        k: number of the sensor.
        h: distance of the robot's centre from the wall.
        nx: unit vector from the robot to the wall, component ahead.
        ny: its component to the left.
        cone: cosine and sine of the half angle of a sensor's cone.
        reach: range of a sensor.
    """
    side = wp.where(k < 4, 1.0, -1.0)
    look_x = one_of(LOOK_X, k)
    look_y = side * one_of(LOOK_Y, k)
    d = h - (one_of(PLACE_X, k) * nx + side * one_of(PLACE_Y, k) * ny)
    q = look_x * nx + look_y * ny
    # The wall's normal lies in the cone, or else the nearest ray is the edge that is closer to it.
    edge = q * cone[0] + wp.abs(look_x * ny - look_y * nx) * cone[1]
    slope = wp.where(q < cone[0], edge, 1.0)
    return wp.where(slope > 1.0e-6, d / wp.max(slope, 1.0e-6), reach)


@wp.func
def activation(gap: float, reach: float) -> float:
    """Return the activation of a sensor ``gap`` from the nearest thing it sees; 1 in contact."""
    return 1.0 - wp.max(gap, 0.0) / reach


@wp.func
def wrap(angle: float) -> float:
    """Return an angle between -3 pi and 3 pi, wrapped to [-pi, pi)."""
    a = float(angle)
    if a >= PI:
        a = a - 2.0 * PI
    if a < -PI:
        a = a + 2.0 * PI
    return a


@wp.func
def drive(
    x: float, y: float, heading: float, ahead: wp.vec2f, left: float, right: float
) -> wp.vec3f:
    """Return the pose (x, y, heading) after one iteration: the exact arc of a differential drive.

    Args:
        x: first coordinate of the pose before the iteration.
        y: second coordinate of this pose.
        heading: of this pose.
        ahead: cosine and sine of that heading.
        left: distance that the left wheel rolls, up to 6.
        right: distance that the right wheel rolls.
    """
    half = (right - left) * (0.5 / AXLE)
    q = half * half
    sinc = 1.0 + q * (S2 + q * (S4 + q * (S6 + q * (S8 + q * S10))))
    c = 1.0 + q * (C2 + q * (C4 + q * (C6 + q * (C8 + q * C10))))
    s = half * sinc
    chord = 0.5 * (left + right) * sinc
    return wp.vec3f(
        x + chord * (ahead[0] * c - ahead[1] * s),
        y + chord * (ahead[1] * c + ahead[0] * s),
        wrap(heading + 2.0 * half),
    )


@wp.func
def steer(error: float, speed: float) -> wp.vec2f:
    """Return wheel commands in [-1, 1]: turn by ``error``, drive ahead with the remaining speed.

    Args:
        error: angle to turn, in [-pi, pi).
        speed: distance that a wheel rolls at command 1.
    """
    w = wp.clamp(error * AXLE / (2.0 * speed), -1.0, 1.0)
    f = 1.0 - wp.abs(w)
    return wp.vec2f(f - w, f + w)


@wp.func
def steer_to(dx: float, dy: float, ahead: wp.vec2f, speed: float) -> wp.vec2f:
    """Return wheel commands that ``steer`` to a place.

    Args:
        dx: first component of the vector from the robot to the place.
        dy: second component.
        ahead: cosine and sine of the robot's heading.
        speed: distance that a wheel rolls at command 1.
    """
    forth = ahead[0] * dx + ahead[1] * dy
    aside = ahead[0] * dy - ahead[1] * dx
    if wp.abs(aside) > forth and 2.0 * speed < EIGHTH * AXLE:  # more than it can turn at once
        return wp.where(aside < 0.0, wp.vec2f(1.0, -1.0), wp.vec2f(-1.0, 1.0))
    return steer(arc_tangent(aside, forth), speed)
