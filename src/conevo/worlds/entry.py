"""Registry entries: the facts about a world that are known without loading it."""

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
    """One world in the registry.

    ``module`` contains the classes named ``params_name`` (parameters) and ``world_name`` (built
    from an environment name and parameters). ``defaults`` are those of an environment that differ
    from those of the class: environment -> parameter -> value. ``drawn`` is a module, imported
    without Warp, whose function ``playback`` draws an epoch, and whose ``CASTES`` are the colours
    of castes. Without it, the ``drawn`` of the world's class is used (``playback.drawn``).
    ``studied`` is a module, imported without Warp, that observes behaviours of robots beyond their
    actions (``study.WorldStudy``). ``product`` is the module that makes a file of a finished
    shaping in all of its ``TASKS``. An entry in a file outside the package leaves ``module`` out;
    ``worlds.outside`` fills it in, with the file's path, ``files`` (this one first, then the files
    next to it that it imports) and the digest of their texts.
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
        return self.name.rpartition("-v")[0] or self.name

    @property
    def params_class(self) -> type[Any]:
        """The dataclass of the world's parameters; it refuses values outside their bounds."""
        from conevo.parameters import checked

        return checked(getattr(import_module(self.module), self.params_name), "world")

    def params(self, environment: str, **given: Any) -> Any:
        """Return the parameters of an environment: the given ones, and its defaults.

        Raises:
            UsageError: an unknown parameter, or a value that is not allowed.
        """
        return self.params_class(**{**self.defaults.get(environment, {}), **given})

    @property
    def world_class(self) -> Any:
        """The class of its environments."""
        return getattr(import_module(self.module), self.world_name)

    def address(self, environment: str) -> str:
        """The address of an environment of this world, for ``resolve``."""
        return f"{self.file}:{environment}" if self.file else f"{self.name}/{environment}"

    def build(self, environment: str, params: Any) -> World:
        """Return one environment of this world.

        Raises:
            UsageError: parameters that are not allowed, or do not fit together, or a world without
                inputs or outputs.
        """
        part = self.params_class
        if not isinstance(params, part):  # a plain dataclass, which has not checked its values
            given = {one.name: getattr(params, one.name) for one in fields(params) if one.init}
            params = part(**given)
        built: World = self.world_class(environment, params)
        for name in ("inputs", "outputs"):
            if not hasattr(built, name):
                raise UsageError(f"world {built.name} needs {name}, a tuple of names, one of each")
        _ = measures_of(built)  # refuses invalid measures
        return built
