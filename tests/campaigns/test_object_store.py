"""Runs in an object store: whole or broken off anywhere, they continue bit for bit.

The store has the interface of S3.
"""

import shutil
from pathlib import Path

import pytest

import conevo
from campaigns.plans import tiny_campaign
from conevo.campaigns.object_store import ObjectStore
from conevo.campaigns.worker import carry_out
from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs.start import start

MORE = '[[where]]\nsettings = { "run.generations" = 9 }'


@pytest.fixture
def campaign(tmp_path):
    return tiny_campaign(tmp_path, more=MORE)


@pytest.fixture
def label(campaign):
    return next(iter(campaign.planned))


@pytest.fixture
def store(bucket):
    return ObjectStore(f"{bucket}/inner")


def advance(path, generations=1):
    """Continue a run by some generations."""

    def watch(run, record):
        nonlocal generations
        generations -= 1
        if not generations:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        conevo.Run(path).resume(threads=1, watch=watch)


def begun(campaign, label):
    """Start a run as a worker does, and leave it after two generations."""
    planned = campaign.planned[label]
    (config,) = planned.configs()
    start(config, campaign.paths.run(label), threads=1)
    advance(campaign.paths.run(label), 2)
    return campaign.paths.run(label)


def outcome(path):
    run = conevo.Run(path)
    assert run.changed_files == []
    rows = [{k: v for k, v in row.items() if k != "seconds"} for row in run.generations()]
    return rows, run.champion.genes.tobytes(), run.test_result


