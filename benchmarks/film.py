"""Time and size of films: an epoch of 20 rovers among rocks, 2,500 iterations, drawing included.

The team has random networks, or is the champion of a run (``--run``); teams that detect more are
more work. Each film is written by a separate process. "core s" is the time of all cores, of conevo
and of ffmpeg.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from conevo.replay.film import find_ffmpeg
from conevo.replay.recording import record
from conevo.replay.trajectory import Trajectory
from conevo.runs.run import Run
from machine import machine, spread, table

ROOT = Path(__file__).resolve().parent.parent
FILMS = (  # ending, size in px, number of teams next to each other
    ("mp4", 720, 1),
    ("mp4", 480, 1),
    ("mp4", 720, 2),
    ("gif", 720, 1),
    ("gif", 480, 1),
)
MEASURED = """
import json, resource, sys, time
from pathlib import Path
epoch, path, size, teams = Path(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:])
began = time.perf_counter()
from conevo.replay.film import frames_of, write_film
from conevo.replay.film_frame import Painter
from conevo.replay.playback import playback_of
from conevo.replay.trajectory import Trajectory
painter = Painter([playback_of(Trajectory.load(epoch))] * teams, size)
frames = frames_of(painter.iterations, path.suffix[1:])
write_film(painter, path, frames)
wall = time.perf_counter() - began
used = [resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
print(json.dumps({
    "wall": wall,
    "conevo": used[0].ru_utime + used[0].ru_stime,
    "ffmpeg": used[1].ru_utime + used[1].ru_stime,
    "memory": int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024,
    "frames": len(frames),
    "picture": painter.size,
    "file": path.stat().st_size / 1e6,
}))
"""


def measure(epoch: Path, ending: str, size: int, teams: int) -> dict[str, float | list[int]]:
    """Write a film and return its times, memory and size."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"epoch.{ending}"
        command = [sys.executable, "-c", MEASURED, str(epoch), str(path), str(size), str(teams)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, float | list[int]] = json.loads(done.stdout)
    return found


def rover_epoch(run: str | None, iterations: int) -> Trajectory:
    """Return an epoch of the champion of a run, or of random networks."""
    if run:
        return record(Run(Path(run)))
    sys.path.insert(0, str(ROOT / "tests"))
    from replay.epochs import epoch

    made: Trajectory = epoch("rover/complex-5", iterations=iterations)
    return made


def main() -> None:
    """Measure all films and print a markdown table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", metavar="RUN", help="a run, for the champion's epoch")
    parser.add_argument("--iterations", type=int, default=2500, help="of random networks' epoch")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    print(machine("conevo", "numpy", "pillow"))
    print(f"ffmpeg: {Path(find_ffmpeg() or 'none').name}\n")
    trajectory = rover_epoch(options.run, options.iterations)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        epoch = Path(folder) / "epoch.npz"
        trajectory.save(epoch)
        for ending, size, teams in FILMS:
            runs = [measure(epoch, ending, size, teams) for _ in range(options.repeats)]
            last = runs[-1]
            numbers = ["{} ({})".format(*spread([r[key] for r in runs], 1, 1)) for key in
                       ("wall", "conevo", "ffmpeg")]  # fmt: skip
            picture = "{} x {}".format(*last["picture"])
            size_mb, peak = f"{last['file']:.1f}", f"{last['memory']:.0f}"
            rows.append([ending, teams, picture, last["frames"], *numbers, peak, size_mb])
    head = ["film", "teams", "px", "frames", "s", "core s, conevo", "core s, ffmpeg"]
    print(table([*head, "peak MiB", "MB"], rows))
    about = trajectory.about
    print(f"\n{about['n_robots']} robots, {about['iterations']} iterations; {machine()}")


if __name__ == "__main__":
    main()
