"""A run, or the runs of a campaign, are sent to a tracker."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

import conevo.track
from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs import locks
from conevo.track import tracking
from conevo.track.trackers import TRACKERS, Tracker
from conevo.track.tracking import Tracking
from runs.tiny import evolve_tiny
from track.kept import Kept
from watch.followed import append, configure, locked, record, write_campaign, write_run


@pytest.fixture
def kept(monkeypatch: pytest.MonkeyPatch) -> Kept:
    """The tracker "kept", of which the command line knows, too."""
    found = Kept()
    monkeypatch.setitem(TRACKERS, "kept", Tracker("kept", "Kept", "conevo"))
    monkeypatch.setattr(Tracker, "module", property(lambda self: found))
    monkeypatch.setattr(tracking, "EVERY", 0.0)
    monkeypatch.setattr(tracking, "PATIENCE", 0.0)
    return found


def send(path: Path, out: Path, follow: bool = False) -> list[str]:
    """Send a run; return the notes."""
    notes: list[str] = []
    sending = Tracking(path, TRACKERS["kept"], out, notes.append)
    if follow:
        sending.follow()
    else:
        sending.once()
    return notes


def test_a_run_is_sent_once_and_its_test_last(tmp_path: Path, kept: Kept) -> None:
    run = evolve_tiny(tmp_path / "run", run__generations=2)
    assert send(run.path, tmp_path / "out") == ["run: 2 generations sent to memory of run"]
    (series,) = kept.targets
    assert [row.step for row in series.rows] == [one["team_steps"] for one in run.generations()]
    assert series.test["test/value"] == run.test_result["champion"]["performance"]["value"]["mean"]
    assert series.ended == [True]
    assert series.folder == tmp_path / "out" / "kept" / f"run-{series.about.id[:6]}"
    assert run.changed_files == []


def test_only_rows_that_the_tracker_does_not_have_are_sent(tmp_path: Path, kept: Kept) -> None:
    path = write_run(tmp_path / "run", 4)
    kept.first = 2001
    assert send(path, tmp_path) == ["run: 2 generations sent to memory of run"]
    assert kept.steps() == {"run": [3000, 4000]}
    assert kept.targets[0].ended == [False]


def test_following_sends_what_is_written_until_the_end(tmp_path: Path, kept: Kept) -> None:
    path = write_run(tmp_path / "run", 1, torn='{"gen')
    log = path / "generations.jsonl"

    def write_more() -> None:
        n = len(kept.targets[0].rows)
        text = log.read_text().removesuffix('{"gen')
        log.write_text(text)
        append(path, record(n + 1))
        if n == 3:
            configure(path, {"finished": "now", "stopped_by": "generations"})
            (path / "DONE").write_text('{"files": {}}')

    kept.on_put = write_more
    with locked(path):
        send(path, tmp_path / "out", follow=True)
    assert kept.steps() == {"run": [1000, 2000, 3000, 4000, 5000]}
    assert [one.ended for one in kept.targets] == [[True]]


def test_following_ends_some_time_after_the_last_process_that_writes(
    tmp_path: Path, kept: Kept
) -> None:
    path = write_run(tmp_path / "run", 2)
    assert send(path, tmp_path / "out", follow=True) == [
        f"{path} is not running any more",
        "run: 2 generations sent to memory of run",
    ]
    assert kept.targets[0].ended == [False]


@pytest.mark.parametrize("is_gone", [True, False])
def test_a_run_that_goes_while_it_is_followed_keeps_what_was_sent(
    tmp_path: Path, kept: Kept, monkeypatch: pytest.MonkeyPatch, is_gone: bool
) -> None:
    monkeypatch.setattr(tracking, "PATIENCE", 60.0)
    path = write_run(tmp_path / "run", 2)

    def take_away() -> None:
        shutil.rmtree(path) if is_gone else append(path, torn="nonsense\n")

    kept.on_put = take_away
    why = "was removed" if is_gone else "is damaged in line 3"
    with pytest.raises(UsageError, match=why):
        send(path, tmp_path / "out", follow=True)
    assert kept.steps() == {"run": [1000, 2000]}
    assert kept.targets[0].ended == [False]


def test_all_runs_of_a_campaign_are_sent(tmp_path: Path, kept: Kept) -> None:
    campaign = write_campaign(tmp_path / "three")
    first, second, third, _ = campaign.planned
    write_run(campaign.paths.run(first), 2, is_finished=True)
    write_run(campaign.paths.run(second), 1)
    append(write_run(campaign.paths.run(third), 1), torn="nonsense\n")
    notes = send(campaign.path, tmp_path / "out")
    assert kept.steps() == {first: [1000, 2000], second: [1000], third: [1000]}
    assert {one.about.group for one in kept.targets} == {"three"}
    assert {one.folder.parent for one in kept.targets} == {tmp_path / "out" / "kept" / "three"}
    assert len(notes) == 3


def test_a_campaign_goes_on_without_a_run_that_is_damaged(tmp_path: Path, kept: Kept) -> None:
    campaign = write_campaign(tmp_path / "three")
    bad, good, *_ = campaign.planned
    write_run(campaign.paths.run(bad), 1)
    (campaign.paths.run(bad) / "provenance.json").write_text("{")
    write_run(campaign.paths.run(good), 2)
    notes: list[str] = []
    sending = Tracking(campaign.path, TRACKERS["kept"], tmp_path / "out", notes.append)
    sending.once()
    assert sending.failed == [bad]
    assert kept.steps() == {good: [1000, 2000]}
    assert sum(note.startswith("left out: ") and "provenance.json" in note for note in notes) == 1


def test_two_trackers_do_not_send_the_same_run_at_once(tmp_path: Path, kept: Kept) -> None:
    path = write_run(tmp_path / "run", 1)
    send(path, tmp_path / "out")
    folder = kept.targets[0].folder
    with locked(folder), pytest.raises(UsageError, match="another tracker is sending this run"):
        send(path, tmp_path / "out")
    assert len(kept.targets) == 1
    send(path, tmp_path / "out")  # the lock is free again
    assert not locks.is_held(folder / "lock")


def test_a_tracker_that_fails_ends_in_one_line_and_gives_its_lock_back(
    tmp_path: Path, kept: Kept
) -> None:
    path = write_run(tmp_path / "run", 3)
    kept.fails_at = 2000
    with pytest.raises(EnvironmentFailure, match="No space left"):
        send(path, tmp_path / "out")
    assert kept.steps() == {"run": [1000]}
    assert not locks.is_held(kept.targets[0].folder / "lock")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_nothing_is_written_in_a_run_that_is_read_only(tmp_path: Path, kept: Kept) -> None:
    path = write_run(tmp_path / "run", 2)
    path.chmod(0o500)
    try:
        send(path, tmp_path / "out")
        with pytest.raises(EnvironmentFailure, match=r"cannot write .*run/out"):
            send(path, path / "out")
    finally:
        path.chmod(0o700)
    assert kept.steps() == {"run": [1000, 2000]}


def test_a_tracker_needs_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, package in (
        ("tensorboard", "tensorboardX"),
        ("wandb", "wandb"),
        ("mlflow", "mlflow"),
    ):
        monkeypatch.setattr("conevo.track.trackers.find_spec", lambda _: None)
        with pytest.raises(UsageError, match=rf"needs {package}: pip install 'conevo\[{name}\]'"):
            TRACKERS[name].refuse()


def test_mlflow_needs_the_address_of_a_server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("conevo.track.trackers.find_spec", lambda _: object())
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    with pytest.raises(UsageError, match="address of its server in MLFLOW_TRACKING_URI"):
        TRACKERS["mlflow"].refuse()


def test_every_tracker_has_a_file_and_an_extra() -> None:
    folder = Path(conevo.track.__file__).parent
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text()
    for one in TRACKERS.values():
        assert (folder / f"{one.name}.py").is_file()
        assert f"\n{one.name} = [" in text
