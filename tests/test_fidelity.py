"""The pages "method" and "fidelity" agree with the code: places, defaults, choices, examples.

The code is read, not run (ast), so that neither Warp nor a wrong import can hide a difference.
"""

from __future__ import annotations

import ast
import doctest
import re
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conevo.evolution import Layout, Scores, method

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "src" / "conevo"
PAGES = [ROOT / "docs" / name for name in ("method.md", "techniques.md", "fidelity.md")]
PLACE = re.compile(r"`([\w/.-]+\.(?:py|toml))(?:::([\w.-]+))?`")
CHOICE = re.compile(r"\bChoice(?: \([^)]*\))?:")
UNKNOWN = object()


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def find(name: str) -> Path:
    """Return the file of a place: below the package, or below the repository."""
    return next((base / name for base in (SOURCE, ROOT) if (base / name).is_file()), SOURCE / name)


def names_of(node: ast.stmt) -> list[str]:
    """Return the names that a statement defines."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
    return [target.id for target in targets if isinstance(target, ast.Name)]


def member(body: list[ast.stmt], name: str) -> ast.stmt | None:
    return next((node for node in body if name in names_of(node)), None)


@cache
def classes() -> dict[str, ast.ClassDef]:
    return {
        node.name: node
        for path in SOURCE.rglob("*.py")
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ClassDef)
    }


def inherited(owner: ast.ClassDef, name: str) -> ast.stmt | None:
    """Return a class' own or inherited member."""
    found = member(owner.body, name)
    for parent in owner.bases:
        if found is None and isinstance(parent, ast.Name) and parent.id in classes():
            found = inherited(classes()[parent.id], name)
    return found


def lookup(file: str, name: str | None) -> Any:
    """Return the statement or value at a place, UNKNOWN if it has none."""
    path = find(file)
    if not path.is_file():
        return UNKNOWN
    if path.suffix == ".toml":
        found: Any = tomllib.loads(path.read_text(encoding="utf-8"))
        for key in (name or "").split("."):
            found = found.get(key, UNKNOWN) if isinstance(found, dict) else UNKNOWN
        return found
    node: ast.stmt | ast.Module | None = parsed(path)
    for part in name.split(".") if name else []:
        if isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Dict):
            return literal(node.value).get(part, UNKNOWN)
        if isinstance(node, ast.ClassDef):
            node = inherited(node, part)
        else:
            node = member(getattr(node, "body", []), part)
    return UNKNOWN if node is None else node


def literal(node: ast.expr) -> Any:
    """Return the value of an expression: a literal, or one wrapped as ``wp.constant(value)``."""
    return ast.literal_eval(node.args[0] if isinstance(node, ast.Call) and node.args else node)


def default(found: Any) -> set[Any]:
    """Return the default of a field or constant, or those of a function's arguments."""
    if isinstance(found, ast.FunctionDef):
        return {literal(value) for value in found.args.defaults}
    if isinstance(found, ast.Assign | ast.AnnAssign) and found.value is not None:
        return {literal(found.value)}
    return set() if isinstance(found, ast.AST) else {found}


def tables(page: Path) -> list[list[dict[str, str]]]:
    """Return the page's tables as rows of header -> cell."""
    found: list[list[dict[str, str]]] = []
    header: list[str] = []
    for line in [*page.read_text(encoding="utf-8").splitlines(), ""]:
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not line.startswith("|"):
            header = []
        elif not header:
            header = cells
            found.append([])
        elif set(line) - set("|-: "):
            cells = [cell.strip() for cell in line.strip()[1:-1].split("|")]
            assert len(cells) == len(header), f"{page.name}: {line}"
            found[-1].append(dict(zip(header, cells, strict=True)))
    return found


