"""Endings of commands: printed commands can be copied, and every interruption has a message."""

from __future__ import annotations

import re
import shlex
import signal
import time
from pathlib import Path
from typing import Any

import pytest

from campaigns.plans import write_plan
from conevo.errors import UsageError
from conevo.runs.config import resolve
from conevo.runs.lab import Lab
from conevo.runs.start import start
from runs.tiny import TASK, command, spawn, tiny_settings, wait_for

SPACED = "my runs/it's one"


def test_printed_commands_can_be_copied(say, tmp_path: Path) -> None:
    sets = [w for key, value in tiny_settings("cone").items() for w in ("--set", f"{key}={value}")]
    run = ("run", TASK, "--preset", "smoke", *sets, "--out", SPACED)
    said = say(*run, "--time-limit", "0.001s")
    (advice,) = re.findall(r"continue with: conevo (.*)", said.err)
    assert shlex.split(advice) == ["resume", SPACED]
    said = say(*shlex.split(advice))
    commands = [shlex.split(line) for line in re.findall("^  conevo (.*)", said.out, re.M)]
    assert [one[:2] for one in commands[:4]] == [
        [verb, SPACED] for verb in ("show", "replay", "test", "resume")
    ]
    assert commands[4][:3] == ["run", "--config", f"{SPACED}/config.toml"]
    for arguments in (("resume", SPACED), run):
        quoted = re.findall(r"'conevo (\w+ .*?)'(?=,|$)", say(*arguments).err.split(" --gener")[0])
        assert shlex.split(quoted[0]) == ["show", SPACED]


def test_a_quiet_campaign_prints_its_directory_when_its_time_is_over(say, tmp_path: Path) -> None:
    write_plan(tmp_path)
    started = ("campaign", "start", "tiny.toml", "--executor", "serial", "--quiet")
    said = say(*started, "--time-limit", "0.001s")
    assert (said.code, said.out) == (0, "campaigns/tiny\n")


def test_a_run_that_another_process_has_just_started_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config, path = resolve(TASK, "cone", "smoke", overrides=tiny_settings("cone")), tmp_path / "run"
    equip = Lab.equip

    def slowly(*arguments: Any) -> Lab:
        monkeypatch.setattr(Lab, "equip", equip)
        start(config, path, threads=1)  # meanwhile another process does this
        return equip(*arguments)

    monkeypatch.setattr(Lab, "equip", slowly)
    with pytest.raises(UsageError, match=r"another conevo has just begun a run at .*/run; leave"):
        start(config, path, threads=1)
    with pytest.raises(UsageError, match="already holds a run, unfinished: continue it with"):
        start(config, path, threads=1)


def test_interrupts_in_a_row_end_with_the_message(tmp_path: Path) -> None:
    path = tmp_path / "run"
    with spawn(*command(path, "cone", run__generations=100_000)) as process:
        log = path / "generations.jsonl"
        wait_for(lambda: log.is_file() and log.stat().st_size > 0)
        for _ in range(20):
            process.send_signal(signal.SIGINT)
            time.sleep(0.02)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert re.fullmatch(
        rf"interrupted after \d+ generations?; continue with: conevo resume {path}\n", said
    )
