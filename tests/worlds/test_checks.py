"""Each mistake in a world's file is one clear line of ``conevo check``."""

from __future__ import annotations

import functools
import json
import re
import subprocess
import sys
import time
from pathlib import Path
from textwrap import indent

import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.worlds import checking
from conevo.worlds.checks import findings
from conevo.worlds.registry import resolve
from worlds.test_outside import TEXT, line_with, written

TEAM = TEXT[TEXT.index("@wp.struct\nclass Team") : TEXT.index("@wp.func\ndef light(")]


IMPORT = "from conevo.kernels.arrays import named_arrays\n"


def named(field: str, dimension: str) -> str:
    """Return the team's state with a dimension given to one of its fields."""
    text = TEAM.replace("@wp.struct", f"{IMPORT}\n@named_arrays")
    given = f'{field}: Annotated[wp.array[float], "{dimension}"]'
    return text.replace(f"{field}: wp.array[float]", given)


# One line changed, and the topic and words of the one problem that must be found.
DECLARED = {
    "phase": ("(reset, sense, act,", "(reset, sense,", "structure", "has no phase 'act'; a world"),
    "arguments": (
        "def act(team: Team, scene: Scene, p: Params, i: int, t: int)",
        "def act(team: Team, scene: Scene, p: Params, i: int)",
        "structure",
        f"bad.py:{line_with('def act(') - 1}: phase act must be declared as act(team, scene, p, i,",
    ),
    "types": (
        "def act(team: Team, scene: Scene,", "def act(scene: Scene, team: Team,",
        "structure", "phase act must be declared as act(team, scene, p, i, t), of types Team",
    ),
    "inputs": ("    inputs: wp.array2d[float]\n", "", "structure",
               "Team needs a field 'inputs: wp.array2d[float]'"),
    "flat": ("    outputs: wp.array2d[float]", "    outputs: wp.array[float]", "structure",
             "Team.outputs must be declared as 'outputs: wp.array2d[float]'"),
    "field": ("    fitness: wp.array[float]\n", "", "structure", "Team needs a field 'fitness: "),
    "dtype": ("    action: wp.array[int]", "    action: wp.array[float]", "structure",
              "Team.action must be declared as 'action: wp.array[int]'"),
    "number": ("    chosen: wp.array[int]", "    chosen: int", "structure",
               "Team.chosen must be a one-dimensional array"),
    "scene": ("    places: wp.array[float]", "    places: float", "structure",
              "Scene.places must be an array"),
    "outputs": ('"dx", "dy")', '"dx", "dy", *"abcde")', "structure",
                "controller 'srn' has at most 8 outputs, and light-v1/dark-1 has 9"),
    "sensors": ('("light x", "light y")', '("light x")', "structure",
                "inputs must be a tuple of names, as in ('rest',), not 'light x'"),
    "same": ('"light y"', '"light x"', "structure", "inputs has 'light x' twice"),
    "no inputs": ('    inputs: ClassVar[tuple[str, ...]] = ("light x", "light y")\n', "",
                  "world", "world light-v1 needs inputs, a tuple of names, one of each"),
    "setting": ('{"n_hidden": 4', '{"n_hiden": 4', "structure",
                "unknown setting 'n_hiden' in the controller of light-v1; did you mean 'n_hidden'"),
    "settings": ('{"n_hidden": 4, "max_hidden": 8}', '("n_hidden", 4)', "structure",
                 "world light-v1: controller must be a dict of settings, as in {'n_hidden': 4}"),
    "castes": ("] = actions", "] = ('rest')", "structure", "castes must be a tuple of names"),
    "chosen": ("] = actions", "] = actions\n    settings = ('rst',)", "structure",
               "unknown caste 'rst' in settings; did you mean 'rest'?"),
    "choices": ("] = actions", "] = actions\n    settings = 'rest'", "structure",
                "settings must be a tuple of castes, as in ('rest',), not 'rest'"),
    "fewer": ("] = actions", "] = ('rest',)", "structure", "fewer than the 2 actions"),
    "twice": ('("idler",)', '("idler", "idler")', "structure", "heuristics has 'idler' twice"),
    "recorded": ('"action", "fitness")', '"acton", "action", "fitness")', "structure",
                 "unknown array 'acton' in Simulation.recorded; did you mean 'action'?"),
    "must be": ('"action", "fitness")', '"action")', "structure", "recorded must have 'fitness'"),
    "scratch": ("recorded=(", "scratch=('plces',), recorded=(", "structure",
                "unknown array 'plces' in Simulation.scratch"),
    "kept": ("recorded=(", "scratch=('fitness',), recorded=(", "structure",
             "Simulation.scratch must not have 'fitness', which is a result or recorded"),
    "sizes": ("recorded=(", "sizes={'lights': 2}, recorded=(", "structure",
              "Simulation.sizes has 'lights', which is not a dimension of an array of Team"),
    "size": ("recorded=(", "sizes={'robots': 2}, recorded=(", "structure",
             "Simulation.sizes must not have 'robots', which is 3 in this world"),
    "dimension": (TEAM, named("y", "robot"), "structure",
                  "unknown dimension 'robot' in Team.y; did you mean 'robots'?"),
    "dimensions": (TEAM, named("fitness", "castes"), "structure",
                   "Team.fitness must have the dimensions robots"),
    "made of": ("kernel_params(Params, self.params)", "self.params", "structure",
                "must be made of"),
    "bounds": ("step: Annotated[float, Gt(0), Le(0.1)]", "step: float", "parameters",
               "LightParams.step has no bounds; declare them, as in Annotated[float"),
    "default": ("Le(0.1)] = 0.01", "Le(0.1)] = 0.2", "parameters",
                "world.step = 0.2: must be less than or equal to 0.1"),
    "no default": ("Le(64)] = 3", "Le(64)]", "parameters", "LightParams.n_robots needs a default"),
    "frozen": ('@parameters("world")\nclass LightParams', "@dataclass\nclass LightParams",
               "parameters", "LightParams must be frozen"),
    "key": ("stream(key,", "stream(1,", "scenarios", "places are the same for all keys"),
    "call": ("stream(key, self.name)", "np.random.default_rng()", "scenarios",
             "places changes from call to call"),
    "company": ("stream(key, self.name)", "stream(keys[0] + key % 99, self.name)", "scenarios",
                "places of a scenario changes with the other keys"),
    "float64": ("(shape, np.float32)", "(shape)", "scenarios",
                "LightScenarios.places must be float32 as in Scene, not float64"),
    "too few": ("for key in keys])\n        return", "for key in keys[:1]])\n        return",
                "scenarios", "must have a row for each of 3 scenarios, got shape [1, 4, 2]"),
    "infinite": ("np.float32) for key", "np.float32) * np.float32('inf') for key", "scenarios",
                 "places has values that are not finite"),
    "missing": ("places=places, ", "", "world",
                f"bad.py:{line_with('places=places')}: in scenarios: TypeError: LightSc"),
    "name": ("1.0 - wp.length", "one - wp.length", "world",
             f"bad.py:{line_with('1.0 - wp.length')}: Referencing undefined symbol: one (in "
             "resolve: team.fitness[i] = one -"),
    "class": ('"LightWorld"', '"LightWord"', "world",
              "unknown class 'LightWord' in its ENTRY; did you mean 'LightWorld'?"),
}  # fmt: skip

