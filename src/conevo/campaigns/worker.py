"""A worker: carries one run of a campaign to its end, whether it has begun or not.

``python -m conevo.campaigns.worker CAMPAIGN LABEL THREADS [DEVICE]`` is the unit of work of every
executor. It is idempotent: a finished run is left alone, and an interrupted one continues from its
checkpoint. ``ended/LABEL.json`` records how it ended.
"""

from __future__ import annotations

import _thread
import os
import platform
import resource
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from conevo.campaigns.admission import admit_code
from conevo.campaigns.devices import CPU
from conevo.campaigns.inputs import located
from conevo.campaigns.paths import Paths
from conevo.campaigns.plan import PlannedRun
from conevo.campaigns.plan_file import STUDIES
from conevo.errors import ConevoError, EnvironmentFailure, UsageError
from conevo.outside import line_of
from conevo.reading import check, read_json_lines
from conevo.runs.directory import as_json, kind_of
from conevo.runs.durable import replace_file
from conevo.runs.run import Run
from conevo.runs.shaping import Shaping, start_stages
from conevo.runs.start import start
from conevo.runs.time_limit import TimeLimit

__all__ = ["carry_out", "core_seconds", "main", "planned_runs"]

PATIENCE = 600.0  # seconds to wait for another worker that is just about to leave a run


class _InUse(Exception):
    """Another worker has the run, and keeps it."""


def planned_runs(root: Path) -> dict[str, PlannedRun]:
    """Return the runs of a campaign by label, in the order of the plan.

    Raises:
        UsageError: the list is damaged.
        EnvironmentFailure: it cannot be read.
    """
    path = Paths(root).runs
    runs: list[PlannedRun] = [
        check(line, PlannedRun, f"{path} is damaged in line {number}")
        for number, line in enumerate(read_json_lines(path), 1)
    ]
    if not runs:
        raise UsageError(f"{path} is damaged: it lists no runs")
    return {run.label: run.mapped(lambda value: located(value, root)) for run in runs}


def carry_out(
    root: Path,
    label: str,
    threads: int,
    *,
    device: str | None = None,
    limit: TimeLimit | None = None,
    spent_before: float = 0.0,
) -> bool:
    """Carry a run to its end, study it, and record how it ended.

    Args:
        root: the campaign's directory.
        label: of the run.
        threads: CPU threads; results do not depend on it.
        device: by default the CPU for a new run, and the previous device for one that has begun.
        limit: the time left for evolution, no limit by default.
        spent_before: core seconds of this process that are not the run's.

    Returns:
        Whether it is finished. If not, ``ended/LABEL.json`` gives the reason, unless another worker
        has the run or its time is over.
    """
    began = time.perf_counter()
    ending: dict[str, Any] = {"status": "finished", "origin": "", "message": "", "traceback": ""}
    try:
        paths = Paths(root)
        planned = planned_runs(root)
        if label not in planned:
            raise UsageError(f"{root} has no run {label!r} in its plan")
        admit_code(paths, planned)
        found = _evolve(paths, planned[label], threads, device, limit or TimeLimit(None))
        if found.status != "finished":
            return False  # its time was over
        _study(paths, planned[label], found, threads)
    except _InUse:
        sys.stderr.write(f"{label} is in use by another worker, which will finish it\n")
        return False  # the other worker records how it ended
    except (Exception, SystemExit) as error:
        ending = {"status": "failed", **_describe(error)}
    ending |= {
        "threads": threads,
        "core_seconds": round(core_seconds() - spent_before, 3),
        "wall_seconds": round(time.perf_counter() - began, 3),
        "host": platform.node(),
    }
    path = Paths(root).ended(label)
    path.parent.mkdir(exist_ok=True)
    replace_file(path, as_json(ending))
    return bool(ending["status"] == "finished")


def core_seconds() -> float:
    """Return the core seconds that this process has used."""
    spent = resource.getrusage(resource.RUSAGE_SELF)
    return spent.ru_utime + spent.ru_stime


