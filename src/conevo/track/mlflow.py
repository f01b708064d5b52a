"""Runs of MLflow, in the experiment "conevo" of the server that MLFLOW_TRACKING_URI names.

A run there is found again by a tag, the id of ``RunProfile``, and continued after the last step
that it has. Times are those of the run, so a row that is sent twice is the same row.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs.outline import LENGTH
from conevo.track.series import Row, RunProfile

__all__ = ["begin", "refuse"]

URI, EXPERIMENT, TAG = "MLFLOW_TRACKING_URI", "MLFLOW_EXPERIMENT_NAME", "conevo.id"
PATIENCE = {"MLFLOW_HTTP_REQUEST_MAX_RETRIES": "3", "MLFLOW_HTTP_REQUEST_TIMEOUT": "30"}
MOST_METRICS, MOST_PARAMS = 1000, 100  # of one request
LONGEST = 6000  # characters of a parameter
OTHER = re.compile(r"[^\w./ -]")  # than the letters of a name
LENGTHS = {f"run.{name}" for name in LENGTH}  # which may change; parameters may not


def refuse() -> None:
    """Raise UsageError if no server is named."""
    if not os.environ.get(URI):
        raise UsageError(
            f"tracking to MLflow needs the address of its server in {URI}, for example "
            f"http://127.0.0.1:5000"
        )


def begin(about: RunProfile, folder: Path) -> MlflowRun:
    """Begin or continue the run with this id."""
    return MlflowRun(about)


class MlflowRun:
    """A run there."""

    def __init__(self, about: RunProfile) -> None:
        for name, value in PATIENCE.items():
            os.environ.setdefault(name, value)
        with _refusals():
            from mlflow.entities import Param
            from mlflow.tracking import MlflowClient

            self._client: Any = MlflowClient(os.environ[URI])
            experiment = _experiment(self._client)
            found = self._client.search_runs(
                [experiment], f"tags.`{TAG}` = '{about.id}'", max_results=1
            )
            known: Mapping[str, str] = {}
            if found:
                known = found[0].data.params
                self._id = found[0].info.run_id
                self._client.update_run(self._id, status="RUNNING")
            else:
                tags = {TAG: about.id, "mlflow.runName": about.name, **about.tags}
                tags |= {"campaign": about.group} if about.group else {}
                made = self._client.create_run(experiment, int(about.started * 1000), tags)
                self._id = made.info.run_id
            params = [
                Param(_name(name), str(value)[:LONGEST])
                for name, value in about.settings.items()
                if name not in LENGTHS and _name(name) not in known
            ]
            for k in range(0, len(params), MOST_PARAMS):
                self._client.log_batch(self._id, params=params[k : k + MOST_PARAMS])
            self.next_step = 1 + self._last_step("generation")
        self.see = os.environ[URI]
        self.place = f"{self.see}, run {self._id}"

    def put(self, rows: Sequence[Row]) -> None:
        """Send the rows, as many in a request as it may have."""
        batch: list[Any] = []
        for row in rows:
            metrics = _metrics(row.values, row)
            if len(batch) + len(metrics) > MOST_METRICS:
                self._send(batch)
                batch = []
            batch += metrics
        self._send(batch)

    def conclude(self, values: Mapping[str, float], last: Row) -> None:
        """Send the results of the testing phase, at the last step, unless they are there."""
        with _refusals():
            is_there = self._last_step("test/fitness") >= last.step
        if not is_there:
            self._send(_metrics(values, last))

    def close(self, is_finished: bool) -> None:
        """Set the status of the run there."""
        with _refusals():
            self._client.set_terminated(self._id, "FINISHED" if is_finished else "KILLED")

    def _send(self, metrics: list[Any]) -> None:
        with _refusals():
            for k in range(0, len(metrics), MOST_METRICS):
                self._client.log_batch(self._id, metrics=metrics[k : k + MOST_METRICS])

    def _last_step(self, name: str) -> int:
        """Return the last step of a metric, -1 if there is none."""
        history = self._client.get_metric_history(self._id, name)
        return max((one.step for one in history), default=-1)


def _experiment(client: Any) -> str:
    """Return the id of the experiment, which is made if there is none."""
    name = os.environ.get(EXPERIMENT, "conevo")
    found = client.get_experiment_by_name(name)
    return str(found.experiment_id if found else client.create_experiment(name))


def _metrics(values: Mapping[str, float], row: Row) -> list[Any]:
    from mlflow.entities import Metric

    at = int(row.at * 1000)
    return [Metric(_name(name), value, at, row.step) for name, value in values.items()]


def _name(name: str) -> str:
    """Return a name with the letters that MLflow allows."""
    return OTHER.sub("-", name)


@contextmanager
def _refusals() -> Iterator[None]:
    """Convert the errors of MLflow, and those of the system, to one clear line."""
    try:
        yield
    except Exception as error:
        if not (isinstance(error, (ImportError, OSError)) or _is_own(error)):
            raise
        reason = " ".join(str(error).split())[:300]
        raise EnvironmentFailure(f"MLflow at {os.environ[URI]}: {reason}") from error


def _is_own(error: Exception) -> bool:
    return any(one.__module__.partition(".")[0] == "mlflow" for one in type(error).__mro__)
