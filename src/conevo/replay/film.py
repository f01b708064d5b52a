"""Films of what a team does: GIF by Pillow, MP4 by ffmpeg, and single pictures.

A file appears all at once: until it is finished it has a hidden name beside its own, and what ends
early leaves neither. Nothing is written over another file.
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from conevo.errors import EnvironmentFailure, UsageError
from conevo.playback.look import SPEED
from conevo.replay.film_frame import Painter
from conevo.runs.drafts import draft_of
from conevo.runs.durable import refuse_file, sync_directory, sync_file, writing

__all__ = [
    "FPS",
    "SIZES",
    "choose_format",
    "find_ffmpeg",
    "frames_of",
    "write_film",
    "write_gif",
    "write_mp4",
    "write_poster",
]

Progress = Callable[[int, int], None]

FPS = {"gif": 20, "mp4": SPEED}  # Choice: browsers show a GIF no faster
SIZES = {"gif": 480, "mp4": 720, "png": 720}  # Choice: of a world in pixels; GIFs are for slides
GIF_FRAMES = 250  # Choice: a GIF has about so many frames unless told otherwise
_SAMPLES = 16  # frames that a GIF's colours are taken from
_EXACT = 64  # of its 255 colours
_NO_FFMPEG = "MP4 needs ffmpeg: install it, or conevo[video], or make a GIF with --gif"


def choose_format(out: str | None, wanted: str = "") -> str:
    """Return what to make: "gif", "mp4" or "png".

    Args:
        out: the file's name if there is one.
        wanted: one of the three, or "": what the name ends in, else an MP4 if ffmpeg is there.

    Raises:
        UsageError: the name ends in something else, or ffmpeg is wanted and missing.
    """
    ending = Path(out).suffix[1:].lower() if out else ""
    kind = wanted or ending or ("mp4" if find_ffmpeg() else "gif")
    if out and ending != kind:
        raise UsageError(f"{out}: the name of a {kind.upper()} must end in .{kind}")
    if kind == "png" and not wanted:
        raise UsageError(f"{out}: a picture shows one iteration; choose it with --poster T")
    if kind not in ("gif", "mp4", "png"):
        raise UsageError(f"{out}: a film's name must end in .gif or .mp4")
    if kind == "mp4" and not find_ffmpeg():
        raise UsageError(_NO_FFMPEG)
    return kind


def frames_of(
    iterations: int,
    kind: str = "mp4",
    every: int | None = None,
    first: int | None = None,
    last: int | None = None,
) -> list[int]:
    """Return the frames of a film, the last one always among them.

    Args:
        iterations: of the epoch.
        kind: "mp4" shows every iteration unless told otherwise, "gif" 250 of them or a few less.
        every: iterations from one frame to the next.
        first: iteration, from 0.
        last: iteration, by default the epoch's.

    Raises:
        UsageError: nothing is left to be shown.
    """
    begin = 0 if first is None else first
    end = iterations - 1 if last is None else last
    if not 0 <= begin <= end < iterations:
        raise UsageError(
            f"no iterations from {begin} to {end}: the epoch has 0 to {iterations - 1}"
        )
    if every is None:
        every = math.ceil((end - begin + 1) / GIF_FRAMES) if kind == "gif" else 1
    if every < 1:
        raise UsageError(f"every {every} iterations is not possible")
    frames = list(range(begin, end + 1, every))
    return frames if frames[-1] == end else [*frames, end]


def write_film(
    painter: Painter,
    path: Path,
    frames: Sequence[int],
    fps: int | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a GIF or an MP4, as the file's name says.

    Args:
        painter: of the frames.
        path: where to.
        frames: their numbers, at least one.
        fps: frames per second; GIF counts in hundredths of a second, so 50 at most.
        progress: told the frames done and all.

    Raises:
        UsageError: no frames, something is at ``path`` already, or ffmpeg is needed and missing.
        EnvironmentFailure: ffmpeg fails, or the file cannot be written.
    """
    kind = choose_format(str(path))
    write = {"gif": write_gif, "mp4": write_mp4}[kind]
    write(painter, path, frames, fps or FPS[kind], progress)


def write_poster(painter: Painter, path: Path, t: int) -> None:
    """Write the picture of one iteration as PNG.

    Raises:
        UsageError: no such iteration, or something is at ``path`` already.
        EnvironmentFailure: it cannot be written.
    """
    picture = painter.frame(t)
    with _appearing(path) as draft, draft.open("xb") as file:
        picture.save(file, "PNG", optimize=True)


