"""How each world is drawn: ``stage_of`` says it all at once, for the viewer and for films."""

from __future__ import annotations

from conevo.replay.stage import Stage
from conevo.replay.stages import gacc, plain, pursuit, rover
from conevo.replay.stages.check import checked
from conevo.replay.stages.parts import Parts
from conevo.replay.stages.refusals import DAMAGE, refusal
from conevo.replay.trajectory import Trajectory

__all__ = ["checked", "stage_of"]

_STAGES = {
    "rover-v1": rover.stage,
    "pursuit-v1": pursuit.stage,
    "prey-v1": pursuit.stage,
    "gacc-v1": gacc.stage,
}


def stage_of(trajectory: Trajectory) -> Stage:
    """Return what is to be drawn of a trajectory.

    Raises:
        UsageError: it lacks what its world needs, or what it says cannot be.
    """
    try:
        parts = Parts(trajectory)
        return checked(_STAGES.get(parts.about["world"], plain.stage)(parts))
    except DAMAGE as error:
        raise refusal(error) from error
