"""What a robot does: how its actions are chosen by a heuristic, and how they are counted."""

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
        other: what it does otherwise.
        n_actions: number of all actions.
    """
    if own == NONE:
        return wp.min(int(u * float(n_actions)), n_actions - 1)
    return wp.where(u < PREFERENCE, own, other)


@wp.func
def begin_counting(
    action: wp.array[int], switches: wp.array[int], counts: wp.array[int], i: int
) -> None:
    """Let robot ``i`` have executed nothing yet; the arrays are those of ``count_action``."""
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
    """Make ``a`` the action that robot ``i`` has executed, and count it unless it is NONE.

    A switch is another action than in the iteration just before (Nitschke 2009, eq. 3.4); after an
    iteration without an action nothing is one.

    Args:
        action: [R] executed in the previous iteration, NONE if the robot did nothing.
        switches: [R].
        counts: [R, C] actions executed for each caste.
        i: the robot.
        a: the action.
        column: the caste that it counts for.
    """
    previous = action[i]
    action[i] = a
    if a == NONE:
        return
    if previous != NONE and previous != a:
        switches[i] = switches[i] + 1
    k = i * (counts.shape[0] // action.shape[0]) + column
    counts[k] = counts[k] + 1