# One kernel with all of these mistakes; the parameter ``fault`` selects one.
PLAYED = {
    "fitness": ("resolve", "team.fitness[i] = wp.sqrt(-1.0)", "values", "fitness is not finite"),
    "measure": ("outcome", "team.performance[0] = 1.0 / p.zero", "values", "nearness is not"),
    "others": ("commit", "team.x[(i + 1) % 3] = 0.01 * float(i)", "order",
               "commit gives other results if robots are visited in another order (`x` differ in "
               "iteration 0): robot 0 writes `x` of robot 1; a phase writes its own robot's data"),
    "early": ("act", "team.x[i] = team.x[(i + 1) % 3]", "order",
              "act gives other results if robots are visited in another order (`x`"),
    "peek": ("sense", "team.inputs[i, 0] = team.inputs[(i + 1) % 3, 1]", "order",
             "sense gives other results if robots are visited in another order (`inputs` differ"),
    "shared": ("commit", "move_light(team, i)", "order",
               "robot 0 writes `moved`, which others read or write in the same phase; move it in "
               "settle(team, scene, p, t), which runs once for the team"),
    "sum": ("resolve", "team.moved[0] = team.moved[0] + team.x[i]", "order",
            "3 robots write `moved`"),
    "neighbour": ("sense", "team.inputs[2 - i, 0] = 1.0", "sensors",
                  "sense writes inputs of robot 2 for robot 0"),
    "output": ("act", "team.outputs[(i + 1) % 3, 0] = 9.0", "order",
               "robot 0 writes `outputs` of robot 1; a phase writes its own robot's data"),
    "action": ("commit", "team.action[i] = 2", "counts", "action is 2; it must be -1 (none) or"),
    "column": ("commit", "team.counts[2 * i] = team.counts[2 * i] + 1", "counts", "counts sum"),
    "switches": ("commit", "team.switches[i] = 0", "counts", "switches are not those of `action`"),
    "left": ("resolve", "team.left[i] = team.left[i] + 1.0; team.fitness[i] = team.left[i]",
             "reset", "depend on the previous epoch in the same memory; reset leaves"),
    "constant": ("resolve", "team.fitness[i] = 0.5", "random teams",
                 "all 100 have the same fitness: there is nothing to select on"),
    "late": ("outcome", "team.fitness[0] = 2.0", "values",
             "outcome writes fitness, which must be right after each iteration: write it in"),
    "again": ("outcome", "team.kept[0] = team.kept[0] + 1.0; team.performance[0] = team.kept[0]",
              "record", "performance differs from that of evaluate"),
}  # fmt: skip
MOVE_LIGHT = """
@wp.func
def move_light(team: Team, i: int) -> None:
    if i == 0:
        team.moved[0] = 0.25
    team.x[i] = team.moved[0]


"""
RESET = "@wp.func\ndef reset("
FIELDS = [
    '    moved: Annotated[wp.array[float], "team"]\n',
    "    left: wp.array[float]\n",
    '    kept: Annotated[wp.array[float], "team"]\n',
]


