"""What is known of a world without loading it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from importlib import import_module
from typing import TYPE_CHECKING, Any

from conevo.errors import UsageError
from conevo.worlds.measures import measures_of

if TYPE_CHECKING:
    from conevo.worlds.protocol import World

__all__ = ["WorldEntry"]


@dataclass(frozen=True)
class WorldEntry:
    """What the registry knows of a world without loading it.

    ``module`` holds the classes named ``params_name`` (parameters) and ``world_name`` (built from
    an environment name and parameters). ``defaults`` are those of an environment where they are not
    those of the class: environment -> parameter -> value. ``drawn`` is the module whose
    ``playback`` tells what is to be drawn of an epoch, without Warp, and ``CASTES`` the colours of
    its castes; without it, what the world's class says in its own ``drawn`` is
    (``playback.drawn``). ``studied`` is the module that tells what robots are seen to do besides
    their actions (``study.WorldStudy``), its import without Warp. ``product`` is the module that
    makes a file of a finished shaping in all of its ``TASKS``. An entry in a file outside the
    package leaves ``module`` out; ``worlds.outside`` fills it in, with the file's path, ``files``
    (this one first, then the files next to it that it imports) and the digest of their texts.
    """

    name: str
    title: str
    summary: str
    source: str
    environments: tuple[str, ...]
    params_name: str
    world_name: str
    defaults: Mapping[str, Mapping[str, Any]] = field(default_factory=dict, hash=False)
    module: str = ""
    drawn: str = ""
    studied: str = ""
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

    def params(self, environment: str, **given: Any) -> Any:
        """Return the parameters of an environment: those given, and its defaults.

        Raises:
            UsageError: an unknown parameter, or a value that is not allowed.
        """
        return self.params_class(**{**self.defaults.get(environment, {}), **given})

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
