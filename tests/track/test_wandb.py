"""Offline runs of Weights & Biases; nothing is sent anywhere."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from conevo.errors import EnvironmentFailure
from conevo.track.series import Series
from conevo.track.trackers import TRACKERS
from conevo.track.tracking import Tracking
from conevo.track.wandb import begin
from extras import need
from watch.followed import write_run

need("wandb")


@pytest.fixture(autouse=True)
def _apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody is logged in here, and settings of this user do not count."""
    for name in ("WANDB_API_KEY", "WANDB_MODE", "WANDB_PROJECT", "WANDB_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("WANDB_BASE_URL", "http://127.0.0.1:9")
    end_wandb()  # it remembers the key of another test


def send(path: Path, out: Path) -> None:
    Tracking(path, TRACKERS["wandb"], out, lambda _: None).once()


def end_wandb() -> None:
    """Wait until all is on the disk."""
    import wandb

    wandb.teardown()


def records(content: bytes) -> Iterator[bytes]:
    """Yield the records of a file: pieces in blocks of 32 KiB, as LevelDB has them."""
    at, whole = 7, b""
    while at + 7 <= len(content):
        size, kind = struct.unpack("<HB", content[at + 4 : at + 7])
        whole += content[at + 7 : at + 7 + size]
        at += 7 + size
        if kind in (1, 4):  # whole, or the last piece
            yield whole
            whole = b""
        if 32768 - at % 32768 < 7:
            at += -at % 32768


def logged(path: Path) -> list[dict[str, str]]:
    """Return the rows of the history in the file of an offline run."""
    from wandb.proto.wandb_internal_pb2 import Record

    rows = []
    for data in records(path.read_bytes()):
        found = Record.FromString(data)
        if found.WhichOneof("record_type") == "history":
            items = found.history.item
            rows.append({"/".join(one.nested_key) or one.key: one.value_json for one in items})
    return rows


def test_a_run_is_kept_offline_under_its_id_once(tmp_path: Path) -> None:
    path = write_run(tmp_path / "run", 3)
    about = Series(path).about
    for _ in range(3):
        send(path, tmp_path / "out")
        end_wandb()
        (file,) = (tmp_path / "out").rglob("*.wandb")
        assert file.name == f"run-{about.id}.wandb"
        rows = logged(file)
        assert [int(row["_step"]) for row in rows] == [1000, 2000, 3000]
        assert [float(row["performance/value"]) for row in rows] == [1, 2, 3]


def test_a_dead_server_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WANDB_MODE", "online")
    monkeypatch.setenv("WANDB_API_KEY", "0" * 40)
    monkeypatch.setattr("conevo.track.wandb.PATIENCE", 3.0)
    path = write_run(tmp_path / "run", 1)
    with pytest.raises(EnvironmentFailure, match=r"^Weights & Biases: .*127\.0\.0\.1:9") as caught:
        send(path, tmp_path / "out")
    assert "\n" not in str(caught.value)


def test_a_previous_directory_stays_until_the_new_one_is_on_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import wandb

    ids = [{"run_id": digit * 12} for digit in "12"]
    paths = [write_run(tmp_path / f"run-{k}", 3, about=one) for k, one in enumerate(ids)]
    for path in paths:
        send(path, tmp_path / "out")
    before = set((tmp_path / "out").rglob("*.wandb"))
    found: list[set[Path]] = []
    end = wandb.teardown

    def teardown() -> None:
        found.append(set((tmp_path / "out").rglob("*.wandb")))
        end()
        assert all(len(logged(one)) == 3 for one in found[-1])

    monkeypatch.setattr(wandb, "teardown", teardown)
    of = [Series(path) for path in paths]
    folders = [tmp_path / "out" / "wandb" / f"{s.about.name}-{s.about.id[:6]}" for s in of]
    targets = [begin(s.about, folder) for s, folder in zip(of, folders, strict=True)]
    for target, s in zip(targets, of, strict=True):
        target.put(s.read())
        target.close(False)
    (all_there,) = found  # not while the second run was open
    assert before < all_there
    assert set((tmp_path / "out").rglob("*.wandb")) == all_there - before
