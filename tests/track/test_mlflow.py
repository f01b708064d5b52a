"""Runs of MLflow, in files in place of a server."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from conevo.errors import EnvironmentFailure
from conevo.track.trackers import TRACKERS
from conevo.track.tracking import Tracking
from extras import need
from runs.tiny import evolve_tiny
from watch.followed import append, configure, record, write_run

need("mlflow")


@pytest.fixture
def client(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A client of the store in which runs are kept."""
    monkeypatch.setenv("MLFLOW_ALLOW_FILE_STORE", "true")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"file://{tmp_path}/store")
    monkeypatch.delenv("MLFLOW_EXPERIMENT_NAME", raising=False)
    from mlflow.tracking import MlflowClient

    return MlflowClient(f"file://{tmp_path}/store")


def send(path: Path, out: Path) -> None:
    Tracking(path, TRACKERS["mlflow"], out, lambda _: None).once()


def only_run(client: Any) -> Any:
    experiment = client.get_experiment_by_name("conevo")
    (found,) = client.search_runs([experiment.experiment_id])
    return found


def history(client: Any, name: str) -> list[tuple[int, int, float]]:
    found = client.get_metric_history(only_run(client).info.run_id, name)
    return [(one.step, one.timestamp, one.value) for one in found]


def test_a_run_is_continued_where_its_series_ends(tmp_path: Path, client: Any) -> None:
    about = {"created": "2026-01-01T00:00:00+00:00", "stem_id": "a" * 12}
    path = write_run(tmp_path / "run", 2, about=about, method__gst=0.2)
    send(path, tmp_path / "out")
    append(path, record(2))
    configure(path, about, method__gst=0.2, generations=20)  # extended
    for _ in range(2):
        send(path, tmp_path / "elsewhere")
        assert history(client, "performance/value") == [
            (1000, 1767225602000, 1.0),
            (2000, 1767225604000, 2.0),
            (3000, 1767225606000, 3.0),
        ]
    found = only_run(client)
    assert found.data.params["method.gst"] == "0.2"
    assert "run.generations" not in found.data.params
    assert found.data.tags["mlflow.runName"] == "run"
    assert found.info.status == "KILLED"


def test_a_finished_run_has_its_test_once(tmp_path: Path, client: Any) -> None:
    run = evolve_tiny(tmp_path / "run", run__generations=2)
    for _ in range(2):
        send(run.path, tmp_path / "out")
    last = run.generations()[-1]["team_steps"]
    value = run.test_result["champion"]["performance"]["value"]["mean"]
    assert [(step, value) for step, _, value in history(client, "test/value")] == [(last, value)]
    assert only_run(client).info.status == "FINISHED"


@pytest.mark.parametrize(
    ("uri", "why"),
    [("http://127.0.0.1:9", "Max retries exceeded"), ("nonsense://x", "unsupported URI")],
)
def test_a_store_that_cannot_be_used_is_one_line(
    tmp_path: Path, client: Any, monkeypatch: pytest.MonkeyPatch, uri: str, why: str
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    with pytest.raises(EnvironmentFailure, match=f"^MLflow at {uri}: .*{why}") as caught:
        send(write_run(tmp_path / "run", 1), tmp_path / "out")
    assert "\n" not in str(caught.value)
