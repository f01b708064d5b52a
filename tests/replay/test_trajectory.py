"""Trajectories agree with the kernels, and their files are complete or refused."""

import io
import json
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conevo.errors import UsageError
from conevo.playback.quantized import Channel
from conevo.replay.trajectory import Trajectory
from conevo.rng import fold
from conevo.worlds.protocol import setting_columns
from conevo.worlds.registry import world
from conevo.worlds.rollout import Rollout
from replay.epochs import TASKS, epoch, random_team, renamed

# --- channels -------------------------------------------------------------------------------------


@given(st.lists(st.integers(-(2**31), 2**31 - 1), min_size=1, max_size=20))
def test_whole_numbers_are_kept_exactly(numbers):
    kept = Channel.of(np.array(numbers))
    assert kept.values.tolist() == numbers
    assert kept.codes.dtype in (np.uint8, np.uint16, np.uint32)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20), st.sampled_from([8, 16]))
def test_other_numbers_are_off_by_half_a_step_at_most(numbers, bits):
    kept = Channel.of(np.array(numbers), bits)
    span = max(numbers) - min(numbers)
    assert kept.codes.dtype.itemsize * 8 == bits
    assert np.abs(kept.values - numbers).max() <= 0.5 * span / (2**bits - 1) + 1e-9 * (1 + span)
    assert kept.values.min() == min(numbers)


def test_a_constant_and_an_empty_channel_can_be_stored():
    assert Channel.of(np.full(3, 2.5)).values.tolist() == [2.5] * 3
    assert Channel.of(np.zeros((4, 0))).values.shape == (4, 0)


@pytest.mark.parametrize("numbers", [[np.nan], [0.0, np.inf]])
def test_values_that_are_not_finite_are_refused(numbers):
    with pytest.raises(ValueError, match="finite"):
        Channel.of(np.array(numbers))


# --- recording ------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", TASKS)
def test_a_trajectory_agrees_with_the_kernels(task):
    a_world = world(task, iterations=60)
    rollout = Rollout(a_world, n_threads=1)
    genes, team = random_team(a_world)
    key = fold(3, "test", 0)
    seen = rollout.record(genes, team, a_world.scenarios([key]))
    out = rollout.evaluate(genes, team[None], a_world.scenarios([key]))
    from conevo.replay.recording import record_epoch

    about, channels = record_epoch(rollout, genes, team, key)
    for name in a_world.simulation().recorded:
        if name != "counts":
            kept = channels[name]
            wanted = seen[name].astype(np.float64)
            allowed = 0.0 if seen[name].dtype.kind in "biu" else kept.step / 2
            assert np.abs(kept.values - wanted).max() <= allowed + 1e-9 * np.abs(wanted).max(), name
    sensors = channels["sensors"]
    assert sensors.values.shape == (60, a_world.n_robots, len(a_world.inputs))
    assert np.abs(sensors.values - seen["inputs"]).max() <= sensors.step / 2 + 1e-9
    outputs = 1 / (1 + np.exp(-seen["outputs"].astype(np.float64)))
    for name, wanted in (("hidden", seen["hidden"]), ("outputs", outputs)):
        kept = channels[name]
        assert kept.values.shape == wanted.shape
        assert np.abs(kept.values - wanted).max() <= kept.step / 2 + 1e-9, name
    assert about["fitness"] == [float(value) for value in out.fitness[0, 0]]
    assert about["performance"] == {k: float(v[0, 0]) for k, v in out.performance.items()}
    for name, value in about["performance"].items():
        curve = channels[f"performance/{name}"]
        assert curve.values.shape == (60,)
        assert abs(curve.values[-1] - value) <= curve.step / 2 + 1e-9 * abs(value)
    assert about["scenario"] == key
    assert len(about["labels"]) == len(about["specialization"]) == a_world.n_robots
    counts = out.counts[0, 0][:, setting_columns(a_world)]
    shares = counts.max(axis=1) / np.maximum(counts.sum(axis=1), 1)
    assert about["favourite_shares"] == pytest.approx(shares.tolist())
    for robot, name in enumerate(about["favourites"]):
        assert (name == "") == (counts[robot].sum() == 0)
        if name:
            chosen = getattr(a_world, "settings", a_world.castes)
            assert counts[robot, chosen.index(name)] == counts[robot].max()