def rows(*headers: str) -> list[dict[str, str]]:
    """Return all rows of the fidelity page's tables with these headers."""
    return [row for table in tables(PAGES[-1]) for row in table if set(headers) <= set(row)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_place_exists(page: Path) -> None:
    places = PLACE.findall(page.read_text(encoding="utf-8"))
    assert len(places) > 40
    missing = [place for place in places if lookup(place[0], place[1] or None) is UNKNOWN]
    assert missing == []


def test_every_default_is_the_codes() -> None:
    checked = 0
    for row in rows("Default"):
        values = [ast.literal_eval(text) for text in re.findall(r"`([^`]+)`", row["Default"])]
        places = PLACE.findall(row["Place"])
        assert len(values) <= len(places), row["Rule"]
        for value, (file, name) in zip(values, places, strict=False):
            assert value in default(lookup(file, name)), f"{file}::{name} is not {value!r}"
            checked += 1
    assert checked > 60


def test_every_rule_is_marked_and_every_choice_explained() -> None:
    found = rows("Mark")
    assert {row["Mark"] for row in found} == {"T", "D", "C"}
    for row in found:
        assert PLACE.search(row["Place"]), row["Rule"]
        assert row["Thesis"], row["Rule"]
        for column in ("Why", "Sensitivity"):
            assert bool(row[column]) == (row["Mark"] == "C"), f"{column} of: {row['Rule']}"


def enclosing(path: Path, line: int) -> str:
    """Return the place of a line: file and the innermost class, function or field around it."""
    node: Any = parsed(path)
    names: list[str] = []
    while node is not None:
        inside = [
            child
            for child in getattr(node, "body", [])
            if names_of(child) and child.lineno <= line <= (child.end_lineno or 0)
        ]
        node = inside[0] if inside else None
        names += names_of(node) if node is not None else []
    return "::".join([path.relative_to(SOURCE).as_posix(), *([".".join(names)] if names else [])])


def test_every_choice_in_the_code_is_on_the_page() -> None:
    in_code: Counter[str] = Counter()
    for path in sorted(SOURCE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        for hit in CHOICE.finditer(text):
            in_code[enclosing(path, text.count("\n", 0, hit.start()) + 1)] += 1
    on_page: Counter[str] = Counter()
    for row in rows("Choice"):
        place = row["Place"].strip("`")
        # A field described in the docstring of its class is a choice of the class.
        on_page[place if place in in_code else place.rpartition(".")[0]] += 1
        assert row["Why"], place
        assert row["Sensitivity"], place
    assert on_page == in_code


def test_note_1_energy_lasts() -> None:
    def value(name: str) -> float:
        (number,) = default(lookup("worlds/rover/world.py", f"RoverParams.{name}"))
        return float(number)

    costs = [value(f"{setting}_cost") for setting in ("low", "med", "hi")]
    most = value("rover_sensor_cost") + max(*costs, value("move_cost")) + value("report_cost")
    assert most == pytest.approx(0.4)
    assert most * value("iterations") == pytest.approx(value("energy"))


@pytest.mark.parametrize(("page", "least"), [(PAGES[0], 20), (PAGES[1], 8)])
def test_examples_run(page: Path, least: int) -> None:
    result = doctest.testfile(str(page), module_relative=False)
    assert result.attempted > least
    assert result.failed == 0


COSTS = next(t for t in tables(PAGES[0]) if "team evaluations per generation" in t[0])


@pytest.mark.parametrize("scheme", ["systematic", "shared"])
@pytest.mark.parametrize("row", COSTS, ids=lambda row: row["method"].strip("`"))
def test_team_evaluations_per_generation(row: dict[str, str], scheme: str) -> None:
    column = "team evaluations per generation"
    formula = row[column if scheme == "systematic" else 'with `evaluation="shared"`'].strip("`")
    sizes = {"R": 3, "u": 2, "M": 6, "K": 4, "L": 3}
    if formula == "–":
        assert row["populations"] == "1"
        return
    config: dict[str, Any] = {"genotypes": sizes["M"], "elite_portion": 0.5}
    if scheme == "shared":
        config |= {"evaluation": "shared", "rounds": sizes["K"]}
    learner = method(row["method"].strip("`"), **config)
    state = learner.init(Layout(n_robots=3, n_hidden=2, max_hidden=4, n_genes=5), root=1)
    while state.progress.generation < 1:
        trials = learner.ask(state)
        nothing = np.zeros(trials.teams.shape[:2])
        state = learner.tell(state, trials, Scores(nothing, nothing))
    assert state.progress.team_evaluations == eval(formula, {"__builtins__": {}}, sizes)
