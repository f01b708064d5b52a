"""What a run is, settled before it starts: component defaults, preset, TOML file, single settings.

Each layer overrides the one before. A default lives in one place only: the field of the component
it belongs to. Presets and files hold overrides, and every value remembers where it came from, so
that a wrong one can be named with its place.

A configuration file has three tables. ``[run]`` also holds the three names::

    [run]
    world = "rover-v1/complex-1"
    method = "cone"
    preset = "desk"
    seed = 1

    [world]
    iterations = 1250

    [method]
    genotypes = 20

The world may be one in a file of its own, ``world = "FILE.py:ENVIRONMENT"``; ``world_digest`` next
to it is checked when it is given. A file is named from the folder of the configuration file; a run
has copies of its own (``runs.inputs``).

Presets (``presets/*.toml``) hold the same three tables, with ``method`` split by method, for any
world; a world's own table replaces that one. A variant ("cone-1") takes its family's values
("cone") first, then its own::

    [any.run]
    [any.method.cone]
    [rover.world]
    [pursuit.run]
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import tomli_w
from annotated_types import Ge, Le
from pydantic import TypeAdapter, ValidationError

from conevo.errors import UsageError, shown, unknown_name
from conevo.reading import DamagedFile, parse_toml, read_toml
from conevo.runs.outline import LENGTH, Outline, identify, outline_of

if TYPE_CHECKING:
    from conevo.worlds.protocol import World
    from conevo.worlds.registry import WorldEntry

__all__ = [
    "PRESETS",
    "RunConfig",
    "RunSettings",
    "parse_assignment",
    "parse_assignments",
    "resolve",
]

PRESETS = ("smoke", "desk", "night", "thesis")
SECTIONS = ("run", "world", "method")
NAMES = {
    "world": "",
    "world_digest": "",
    "method": "cone",
    "preset": "desk",
}  # the keys of [run] that choose components
LEAST, MOST = 1e-18, 1e18  # sizes of numbers whose squares a kernel can hold
ANY = "any"  # the table of a preset for worlds without one of their own


@dataclass(frozen=True)
class RunSettings:
    """How long and on how much evidence to evolve; belongs to no world and no method.

    Defaults are those of the multi-rover experiments (Nitschke 2009, table 5.5).

    Attributes:
        seed: root of all randomness of the run.
        generations: the run ends after this many.
        epochs: simulated trials per team evaluation (q); all teams of a generation meet the same.
        fittest_epochs: simulated trials in which each generation's fittest team is evaluated once
            more. Choice: as many as the thesis' q, and the same in all generations, so that
            progress and the champion of a run are not a matter of lucky scenarios.
        credit: "robot" gives each robot its own fitness as the world reports it (eq. 5.4, 6.8);
            "team" gives every robot the sum over the team (eq. 5.5).
        budget_evaluations: the run never spends more team evaluations than this; 0 is no limit.
        target: the run ends when the fittest team's main task performance is as good as this: at
            least, or, of a measure of which smaller is better, at most.
        checkpoint_every: generations between two checkpoints.
        n_finalists: the fittest teams of the run, which are validated at its end. Choice: 10, as
            the thesis says nothing of how a run's best team is found. 1 leaves the choice to the
            scenarios of the evolution phase.
        n_validations: scenarios in which finalists are validated. Choice: 20, as many as tests.
        n_tests: fresh scenarios of the testing phase (5.4: 20).
    """

    seed: Annotated[int, Ge(0), Le(2**63 - 1)] = 1
    generations: Annotated[int, Ge(1), Le(10_000_000)] = 250
    epochs: Annotated[int, Ge(1), Le(10_000)] = 10
    fittest_epochs: Annotated[int, Ge(1), Le(10_000)] = 10
    credit: Literal["robot", "team"] = "robot"
    budget_evaluations: Annotated[int, Ge(0), Le(2**63 - 1)] = 0
    target: float | None = None
    checkpoint_every: Annotated[int, Ge(1), Le(10_000_000)] = 1
    n_finalists: Annotated[int, Ge(1), Le(1000)] = 10
    n_validations: Annotated[int, Ge(1), Le(10_000)] = 20
    n_tests: Annotated[int, Ge(1), Le(10_000)] = 20


@dataclass(frozen=True)
class RunConfig:
    """A fully resolved run.

    ``world_params`` and ``method_config`` are the world's and the method's own frozen dataclasses.
    ``changed`` names the settings that are not as the preset has them, "run.generations"; the seed
    is none of them.
    """

    entry: WorldEntry
    environment: str
    method: str
    preset: str
    run: RunSettings
    world_params: Any
    method_config: Any
    changed: tuple[str, ...] = dataclasses.field(default=(), compare=False)

    @property
    def world(self) -> str:
        """The world's name with its version, "rover-v1"."""
        return self.entry.name

    @property
    def task(self) -> str:
        """World and environment in one name, "rover-v1/complex-1"."""
        return f"{self.world}/{self.environment}"

    @property
    def address(self) -> str:
        """What ``resolve`` finds the same world by: the task, or "FILE.py:ENVIRONMENT"."""
        return self.entry.address(self.environment)

    def build_world(self) -> World:
        """Return the world of this run."""
        return self.entry.build(self.environment, self.world_params)

    @functools.cached_property
    def run_id(self) -> str:
        """Twelve hex digits that change with any value but the preset's name.

        A file counts by its content: where a value has a digest beside it ("prey_digest"), the
        path does not count. Neither does that of a world's file.
        """
        return identify(self.tables(), self.task)

    @functools.cached_property
    def stem_id(self) -> str:
        """As ``run_id``, but for the length: runs that share it are alike while both go on."""
        return identify(self.tables(), self.task, without=("preset", *LENGTH))

    @property
    def outline(self) -> Outline:
        """What names the run."""
        return outline_of(self.tables(), self.task)

    def of_length(self, length: Mapping[str, Any]) -> RunConfig:
        """Return the configuration of a run that is the same but for values of ``LENGTH``.

        Raises:
            UsageError: a value that is not allowed; None is allowed for a target.
        """
        values = {k: v for k, v in (_set_fields(self.run) | dict(length)).items() if v is not None}
        layer = _as_layer({"run": values}, "as the run's length")
        run = _build("run", RunSettings, [layer])
        built = {"run": run, "world": self.world_params, "method": self.method_config}
        parts = {name: type(part) for name, part in built.items()}
        base = _read_preset(self.preset, self.world, self.method)
        changed = tuple(_changed(parts, built, base))
        return dataclasses.replace(self, run=run, changed=changed)

    @property
    def label(self) -> str:
        """A readable, unique directory name for this run."""
        task = self.task.replace("/", "-")
        return f"{task}-{self.method}-{self.preset}-s{self.run.seed}-{self.run_id[:6]}"

    def tables(self, folder: Path | None = None) -> dict[str, dict[str, Any]]:
        """Return the three tables of the configuration file, every value spelt out.

        Args:
            folder: of that file; files in it are named from there, others by their whole path.
        """
        world = {"world": self.address}
        if self.entry.digest:
            world["world_digest"] = self.entry.digest
        names = {"method": self.method, "preset": self.preset}
        tables = {
            "run": world | names | _set_fields(self.run),
            "world": _set_fields(self.world_params),
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
        """Return the text that ``resolve(file=...)`` turns back into this configuration.

        Args:
            folder: of the file that it is written to.
        """
        return tomli_w.dumps(self.tables(folder))


def _files_of(table: Mapping[str, Any]) -> list[str]:
    """Return the keys of a table whose values are files: those with a digest next to them."""
    return [key.removesuffix("_digest") for key in table if key.endswith("_digest") and table[key]]


@dataclass(frozen=True)
class _Value:
    """A value and the place it was read from; a file is named from ``folder``."""

    value: Any
    place: str
    folder: Path | None = None

    @property
    def as_file(self) -> Any:
        """The value if it is the name of a file, "prey.npz" or "FILE.py:ENVIRONMENT"."""
        text = self.value
        if self.folder is None or not isinstance(text, str):
            return text
        name = text.rpartition(":")[0] if ".py:" in text else text
        is_file = Path(name).suffix or ("/" in name and (self.folder / name).is_file())
        return str(self.folder / text) if is_file else text


Layer = dict[str, dict[str, _Value]]  # section -> key -> value


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
    """Return the one configuration that all layers together describe.

    Args:
        world: "rover/complex-1", or "FILE.py:ENVIRONMENT" for a world in a file of its own; may be
            left out if the configuration file names it.
        method: wins over the file's, as the next two do.
        preset: whose overrides to begin with.
        seed: root of all randomness.
        file: a configuration file, for example the ``config.toml`` of a run.
        overrides: single settings, "run.generations" -> 5; a key that only one section has may be
            written without its section.
        place: where ``overrides`` came from, for error messages.
        folder: from which ``world`` and ``overrides`` name files, by default the working directory.

    Raises:
        UsageError: an unknown name or a value that is not allowed; a world, method, preset or
            seed that ``overrides`` has, too; a preset that would change nothing, as the file sets
            all that it does; nothing has been written.
        EnvironmentFailure: the file cannot be read.
    """
    from conevo.evolution.methods.registry import METHODS
    from conevo.worlds.registry import resolve as resolve_world

    layers: list[Layer] = [_read_file(Path(file))] if file is not None else []
    given = dict(overrides or {})
    single, short = _split_keys(given, place, folder)
    if world is not None:
        world = _Value(world, place, folder).as_file
    for name, asked in (("world", world), ("method", method), ("preset", preset), ("seed", seed)):
        if asked is not None and (twice := single.get("run", {}).get(name)):
            raise UsageError(
                f"run.{name} = {shown(twice.value)} {twice.place}: the {name} is given as {asked}"
            )
    own_preset = layers[0].get("run", {}).get("preset") if layers else None
    names = _take_names([*layers, single], {"world": world, "method": method, "preset": preset})
    if not names["world"]:
        named = "" if file is None else f"{file} names none: give run.world there, or n"
        raise UsageError(
            f"which world? {named or 'N'}ame one as WORLD/ENVIRONMENT, for example rover/complex-1"
        )
    entry, environment = resolve_world(names["world"], names["world_digest"])
    if names["method"] not in METHODS:
        raise unknown_name("method", names["method"], METHODS)
    parts: dict[str, type] = {
        "run": RunSettings,
        "world": entry.params_class,
        "method": METHODS[names["method"]].config_class,
    }
    for key, value in short.items():
        single.setdefault(_section_of(key, parts, place), {})[key] = value
    if seed is not None:
        single.setdefault("run", {})["seed"] = _Value(seed, "as the seed")
    base = _read_preset(names["preset"], entry.name, names["method"])
    if own_preset is not None and names["preset"] != own_preset.value:
        _refuse_label(names["preset"], base, layers[0], own_preset.place)
    built = {name: _build(name, part, [base, *layers, single]) for name, part in parts.items()}
    try:
        entry.build(environment, built["world"])
    except ValueError as error:
        raise UsageError(f"[world]: {error}") from error
    return RunConfig(
        entry=entry,
        environment=environment,
        method=names["method"],
        preset=names["preset"],
        run=built["run"],
        world_params=built["world"],
        method_config=built["method"],
        changed=tuple(_changed(parts, built, base)),
    )


def parse_assignment(text: str) -> tuple[str, Any]:
    """Return key and value of "key=value"; the value is TOML, or else plain text.

    Raises:
        UsageError: there is no "=".
    """
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise UsageError(f"--set {text!r}: expected key=value, for example run.generations=5")
    try:
        return key.strip(), parse_toml(f"value = {value}", "a value")["value"]
    except DamagedFile:
        return key.strip(), value.strip()


def parse_assignments(texts: Iterable[str]) -> dict[str, Any]:
    """Return the settings of several "key=value".

    Raises:
        UsageError: one has no "=", or two set the same key.
    """
    found: dict[str, Any] = {}
    for text in texts:
        key, value = parse_assignment(text)
        if key in found:
            raise UsageError(f"--set {text!r}: {key} is set twice")
        found[key] = value
    return found


def _read_file(path: Path) -> Layer:
    return _as_layer(read_toml(path), f"in {path}", path.resolve().parent)


def _as_layer(tables: Mapping[str, Any], place: str, folder: Path | None = None) -> Layer:
    layer: Layer = {}
    for section, values in tables.items():
        if section not in SECTIONS:
            raise unknown_name("section", section, SECTIONS, place)
        if not isinstance(values, Mapping):
            raise UsageError(f"{section} {place} must be a table: [{section}]")
        layer[section] = {key: _Value(value, place, folder) for key, value in values.items()}
    return layer


def _split_keys(
    given: Mapping[str, Any], place: str, folder: Path | None
) -> tuple[Layer, dict[str, _Value]]:
    """Separate settings with a section from short ones."""
    dotted: Layer = {}
    short: dict[str, _Value] = {}
    for key, value in given.items():
        section, dot, name = key.partition(".")
        if not dot:
            short[key] = _Value(value, place, folder)
        elif section not in SECTIONS:
            raise unknown_name("section", section, SECTIONS, f"in {key!r} {place}")
        elif name in given:
            raise UsageError(f"{key} {place}: the same setting is given as {name}, too")
        else:
            dotted.setdefault(section, {})[name] = _Value(value, place, folder)
    return dotted, short


def _take_names(layers: list[Layer], asked: Mapping[str, str | None]) -> dict[str, str]:
    """Remove the names from the layers' [run] tables and return those that hold."""
    names = dict(NAMES)
    for layer in layers:
        given = {name: layer.get("run", {}).pop(name, None) for name in NAMES}
        if given["world_digest"] is not None and given["world"] is None:
            place = given["world_digest"].place
            raise UsageError(f"run.world_digest {place}: it needs run.world next to it")
        if given["world"] is not None:
            names["world_digest"] = ""  # of another world
        for name, found in given.items():
            if found is not None and not isinstance(found.value, str):
                raise UsageError(f"run.{name} = {shown(found.value)} {found.place}: must be a name")
            if found is not None:
                names[name] = found.as_file if name == "world" else found.value
    if asked["world"] is not None:
        names["world_digest"] = ""
    return names | {name: value for name, value in asked.items() if value is not None}


def _refuse_label(preset: str, base: Layer, file: Layer, place: str) -> None:
    """Raise UsageError if a preset would set nothing that the configuration file does not set."""
    if all(key in file.get(section, {}) for section in base for key in base[section]):
        raise UsageError(
            f"preset {preset!r} would change nothing but the run's label: every value that it sets "
            f"is already set {place}; leave the preset out, or remove those values from the file"
        )


def _changed(parts: Mapping[str, type], built: Mapping[str, Any], base: Layer) -> Iterator[str]:
    """Yield the settings that are not as the preset has them, without the seed and digests."""
    for section, part in parts.items():
        preset = base.get(section, {})
        for field in dataclasses.fields(part):
            plain = preset[field.name].value if field.name in preset else field.default
            is_own = field.name != "seed" and not field.name.endswith("_digest")
            if is_own and getattr(built[section], field.name) != plain:
                yield f"{section}.{field.name}"


def _section_of(key: str, parts: Mapping[str, type], place: str) -> str:
    """Return the only section that has ``key``."""
    known = {name: [f.name for f in dataclasses.fields(part)] for name, part in parts.items()}
    homes = [name for name in known if key in known[name]]
    if len(homes) > 1:
        options = " or ".join(f"{home}.{key}" for home in homes)
        raise UsageError(f"key {key!r} {place} is ambiguous: write {options}")
    if not homes:
        raise unknown_name("key", key, [key for keys in known.values() for key in keys], place)
    return homes[0]


def _read_preset(preset: str, world: str, method: str) -> Layer:
    """Return what a preset says about this world and method."""
    if preset not in PRESETS:
        raise unknown_name("preset", preset, PRESETS)
    source = resources.files(__package__) / "presets" / f"{preset}.toml"
    worlds = parse_toml(source.read_text(encoding="utf-8"), f"preset {preset!r}")
    generic, own = dict(worlds[ANY]), dict(worlds.get(world.rsplit("-v", 1)[0], {}))
    by_method = generic.pop("method") | own.pop("method", {})
    family = method.split("-")[0]
    if not {family, method} & set(by_method):
        raise UsageError(f"preset {preset!r} has no settings for method {method!r} in {world!r}")
    tables = generic | own
    tables["method"] = by_method.get(family, {}) | by_method.get(method, {})
    return _as_layer(tables, f"in preset {preset!r}")


def _build(section: str, part: Any, layers: Iterable[Layer]) -> Any:
    """Return the component's dataclass with the layers' values over its defaults."""
    hints = get_type_hints(part, include_extras=True)
    values: dict[str, Any] = {}
    for layer in layers:
        for key, given in layer.get(section, {}).items():
            if key not in hints:
                known = [f"{section}.{name}" for name in hints]
                raise unknown_name("key", f"{section}.{key}", known, given.place)
            if f"{key}_digest" in hints:
                given = dataclasses.replace(given, value=given.as_file)
            values[key] = _check(f"{section}.{key}", hints[key], given)
    try:
        return part(**values)
    except ValueError as error:
        raise UsageError(f"[{section}]: {error}") from error


def _check(name: str, hint: Any, given: _Value) -> Any:
    """Return the value as the type asks for it, or say what is allowed."""
    problem = f"must be finite, and 0 or between {LEAST:g} and {MOST:g} in size"
    number = given.value if isinstance(given.value, float) else 0.0
    if number == 0 or LEAST <= abs(number) <= MOST:
        try:
            return TypeAdapter(hint).validate_python(given.value, strict=True)
        except ValidationError as error:
            problem = error.errors()[0]["msg"].replace("Input should be", "must be")
    raise UsageError(f"{name} = {shown(given.value)} {given.place}: {problem}")


def _set_fields(part: Any) -> dict[str, Any]:
    """Return a dataclass' fields without those that are None (TOML has no such value)."""
    return {key: value for key, value in dataclasses.asdict(part).items() if value is not None}
