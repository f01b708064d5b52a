"""Requirements of the engine, checked before a world's kernel is made: a line for each fault."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp

from conevo.errors import UsageError, unknown_name
from conevo.kernels.arrays import dimensions, shapes
from conevo.kernels.phases import Phase
from conevo.worlds.protocol import Simulation, World
from conevo.worlds.spaces import space_faults

__all__ = [
    "STAGES",
    "dimensions_of",
    "faults",
    "faults_of_names",
    "refuse_faults",
    "scenario_faults",
    "shapes_of",
    "stages_of",
]


@wp.struct
class _Nothing:
    """An example of a Warp struct, for its type."""

    number: int


# The stages of an epoch, each with the numbers that its function gets after team, scene and p. A
# world may have phases over other items in place of a function.
STAGES = {
    "reset": ("i",),
    "sense": ("i", "t"),
    "act": ("i", "t"),
    "commit": ("i", "t"),
    "settle": ("t",),
    "resolve": ("i", "t"),
    "outcome": ("t_end",),
}
OPTIONAL = ("settle",)
NUMBERS = {"i": "q", "t": "t", "t_end": "t"}  # their names in a phase
STATE = {
    "action": int,
    "heuristic": int,
    "fitness": float,
    "counts": int,
    "switches": int,
    "performance": float,
}
STRUCT = type(_Nothing)
WIDE = ("inputs", "outputs")
# The dimensions of arrays that every world has. All others have one element for each robot unless
# they name their dimensions.
DIMENSIONS = {
    "inputs": ("robots", "inputs"),
    "outputs": ("robots", "outputs"),
    "counts": ("robots", "castes"),
    "performance": ("measures",),
}
ROBOTS = ("robots",)
RECORDED = ("action", "fitness")


def refuse_faults(world: World, simulation: Simulation) -> None:
    """Refuse a world that the engine cannot run.

    Raises:
        UsageError: the first fault.
    """
    for fault in faults(world, simulation):
        raise UsageError(f"world {world.name}: {fault}")


def stages_of(simulation: Simulation) -> dict[str, tuple[Phase, ...]]:
    """Return the phases of each stage of an epoch, in the order in which they run."""
    found = {}
    for name, takes in STAGES.items():
        given = simulation.functions.get(name, ())
        if isinstance(given, wp.Function):
            items = None if "i" in takes else 1
            given = (Phase(given, items, ", ".join(NUMBERS[one] for one in takes)),)
        found[name] = given
    return found


def dimensions_of(simulation: Simulation) -> dict[str, tuple[str, ...]]:
    """Return the names of the dimensions of each array of a team's state."""
    return dimensions(simulation.state, lambda name: DIMENSIONS.get(name, ROBOTS))


def shapes_of(world: World, simulation: Simulation) -> dict[str, tuple[int, ...]]:
    """Return the shape of each array of a team's state."""
    return shapes(dimensions_of(simulation), _known_sizes(world) | simulation.sizes)


def _known_sizes(world: World) -> dict[str, int]:
    """Return the sizes of the dimensions that every world has."""
    named = {n: len(getattr(world, n)) for n in ("inputs", "outputs", "castes")}
    return {"robots": world.n_robots, "measures": len(world.performance), "team": 1} | named


def faults(world: World, simulation: Simulation) -> Iterator[str]:
    """Yield the faults of a world's names, controller, phases and structs."""
    yield from faults_of_names(world)
    yield from _of_phases(simulation)
    if _is_struct(simulation.state):
        yield from _of_state(world, simulation)
    else:
        yield "Simulation.state must be a wp.struct"
    if _is_struct(simulation.scene):
        yield from _of_scene(simulation.scene)
    else:
        yield "Simulation.scene must be a wp.struct"
    made_of = getattr(simulation.params, "_cls", None)
    if not _is_struct(simulation.params_type) or made_of is not simulation.params_type:
        yield "Simulation.params must be made of Simulation.params_type, a wp.struct"


def _is_struct(kind: Any) -> bool:
    return isinstance(kind, STRUCT)


