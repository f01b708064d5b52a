"""The worlds there are: drives the command line, the docs tables and the contract tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError, unknown_name
from conevo.worlds.measures import measures_of

if TYPE_CHECKING:
    from conevo.worlds.protocol import World

__all__ = ["WORLDS", "WorldEntry", "colours_of", "inherited", "product_of", "resolve", "world"]


@dataclass(frozen=True)
class WorldEntry:
    """What the registry knows of a world without loading it.

    ``module`` holds the classes named ``params_name`` (parameters) and ``world_name`` (built from
    an environment name and parameters). ``drawn`` is the module whose ``playback`` tells what is to
    be drawn of an epoch, without Warp, and ``CASTES`` the colours of its castes; without it, what
    the world's class says in its own ``drawn`` is (``playback.drawn``). ``product`` is the module
    that makes a file of a finished shaping in all of its ``TASKS``. An entry in a file outside the
    package leaves it out; ``worlds.outside`` fills it in, with the file's path, ``files`` (this one
    first, then the files next to it that it imports) and the digest of their texts.
    """

    name: str
    title: str
    summary: str
    source: str
    environments: tuple[str, ...]
    params_name: str
    world_name: str
    module: str = ""
    drawn: str = ""
    product: str = ""
    file: str = ""
    files: tuple[str, ...] = ()
    digest: str = ""

    @property
    def short_name(self) -> str:
        """The name without its version, as in "rover"."""
        return self.name.rpartition("-v")[0]

    @property
    def params_class(self) -> type[Any]:
        """The dataclass of the world's parameters; it refuses what they do not allow."""
        from conevo.parameters import checked

        return checked(getattr(import_module(self.module), self.params_name), "world")

    @property
    def world_class(self) -> Any:
        """The class of its environments."""
        return getattr(import_module(self.module), self.world_name)

    def address(self, environment: str) -> str:
        """What ``resolve`` finds an environment of this world by."""
        return f"{self.file}:{environment}" if self.file else f"{self.name}/{environment}"

    def build(self, environment: str, params: Any) -> World:
        """Return one environment of this world.

        Raises:
            UsageError: parameters that are not allowed, or do not fit together, or a world without
                inputs or outputs.
        """
        part = self.params_class
        if not isinstance(params, part):  # of a plain dataclass, which has checked nothing
            given = {one.name: getattr(params, one.name) for one in fields(params) if one.init}
            params = part(**given)
        built: World = self.world_class(environment, params)
        for name in ("inputs", "outputs"):
            if not hasattr(built, name):
                raise UsageError(f"world {built.name} needs {name}, a tuple of names, one of each")
        _ = measures_of(built)  # refuses what are no measures
        return built


WORLDS: dict[str, WorldEntry] = {
    entry.name: entry
    for entry in (
        WorldEntry(
            name="rover-v1",
            title="Multi-rover",
            summary="20 rovers detect red rocks that only two of them together can detect",
            source="Nitschke 2009, chapter 5",
            environments=tuple(
                f"{kind}-{n}" for kind in ("simple", "complex", "extended") for n in range(1, 11)
            ),
            module="conevo.worlds.rover.world",
            drawn="conevo.worlds.rover.drawn",
            params_name="RoverParams",
            world_name="RoverWorld",
        ),
        WorldEntry(
            name="pursuit-v1",
            title="Pursuit-evasion",
            summary="2 to 6 Khepera predators immobilize one or two prey that are faster",
            source="Nitschke 2009, chapter 4",
            environments=tuple(f"team-{n}" for n in range(1, 11)),
            module="conevo.worlds.pursuit.world",
            drawn="conevo.worlds.pursuit.drawn",
            params_name="PursuitParams",
            world_name="PursuitWorld",
        ),
        WorldEntry(
            name="prey-v1",
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
            name="gacc-v1",
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


def resolve(path: str, digest: str = "", is_whole: bool = True) -> tuple[WorldEntry, str]:
    """Return the entry and environment of a path.

    Args:
        path: "rover/complex-1", "rover-v1/complex-1", or "FILE.py:ENVIRONMENT" for a world in a
            file outside the package.
        digest: of that file, checked if it is given.
        is_whole: whether the path must have an environment; the world's first one if it need not.

    Raises:
        UsageError: no such world or environment, or no environment given; a file that holds no
            world or has changed.
    """
    file, _, environment = path.rpartition(":")
    if path.endswith(".py"):
        file, environment = path, ""
    if file.endswith(".py"):
        from conevo.worlds.outside import load

        name, entry = file, load(Path(file), digest)
        example = f"{file}:{entry.environments[0]}"
    elif file or ".py/" in path or path.startswith(("/", ".")):
        raise UsageError(f"world {path!r}: a world in a file is named FILE.py:ENVIRONMENT")
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


def _named(name: str) -> WorldEntry:
    """Return the entry of a world of the package, the newest version if none is named."""
    newest = {entry.short_name: entry for entry in WORLDS.values()}
    entry = WORLDS.get(name) or newest.get(name)
    if entry is None:
        raise unknown_name("world", name, [*newest, *WORLDS])
    return entry


def colours_of(world: str) -> dict[str, str]:
    """Return the colours of a world's castes by its name; none of a world elsewhere."""
    entry = WORLDS.get(world) or next((e for e in WORLDS.values() if e.short_name == world), None)
    if entry is None or not entry.drawn:
        return {}
    return dict(import_module(entry.drawn).CASTES)


def product_of(tasks: Sequence[str]) -> Any:
    """Return the module that makes a file of a shaping in these tasks, None if there is none.

    Its ``FILE`` is the file's name, ``refuse`` raises UsageError at configurations it cannot use,
    ``save`` writes the file from the finished stages, and ``USE`` is a command with it, and why.
    """
    entry = WORLDS.get(tasks[0].partition("/")[0]) if tasks else None
    module = import_module(entry.product) if entry is not None and entry.product else None
    return module if module is not None and tuple(tasks) == module.TASKS else None


def inherited(world: World) -> str:
    """Return the name of the world of the package whose class a world's own inherits, or ""."""
    classes = {(one.__module__, one.__qualname__) for one in type(world).__mro__[1:]}
    for entry in WORLDS.values():
        if (entry.module, entry.world_name) in classes:
            return entry.name
    return ""


def world(path: str, **params: Any) -> World:
    """Return the world at a path, with parameters other than its defaults.

    The path is one that ``resolve`` knows: "rover/complex-1", or "FILE.py:ENVIRONMENT".

    Raises:
        UsageError: unknown world, environment or parameter, or a value that is not allowed.
    """
    entry, environment = resolve(path)
    return entry.build(environment, entry.params_class(**params))
