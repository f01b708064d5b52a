"""Plans as TOML files, and those that come with conevo: the thesis' experiments.

A plan is a TOML file. Every combination of the levels of its factors is a cell, and every cell is
run with every seed::

    [campaign]
    title = "Multi-rover, complex environments"
    produces = ["figure 5.6"]      # tables and figures of the thesis
    seeds = 20                     # 1 to 20; or a list of seeds
    preset = "desk"                # scale; the command line wins
    shape = false                  # true: every run learns the environments 1 to N in stages
    studies = ["teams"]            # made of every finished run; also "signal"; [] for none

    [factors]
    world = ["rover/complex-1..10"]
    method = ["homcne", "cone"]
    "method.rounds" = [5, 10]      # any setting may be a factor

    [settings]                     # of all runs, over those of the preset
    "run.budget_evaluations" = 20000

    [[where]]                      # of the runs that meet all conditions; later ones win
    method = ["ccga", "mesp", "cone"]
    preset = "desk"
    settings = { "method.n_elitist" = 5 }
    # shape = true                 # also here, for some of the runs

    [[where]]                      # a factor of some runs only
    method = ["cone"]
    factors = { "method.gst" = [0.1, 0.2], ranges = ["small", "large"] }

    [[where]]                      # two stages of one task, the first of another method; they share
    method = ["ccga"]              # the run's budget: half each by default, else see first_share
    factors = { first = ["none", "homcne"] }   # as every factor, it may also be a setting

    [levels.ranges]                # a factor whose levels are several settings
    small = { "world.low_range" = 0.07, "world.hi_range" = 0.03 }
    large = { "world.low_range" = 0.2, "world.hi_range" = 0.1 }
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from conevo.campaigns.inputs import located
from conevo.campaigns.plan import EFFECTS, HEAD, MOST_SEEDS, Plan, Where
from conevo.errors import UsageError, shown, unknown_name
from conevo.evolution.methods.registry import METHODS
from conevo.reading import parse_toml, read_toml
from conevo.runs.first import FIRST
from conevo.runs.layers import PRESETS
from conevo.worlds.registry import resolve as resolve_world

__all__ = ["STUDIES", "preset_names", "read_plan", "read_preset"]

STUDIES = ("teams", "signal")
TABLES = ("campaign", "factors", "levels", "settings", "where")
CONDITIONS = ("world", "method", "preset")
KINDS = {str: "text", bool: "true or false", list: "a list of texts"}
T = TypeVar("T")
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
RANGE = re.compile(r"(.*-)(\d+)\.\.(\d+)")


def preset_names() -> list[str]:
    """Return the names of the plans that come with conevo: the thesis' experiments."""
    folder = resources.files(__package__) / "presets"
    return sorted(
        p.name.removesuffix(".toml") for p in folder.iterdir() if p.name.endswith(".toml")
    )


def read_preset(name: str) -> Plan:
    """Return a plan that comes with conevo.

    Raises:
        UsageError: none has this name.
    """
    if name not in preset_names():
        raise unknown_name("campaign", name, preset_names())
    source = resources.files(__package__) / "presets" / f"{name}.toml"
    place = f"campaign {name!r}"
    return _parse(parse_toml(source.read_text(encoding="utf-8"), place), f"in {place}", name)


def read_plan(path: Path) -> Plan:
    """Return the plan in a file; its name is the file's by default.

    Names of files, of worlds, methods and prey, are relative to its folder.

    Raises:
        UsageError: it is not a plan; the message names the key and what is allowed.
        EnvironmentFailure: it cannot be read.
    """
    plan = _parse(read_toml(path), f"in {path}", path.stem)
    return plan.mapped(lambda value: located(value, path.parent))


