"""A run is continued, tested and shown on any device, bit for bit; two devices are simulated."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import EnvironmentFailure, UsageError
from conevo.replay.recording import record
from conevo.runs import provenance
from conevo.runs.config import resolve
from conevo.runs.shaping import start_shaping
from conevo.runs.start import start
from conevo.studies.observation import equip
from runs.tiny import TASK, content, evolve_tiny, tiny_settings

OTHER = "this machine has no 'cuda:1', on which the run was last played: it is played on the cpu"


@pytest.fixture(autouse=True)
def no_earlier_notes():
    provenance._warn_of_missing.cache_clear()


def begun(path: Path, device: str, generations: int = 5) -> conevo.Run:
    """Start a run on a device and leave it after its first generation."""
    settings = tiny_settings("cone", run__generations=generations)
    config = resolve(TASK, "cone", "smoke", overrides=settings)
    return start(config, path, threads=1, device=device).resume(time_limit=1e-9, threads=1)


def devices(run: conevo.Run) -> list[str]:
    return [run.provenance["device"], *(one["device"] for one in run.provenance["sessions"])]


def test_a_run_continues_on_another_kind_of_device_bit_for_bit(two_cards, tmp_path):
    whole = content(evolve_tiny(tmp_path / "whole").path)
    run = begun(tmp_path / "down", "cuda:1")
    assert (run.status, len(run.generations())) == ("interrupted", 1)
    run.resume(device="cpu", threads=1)
    assert devices(run) == ["cuda:1", "cuda:1", "cpu"]
    assert content(run.path) == whole
    run = begun(tmp_path / "up", "cpu")
    run.resume(device="auto", threads=1)
    assert devices(run) == ["cpu", "cpu", "cuda:0"]
    assert content(run.path) == whole


def test_by_default_a_run_continues_on_its_last_device(two_cards, tmp_path, caplog):
    run = begun(tmp_path / "run", "cpu")
    run.resume(device="cuda:1", time_limit=1e-9)
    conevo.Run(run.path).resume()
    assert devices(run) == ["cpu", "cpu", "cuda:1", "cuda:1"]
    _, lab = equip(run)
    assert lab.device == "cuda:1"
    _, lab = equip(run, device="cpu")
    assert lab.device == "cpu"
    assert caplog.messages == []


def test_a_missing_device_is_noted_once_and_the_cpu_is_used(
    two_cards, tmp_path, monkeypatch, caplog
):
    run = begun(tmp_path / "run", "cuda:1", 2)
    monkeypatch.setattr("warp.get_cuda_devices", list)
    run = conevo.Run(run.path)
    run.resume(generations=3)
    run.test(2)
    record(run)
    assert [message[: len(OTHER)] for message in caplog.messages] == [OTHER]
    assert devices(run) == ["cuda:1", "cuda:1", "cpu"]
    with pytest.raises(EnvironmentFailure, match="device 'cuda:1': "):
        run.test(2, device="cuda:1")


@pytest.mark.parametrize("cards", [["cuda:0", "cuda:1"], []])
def test_auto_is_recorded_as_the_chosen_device(cards, two_cards, tmp_path, monkeypatch):
    if not cards:
        monkeypatch.setattr("warp.get_cuda_devices", list)
    became = cards[0] if cards else "cpu"
    run = begun(tmp_path / "run", "auto", 2)
    assert devices(run) == [became, became]
    shaping = start_shaping(
        ["rover/complex-1", "rover/complex-2"], "homcne", "smoke", out=tmp_path / "shaped",
        overrides=tiny_settings("homcne", run__generations=2), device="auto",
    )  # fmt: skip
    assert f'device = "{became}"' in (shaping.path / "shaping.toml").read_text()
    shaping.resume(time_limit=1e-9)
    assert devices(shaping.stages[0]) == [became, became]
    shaping.resume(device="cpu")
    assert devices(shaping.stages[0]) == [became, became, "cpu"]
    assert devices(shaping.stages[1]) == ["cpu", "cpu"]


def test_a_world_with_its_own_simulator_is_played_on_the_cpu(two_cards, tmp_path):
    world = str(Path(__file__).parents[2] / "examples/spread.py") + ":open-1"
    config = resolve(world, "homcne", "smoke")
    run = start(config, tmp_path / "run", device="auto")
    assert run.provenance["device"] == "cpu"
    with pytest.raises(EnvironmentFailure, match="its own simulator, on the cpu"):
        run.resume(device="cuda")


@pytest.mark.parametrize(
    "words", [["resume"], ["test"], ["replay"], ["film"], ["behaviours"], ["watch"]]
)
def test_the_command_line_takes_the_device(words, tmp_path, monkeypatch, capsys):
    run = begun(tmp_path / "run", "cpu", 2)
    monkeypatch.chdir(tmp_path)

    def outcome(device: str) -> tuple[int, str]:
        with pytest.raises(SystemExit) as caught:
            main([*words, str(run.path), "--device", device])
        return int(caught.value.code or 0), capsys.readouterr().err

    assert outcome("gpu") == (
        2, "conevo: error: 'gpu' is not a device; allowed: auto, cpu, cuda, cuda:N\n"
    )  # fmt: skip
    if words[0] in ("resume", "test", "replay", "film"):
        code, err = outcome("cuda:99")
        assert code == 3
        assert err.startswith("conevo: error: device 'cuda:99': ")
        assert err.count("\n") == 1


def test_commands_print_notes_of_the_library(two_cards, tmp_path, monkeypatch, capsys):
    run = begun(tmp_path / "run", "cuda:1", 2)
    with pytest.raises(SystemExit):
        main(["resume", str(run.path), "--device", "auto", "--quiet"])
    assert capsys.readouterr().err == ""
    about = json.loads((run.path / "provenance.json").read_text())
    assert about["sessions"][1]["device"] == "cuda:0"
    monkeypatch.setattr("warp.get_cuda_devices", list)
    for command in (["test", "--json"], ["test", "--on", "complex-2", "--json"]):
        with pytest.raises(SystemExit) as caught:
            main([*command, str(run.path)])
        assert caught.value.code in (0, None)
    output = capsys.readouterr()
    assert (
        output.err == f"conevo: note: {OTHER.replace('cuda:1', 'cuda:0')}, with the same results\n"
    )
    assert json.loads(output.out.splitlines()[0])["scenarios"] == 3


def test_other_names_than_those_of_devices_are_refused_in_python_too(tmp_path):
    run = begun(tmp_path / "run", "cpu", 2)
    with pytest.raises(UsageError, match="'tpu' is not a device; allowed: auto, cpu, cuda"):
        run.resume(device="tpu")
    assert run.status == "interrupted"
