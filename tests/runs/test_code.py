"""The code of a run: one digest of all code that affects results, and no silent change of it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.runs.code import DECIDING, changes_text, code_digest, sessions_of
from conevo.runs.config import resolve
from conevo.runs.start import start
from runs.tiny import TASK, evolve_tiny, tiny_settings

# Loaded by modules that affect results, but without effect themselves: a run's config.toml has all
# settings in full, and files store data unchanged.
NOT_DECIDING = {
    "conevo",
    "conevo.errors",
    "conevo.parameters",
    "conevo.reading",
    "conevo.runs",
    "conevo.runs.config",
    "conevo.runs.layers",
    "conevo.runs.outline",
    "conevo.runs.settings",
    "conevo.terms",
    "conevo.typing",
}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the package's source, whose digest is computed."""
    copy = tmp_path / "conevo"
    shutil.copytree(Path(conevo.__file__).parent, copy, ignore=shutil.ignore_patterns("*.npz"))
    monkeypatch.setattr(conevo, "__file__", str(copy / "__init__.py"))
    monkeypatch.setattr("conevo.runs.code.code_digest", code_digest.__wrapped__)
    return copy


def test_the_digest_covers_exactly_the_code_that_affects_results(package: Path) -> None:
    digest = code_digest.__wrapped__
    assert digest() == code_digest()  # wherever it is installed
    for name in ("evolution/variation.py", "controllers/srn.py", "runs/loop.py", "rng.py"):
        before, text = digest(), (package / name).read_text()
        (package / name).write_text(text + "\n")
        assert digest() != before, name
        (package / name).write_bytes(text.replace("\n", "\r\n").encode())
        assert digest() == before, name  # checked out with other line endings
    (package / "cli" / "show.py").write_text("")
    assert digest() == before


def test_all_modules_that_affect_results_count() -> None:
    parts = "conevo.runs.lab, conevo.runs.testing, conevo.worlds.rollout"
    find = f"import sys, {parts}; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", find], text=True, capture_output=True, check=True
    ).stdout.split()
    deciding = tuple(f"conevo.{name.removesuffix('.py').replace('/', '.')}" for name in DECIDING)
    others = {
        name
        for name in loaded
        if name.split(".")[0] == "conevo"
        and not any(name == one or name.startswith(f"{one}.") for one in deciding)
    }
    assert others <= NOT_DECIDING
    assert "conevo.worlds.rollout" in loaded


def interrupted(path: Path) -> conevo.Run:
    """Make a run of five generations that was stopped in the third."""

    def stop(run: conevo.Run, record: dict[str, Any]) -> None:
        if record["generation"] == 2:
            raise KeyboardInterrupt

    run = start(resolve(TASK, "cone", "smoke", overrides=tiny_settings("cone")), path, threads=1)
    with pytest.raises(KeyboardInterrupt):
        run.resume(threads=1, watch=stop)
    return conevo.Run(path)


def change(path: Path, edit: Callable[[dict[str, Any]], None]) -> None:
    """Edit a run's provenance."""
    file = path / "provenance.json"
    about = json.loads(file.read_text())
    edit(about)
    file.write_text(json.dumps(about))


def of_another(about: dict[str, Any]) -> None:
    """Make a provenance that of a run by another version."""
    for one in (about, *about["sessions"]):
        one |= {"conevo": "0.9.0", "code": "abc123abc123", "numpy": "2.9.9"}


def of_first_release(about: dict[str, Any]) -> None:
    """Make a provenance one as conevo 0.1.0 wrote it."""
    about["conevo"] = "0.1.0"
    for name in ("code", "world"):
        del about[name]
    about["sessions"] = [
        {key: one[key] for key in ("started", "from_generation", "threads")}
        for one in about["sessions"]
    ]


def test_sessions_record_their_versions(tmp_path: Path) -> None:
    run = interrupted(tmp_path / "run")
    run.resume(threads=1)
    first, second = run.provenance["sessions"]
    assert (first["from_generation"], second["from_generation"]) == (0, 3)
    for session in (first, second):
        assert session["code"] == code_digest()
        same = ("conevo", "code", "python", "numpy", "warp", "platform", "cpu", "device")
        assert {key: session[key] for key in same} == {key: run.provenance[key] for key in same}
    assert changes_text(sessions_of(run.provenance)) == []


