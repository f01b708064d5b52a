"""Films: files are complete and readable, and never replace others."""

import os
import shutil
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pytest
from PIL import Image

from conevo import palette
from conevo.errors import EnvironmentFailure, UsageError
from conevo.replay import film
from conevo.replay.drawing.panel import PAGE, Panel
from conevo.replay.film_frame import Painter
from replay.filmed import GONE, SIZE, T, near, playback, rgb

needs_ffmpeg = pytest.mark.skipif(film.find_ffmpeg() is None, reason="there is no ffmpeg")


# --- which frames, which file ---------------------------------------------------------------------


def test_frames():
    assert film.frames_of(5) == [0, 1, 2, 3, 4]
    assert film.frames_of(10, every=4) == [0, 4, 8, 9]
    assert film.frames_of(10, every=3) == [0, 3, 6, 9]
    assert film.frames_of(100, first=90, last=92) == [90, 91, 92]
    gif = film.frames_of(2500, "gif")
    assert gif[:3] == [0, 10, 20]
    assert (gif[-1], len(gif)) == (2499, 251)
    assert film.frames_of(200, "gif") == list(range(200))
    for wrong in (
        {"first": 10},
        {"last": 10},
        {"first": 3, "last": 2},
        {"first": -1},
        {"every": 0},
    ):
        with pytest.raises(UsageError):
            film.frames_of(10, **wrong)


def test_the_format_follows_from_option_name_and_machine(monkeypatch):
    monkeypatch.setattr(film, "find_ffmpeg", lambda: "ffmpeg")
    assert film.choose_format(None) == "mp4"
    assert film.choose_format("a.GIF") == "gif"
    assert film.choose_format("a.png", "png") == "png"
    for out, wanted in (("a.gif", "mp4"), ("a", "gif"), ("a.avi", ""), ("a.png", ""), ("a", "")):
        with pytest.raises(UsageError):
            film.choose_format(out, wanted)
    monkeypatch.setattr(film, "find_ffmpeg", lambda: None)
    assert film.choose_format(None) == "gif"
    with pytest.raises(UsageError, match=r"conevo\[video\].*--gif"):
        film.choose_format(None, "mp4")


def test_ffmpeg_of_the_machine_comes_first(monkeypatch, tmp_path):
    own = tmp_path / "ffmpeg"
    own.write_text("#!/bin/sh\n")
    own.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert film.find_ffmpeg() == str(own)
    own.unlink()
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)  # as if it were not installed
    assert film.find_ffmpeg() is None


# --- GIF ------------------------------------------------------------------------------------------


def test_a_gif_read_again_shows_every_frame_for_its_time(tmp_path):
    path = tmp_path / "new" / "epoch.gif"
    painter = Painter([playback()], SIZE)
    frames = [0, 1, 1, GONE, GONE + 4, 39]
    progress = []
    film.write_film(painter, path, frames, 20, lambda done, total: progress.append((done, total)))
    assert progress == [(k, 6) for k in range(1, 7)]
    with Image.open(path) as gif:
        assert (gif.n_frames, gif.size, gif.info["loop"]) == (5, painter.size, 0)
        for k, t in enumerate(dict.fromkeys(frames)):
            gif.seek(k)
            assert gif.info["duration"] == 50 * frames.count(t)
            shown = np.asarray(gif.convert("RGB")).astype(int)
            wanted = np.asarray(painter.frame(t)).astype(int)
            assert np.abs(shown - wanted).max() <= 48
            assert np.abs(shown - wanted).mean() < 0.5
    assert [p.name for p in path.parent.iterdir()] == ["epoch.gif"]


def test_colours_of_a_gif_do_not_flicker(tmp_path):
    path = tmp_path / "epoch.gif"
    painter = Painter([playback(rings=())], SIZE)
    film.write_film(painter, path, list(range(0, T, 4)))
    panel = Panel(playback(), SIZE, "action", alone=True)
    x0, y0, x1, _ = panel.world
    scale = (x1 - x0) / 10
    colours = {"robot": set(), "ground": set(), "page": set()}
    with Image.open(path) as gif:
        for k in range(7):  # until its action changes
            gif.seek(k)
            picture = gif.convert("RGB")
            colours["robot"].add(picture.getpixel((x0 + int(3 * scale), y0 + int(3 * scale))))
            colours["ground"].add(picture.getpixel((x0 + int(9 * scale), y0 + int(6 * scale))))
            colours["page"].add(picture.getpixel((1, 1)))
    assert colours["page"] == {rgb(PAGE)}
    assert colours["ground"] == {rgb(palette.GROUND)}
    assert len(colours["robot"]) == 1
    assert near(colours["robot"].pop(), rgb(palette.ORANGE), by=3)


def test_a_gif_is_never_faster_than_the_format_allows(tmp_path):
    film.write_film(Painter([playback()], SIZE), tmp_path / "a.gif", [0, 1], fps=100)
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.info["duration"] == 20


# --- MP4 ------------------------------------------------------------------------------------------