def _parse(tables: Mapping[str, Any], place: str, name: str) -> Plan:
    for key in tables:
        if key not in TABLES:
            raise unknown_name("section", key, TABLES, place)
    head = _table(tables, "campaign", place)
    for key in head:
        if key not in HEAD:
            raise unknown_name("key", f"campaign.{key}", [f"campaign.{k}" for k in HEAD], place)
    preset = _checked(head.get("preset", "desk"), str, "campaign.preset", place)
    if preset not in PRESETS:
        raise unknown_name("preset", preset, PRESETS, place)
    shape = _checked(head.get("shape", False), bool, "campaign.shape", place)
    studies = _texts(head.get("studies", ["teams"]), "campaign.studies", place)
    for study in studies:
        if study not in STUDIES:
            raise unknown_name("study", study, STUDIES, place)
    wheres = tables.get("where", [])
    if not isinstance(wheres, list):
        raise UsageError(f"where {place} must be written [[where]]")
    every_run = {"world": [], "method": []} | _table(tables, "factors", place)
    factors = _factors(every_run, "factors", place)
    firsts = _firsts(tables)
    where = tuple(_where(one, factors, firsts, place) for one in wheres)
    return Plan(
        name=_name(head.get("name", name), place),
        title=_line(head.get("title", ""), "campaign.title", place),
        produces=_texts(head.get("produces", []), "campaign.produces", place),
        seeds=_seeds(head.get("seeds", 20), place),
        preset=preset,
        shape=shape,
        studies=studies,
        factors=factors,
        levels=_levels(tables, [factors, *(one.factors for one in where)], place),
        settings=_table(tables, "settings", place),
        where=where,
        place=place,
    )


def _table(tables: Mapping[str, Any], key: str, place: str, named: str = "") -> dict[str, Any]:
    found = tables.get(key, {})
    if not isinstance(found, dict):
        raise UsageError(f"{named or key} {place} must be a table")
    return found


def _name(value: Any, place: str) -> str:
    name = _checked(value, str, "campaign.name", place)
    if not NAME.fullmatch(name):
        raise UsageError(
            f"campaign.name = {shown(name)} {place}: "
            f"letters, digits and . _ - only, it names a folder"
        )
    return name


def _line(value: Any, key: str, place: str) -> str:
    text = _checked(value, str, key, place)
    if not text.isprintable():
        raise UsageError(f"{key} = {shown(text)} {place}: must be one line of printable characters")
    return text


def _checked(value: Any, kind: type[T], key: str, place: str) -> T:
    if not isinstance(value, kind):
        raise UsageError(f"{key} = {shown(value)} {place}: must be {KINDS[kind]}")
    return value


def _texts(value: Any, key: str, place: str) -> tuple[str, ...]:
    return tuple(_checked(one, str, key, place) for one in _checked(value, list, key, place))


def _seeds(value: Any, place: str) -> tuple[int, ...]:
    if type(value) is int and 1 <= value <= MOST_SEEDS:
        return tuple(range(1, value + 1))
    is_list = isinstance(value, list) and 1 <= len(value) <= MOST_SEEDS
    if not is_list or any(type(seed) is not int or not 0 <= seed < 2**63 for seed in value):
        raise UsageError(
            f"campaign.seeds = {shown(value)} {place}: must be a number from 1 to {MOST_SEEDS:,}, "
            f"or a list of at most that many seeds"
        )
    return tuple(value)


def _factors(table: Mapping[str, Any], key: str, place: str) -> dict[str, tuple[Any, ...]]:
    factors: dict[str, tuple[Any, ...]] = {}
    for name, levels in table.items():
        if not isinstance(levels, list) or not levels:
            raise UsageError(f"{key}.{name} {place}: must be a list of at least one level")
        if name in ("world", "method"):
            levels = _expand(_texts(levels, f"{key}.{name}", place))
        elif any(isinstance(level, (list, dict)) for level in levels):
            raise UsageError(f"{key}.{name} {place}: levels are numbers, texts, true or false")
        factors[name] = tuple(levels)
    return factors