def finish(store, folder, label):
    """Finish a run elsewhere, as a worker on another machine does, and return its outcome."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    store.get_plan(folder)
    store.get_run(folder, label)
    first = len(conevo.Run(folder / "runs" / label).generations())
    assert carry_out(folder, label, 1), (folder / "ended" / f"{label}.json").read_text()
    return first, outcome(folder / "runs" / label)


@pytest.fixture
def undisturbed(campaign, label, tmp_path):
    """The outcome of the run if nothing is copied."""
    folder = tmp_path / "undisturbed"
    folder.mkdir()
    shutil.copy(campaign.paths.runs, folder)
    assert carry_out(folder, label, 1)
    return outcome(folder / "runs" / label)


def test_a_finished_run_comes_back_as_it_was(campaign, label, store, tmp_path):
    assert carry_out(campaign.path, label, 1)
    for path in (campaign.paths.study(label), campaign.paths.log(label)):
        path.parent.mkdir()
        path.write_text("{}")
    (campaign.paths.run(label) / "half.tmp").write_text("a draft")
    store.put_plan(campaign.path)
    assert not store.has_run(label)
    store.put_run(campaign.path, label)
    assert store.has_run(label)
    elsewhere = tmp_path / "elsewhere"
    store.get_plan(elsewhere)
    store.get_run(elsewhere, label)
    found = {path.relative_to(elsewhere) for path in elsewhere.rglob("*") if path.is_file()}
    known = {path.relative_to(campaign.path) for path in campaign.path.rglob("*") if path.is_file()}
    assert known - found == {
        Path("plan.toml"), Path("runs", label, "lock"), Path("runs", label, "half.tmp"),
    }  # fmt: skip
    assert found <= known
    assert all((elsewhere / p).read_bytes() == (campaign.path / p).read_bytes() for p in found)
    assert outcome(elsewhere / "runs" / label) == outcome(campaign.paths.run(label))


def test_fetched_files_replace_existing_ones(campaign, label, store):
    path = begun(campaign, label)
    store.put_run(campaign.path, label)
    advance(path, 2)
    (path / "another").write_text("file")
    store.get_run(campaign.path, label)
    assert len(conevo.Run(path).generations()) == 2
    assert not (path / "another").exists()


def test_the_ending_of_a_run_is_removed_when_it_is_tried_again(campaign, label, store):
    store.forget_ending(campaign.path, label)
    ended = campaign.paths.ended(label)
    ended.parent.mkdir()
    ended.write_text("{}")
    store.put_run(campaign.path, label)
    ended.unlink()
    store.forget_ending(campaign.path, label)
    store.get_run(campaign.path, label)
    assert not ended.exists()


@pytest.mark.slow
def test_a_copy_that_breaks_off_anywhere_leaves_a_run_that_continues(
    campaign, label, store, tmp_path, undisturbed, monkeypatch
):
    path = begun(campaign, label)
    store.put_plan(campaign.path)
    store.put_run(campaign.path, label)
    advance(path, 3)
    put, firsts = store._put, []
    for n_files in range(20):
        left = [n_files]

        def put_some(root, name, content, left=left):
            if not left[0]:
                raise ConnectionError
            left[0] -= 1
            put(root, name, content)

        monkeypatch.setattr(store, "_put", put_some)
        try:
            store.put_run(campaign.path, label)
        except ConnectionError:
            is_whole = False
        else:
            is_whole = True
        first, found = finish(store, tmp_path / "elsewhere", label)
        assert found == undisturbed
        firsts.append(first)
        if is_whole:
            break
    assert is_whole
    assert firsts[0] == 2
    assert firsts[-1] == 5
    assert len(firsts) > 6


def test_a_running_run_can_be_copied(campaign, label, store, tmp_path, undisturbed, monkeypatch):
    path = begun(campaign, label)
    store.put_plan(campaign.path)
    read = Path.read_bytes
    copying = True

    def read_and_advance(self):
        nonlocal copying
        content = read(self)
        if copying and path in self.parents:
            copying = False
            if len(conevo.Run(path).generations()) < 8:
                advance(path)
            copying = True
        return content

    monkeypatch.setattr(Path, "read_bytes", read_and_advance)
    store.put_run(campaign.path, label)
    monkeypatch.undo()
    assert len(conevo.Run(path).generations()) == 8
    first, found = finish(store, tmp_path / "elsewhere", label)
    assert first > 2
    assert found == undisturbed


def test_a_sealed_run_is_whole_wherever_its_copy_breaks_off(campaign, label, store, monkeypatch):
    assert carry_out(campaign.path, label, 1)
    names = []
    monkeypatch.setattr(store, "_put", lambda root, path, content: names.append(path.name))
    store.put_run(campaign.path, label)
    assert names[-2:] == ["DONE", f"{label}.json"]
    assert names[-3].startswith("checkpoint-")


def test_files_removed_from_a_run_are_removed_from_the_store(campaign, label, store, tmp_path):
    path = begun(campaign, label)
    store.put_run(campaign.path, label)
    two = set(store._names(f"runs/{label}"))
    assert carry_out(campaign.path, label, 1)
    store.put_run(campaign.path, label)
    assert set(store._names(f"runs/{label}")) == {
        file.relative_to(path).as_posix() for file in path.rglob("*") if file.is_file()
    } - {"lock"}
    assert {"checkpoint-a.npz", "checkpoint-b.npz"} <= two


@pytest.mark.parametrize("uri", ["nowhere", "xyz://bucket/path", "s3://"])
def test_an_invalid_address_is_refused(uri):
    pytest.importorskip("pyarrow")
    with pytest.raises(UsageError, match=f"object store '{uri}'"):
        ObjectStore(uri)


class Down:
    """A store that cannot be reached."""

    def __getattr__(self, name):
        def refuse(*_, **__):
            raise OSError("Could not connect\nto server")

        return refuse


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda store, root, label: store.put_plan(root), "write s3://box/in/runs.jsonl"),
        (lambda store, root, label: store.get_plan(root), "read s3://box/in/runs.jsonl"),
        (lambda store, root, label: store.has_run(label), "list s3://box/in/runs/rover"),
        (lambda store, root, label: store.put_run(root, label), "read s3://box/in/runs/rover"),
        (lambda store, root, label: store.get_run(root, label), "list s3://box/in/runs/rover"),
        (lambda store, root, label: store.forget_ending(root, label), "read s3://box/in/ended/"),
    ],
)
def test_a_store_that_cannot_be_reached_is_one_line_without_the_password(
    campaign, label, monkeypatch, ask, words
):
    pytest.importorskip("pyarrow")
    store = ObjectStore("s3://me:hidden@box/in?region=eu-west-1")
    monkeypatch.setattr(store, "_files", Down())
    with pytest.raises(EnvironmentFailure, match=words) as caught:
        ask(store, campaign.path, label)
    assert str(caught.value).endswith(": Could not connect to server")
    assert "hidden" not in str(caught.value)


def test_a_missing_bucket_is_refused_before_anything_starts(campaign, bucket):
    with pytest.raises(EnvironmentFailure, match=r"-none/inner/runs.jsonl: Bucket .* not found"):
        ObjectStore(f"{bucket}-none/inner").put_plan(campaign.path)
