"""A world in a file outside the package: used like any other, and never silently changed."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
import tomllib
from importlib import resources
from pathlib import Path

import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.runs.config import resolve
from conevo.runs.shaping import start_shaping, tasks_up_to
from conevo.runs.start import start
from conevo.worlds.registry import WORLDS
from conevo.worlds.registry import resolve as resolve_world
from runs.tiny import command, content, evolve_tiny, kill_twice, tiny_settings

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "light.py"
TEXT = EXAMPLE.read_text()


def line_with(text: str) -> int:
    """Return the number of the line of the example that has a text."""
    return next(k for k, line in enumerate(TEXT.splitlines(), 1) if text in line)


def written(path: Path, *changes: tuple[str, str]) -> Path:
    """Write the example with some words changed."""
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    os.utime(path, (0, 0))  # as if all were written at the same moment
    return path


@pytest.fixture
def light(tmp_path: Path) -> Path:
    """The example, in a file that a test may change."""
    return written(tmp_path / "light.py")


def test_a_path_names_the_world_wherever_it_is_named(
    light: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.toml"
    file.write_text('[run]\nworld = "light.py:dark-1"\nepochs = 3\n[world]\nstep = 0.02\n')
    config = resolve(file=file)
    assert (config.task, config.run.epochs) == ("light-v1/dark-1", 3)
    assert config.world_params.step == 0.02
    assert config.address == f"{light}:dark-1"
    assert config.label.startswith("light-v1-dark-1-cone-desk-s1-")
    for path in ("light.py:dark-1", "./light.py:dark-1", f"{light}:dark-1"):
        assert resolve(path).entry == config.entry
        assert conevo.world(path, n_robots=5).n_robots == 5
    assert "light-v1" not in WORLDS


def test_a_preset_serves_a_world_that_it_does_not_know(light: Path) -> None:
    rover = resolve("rover/complex-1", "cone", "desk")
    config = resolve(f"{light}:dark-1", "cone", "desk")
    assert config.run == rover.run
    presets = resources.files("conevo.runs") / "presets"
    sizes = tomllib.loads((presets / "desk.toml").read_text())["any"]["method"]["cone"]
    assert sizes
    assert {name: getattr(config.method_config, name) for name in sizes} == sizes
    assert config.world_params == config.entry.params_class()


def test_a_run_is_identified_by_the_text_and_not_by_the_place(light: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    moved = written(tmp_path / "other" / "name.py")
    ids = [resolve(f"{path}:dark-1").run_id for path in (light, moved)]
    assert ids[0] == ids[1]
    written(moved, ("start", "begin"))
    assert resolve(f"{moved}:dark-1").run_id != ids[0]


def test_a_changed_text_is_another_world_in_the_same_process(tmp_path: Path) -> None:
    file = tmp_path / "light.py"
    found = []
    for step in ("0.01", "0.02", "0.01"):  # of the same length, within a second
        written(file, (" = 0.01", f" = {step}"))
        found.append(resolve(f"{file}:dark-1"))
    assert [config.world_params.step for config in found] == [0.01, 0.02, 0.01]
    assert found[0] == found[2]
    assert found[0].entry.module != found[1].entry.module


def test_its_kernels_are_also_identified_by_their_text(tmp_path: Path) -> None:
    hashes, fresh = [], ("first version", "not loaded before")
    for change in (("", ""), ("1.0 - wp.length", "2.0 - wp.length"), ("three robots", "3 robots")):
        file = written(tmp_path / "light.py", change, fresh)
        hashes.append(conevo.Rollout(conevo.world(f"{file}:dark-1")).fingerprint)
    assert hashes[0] == hashes[2] != hashes[1]


@pytest.mark.slow
def test_a_world_outside_evolves_and_resumes_after_kills_bit_for_bit(
    light: Path, tmp_path: Path
) -> None:
    task = f"{light}:dark-1"
    whole = evolve_tiny(tmp_path / "whole", "cone", task, run__generations=40)
    path = tmp_path / "killed"
    kills = kill_twice(path, command(path, "cone", task, run__generations=40))
    conevo.Run(path).resume(threads=2)
    assert content(path) == content(whole.path), kills
    assert conevo.Run(path).test(4)["labels"] == whole.test(4)["labels"]


def interrupted(path: Path, task: str) -> conevo.Run:
    """Make a run that was interrupted after two generations."""

    def stop(run: conevo.Run, record: dict[str, object]) -> None:
        if record["generation"] == 1:
            raise KeyboardInterrupt

    config = resolve(task, "homcne", "smoke", overrides=tiny_settings("homcne", task))
    run = start(config, path, threads=1)
    with pytest.raises(KeyboardInterrupt):
        run.resume(threads=1, watch=stop)
    return conevo.Run(path)


def test_a_run_notices_that_its_world_has_changed_before_anything_in_it_runs(
    light: Path, tmp_path: Path
) -> None:
    path = interrupted(tmp_path / "run", f"{light}:dark-1").path
    light = path / "inputs" / "light.py"  # the run's own copy
    before = {p: p.read_bytes() for p in path.rglob("*") if p.is_file() and p != light}
    witness = tmp_path / "witness"
    light.write_text(f"{TEXT}\nopen({str(witness)!r}, 'w')\n")
    for use in (lambda run: run.resume(threads=1), lambda run: run.test(threads=1)):
        with pytest.raises(UsageError) as caught:
            use(conevo.Run(path))
        assert re.fullmatch(
            rf"world file {light} has changed: its digest is [0-9a-f]+, not [0-9a-f]+; .*",
            str(caught.value),
        )
    assert not witness.exists()
    light.unlink()
    with pytest.raises(UsageError, match=r"cannot read the world file .*light\.py: No such file"):
        conevo.Run(path).test(threads=1)
    assert {p: p.read_bytes() for p in path.rglob("*") if p.is_file()} == before
    light.write_text(TEXT)
    assert conevo.Run(path).resume(threads=1).status == "finished"


def test_a_world_named_again_is_its_current_version(light: Path, tmp_path: Path) -> None:
    file = tmp_path / "config.toml"
    file.write_text(resolve(f"{light}:dark-1", seed=7).to_toml())
    assert resolve(file=file).run.seed == 7
    written(light, ("start", "begin"))
    with pytest.raises(UsageError, match="has changed"):
        resolve(file=file)
    assert resolve(f"{light}:dark-1", file=file).run.seed == 7
    assert resolve(file=file, overrides={"run.world": f"{light}:dark-1"}).run.seed == 7
    with pytest.raises(UsageError, match=r"'world\.step' in .*config\.toml"):
        resolve("rover/complex-1", file=file)


def test_a_digest_needs_its_world(light: Path, tmp_path: Path) -> None:
    for given, words in (
        ({"run.world_digest": "0" * 12}, "needs run.world next to it"),
        (
            {"run.world": "rover/complex-1", "run.world_digest": "0" * 12},
            "belongs to a world in a file, not to 'rover/complex-1'",
        ),
        ({"run.world": f"{light}:dark-1", "run.world_digest": "0" * 12}, "has changed"),
        ({"run.world": f"{light}:dark-1", "run.world_digest": 5}, "must be a name"),
    ):
        with pytest.raises(UsageError, match=words):
            resolve(overrides=given)


FETCH = (
    "from conevo.rng import stream\n",
    "from conevo.rng import stream\nfrom paces import PACE\n",
)
PACED = (FETCH, ("Le(0.1)] = 0.01", "Le(0.1)] = PACE"))


def test_a_file_imports_its_neighbours_and_the_digest_covers_them(tmp_path: Path) -> None:
    found = []
    for place, pace in (("a", "0.02"), ("b", "0.03"), ("c", "0.02")):
        (tmp_path / place).mkdir()
        file = written(tmp_path / place / "light.py", *PACED)
        (file.parent / "paces.py").write_text("import math\nimport deeper\n\nPACE = deeper.PACE\n")
        (file.parent / "deeper.py").write_text(f"import paces\nimport light\n\nPACE = {pace}\n")
        (file.parent / "unused.py").write_text("raise RuntimeError\n")
        found.append(resolve(f"{file}:dark-1"))
    assert [config.world_params.step for config in found] == [0.02, 0.03, 0.02]
    assert found[0].run_id == found[2].run_id != found[1].run_id
    names = [Path(file).name for file in found[0].entry.files]
    assert names == ["light.py", "paces.py", "deeper.py"]
    assert found[0].entry.files[0] == found[0].entry.file
    assert not {"paces", "deeper", "light", "unused"} & set(sys.modules)
    kept = tmp_path / "config.toml"
    kept.write_text(found[0].to_toml())
    (tmp_path / "a" / "deeper.py").write_text("PACE = 0.04\n")
    with pytest.raises(
        UsageError, match=r"has changed, or its imports have \(paces.py, deeper.py\)"
    ):
        resolve(file=kept)


def test_kernels_made_of_a_neighbour_change_with_it_and_imports_may_wait(tmp_path: Path) -> None:
    score = "1.0 - wp.length(light(team, scene, i))"
    changes = (
        (score, "scored(light(team, scene, i))"),
        ("from conevo.rng", "from scores import scored\nfrom conevo.rng"),
        ("        return Simulation(", "        import late\n\n        return Simulation("),
        ("kernel_params(Params, self.params)", "late.of(Params, self.params)"),
    )
    file = written(tmp_path / "light.py", *changes)
    (tmp_path / "late.py").write_text("from conevo.worlds.protocol import kernel_params as of\n")
    hashes = []
    for sign in ("1.0", "2.0", "1.0"):
        (tmp_path / "scores.py").write_text(
            "import warp as wp\n\n\n@wp.func\ndef scored(way: wp.vec2f) -> float:\n"
            f"    return {sign} - wp.length(way)\n"
        )
        hashes.append(conevo.Rollout(conevo.world(f"{file}:dark-1")).fingerprint)
    assert hashes[0] == hashes[2] != hashes[1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("PACE = 1 / 0\n", "light.py: paces.py line 1: ZeroDivisionError: division by zero"),
        ("PACE = = 1\n", "light.py: paces.py line 1: SyntaxError: invalid syntax"),
        ("\nimport os\nimport conevo_no_such\n", "light.py: paces.py line 3: ModuleNotFoundError"),
        ("", "ImportError: cannot import name 'PACE'"),
    ],
)
def test_a_bad_neighbour_is_named(text: str, words: str, tmp_path: Path) -> None:
    file = written(tmp_path / "light.py", *PACED)
    for _ in range(2):
        (tmp_path / "paces.py").write_text(text)
        with pytest.raises(UsageError, match=re.escape(words)):
            resolve(f"{file}:dark-1")
    (tmp_path / "paces.py").write_text("PACE = 0.05\n")
    assert resolve(f"{file}:dark-1").world_params.step == 0.05


def test_shaping_through_the_environments_of_a_file(tmp_path: Path) -> None:
    names = '"dark-1", "dark-2", "dark-3"'
    file = written(tmp_path / "light.py", ('"dark-1",', names))
    tasks = tasks_up_to(f"{file}:dark-3")
    assert tasks == [f"{file}:dark-{k}" for k in (1, 2, 3)]
    settings = tiny_settings("homcne", tasks[0])
    shaping = start_shaping(tasks, "homcne", "smoke", 1, tmp_path / "s", settings, threads=1)
    shaping.resume(threads=1)
    assert shaping.tasks == ["light-v1/dark-1", "light-v1/dark-2", "light-v1/dark-3"]
    assert [run.status for run in shaping.stages] == ["finished"] * 3
    written(shaping.path / "inputs" / "light.py", ('"dark-1",', names), ("start", "begin"))
    with pytest.raises(UsageError, match="has changed"):
        _ = type(shaping)(shaping.path).configs


def say(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Run a command and return its exit code, output and errors."""
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


