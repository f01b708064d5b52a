"""The configuration of a run: defaults, preset, TOML file, single settings.

Each layer overrides the previous one. A default lives in one place only: the field of its
component, or the world's entry for an environment with another one. Presets and files contain
overrides; every value has a place, which errors name.

A configuration file has four tables. ``[run]`` also has three names::

    [run]
    world = "rover-v2/complex-1"
    method = "cone"
    preset = "desk"
    seed = 1

    [world]
    iterations = 1250

    [controller]
    name = "srn"
    n_hidden = 8

    [method]
    genotypes = 20

Settings missing in ``[controller]`` are those that the world suggests, else the controller's
defaults. Its name is by default the one that the method asks for, else "srn". The world may be in a
file, ``world = "FILE.py:ENVIRONMENT"``, and so may the method, ``method = "FILE.py:NAME"``;
``world_digest`` and ``method_digest`` next to them are checked if they are given. Paths are
relative to the folder of the configuration file; a run has copies of the files (``runs.inputs``).
No preset has sizes for a method in a file: its own defaults apply.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from conevo.errors import UsageError, placed, shown
from conevo.runs.layers import (
    Layer,
    Value,
    as_layer,
    build,
    read_file,
    read_preset,
    section_of,
    split_keys,
)
from conevo.runs.outline import LENGTH, Outline, identify, outline_of
from conevo.runs.settings import (
    RunSettings,
    controller_of,
    refuse_contradiction,
    refuse_other_controller,
)

if TYPE_CHECKING:
    from conevo.controllers.protocol import Controller
    from conevo.evolution.methods.registry import MethodEntry
    from conevo.evolution.protocol import Method
    from conevo.worlds.protocol import World
    from conevo.worlds.registry import WorldEntry

__all__ = [
    "RunConfig",
    "resolve",
]

NAMES = {
    "world": "",
    "world_digest": "",
    "method": "cone",
    "method_digest": "",
    "preset": "desk",
}  # the keys of [run] that choose components
IN_FILES = ("world", "method")  # of NAMES, those that may be in a file outside the package


@dataclass(frozen=True)
class RunConfig:
    """A fully resolved run.

    ``world_params``, ``controller`` and ``method_config`` are the world's, the controller's and the
    method's own frozen dataclasses.
    ``changed`` lists the settings that differ from those of the preset and the environment, such as
    "run.generations", without the seed.
    """

    entry: WorldEntry
    environment: str
    method_entry: MethodEntry
    preset: str
    run: RunSettings
    world_params: Any
    controller: Controller
    method_config: Any
    changed: tuple[str, ...] = dataclasses.field(default=(), compare=False)

    @property
    def world(self) -> str:
        """The world's name with its version, "rover-v2"."""
        return self.entry.name

    @property
    def method(self) -> str:
        """The method's name, "cone"."""
        return self.method_entry.name

    @property
    def task(self) -> str:
        """World and environment in one name, "rover-v2/complex-1"."""
        return f"{self.world}/{self.environment}"

    @property
    def address(self) -> str:
        """The name with which ``resolve`` finds the same world: task, or "FILE.py:ENVIRONMENT"."""
        return self.entry.address(self.environment)

    def build_world(self) -> World:
        """Return the world of this run, which is built once.

        Raises:
            UsageError: the world refuses these parameters.
        """
        return self._world

    @functools.cached_property
    def _world(self) -> World:
        try:
            return self.entry.build(self.environment, self.world_params)
        except ValueError as error:  # of a world in a file
            raise UsageError(f"[world]: {error}") from error

    def build_method(self) -> Method:
        """Return the method of this run."""
        return self.method_entry.build(self.method_config)

    @functools.cached_property
    def run_id(self) -> str:
        """Twelve hex digits that change with any value but the preset's name.

        A file counts by its content: if a value has a digest next to it ("prey_digest"), the path
        does not count. Neither does the path of a world's or a method's file.
        """
        return identify(self.tables(), self.task)

    @functools.cached_property
    def stem_id(self) -> str:
        """As ``run_id``, without the length: runs that share it are equal while both continue."""
        return identify(self.tables(), self.task, without=("preset", *LENGTH))

    @property
    def outline(self) -> Outline:
        """Its task, method, preset, seed and length."""
        return outline_of(self.tables(), self.task)

    def of_length(self, length: Mapping[str, Any]) -> RunConfig:
        """Return the configuration of the same run with other values of ``LENGTH``.

        Raises:
            UsageError: a value that is not allowed; None is allowed for a target.
        """
        values = {k: v for k, v in (_set_fields(self.run) | dict(length)).items() if v is not None}
        layer = as_layer({"run": values}, "as the run's length")
        run = build("run", {"run": RunSettings}, [layer])
        built = {"run": run, "world": self.world_params, "controller": self.controller}
        built["method"] = self.method_config
        parts = {name: type(part) for name, part in built.items()}
        names = (self.preset, self.entry, self.environment, self.method_entry)
        base = read_preset(*names, self.controller.name)
        changed = tuple(_changed(parts, built, base, self.method_entry))
        return dataclasses.replace(self, run=run, changed=changed)

    @property
    def label(self) -> str:
        """A readable, unique directory name for this run."""
        task = self.task.replace("/", "-")
        return f"{task}-{self.method}-{self.preset}-s{self.run.seed}-{self.run_id[:6]}"

    def tables(self, folder: Path | None = None) -> dict[str, dict[str, Any]]:
        """Return the tables of the configuration file, every value spelt out.

        Args:
            folder: of that file; paths in it are relative, all others are absolute.
        """
        names = {"world": self.address}
        if self.entry.digest:
            names["world_digest"] = self.entry.digest
        names["method"] = self.method_entry.address
        if self.method_entry.digest:
            names["method_digest"] = self.method_entry.digest
        names["preset"] = self.preset
        tables = {
            "run": names | _set_fields(self.run),
            "world": _set_fields(self.world_params),
            "controller": {"name": self.controller.name} | _set_fields(self.controller),
            "method": _set_fields(self.method_config),
        }
        if folder is not None:
            for table in tables.values():
                for key in _files_of(table):
                    path = Path(table[key])
                    if path.is_relative_to(folder.resolve()):
                        table[key] = path.relative_to(folder.resolve()).as_posix()
        return tables

    def to_toml(self, folder: Path | None = None) -> str:
        """Return the text of a file from which ``resolve(file=...)`` makes this configuration.

        Args:
            folder: of that file.
        """
        return tomli_w.dumps(self.tables(folder))


