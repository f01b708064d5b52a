"""Wrong names, and pipes, devices or links in place of a file: one line states the problem."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from conevo.errors import UsageError, unknown_name
from conevo.runs.shaping import start_shaping
from runs.tiny import evolve_tiny, tiny_settings

KINDS = {
    "directory": (lambda path: path.mkdir(), "Is a directory"),
    "pipe": (os.mkfifo, "it is a pipe, not a regular file"),
    "device": (lambda path: path.symlink_to("/dev/zero"), "it is a device, not a regular file"),
    "loop": (lambda path: path.symlink_to(path.name), "Too many levels of symbolic links"),
    "dangling": (lambda path: path.symlink_to("nowhere"), "No such file or directory"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_anything_in_place_of_a_file_is_named(say, tmp_path: Path, kind: str) -> None:
    make, reason = KINDS[kind]
    for folder, name, verbs in (
        ("campaigns/c", "plan.toml", ("campaign status c", "campaign start c", "query c X")),
        ("runs/s", "shaping.toml", ("show runs/s", "show s", "resume runs/s", "replay runs/s")),
        ("runs/r", "config.toml", ("show runs/r", "show r", "test runs/r")),
    ):
        (tmp_path / folder).mkdir(parents=True)
        make(tmp_path / folder / name)
        for verb in verbs:
            said = say(*verb.split())
            assert said.code in (2, 3)
            assert said.err == f"conevo: error: cannot read {folder}/{name}: {reason}\n", verb
    assert reason in say("campaign", "list").out
    assert say("list", "runs").out.count(reason) == 2
    plan = ("campaign", "start", "rover-simple", "--preset", "smoke", "--out", "campaigns/c")
    assert f"cannot read campaigns/c/plan.toml: {reason}" in say(*plan).err


@pytest.mark.parametrize("verb", ["check", "run"])
@pytest.mark.parametrize("path", ["/dev/zero", "./light", "../light/dark-1"])
def test_a_path_that_is_not_a_world_is_refused_with_the_right_form(
    say, verb: str, path: str
) -> None:
    said = say(verb, path)
    assert said.code == 2
    assert f"world {path!r}: a world in a file is named FILE.py:ENVIRONMENT" in said.err


def test_a_shaping_that_lost_its_teams_is_not_reported_as_without_generations(
    say, tmp_path: Path
) -> None:
    settings = tiny_settings("cone", run__generations=1)
    tasks = ["rover/complex-1", "rover/complex-2"]
    here = start_shaping(tasks, preset="smoke", out=tmp_path / "here", overrides=settings)
    here.resume(threads=1)
    for file in (tmp_path / "here").glob("stage-*/champion.npz"):
        file.unlink()
    for options in ([], ["--stages"]):
        said = say("test", "here", *options)
        assert (said.code, said.err) == (
            2, "conevo: error: here has lost its champion.npz, so there is no team\n",
        )  # fmt: skip


def test_the_nearest_name_is_that_with_the_nearest_number() -> None:
    names = [f"{family}-{n}" for family in ("simple", "complex") for n in range(1, 11)]
    for wrong, near in (
        ("complex-11", "complex-10"),
        ("complex-0", "complex-1"),
        ("complx-10", "complex-10"),
    ):
        assert f"did you mean {near!r}?" in str(unknown_name("environment", wrong, names))
    with pytest.raises(UsageError, match=r"did you mean 'cone-3'\?"):
        raise unknown_name("method", "cone-4", ["cone", "cone-1", "cone-2", "cone-3"])


@pytest.mark.parametrize("kind", KINDS)
def test_anything_in_place_of_a_seal_is_named(say, tmp_path: Path, kind: str) -> None:
    """It is neither taken for a run that goes on, nor replaced by a seal."""
    make, reason = KINDS[kind]
    run = evolve_tiny(tmp_path / "run")
    (run.path / "DONE").unlink()
    make(run.path / "DONE")
    for words in (["show", "run"], ["resume", "run", "--generations", "9"]):
        said = say(*words)
        assert said.code in (2, 3)
        assert said.err.startswith(f"conevo: error: cannot read run/DONE: {reason}")
    assert run.done()[0] == 5


@pytest.mark.parametrize(
    "words",
    [
        ("run", "rover/complex-1", "--from", ""),
        ("run", "rover/complex-1", "--from-champion", ""),
        ("run", "rover/complex-1", "--method", ""),
        ("campaign", "start", "rover-simple", "--out", ""),
        ("report", "some", "--out", ""),
    ],
)
def test_an_option_that_is_empty_is_not_one_that_was_left_out(say, words: tuple[str, ...]) -> None:
    said = say(*words)
    assert said.code == 2
    assert said.err == f"conevo: error: {words[-2]} is empty: give a value, or leave it out\n"
    assert not Path("runs").exists()
