"""conevo track as a user gives it."""

from __future__ import annotations

from pathlib import Path

import pytest

from conevo.track.trackers import TRACKERS, Tracker
from track.kept import Kept
from watch.followed import append, write_campaign, write_run


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> Kept:
    """The tracker "kept"."""
    found = Kept()
    monkeypatch.setitem(TRACKERS, "kept", Tracker("kept", "Kept", "conevo"))
    monkeypatch.setattr(Tracker, "module", property(lambda self: found))
    return found


def test_a_run_is_sent_and_named_as_everywhere(say, kept: Kept) -> None:
    write_run(Path("runs/first"), 2)
    said = say("track", "fir", "--to", "kept")
    assert (said.code, said.err) == (0, "")
    assert said.out == "first: 2 generations sent to memory of first\nsee: look around\n"
    assert kept.targets[0].folder.parent == Path("tracks/kept")
    assert say("track", "first", "--to", "kept", "--out", "there").code == 0
    assert kept.targets[1].folder.parent == Path("there/kept")


def test_a_run_without_a_generation_has_nothing_to_send(say, kept: Kept) -> None:
    write_run(Path("runs/first"), 0)
    said = say("track", "first", "--to", "kept")
    assert (said.code, said.out) == (0, "runs/first has no finished generation yet\n")
    assert kept.targets == []
    assert not Path("tracks").exists()


def test_a_damaged_run_of_a_campaign_makes_the_exit_code_2(say, kept: Kept) -> None:
    campaign = write_campaign(Path("campaigns/three"))
    good, bad, *_ = campaign.planned
    write_run(campaign.paths.run(good), 1)
    append(write_run(campaign.paths.run(bad), 0), torn="nonsense\n")
    said = say("track", "three", "--to", "kept")
    assert said.code == 2
    assert f"{good}: 1 generation sent" in said.out
    assert f"left out: {campaign.paths.run(bad)}: generations.jsonl is damaged" in said.out
    assert said.err == "conevo: error: 1 run left out, see above\n"


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("track", "none", "--to", "kept"), "unknown run 'none'"),
        (("track", "first", "--to", "kep"), "unknown tracker 'kep'; did you mean 'kept'"),
        (("track", "first"), "Missing option '--to'"),
        (("run", "rover/complex-1", "--track", "tensorbord"), "did you mean 'tensorboard'"),
        (("run", "rover/complex-1", "--dry-run", "--track", "no"), "unknown tracker 'no'"),
    ],
)
def test_what_cannot_be_tracked_is_refused_in_one_line(say, kept: Kept, words, why: str) -> None:
    write_run(Path("runs/first"), 1)
    said = say(*words)
    assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert why in said.err
    assert sorted(Path("runs").iterdir()) == [Path("runs/first")]


def test_a_tracker_whose_package_is_missing_is_refused_before_the_run_begins(
    say, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("conevo.track.trackers.find_spec", lambda _: None)
    said = say("run", "rover/complex-1", "--preset", "smoke", "--track", "wandb")
    assert (said.code, said.out) == (2, "")
    assert said.err == (
        "conevo: error: tracking to Weights & Biases needs wandb: pip install 'conevo[wandb]'\n"
    )
    assert not Path("runs").exists()