def problems(file: Path) -> list[tuple[str, str]]:
    """Return topics and texts of all problems."""
    found = list(findings(f"{file}:dark-1"))
    return [(one.topic, one.text) for one in found if one.status == "problem"]


@pytest.mark.parametrize("name", DECLARED)
def test_a_mistake_in_a_declaration_is_one_line(name: str, tmp_path: Path) -> None:
    old, new, topic, words = DECLARED[name]
    file = written(tmp_path / "bad.py", (old, new))
    found = problems(file)
    assert [one for one, _ in found] == [topic]
    assert words in found[0][1]
    if topic == "structure":  # no run starts with it either
        with pytest.raises(UsageError, match=re.escape(words)):
            conevo.Rollout(conevo.world(f"{file}:dark-1"))


def selecting(number: int, text: str = TEXT) -> str:
    """Return the example with a parameter ``fault`` of this number, which its kernel can read."""
    for old, new in (
        ("class LightParams:", f"{{}}\n    fault: Annotated[int, Ge(0), Le(99)] = {number}\n"),
        ("    step: float\n", "{}    fault: int\n    zero: float\n"),
        ("kernel_params(Params, self.params)", "kernel_params(Params, self.params, zero=0.0)"),
    ):
        assert text.count(old) == 1, old
        text = text.replace(old, new.replace("{}", old))
    return text


