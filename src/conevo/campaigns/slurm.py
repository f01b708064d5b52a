"""A campaign as a SLURM job array: a script that is submitted by hand, without a coordinator.

Each task of the array carries out its share of the runs, one by one, with the same worker as all
executors. Before its time is up SLURM signals the script, which lets its worker write a checkpoint
and puts the task back into the queue, so that no run needs to fit into one job. Starting the
campaign as usual then finds what is finished, and finishes what is not.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from conevo.campaigns.executors import ONE_THREAD
from conevo.errors import UsageError
from conevo.runs.durable import replace_file

__all__ = ["write_array"]

TASKS = 1000  # SLURM takes array indices below 1001 unless a site allows more
GRACE = 180  # seconds before the end at which SLURM signals the script

SCRIPT = """\
#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --array=0-{last}{at_once}
#SBATCH --cpus-per-task={threads}
#SBATCH --time={minutes}
#SBATCH --signal=B:USR1@{grace}
#SBATCH --requeue
#SBATCH --output=/dev/null
# {n_runs} runs in {tasks} tasks. Submit with: sbatch [--partition=... --account=...] {path}
set -u
campaign={campaign}
export {variables}
mkdir -p "$campaign/logs"
exec >> "$campaign/logs/slurm-$SLURM_ARRAY_TASK_ID.txt" 2>&1
leaving=
trap 'leaving=yes; exec 3>&-' USR1 TERM  # the worker leaves when its stdin ends
for ((line = SLURM_ARRAY_TASK_ID + 1; line <= {n_runs}; line += {tasks})); do
    label=$(sed -n "${{line}}p" "$campaign/slurm-runs.txt")
    if grep -qs '"status": "finished"' "$campaign/ended/$label.json"; then continue; fi
    echo "$(date -Is) $(hostname) $label"
    exec 3> >(exec {python} -m conevo.campaigns.work "$campaign" "$label" "$SLURM_CPUS_PER_TASK" \\
        >> "$campaign/logs/$label.txt" 2>&1)
    worker=$!
    while kill -0 "$worker" 2> /dev/null; do wait "$worker"; done  # a signal interrupts wait
    exec 3>&-
    if [ "$leaving" ]; then exec scontrol requeue "$SLURM_JOB_ID"; fi
done
"""


def write_array(
    root: Path,
    labels: Sequence[str],
    *,
    threads: int = 1,
    hours: float = 24.0,
    at_once: int | None = None,
    python: str = sys.executable,
) -> Path:
    """Write ``slurm.sh`` and ``slurm-runs.txt`` into a campaign's directory; nothing is submitted.

    Args:
        root: the campaign's directory, which all nodes must see under the same path.
        labels: of the runs to carry out.
        threads: CPU threads of a run.
        hours: time limit of a task; what takes longer is put into the queue again.
        at_once: tasks that may be at work together; no limit by default.
        python: the interpreter on the nodes.

    Raises:
        UsageError: no runs, or less time than a worker is given to leave.
        EnvironmentFailure: the files cannot be written.
    """
    if not labels:
        raise UsageError(f"{root} has no run left to carry out")
    minutes = int(hours * 60)
    if minutes * 60 < 2 * GRACE:
        raise UsageError(f"{hours:g} hours are too short: a worker has {GRACE} s to leave")
    root = root.resolve()
    path = root / "slurm.sh"
    tasks = min(len(labels), TASKS)
    text = SCRIPT.format(
        name=f"conevo-{root.name}",
        last=tasks - 1,
        at_once=f"%{at_once}" if at_once else "",
        threads=threads,
        minutes=minutes,
        grace=GRACE,
        n_runs=len(labels),
        tasks=tasks,
        path=shlex.quote(str(path)),
        campaign=shlex.quote(str(root)),
        variables=" ".join(f"{name}=1" for name in ONE_THREAD),
        python=shlex.quote(python),
    )
    replace_file(root / "slurm-runs.txt", "".join(f"{label}\n" for label in labels).encode())
    replace_file(path, text.encode())
    return path
