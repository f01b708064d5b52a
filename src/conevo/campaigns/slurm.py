"""A campaign as a SLURM job array: a script that is submitted by hand, without a coordinator.

Each task of the array executes its share of the runs, one by one, with the same worker as all
executors. Before its time is up SLURM signals the script, which lets its worker write a checkpoint
and requeues the task, so no run needs to fit into one job. Starting the campaign as usual then
finds the finished runs, and finishes the others.
"""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from conevo.campaigns.devices import AUTO, CPU, parse_devices
from conevo.campaigns.ended import read_ended
from conevo.campaigns.executors.local import ONE_THREAD
from conevo.campaigns.paths import Paths
from conevo.errors import UsageError, shown
from conevo.runs.durable import replace_file

__all__ = ["check_request", "write_array"]

TASKS = 1000  # SLURM takes array indices below 1001 unless a site allows more
GRACE = 180  # seconds before the end at which SLURM signals the script
MOST_HOURS = 8760  # a year
OURS = {  # options that the script sets, and conevo's option for each
    "array": "--at-once",
    "cpus-per-task": "--threads",
    "time": "--hours",
    **dict.fromkeys(("job-name", "signal", "requeue", "no-requeue", "output", "wrap", "ntasks")),
}
OPTION = re.compile(r"--([a-z][a-z0-9-]*)(=[A-Za-z0-9_.,:;/=+@%*&|!()\[\]{}<>~^-]+)?")

SCRIPT = """\
#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --array=0-{last}{at_once}
#SBATCH --cpus-per-task={threads}
#SBATCH --time={minutes}
#SBATCH --signal=B:USR1@{grace}
#SBATCH --requeue
#SBATCH --output=/dev/null
{options}# Runs: {n_runs}, tasks: {tasks}. Submit this file with sbatch.
set -u
campaign={campaign}
runs=(
{runs}
)
export {variables}
mkdir -p "$campaign/logs"
exec >> "$campaign/logs/slurm-$SLURM_ARRAY_TASK_ID.txt" 2>&1
{check}leaving= failed=
trap 'leaving=requeue; exec 3>&-' USR1  # the worker leaves when its stdin ends
trap 'leaving=end; exec 3>&-' TERM
for ((k = SLURM_ARRAY_TASK_ID; k < {n_runs}; k += {tasks})); do
    label=${{runs[k]}}
    if grep -qs '"status": "finished"' "$campaign/ended/$label.json"; then continue; fi
    echo "$(date -Is) $(hostname) $label"
    exec 3> >(exec {python} -m conevo.campaigns.worker "$campaign" "$label" \\
        "$SLURM_CPUS_PER_TASK"{device} \\
        >> "$campaign/logs/$label.txt" 2>&1)
    worker=$!
    while kill -0 "$worker" 2> /dev/null; do wait "$worker"; done  # a signal interrupts wait
    exec 3>&-
    case $leaving in
        # SLURM_JOB_ID of one of the tasks is that of the whole array, which would be requeued
        requeue) exec scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID" ;;
        end) exit 143 ;;
    esac
    grep -qs '"status": "finished"' "$campaign/ended/$label.json" || failed=yes
done
[ -z "$failed" ]  # SLURM lists a task as failed if one of its runs is
"""

# A node without the device ends its task with one line, before any of its runs starts.
CHECK = """\
{python} -m conevo.campaigns.devices {device} || exit 3
"""


def write_array(
    root: Path,
    labels: Sequence[str],
    *,
    threads: int = 1,
    hours: float = 24.0,
    at_once: int | None = None,
    options: Sequence[str] = (),
    device: str | None = None,
    python: str = sys.executable,
) -> Path:
    """Write ``slurm.sh`` into a campaign's directory; nothing is submitted.

    Args:
        root: the campaign's directory, which must have the same path on all nodes.
        labels: of the runs to execute.
        threads: CPU threads of a run.
        hours: time limit of a task; unfinished runs are requeued.
        at_once: largest number of tasks at the same time; no limit by default.
        options: of sbatch, for every task: "--gres=gpu:1"; see ``check_request``.
        device: "auto", "cpu" or a CUDA device of every node; by default runs start on the CPU, and
            continue on their previous device.
        python: the interpreter on the nodes.

    Raises:
        UsageError: no runs, less time than a worker has to leave, or an option that is not allowed.
        EnvironmentFailure: the file cannot be written.
    """
    if not labels:
        raise UsageError(f"{root} has no unfinished run")
    check_request(hours, options, device)
    root = root.resolve()
    path = root / "slurm.sh"
    tasks = min(len(labels), TASKS)
    check = CHECK.format(python=shlex.quote(python), device=device)
    text = SCRIPT.format(
        name=re.sub(r"[^A-Za-z0-9._-]", "_", f"conevo-{root.name}"),
        last=tasks - 1,
        at_once=f"%{at_once}" if at_once else "",
        threads=threads,
        minutes=int(hours * 60),
        grace=GRACE,
        options="".join(f"#SBATCH {option}\n" for option in options),
        n_runs=len(labels),
        tasks=tasks,
        campaign=shlex.quote(str(root)),
        runs="\n".join(shlex.quote(label) for label in labels),
        variables=" ".join(f"{name}=1" for name in ONE_THREAD),
        python=shlex.quote(python),
        device=f" {device}" if device else "",
        check="" if device in (None, AUTO, CPU) else check,
    )
    for label in labels:  # the script would skip a run that was finished before it was extended
        ended = Paths(root).ended(label)
        if (found := read_ended(ended)) is None or found["status"] == "finished":
            ended.unlink(missing_ok=True)
    replace_file(path, text.encode())
    return path


def check_request(hours: float, options: Sequence[str], device: str | None = None) -> None:
    """Refuse a time limit, options or devices with which the script would not work.

    Raises:
        UsageError: less time than a worker has to leave, or more than a year; an option that is not
            ``--NAME`` or ``--NAME=VALUE`` in characters that ``#SBATCH`` lines take unquoted, that
            is the script's own, or that is given twice; several devices.
    """
    if device and len(parse_devices(device)) > 1:
        raise UsageError(f"--device {device}: a task of the array has one device, cpu or cuda")
    if not 2 * GRACE <= hours * 3600 <= MOST_HOURS * 3600:
        raise UsageError(
            f"--hours {hours:g}: must be from {2 * GRACE / 3600:g} (a worker has {GRACE} s to "
            f"leave) to {MOST_HOURS}"
        )
    seen = set()
    for option in options:
        match = OPTION.fullmatch(option)
        if match is None:
            raise UsageError(
                f"{shown(option)} is not an option for sbatch: write --NAME or --NAME=VALUE, "
                f"without spaces, quotes and #, for example --gres=gpu:1"
            )
        name = match[1]
        if name in OURS:
            instead = f"use conevo's {OURS[name]}" if OURS[name] else "leave it out"
            raise UsageError(f"{option}: conevo sets --{name} itself; {instead}")
        if name in seen:
            raise UsageError(f"--{name} for sbatch is given twice")
        seen.add(name)
