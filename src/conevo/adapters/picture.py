"""A stepped team as a picture: its world as a film draws it, without the texts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from conevo.errors import UsageError
from conevo.playback.check import DAMAGE, checked, one_line
from conevo.playback.quantized import Channel
from conevo.replay.drawing.scene import Scene
from conevo.terms import NON_SPECIALIZED
from conevo.worlds.drawing import drawing
from conevo.worlds.recorded import facts_of, scene_of

if TYPE_CHECKING:
    from conevo.adapters.teams import SteppedTeams
    from conevo.playback.schema import Playback

__all__ = ["SIZE", "Camera"]

SIZE = 480  # px, of the longer side; as in a GIF


class Camera:
    """Keeps the states of one team's epoch, and paints the last one.

    Trails and things that fade need the states before it.

    Args:
        teams: the stepped teams.
        k: number of the team.
    """

    def __init__(self, teams: SteppedTeams, k: int = 0) -> None:
        self._teams, self._k = teams, k
        self._facts = facts_of(teams.world)
        self._states: list[dict[str, npt.NDArray[Any]]] = []
        self._scene: Scene | None = None  # of the last picture in this epoch

    def look(self) -> None:
        """Keep the state of now; to be called after each reset and each step."""
        played = int(self._teams.clock[self._k])
        if played == 0:
            self._states, self._scene = [], None
        elif played > len(self._states):
            self._states.append(self._now())

    def picture(self) -> npt.NDArray[np.uint8]:
        """Return the picture [height, width, 3] of the state of now.

        Raises:
            UsageError: the world cannot be drawn.
        """
        try:
            playback = checked(self._playback())
        except DAMAGE as error:
            reason = one_line(str(error) or type(error).__name__)
            raise UsageError(f"{self._facts['task']} cannot be drawn: {reason}") from error
        x0, y0, x1, y1 = playback.bounds
        scale = SIZE / max(x1 - x0, y1 - y0)
        width, height = (max(2 * round(side * scale / 2), 2) for side in (x1 - x0, y1 - y0))
        self._scene = Scene(playback, (width, height), "action", self._scene)
        return np.array(self._scene.at(playback.iterations - 1))

    def _now(self) -> dict[str, npt.NDArray[Any]]:
        stepper = self._teams.stepper
        return {name: stepper.read(name)[self._k] for name in stepper.recorded}

    def _playback(self) -> Playback:
        """Return the playback of the epoch so far."""
        stepper, world = self._teams.stepper, self._teams.world
        states = self._states
        if not states:  # nobody has acted yet
            now = self._now()
            states = [now | {"action": np.full_like(now["action"], -1)}]
        arrays = {name: np.stack([one[name] for one in states]) for name in states[0]}
        arrays |= {name: stepper.read(name)[self._k] for name in stepper.recorded_at_end}
        channels = {name: Channel.of(values) for name, values in arrays.items()}
        t, r = len(states), world.n_robots
        for name, size in (("sensors", world.inputs), ("outputs", world.outputs)):
            channels[name] = _not_drawn(t, r, len(size))
        for name in self._teams.measures:
            channels[f"performance/{name}"] = _not_drawn(t)
        key = stepper.keys[int(stepper.scenario.numpy()[self._k])]
        channels |= scene_of(world.scenarios([key]), stepper.is_shared)
        about = self._facts | {
            "iterations": t,
            "labels": [NON_SPECIALIZED] * r,
            "specialization": [0.0] * r,
            "fitness": [0.0] * r,
            "heuristic": ["a program outside"] * r,
            "neurons": [[]] * r,
            "performance": dict.fromkeys(self._teams.measures, 0.0),
        }
        return drawing(cast("Any", about), channels)


def _not_drawn(*shape: int) -> Channel:
    """Return a channel of numbers that a picture does not show."""
    return Channel(np.zeros(shape, np.uint8), 0.0, 1.0)
