"""What a run begins with that begins with another one: its last populations, or its champion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError
from conevo.runs.champions import Team
from conevo.runs.code import last_code
from conevo.runs.store import Store
from conevo.terms import quoted
from conevo.worlds.protocol import World

if TYPE_CHECKING:
    from conevo.evolution.protocol import State
    from conevo.runs.run import Run

__all__ = ["ancestor_of", "refuse_other_controllers"]

SIZES = {
    "n_sensors": "sensors",
    "n_context": "context inputs",
    "n_outputs": "outputs",
    "max_hidden": "slots for neurons",
}


def ancestor_of(
    store: Store, method: str, of_champion: bool = False
) -> tuple[State | Team, dict[str, Any]]:
    """Return what a finished run hands on, and what its descendants say about it.

    Args:
        store: of the run.
        method: of the run.
        of_champion: its champion instead of the state that it ended with.

    Raises:
        UsageError: it is not finished, or not as it was when it was sealed.
    """
    path = store.path
    if not store.is_finished:
        raise UsageError(
            f"{path} is not finished, so no run can begin with its populations; "
            f"finish it with 'conevo resume {quoted(path)}'"
        )
    if changed := store.check_seal():
        raise UsageError(
            f"{path} was changed since it was finished ({', '.join(changed)}): "
            f"no run can begin with its populations"
        )
    made = store.read_provenance()
    about = {"path": str(path), "run_id": made["run_id"], "code": last_code(made)}
    if of_champion:
        team, digest = store.load_final_champion()
        about |= {"generation": team.generation, "checkpoint": digest, "of": "champion"}
        return team, {"origin": about}
    state, digest = store.load_final(method)
    return state, {"origin": about | {"generation": state.generation, "checkpoint": digest}}


def refuse_other_controllers(origin: Run, world: World) -> None:
    """Raise UsageError if a world's controllers are not of the sizes that a run's world has."""
    old, new = origin.config.build_world().controller, world.controller
    different = [
        f"{getattr(old, name)} {what} became {getattr(new, name)}"
        for name, what in SIZES.items()
        if getattr(old, name) != getattr(new, name)
    ]
    if old.bias != new.bias:
        different.append("only one of the two has a bias")
    if different:
        raise UsageError(
            f"the controllers of {origin.path} ({origin.config.task}) do not fit this world: "
            f"{'; '.join(different)}"
        )
