"""The outline of a run, read from its files alone: no world or method is loaded.

So a run can be shown on any machine, quickly, and without executing a world's file.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from conevo.errors import UsageError
from conevo.evolution.methods.registry import name_in, remember_title
from conevo.reading import DamagedFile, parse_toml
from conevo.terms import quoted

__all__ = [
    "LENGTH",
    "Outline",
    "budget_of",
    "digest_of",
    "flattened",
    "identify",
    "outline_of",
    "read_outline",
    "span",
]

Tables = Mapping[str, Mapping[str, Any]]
NAMES = ("world", "method", "preset")
LENGTH = ("generations", "budget_evaluations", "target")  # the keys of [run] that end a run
NUMBERS = {"seed": 0, "generations": 1, "budget_evaluations": 0}  # name -> smallest


@dataclass(frozen=True)
class Outline:
    """The task, method, preset, seed and length of a run.

    Attributes:
        task: world and environment, "rover-v2/complex-1".
        method, preset, seed: from its configuration.
        generations: number of planned generations.
        budget_evaluations: most team evaluations, 0 for no limit.
    """

    task: str
    method: str
    preset: str
    seed: int
    generations: int
    budget_evaluations: int

    @property
    def environment(self) -> str:
        """Name of the environment, "complex-1"."""
        return self.task.rpartition("/")[2]


def identify(tables: Tables, task: str, without: Collection[str] = ("preset",)) -> str:
    """Return twelve hex digits that change with any value in the tables of a configuration.

    A file counts by its content: where a value has a digest next to it ("prey_digest"), the path
    does not count. Neither does that of a world's file, for which ``task`` stands, nor that of a
    method's file.

    Args:
        tables: every value spelt out.
        task: world and environment.
        without: keys of ``[run]`` that do not count.
    """
    found = {section: dict(table) for section, table in tables.items()}
    names = {"world": task, "method": name_in(found["run"]["method"])}
    found["run"] = {k: v for k, v in found["run"].items() if k not in without} | names
    for section in ("world", "method"):
        table = found[section]
        for key in [key for key in table if key.endswith("_digest") and table[key]]:
            table.pop(key.removesuffix("_digest"), None)
    text = json.dumps(found, sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=6).hexdigest()


def digest_of(content: bytes) -> str:
    """Return the digest of a file's content, by which an unchanged one is known at once."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def flattened(tables: Tables) -> dict[str, Any]:
    """Return the settings in tables by their names: "method.gst" -> 0.2."""
    return {f"{part}.{key}": table[key] for part, table in tables.items() for key in table}


def outline_of(tables: Tables, task: str = "", place: str = "config.toml") -> Outline:
    """Return the outline in the tables of a configuration.

    Args:
        tables: those of a run; ``[run]`` is enough.
        task: where it is known; else it is the world's address, without the folder of a file.
        place: where they were read, for messages.

    Raises:
        DamagedFile: something is missing or not what it should be.
    """
    run = tables.get("run")
    if not isinstance(run, Mapping):
        raise DamagedFile(f"{place} is damaged: it has no table [run]")
    for name in NAMES:
        if not isinstance(run.get(name), str):
            raise DamagedFile(f"{place} is damaged: run.{name} must be text")
    for name, least in NUMBERS.items():
        if type(run.get(name)) is not int or not least <= run[name] < 2**63:
            raise DamagedFile(f"{place} is damaged: run.{name} must be a whole number from {least}")
    address = run["world"]
    known = task or (PurePath(address).name if ".py:" in address else address)
    method = name_in(run["method"])
    return Outline(known, method, run["preset"], *(run[name] for name in NUMBERS))


def read_outline(content: bytes, provenance: Mapping[str, Any], place: str) -> Outline:
    """Return the outline of a run, after checking that its configuration is the one it was made of.

    Args:
        content: of its config.toml.
        provenance: of the run.
        place: path of config.toml, for messages.

    Raises:
        UsageError: the configuration was changed, or is damaged.
    """
    if about := provenance.get("method"):
        remember_title(about["name"], about["title"])
    header = provenance.get("world")
    task = f"{header['name']}/{header['environment']}" if header else ""
    text = content.decode("utf-8", "replace")
    if provenance.get("config_digest") == digest_of(content):
        # [run] comes first; the whole file takes five times as long to parse.
        return outline_of(parse_toml(text.partition("\n[world]\n")[0], place), task, place)
    tables = parse_toml(text, place)
    outline = outline_of(tables, task, place)
    is_own_file = ".py:" in tables["run"]["world"]
    if not {"world", "method"} <= tables.keys() or (
        (task or not is_own_file) and identify(tables, outline.task) != provenance.get("run_id")
    ):
        raise UsageError(
            f"{place} was changed after the run was started; start another run with "
            f"'conevo run --config {quoted(place)} --out DIR'"
        )
    return outline


def budget_of(stages: Iterable[Outline]) -> int:
    """Return the team evaluations that all stages may spend together, 0 without a limit."""
    budgets = [one.budget_evaluations for one in stages]
    return sum(budgets) if all(budgets) else 0


def span(tasks: Sequence[str]) -> str:
    """Return the tasks of a run or shaping in short: "rover-v2/complex-1 to complex-3"."""
    last = re.split("[/:]", tasks[-1])[-1]
    return tasks[0] if tasks[0] == tasks[-1] else f"{tasks[0]} to {last}"
