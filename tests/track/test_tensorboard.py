"""Event files as TensorBoard reads them."""

from __future__ import annotations

import struct
from pathlib import Path

from conevo.track.trackers import TRACKERS
from conevo.track.tracking import Tracking
from extras import need
from watch.followed import append, record, write_run

need("tensorboardX")


def send(path: Path, out: Path) -> None:
    Tracking(path, TRACKERS["tensorboard"], out, lambda _: None).once()


def read(path: Path) -> list[object]:
    """Return the events of a file."""
    from tensorboardX.proto.event_pb2 import Event

    content, found = path.read_bytes(), []
    while content:
        (size,) = struct.unpack("<Q", content[:8])
        found.append(Event.FromString(content[12 : 12 + size]))
        content = content[16 + size :]
    return found


def scalars(folder: Path, tag: str) -> list[tuple[int, float, float]]:
    """Return step, time and value of a tag in the only event file of a folder."""
    (path,) = folder.glob("tensorboard/run-*/events.*")
    return [
        (event.step, event.wall_time, value.simple_value)
        for event in read(path)
        for value in event.summary.value
        if value.tag == tag
    ]


def test_an_event_file_has_every_generation_at_its_team_steps(tmp_path: Path) -> None:
    path = write_run(tmp_path / "run", 3, about={"created": "2026-01-01T00:00:00+00:00"})
    send(path, tmp_path)
    assert scalars(tmp_path, "performance/value") == [
        (1000, 1767225602.0, 1.0),
        (2000, 1767225604.0, 2.0),
        (3000, 1767225606.0, 3.0),
    ]
    (file,) = tmp_path.glob("tensorboard/run-*/events.*")
    head, start, settings, *_ = read(file)
    assert head.file_version == "brain.Event:2"
    assert (start.session_log.status, start.step) == (1, 0)
    assert b"run.seed | 1" in settings.summary.value[0].tensor.string_val[0]


def test_sending_a_run_again_replaces_its_file(tmp_path: Path) -> None:
    path = write_run(tmp_path / "run", 2)
    send(path, tmp_path)
    (first,) = tmp_path.glob("tensorboard/run-*/events.*")
    content = first.read_bytes()
    send(path, tmp_path)
    (second,) = tmp_path.glob("tensorboard/run-*/events.*")
    assert second > first
    assert second.read_bytes() == content
    append(path, record(2))
    send(path, tmp_path)
    assert [step for step, _, _ in scalars(tmp_path, "team_fitness")] == [1000, 2000, 3000]


def test_tensorboard_shows_no_point_twice_even_with_the_file_of_a_killed_tracker(
    tmp_path: Path,
) -> None:
    need("tensorboard")
    from tensorboard.backend.event_processing import event_accumulator as accumulator

    path = write_run(tmp_path / "run", 4)
    send(path, tmp_path)
    (file,) = tmp_path.glob("tensorboard/run-*/events.*")
    kept = file.read_bytes()
    send(path, tmp_path)
    file.write_bytes(kept)  # as if the second tracker had been killed before it removed the first
    seen = accumulator.EventAccumulator(str(file.parent))
    seen.Reload()
    assert [one.step for one in seen.Scalars("team_fitness")] == [1000, 2000, 3000, 4000]