@pytest.mark.parametrize(
    ("edit", "name"),
    [
        (of_another, r"0\.9\.0 \(abc123abc123\)"),
        (of_first_release, r"0\.1\.0 \(code not recorded\)"),
    ],
)
def test_other_code_is_refused_or_recorded(
    tmp_path: Path,
    edit: Callable[[dict[str, Any]], None],
    name: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run = interrupted(tmp_path / "run")
    change(run.path, edit)
    if edit is of_first_release:
        (run.path / "finalists.npz").unlink()
    before = run.provenance
    asks = f"made by conevo {name}, and this is .*{code_digest()}.*--accept-other-code'"
    with pytest.raises(UsageError, match=asks):
        conevo.Run(run.path).resume(threads=1)
    with pytest.raises(SystemExit, match="2"):
        main(["resume", str(run.path)])
    out, error = capsys.readouterr()
    assert out == ""
    assert error.count("\n") == 1
    assert run.provenance == before
    with pytest.raises(SystemExit, match="0"):
        main(["resume", str(run.path), "--accept-other-code", "--quiet"])
    assert [one.get("code") for one in run.provenance["sessions"]][1:] == [code_digest()]
    capsys.readouterr()
    with pytest.raises(SystemExit, match="0"):
        main(["show", str(run.path)])
    shown = capsys.readouterr().out
    now = f"{conevo.__version__} ({code_digest()})"
    made = f"made by 2 versions: {name} generations 0-2, ".replace("\\", "")
    assert f"{made}{now} from 3\n" in shown
    assert ("made with more than one numpy: 2.9.9 generations 0-2, " in shown) == (
        edit is of_another
    )


def test_repeated_generations_count_for_the_later_code() -> None:
    def session(start: int, code: str) -> dict[str, Any]:
        of = {"conevo": code[0], "code": code, "numpy": "2", "warp": "1", "device": "cpu"}
        return of | {"from_generation": start}

    made = [session(0, "a"), session(4, "a"), session(4, "b"), session(4, "c"), session(9, "a")]
    assert changes_text(made) == [
        "made by 2 versions: a (a) generations 0-3, c (c) generations 4-8, a (a) from 9"
    ]


def test_a_finished_run_by_other_code_is_shown_and_tested(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    change(run.path, of_another)
    assert conevo.Run(run.path).test(threads=1) == run.test_result["champion"]


def test_the_code_of_an_origin_is_shown_if_it_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def shown(*command: str) -> tuple[str, str]:
        with pytest.raises(SystemExit, match="0"):
            main(command)
        out, error = capsys.readouterr()
        return out, error

    with monkeypatch.context() as other:
        for module in ("provenance", "code"):
            other.setattr(f"conevo.runs.{module}.code_digest", lambda: "abc123abc123")
        origin = evolve_tiny(tmp_path / "origin")
    now, then = (f"{conevo.__version__} ({code})" for code in (code_digest(), "abc123abc123"))
    assert shown("test", str(origin.path)) == (
        shown("test", str(origin.path), "--threads", "1")[0],
        f"conevo: note: {origin.path} was made by conevo {then}, and this is {now}, "
        f"which may give other results\n",
    )
    sets = [
        word for key, value in tiny_settings("cone").items() for word in ("--set", f"{key}={value}")
    ]
    for name, options in (("run", ["--from"]), ("bred", ["--from-champion"])):
        run = str(tmp_path / name)
        shown("run", TASK, "--preset", "smoke", *sets, *options, str(origin.path), "--out", run)
        generation = conevo.Run(run).provenance["origin"]["generation"]
        line = f" of {origin.path}, generation {generation} (made by {then}, this run by {now})\n"
        assert line in shown("show", run)[0] + "\n"
        assert shown("test", run)[1] == ""
    shown("run", TASK, "--preset", "smoke", *sets, "--from", run, "--out", f"{run}-again")
    assert "made by" not in shown("show", f"{run}-again")[0]


def test_the_world_is_described_without_loading_it(tmp_path: Path) -> None:
    header = evolve_tiny(tmp_path / "run").provenance["world"]
    assert (header["name"], header["environment"], header["n_robots"]) == (
        "rover-v2",
        "complex-1",
        3,
    )
    assert [one["name"] for one in header["measures"]] == ["value", "area"]
    assert {one["larger_is_better"] for one in header["measures"]} == {True}
    assert header["optimum"] > 0
    assert {"low", "med", "hi"} <= set(header["castes"])
    assert header["iterations"] == 12
