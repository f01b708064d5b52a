"""Start a tracker for a run that is about to be evolved; the run neither waits for it nor joins it.

The tracker has a session of its own, so Ctrl-C ends the run only; it has no input, and its output
is in a log next to its series, outside the run's directory, whose files are sealed.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from conevo.track.trackers import Tracker
from conevo.track.tracking import TRACKS, folder_of

__all__ = ["spawn"]


def spawn(path: Path, kind: Tracker, out: Path = TRACKS) -> str:
    """Start a tracker that follows a run, a shaping or a campaign.

    Args:
        path: its directory.
        kind: the tracker.
        out: folder of what trackers write.

    Returns:
        A line about it: where its log is, or why it could not be started.
    """
    log = folder_of(path, kind, out) / f"{path.resolve().name}.track.log"
    command = [sys.executable, "-m", "conevo", "track", str(path), "--to", kind.name]
    command += ["--follow", "--out", str(out)]
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("ab") as output:
            subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
    except OSError as error:
        return f"not tracked: {error}"
    return f"tracked by a process of its own; its log is {log}"
