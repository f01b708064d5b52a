"""conevo replay, film and watch as a user gives them."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import urllib.request
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from conevo.cli.epoch_options import bar
from conevo.cli.main import main
from conevo.replay.trajectory import Trajectory
from conevo.watch.server import LiveServer
from runs.tiny import evolve_tiny

LONG = {"run__generations": 22}  # of which every second team is kept


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with runs of every world."""
    folder = tmp_path_factory.mktemp("made")
    evolve_tiny(folder / "cone", **LONG)
    evolve_tiny(folder / "homcne", "homcne")
    more = {"world__iterations": 100, "world__n_robots": 10, "run__seed": 2}
    evolve_tiny(
        folder / "later", "homcne", **more
    )  # its champion is from a later generation than 0
    evolve_tiny(folder / "pursuit", task="pursuit/team-10")
    evolve_tiny(folder / "gacc", task="gacc/complex-9")
    return folder


@pytest.fixture
def here(made: Path, tmp_path: Path) -> Path:
    """Return an empty directory with these runs in runs/."""
    shutil.copytree(made, tmp_path / "runs")
    return tmp_path


def opened(monkeypatch: pytest.MonkeyPatch, answer: bool = True) -> list[str]:
    """Return a list of the addresses that a browser is asked to open from now on."""
    asked: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda at: asked.append(at) or answer)
    return asked


def data_of(page: str) -> dict:
    """Return the data of a page about its teams."""
    text = page.partition('<script type="application/json" id="about">')[2]
    return json.loads(text.partition("</script>")[0])


@pytest.mark.parametrize("name", ["cone", "homcne", "pursuit", "gacc"])
def test_replay_prints_the_page_it_has_made(say, here, monkeypatch, name) -> None:
    asked = opened(monkeypatch)
    said = say("replay", name, "--no-browser", "--threads", "1")
    assert (said.code, said.err, asked) == (0, "", [])
    path = Path(said.out.strip())
    assert path.parent == Path("replays")
    assert [team["iterations"] for team in data_of(path.read_text())["teams"]] == [12]
    assert say("replay", name, "--no-browser").out == said.out  # the same bytes are not a conflict
    assert len(list(Path("replays").iterdir())) == 1


def test_replay_opens_the_page(say, here, monkeypatch) -> None:
    asked = opened(monkeypatch)
    path = Path(say("replay", "cone").out.strip())
    assert asked == [path.resolve().as_uri()]
    opened(monkeypatch, answer=False)
    said = say("replay", "cone")
    assert said.code == 0
    assert said.err.startswith("conevo: note: no browser found here; open file://")


def test_a_page_is_never_written_over_something_else(say, here) -> None:
    (here / "page.html").write_text("mine")
    words = ("replay", "cone", "--no-browser", "--out", "page.html", "--keep", "epoch.npz")
    said = say(*words)
    assert said.code == 2
    assert said.err == (
        "conevo: error: page.html exists already; choose another place with --out, or remove it\n"
    )
    assert (here / "page.html").read_text() == "mine"
    assert not (here / "epoch.npz").exists()  # not half of the request


def test_a_kept_epoch_shows_the_same_as_the_run(say, here) -> None:
    say("replay", "cone", "--no-browser", "--out", "a.html", "--keep", "epoch.npz")
    say("replay", "epoch.npz", "--no-browser", "--out", "b.html")
    assert (here / "a.html").read_bytes() == (here / "b.html").read_bytes()
    kept = Trajectory.load(here / "epoch.npz")
    with np.load(here / "epoch.npz") as file:
        assert file["x"].shape == (12, 3)
    say("replay", "cone", "--no-browser", "--epoch", "1", "--out", "c.html", "--keep", "other.npz")
    assert Trajectory.load(here / "other.npz").about["scenario"] != kept.about["scenario"]


