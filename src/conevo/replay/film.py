"""Films of a team: GIF by Pillow, MP4 by ffmpeg, and single pictures.

A file appears all at once: until it is finished it has a hidden name in the same folder, and an
interrupted one leaves nothing. Existing files are never overwritten.
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from conevo.errors import EnvironmentFailure, UsageError
from conevo.playback.look import SPEED
from conevo.replay.film_frame import Painter
from conevo.runs.durable import appearing_file

__all__ = [
    "FPS",
    "SIZES",
    "choose_format",
    "find_ffmpeg",
    "frames_of",
    "write_film",
    "write_poster",
]

Progress = Callable[[int, int], None]

FPS = {"gif": 20, "mp4": SPEED}  # Choice: browsers show a GIF no faster
SIZES = {"gif": 480, "mp4": 720, "png": 720}  # Choice: of a world in pixels; GIFs are for slides
GIF_FRAMES = 250  # Choice: frames of a GIF by default, about
_SAMPLES = 16  # frames that a GIF's colours are taken from
_EXACT = 64  # of its 255 colours
_NO_FFMPEG = "MP4 needs ffmpeg: install it, or conevo[video], or make a GIF with --gif"


def choose_format(out: str | None, wanted: str = "") -> str:
    """Return the format: "gif", "mp4" or "png".

    Args:
        out: name of the file, if it is given.
        wanted: one of the three, or "": that of the name, else MP4 if ffmpeg is installed.

    Raises:
        UsageError: the name ends differently, or ffmpeg is needed and missing.
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
    """Return the frames of a film, always with the last one.

    Args:
        iterations: of the epoch.
        kind: by default "mp4" shows every iteration, "gif" 250 of them or a few less.
        every: iterations from one frame to the next.
        first: iteration, from 0.
        last: iteration, by default the epoch's.

    Raises:
        UsageError: no frames are left.
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
    """Write a GIF or an MP4, according to the file's name.

    Args:
        painter: of the frames.
        path: of the file.
        frames: their numbers, at least one.
        fps: frames per second; GIF counts in hundredths of a second, so 50 at most.
        progress: called with the number of finished frames and of all.

    Raises:
        UsageError: no frames, ``path`` exists, or ffmpeg is needed and missing.
        EnvironmentFailure: ffmpeg fails, or the file cannot be written.
    """
    kind = choose_format(str(path))
    fps = fps or FPS[kind]
    if not frames:
        raise UsageError("the film has no frames")

    def pictures() -> Iterator[Image.Image]:
        for done, t in enumerate(frames, start=1):
            yield painter.frame(t)
            if progress:
                progress(done, len(frames))

    with appearing_file(path) as draft:
        if kind == "gif":
            samples = (painter.frame(t) for t in frames[:: -(-len(frames) // _SAMPLES)])
            _save_gif(pictures(), _palette(samples), fps, draft)
        else:
            _save_mp4(pictures(), _command(painter.size, fps, draft), path, draft)


def write_poster(painter: Painter, path: Path, t: int) -> None:
    """Write the picture of one iteration as PNG.

    Raises:
        UsageError: no such iteration, or ``path`` exists.
        EnvironmentFailure: it cannot be written.
    """
    picture = painter.frame(t)
    with appearing_file(path) as draft, draft.open("xb") as file:
        picture.save(file, "PNG", optimize=True)


def find_ffmpeg() -> str | None:
    """Return ffmpeg on this machine, else that of the package imageio-ffmpeg, else None."""
    if found := shutil.which("ffmpeg"):
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):  # no such package, or one without an ffmpeg
        return None


# --- MP4 ------------------------------------------------------------------------------------------


def _command(size: tuple[int, int], fps: int, draft: Path) -> list[str]:
    """Return the call of ffmpeg that reads frames in red, green and blue from its input.

    It writes H.264 in yuv420p with the index at the beginning, which all players can show.
    """
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
        *(find_ffmpeg() or "ffmpeg", "-nostdin", "-hide_banner", "-loglevel", "error", "-y"),
        *(*frames, "-r", str(fps), "-i", "pipe:0", *colours),
        *(*video, *exact, "-movflags", "+faststart"),
        *("-f", "mp4", f"file:{draft.absolute()}"),
    ]


def _save_mp4(pictures: Iterable[Image.Image], command: list[str], path: Path, draft: Path) -> None:
    """Have ffmpeg write a draft of ``path``; its process has ended when this returns or raises.

    The same pictures give the same bytes with the same ffmpeg.
    """
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            process_group=0,  # Ctrl-C is for this process, which then ends ffmpeg
        )
        pipe = process.stdin
        assert pipe is not None
        try:
            with suppress(BrokenPipeError):  # ffmpeg has failed: its errors give the reason
                for picture in pictures:
                    pipe.write(picture.tobytes())
                pipe.close()
            process.wait()
        finally:
            process.kill()
            process.wait()
            with suppress(OSError):
                pipe.close()
        if process.returncode != 0:
            errors.seek(0)
            raise EnvironmentFailure(_why(path, errors.read().decode(errors="replace"), draft))


def _why(path: Path, output: str, draft: Path) -> str:
    """Return one line about why ffmpeg failed."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    reason = re.sub(r"^\[[^]]*\] ", "", lines[0]) if lines else "it gave no reason"
    reason = reason.replace(f"file:{draft.absolute()}", str(path)).replace(str(draft), str(path))
    return f"ffmpeg could not write {path}: {reason}"


# --- GIF ------------------------------------------------------------------------------------------


def _save_gif(pictures: Iterable[Image.Image], palette: Image.Image, fps: int, draft: Path) -> None:
    """Write a GIF that repeats for ever.

    All frames have the colours of one palette, so none flickers. Equal ones in a row become one
    that lasts longer. Pillow keeps all in memory until it writes them.
    """
    frames = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures)
    with draft.open("xb") as file:
        next(frames).save(
            file, "GIF", save_all=True, append_images=frames, loop=0, disposal=1, optimize=True,
            duration=10 * max(round(100 / fps), 2),
        )  # fmt: skip


def _palette(samples: Iterable[Image.Image]) -> Image.Image:
    """Return a picture whose palette has at most 255 colours, the most frequent of some pictures.

    The first of them are those of areas, text and robots, and stay exact: Pillow looks up the
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
