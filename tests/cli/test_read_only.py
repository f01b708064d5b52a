"""Commands read what cannot be written: archives, other people's folders, full disks."""

import os
import shutil
import subprocess
import sys

import pytest

from campaigns.plans import tiny_campaign
from conevo.campaigns.executors.registry import make_executor

pytest_plugins = ["report.quick_figures"]

MOUNT = "mount --bind {0} {0} && mount -o remount,ro,bind {0} && "

ALL = """
from conevo.cli.main import main
from conevo.report.figures import charts, curves, tiles
from conevo.report.figures.style import Drawing
from report.quick_figures import EMPTY
for module in (charts, curves, tiles):
    module.saved = lambda figure: Drawing(EMPTY["svg"], EMPTY["pdf"])
for words in {}:
    try:
        main(words)
    except SystemExit as ended:
        assert not ended.code, words
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished campaign."""
    campaign = tiny_campaign(tmp_path_factory.mktemp("archive"))
    campaign.carry_on(make_executor("serial", 1))
    return campaign.path


@pytest.fixture
def archive(finished, tmp_path):
    """Return a copy of it in an empty folder."""
    shutil.copytree(finished, tmp_path / "archive" / "tiny")
    return tmp_path / "archive"


@pytest.fixture
def refusing(monkeypatch):
    """Refuse to write any lock, as a read-only file system does."""

    def refuse(path, flags, *more, **others):
        if flags & os.O_CREAT and os.path.basename(path) == "lock":
            raise OSError(30, "Read-only file system")
        return real(path, flags, *more, **others)

    real = os.open
    monkeypatch.setattr("conevo.runs.directory.os.open", refuse)


def content(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("lost", [(), ("tables", "lock", "ledger.sqlite")])
def test_a_campaign_is_queried_and_reported_where_nothing_can_be_written(
    without_ink, say, archive, tmp_path, refusing, lost
):
    for name in lost:
        path = archive / "tiny" / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    before = content(archive)
    asked = "SELECT method, count(*) FROM runs GROUP BY ALL ORDER BY ALL"
    said = say("query", "archive/tiny", asked, "--csv")
    assert (said.code, said.out.split()[1:]) == (0, ["cone,2", "homcne,2"])
    note = "Read-only file system; its tables are made for this one use\n"
    assert said.err.endswith(note) if lost else said.err == ""
    said = say("report", "archive/tiny", "--out", "report")
    assert (said.code, (tmp_path / "report" / "index.html").is_file()) == (0, True), said.err
    assert content(archive) == before


def test_the_same_tables_are_made_elsewhere(without_ink, say, archive, tmp_path, refusing):
    say("report", "archive/tiny", "--out", "here")
    shutil.rmtree(archive / "tiny" / "tables")
    say("report", "archive/tiny", "--out", "there")
    assert content_of(tmp_path / "here") == content_of(tmp_path / "there")


def content_of(folder):
    return {path.relative_to(folder): text for path, text in content(folder).items()}


def test_a_campaign_without_a_finished_run_is_one_line(say, tmp_path, refusing):
    tiny_campaign(tmp_path / "archive")
    said = say("query", "archive/tiny", "SELECT 1")
    assert (said.code, said.out) == (2, "")
    assert said.err.endswith("has no finished run yet, so there is nothing to show\n")
    assert said.err.count("\n") == 1


def test_a_mounted_archive_is_read(archive, tmp_path):
    """On a real read-only file system, where this process may mount one."""
    can_mount = ["unshare", "-rm", "sh", "-c", MOUNT.format(archive) + "true"]
    if not shutil.which("unshare") or subprocess.run(can_mount, capture_output=True).returncode:
        pytest.skip("no file system can be mounted here")
    shutil.rmtree(archive / "tiny" / "tables")
    campaign, run = "archive/tiny", "archive/tiny/runs/rover-v2-complex-1-cone-s1"
    commands = [
        ["campaign", "status", campaign],
        ["query", campaign, "SELECT count(*) FROM runs"],
        ["report", campaign, "--out", "report"],
        ["show", run],
        ["test", run, "--scenarios", "2"],
        ["replay", run, "--no-browser", "--out", "page.html"],
        ["film", run, "--gif", "--size", "200", "--out", "film.gif"],
        ["export", run, "--to", "team.py"],
    ]
    (tmp_path / "all.py").write_text(ALL.format(commands))
    script = f"{MOUNT.format(archive)} exec {sys.executable} all.py"
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", script],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    made = {path.name for path in tmp_path.iterdir()}
    assert made == {"all.py", "archive", "report", "page.html", "film.gif", "team.py"}


def test_a_report_is_silent_about_folders_for_fonts(finished, tmp_path):
    """Matplotlib keeps fonts in the home directory, which may be missing or read-only."""
    words = ["report", str(finished), "--out", str(tmp_path / "report")]
    said = subprocess.run(
        [sys.executable, "-c", ALL.format([words])],
        env=os.environ | {"MPLCONFIGDIR": "/proc/none", "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
    )
    assert (said.returncode, said.stderr) == (0, "")


def test_a_missing_place_for_compiled_kernels_is_never_the_working_directory(tmp_path):
    said = subprocess.run(
        [sys.executable, "-c", "from conevo.kernels import engine; engine.start()"],
        env=os.environ | {"WARP_CACHE_PATH": "", "XDG_CACHE_HOME": str(tmp_path / "cache")},
        cwd=tmp_path,
    )
    assert said.returncode == 0
    assert [path.name for path in tmp_path.iterdir()] == ["cache"]