def decoded(path, size):
    """Return the frames of a film [n, height, width, 3] and ffmpeg's description of it."""
    ffmpeg = film.find_ffmpeg()
    command = [ffmpeg, "-hide_banner", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    pixels = np.frombuffer(done.stdout, np.uint8)
    return pixels.reshape(-1, size[1], size[0], 3), done.stderr.decode()


@needs_ffmpeg
def test_an_mp4_read_again_shows_the_frames(tmp_path):
    path = tmp_path / "epoch.mp4"
    painter = Painter([playback()], SIZE)
    frames = film.frames_of(T, every=2)
    progress = []
    film.write_film(painter, path, frames, 25, lambda done, total: progress.append((done, total)))
    assert progress[-1] == (len(frames), len(frames))
    shown, description = decoded(path, painter.size)
    assert len(shown) == len(frames)
    assert "h264" in description
    assert "yuv420p(tv, bt709" in description
    assert "25 fps" in description
    panel = Panel(playback(), SIZE, "action", alone=True)
    x0, _, x1, y1 = panel.world
    scale = (x1 - x0) / 10
    for k, t in enumerate(frames):
        wanted = np.asarray(painter.frame(t)).astype(int)
        assert np.abs(shown[k] - wanted).mean() < 4
        robot = shown[k][y1 - round(2 * scale), x0 + round((2 + 0.1 * t) * scale)]
        assert near(robot.astype(int), rgb(palette.BLUE), by=25)
    head = path.read_bytes()
    assert head.index(b"moov") < head.index(b"mdat")
    assert [p.name for p in tmp_path.iterdir()] == ["epoch.mp4"]


@needs_ffmpeg
def test_the_same_film_has_the_same_bytes(tmp_path):
    for name in ("a.mp4", "b.mp4"):
        film.write_film(Painter([playback()], SIZE), tmp_path / name, range(0, T, 3))
    assert (tmp_path / "a.mp4").read_bytes() == (tmp_path / "b.mp4").read_bytes()


def failing(monkeypatch, tmp_path, script):
    """Replace ffmpeg by another program."""
    program = tmp_path / "bin" / "ffmpeg"
    program.parent.mkdir()
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setattr(film, "find_ffmpeg", lambda: str(program))
    (tmp_path / "out").mkdir()
    return tmp_path / "out" / "epoch.mp4"


@pytest.mark.parametrize(
    "script",
    [
        'echo "$0: No space left on device" >&2; exit 1',
        'cat >/dev/null; echo "[mp4 @ 0x1f] No space left on device" >&2; exit 1',
    ],
    ids=["at once", "in the end"],
)
def test_an_ffmpeg_that_fails_is_one_line_and_no_file(monkeypatch, tmp_path, script):
    path = failing(monkeypatch, tmp_path, script)
    with pytest.raises(EnvironmentFailure, match=r"could not write [^[]*No space left") as caught:
        film.write_film(Painter([playback()], SIZE), path, range(T))
    assert "\n" not in str(caught.value)
    assert list(path.parent.iterdir()) == []


def test_an_interrupt_ends_ffmpeg_and_leaves_nothing(monkeypatch, tmp_path):
    stays = "import sys, time; sys.stdin.buffer.read(); time.sleep(60)"
    draft = 'for last; do :; done; echo x > "${last#file:}"'
    script = f"echo $$ > {tmp_path}/pid; {draft}; exec {sys.executable} -c '{stays}'"
    path = failing(monkeypatch, tmp_path, script)

    def interrupt(done, total):
        deadline = time.monotonic() + 10
        while not list(path.parent.iterdir()) and time.monotonic() < deadline:
            time.sleep(0.01)
        assert list(path.parent.iterdir())  # a draft exists
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film.write_film(Painter([playback()], SIZE), path, range(T), progress=interrupt)
    assert list(path.parent.iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), signal.SIG_DFL)


def test_without_ffmpeg_the_message_gives_advice(monkeypatch, tmp_path):
    monkeypatch.setattr(film, "find_ffmpeg", lambda: None)
    with pytest.raises(UsageError, match=r"conevo\[video\].*--gif"):
        film.write_film(Painter([playback()], SIZE), tmp_path / "a.mp4", [0])


# --- all files ------------------------------------------------------------------------------------


def test_a_poster_is_the_frame(tmp_path):
    painter = Painter([playback()], SIZE)
    film.write_poster(painter, tmp_path / "a.png", 7)
    with Image.open(tmp_path / "a.png") as poster:
        assert poster.convert("RGB").tobytes() == painter.frame(7).tobytes()


@pytest.mark.parametrize("ending", ["gif", "mp4", "png"])
def test_no_file_is_overwritten(monkeypatch, tmp_path, ending):
    monkeypatch.setattr(film, "find_ffmpeg", lambda: shutil.which("true"))
    path = tmp_path / f"a.{ending}"
    path.write_bytes(b"mine")
    painter = Painter([playback()], SIZE)
    poster = ending == "png"
    write = partial(film.write_poster, t=0) if poster else partial(film.write_film, frames=[0])
    with pytest.raises(UsageError, match="exists"):
        write(painter, path)
    assert path.read_bytes() == b"mine"
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupted_gif_leaves_nothing(tmp_path):
    def interrupt(done, total):
        assert len(list(tmp_path.iterdir())) == 1
        assert not (tmp_path / "a.gif").exists()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film.write_film(Painter([playback()], SIZE), tmp_path / "a.gif", [0, 1], progress=interrupt)
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="file is a file, not a directory"):
        film.write_film(Painter([playback()], SIZE), tmp_path / "file" / "a.gif", [0])


def test_a_film_without_frames_is_refused(tmp_path):
    for name in ("a.gif", "a.mp4"):
        with pytest.raises(UsageError):
            film.write_film(Painter([playback()], SIZE), tmp_path / name, [])
    assert list(tmp_path.iterdir()) == []