def _files_of(table: Mapping[str, Any]) -> list[str]:
    """Return the keys of a table whose values are files: those with a digest next to them."""
    return [key.removesuffix("_digest") for key in table if key.endswith("_digest") and table[key]]


def resolve(
    world: str | None = None,
    method: str | None = None,
    preset: str | None = None,
    seed: int | None = None,
    file: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    place: str = "in overrides",
    folder: Path | None = None,
) -> RunConfig:
    """Return the configuration that results from all layers.

    Args:
        world: "rover/complex-1", or "FILE.py:ENVIRONMENT" for a world in a file; optional if the
            configuration file names one.
        method: "cone", or "FILE.py:NAME" for a method in a file; takes precedence over the
            configuration file, like ``preset`` and ``seed``.
        preset: name of the initial overrides.
        seed: root of all randomness.
        file: a configuration file, for example the ``config.toml`` of a run.
        overrides: single settings, "run.generations" -> 5; a key that only one section has may be
            written without its section.
        place: where ``overrides`` came from, for error messages.
        folder: of relative paths in ``world`` and ``overrides``, by default the working directory.

    Raises:
        UsageError: an unknown name or a value that is not allowed; a world, method, preset or
            seed that ``overrides`` also has; a preset without effect, since the file has all its
            settings; nothing has been written.
        EnvironmentFailure: the file cannot be read.
    """
    from conevo.controllers.registry import find, refuse_misfit
    from conevo.evolution.methods.registry import resolve as resolve_method
    from conevo.worlds.registry import resolve as resolve_world

    layers: list[Layer] = [read_file(Path(file))] if file is not None else []
    if not isinstance(overrides, Mapping | None):
        raise UsageError(f"overrides = {overrides!r:.60}: must be a dict of settings")
    given = dict(overrides or {})
    single, short = split_keys(given, place, folder)
    if world is not None:
        world = Value(world, place, folder).as_file
    if method is not None:
        method = Value(method, place, folder).as_file
    for name, asked in (("world", world), ("method", method), ("preset", preset), ("seed", seed)):
        if asked is not None and (twice := single.get("run", {}).get(name)):
            raise UsageError(
                f"run.{name} = {shown(twice.value)} {twice.place}: the {name} is given as {asked}"
            )
    own_preset = layers[0].get("run", {}).get("preset") if layers else None
    names, places = _take_names(
        [*layers, single], {"world": world, "method": method, "preset": preset}
    )
    if not names["world"]:
        named = "" if file is None else f"{file} names none: give run.world there, or n"
        raise UsageError(
            f"which world? {named or 'N'}ame one as WORLD/ENVIRONMENT, for example rover/complex-1"
        )
    with placed("run.world", places.get("world")):
        entry, environment = resolve_world(names["world"], names["world_digest"])
    with placed("run.method", places.get("method")):
        method_entry = resolve_method(names["method"], names["method_digest"])
    by_default = controller_of(method_entry)
    controller, controller_place = _take_controller([*layers, single], by_default)
    with placed("controller.name", controller_place):
        controller_class = find(controller).settings_class
    refuse_other_controller(method_entry, controller, controller_place)
    parts: dict[str, type] = {
        "run": RunSettings,
        "world": entry.params_class,
        "controller": controller_class,
        "method": method_entry.config_class,
    }
    for key, value in short.items():
        single.setdefault(section_of(key, parts, place), {})[key] = value
    if seed is not None:
        single.setdefault("run", {})["seed"] = Value(seed, "as the seed")
    with placed("run.preset", places.get("preset")):
        base = read_preset(names["preset"], entry, environment, method_entry, controller)
    if own_preset is not None and names["preset"] != own_preset.value:
        _refuse_label(names["preset"], base, layers[0], own_preset.place)
    built = {name: build(name, parts, [base, *layers, single]) for name in parts}
    config = RunConfig(
        entry=entry,
        environment=environment,
        method_entry=method_entry,
        preset=names["preset"],
        run=built["run"],
        world_params=built["world"],
        controller=built["controller"],
        method_config=built["method"],
        changed=tuple(_changed(parts, built, base, method_entry)),
    )
    built_world = config.build_world()  # refuses parameters that do not fit together
    refuse_misfit(config.controller, built_world)
    refuse_contradiction(config.run, config.method_config, built_world.n_robots)
    return config


