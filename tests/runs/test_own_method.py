"""A method whose genotypes are whole teams, in whole runs: resumed, extended, next to CONE."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.cli.main import main
from conevo.cli.run_text import generations_table
from conevo.errors import UsageError
from conevo.runs.checkpoint import save
from conevo.runs.config import resolve
from conevo.runs.lab import Lab
from conevo.runs.start import start
from conevo.runs.store import Store
from runs.tiny import TASK, content, tiny_settings

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_method.py"
ADDRESS = f"{EXAMPLE}:team-es"
SETTINGS = tiny_settings("homcne", run__generations=6)


def evolved(path: Path, method: str = ADDRESS, **more: object) -> conevo.Run:
    return conevo.evolve(TASK, method, "smoke", out=path, overrides=SETTINGS, threads=1, **more)


def broken_off(path: Path) -> conevo.Run:
    """Make a run that was interrupted after three generations."""

    def stop(run: conevo.Run, record: dict[str, object]) -> None:
        if record["generation"] == 2:
            raise KeyboardInterrupt

    run = start(resolve(TASK, ADDRESS, "smoke", overrides=SETTINGS), path, threads=1)
    with pytest.raises(KeyboardInterrupt):
        run.resume(threads=1, watch=stop)
    return conevo.Run(path)


def test_it_resumes_and_is_extended_bit_for_bit(tmp_path: Path) -> None:
    whole = evolved(tmp_path / "whole")
    assert content(broken_off(tmp_path / "run").resume(threads=2).path) == content(whole.path)
    short = conevo.evolve(
        TASK,
        ADDRESS,
        "smoke",
        out=tmp_path / "short",
        overrides=SETTINGS | {"run.generations": 2},
        threads=1,
    )
    assert content(short.resume(generations=6, threads=1).path) == content(whole.path)


def test_its_step_size_is_in_the_log_and_its_state_in_the_checkpoint(tmp_path: Path) -> None:
    run = evolved(tmp_path / "run")
    sizes = [record["step_size"] for record in run.generations()]
    assert sizes[0] == 0.2
    assert len(set(sizes)) == 6
    assert {record["sst"] for record in run.generations()} == {None}
    shown = generations_table(run.generations()).splitlines()
    assert re.search(r" S  step_size  neurons ", shown[0])  # and none of an exchange
    assert "  0.2  " in shown[1]
    (file,) = run.path.glob("checkpoint-?.npz")
    with np.load(file) as archive:
        assert archive["field.mean"].shape == archive["field.path"].shape == (3, 2, 23)
        text = json.loads(archive["about"].tobytes())
    assert text["fields"]["progress.generation"] == 6
    assert text["fields"]["progress.numbers.step_size"] == sizes[-1]


def test_another_state_is_refused_by_its_own_check(tmp_path: Path) -> None:
    run = broken_off(tmp_path / "run")
    store, blank = Store(run.path), Lab.equip(run.config, 1, "cpu").blank_state()
    state, _ = store.load_checkpoint("team-es", blank)
    for field, value in (("step_size", -1.0), ("mean", state.mean + 3)):  # type: ignore[union-attr]
        for file in run.path.glob("checkpoint-?.npz"):
            other = type(state)(**vars(state) | {field: value})
            save(file, other, store._identity() | {"method": "team-es"})
        with pytest.raises(UsageError, match=f"{field} of its checkpoint is not one of this run"):
            conevo.Run(run.path).resume(threads=1)


def test_no_run_starts_from_its_populations_but_one_may_start_from_its_champion(
    tmp_path: Path,
) -> None:
    origin = evolved(tmp_path / "origin")
    for method, words in (
        ("homcne", "the method it is from has none that consists of controllers"),
        (ADDRESS, "Team ES has none that consists of controllers"),
    ):
        with pytest.raises(UsageError, match=words) as caught:
            evolved(tmp_path / "run", method, origin=origin)
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "run").exists()
    heir = evolved(tmp_path / "heir", "homcne", origin=origin, of_champion=True)
    assert heir.status == "finished"


def test_it_is_compared_with_cone_from_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(EXAMPLE.parent)
    sets = [word for key, value in SETTINGS.items() for word in ("--set", f"{key}={value}")]
    words = ["--method", "own_method.py:team-es,cone", "--preset", "smoke", "--seeds", "1"]
    out = ["--out", str(tmp_path / "both"), "--threads", "1", "--quiet"]
    with pytest.raises(SystemExit, match="0"):
        main(["run", TASK, *words, *sets, *out])
    capsys.readouterr()
    with pytest.raises(SystemExit, match="0"):
        main(["campaign", "status", str(tmp_path / "both")])
    status = capsys.readouterr().out
    assert "team-es" in status
    assert "cone" in status
    assert "examples" not in (tmp_path / "both" / "runs.jsonl").read_text()
