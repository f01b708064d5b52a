"""Kernels are built before anything is written, one at a time, and mistakes in them are named."""

from __future__ import annotations

import os
import re
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path

import pytest
import warp as wp

import conevo
from conevo.campaigns.campaign import create
from conevo.campaigns.plan import Plan
from conevo.cli.main import main
from conevo.errors import EnvironmentFailure, UsageError
from conevo.kernels import engine
from conevo.worlds.rollout import Rollout
from worlds.test_outside import EXAMPLE, line_with, written

SCORE = "1.0 - wp.length(light(team, scene, i))"
STATE = "    x: wp.array[float]\n"


MISTAKES = {
    "name": (SCORE, "unknown_name", "Referencing undefined symbol: unknown_name (in resolve: "),
    "field": ("team.fitness[i] = 1.0", "team.fitnes[i] = 1.0", "`fitnes` is not an attribute of"),
    "type": (SCORE, "team.chosen[i]", "(in resolve: team.fitness[i] = team.chosen[i])"),
    "argument": ("light(team, scene, i))\n\n\n", "light(team, scene))\n\n\n", "(in resolve: "),
    "scenarios": ("(self.n_robots + 1, 2)", "(self.n_robot + 1, 2)", "AttributeError: "),
    "simulation": ("kernel_params(Params,", "kernel_params(Prams,", "NameError: name 'Prams'"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_a_world_is_one_line_with_its_place_and_no_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    old, new, words = MISTAKES[name]
    file = written(tmp_path / "light.py", (old, new))
    for _ in range(2 if name == "name" else 1):  # the second time is not blocked by the first
        with pytest.raises(SystemExit) as caught:
            main(["run", "light.py:dark-1", "--preset", "smoke"])
        out, err = capfd.readouterr()
        assert (caught.value.code, out, err.count("\n")) == (2, "", 1)
        assert err.startswith(f"conevo: error: {file}:{line_with(old.splitlines()[0])}: ")
        assert words in err
    assert [p.name for p in tmp_path.iterdir()] == ["light.py"]


NAMES = '    inputs: ClassVar[tuple[str, ...]] = ("light x", "light y")\n'
UNFIT = {
    "setting": ('{"n_hidden": 4', '{"n_hiden": 4', "setting 'n_hiden' in the controller of"),
    "settings": ('{"n_hidden": 4, "max_hidden": 8}', "None", "must be a dict of settings"),
    "bound": ('"n_hidden": 4', '"n_hidden": 40', "controller.n_hidden = 40 of world 'light-v1': "),
    "type": ('"n_hidden": 4', '"n_hidden": "4"', "controller.n_hidden = '4' of world 'light-v1': "),
    "outputs": ('"dx", "dy")', '"dx", "dy", *"abcde")', "'srn' has at most 8 outputs, and"),
    "inputs": (NAMES, "", "world light-v1 needs inputs, a tuple of names"),
}  # fmt: skip


@pytest.mark.parametrize("name", UNFIT)
def test_a_world_that_no_controller_fits_is_one_line_and_no_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    old, new, words = UNFIT[name]
    written(tmp_path / "light.py", (old, new))
    with pytest.raises(SystemExit) as caught:
        main(["run", "light.py:dark-1", "--preset", "smoke"])
    out, err = capfd.readouterr()
    assert (caught.value.code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("conevo: error: ")
    assert words in err
    assert [p.name for p in tmp_path.iterdir()] == ["light.py"]


def test_no_campaign_appears_with_a_world_that_cannot_be_built(tmp_path: Path) -> None:
    file = written(tmp_path / "light.py", (SCORE, "third_name"))
    factors = {"world": (f"{file}:dark-1",), "method": ("homcne",)}
    plan = Plan("mine", "Mine", (), (1,), "smoke", False, (), factors, {})
    with pytest.raises(UsageError, match="Referencing undefined symbol: third_name"):
        create(plan, tmp_path / "campaign")
    assert [p.name for p in tmp_path.iterdir()] == ["light.py"]


def build(path: Path) -> str:
    """Build a world's kernel and return its hash."""
    rollout = Rollout(conevo.world(f"{path}:dark-1"))
    rollout.build()
    return rollout.fingerprint


def test_threads_build_different_worlds_one_after_the_other(tmp_path: Path) -> None:
    nonce = os.urandom(4).hex()  # never compiled before
    files = [
        written(tmp_path / f"{k}.py", (STATE, f"{STATE}    z{nonce}{k}: wp.array[float]\n"))
        for k in range(2)
    ]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(build, files))
    assert together == [build(file) for file in files]
    assert together[0] != together[1]


@pytest.mark.parametrize("step", ["start", "build"])
def test_a_cache_that_cannot_be_written_is_named_with_its_variable(
    step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*arguments: object) -> None:
        raise OSError(30, "Read-only file system")

    rollout = Rollout(conevo.world(f"{EXAMPLE}:dark-1"))
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    monkeypatch.setattr(wp, "init", refuse)
    monkeypatch.setattr(type(rollout._kernel.module), "load", refuse)
    monkeypatch.setattr(engine, "_without_line", nullcontext)
    monkeypatch.setattr(engine, "_is_started", False)
    words = (
        f"compiled kernels cannot be kept in {tmp_path}: Read-only file system; set .*CACHE_PATH"
    )
    with pytest.raises(EnvironmentFailure, match=words):
        engine.start() if step == "start" else rollout.build()


def test_an_error_outside_world_files_is_passed_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    conevo.world(f"{EXAMPLE}:dark-1")
    monkeypatch.setattr("conevo.runs.config.resolve", lambda *a, **k: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        main(["run", "rover/complex-1"])


def test_python_raises_the_same_line(tmp_path: Path) -> None:
    file = written(tmp_path / "light.py", (SCORE, "another_name"))
    place = re.escape(f"{file}:{line_with(SCORE)}: Referencing undefined symbol")
    with pytest.raises(UsageError, match=place):
        conevo.evolve(f"{file}:dark-1", preset="smoke", out=tmp_path / "run")
    assert not (tmp_path / "run").exists()
