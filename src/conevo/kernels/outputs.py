"""Functions of a robot's outputs: which is the highest, and a share between 0 and 1.

The sigmoid is the rational approximation of tanh, of degree 13 over 6, with the coefficients that
Eigen publishes. It is here twice, with the same operations in float32: for kernels and for numpy.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
import warp as wp

__all__ = ["EXTREME", "highest", "sigmoid", "sigmoid_of"]

EXTREME = 16.0  # from 2 * LIMIT on the sigmoid is constant, 1e-7 from 1

LIMIT = wp.constant(7.9)
P1 = wp.constant(4.89352455891786e-03)
P3 = wp.constant(6.37261928875436e-04)
P5 = wp.constant(1.48572235717979e-05)
P7 = wp.constant(5.12229709037114e-08)
P9 = wp.constant(-8.60467152213735e-11)
P11 = wp.constant(2.00018790482477e-13)
P13 = wp.constant(-2.76076847742355e-16)
Q0 = wp.constant(4.89352518554385e-03)
Q2 = wp.constant(2.26843463243900e-03)
Q4 = wp.constant(1.18534705686654e-04)
Q6 = wp.constant(1.19825839466702e-06)


@wp.func
def highest(outputs: wp.array2d[float], i: int, n: int) -> int:
    """Return which of robot ``i``'s first ``n`` outputs is the highest; ties go to the first."""
    best = int(0)
    most = outputs[i, 0]
    k = int(1)
    while k < n:
        output = outputs[i, k]
        best = wp.where(output > most, k, best)
        most = wp.where(output > most, output, most)
        k += 1
    return best


@wp.func
def sigmoid(a: float) -> float:
    """Return the logistic function by a rational approximation, error below 1e-6, branch-free.

    Its operations are the same on every target, unlike those of a library's exp.
    """
    h = wp.clamp(a * 0.5, -LIMIT, LIMIT)
    q = h * h
    p = h * (P1 + q * (P3 + q * (P5 + q * (P7 + q * (P9 + q * (P11 + q * P13))))))
    d = Q0 + q * (Q2 + q * (Q4 + q * Q6))
    return 0.5 + 0.5 * (p / d)


def sigmoid_of(a: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return ``sigmoid`` of every element, bit for bit. It takes arrays of jax, too."""
    f: Any = np.float32
    half = f(0.5)
    h = (a * half).clip(-f(LIMIT), f(LIMIT))
    q = h * h
    p = f(P11) + q * f(P13)
    for c in (P9, P7, P5, P3, P1):
        p = f(c) + q * p
    d = f(Q0) + q * (f(Q2) + q * (f(Q4) + q * f(Q6)))
    result: npt.NDArray[np.float32] = half + half * ((h * p) / d)
    return result
