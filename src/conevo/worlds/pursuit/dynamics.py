"""The phases of an epoch of predators and prey: its start, captures, its end.

One set of rules serves two worlds: the team consists of the predators in ``pursuit.world``, and of
the prey in ``pursuit.prey``. The cards of the two worlds list the rules and the choices.
"""

import warp as wp

from conevo.kernels.actions import begin_counting
from conevo.kernels.disturbances import fails
from conevo.kernels.phases import Phase
from conevo.kernels.trigonometry import cosine_sine
from conevo.worlds.pursuit.bodies import NONE, PursuitConstants, PursuitScene, PursuitTeam
from conevo.worlds.pursuit.commands import set_up_prey
from conevo.worlds.pursuit.motion import ACT, ACTIONS, COMMIT, N_ACTIONS, WAY_UNITS
from conevo.worlds.pursuit.senses import SENSE

__all__ = ["ACTIONS", "N_ACTIONS", "PREY_FUNCTIONS", "PURSUIT_FUNCTIONS", "fail", "stand"]


# --- reset ----------------------------------------------------------------------------------------


@wp.func
def places(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants) -> int:
    """Return the largest number of bodies, so that a record has no remains of another team."""
    return team.x.shape[0]


@wp.func
def reset_body(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, b: int, t: int) -> None:
    """Put body ``b`` at its place."""
    heading = scene.heading[b]
    ahead = cosine_sine(heading)
    team.x[b] = scene.x[b]
    team.y[b] = scene.y[b]
    team.heading[b] = heading
    team.ahead_x[b] = ahead[0]
    team.ahead_y[b] = ahead[1]
    team.wander[b] = heading
    team.left[b] = 0.0
    team.right[b] = 0.0
    team.refused[b] = 0
    team.collided[b] = 0
    team.collisions[b] = 0
    team.has_moved[b] = 1
    team.near[b] = 0
    team.close[b] = 0
    team.known[b] = 0


@wp.func
def reset_robot(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int
) -> None:
    """Clear the records of robot ``i``, and list its sensors that are held."""
    held = int(0)
    k = int(0)
    while k < scene.clamp.shape[1]:
        held = held | (int(not wp.isnan(scene.clamp[i, k])) << k)
        k += 1
    team.held[i] = held
    team.fitness[i] = 0.0
    begin_counting(team.action, team.switches, team.counts, i)
    if i == 0:
        team.first[0] = NONE


@wp.func
def prey(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants) -> int:
    """Return the number of prey that are opponents; one, which is absent, if they are the team."""
    return team.captured.shape[0]


@wp.func
def reset_prey(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, q: int, t: int) -> None:
    """Clear the records of prey ``q``, and build its network."""
    team.captured[q] = 0
    team.captures[q] = 0
    team.moved_sum[q] = 0
    team.commanded_sum[q] = 0
    k = int(0)
    while k < p.capture_window:
        team.moved[q * p.capture_window + k] = 0
        team.commanded[q * p.capture_window + k] = 0
        k += 1
    set_up_prey(team, scene, p, q, t)


# --- failures ------------------------------------------------------------------------------------


@wp.func
def fail(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int) -> None:
    """Record whether robot ``i`` fails."""
    if fails(scene.seed[0], p, i, t):
        team.failed[i] = 1


@wp.func
def stand(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int) -> None:
    """Stop the wheels of robot ``i`` if it has failed, whatever controls it."""
    if t == 0:
        team.failed[i] = 0
    if team.failed[i] != 0:
        team.heuristic[i] = NONE
        for k in range(team.outputs.shape[1]):
            team.outputs[i, k] = 0.0


# --- resolve --------------------------------------------------------------------------------------


@wp.func
def is_captured(team: PursuitTeam, p: PursuitConstants, q: int, t: int) -> bool:
    """Return whether prey ``q`` is captured in this iteration: immobilized, with predators near."""
    if t + 1 < p.capture_window:
        return False
    moved = float(team.moved_sum[q])
    least = p.capture_share * float(team.commanded_sum[q])
    if moved >= least and moved >= p.capture_distance_cm * WAY_UNITS:
        return False
    x = team.x[p.n_robots + q]
    y = team.y[p.n_robots + q]
    near = int(0)
    j = int(0)
    while j < p.n_robots:
        dx = team.x[j] - x
        dy = team.y[j] - y
        near += int(dx * dx + dy * dy <= p.sight_cm_2)
        j += 1
    return near >= p.capture_predators


@wp.func
def capture(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, q: int, t: int) -> None:
    """Determine whether prey ``q`` is captured, and count captures."""
    now = int(is_captured(team, p, q, t))
    team.captures[q] = team.captures[q] + wp.max(now - team.captured[q], 0)
    team.captured[q] = now


@wp.func
def resolve_capture(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int
) -> None:
    """Credit predator ``i``, like all predators, if any prey is captured (section 4.4)."""
    held = int(0)
    q = int(0)
    while q < team.captured.shape[0]:
        held = wp.max(held, team.captured[q])
        q += 1
    team.fitness[i] = team.fitness[i] + float(held)
    if i == 0 and held != 0 and team.first[0] == NONE:
        team.first[0] = t


@wp.func
def resolve_escape(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, i: int, t: int
) -> None:
    """Credit prey ``i`` with its path, more for a straight one; nothing once it has collided.

    Section 4.3: "how far and fast the prey could move in a straight line without colliding".
    Choice: distance times 1 - sqrt(difference of the wheels), Floreano and Mondada's form of it.
    """
    if team.collisions[i] != 0:
        team.fitness[i] = 0.0
        return
    d = 0.5 * wp.abs(team.left[i] + team.right[i]) * p.prey_speed_cm
    bend = 0.5 * wp.abs(team.right[i] - team.left[i])
    team.fitness[i] = team.fitness[i] + d * (1.0 - wp.sqrt(bend))


# --- outcome --------------------------------------------------------------------------------------


@wp.func
def outcome_capture(
    team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, t_end: int
) -> None:
    """Write capture time, iteration of the first capture, captures, and the team's collisions."""
    captures = int(0)
    for q in range(team.captured.shape[0]):
        captures += team.captures[q]
    collisions = int(0)
    for i in range(p.n_robots):
        collisions += team.collisions[i]
    team.performance[0] = team.fitness[0]
    team.performance[1] = float(wp.where(team.first[0] == NONE, t_end, team.first[0]))
    team.performance[2] = float(captures)
    team.performance[3] = float(collisions)


@wp.func
def outcome_escape(team: PursuitTeam, scene: PursuitScene, p: PursuitConstants, t_end: int) -> None:
    """Write the prey's mean path, and the share of them that collided."""
    path = float(0.0)
    collided = int(0)
    for i in range(p.n_robots):
        path += team.fitness[i]
        collided += wp.min(team.collisions[i], 1)
    team.performance[0] = path / float(p.n_robots)
    team.performance[1] = float(collided) / float(p.n_robots)


RESET = (Phase(reset_body, places), Phase(reset_robot), Phase(reset_prey, prey))
_PHASES = {"reset": RESET, "sense": SENSE, "act": ACT, "commit": COMMIT}
PURSUIT_FUNCTIONS = _PHASES | {
    "resolve": (Phase(capture, prey), Phase(resolve_capture)),
    "outcome": outcome_capture,
}
PREY_FUNCTIONS = _PHASES | {"resolve": resolve_escape, "outcome": outcome_escape}
