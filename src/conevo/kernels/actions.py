"""Actions of a robot: how a heuristic chooses them, and how they are counted."""

import warp as wp

__all__ = ["NONE", "PREFERENCE", "begin_counting", "count_action", "heuristic_action"]

NONE = wp.constant(-1)
PREFERENCE = wp.constant(0.7)  # Nitschke 2009, tables 5.3 and 6.3


@wp.func
def heuristic_action(u: float, own: int, other: int, n_actions: int) -> int:
    """Return the action of a heuristic robot: ``own`` with probability 0.7, else ``other``.

    Args:
        u: random number in [0, 1).
        own: its own action; NONE if it prefers none, so that all are equally likely.
        other: the action that it executes otherwise.
        n_actions: number of all actions.
    """
    if own == NONE:
        return wp.min(int(u * float(n_actions)), n_actions - 1)
    return wp.where(u < PREFERENCE, own, other)


@wp.func
def begin_counting(
    action: wp.array[int], switches: wp.array[int], counts: wp.array[int], i: int
) -> None:
    """Reset robot ``i``'s counts and last action; the arrays are those of ``count_action``."""
    action[i] = NONE
    switches[i] = 0
    columns = counts.shape[0] // action.shape[0]
    for column in range(columns):
        counts[i * columns + column] = 0


@wp.func
def count_action(
    action: wp.array[int],
    switches: wp.array[int],
    counts: wp.array[int],
    i: int,
    a: int,
    column: int,
) -> None:
    """Record that robot ``i`` executed action ``a``, and count it unless it is NONE.

    A switch is a different action than in the previous iteration (Nitschke 2009, eq. 3.4). An
    action that follows an iteration without one is not a switch.

    Args:
        action: [R] executed in the previous iteration, NONE if the robot did nothing.
        switches: [R].
        counts: [R, C] actions executed for each caste.
        i: the robot.
        a: the action.
        column: the caste for which it counts.
    """
    previous = action[i]
    action[i] = a
    if a == NONE:
        return
    if previous != NONE and previous != a:
        switches[i] = switches[i] + 1
    k = i * (counts.shape[0] // action.shape[0]) + column
    counts[k] = counts[k] + 1