def _describe(error: BaseException) -> dict[str, str]:
    """Return the origin and message of an error, and the traceback of one that is unexpected."""
    if isinstance(error, ConevoError):
        # A file that was there when the campaign started may be missing on one machine only.
        is_machine = isinstance(error, EnvironmentFailure) or isinstance(
            error.__cause__, FileNotFoundError
        )
        origin = "machine" if is_machine else "request"
        return {"origin": origin, "message": str(error), "traceback": ""}
    trace = traceback.format_exc()
    if line := line_of(error):
        return {"origin": "request", "message": line, "traceback": trace}
    last = traceback.extract_tb(error.__traceback__)[-1]
    message = f"{error!r} in {last.name} ({last.filename}:{last.lineno})"
    return {"origin": "program", "message": message, "traceback": trace}


def _evolve(
    paths: Paths, planned: PlannedRun, threads: int, device: str | None, limit: TimeLimit
) -> Run | Shaping:
    """Return the run, which is finished unless its time was over."""
    path = paths.run(planned.label)
    found: Run | Shaping
    if kind_of(path):
        found = Shaping(path) if kind_of(path) == "shaping" else Run(path)
    else:
        configs = planned.configs()
        command = f"conevo campaign start, run {planned.label}"
        how: dict[str, Any] = {"threads": threads, "device": device or CPU, "command": command}
        if planned.in_stages:
            found = start_stages(configs, path, **how)
        else:
            found = start(configs[0], path, **how)
    longer = None if found.run_ids == planned.run_ids else planned.configs()[0]
    if longer and (isinstance(found, Shaping) or found.provenance.get("stem_id") != longer.stem_id):
        raise UsageError(f"{path} is not the run that was planned; move it away and retry")
    deadline = time.monotonic() + PATIENCE
    while found.status == "running" and time.monotonic() < deadline:
        time.sleep(0.2)
    if found.status == "running":
        raise _InUse
    how = {"threads": threads, "device": device, "accept_other_code": True}
    if longer and isinstance(found, Run):
        for kind in STUDIES:  # of a team and populations that will change
            paths.study(planned.label, kind).unlink(missing_ok=True)
        found.extend_as(longer, **how)
    if found.status != "finished":
        found.resume(time_limit=limit, progress=False, **how)
    return found


def _study(paths: Paths, planned: PlannedRun, found: Run | Shaping, threads: int) -> None:
    """Make the missing studies of a run, or of every stage.

    If another method evolved the first stage, only the second is studied.
    """
    from conevo.studies.signal import signal_study
    from conevo.studies.team_study import study

    make: dict[str, Callable[..., Any]] = {"teams": study, "signal": signal_study}
    runs = [found] if isinstance(found, Run) else found.stages[-len(planned.courses) :]
    for name, run in zip(planned.courses, runs, strict=True):
        for kind in planned.studies:
            path = paths.study(name, kind)
            if not path.is_file():
                path.parent.mkdir(parents=True, exist_ok=True)
                replace_file(path, as_json(make[kind](run, threads=threads)))


def main() -> None:
    """Carry out one run; end when the coordinator does, which has the other end of stdin."""
    root, label, threads, *rest = sys.argv[1:]
    # A shell's background jobs ignore interrupts, and so do processes that they start.
    signal.signal(signal.SIGINT, signal.default_int_handler)

    def leave_with_coordinator() -> None:
        sys.stdin.buffer.read()
        _thread.interrupt_main()  # like Ctrl-C: the run writes its checkpoint

    if not sys.stdin.isatty():
        threading.Thread(target=leave_with_coordinator, daemon=True).start()
    try:
        is_finished = carry_out(Path(root), label, int(threads), device=next(iter(rest), None))
    except KeyboardInterrupt:
        os._exit(130)
    sys.stdout.flush()
    os._exit(0 if is_finished else 1)  # the thread that reads stdin never ends by itself


if __name__ == "__main__":
    main()