def faults_of_names(world: World) -> Iterator[str]:
    """Yield the faults in the names of inputs, outputs, actions, castes and heuristics."""
    for what in ("inputs", "outputs", "actions", "castes", "heuristics"):
        names: Any = getattr(world, what)
        if not (isinstance(names, tuple) and names and all(isinstance(n, str) for n in names)):
            yield f"{what} must be a tuple of names, as in ('rest',), not {names!r}"
        elif twice := next((name for name in names if names.count(name) > 1), ""):
            yield f"{what} has {twice!r} twice"
    yield from _of_settings(world)
    yield from space_faults(world)
    if len(world.castes) < len(world.actions):
        yield f"castes has {len(world.castes)} names, fewer than the {len(world.actions)} actions"


def _of_settings(world: World) -> Iterator[str]:
    if not hasattr(world, "settings"):
        return
    names: Any = world.settings
    if not (isinstance(names, tuple) and names and all(isinstance(n, str) for n in names)):
        yield f"settings must be a tuple of castes, as in {world.castes[:1]!r}, not {names!r}"
    elif twice := next((name for name in names if names.count(name) > 1), ""):
        yield f"settings has {twice!r} twice"
    elif other := next((name for name in names if name not in world.castes), ""):
        yield str(unknown_name("caste", other, world.castes, "in settings"))


def _of_phases(simulation: Simulation) -> Iterator[str]:
    needed = [name for name in STAGES if name not in OPTIONAL]
    for name in needed:
        if name not in simulation.functions:
            yield f"Simulation.functions has no phase {name!r}; a world has {', '.join(needed)}"
    for name, given in simulation.functions.items():
        if name not in STAGES:
            yield str(unknown_name("phase", name, STAGES, "in Simulation.functions"))
        elif isinstance(given, wp.Function):
            yield from _of_function(simulation, name, given, STAGES[name], f"phase {name}")
        elif not (isinstance(given, tuple) and all(isinstance(one, Phase) for one in given)):
            kind = type(given).__name__
            yield f"phase {name} must be a wp.func, or a tuple of Phase, not {kind}"
        else:
            for phase in given:
                yield from _of_function(simulation, phase.name, phase.function, ("q", "t"), name)
                if isinstance(phase.items, wp.Function):
                    yield from _of_function(simulation, "items", phase.items, (), f"of {name}")


def _of_function(
    simulation: Simulation, name: str, function: Any, numbers: tuple[str, ...], what: str
) -> Iterator[str]:
    """Yield a line if a function is not declared with a world's structs and these numbers."""
    structs = (simulation.state, simulation.scene, simulation.params_type)
    wanted = ["team", "scene", "p", *numbers]
    given = list(function.input_types.values())
    types = [*structs, *[int] * len(numbers)]
    if len(given) != len(wanted) or any(map(_differ, given, types)):
        yield (
            f"{_place(function)}: {what} must be declared as {name}({', '.join(wanted)}), of types "
            f"Team, Scene, Params{', int' * len(numbers)}"
        )


def _differ(given: Any, wanted: Any) -> bool:
    if _is_struct(wanted):
        return given is not wanted
    return given not in (int, wp.int32)


def _place(function: Any) -> str:
    code = function.func.__code__
    return f"{code.co_filename}:{code.co_firstlineno}"


def _of_state(world: World, simulation: Simulation) -> Iterator[str]:
    state = simulation.state
    fields = {name: var.type for name, var in state.vars.items()}
    for name, kind in (STATE | dict.fromkeys(WIDE, float)).items():
        ndim = 2 if name in WIDE else 1
        wanted = f"'{name}: wp.array{'2d' if ndim == 2 else ''}[{kind.__name__}]'"
        if name not in fields:
            yield f"{state.key} needs a field {wanted}"
        elif not _is_array_of(fields[name], kind, ndim):
            yield f"{state.key}.{name} must be declared as {wanted}"
    arrays = {name for name, kind in fields.items() if wp.types.is_array(kind)}
    for name, kind in fields.items():
        if name not in (*WIDE, *STATE) and not (name in arrays and kind.ndim == 1):
            yield f"{state.key}.{name} must be a one-dimensional array: only those keep a value"
    yield from _of_dimensions(world, simulation)
    for what in ("recorded", "recorded_at_end"):
        names = getattr(simulation, what)
        for name in names:
            if name not in (*arrays, *STATE):
                yield str(unknown_name("array", name, arrays, f"in Simulation.{what}"))
    kept = {*simulation.recorded, *simulation.recorded_at_end, *STATE, *WIDE}
    for name in simulation.scratch:
        if name in kept:
            yield f"Simulation.scratch must not have {name!r}, which is a result or recorded"
        elif name not in arrays:
            yield str(unknown_name("array", name, arrays, "in Simulation.scratch"))
    for name in RECORDED:
        if name not in simulation.recorded:
            yield f"Simulation.recorded must have {name!r}"