def test_a_session_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "my worlds").mkdir()
    written(tmp_path / "my worlds" / "light.py", ('"dark-1",', '"dark-1", "dark-2"'))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("webbrowser.open", lambda address: True)
    monkeypatch.setattr("webbrowser.get", lambda: object())
    monkeypatch.setenv("DISPLAY", ":0")
    sets = [w for k, v in tiny_settings("homcne").items() if k != "world.n_robots"
            for w in ("--set", f"{k}={v}")]  # fmt: skip
    more = ["--method", "homcne", "--preset", "smoke", "--threads", "1", *sets]
    code, out, err = say(capsys, "run", "my worlds/light.py:dark-1", *more)
    assert (code, err) == (0, "")
    assert "light-v1/dark-1, HomCNE, preset smoke, seed 1" in out
    assert "generation 5/5  nearness" in out
    recommended = re.findall(r"^  (conevo .*)$", out, flags=re.MULTILINE)
    assert [line.split()[1] for line in recommended] == [
        *("show", "replay", "test", "resume", "run", "run")
    ]
    for line in recommended:
        assert say(capsys, *shlex.split(line)[1:])[::2] == (0, "")
    code, out, err = say(capsys, "run", "my worlds/light.py:dark-2", "--shape", "--quiet", *more)
    assert (code, err) == (0, "")
    listed = json.loads(say(capsys, "list", "runs", "--json")[1])
    assert [row["world"] for row in listed] == [
        *["light-v1/dark-1"] * 3, "light-v1/dark-1 to dark-2",
    ]  # fmt: skip
    assert {row["status"] for row in listed} == {"finished"}


