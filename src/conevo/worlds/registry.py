"""The worlds by name, for the command line, the docs tables and the contract tests."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError, unknown_name
from conevo.worlds.entry import WorldEntry
from conevo.worlds.families import FAMILIES, is_task
from conevo.worlds.rover import rocks
from conevo.worlds.study import load_study

if TYPE_CHECKING:
    from conevo.worlds.protocol import World
    from conevo.worlds.study import WorldStudy

__all__ = [
    "WORLDS",
    "WorldEntry",
    "colours_of",
    "entry_of",
    "inherited",
    "product_of",
    "refuse_earlier",
    "resolve",
    "studies",
    "study_of",
    "world",
]


WORLDS: dict[str, WorldEntry] = {
    entry.name: entry
    for entry in (
        WorldEntry(
            name="rover-v2",
            title="Multi-rover",
            summary="20 rovers detect red rocks that only two of them together can detect",
            source="Nitschke 2009, chapter 5",
            environments=rocks.ENVIRONMENTS,
            defaults=rocks.DEFAULTS,
            module="conevo.worlds.rover.world",
            drawn="conevo.worlds.rover.drawn",
            params_name="RoverParams",
            world_name="RoverWorld",
        ),
        WorldEntry(
            name="pursuit-v2",
            title="Pursuit-evasion",
            summary="2 to 6 Khepera predators immobilize one or two prey that are faster",
            source="Nitschke 2009, chapter 4",
            environments=tuple(f"team-{n}" for n in range(1, 11)),
            module="conevo.worlds.pursuit.world",
            drawn="conevo.worlds.pursuit.drawn",
            studied="conevo.worlds.pursuit.study.predators",
            params_name="PursuitParams",
            world_name="PursuitWorld",
        ),
        WorldEntry(
            name="prey-v2",
            title="Prey shaping",
            summary="one or two prey learn to run fast and straight without a collision",
            source="Nitschke 2009, section 4.3",
            environments=tuple(f"shaping-{n}" for n in range(1, 7)),
            module="conevo.worlds.pursuit.prey",
            drawn="conevo.worlds.pursuit.drawn",
            product="conevo.worlds.pursuit.evolved",
            params_name="PreyParams",
            world_name="PreyWorld",
        ),
        WorldEntry(
            name="gacc-v2",
            title="Gathering and collective construction",
            summary="30 robots gather objects of three types and build with them in order",
            source="Nitschke 2009, chapter 6",
            environments=tuple(f"simple-{n}" for n in range(1, 11))
            + tuple(f"complex-{n}" for n in range(1, 10)),
            module="conevo.worlds.gacc.world",
            drawn="conevo.worlds.gacc.drawn",
            params_name="GaccParams",
            world_name="GaccWorld",
        ),
    )
}

# Versions that are still drawn and reported but no longer played, and the release that plays them.
EARLIER = dict.fromkeys(("rover-v1", "pursuit-v1", "prey-v1", "gacc-v1"), "0.1.0")


def resolve(path: str, digest: str = "", is_whole: bool = True) -> tuple[WorldEntry, str]:
    """Return the entry and environment of a path.

    Args:
        path: "rover/complex-1", "rover-v2/complex-1", "FILE.py:ENVIRONMENT" for a world in a file
            outside the package, or "FAMILY:TASK" for a task of another package.
        digest: of that file, checked if it is given.
        is_whole: whether the path must have an environment; the world's first one if it need not.

    Raises:
        UsageError: no such world or environment, or no environment given; a file without a world,
            or one that has changed.
    """
    if is_task(path):
        return _task(path, digest)
    _refuse_near_task(path)
    file, _, environment = path.rpartition(":")
    if path.endswith(".py"):
        file, environment = path, ""
    if file.endswith(".py"):
        from conevo.worlds.outside import load

        name, entry = file, load(Path(file), digest)
        if entry.name in WORLDS:
            raise UsageError(
                f"world file {file}: its name {entry.name!r} is that of a world of the package"
            )
        example = f"{file}:{entry.environments[0]}"
    elif file or ".py/" in path or path.startswith(("/", ".")):
        families = ", ".join(f"{one}:TASK" for one in FAMILIES)
        raise UsageError(
            f"world {path!r}: a world in a file is named FILE.py:ENVIRONMENT, a task of another "
            f"package {families}"
        )
    else:
        name, _, environment = path.partition("/")
        entry = _named(name)
        example = f"{entry.short_name}/{entry.environments[0]}"
        if digest:
            raise UsageError(f"run.world_digest belongs to a world in a file, not to {path!r}")
    if not environment and is_whole:
        raise UsageError(f"world {name!r} needs an environment, as in {example}")
    environment = environment or entry.environments[0]
    if environment not in entry.environments:
        raise unknown_name("environment", environment, entry.environments, f"of world {name!r}")
    return entry, environment


def _task(path: str, digest: str) -> tuple[WorldEntry, str]:
    """Return the entry of a task of another package, and its name."""
    family, _, task = path.partition(":")
    if digest:
        raise UsageError(f"run.world_digest belongs to a world in a file, not to {path!r}")
    entry: WorldEntry = import_module(FAMILIES[family]).entry(task)
    return entry, entry.environments[0]


def _refuse_near_task(path: str) -> None:
    """Raise UsageError if a path is nearly that of a task of another package."""
    family, slash, task = path.partition("/")
    if slash and family in FAMILIES:
        raise UsageError(f"world {path!r}: a task of {family} is named {family}:{task}")
    family, colon, _ = path.partition(":")
    if colon and ".py" not in path and get_close_matches(family, FAMILIES, n=1, cutoff=0.6):
        raise unknown_name("family of tasks", family, FAMILIES)


def _named(name: str) -> WorldEntry:
    """Return the entry of a world of the package, the newest version if none is named."""
    newest = {entry.short_name: entry for entry in WORLDS.values()}
    refuse_earlier(name)
    entry = WORLDS.get(name) or newest.get(name)
    if entry is None:
        raise unknown_name("world", name, [*newest, *WORLDS])
    return entry


def refuse_earlier(task: str, run: Path | None = None) -> None:
    """Raise UsageError if a task, of a run if given, belongs to a version no longer played."""
    name = task.partition("/")[0]
    if name in EARLIER and (newest := entry_of(name)):
        raise UsageError(
            f"{f'{run}: ' if run else ''}this version of conevo plays {newest.name}, no longer "
            f"{name}; conevo {EARLIER[name]} plays {name}"
        )


def entry_of(world: str) -> WorldEntry | None:
    """Return the entry of a world of the package by its name, the newest one for any version.

    It serves drawings and reports, which are the same for all versions.
    """
    short = world.rpartition("-v")[0] if world in EARLIER else world
    return WORLDS.get(world) or next((e for e in WORLDS.values() if e.short_name == short), None)


def colours_of(world: str) -> dict[str, str]:
    """Return the colours of a world's castes by its name; none for a world in a file."""
    entry = entry_of(world)
    if entry is None:
        return {}
    if entry.drawn:
        return dict(import_module(entry.drawn).CASTES)
    known = getattr(getattr(entry.world_class, "drawn", None), "colours", {})
    return {name: known[name] for name in entry.world_class.castes if name in known}