def faulty(path: Path, name: str) -> Path:
    """Write the example with a kernel that has all mistakes and a parameter that selects one."""
    state = "    y: wp.array[float]\n"
    begin = "    team.x[i] = scene.places[2 * i]\n"
    text = selecting([*PLAYED].index(name) + 1 if name else 0)
    for old, new in (
        (state, "{}" + "".join(FIELDS)),
        ("@wp.struct\nclass Team:", "@named_arrays\nclass Team:"),
        ("import warp as wp\n", "{}" + IMPORT),
        (RESET, MOVE_LIGHT + "{}"),
        (begin, "{}    if i == 0:\n        team.kept[0] = 0.0\n        team.moved[0] = 0.0\n"),
    ):
        assert text.count(old) == 1, old
        text = text.replace(old, new.replace("{}", old))
    for k, (phase, line, *_) in enumerate(PLAYED.values(), 1):
        head = re.search(rf"def {phase}\(.*\n", text)
        assert head is not None
        after = text.index("\n\n\n", head.end())
        text = f"{text[:after]}\n    if p.fault == {k}:\n        {line}{text[after:]}"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", ["", *PLAYED])
def test_a_mistake_in_a_phase_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("conevo.worlds.checks.ITERATIONS", 15)  # of an epoch step by step
    found = problems(faulty(tmp_path / "bad.py", name))
    if not name:
        assert found == []
        return
    _, _, topic, words = PLAYED[name]
    assert any(one == topic and words in text for one, text in found), found
    assert len(found) <= 2