SOME = "        if int(keys[0]) % 7 == 3:\n            "
LATER = {
    "raises": (
        "        shape = (self",
        f"{SOME}self.fail()\n        shape = (self",
        "{file}:{line}: in scenarios: ValueError: boom; r keeps its copy of that file as it "
        "is: correct yours, and start another run",
    ),
    "returns nothing": (
        "        return LightScenarios(",
        f"{SOME}return None\n        return LightScenarios(",
        "world light-v1: scenarios: NoneType needs an array places, as Scene has one",
    ),
    "loses rows": (
        "        return LightScenarios(",
        f"{SOME}places = places[:0]\n        return LightScenarios(",
        "world light-v1: scenarios: LightScenarios.places must have a row for each of 1 scenarios, "
        "got shape [0, 4, 2]",
    ),
}
FAIL = (
    "    def simulation(self)",
    "    def fail(self):\n        raise ValueError('boom')\n\n    def simulation(self)",
)


@pytest.mark.parametrize("name", LATER)
def test_a_world_that_fails_later_is_named_with_its_line_and_the_call(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    old, new, words = LATER[name]
    file = written(tmp_path / "bad.py", (old, new), FAIL)
    line = 1 + file.read_text().splitlines().index("        raise ValueError('boom')")
    settings = tiny_settings("homcne") | {"run.epochs": 1, "run.generations": 40}
    sets = [w for k, v in settings.items() if k != "world.n_robots" for w in ("--set", f"{k}={v}")]
    task = [f"{file}:dark-1", "--method", "homcne", "--preset", "smoke", "--quiet"]
    code, out, err = say(capsys, "run", *task, "--out", "r", *sets)
    assert (code, out) == (2, "")
    assert err == f"conevo: error: {words.format(file=file, line=line)}\n"
    assert conevo.Run("r").done()[0] > 0


ENTRY = TEXT[TEXT.index("ENTRY = ") :]
BAD = {
    "none": ("", "has no ENTRY"),
    "syntax": ("def light(:\n", "line 1: SyntaxError: invalid syntax"),
    "binary": (b"\x00\xff\xfe", "cannot run the world file"),
    "raises": ("import math\n\nmath.sqrt(-1)\n", "line 3: ValueError: math domain error"),
    "lines": ("raise OSError('two\\nlines')\n", "line 1: OSError: two lines"),
    "exits": ("import sys\nsys.exit('used as a script')\n", "line 2: SystemExit: used as"),
    "escapes": ("class Odd(BaseException): pass\nraise Odd('out')\n", "line 2: Odd: out"),
    "imports": ("import conevo_no_such_module\n", "No module named 'conevo_no_such_module'"),
    "entry": ("ENTRY = 'light-v1'\n", "must be a WorldEntry, not str"),
    "version": (TEXT.replace('"light-v1"', '"light"'), "must be lower case and end with a version"),
    "taken": (TEXT.replace('"light-v1"', '"rover-v2"'), "is that of a world of the package"),
    "other": (
        TEXT.replace(ENTRY, ENTRY.replace('"light-v1"', '"dark-v1"')),
        "LightWorld is named 'light-v1', its entry 'dark-v1'",
    ),
    "environments": (TEXT.replace('("dark-1",)', '("dark-1")'), "must be a tuple of names"),
    "environment": (TEXT.replace('("dark-1",)', '("dark/1",)'), "must be a tuple of names"),
    "params": (TEXT.replace('"LightParams"', '"Lights"'), "unknown class 'Lights' in its ENTRY"),
    "kind": (TEXT.replace('"LightParams"', '"LightScenarios"'), "must be a dataclass with"),
    "world": (TEXT.replace('"LightWorld"', '"Lights"'), "class 'Lights' in its ENTRY; did you"),
    "castes": (TEXT.replace("    castes:", "    cast:"), "LightWorld has no castes"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_clear_line_and_nothing_is_written(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    text, words = BAD[name]
    Path("bad.py").write_bytes(text if isinstance(text, bytes) else text.encode())
    for _ in range(2):  # a file that failed once does not count as loaded
        code, out, err = say(capsys, "run", "bad.py:dark-1")
        assert (code, out) == (2, "")
        assert err.startswith("conevo: error: ")
        assert err.count("\n") == 1
        assert "bad.py" in err
        assert words in err
    assert [p.name for p in tmp_path.iterdir()] == ["bad.py"]


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("none.py:dark-1", "cannot read the world file none.py: No such file"),
        ("folder.py:dark-1", "cannot read the world file folder.py: Is a directory"),
        ("light.py", "'light.py' needs an environment, as in light.py:dark-1"),
        ("light.py:", "needs an environment, as in light.py:dark-1"),
        ("light.py:drak-1", "unknown environment 'drak-1' of world 'light.py'; did you mean"),
        ("light.py/dark-1", "a world in a file is named FILE.py:ENVIRONMENT"),
        ("light.txt:dark-1", "a world in a file is named FILE.py:ENVIRONMENT"),
        ("a/light.txt:dark-1", "a world in a file is named FILE.py:ENVIRONMENT"),
        ("light.py:dark-1 --set max_hidden=3", "max_hidden (3) must not be below n_hidden (4)"),
        ("light.py:dark-1 --shape", "no environment comes before"),
        ("light.py:dark-1 --prey random", "light-v1 has no prey"),
    ],
)
def test_a_wrong_name_is_one_clear_line(
    path: str,
    words: str,
    light: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(light.parent)
    Path("folder.py").mkdir()
    code, out, err = say(capsys, "run", *path.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert words in err
    assert sorted(p.name for p in light.parent.iterdir()) == ["folder.py", "light.py"]


def test_the_registry_finds_the_example() -> None:
    entry, environment = resolve_world(f"{EXAMPLE}:dark-1")
    assert (entry.name, environment, entry.file) == ("light-v1", "dark-1", str(EXAMPLE))
    assert len(TEXT.splitlines()) < 200


def test_a_file_that_is_not_utf_8_is_one_line(tmp_path: Path) -> None:
    file = tmp_path / "wide.py"
    for encoding in ("utf-16", "utf-16-le"):
        file.write_text(TEXT, encoding)
        with pytest.raises(UsageError, match=r"wide.py is UTF-16 text; save it as UTF-8$"):
            resolve(f"{file}:dark-1")