def _of_dimensions(world: World, simulation: Simulation) -> Iterator[str]:
    key, known = simulation.state.key, _known_sizes(world)
    named = dimensions_of(simulation)
    used = {name for names in named.values() for name in names}
    for name, size in simulation.sizes.items():
        if name in known:
            yield f"Simulation.sizes must not have {name!r}, which is {known[name]} in this world"
        elif name not in used:
            yield f"Simulation.sizes has {name!r}, which is not a dimension of an array of {key}"
        elif size < 1:
            yield f"Simulation.sizes[{name!r}] must be 1 or more, not {size!r}"
    for array, names in named.items():
        wanted = DIMENSIONS.get(array, ROBOTS)
        if array in (*STATE, *WIDE) and names != wanted:
            yield f"{key}.{array} must have the dimensions {', '.join(wanted)}"
        for name in names:
            if name not in known and name not in simulation.sizes:
                sizes = {*known, *simulation.sizes}
                yield str(unknown_name("dimension", name, sizes, f"in {key}.{array}"))


def _is_array_of(kind: Any, dtype: Any, ndim: int = 1) -> bool:
    is_right = wp.types.is_array(kind) and kind.ndim == ndim
    return is_right and wp.types.types_equal(kind.dtype, dtype)


def _of_scene(scene: Any) -> Iterator[str]:
    for name, var in scene.vars.items():
        if not wp.types.is_array(var.type):
            yield f"{scene.key}.{name} must be an array: it has a part for each scenario"
        elif not wp.types.type_is_scalar(var.type.dtype):
            yield f"{scene.key}.{name} must be an array of numbers"
    if "seed" in scene.vars and not _is_array_of(scene.vars["seed"].type, wp.uint64):
        yield f"{scene.key}.seed must be declared as 'seed: wp.array[wp.uint64]'"


def scenario_faults(scene: Any, scenarios: Any, n: int, example: Any = None) -> Iterator[str]:
    """Yield the faults of ``n`` scenarios: their arrays must be those of the scene.

    They must also have the shapes of an ``example`` of the same world, if given: a kernel relies on
    them.
    """
    kind = type(scenarios).__name__
    for name, var in scene.vars.items():
        values, alike = getattr(scenarios, name, None), getattr(example, name, None)
        each = 0 if var.type.ndim > 1 else 1  # where the shape of one scenario starts
        if not isinstance(values, np.ndarray):
            yield f"{kind} needs an array {name}, as {scene.key} has one"
            continue
        wanted = wp.dtype_to_numpy(var.type.dtype)
        if values.dtype != wanted:
            yield f"{kind}.{name} must be {np.dtype(wanted)} as in {scene.key}, not {values.dtype}"
        elif var.type.ndim > 1:
            if values.ndim != var.type.ndim:
                yield f"{kind}.{name} must have {var.type.ndim} dimensions, as in {scene.key}"
        elif values.shape[:1] != (n,):
            got = list(values.shape)
            yield f"{kind}.{name} must have a row for each of {n} scenarios, got shape {got}"
        if isinstance(alike, np.ndarray) and values.shape[each:] != alike.shape[each:]:
            got, there = list(values.shape[each:]), list(alike.shape[each:])
            yield f"{kind}.{name} has shape {got} in a scenario, and {there} in this world"
        elif var.type.ndim == 1 and values.dtype.kind == "f" and not np.isfinite(values).all():
            yield f"{kind}.{name} has values that are not finite"
