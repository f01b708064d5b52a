"""Files appear all at once; drafts of killed processes are removed, those of others are not."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from conevo.errors import EnvironmentFailure
from conevo.runs import locks
from conevo.runs.directory import Directory, appearing
from conevo.runs.drafts import draft_of, remove_torn
from conevo.runs.durable import write_new

WRITER = """
import sys
from pathlib import Path
from conevo.runs.directory import appearing
from conevo.runs.drafts import draft_of
make, path = sys.argv[1:]
with (appearing if make == "directory" else draft_of)(Path(path)) as draft:
    (draft / "config.toml" if draft.is_dir() else draft).write_text("half")
    print("writing", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def writer():
    """Return a function that starts a process which writes a draft until it is killed."""
    begun = []

    def begin(make, path):
        process = subprocess.Popen(
            [sys.executable, "-c", WRITER, make, str(path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        begun.append(process)
        assert process.stdout.readline() == b"writing\n"
        return process

    yield begin
    for process in begun:
        process.kill()
        process.communicate()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("make", ["directory", "file"])
def test_a_draft_is_left_alone_while_it_is_written_and_removed_after_a_kill(tmp_path, writer, make):
    process = writer(make, tmp_path / "thing")
    (hidden,) = names(tmp_path)
    assert hidden.startswith(".thing.")
    with appearing(tmp_path / "other"):
        pass
    assert names(tmp_path) == [hidden, "other"]
    process.kill()
    assert process.wait() == -signal.SIGKILL
    assert names(tmp_path) == [hidden, "other"]
    write_new({tmp_path / "page.html": b"page"})
    assert names(tmp_path) == ["other", "page.html"]


def test_the_owner_of_the_lock_removes_drafts_of_killed_processes(tmp_path, writer):
    for name in ("runs", "studies", "teams"):
        (tmp_path / name).mkdir()
    (tmp_path / "plan.toml").touch()
    killed = [
        writer("directory", tmp_path / "tables"),
        writer("directory", tmp_path / "runs" / "a"),
    ]
    for process in killed:
        process.kill()
        process.wait()
    alive = writer("directory", tmp_path / "runs" / "b")
    (living,) = (p for p in (tmp_path / "runs").iterdir() if p.name.startswith(".b."))
    ours = [tmp_path / "plan.toml.tmp", tmp_path / "DONE.tmp", tmp_path / "teams/g-0000.npz.tmp"]
    others = [tmp_path / "notes.tmp", tmp_path / "studies" / "a.json.tmp"]
    old = tmp_path / "studies" / "b.json.tmp"
    for path in (*ours, *others, old):
        path.touch()
    os.utime(old, (0, 0))
    with Directory(tmp_path, "campaign").locked():
        assert names(tmp_path) == ["lock", "notes.tmp", "plan.toml", "runs", "studies", "teams"]
        assert names(tmp_path / "studies") == ["a.json.tmp"]  # a worker may be writing it
        assert names(tmp_path / "teams") == []
        assert names(tmp_path / "runs") == [living.name]
    assert alive.poll() is None


def test_the_owner_of_the_lock_removes_the_draft_of_the_directory(tmp_path, writer):
    path = tmp_path / "run"
    process = writer("directory", path)
    (hidden,) = tmp_path.iterdir()
    process.kill()
    process.wait()
    (hidden / "run").rename(path)  # killed just after it had appeared
    with Directory(path, "run").locked():
        assert names(tmp_path) == ["run"]


@pytest.mark.parametrize(
    "files",
    [
        {"letter.txt": "mine"},
        {"owner": "somebody else's", "letter.txt": "mine"},
        {"owner": ".thing.abcdefg1", "letter.txt": "a copy of a draft"},
        {"owner": "", "letter.txt": "mine"},
    ],
)
def test_files_of_unknown_origin_are_left_alone(tmp_path, files):
    hidden = tmp_path / ".thing.abcdefgh"
    hidden.mkdir()
    for name, text in files.items():
        (hidden / name).write_text(text)
    (tmp_path / ".link.abcdefgh").symlink_to(hidden)
    before = {path: path.read_text() for path in hidden.iterdir()}
    with draft_of(tmp_path / "thing") as draft:
        draft.write_text("text")
    assert {path: path.read_text() for path in hidden.iterdir()} == before
    assert names(tmp_path) == [".link.abcdefgh", ".thing.abcdefgh"]


@pytest.mark.parametrize("files", [[], ["owner"]])
def test_a_draft_that_never_had_an_owner_is_removed(tmp_path, files):
    hidden = tmp_path / ".thing.abcdefgh"
    hidden.mkdir()
    for name in files:
        (hidden / name).touch()
    with appearing(tmp_path / "thing"):
        pass
    assert names(tmp_path) == ["thing"]


def test_a_draft_that_another_process_removed_as_abandoned_is_started_again(tmp_path, monkeypatch):
    real, taken = locks.take, []

    def take(handle, tries=locks.TRIES):
        if not taken:
            taken.append(handle)
            (folder,) = tmp_path.iterdir()
            (folder / "owner").unlink()  # between making and locking it
            folder.rmdir()
        return real(handle, tries)

    monkeypatch.setattr(locks, "take", take)
    with appearing(tmp_path / "thing") as draft:
        (draft / "config.toml").write_text("whole")
    assert names(tmp_path) == ["thing"]
    assert (tmp_path / "thing" / "config.toml").read_text() == "whole"


def test_torn_files_of_others_are_left_alone(tmp_path):
    for name in ("a.json.tmp", "a.tmp", ".json.tmp", "a.json", "b.jsonl.tmp"):
        (tmp_path / name).touch()
    (tmp_path / "c.json.tmp").mkdir()
    remove_torn(tmp_path)
    remove_torn(tmp_path / "missing")
    assert names(tmp_path) == [".json.tmp", "a.json", "a.tmp", "c.json.tmp"]


# --- file systems without locks, systems without flock ------------------------------------------


@pytest.fixture(params=["ENOLCK", "ENOSYS", "ENOTSUP", "EIO"])
def without_locks(request, monkeypatch):
    """Make flock fail as on file systems without locks; return the text of the error."""
    number = getattr(errno, request.param)

    def flock(handle, kind):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", flock)
    return os.strerror(number)


def test_a_file_system_without_locks_is_named_and_nothing_appears(tmp_path, without_locks):
    with pytest.raises(EnvironmentFailure) as caught, appearing(tmp_path / "run"):
        pytest.fail("there is no lock")
    message = f"cannot lock {tmp_path}: {without_locks}; without locks two processes could write"
    assert message in str(caught.value)
    assert "--out" in str(caught.value)
    assert names(tmp_path) == []


def test_a_directory_moved_to_such_a_file_system_is_read_but_not_written(tmp_path, without_locks):
    (tmp_path / "config.toml").touch()
    directory = Directory(tmp_path, "run")
    assert not directory.is_in_use
    with pytest.raises(EnvironmentFailure, match=f"cannot lock {tmp_path}: "), directory.locked():
        pytest.fail("there is no lock")


def test_files_without_a_lock_are_written_there_and_no_draft_is_removed(tmp_path, without_locks):
    hidden = tmp_path / ".film.gif.abcdefgh"
    hidden.mkdir()
    (hidden / "owner").write_text(hidden.name)
    write_new({tmp_path / "page.html": b"page"})
    assert names(tmp_path) == [hidden.name, "page.html"]


def test_only_a_lock_of_another_process_is_in_use(tmp_path):
    path = tmp_path / "lock"
    path.touch()
    with path.open("rb+") as first, path.open("rb+") as second:
        assert locks.take(first.fileno())
        assert not locks.take(second.fileno(), tries=1)
        assert locks.is_taken(second.fileno())
        assert locks.is_held(path)
    assert not locks.is_held(path)
    assert not locks.is_held(tmp_path / "missing")


def test_a_system_without_flock_gets_one_line(tmp_path):
    code = "import sys; sys.modules['fcntl'] = None; from conevo.cli.main import main; main()"
    for arguments in (["run", "rover/complex-1", "--preset", "smoke"], ["watch"], ["resume", "x"]):
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments], cwd=tmp_path, capture_output=True, text=True
        )
        assert (done.returncode, done.stdout) == (3, "")
        assert done.stderr.startswith("conevo: error: conevo needs Linux, on Windows WSL: ")
        assert done.stderr.count("\n") == 1
    assert list(Path(tmp_path).iterdir()) == []