def _levels(
    tables: Mapping[str, Any], factors: Iterable[Mapping[str, tuple[Any, ...]]], place: str
) -> dict[str, dict[str, dict[str, Any]]]:
    """Return the settings of named levels: factor -> level -> settings."""
    used = [(name, level) for table in factors for name in table for level in table[name]]
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for factor in _table(tables, "levels", place):
        key = f"levels.{factor}"
        if factor in ("world", "method") or not NAME.fullmatch(factor) or "." in factor:
            raise UsageError(
                f"{key} {place}: a factor with named levels needs its own name, of letters, "
                f"digits, _ and -"
            )
        if factor not in [name for name, _ in used]:
            raise UsageError(f"{key} {place}: the plan has no factor {factor!r}")
        named = found[factor] = {}
        for level in _table(tables["levels"], factor, place, key):
            if not NAME.fullmatch(level):
                raise UsageError(f"{key}.{level} {place}: letters, digits and . _ - only")
            named[level] = _table(tables["levels"][factor], level, place, f"{key}.{level}")
        for name, level in used:
            if name == factor and level not in named:
                raise unknown_name(f"level of {factor}", str(level), named, place)
    return found


def _expand(names: Iterable[str]) -> list[str]:
    """Turn "rover/complex-1..10" into ten names."""
    found: list[str] = []
    for name in names:
        if match := RANGE.fullmatch(name):
            stem, first, last = match.groups()
            if max(len(first), len(last)) > 3:
                raise UsageError(f"{shown(name)}: the numbers of a range have three digits at most")
            if int(first) > int(last):
                raise UsageError(f"{shown(name)}: a range starts with its smaller number")
            found += [f"{stem}{k}" for k in range(int(first), int(last) + 1)]
        else:
            found.append(name)
    return found


def _firsts(value: Any, key: str = "") -> list[str]:
    """Return every value of the setting ``first``, and level of a factor, anywhere in a plan."""
    if isinstance(value, dict):
        return [one for name, part in value.items() for one in _firsts(part, name)]
    if isinstance(value, list):
        return [one for part in value for one in _firsts(part, key)]
    return [value] if key == FIRST and isinstance(value, str) else []


def _where(table: Any, of_all: Mapping[str, Any], firsts: Sequence[str], place: str) -> Where:
    """Return one [[where]].

    Args:
        table: as written.
        of_all: the factors of all runs, which it may not repeat.
        firsts: methods of first stages, which conditions may name, too.
        place: where it is, for messages.
    """
    if not isinstance(table, dict):
        raise UsageError(f"where {place} must be written [[where]]")
    conditions: dict[str, tuple[str, ...]] = {}
    for key, value in table.items():
        if key in EFFECTS:
            continue
        if key not in CONDITIONS:
            raise unknown_name("condition", f"where.{key}", [*CONDITIONS, *EFFECTS], place)
        allowed = [value] if isinstance(value, str) else value
        conditions[key] = tuple(_expand(_texts(allowed, f"where.{key}", place)))
    for key, known in (("method", METHODS), ("preset", PRESETS)):
        for name in conditions.get(key, ()):
            if name not in known and not (key == "method" and ".py:" in name):
                raise unknown_name(f"where.{key}", name, known, place)
    for name in conditions.get("world", ()):
        if name not in of_all["world"] and ".py" not in name:
            resolve_world(name)  # a condition on a world that does not exist is a mistake
    for key in ("world", "method"):
        names = conditions.get(key)
        planned = [*of_all[key], *(firsts if key == "method" else ())]
        if names is not None and not any(n in planned or ".py" in n for n in names):
            raise UsageError(
                f"where.{key} = {shown(list(names))} {place} matches no run: factors.{key} is "
                f"{', '.join(of_all[key])}"
            )
    shape = _checked(table["shape"], bool, "where.shape", place) if "shape" in table else None
    factors = _factors(_table(table, "factors", place), "where.factors", place)
    if twice := sorted(factors.keys() & of_all.keys()):
        raise UsageError(f"where.factors.{twice[0]} {place}: [factors] has {twice[0]} for all runs")
    return Where(conditions, _table(table, "settings", place), shape, factors)
