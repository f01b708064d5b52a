"""What a user sees of the package before any robot moves: imports, start-up time, names, files."""

from __future__ import annotations

import inspect
import re
import statistics
import subprocess
import sys
import time
import tomllib
from importlib import metadata, resources
from pathlib import Path

import grimp
import pytest

import conevo

ROOT = Path(__file__).resolve().parent.parent
SOURCES = sorted((ROOT / "src" / "conevo").rglob("*.py"))
HEAVY = {"duckdb", "matplotlib", "numpy", "pandas", "pydantic", "ray", "scipy", "torch", "warp"}


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run this interpreter as a user would, outside the checkout's folder of sources."""
    return subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, check=True, timeout=60
    )


@pytest.mark.parametrize("statement", ["import conevo", "import conevo.cli.main"])
def test_import_is_light(statement: str) -> None:
    code = f"import sys; {statement}; print(*sorted({{m.split('.')[0] for m in sys.modules}}))"
    loaded = set(python("-c", code).stdout.split())
    assert "conevo" in loaded
    assert loaded & HEAVY == set()


def test_a_run_needs_no_plotting_and_no_statistics_library() -> None:
    code = (
        "import sys, conevo; [getattr(conevo, n) for n in conevo.__all__];"
        "import conevo.worlds.rollout, conevo.runs.loop;"
        "print(*sorted({m.split('.')[0] for m in sys.modules}))"
    )
    loaded = set(python("-c", code).stdout.split())
    assert "numpy" in loaded
    assert loaded & {"matplotlib", "pandas", "scipy"} == set()


@pytest.mark.timing
def test_help_appears_within_300_ms() -> None:
    seconds = []
    for _ in range(6):
        began = time.perf_counter()
        shown = python("-m", "conevo", "--help").stdout
        seconds.append(time.perf_counter() - began)
        assert "resume" in shown
    assert statistics.median(seconds[1:]) < 0.3  # the first one may still write bytecode


def test_public_names_are_few_and_documented() -> None:
    assert 1 <= len(conevo.__all__) <= 20
    assert len(set(conevo.__all__)) == len(conevo.__all__)
    assert set(conevo.__all__) <= set(dir(conevo))
    undocumented = [
        name
        for name in conevo.__all__
        if (callable(getattr(conevo, name)) or inspect.ismodule(getattr(conevo, name)))
        and not own_docstring(getattr(conevo, name))
    ]
    assert undocumented == []


def own_docstring(thing: object) -> str:
    """A docstring somebody wrote: not inherited, not the one dataclasses make up."""
    text = getattr(thing, "__doc__", None) or ""
    return "" if text.startswith(f"{getattr(thing, '__name__', '')}(") else text.strip()


def test_unknown_public_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="evolv_"):
        conevo.evolv_  # noqa: B018


def test_version_is_the_one_of_pyproject() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert metadata.version("conevo") == project["version"]
    assert project["version"] in python("-m", "conevo", "--version").stdout
    assert f"## {project['version']}" in (ROOT / "CHANGELOG.md").read_text()
    assert f"version: {project['version']}\n" in (ROOT / "CITATION.cff").read_text()


def test_the_installed_package_has_every_file_of_the_source() -> None:
    """Data files reach the wheel; ``py.typed`` tells type checkers that conevo is typed."""
    installed = Path(str(resources.files("conevo")))
    here = ROOT / "src" / "conevo"
    wanted = {p.relative_to(here) for p in here.rglob("*") if p.is_file()}
    wanted = {p for p in wanted if "__pycache__" not in p.parts}
    assert Path("py.typed") in wanted
    assert {p.suffix for p in wanted} >= {".npz", ".py", ".toml"}
    assert {p for p in wanted if not (installed / p).is_file()} == set()


def test_no_source_file_is_over_500_lines() -> None:
    lengths = {p.relative_to(ROOT).as_posix(): len(p.read_text().splitlines()) for p in SOURCES}
    assert len(lengths) > 20
    assert {name: n for name, n in lengths.items() if n > 500} == {}


def test_no_module_is_named_for_leftovers() -> None:
    leftovers = {"utils", "util", "common", "helpers", "base", "misc"}
    names = {p.stem for p in SOURCES} | {p.parent.name for p in SOURCES}
    assert names & leftovers == set()


def test_no_pickle_and_no_global_random_state() -> None:
    """House rules: data on disk is npz and JSON; randomness has an address."""
    forbidden = re.compile(
        r"^\s*(import|from) (pickle|cloudpickle|dill|joblib|random)\b"
        r"|allow_pickle=True|np\.random\.(seed|default_rng|rand)\b",
        re.MULTILINE,
    )
    found = {p.relative_to(ROOT).as_posix(): m[0] for p in SOURCES if (m := search(forbidden, p))}
    assert found == {}


def test_no_tracked_file_names_a_registry_or_a_machine() -> None:
    """What is committed must mean the same on every machine."""
    listed = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "-z"], capture_output=True, text=True, check=False
    )
    if listed.returncode != 0:
        pytest.skip("not a git checkout")
    tracked = [ROOT / name for name in listed.stdout.split("\0") if name]
    assert len(tracked) > 20
    # Spelt in pieces, so that this file does not find itself.
    machine = "|".join("/" + name + "/" for name in ("home", "root", "work", "opt", "Users"))
    registry = "|".join(
        name + end
        for name, end in (
            ("pypi", r"\.org"),
            ("files", r"\.pythonhosted"),
            ("--(extra-)?index", "-url"),
            ("registry", r"\.npm"),
        )
    )
    pattern = re.compile(rf"(?<![\w.~$}}-])({machine})[\w.]|{registry}")
    found = {p.relative_to(ROOT).as_posix(): m[0] for p in tracked if (m := search(pattern, p))}
    assert found == {}


def search(pattern: re.Pattern[str], path: Path) -> re.Match[str] | None:
    """The first hit of a pattern in a text file; pictures and arrays have none."""
    if path.suffix in {".gif", ".npz", ".pdf", ".png"} or not path.is_file():
        return None
    return pattern.search(path.read_text(encoding="utf-8"))


def test_no_module_imports_one_that_imports_it() -> None:
    """Neither directly nor by others, within functions included; for type checkers it may."""
    graph = grimp.build_graph("conevo", exclude_type_checking_imports=True, cache_dir=None)
    rest = {name: set(graph.find_modules_directly_imported_by(name)) for name in graph.modules}
    while free := {name for name, imported in rest.items() if not imported & rest.keys()}:
        rest = {name: imported for name, imported in rest.items() if name not in free}
    in_circles = {name for name in rest if any(name in rest[other] for other in rest)}
    assert in_circles == set()


# What is left to be renamed. Names of kernels' structs stay: the digest of a kernel has them.
HOMONYMS: dict[str, set[str]] = {}


def test_a_class_is_found_by_its_name() -> None:
    """One word, one thing: no two classes have the same name."""
    found: dict[str, set[str]] = {}
    package = ROOT / "src" / "conevo"
    for path in SOURCES:
        for name in re.findall(r"^class (\w+)", path.read_text(), re.MULTILINE):
            found.setdefault(name, set()).add(path.relative_to(package).as_posix())
    assert {name: files for name, files in found.items() if len(files) > 1} == HOMONYMS
