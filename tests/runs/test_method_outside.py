"""A method in a file outside the package: used like any other, and never silently another one."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import shutil
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import conevo
from conevo.campaigns.plan_file import read_plan
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.evolution.methods.registry import METHODS
from conevo.evolution.methods.registry import resolve as resolve_method
from conevo.runs.config import resolve
from conevo.runs.lab import layout_of
from conevo.runs.settings import settings_of
from conevo.runs.start import start
from runs.tiny import TASK, content, tiny_settings

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "random_search.py"
TEXT = EXAMPLE.read_text()
NAME = "random-search"
SETTINGS = tiny_settings("homcne")


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """The example, in a file that a test may change, next to a file that it imports."""
    folder = tmp_path / "methods"
    folder.mkdir()
    (folder / "sizes.py").write_text("MANY = 30\n")
    text = TEXT.replace("import numpy as np\n", "import numpy as np\nfrom sizes import MANY\n")
    (folder / "mine.py").write_text(text.replace("Ge(2)] = 10_000", "Ge(2)] = MANY"))
    return folder / "mine.py"


def evolved(path: Path, method: Any, **more: Any) -> conevo.Run:
    return conevo.evolve(TASK, method, "smoke", out=path, overrides=SETTINGS, threads=1, **more)


def test_a_name_finds_the_method_wherever_it_is_named(
    mine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own.toml").write_text(
        f'[run]\nworld = "{TASK}"\nmethod = "methods/mine.py:{NAME}"\n[method]\ngenotypes = 9\n'
    )
    config = resolve(file=tmp_path / "own.toml")
    assert (config.method, config.method_config.genotypes) == (NAME, 9)
    assert config.label.startswith(f"rover-v2-complex-1-{NAME}-desk-s1-")
    monkeypatch.chdir(mine.parent)
    for name in (f"mine.py:{NAME}", f"./mine.py:{NAME}", f"{mine}:{NAME}"):
        again = resolve(TASK, name)
        assert again.method_entry == config.method_entry
        assert again.method_config.genotypes == 30  # its own default, from the file that it imports
        assert conevo.method(name, genotypes=5).config.genotypes == 5
    assert again.run == resolve(TASK, "cone").run  # the preset sets the length, not the sizes
    assert NAME not in METHODS


def test_a_run_is_identified_by_the_text_and_needs_nothing_outside_its_directory(
    mine: Path, tmp_path: Path
) -> None:
    run = evolved(tmp_path / "run", f"{mine}:{NAME}")
    assert run.outline.method == run.config.method == NAME
    assert {p.name for p in (run.path / "inputs").iterdir()} == {"mine.py", "sizes.py"}
    text = (run.path / "config.toml").read_text()
    assert f'method = "inputs/mine.py:{NAME}"' in text
    assert re.search(r'^method_digest = "[0-9a-f]{12}"$', text, flags=re.MULTILINE)
    made = content(run.path)
    moved = run.path.rename(tmp_path / "elsewhere")
    shutil.rmtree(mine.parent)
    found = conevo.Run(moved)
    assert found.config.run_id == found.provenance["run_id"]
    assert found.test(threads=1) == found.test_result["champion"]  # type: ignore[index]
    again = conevo.evolve(config=moved / "config.toml", out=tmp_path / "again", threads=1)
    assert content(again.path) == made
    longer = conevo.Run(moved).resume(generations=7, threads=1)
    assert len(longer.generations()) == 7


def interrupted(path: Path, name: str) -> conevo.Run:
    """Make a run that was interrupted after two generations."""

    def stop(run: conevo.Run, record: dict[str, object]) -> None:
        if record["generation"] == 1:
            raise KeyboardInterrupt

    config = resolve(TASK, name, "smoke", overrides=SETTINGS)
    run = start(config, path, threads=1)
    with pytest.raises(KeyboardInterrupt):
        run.resume(threads=1, watch=stop)
    return conevo.Run(path)


def test_it_resumes_bit_for_bit(mine: Path, tmp_path: Path) -> None:
    whole = evolved(tmp_path / "whole", f"{mine}:{NAME}")
    run = interrupted(tmp_path / "run", f"{mine}:{NAME}")
    mine.unlink()
    assert content(run.resume(threads=1).path) == content(whole.path)


def test_a_changed_copy_is_refused_before_anything_in_it_runs(mine: Path, tmp_path: Path) -> None:
    path = interrupted(tmp_path / "run", f"{mine}:{NAME}").path
    copy, witness = path / "inputs" / "mine.py", tmp_path / "witness"
    text = copy.read_text()
    copy.write_text(f"{text}\nopen({str(witness)!r}, 'w')\n")
    with pytest.raises(UsageError, match=rf"method file {copy} has changed, or its imports have"):
        conevo.Run(path).resume(threads=1)
    assert not witness.exists()
    copy.write_text(text)
    assert conevo.Run(path).resume(threads=1).status == "finished"


def imported(file: Path) -> ModuleType:
    """Import a file as a user's own module."""
    spec = importlib.util.spec_from_file_location("users_own", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["users_own"] = module
    spec.loader.exec_module(module)
    return module


def test_an_object_works_like_its_name(
    mine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(mine.parent))
    own = imported(mine)
    search = own.RandomSearch(own.RandomSearchConfig(genotypes=4, elite_portion=0.25))
    settings = {k: v for k, v in SETTINGS.items() if k != "method.genotypes"}
    run = conevo.evolve(TASK, search, "smoke", out=tmp_path / "a", overrides=settings, threads=1)
    assert run.config.method_config.elite_portion == 0.25
    assert (run.path / "inputs" / "mine.py").read_bytes() == mine.read_bytes()
    settings |= {"method.elite_portion": 0.25, "method.genotypes": 4}
    name = f"{mine}:{NAME}"
    same = conevo.evolve(TASK, name, "smoke", out=tmp_path / "b", overrides=settings, threads=1)
    assert content(run.path) == content(same.path)
    with pytest.raises(UsageError, match=r"method\.genotypes in overrides: the method that is"):
        evolved(tmp_path / "c", search)
    cone = conevo.evolve(
        TASK,
        conevo.method("cone-2", genotypes=4),
        "smoke",
        out=tmp_path / "d",
        overrides={k: v for k, v in SETTINGS.items() if k[:6] != "method"},
        threads=1,
    )
    assert (cone.outline.method, cone.config.method_entry) == ("cone-2", METHODS["cone-2"])


@dataclass(frozen=True)
class Homeless:
    """A method in a file without an entry."""

    config: object = field(default_factory=object)
    name: str = "homeless"

    def init(self, layout: object, root: object) -> None: ...
    def ask(self, state: object) -> None: ...
    def tell(self, state: object, trials: object, scores: object) -> None: ...


def test_an_object_that_no_run_can_keep_is_refused(
    mine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = ModuleType("__main__")  # as in an interactive session
    monkeypatch.setitem(sys.modules, "__main__", session)
    exec(TEXT.partition("if __name__")[0], vars(session))
    other = TEXT.replace("class RandomSearch:", "class Other(object):\n    pass\n\n\n"
                         "@dataclass(frozen=True)\nclass RandomSearch(Other):")  # fmt: skip
    mine.with_name("other.py").write_text(
        other.replace("class Other(object):\n    pass", "class Other:\n    init = ask = tell = len")
    )
    stray = imported(mine.with_name("other.py")).Other()
    for method, words in (
        (session.RandomSearch(), "is defined in __main__, which a run cannot keep a copy of: put"),
        (Homeless(), r"method file .*test_method_outside\.py: it has no ENTRY"),
        (stray, "its ENTRY is of RandomSearch, not of method Other"),
        (3, "method int is neither a name nor a method, which has init, ask and tell"),
    ):
        with pytest.raises(UsageError, match=words) as caught:
            evolved(tmp_path / "run", method)
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "run").exists()


def say(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Run a command and return its exit code, output and errors."""
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


def test_a_session_on_the_command_line(
    mine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    name = f"methods/mine.py:{NAME}"
    code, out, err = say(capsys, "list", "settings", TASK, "--method", name)
    assert (code, err) == (0, "")
    assert re.search(r"^method\.genotypes +30 +30 ", out, flags=re.MULTILINE)
    assert "M, whole networks in the" in out
    sets = [word for key, value in SETTINGS.items() for word in ("--set", f"{key}={value}")]
    words = ("run", TASK, "--method", name, "--preset", "smoke", "--threads", "1", *sets)
    assert "nothing was written" in say(capsys, *words, "--dry-run")[1]
    code, out, err = say(capsys, *words)
    assert (code, err) == (0, "")
    assert "rover-v2/complex-1, random search, preset smoke, seed 1" in out
    (path,) = (tmp_path / "runs").iterdir()
    mine.unlink()
    shown = say(capsys, "show", str(path))[1]
    assert "rover-v2/complex-1, random search, preset smoke, seed 1" in shown
    listed = json.loads(say(capsys, "list", "runs", "--json")[1])
    assert [(row["method"], row["status"]) for row in listed] == [(NAME, "finished")]
    for line in re.findall(r"^  (conevo (?:test|resume|run) .*)$", out, flags=re.MULTILINE):
        assert say(capsys, *shlex.split(line)[1:])[::2] == (0, ""), line


def test_no_other_run_starts_from_it_unless_it_has_populations(mine: Path, tmp_path: Path) -> None:
    origin = evolved(tmp_path / "origin", f"{mine}:{NAME}")
    run = evolved(tmp_path / "run", "homcne", origin=origin)  # both have whole networks
    assert run.status == "finished"
    again = evolved(tmp_path / "again", f"{mine}:{NAME}", origin=origin, of_champion=True)
    assert again.provenance["origin"]["of"] == "champion"


TELL = "def tell(self, state: Populations, trials: Trials, scores: Scores)"
BAD = {
    "none": ("", "has no ENTRY, the MethodEntry of its method"),
    "syntax": ("def ask(:\n", "cannot run the method file bad.py: line 1: SyntaxError"),
    "raises": ("import math\n\nmath.sqrt(-1)\n", "line 3: ValueError: math domain error"),
    "imports": ("import conevo_no_such\n", "line 1: ModuleNotFoundError: No module named"),
    "entry": ("ENTRY = 'random-search'\n", "its ENTRY must be a MethodEntry, not str"),
    "letters": (TEXT.replace('"random-search",', '"Random Search",'), "must be lower case, digits"),
    "taken": (TEXT.replace('name="random-search"', 'name="cone-1"'), "is that of a method of the"),
    "config": (TEXT.replace('config_name="RandomSearchConfig"', 'config_name="Config"'),
        "unknown class 'Config' in its ENTRY"),
    "kind": (TEXT.replace('config_name="RandomSearchConfig"', 'config_name="RandomSearch"')
        .replace("@dataclass(frozen=True)\nclass RandomSearch:", "class RandomSearch:"),
        "RandomSearch must be a dataclass"),
    "class": (TEXT.replace('method_name="RandomSearch"', 'method_name="RandomSerch"'),
        "unknown class 'RandomSerch' in its ENTRY; did you mean 'RandomSearch'?"),
    "functions": (TEXT.replace("def ask(", "def asks(").replace("def init(", "def begin("),
        "RandomSearch has no init, no ask"),
    "arguments": (TEXT.replace(TELL, "def tell(self, state: Populations)"),
        "RandomSearch.tell must take 3 arguments"),
    "made": (TEXT.replace('    title: str = "random search"\n', ""),
        "RandomSearch must be made of config, name and title"),
    "name": (TEXT, "method 'bad.py:other': the method in this file is bad.py:random-search"),
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
    Path("bad.py").write_text(text)
    for _ in range(2):  # a file that failed once does not count as loaded
        code, out, err = say(capsys, "run", TASK, "--method", "bad.py:other")
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert err.startswith("conevo: error: ")
        assert "bad.py" in err
        assert words in err
    assert [p.name for p in tmp_path.iterdir()] == ["bad.py"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("none.py:x", "cannot read the method file none.py: No such file"),
        ("mine.py", "method 'mine.py': the method in this file is mine.py:random-search"),
        ("mine.txt:x", "method 'mine.txt:x': a method in a file is named FILE.py:NAME"),
        ("mine.py/x", "a method in a file is named FILE.py:NAME"),
        ("randon-search", "unknown method 'randon-search'"),
        (f"mine.py:{NAME} --set method.genotype=3", "did you mean 'method.genotypes'"),
        (f"mine.py:{NAME} --set method.genotypes=1", "must be greater than or equal to 2"),
        (f"mine.py:{NAME} --set run.method_digest=000000000000", "run.method_digest"),
        ("cone --set run.method_digest=000000000000", "run.method_digest"),
    ],
)
def test_a_wrong_name_is_one_clear_line(
    name: str,
    words: str,
    mine: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(mine.parent)
    code, out, err = say(capsys, "run", TASK, "--method", *name.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert words in err
    assert sorted(p.name for p in mine.parent.iterdir()) == ["mine.py", "sizes.py"]


UNKEPT = (
    ("import dataclass, field\n", "import dataclass, field, replace\n"),
    ("        return begin(", "        begun = begin("),
    ("True\n        )\n\n    def ask", "True\n        )\n        return BEGUN\n\n    def ask"),
)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("[1.0]", "the state of random search cannot be kept: fitness is list;"),
        ("stream(1, 'a')", "the state of random search cannot be kept: fitness is Generator;"),
        ("begun.fitness, progress=7", "the state of random search has no progress, made by"),
        (
            "begun.fitness, progress=replace(begun.progress, root=99)",
            "the first state of random search has a progress with another root",
        ),
    ],
)
def test_a_state_that_cannot_be_kept_is_refused_before_anything_is_written(
    value: str, words: str, mine: Path, tmp_path: Path
) -> None:
    text = TEXT
    for old, new in UNKEPT:
        assert old in text
        text = text.replace(old, new.replace("BEGUN", f"replace(begun, fitness={value})"))
    mine.write_text(text)
    with pytest.raises(UsageError, match=re.escape(words)):
        evolved(tmp_path / "run", f"{mine}:{NAME}")
    assert not (tmp_path / "run").exists()


def test_an_error_in_the_file_is_named_with_its_line(
    mine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    old = "credit.of_clones(scores.fitness)[None]"
    mine.write_text(TEXT.replace(old, f"{old} * (1 // (1 - state.generation))"))  # not at once
    monkeypatch.chdir(tmp_path)
    sets = [word for key, value in SETTINGS.items() for word in ("--set", f"{key}={value}")]
    words = ("run", TASK, "--method", f"{mine}:{NAME}", "--preset", "smoke", "--quiet", *sets)
    code, _, err = say(capsys, *words)
    assert code == 2
    assert re.fullmatch(
        r"conevo: error: .*mine\.py:\d+: in tell: ZeroDivisionError: .* by zero; \S+ keeps "
        r"its copy of that file as it is: correct yours, and start another run\n",
        err,
    )


def test_the_registry_finds_the_example() -> None:
    entry = resolve_method(f"{EXAMPLE}:{NAME}")
    assert (entry.name, entry.title, entry.file) == (NAME, "random search", str(EXAMPLE))


# --- controllers of a method ----------------------------------------------------------------------


@pytest.fixture
def choosy(mine: Path) -> str:
    """The address of a method that works with two controllers only."""
    text = mine.read_text()
    mine.write_text(
        text.replace('    name="random', '    controllers=("gru", "ctrnn"),\n    name="random')
    )
    return f"{mine}:{NAME}"


def test_a_method_chooses_its_controller(choosy: str, tmp_path: Path) -> None:
    config = resolve(TASK, choosy)
    assert config.controller.name == "gru"
    assert "controller.name" not in config.changed
    other = resolve(TASK, choosy, overrides={"controller.name": "ctrnn"})
    assert other.controller.name == "ctrnn"
    assert "controller.name" in other.changed
    (kind,) = [one for _, one, _ in settings_of(config) if one.name == "name"]
    assert (kind.default, kind.allowed) == ("gru", "gru, ctrnn")
    (tmp_path / "own.toml").write_text(config.to_toml())
    assert resolve(file=tmp_path / "own.toml").run_id == config.run_id
    layout = layout_of(config.build_world(), config.controller)
    assert (layout.n_inputs, layout.n_outputs) == (16, 5)


def test_another_controller_is_refused_in_one_line(
    choosy: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.toml").write_text(
        f'[run]\nworld = "{TASK}"\nmethod = "{choosy}"\n[controller]\nname = "srn"\n'
    )
    words = "method 'random-search' only works with gru or ctrnn"
    with pytest.raises(UsageError) as caught:
        resolve(file=tmp_path / "own.toml")
    place = tmp_path / "own.toml"
    assert str(caught.value) == f"controller.name = 'srn' in {place}: {words}"
    with pytest.raises(UsageError, match=f"'srn' in overrides: {words}"):
        resolve(TASK, choosy, overrides={"controller.name": "srn"})
    command = ["run", TASK, "--method", choosy, "--set", "controller.name=srn"]
    with pytest.raises(SystemExit) as ended:
        main([*command, "--out", str(tmp_path / "run")])
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "run").exists()
    with pytest.raises(UsageError, match=words):
        plan_of(tmp_path, choosy).write_out()


def plan_of(folder: Path, method: str) -> Any:
    """Return a plan that has the method with a controller that it does not work with."""
    file = folder / "plan.toml"
    file.write_text(
        f'[campaign]\nname = "some"\nseeds = 1\n[factors]\nworld = ["{TASK}"]\n'
        f'method = ["{method}", "homcne"]\n"controller.name" = ["gru", "srn"]\n'
    )
    return read_plan(file)


def test_controllers_that_are_not_names_are_refused(mine: Path) -> None:
    mine.write_text(
        mine.read_text().replace('    name="random', '    controllers="gru",\n    name="random')
    )
    with pytest.raises(UsageError, match="its controllers 'gru' must be a tuple of names"):
        resolve(TASK, f"{mine}:{NAME}")


def test_an_unknown_controller_of_a_method_names_the_nearest(mine: Path) -> None:
    mine.write_text(
        mine.read_text().replace('    name="random', '    controllers=("gur",),\n    name="random')
    )
    with pytest.raises(UsageError, match="unknown controller 'gur'; did you mean 'gru'"):
        resolve(TASK, f"{mine}:{NAME}")