def test_two_teams_side_by_side(say, here) -> None:
    said = say("replay", "cone", "--beside", "homcne", "--no-browser")
    assert said.code == 0, said.err
    assert "-beside-" in said.out
    one, two = data_of(Path(said.out.strip()).read_text())["teams"]
    assert one["title"] == two["title"]
    assert (one["subtitle"][:5], two["subtitle"][:7]) == ("CONE,", "HomCNE,")
    words = ("--beside", "cone", "--beside-generation", "0", "--no-browser", "--out", "c.html")
    assert say("replay", "cone", *words).code == 0
    one, two = data_of((here / "c.html").read_text())["teams"]
    assert "generation 0" in two["subtitle"]
    assert "generation 0" not in one["subtitle"] or one["subtitle"] == two["subtitle"]


def test_a_generation_that_was_not_stored_is_evolved_again(say, here) -> None:
    lost = next(g for g in range(1, 22, 2) if g != champion(here / "runs" / "cone"))
    words = ("--generation", str(lost), "--no-browser", "--out", "a.html", "--keep", "a.npz")
    assert say("replay", "cone", *words).code == 0
    assert Trajectory.load(here / "a.npz").about["generation"] == lost


def champion(path: Path) -> int:
    from conevo.runs.run import Run

    team = Run(path).champion
    assert team is not None
    return team.generation


def test_a_film_a_poster_and_their_options(say, here) -> None:
    small = ("--size", "200", "--threads", "1")
    said = say("film", "gacc", "--gif", "--every", "3", "--fps", "10", *small)
    assert (said.code, said.err) == (0, "")
    with Image.open(said.out.strip()) as film:
        assert film.format == "GIF"
        assert film.n_frames == 5  # iterations 0, 3, 6, 9 and the last one, 11
        assert film.info["duration"] == 100
    said = say("film", "pursuit", "--poster", "11", "--colour", "caste", "--out", "p.png", *small)
    assert (said.code, said.out) == (0, "p.png\n")
    with Image.open("p.png") as picture:
        assert picture.format == "PNG"
    said = say("film", "cone", "--beside", "homcne", "--from", "4", "--to", "7", "--gif", *small)
    with Image.open(said.out.strip()) as film:
        assert film.n_frames == 4
        assert film.width > 2 * 200


def test_films_that_differ_have_names_that_differ(say, here, monkeypatch) -> None:
    """All in grey: the choice of the colours takes most of a film's time."""
    grey = Image.new("P", (1, 1))
    grey.putpalette([level for level in range(0, 256, 51) for _ in "rgb"])
    monkeypatch.setattr("conevo.replay.film._palette", lambda samples: grey)
    base = ("film", "homcne", "--size", "200", "--threads", "1")
    others = [
        ("--gif",),
        ("--gif", "--from", "4"),
        ("--gif", "--to", "4"),
        ("--gif", "--from", "4", "--to", "7", "--every", "3"),
        ("--gif", "--every", "3"),
        ("--gif", "--every", "3", "--fps", "10"),
        ("--gif", "--every", "3", "--colour", "caste"),
        ("--poster", "3"),
        ("--poster", "4"),
    ]
    said = [say(*base, *other) for other in others]
    assert [one.code for one in said] == [0] * len(others), said
    assert len({one.out for one in said}) == len(others)
    assert said[3].out.strip().endswith("-from-4-to-7-every-3-size-200.gif")
    assert "exists already" in say(*base, "--gif").err


@pytest.mark.parametrize(
    ("label", "name"),
    [
        ("../../away", "away-generation-0-epoch-0"),
        ("/etc/cron.d/x", "etc-cron.d-x-generation-0-epoch-0"),
        ("<script>alert(1)</script>", "script-alert-1-script--generation-0-epoch-0"),
        ("...", "generation-0-epoch-0"),
        ("x" * 1500, "x" * 200),
    ],
)
def test_a_file_from_elsewhere_does_not_choose_its_place(say, here, label, name) -> None:
    say("replay", "cone", "--generation", "0", "--no-browser", "--out", "a.html", "--keep", "a.npz")
    kept = Trajectory.load(here / "a.npz")
    replace(kept, about=kept.about | {"label": label}).save(here / "b.npz")
    before = set(here.rglob("*"))
    said = say("replay", "b.npz", "--no-browser")
    assert (said.code, said.err, said.out) == (0, "", f"replays/{name}.html\n")
    folder = here / "replays"
    assert set(here.rglob("*")) - before == {folder, folder / f"{name}.html"}