@pytest.mark.parametrize("task", TASKS)
def test_hidden_activations_are_those_of_a_network(task):
    """They follow from sensors and previous activations, and outputs from them, in float64."""
    a_world = world(task, iterations=60)
    genes, team = random_team(a_world)
    rollout = Rollout(a_world, n_threads=1)
    mind, n_sensors = rollout.controller, len(a_world.inputs)
    seen = rollout.record(genes, team, a_world.scenarios([fold(3, "test", 0)]))
    hidden = seen["hidden"].astype(np.float64)
    assert hidden.shape == (60, a_world.n_robots, rollout.genome.max_parts)
    assert not hidden[:, team < 0].any()
    assert hidden[:, team >= 0].any()
    n_context = mind.n_hidden if mind.recurrent else 0
    weights = mind.weight_scale * genes[team].astype(np.float64)
    w_in, w_out = np.split(weights, [n_sensors + n_context], axis=2)
    context = np.concatenate([np.zeros_like(hidden[:1]), hidden[:-1]])[:, :, :n_context]
    inputs = np.concatenate([seen["inputs"], context], axis=2)
    sums = np.einsum("tri,rui->tru", inputs, w_in) + mind.bias
    wanted = np.where(team >= 0, 1 / (1 + np.exp(-sums)), 0.0)
    assert np.abs(hidden - wanted).max() < 1e-4
    sums = np.einsum("tru,ruo->tro", hidden, w_out) + mind.bias
    assert np.abs(sums - seen["outputs"]).max() < 1e-3


def test_heuristic_robots_have_no_activations():
    found = epoch("rover/complex-5", 60, is_heuristic=True)
    heuristic = np.array([bool(name) for name in found.about["heuristic"]])
    assert heuristic[::2].all()
    assert not heuristic[1::2].any()
    for name in ("hidden", "outputs"):
        assert not found.channels[name].values[:, heuristic].any()
        assert found.channels[name].values[:, ~heuristic].any()


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", TASKS)
def test_a_file_is_read_as_it_was_written(task, tmp_path):
    found = epoch(task)
    path = tmp_path / "deep" / "epoch.npz"
    found.save(path)
    again = Trajectory.load(path)
    assert again.about == found.about
    assert list(again.about["performance"]) == list(found.about["performance"])
    assert again.channels.keys() == found.channels.keys()
    for name, kept in found.channels.items():
        assert np.array_equal(again.channels[name].values, kept.values), name
    assert again.to_bytes() == path.read_bytes()
    found.save(path)  # the same bytes do not count as another file


def test_numpy_alone_reads_a_file(tmp_path):
    """The recipe of the module's docstring."""
    found = epoch("rover/complex-5")
    found.save(tmp_path / "epoch.npz")
    file = np.load(tmp_path / "epoch.npz")
    about = json.loads(file["about"].tobytes())
    kept = about["channels"]["x"]
    x = kept["low"] + kept["step"] * file["x"]
    assert x.shape == (200, 20)
    assert np.array_equal(x, found.channels["x"].values)


def test_another_file_is_not_replaced(tmp_path):
    path = tmp_path / "epoch.npz"
    path.write_text("mine")
    with pytest.raises(UsageError, match="exists already"):
        epoch("rover/complex-5").save(path)
    assert path.read_text() == "mine"


def test_a_missing_file_is_a_wrong_request(tmp_path):
    with pytest.raises(UsageError, match=r"none\.npz: No such file"):
        Trajectory.load(tmp_path / "none.npz")


def refused(path, data):
    path.write_bytes(data)
    with pytest.raises(UsageError, match="damaged or not a trajectory") as error:
        Trajectory.load(path)
    assert "\n" not in str(error.value)
    return str(error.value)


@settings(max_examples=80, deadline=None)
@given(st.data())
def test_a_damaged_file_is_refused_or_has_the_same_content(tmp_path_factory, data):
    """One flipped bit, or a missing end."""
    good = epoch("pursuit/team-7", 40).to_bytes()
    path = tmp_path_factory.mktemp("torn") / "epoch.npz"
    if data.draw(st.booleans()):
        bad = bytearray(good)
        at = data.draw(st.integers(0, len(good) - 1))
        bad[at] ^= 1 << data.draw(st.integers(0, 7))
    else:
        bad = good[: data.draw(st.integers(0, len(good) - 1))]
    path.write_bytes(bytes(bad))
    try:
        found = Trajectory.load(path)
    except UsageError as error:
        assert "\n" not in str(error)  # noqa: PT017 (either way is right)
    else:  # a bit of the archive's own records, such as a date
        assert found.to_bytes() == good


