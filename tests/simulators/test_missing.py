"""A task that cannot be had is refused in one line, without torch; a test's extra is required."""

from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.simulators import tasks
from conevo.simulators.jaxmarl import world as jaxmarl_family
from conevo.simulators.vmas import world as family
from conevo.worlds.registry import resolve
from extras import need
from simulators import toy

SCENARIOS = ("balance.py", "mpe/simple_tag.py", "debug/__init__.py")


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """The packages of VMAS that are installed, as far as conevo sees; VMAS has two scenarios."""
    folder = tmp_path / "vmas"
    for name in SCENARIOS:
        (folder / "scenarios" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "scenarios" / name).touch()
    packages = {"vmas", "torch"}

    def find_spec(name: str) -> ModuleSpec | None:
        if name not in packages:
            return None
        found = ModuleSpec(name, None, is_package=True)
        found.submodule_search_locations = [str(folder)]
        return found

    for module in (tasks, family):
        monkeypatch.setattr(module, "find_spec", find_spec)
    return packages


@pytest.mark.parametrize("package", ["vmas", "torch"])
def test_the_extra_is_named(
    package: str, installed: set[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    installed.remove(package)
    for command in (["run", "--out", str(tmp_path / "run")], ["signal"], ["list", "settings"]):
        with pytest.raises(SystemExit, match="2"):
            main([*command, "vmas:balance"])
        out, error = capsys.readouterr()
        assert (out, error.count("\n")) == ("", 1)
        assert f"vmas:balance needs the package {package}, which is not installed" in error
        assert "pip install 'conevo[vmas]'" in error
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("task", "package", "extra"),
    [("mpe2.simple_tag_v3", "mpe2", "mpe2"), ("of_my_own", "pettingzoo", "pettingzoo")],
)
def test_the_extra_of_pettingzoo_or_of_its_tasks_is_named(
    task: str, package: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tasks, "find_spec", lambda name: None)
    words = rf"pettingzoo:{task} needs the package {package}, .*'conevo\[{extra}\]'"
    with pytest.raises(UsageError, match=words):
        resolve(f"pettingzoo:{task}")


@pytest.mark.parametrize("package", ["jaxmarl", "jax"])
def test_the_extra_of_jaxmarl_is_named(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    present = {"jaxmarl", "jax"} - {package}
    monkeypatch.setattr(tasks, "find_spec", lambda name: name in present or None)
    with pytest.raises(UsageError, match=rf"needs the package {package}, .*'conevo\[jaxmarl\]'"):
        resolve("jaxmarl:MPE_simple_spread_v3")


def test_the_tasks_of_jaxmarl_are_read_and_not_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "raise SystemExit\nregistered_envs = ['MPE_simple_v3', 'hanabi']\n"
    (tmp_path / "registration.py").write_text(text)
    found = ModuleSpec("jaxmarl", None, is_package=True)
    found.submodule_search_locations = [str(tmp_path)]
    for module in (tasks, jaxmarl_family):
        monkeypatch.setattr(module, "find_spec", lambda name: found)
    assert resolve("jaxmarl:hanabi")[1] == "hanabi"
    with pytest.raises(UsageError, match=r"unknown task 'simple_v3' of JaxMARL.*'MPE_simple_v3'"):
        resolve("jaxmarl:simple_v3")


@pytest.mark.parametrize(
    ("task", "near"),
    [("balanced", "balance"), ("simple_tagg", "simple_tag"), ("mpe/simple_tag", "simple_tag")],
)
def test_an_unknown_scenario_is_named_with_the_nearest_one(
    task: str,
    near: str,
    installed: set[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    loaded = set(sys.modules)
    with pytest.raises(SystemExit, match="2"):
        main(["run", f"vmas:{task}", "--out", str(tmp_path / "run")])
    out, error = capsys.readouterr()
    assert (out, error.count("\n")) == ("", 1)
    assert f"unknown scenario '{task}' of VMAS" in error
    assert f"did you mean '{near}'?" in error
    assert not (tmp_path / "run").exists()
    assert not {"torch", "vmas"} & (set(sys.modules) - loaded)


def test_a_known_scenario_is_found_without_loading_it(installed: set[str]) -> None:
    assert family.entry("simple_tag").address("simple_tag") == "vmas:simple_tag"
    with pytest.raises(UsageError, match="unknown scenario '__init__'"):
        family.entry("__init__")


def test_a_run_is_shown_without_its_package_but_not_continued(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "run"
    sizes = {"run.generations": 2, "world.iterations": 10, "method.genotypes": 4}
    with toy.known():
        conevo.evolve("toy:line", "cone", "smoke", out=path, overrides=sizes, threads=1)
        monkeypatch.setattr(toy, "entry", lambda task: tasks.need(f"toy:{task}", "toy", "no_toys"))
        before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
        for command, code in ((["show"], 0), (["resume", "--generations", "3"], 2)):
            capsys.readouterr()
            with pytest.raises(SystemExit) as ended:
                main([command[0], str(path), *command[1:]])
            assert int(ended.value.code or 0) == code
            out, error = capsys.readouterr()
            assert ("toy/line, CONE" in out) == (code == 0)
            assert ("toy:line needs the package no_toys" in error) == (code == 2)
    assert before == {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}


@pytest.mark.parametrize(
    ("value", "outcome"), [("", pytest.skip.Exception), ("required", pytest.fail.Exception)]
)
def test_a_required_extra_fails_where_it_would_be_skipped(
    value: str, outcome: type[BaseException], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CONEVO_TEST_EXTRAS", value)
    need("numpy")
    try:
        need("numpy", "no_such_package")
    except (pytest.skip.Exception, pytest.fail.Exception) as ended:  # a skip must not skip this
        found = ended
    assert isinstance(found, outcome)
    assert "no_such_package is not installed" in str(found)
