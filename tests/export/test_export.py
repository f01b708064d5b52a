"""``conevo export`` and its Python function: files of a run, and what is refused."""

import json

import numpy as np
import pytest

import conevo
from cli.conftest import say  # noqa: F401 (a fixture)
from conevo.controllers.registry import CONTROLLERS, ControllerEntry
from conevo.export.files import FORMATS, content_of, export
from conevo.export.team import evolved_team
from export.needed import package
from runs.tiny import evolve_tiny


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A finished run with three rovers; of its generations some are kept."""
    folder = tmp_path_factory.mktemp("export")
    return evolve_tiny(folder / "run", run__generations=20)


def test_files_state_where_they_come_from(run, tmp_path):
    team = evolved_team(run)
    about = {
        "format": "conevo-team-1",
        "conevo": f"{conevo.__version__} ({run.provenance['code']})",
        "task": "rover-v2/complex-1",
        "method": "cone",
        "run": "run",
        "run_id": run.provenance["run_id"],
        "seed": 1,
        "generation": run.champion.generation,
        "n_robots": 3,
        "robots": [0, 1, 2],
        "sensors": list(conevo.world("rover/complex-1").inputs),
        "outputs": ["low", "med", "hi", "move: dx", "move: dy"],
        "context": 2,
        "controller": {"name": "srn", "n_hidden": 2, "max_hidden": 4, "recurrent": True,
                       "bias": False, "weight_scale": 10.0},
    }  # fmt: skip
    assert team.about == about
    with np.load(export(team, tmp_path / "team.npz")) as archive:
        assert json.loads(archive["about"].tobytes()) == about
        w_in = archive["w_in"]
    champion = run.champion
    used = w_in.shape[2]
    genes = np.where(champion.active[..., None], champion.genes, 0)[:, :used]
    assert np.array_equal(w_in, np.float32(10) * genes[:, :, :18].transpose(0, 2, 1))
    written = export(team, tmp_path / "team.py").read_text()
    scope = {}
    exec(written, scope)
    assert scope["ABOUT"] == about
    assert written.startswith(
        '"""Controllers of 3 robots, evolved by cone in rover-v2/complex-1.\n'
    )
    header = export(team, tmp_path / "team.h").read_text()
    assert all(f"   {name}: {json.dumps(value)}\n" in header for name, value in about.items())


def test_a_graph_states_the_same(run, tmp_path):
    onnx = package("onnx")
    team = evolved_team(run, robot=1)
    for fast, arithmetic in ((False, "exact"), (True, "fast")):
        model = onnx.load_from_string(content_of(team, tmp_path / "a.onnx", fast))
        facts = {one.key: one.value for one in model.metadata_props}
        assert facts.pop("arithmetic") == arithmetic
        assert facts == {k: v if isinstance(v, str) else json.dumps(v) for k, v in
                         team.about.items()}  # fmt: skip
        assert (model.ir_version, [one.version for one in model.opset_import]) == (9, [17])
        shapes = {
            one.name: [d.dim_value for d in one.type.tensor_type.shape.dim]
            for one in (*model.graph.input, *model.graph.output)
        }
        assert shapes == {"observations": [1, 16], "context": [1, 2], "outputs": [1, 5],
                          "next_context": [1, 2]}  # fmt: skip
        assert (len(model.graph.node) < 20) == fast


def test_a_program_states_the_same(run, tmp_path):
    torch = package("torch")
    team = evolved_team(run)
    path = export(team, tmp_path / "team.pt2")
    extra = {"about.json": ""}
    torch.export.load(path, extra_files=extra)
    assert json.loads(extra["about.json"]) == team.about | {"arithmetic": "exact"}