def test_a_name_with_brackets_is_shown_as_it_is(monkeypatch, capsys) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    with bar("drawing a{b}[red]c.gif") as show:
        show(1, 3)
        show(2, 3)
    said = capsys.readouterr().err
    assert "drawing a{b}[red]c.gif" in said
    assert "2/3" in said


BAD = [
    (("replay", "none"), "unknown run 'none' in runs/"),
    (("replay", "cone", "--generation", "22"), r"has no generation 22 \(it has 0 to 21\)"),
    (("replay", "cone", "--generation", "-1"), "-1 is not in the range 0<=x<=2147483647"),
    (("replay", "cone", "--beside", "gacc"), "cannot play rover-v2/complex-1"),
    (("replay", "cone", "--beside-generation", "0"), "--beside-generation needs --beside"),
    (("replay", "bad.npz"), "bad.npz is damaged or not a trajectory"),
    (("replay", "page.html"), "page.html is damaged or not a trajectory"),
    (("replay", "epoch.npz", "--generation", "0"), "epoch.npz is a recorded epoch, not a run"),
    (("replay", "epoch.npz", "--epoch", "0"), "epoch.npz is a recorded epoch, not a run"),
    (
        ("replay", "epoch.npz", "--beside", "gacc.npz"),
        "cannot be shown side by side: different tasks",
    ),
    (("replay", "epoch.npz", "--beside", "e1.npz"), "shown side by side: different scenarios"),
    (("replay", "runs"), "is not a run"),
    (
        ("film", "cone", "--gif", "--mp4"),
        "--gif, --mp4 and --poster are mutually exclusive: give one of them",
    ),
    (("film", "cone", "--gif", "--out", "a.mp4"), "a.mp4"),
    (("film", "cone", "--out", "a.avi"), "a.avi"),
    (("film", "cone", "--out", "a.png"), "--poster"),
    (("film", "cone", "--gif", "--from", "9", "--to", "3"), "9"),
    (("film", "cone", "--gif", "--to", "12"), "12"),
    (("film", "cone", "--poster", "12"), "12"),
    (("film", "cone", "--gif", "--out", "old.gif"), "old.gif exists already"),
    (("film", "cone", "--size", "10"), "10 is not in the range"),
    (("watch", "none"), "unknown run 'none'"),
    (("watch", "bad.npz"), "bad.npz"),
]


def test_of_two_epochs_the_damaged_one_is_named(say, here) -> None:
    say("replay", "cone", "--no-browser", "--out", "a.html", "--keep", "a.npz")
    kept = Trajectory.load(here / "a.npz")
    few = {name: channel for name, channel in kept.channels.items() if name != "energy"}
    replace(kept, channels=few).save(here / "b.npz")
    for words in (("replay", "a.npz", "--beside", "b.npz"), ("film", "b.npz", "--gif")):
        said = say(*words)
        assert (said.code, said.out) == (2, "")
        assert said.err == "conevo: error: b.npz: the trajectory is damaged: energy is missing\n"