def product_of(tasks: Sequence[str]) -> Any:
    """Return the module that makes a file of a shaping in these tasks, None without one.

    ``FILE`` is the file's name. ``refuse`` raises UsageError for configurations that it cannot use,
    ``save`` writes the file from the finished stages, and ``USE`` is a command that uses it, with
    its purpose.
    """
    entry = WORLDS.get(tasks[0].partition("/")[0]) if tasks else None
    module = import_module(entry.product) if entry is not None and entry.product else None
    return module if module is not None and tuple(tasks) == module.TASKS else None


def inherited(world_class: type) -> str:
    """Return the name of the package's world from which a world's class inherits, or ""."""
    classes = {(one.__module__, one.__qualname__) for one in world_class.__mro__[1:]}
    for entry in WORLDS.values():
        if (entry.module, entry.world_name) in classes:
            return entry.name
    return ""


def study_of(entry: WorldEntry) -> WorldStudy | None:
    """Return the study of a world, its own or that of the one it inherits, None if none.

    Raises:
        UsageError: the module named in its entry is not a study.
    """
    like = "" if entry.studied else inherited(entry.world_class)
    module = WORLDS[like].studied if like else entry.studied
    return load_study(like or entry.name, module) if module else None


def studies() -> dict[str, WorldStudy]:
    """Return all studies by the names of their worlds."""
    studied = {entry.name: entry.studied for entry in WORLDS.values() if entry.studied}
    return {name: load_study(name, module) for name, module in studied.items()}


def world(path: str, **params: Any) -> World:
    """Return the world at a path, with parameters other than the defaults of its environment.

    The path is one for ``resolve``: "rover/complex-1", or "FILE.py:ENVIRONMENT".

    Raises:
        UsageError: unknown world, environment or parameter, or a value that is not allowed.
    """
    entry, environment = resolve(path)
    return entry.build(environment, entry.params(environment, **params))