def write_gif(
    painter: Painter,
    path: Path,
    frames: Sequence[int],
    fps: int = FPS["gif"],
    progress: Progress | None = None,
) -> None:
    """Write an animated GIF that repeats for ever; arguments and errors as of ``write_film``.

    All frames share 255 colours, so none flickers; equal ones in a row become one that lasts
    longer. Until they are written all are in memory, about a megabyte each.
    """
    if not frames:
        raise UsageError("the film has no frames")
    palette = _palette(painter.frame(t) for t in frames[:: -(-len(frames) // _SAMPLES)])

    def pictures() -> Iterator[Image.Image]:
        for done, t in enumerate(frames, start=1):
            yield painter.frame(t).quantize(palette=palette, dither=Image.Dither.NONE)
            if progress:
                progress(done, len(frames))

    with _appearing(path) as draft, draft.open("xb") as file:
        rest = pictures()
        next(rest).save(
            file, "GIF", save_all=True, append_images=rest, loop=0, disposal=1, optimize=True,
            duration=10 * max(round(100 / fps), 2),
        )  # fmt: skip


def write_mp4(
    painter: Painter,
    path: Path,
    frames: Sequence[int],
    fps: int = FPS["mp4"],
    progress: Progress | None = None,
) -> None:
    """Write an MP4 that players of all kinds show: H.264, yuv420p, its index at the beginning.

    Arguments and errors are those of ``write_film``. The same frames give the same bytes with the
    same ffmpeg, a process of its own that has ended when this returns or raises.
    """
    ffmpeg = find_ffmpeg()
    if ffmpeg is None:
        raise UsageError(_NO_FFMPEG)
    if not frames:
        raise UsageError("the film has no frames")
    with _appearing(path) as draft, tempfile.TemporaryFile() as said:
        command = _command(ffmpeg, painter.size, fps, draft)
        with _running(command, said) as process:
            pipe = process.stdin
            assert pipe is not None
            with suppress(BrokenPipeError):  # it reads no more: what it said tells why
                for done, t in enumerate(frames, start=1):
                    pipe.write(painter.frame(t).tobytes())
                    if progress:
                        progress(done, len(frames))
                pipe.close()
            process.wait()
        if process.returncode != 0:
            said.seek(0)
            raise EnvironmentFailure(_why(path, said.read().decode(errors="replace"), draft))


def find_ffmpeg() -> str | None:
    """Return ffmpeg on this machine, else that of the package imageio-ffmpeg, else None."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError:
        return None
    try:
        exe: str = get_ffmpeg_exe()
    except RuntimeError:  # the package is there, without an ffmpeg
        return None
    return exe


# --- files ----------------------------------------------------------------------------------------


@contextmanager
def _appearing(path: Path) -> Iterator[Path]:
    """Yield a hidden place; the file that is written there then becomes ``path``."""
    refuse_file(path)
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with draft_of(path) as draft:
            yield draft
            sync_file(draft)
            refuse_file(path)
            draft.rename(path)
            sync_directory(path.parent)


# --- MP4 ------------------------------------------------------------------------------------------


def _command(ffmpeg: str, size: tuple[int, int], fps: int, draft: Path) -> list[str]:
    """Return the call of ffmpeg that reads frames in red, green and blue from its input."""
    frames = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}"]
    colours = ["-vf", "scale=flags=accurate_rnd:out_color_matrix=bt709:out_range=tv,format=yuv420p"]
    colours += ["-color_range", "tv", "-colorspace", "bt709"]
    colours += ["-color_primaries", "bt709", "-color_trc", "bt709"]
    # Choice: "veryfast" at quality 20 with a simple search for motion: slower settings gain little
    # on drawn pictures. Two threads on every machine, so that the bytes are the same.
    video = ["-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-threads", "2"]
    video += ["-x264-params", "me=dia:subme=1"]
    exact = ["-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact"]
    return [
        *(ffmpeg, "-nostdin", "-hide_banner", "-loglevel", "error", "-y"),
        *(*frames, "-r", str(fps), "-i", "pipe:0", *colours),
        *(*video, *exact, "-movflags", "+faststart"),
        *("-f", "mp4", f"file:{draft.absolute()}"),
    ]


@contextmanager
def _running(command: list[str], said: IO[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a process that reads what is written to it; it has ended afterwards in any case."""
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=said,
        process_group=0,  # an interrupt is for us, who then end it
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        if process.stdin is not None:
            with suppress(OSError):
                process.stdin.close()


def _why(path: Path, said: str, draft: Path) -> str:
    """Return one line about why ffmpeg failed."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    reason = re.sub(r"^\[[^]]*\] ", "", lines[0]) if lines else "it gave no reason"
    reason = reason.replace(f"file:{draft.absolute()}", str(path)).replace(str(draft), str(path))
    return f"ffmpeg could not write {path}: {reason}"


# --- GIF ------------------------------------------------------------------------------------------


def _palette(samples: Iterable[Image.Image]) -> Image.Image:
    """Return a picture whose palette has at most 255 colours, the most frequent of some pictures.

    The first of them serve areas, text and robots, and are found again exactly: Pillow looks up the
    colour that is nearest to the lower corner of a cube of 4 x 4 x 4. Others are well apart.
    """
    counts: Counter[Any] = Counter()
    for sample in samples:
        found: Any = sample.getcolors(1 << 24)
        counts.update({colour: n for n, colour in found})
    left = np.array([colour for colour, _ in counts.most_common()])
    kept: list[list[int]] = []
    while len(left) and len(kept) < 255:
        one = left[0]
        kept.append(one.tolist())
        if len(kept) <= _EXACT:
            corner, corners = one & ~3, left & ~3
            is_alike = _apart(left, corner) <= _apart(one, corner)
            is_alike |= _apart(one, corners) <= _apart(left, corners)
        else:
            is_alike = np.abs(left - one).max(axis=1) < 8
        left = left[~is_alike]
    palette = Image.new("P", (1, 1))
    palette.putpalette([part for colour in kept for part in colour])
    return palette


def _apart(some: npt.NDArray[Any], others: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the squared distances between colours [..., 3]."""
    return np.asarray(((some - others) ** 2).sum(axis=-1))