def _take_names(
    layers: list[Layer], asked: Mapping[str, str | None]
) -> tuple[dict[str, str], dict[str, str]]:
    """Remove the names from the layers' [run] tables; return the last of each and their places."""
    names, places = dict(NAMES), {}
    for layer in layers:
        given = {name: layer.get("run", {}).pop(name, None) for name in NAMES}
        for name in IN_FILES:
            key = f"{name}_digest"
            if (digest := given[key]) is not None and given[name] is None:
                raise UsageError(f"run.{key} {digest.place}: it needs run.{name} next to it")
            names[key] = names[key] if given[name] is None else ""  # it belongs to another file
        for name, found in given.items():
            if found is not None and not isinstance(found.value, str):
                raise UsageError(f"run.{name} = {shown(found.value)} {found.place}: must be a name")
            if found is not None:
                names[name] = found.as_file if name in IN_FILES else found.value
                places[name] = found.place
    names |= {f"{name}_digest": "" for name in IN_FILES if asked[name] is not None}
    chosen = {name: value for name, value in asked.items() if value is not None}
    return names | chosen, {name: places[name] for name in places.keys() - chosen.keys()}


def _take_controller(layers: list[Layer], default: str) -> tuple[str, str]:
    """Remove the name from the layers' [controller] tables; return the last one and its place."""
    name, place = default, ""
    for layer in layers:
        found = layer.get("controller", {}).pop("name", None)
        if found is not None and not isinstance(found.value, str):
            raise UsageError(
                f"controller.name = {shown(found.value)} {found.place}: must be a name"
            )
        if found is not None:
            name, place = found.value, found.place
    return name, place


def _refuse_label(preset: str, base: Layer, file: Layer, place: str) -> None:
    """Raise UsageError if the configuration file has all settings of a preset."""
    if all(key in file.get(section, {}) for section in base for key in base[section]):
        raise UsageError(
            f"preset {preset!r} would change only the run's label: every value that it sets "
            f"is already set {place}; leave the preset out, or remove those values from the file"
        )


def _changed(
    parts: Mapping[str, type], built: Mapping[str, Any], base: Layer, method: MethodEntry
) -> Iterator[str]:
    """Yield the settings that differ from the preset's, without the seed and digests."""
    for section, part in parts.items():
        preset = base.get(section, {})
        if section == "controller" and built[section].name != controller_of(method):
            yield "controller.name"
        for field in dataclasses.fields(part):
            plain = preset[field.name].value if field.name in preset else field.default
            is_own = field.name != "seed" and not field.name.endswith("_digest")
            if is_own and getattr(built[section], field.name) != plain:
                yield f"{section}.{field.name}"


def _set_fields(part: Any) -> dict[str, Any]:
    """Return a dataclass' fields without those that are None (TOML has no such value)."""
    return {key: value for key, value in dataclasses.asdict(part).items() if value is not None}