@pytest.mark.parametrize("ending", [".py", ".npz", ".h", ".onnx"])
def test_the_same_team_is_the_same_file(run, ending, tmp_path):
    if ending == ".onnx":
        package("onnx")
    team = evolved_team(run)
    path = export(team, tmp_path / f"team{ending}")
    before = path.stat()
    assert export(evolved_team(conevo.Run(run.path)), path) == path  # which is left as it is
    assert (path.stat().st_ino, path.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


def test_the_command_writes_what_the_function_returns(run, say, tmp_path):  # noqa: F811
    said = say("export", str(run.path), "--to", "folder/team.py")
    assert (said.code, said.out, said.err) == (0, "folder/team.py\n", "")
    path = tmp_path / "folder" / "team.py"
    assert path.read_bytes() == content_of(evolved_team(run), path)
    said = say("export", str(run.path), "--to", "one.NPZ", "--robot", "2")
    assert (said.code, said.out) == (0, "one.NPZ\n")
    with np.load(tmp_path / "one.NPZ") as archive:
        assert json.loads(archive["about"].tobytes())["robots"] == [2]
        alone = archive["w_out"]
    assert np.array_equal(alone[0], evolved_team(run).network.weights["w_out"][2, : alone.shape[1]])


def test_a_team_that_was_not_kept_is_evolved_again(run):
    kept = {one for one in range(20) if run.team(one) is not None}
    assert 3 not in kept
    assert kept
    lab = run.equip(1, None)
    for generation in (3, min(kept)):
        team = evolved_team(run, generation)
        assert team.about["generation"] == generation
        genes = run.team_again(generation, lab)
        own = np.float32(10) * np.where(genes.active[..., None], genes.genes, 0)
        w_in = team.network.weights["w_in"]
        assert np.array_equal(w_in, own[:, : w_in.shape[2], :18].transpose(0, 2, 1))


REFUSED = [
    (("--to", "team.onx"), "unknown ending '.onx' of team.onx; did you mean '.onnx'? "
     "(known: .h, .npz, .onnx, .pt2, .py)"),
    (("--to", "team"), "unknown ending '' of team (known: .h, .npz, .onnx, .pt2, .py)"),
    (("--to", "old.py"), "old.py exists already; choose another place with --to, or remove it"),
    (("--to", "old.py/team.py"), "old.py is a file, not a directory"),
    (("--to", "team.py", "--robot", "3"), "robot 3: the team of RUN has robots 0 to 2"),
    (("--to", "team.py", "--generation", "20"), "RUN has no generation 20 (it has 0 to 19)"),
    (("--to", "team.h", "--fast"), "team.h: only .onnx and .pt2 exist with fast arithmetic"),
    ((), "Missing option '--to'."),
    (("--to", ""), "--to is empty: give a value, or leave it out"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "message"), REFUSED)
def test_a_wrong_request_is_one_line(run, say, tmp_path, options, message):  # noqa: F811
    (tmp_path / "old.py").write_text("old")
    said = say("export", str(run.path), *options)
    assert (said.code, said.out) == (2, "")
    assert said.err == f"conevo: error: {message.replace('RUN', str(run.path))}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["old.py"]
    assert (tmp_path / "old.py").read_text() == "old"


@pytest.mark.parametrize(
    ("ending", "name", "install"),
    [(".onnx", "onnx", "pip install 'conevo[export]'"), (".pt2", "torch", "pip install torch")],
)
def test_a_missing_package_is_named(run, say, tmp_path, monkeypatch, ending, name, install):  # noqa: F811
    monkeypatch.setitem(__import__("sys").modules, name, None)  # import raises
    said = say("export", str(run.path), "--to", f"team{ending}")
    assert (said.code, said.out) == (3, "")
    assert said.err.startswith(f"conevo: error: {ending} needs ")
    assert said.err.endswith(f", which is not installed: {install}\n")
    assert said.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_run_without_a_team_and_a_controller_without_equations(run, say, monkeypatch, tmp_path):  # noqa: F811
    monkeypatch.setitem(
        CONTROLLERS, "own", ControllerEntry("own", "Own", "of a user", "made up", "srn:Srn")
    )
    monkeypatch.setattr("conevo.controllers.srn.Srn.name", "own")
    said = say("export", str(run.path), "--to", "team.py")
    assert said.err == (
        "conevo: error: controller 'own' cannot be exported: its equations are not in "
        "conevo/export/networks.py (known: srn, ctrnn, gru, thresholds)\n"
    )
    assert said.code == 2
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    from conevo.runs.config import resolve
    from conevo.runs.start import start
    from runs.tiny import TASK, tiny_settings

    start(resolve(TASK, "cone", "smoke", overrides=tiny_settings("cone")), tmp_path / "empty")
    said = say("export", "empty", "--to", "team.py")
    assert said.err == (
        "conevo: error: empty has no finished generation yet, so there is no team\n"
    )
    assert {path.name for path in tmp_path.iterdir()} == {"empty"}


def test_other_code_is_noted(run, say, tmp_path):  # noqa: F811
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(run.path, copy)
    file = copy / "provenance.json"
    about = json.loads(file.read_text())
    for one in (about, *about["sessions"]):
        one["code"] = "abc123abc123"
    file.write_text(json.dumps(about))
    said = say("export", "copy", "--to", "team.py")
    assert (said.code, said.out) == (0, "team.py\n")
    assert said.err.startswith("conevo: note: copy was made by conevo ")
    assert "(abc123abc123)" in (tmp_path / "team.py").read_text()


def test_all_formats_are_in_the_help(say):  # noqa: F811
    text = say("export", "--help").out
    assert all(ending in text for ending in FORMATS)