NOTED = {
    "heuristic": (
        '("idler",)', '("idler", "runner")', "heuristics",
        "'runner' does exactly what a network with equal outputs does: does act have a case for "
        "heuristic 1?",
    ),
    "environments": (
        '("dark-1",)', '("dark-1", "dark-2")', "environments",
        "dark-2 is the same as dark-1: in its parameters, and in a scenario of one key",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", NOTED)
def test_unused_declarations_are_noted(name: str, tmp_path: Path) -> None:
    old, new, topic, words = NOTED[name]
    file = written(tmp_path / "odd.py", (old, new))
    found = [one for one in findings(f"{file}:dark-1") if one.status in ("note", "problem")]
    assert [(one.status, one.topic, one.text) for one in found] == [("note", topic, words)]


def test_another_environment_whose_scenarios_are_wrong_is_a_problem(tmp_path: Path) -> None:
    fails = "        if self.environment == 'dark-2':\n            places = places[:0]\n"
    made = "        return LightScenarios("
    file = written(
        tmp_path / "bad.py", ('("dark-1",)', '("dark-1", "dark-2")'), (made, fails + made)
    )
    assert problems(file) == [
        ("environments", "dark-2: LightScenarios.places must have a row for each of 1 scenarios, "
                         "got shape [0, 4, 2]"),
    ]  # fmt: skip


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    with pytest.raises(SystemExit) as caught:
        main(["check", *arguments])
    out, err = capsys.readouterr()
    assert err == ""
    return int(caught.value.code or 0), out


CALLED = """
@wp.func
def beyond(team: Team, i: int) -> int:
    if i > 5:
        return i
    return i + 70


@wp.func
def both(team: Team, i: int):
    return beyond(team, i), i


@wp.func
def reset("""
ACT, COMMIT, SENSE = (
    "    a = team.chosen[i]\n",
    "    count_action(",
    "    team.inputs[i, 1] = way[1]\n",
)
CHOOSE = "    if team.heuristic[i] == 0:\n"
# The line of the example before which the mistake is made, the mistake, and the number of the line
# in it, and the statement, that are found. All are in one kernel, and a parameter selects one.
OUTSIDE: dict[str, tuple[str, str, int, str]] = {
    name: (before, line, 0, line)
    for name, before, line in (
        ("counts", COMMIT, "count_action(team.action, team.switches, team.counts, i, a, a + 1)"),
        ("output", CHOOSE, "team.chosen[i] = int(team.outputs[i, 4]) + heuristic_action(uniform("
                           "scene.seed[0], t, 0, i), 0, 1, 2)"),
        ("dy", ACT, "step = steered_step(team.outputs[i, 2], team.outputs[i, 4], p.step)"),
        ("highest", CHOOSE, "team.chosen[i] = highest(team.outputs, i, 5)"),
        ("input", SENSE, "team.inputs[i, 2] = way[1]"),
        ("robot", SENSE, "team.inputs[i + 1, 1] = way[1]"),
    )
} | {
    "after a call": (ACT, "team.x[i] = team.y[\n    beyond(team, i)\n]", 0,
                     "team.x[i] = team.y[ beyond(team, i) ]"),
    "after two": (ACT, "u, v = both(team, i)\nteam.x[v] = team.y[u]", 1, "team.x[v] = team.y[u]"),
    "loop": (ACT, "k = int(0)\nwhile team.x[k] < 7.0:\n    k += 1\n    if k < 2:\n"
                  "        continue", 1, "while team.x[k] < 7.0:"),
}  # fmt: skip


def wild(folder: Path, name: str) -> tuple[Path, int]:
    """Write the example with all these mistakes, of which one is made; return its line, too."""
    text = selecting([*OUTSIDE].index(name) + 1).replace("\n@wp.func\ndef reset(", CALLED)
    text = text.replace("from conevo.rng", "from neighbour import NOTHING\nfrom conevo.rng")
    for k, (before, lines, *_) in enumerate(OUTSIDE.values(), 1):
        assert text.count(before) == 1, before
        made = indent(f"if p.fault == {k}:\n{indent(lines, '    ')}\n", "    ")
        text = text.replace(before, made + before)
    (folder / "neighbour.py").write_text("NOTHING = 0\n")
    file = folder / "bad.py"
    file.write_text(text)
    selected = f"    if p.fault == {[*OUTSIDE].index(name) + 1}:"
    return file, text.splitlines().index(selected) + 2 + OUTSIDE[name][2]


@pytest.mark.parametrize("name", OUTSIDE)
def test_an_index_outside_an_array_is_found_with_its_line(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is the line that reads, not the previous one."""
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    monkeypatch.setenv("TMPDIR", str(scratch))
    file, at = wild(tmp_path, name)
    code, out = run(capsys, str(file))
    assert code == 2
    assert "ok       file          bad.py, which imports neighbour.py" in out
    place = f"problem  memory        {file}:{at}: in `{OUTSIDE[name][3]}` an index lies outside its"
    assert place in out
    assert out.endswith("1 problem\n")
    assert [*scratch.iterdir()] == []  # of two children that died


@pytest.mark.slow
def test_a_check_without_progress_is_ended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checking, "STEP_SECONDS", 0.3)
    monkeypatch.setattr(checking, "AGAIN_SECONDS", 1)
    endless = "k = int(0)\n    while True:\n        k = 1 - k\n    a = team.chosen[i]"
    file = written(tmp_path / "light.py", ("a = team.chosen[i]", endless))
    code, out = run(capsys, str(file), "--json")
    assert code == 2
    n = line_with("a = team.chosen[i]")
    assert re.fullmatch(
        rf"{file}:({n}|{n + 1}|{n + 2}): in `.*` the check did not end: a loop may run forever",
        json.loads(out)[-1]["text"],
    )


def test_only_running_kernels_have_a_time_limit() -> None:
    """The compilation of kernels after a finding has no time limit."""
    code = (
        "import time; print('[\"ok\"]', flush=True); time.sleep(1);"
        "print('[\"running\"]', flush=True); time.sleep(60)"
    )
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    assert child.stdout is not None
    began = time.monotonic()
    with open(child.stdout.fileno(), closefd=False) as lines:
        assert [*checking._heard(child, lines, 0.5)] == [["ok"], ["running"]]
    assert 1.4 < time.monotonic() - began < 30
    child.stdout.close()


@pytest.mark.parametrize(("line", "words"), [
    ("import os; os._exit(7)", "the process that checked it ended with exit status 7"),
    ("import os; os._exit(0)", "the process that checked it ended with exit status 0"),
    ("raise SystemExit(3)", f"bad.py:{line_with('shape = (self')}: in scenarios: SystemExit: 3"),
])  # fmt: skip
def test_a_world_that_ends_the_process_is_not_sound(
    line: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shape = "        shape = (self"
    file = written(tmp_path / "bad.py", (shape, f"        {line}\n{shape}"))
    code, out = run(capsys, str(file))
    assert (code, out.splitlines()[-1]) == (2, "1 problem")
    assert words in out.splitlines()[-2]


def test_a_failure_of_the_machine_is_not_one_of_the_world(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("WARP_CACHE_PATH", "/proc/none")
    with pytest.raises(SystemExit) as caught:
        main(["check", "rover/complex-1"])
    out, err = capsys.readouterr()
    assert caught.value.code == 3
    assert "problem" not in out
    assert re.fullmatch(r"conevo: error: compiled kernels cannot be kept in /proc/none/.*\n", err)


def test_a_sound_world_has_no_problem_and_a_wrong_name_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out = run(capsys, str(written(tmp_path / "light.py")))
    assert (code, out.splitlines()[-1]) == (0, "no problems")
    topics = [line.split()[1] for line in out.splitlines()[:-1]]
    assert topics[:5] == ["file", "parameters", "structure", "scenarios", "memory"]
    assert topics[5:] == [*("sensors", "values", "counts", "order", "reset"),
                          *("heuristics", "record", "drawn", "random")]  # fmt: skip
    for name, words in (("rovr", "did you mean 'rover'"), (f"{tmp_path}/no.py", "cannot read")):
        with pytest.raises(SystemExit) as caught:
            main(["check", name])
        out, err = capsys.readouterr()
        assert (caught.value.code, out, err.count("\n")) == (2, "", 1)
        assert words in err


def test_no_run_and_no_campaign_starts_with_an_index_outside_its_array(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file, at = wild(tmp_path, "counts")
    (tmp_path / "plan.toml").write_text(
        '[campaign]\nname = "bad"\npreset = "smoke"\nseeds = 1\n\n'
        '[factors]\nworld = ["bad.py:dark-1"]\nmethod = ["homcne"]\n'
    )
    known = checking._place
    monkeypatch.setattr(checking, "_place", functools.cache(known))  # compiled only once
    for arguments in (["run", "bad.py:dark-1"], ["campaign", "start", "plan.toml"]):
        with pytest.raises(SystemExit) as caught:
            main(arguments)
        out, err = capsys.readouterr()
        assert (caught.value.code, out) == (2, "")
        assert err == (
            f"conevo: error: {file}:{at}: in `{OUTSIDE['counts'][3]}` an index lies outside its "
            f"array; see also: conevo check {file}:dark-1\n"
        )
        files = {one.name for one in tmp_path.iterdir()} - {"__pycache__"}
        assert files == {"bad.py", "neighbour.py", "plan.toml"}


def test_a_sound_world_is_checked_once_for_its_text_and_parameters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry, environment = resolve(f"{written(tmp_path / 'light.py')}:dark-1")
    begun = []
    in_child = checking._in_child

    def counted(*given):
        begun.append(given)
        return in_child(*given)

    monkeypatch.setattr(checking, "_in_child", counted)
    monkeypatch.setattr(checking.wp.config, "kernel_cache_dir", str(tmp_path))
    few, many = entry.params_class(iterations=5), entry.params_class(iterations=6)
    for params in (few, few, many, many, few):
        checking.refuse_wild_indices(entry, environment, params)
    assert [json.loads(given[-1])["iterations"] for given in begun] == [5, 6]