@pytest.mark.parametrize(("words", "reason"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_wrong_words_are_one_line_and_leave_nothing(say, here, words, reason) -> None:
    (here / "bad.npz").write_bytes(b"PK\x03\x04<script>alert(1)</script>")
    (here / "old.gif").write_text("mine")
    (here / "page.html").write_text("<script>alert(1)</script>")
    for name, run, epoch in (("epoch", "cone", "0"), ("e1", "cone", "1"), ("gacc", "gacc", "0")):
        if any(f"{name}.npz" in word for word in words):
            keep = ("--keep", f"{name}.npz", "--out", f"{name}-0.html", "--epoch", epoch)
            assert say("replay", run, *keep, "--no-browser").code == 0
    before = sorted(here.rglob("*"))
    said = say(*words, *(() if words[0] == "film" else ("--no-browser",)))
    assert said.code == 2
    assert said.out == ""
    assert said.err.startswith("conevo: error: ")
    assert said.err.count("\n") == 1
    assert re.search(reason, said.err), said.err
    assert sorted(here.rglob("*")) == before


def test_watch_shows_the_current_champion(say, here, monkeypatch) -> None:
    """Its replay is made again when another team has become the fittest."""
    path = here / "runs" / "later"
    assert champion(path) != 0
    whole = {file: (path / file).read_bytes() for file in ("generations.jsonl", "champion.npz")}
    first = path / "teams" / "generation-0000.npz"
    pages = []

    def serve(watched, port, replay, on_ready) -> None:
        (path / "generations.jsonl").write_bytes(whole["generations.jsonl"].split(b"\n")[0] + b"\n")
        (path / "champion.npz").write_bytes(first.read_bytes())
        for _ in range(2):
            watched.snapshot()
            pages.append(replay("later"))
        for file, content in whole.items():
            (path / file).write_bytes(content)
        watched.snapshot()
        pages.append(replay("later"))

    monkeypatch.setattr("conevo.watch.server.serve", serve)
    assert say("watch", "later", "--no-browser").code == 0
    said = [data_of(page)["teams"][0]["subtitle"] for page in pages]
    assert ["generation 0," in one for one in said] == [True, True, False]
    assert f"generation {champion(path)}," in said[2]
    assert pages[0] is pages[1]


@pytest.mark.slow
def test_watch_serves_until_it_is_interrupted(here, monkeypatch) -> None:
    monkeypatch.chdir(here)
    before = {path: path.stat().st_mtime_ns for path in here.rglob("*")}
    watching = spawn_watch("cone")
    try:
        address = watching.stdout.readline().split()[0]
        assert address.startswith("http://127.0.0.1:")
        state = json.loads(fetched(f"{address}state.json"))
        assert [run["label"] for run in state["runs"]] == ["cone"]
        page = fetched(f"{address}replay/cone")
        assert data_of(page)["teams"][0]["iterations"] == 12
    finally:
        watching.send_signal(signal.SIGINT)
    _, err = watching.communicate(timeout=20)
    assert (watching.returncode, err) == (0, "")
    assert {path: path.stat().st_mtime_ns for path in here.rglob("*")} == before


def test_watch_serves_while_a_browser_does_not_return(here, monkeypatch) -> None:
    monkeypatch.chdir(here)
    monkeypatch.setenv("DISPLAY", ":0")
    answers: list[str] = []
    served = threading.Event()

    def browser(address: str) -> bool:
        answers.append(fetched(f"{address}state.json"))  # before it returns
        served.set()
        return True

    def serve(watched, port, replay, on_ready) -> None:
        with LiveServer(watched, port, replay) as server:
            on_ready(server.address)
            until = threading.Thread(target=lambda: (served.wait(20), server.shutdown()))
            until.start()
            server.serve_forever(poll_interval=0.01)
            until.join()

    monkeypatch.setattr("webbrowser.get", lambda: object())
    monkeypatch.setattr("webbrowser.open", browser)
    monkeypatch.setattr("conevo.watch.server.serve", serve)
    with pytest.raises(SystemExit) as ended:
        main(["watch", "cone"])
    assert ended.value.code == 0
    assert [run["label"] for run in json.loads(answers[0])["runs"]] == ["cone"]


def spawn_watch(*what: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-u", "-m", "conevo", "watch", *what, "--no-browser"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def fetched(address: str) -> str:
    with urllib.request.urlopen(address, timeout=60) as answer:
        return answer.read().decode()
