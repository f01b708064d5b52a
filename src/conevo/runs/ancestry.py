"""The start of a run from another one: from its last populations, or from its champion."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from conevo.controllers.registry import genome_of
from conevo.errors import UsageError
from conevo.runs.champions import Team
from conevo.runs.code import last_code
from conevo.runs.lab import layout_of, refuse_other_state
from conevo.runs.store import Store
from conevo.terms import quoted

if TYPE_CHECKING:
    from conevo.evolution.protocol import State
    from conevo.runs.config import RunConfig

__all__ = ["ancestor_of", "refuse_other_controllers"]


def ancestor_of(
    store: Store, config: Callable[[], RunConfig], of_champion: bool = False
) -> tuple[State | Team, dict[str, Any]]:
    """Return the state or champion of a finished run, and the provenance entry of descendants.

    Args:
        store: of the run.
        config: returns its settings; called only for a state, since this loads world and method.
        of_champion: return its champion instead of its last state.

    Raises:
        UsageError: it is not finished, or was changed since it was sealed.
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
    settings = config()
    layout = layout_of(settings.build_world(), settings.controller)
    blank = settings.build_method().init(layout, settings.run.seed)
    state, digest = store.load_final(settings.method, blank)
    refuse_other_state(state, blank, path)
    generation = state.progress.generation
    return state, {"origin": about | {"generation": generation, "checkpoint": digest}}


def refuse_other_controllers(what: str, old: RunConfig, new: RunConfig) -> None:
    """Raise UsageError if genotypes of one configuration mean something else in another.

    The initial number of hidden neurons may differ.

    Args:
        what: the owner of the controllers, for the message.
        old: their configuration.
        new: the configuration of the world in which they are to be evaluated.
    """
    there, here = old.build_world(), new.build_world()
    a, b = genome_of(old.controller, there), genome_of(new.controller, here)
    sizes = {
        "inputs": (len(there.inputs), len(here.inputs)),
        "outputs": (len(there.outputs), len(here.outputs)),
        "slots for parts": (a.max_parts, b.max_parts),
        "genes of a part": (a.n_genes, b.n_genes),
    }
    different = [f"{was} {what} became {n}" for what, (was, n) in sizes.items() if was != n]
    before, now = old.tables()["controller"], new.tables()["controller"]
    different += [
        f"controller.{key} = {before.get(key)!r} became {now.get(key)!r}"
        for key in before | now
        if key not in ("n_hidden", "max_hidden") and before.get(key) != now.get(key)
    ]
    if different:
        raise UsageError(
            f"the controllers of {what} ({old.task}) do not fit {new.task}: {'; '.join(different)}"
        )
