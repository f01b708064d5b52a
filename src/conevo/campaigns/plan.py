"""A campaign's plan: factors, levels and seeds, written out as a list of runs.

Every combination of the levels of its factors is a cell, and every cell is run with every seed.
``plan_file`` reads plans from files.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tomli_w
from annotated_types import Ge, Le, MinLen
from pydantic import StringConstraints

from conevo.campaigns.inputs import located, shown_as
from conevo.errors import UsageError, unknown_name
from conevo.evolution.inheritance import refuse_idle
from conevo.evolution.methods.registry import MethodEntry, name_in
from conevo.evolution.methods.registry import resolve as resolve_method
from conevo.runs.config import RunConfig
from conevo.runs.first import FIRST, SHARE, resolve_stages, take_first, without_method
from conevo.runs.layers import PRESETS, overridden, spelt_otherwise, split_keys
from conevo.runs.records import RunId
from conevo.runs.shaping import tasks_up_to
from conevo.worlds.registry import WorldEntry
from conevo.worlds.registry import resolve as resolve_world

__all__ = ["EFFECTS", "HEAD", "MOST_SEEDS", "Plan", "PlannedRun", "Where", "levels_of"]

MOST_RUNS = 100_000
MOST_SEEDS = 10_000
HEAD = ("name", "title", "produces", "seeds", "preset", "shape", "studies")
EFFECTS = ("shape", "settings", "factors")
Settings = dict[str, bool | int | float | str]
NAMING = ("world", "method", "overrides", "of_first")  # parts of a run that may name files


def levels_of(variant: str) -> dict[str, str]:
    """Return the level of each factor that a variant names: "gst=0.1, rounds=2"."""
    parts = re.split(r", (?=[A-Za-z_][\w.-]*=)", variant) if variant else []
    return {name: level for name, _, level in (part.partition("=") for part in parts)}


@dataclass(frozen=True)
class PlannedRun:
    """One run of a campaign, or one shaping: a line of ``runs.jsonl``.

    Attributes:
        label: its name in the campaign, and the name of its directory.
        world: address of the world and environment; of a shaping the last environment.
        method: address of the method.
        preset, seed: as for any run.
        variant: levels of all factors but world and method, "gst=0.1"; empty if there are none.
        overrides: settings that replace those of the preset, ``first`` and ``first_share`` among
            them.
        shape: whether the environments before this one are learned first.
        studies: made when the run is finished.
        run_ids: of the run, or of every stage.
        of_first: settings of the first stage, if another method evolves it (``runs.first``).
    """

    label: Annotated[str, StringConstraints(pattern=r"^[^/.\x00-\x1f][^/\x00-\x1f]*$")]
    world: str
    method: str
    preset: str
    seed: Annotated[int, Ge(0), Le(2**63 - 1)]
    variant: str
    overrides: Settings
    shape: bool
    studies: tuple[str, ...]
    run_ids: Annotated[tuple[RunId, ...], MinLen(1)]
    of_first: Settings = field(default_factory=dict)  # missing before conevo 0.2

    @property
    def values(self) -> list[Any]:
        """Its world, its method and its settings."""
        return _values_in([getattr(self, part) for part in NAMING])

    def mapped(self, change: Callable[[Any], Any]) -> PlannedRun:
        """Return the run with its world, its method and its settings changed."""
        parts = {part: _changed(getattr(self, part), change) for part in NAMING}
        return dataclasses.replace(self, **parts)

    @property
    def in_stages(self) -> bool:
        """Whether its directory is that of a shaping, with a run for every stage."""
        return len(self.run_ids) > 1

    @property
    def courses(self) -> dict[str, list[str]]:
        """The name in tables of the run, or of every stage, each with its directories in order.

        Two stages of one task, the first evolved by another method, are one run in tables.
        """
        if not self.in_stages:
            return {self.label: [self.label]}
        stages = [f"{self.label}/stage-{k}" for k in range(1, len(self.run_ids) + 1)]
        return {stage: [stage] for stage in stages} if self.shape else {self.label: stages}

    @property
    def tasks(self) -> list[str]:
        """World and environment of the run, or of every stage."""
        return tasks_up_to(self.world) if self.shape else [self.world]

    def configs(self) -> list[RunConfig]:
        """Return the configuration of the run, or of every stage.

        Raises:
            UsageError: they differ from those of the time when the plan was written out.
        """
        place = "in the campaign's plan"
        found = resolve_stages(
            self.tasks,
            self.method,
            self.preset,
            self.seed,
            self.overrides,
            self.of_first,
            place,
        )
        if tuple(config.run_id for config in found) != self.run_ids:
            raise UsageError(
                f"{self.label} was planned with other defaults or presets than this version's; "
                f"use the version the campaign was started with, or start another campaign"
            )
        return found


@dataclass(frozen=True)
class Where:
    """Settings of some runs.

    Attributes:
        conditions: "world", "method" or "preset" -> the names to which it applies.
        settings: key -> value.
        shape: whether they are shapings; None: as in the rest of the plan.
        factors: name -> levels, of these runs only.
    """

    conditions: dict[str, tuple[str, ...]]
    settings: dict[str, Any]
    shape: bool | None = None
    factors: dict[str, tuple[Any, ...]] = field(default_factory=dict)

    def applies(self, names: Mapping[str, str]) -> bool:
        """Whether it applies to a run with these names."""
        return all(names[key] in allowed for key, allowed in self.conditions.items())


@dataclass(frozen=True)
class Plan:
    """Factors, levels and seeds.

    Attributes:
        name: of the campaign.
        title: one line for people.
        produces: tables and figures of the thesis that are made from its data.
        seeds: of every cell.
        preset: scale of every run.
        shape: whether runs are shapings, unless ``where`` states otherwise.
        studies: made of finished runs.
        factors: name -> levels; "world" and "method" are among them.
        levels: name of a factor -> name of a level -> its settings, if a level has several.
        settings: of all runs.
        where: of some runs.
        place: where the plan was read, for error messages.
    """

    name: str
    title: str
    produces: tuple[str, ...]
    seeds: tuple[int, ...]
    preset: str
    shape: bool
    studies: tuple[str, ...]
    factors: dict[str, tuple[Any, ...]]
    settings: dict[str, Any]
    where: tuple[Where, ...] = ()
    levels: dict[str, dict[str, dict[str, Any]]] = field(default_factory=dict)
    place: str = field(default="in the plan", compare=False)

    def at(
        self,
        preset: str | None = None,
        seeds: int | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> Plan:
        """Return the plan with another scale, number of seeds or further settings.

        Raises:
            UsageError: an unknown preset, fewer than one seed, a setting that is given twice, or
                one that is a factor.
        """
        if preset is not None and preset not in PRESETS:
            raise unknown_name("preset", preset, PRESETS)
        if seeds is not None and not 1 <= seeds <= MOST_SEEDS:
            raise UsageError(f"--seeds {seeds}: a campaign has 1 to {MOST_SEEDS:,} seeds")
        split_keys(settings or {}, "on the command line", None)  # refuses one that is given twice
        given = {key: located(value, Path.cwd()) for key, value in (settings or {}).items()}
        for factor in [*self.factors, *(name for one in self.where for name in one.factors)]:
            if key := factor if factor in given else spelt_otherwise(factor, given):
                raise UsageError(f"--set {key}: {factor} is a factor {self.place}, with levels")
        forced = () if not given else (Where({}, given),)
        return dataclasses.replace(
            self,
            preset=preset or self.preset,
            seeds=self.seeds if seeds is None else tuple(range(1, seeds + 1)),
            where=self.where + forced,
        )

    @property
    def n_runs(self) -> int:
        """Number of runs."""
        return len(self._cells()) * len(self.seeds)

    def _cells(self) -> list[dict[str, Any]]:
        """Return every combination of levels, with those of factors that only some runs have."""
        found: list[dict[str, Any]] = []
        self._refuse_many(self.factors)
        for levels in _combinations(self.factors):
            names = {"world": levels["world"], "method": levels["method"], "preset": self.preset}
            own: dict[str, tuple[Any, ...]] = {}
            for one in self.where:
                own |= one.factors if one.applies(names) else {}
            self._refuse_many(own)
            found += [levels | more for more in _combinations(own)]
            self._refuse_many({"": tuple(found)})
        return found

    def _refuse_many(self, factors: Mapping[str, tuple[Any, ...]]) -> None:
        """Raise UsageError if a plan has more runs than a campaign may have."""
        n = math.prod(map(len, factors.values())) * len(self.seeds)
        if n > MOST_RUNS:
            raise UsageError(f"{n:,} runs {self.place}: a campaign has {MOST_RUNS:,} at most")

    def write_out(self) -> list[PlannedRun]:
        """Return every run, checked: seed by seed, so that an early stop leaves equal cells.

        Raises:
            UsageError: an unknown name or a value that is not allowed in any run.
        """
        cells = self._cells()
        worlds, methods = ({levels[name] for levels in cells} for name in ("world", "method"))
        self._refuse_namesakes("world", (resolve_world(one)[0] for one in sorted(worlds)))
        self._refuse_namesakes("method", map(resolve_method, sorted(methods)))
        written = [self._write_cell(levels) for levels in cells]
        runs = [run for same_seed in zip(*written, strict=True) for run in same_seed]
        labels = [run.label for run in runs]
        if twice := sorted(label for label, n in Counter(labels).items() if n > 1):
            raise UsageError(f"{twice[0]} {self.place} is planned twice: duplicate level or seed")
        return runs

    def _refuse_namesakes(self, kind: str, entries: Iterable[WorldEntry | MethodEntry]) -> None:
        """Refuse two worlds or methods of one name: results are identified by it."""
        files: dict[str, str] = {}
        for entry in entries:
            other = files.setdefault(entry.name, entry.file)
            if other != entry.file:
                raise UsageError(
                    f"{entry.name} {self.place} is the name of two {kind}s, {other} and "
                    f"{entry.file}: their ENTRY must have different names"
                )

    def _write_cell(self, levels: Mapping[str, Any]) -> list[PlannedRun]:
        """Return the runs of one combination of levels."""
        world, method = levels["world"], levels["method"]
        further = {k: v for k, v in levels.items() if k not in ("world", "method")}
        names = {"world": world, "method": method, "preset": self.preset}
        shape = self.shape
        for one in self.where:
            shape = one.shape if one.shape is not None and one.applies(names) else shape
        overrides = self._settings_of(names, further)
        own, first = take_first(overrides, self.place)
        of_first: dict[str, Any] = {}
        if first is not None:
            others = names | {"method": first.method}
            found = self._settings_of(others, further, resolve_method(method).config_class)
            of_first, _ = take_first(found, self.place)
        elif SHARE in further:
            raise UsageError(
                f"factor {SHARE} {self.place}: it does nothing in runs without {FIRST}"
            )
        if seed := {"seed", "run.seed"} & {*own, *of_first}:
            raise UsageError(f"{seed.pop()} {self.place}: a campaign's seeds are campaign.seeds")
        tasks = tasks_up_to(world) if shape else [world]
        configs = resolve_stages(tasks, method, self.preset, None, overrides, of_first, self.place)
        if first is None:
            refuse_idle(configs[-1].method_config, self.place)
        elif FIRST not in further:
            further = {FIRST: name_in(first.method), **further}
        variant = ", ".join(f"{k.rpartition('.')[2]}={shown_as(v)}" for k, v in further.items())
        address = configs[-1].address
        return [
            PlannedRun(
                label=_label(configs[-1], variant, seed),
                world=address,
                method=configs[-1].method_entry.address,
                preset=self.preset,
                seed=seed,
                variant=variant,
                overrides=overrides,
                shape=shape,
                studies=self.studies,
                run_ids=tuple(_with_seed(config, seed).run_id for config in configs),
                of_first=of_first,
            )
            for seed in self.seeds
        ]

    def _settings_of(
        self,
        names: Mapping[str, str],
        further: Mapping[str, Any],
        other: type[Any] | None = None,
    ) -> dict[str, Any]:
        """Return the settings of runs with these names and these levels of further factors.

        Args:
            names: world, method and preset.
            further: factor -> level.
            other: parameters of the runs' own method, if ``names`` has another one: what levels
                set of them is left out.
        """
        found = dict(self.settings)
        for one in self.where:
            found = overridden(found, one.settings) if one.applies(names) else found
        of_levels: dict[str, Any] = {}
        for factor, level in further.items():
            settings = self.levels[factor][level] if factor in self.levels else {factor: level}
            of_levels |= settings if other is None else without_method(settings, other)
        return overridden(found, of_levels)

    @property
    def values(self) -> list[Any]:
        """All levels and settings, and the names in conditions."""
        some = [vars(one) for one in self.where]
        return _values_in([self.factors, self.settings, self.levels, some])

    def mapped(self, change: Callable[[Any], Any]) -> Plan:
        """Return the plan with all levels, settings and names in conditions changed."""
        parts = {
            part: _changed(getattr(self, part), change)
            for part in ("factors", "levels", "settings")
        }
        where = tuple(Where(**_changed(vars(one), change)) for one in self.where)
        return dataclasses.replace(self, **parts, where=where)

    def to_toml(self) -> str:
        """Return the text that ``read_plan`` turns back into this plan."""
        where = [
            one.conditions
            | {k: v for k, v in vars(one).items() if k in EFFECTS and v not in (None, {})}
            for one in self.where
        ]
        tables = {
            "campaign": {key: getattr(self, key) for key in HEAD},
            "factors": self.factors,
            "settings": self.settings,
        }
        more = {"levels": self.levels, "where": where}
        return tomli_w.dumps(tables | {key: part for key, part in more.items() if part})


def _changed(part: Any, change: Callable[[Any], Any]) -> Any:
    """Return nested tables and lists with all values in them changed."""
    if isinstance(part, dict):
        return {key: _changed(value, change) for key, value in part.items()}
    if isinstance(part, list | tuple):
        return type(part)(_changed(value, change) for value in part)
    return change(part)


def _values_in(part: Any) -> list[Any]:
    """Return all values in nested tables and lists."""
    found: list[Any] = []
    _changed(part, found.append)
    return found


def _combinations(factors: Mapping[str, tuple[Any, ...]]) -> list[dict[str, Any]]:
    """Return every combination of the factors' levels."""
    return [dict(zip(factors, some, strict=True)) for some in itertools.product(*factors.values())]


def _with_seed(config: RunConfig, seed: int) -> RunConfig:
    return dataclasses.replace(config, run=dataclasses.replace(config.run, seed=seed))


def _label(config: RunConfig, variant: str, seed: int) -> str:
    """Return a readable directory name."""
    parts = [config.task.replace("/", "-"), config.method, *variant.split(", ")]
    text = "-".join(part for part in [*parts, f"s{seed}"] if part)
    return re.sub(r"[^A-Za-z0-9._=-]+", "_", text)