def changed(found, *, about=(), arrays=(), drop=()):
    """Return the bytes of a file with other words or arrays."""
    with np.load(io.BytesIO(found.to_bytes())) as archive:
        members = {name: archive[name] for name in archive.files}
    text = json.loads(members["about"].tobytes())
    text.update(about)
    members["about"] = np.frombuffer(json.dumps(text).encode(), np.uint8)
    members.update(arrays)
    members = {name: array for name, array in members.items() if name not in drop}
    out = io.BytesIO()
    np.savez_compressed(out, **members)
    return out.getvalue()


HOSTILE = {
    "another format": {"about": {"format": 2}},
    "no channels": {"about": {"channels": {}}},
    "channels of nothing": {"about": {"channels": None}},
    "a word for a number": {"about": {"iterations": "many"}},
    "a truth for a number": {"about": {"n_robots": True}},
    "no robots": {"about": {"n_robots": 0}},
    "more labels than robots": {"about": {"labels": ["low"] * 30}},
    "a caste of its own": {"about": {"labels": ["<script>"] * 20}},
    "more favourites than robots": {"about": {"favourites": ["low"] * 30}},
    "a favourite of its own": {"about": {"favourites": ["<script>"] * 20}},
    "favourites without shares": {"about": {"favourites": []}},
    "a share above 1": {"about": {"favourite_shares": [1.5] * 20}},
    "something more": {"about": {"script": "alert(1)"}},
    "a text in two lines": {"about": {"label": "a\nb"}},
    "a text too long": {"about": {"environment": "x" * 3000}},
    "no actions": {"about": {"actions": []}},
    "nested params": {"about": {"params": {"a": {"b": []}}}},
    "not a number": {"about": {"fitness": [float("nan")] * 20}},
    "a missing array": {"drop": ("x",)},
    "one array more": {"arrays": {"extra": np.zeros(3, np.uint8)}},
    "floats for codes": {"arrays": {"x": np.zeros((200, 20))}},
    "objects": {"arrays": {"x": np.array([{}], dtype=object)}},
    "no text": {"drop": ("about",)},
}


@pytest.mark.parametrize("how", HOSTILE)
def test_a_hostile_file_is_refused(how, tmp_path):
    found = epoch("rover/complex-5")
    assert Trajectory.load(_written(tmp_path, changed(found))).about == found.about
    refused(tmp_path / "bad.npz", changed(found, **HOSTILE[how]))


def _written(tmp_path, data):
    (tmp_path / "good.npz").write_bytes(data)
    return tmp_path / "good.npz"


@pytest.mark.parametrize(
    "kept",
    [
        {"low": 1e308, "step": 1e308},
        {"low": 0, "step": -1},
        {"low": "0", "step": 1},
        {"low": True, "step": 1},
        {"low": 0},
        [],
    ],
)
def test_a_channel_without_sense_is_refused(kept, tmp_path):
    found = epoch("rover/complex-5")
    with np.load(io.BytesIO(found.to_bytes())) as archive:
        channels = json.loads(archive["about"].tobytes())["channels"]
    refused(tmp_path / "bad.npz", changed(found, about={"channels": channels | {"x": kept}}))


def test_a_header_cannot_declare_more_than_the_file_has(tmp_path):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        head = io.BytesIO()
        np.lib.format.write_array_header_1_0(
            head, {"descr": "|u1", "fortran_order": False, "shape": (2**40,)}
        )
        archive.writestr("about.npy", head.getvalue())
    assert "not that of its header" in refused(tmp_path / "bad.npz", out.getvalue())


def test_a_small_file_cannot_unpack_to_a_huge_one(tmp_path, monkeypatch):
    monkeypatch.setattr("conevo.replay.trajectory.MOST_BYTES", 100_000)
    data = epoch("rover/complex-5").to_bytes()
    assert "more than 100,000" in refused(tmp_path / "bad.npz", data)


def test_files_that_are_not_archives_are_refused(tmp_path):
    for data in (b"", b"<script>alert(1)</script>", b"PK\x05\x06" + bytes(18)):
        refused(tmp_path / "bad.npz", data)


def test_its_description_is_stored_unchanged(tmp_path):
    words = renamed(epoch("rover/complex-5"), label="</script><b>\u00e9&amp;", task="a/../b")
    words.save(tmp_path / "epoch.npz")
    assert Trajectory.load(tmp_path / "epoch.npz").about == words.about
