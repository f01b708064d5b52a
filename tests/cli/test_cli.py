"""The command line: a whole session, every bad input in one line, and instant help."""

from __future__ import annotations

import json
import os
import re
import resource
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest

import conevo
from conevo.cli.main import VERBS
from conevo.runs.run import Run
from runs.tiny import TASK, command, content, evolve_tiny, spawn, wait_for


def tiny(*more: str, method: str = "cone") -> list[str]:
    """Return the words of a tiny run in the default place."""
    words = command(Path("unused"), method)
    at = words.index("--out")
    return [*words[:at], *words[at + 2 :], "--threads", "1", *more]


def test_a_session_from_run_to_the_commands_it_recommends(say, tmp_path: Path) -> None:
    said = say(*tiny())
    assert (said.code, said.err) == (0, "")
    assert "generation 1/5  value" in said.out
    assert "generation 5/5  value" in said.out
    assert "Testing phase, 3 fresh scenarios" in said.out
    assert "5 of 5 generations" in said.out
    recommended = re.findall(r"^  (conevo .*)$", said.out, flags=re.MULTILINE)
    assert [line.split()[1] for line in recommended] == [
        "show",
        "replay",
        "test",
        "resume",
        "run",
        "run",
    ]
    for line in recommended:
        again = say(*shlex.split(line)[1:])
        assert again.code == 0, again.err
    assert len(list((tmp_path / "runs").iterdir())) == 3
    listed = json.loads(say("list", "runs", "--json").out)
    assert [(row["method"], row["seed"]) for row in listed] == [
        ("cone", "1"), ("cone", "2"), ("mesp", "1"),
    ]  # fmt: skip
    assert {row["status"] for row in listed} == {"finished"}
    done = [f"{n} of {n} generations" for n in (10, 10, 5)]  # two of them were continued
    assert [row["generations"] for row in listed] == done


def test_the_other_method_is_run_with_the_same_run_and_world_settings(say) -> None:
    out = say(*tiny()).out
    line = next(line for line in out.splitlines() if "--method mesp" in line)
    say(*shlex.split(line)[1:])
    one, other = (run.config for run in (Run(row["run"]) for row in json.loads(
        say("list", "runs", "--json").out)))  # fmt: skip
    assert (one.run, one.world_params) == (other.run, other.world_params)


def test_json_is_one_object_per_generation_and_one_at_the_end(say) -> None:
    said = say(*tiny("--json"))
    lines = [json.loads(line) for line in said.out.splitlines()]
    assert [line["generation"] for line in lines[:-1]] == [0, 1, 2, 3, 4]
    run = Run(lines[-1]["run"])
    assert lines[:-1] == run.generations()
    assert lines[-1]["test"] == run.test_result
    assert lines[-1]["status"] == "finished"


def test_quiet_prints_the_directory_only(say) -> None:
    said = say(*tiny("--quiet"))
    assert said.err == ""
    assert Run(said.out.strip()).status == "finished"
    assert said.out.count("\n") == 1


def test_verbose_prints_every_generation(say) -> None:
    out = say(*tiny("--verbose")).out
    assert [f"generation {k}/5" in out for k in range(1, 7)] == [True] * 5 + [False]


def test_show_finds_a_run_by_the_beginning_of_its_name(say) -> None:
    name = Path(say(*tiny("--quiet")).out.strip()).name
    said = say("show", name[:20])
    assert said.code == 0
    assert f"runs/{name}: finished" in said.out
    assert "SST" in said.out
    everything = json.loads(say("show", name[:20], "--json").out)
    assert everything["config"]["run"]["world"] == "rover-v2/complex-1"
    assert len(everything["generations"]) == 5
    assert everything["changed_files"] == []
    say(*tiny("--quiet", "--seed", "2"))
    said = say("show", "rover")
    assert said.code == 2
    assert "is ambiguous; it matches" in said.err


def test_show_reports_a_changed_sealed_file(say, tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    (run.path / "champion.npz").write_bytes(b"")
    assert "modified since the run: champion.npz\n" in say("show", "run").out
    (run.path / "test.json").unlink()
    assert "; modified since the run: champion.npz; missing: test.json\n" in say("show", "run").out
    (run.path / "champion.npz").unlink()
    assert "; missing: champion.npz, test.json\n" in say("show", "run").out


@pytest.mark.parametrize("name", ["provenance.json", "generations.jsonl"])
@pytest.mark.parametrize("verb", ["show run", "resume run --generations 9"])
def test_a_run_that_lost_its_records_is_damaged(say, tmp_path: Path, verb: str, name: str) -> None:
    (evolve_tiny(tmp_path / "run").path / name).unlink()
    said = say(*verb.split())
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert "is damaged: it has lost its" in said.err


def test_test_prints_fresh_scenarios(say, tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    assert run.test_result is not None
    assert json.loads(say("test", "run", "--json").out) == run.test_result["champion"]
    said = say("test", "run", "--scenarios", "6", "--seed", "9")
    assert "Testing phase, 6 fresh scenarios" in said.out


def test_an_interrupted_run_is_shown_and_resumed(say, tmp_path: Path) -> None:
    path = tmp_path / "run"
    process = spawn(*command(path, "cone", run__generations=60), "--quiet")
    wait_for(lambda: path.exists() and (path / "generations.jsonl").read_bytes().count(b"\n") > 2)
    process.kill()
    process.wait()
    shown = say("show", "run")
    assert "run: interrupted" in shown.out
    assert "Continue it with: conevo resume run" in shown.out
    assert say("test", "run", "--scenarios", "2").code == 0
    assert say("resume", "run", "--quiet").code == 0
    assert content(path) == content(evolve_tiny(tmp_path / "whole", run__generations=60).path)


def test_an_interrupted_extension_shows_the_length_of_its_testing_phase(
    say, tmp_path: Path
) -> None:
    run = evolve_tiny(tmp_path / "run")
    assert "former length" not in say("show", "run").out
    run.resume(generations=60, time_limit=1e-6, threads=1)
    former = "Of the former length, 5 generations; the new one is tested when it is finished:\n"
    assert former + "Testing phase, 3 fresh" in say("show", "run").out
    run.resume(threads=1)
    shown = say("show", "run").out
    assert "Testing phase, 3 fresh" in shown
    assert "former length" not in shown


def test_lists(say) -> None:
    worlds = json.loads(say("list", "worlds", "--json").out)
    assert [row["world"] for row in worlds] == list(conevo.WORLDS)
    assert "complex-1..10" in worlds[0]["environments"]
    methods = json.loads(say("list", "methods", "--json").out)
    assert [row["method"] for row in methods] == list(conevo.METHODS)
    assert "HomCNE" in say("list", "methods").out
    assert "no runs in runs/" in say("list", "runs").out


BAD = [
    (["run"], "which world"),
    (["run", "rovr/complex-1"], "did you mean 'rover'"),
    (["run", "rover/complx-1"], "did you mean 'complex-1'"),
    (["run", "rover"], "rover/simple-1"),
    (["run", TASK, "--method", "coen"], "did you mean 'cone'"),
    (["run", TASK, "--preset", "smok"], "did you mean 'smoke'"),
    (["run", TASK, "--set", "generations"], "expected key=value"),
    (["run", TASK, "--set", "run.generatoins=3"], "did you mean 'run.generations'"),
    (["run", TASK, "--set", "world.iterations=many"], "world.iterations = 'many' on the command"),
    (["run", TASK, "--set", "world.low_range=9"], "less than or equal to 0.5"),
    (["run", TASK, "--seed", "-1"], "greater than or equal to 0"),
    (["run", TASK, "--seed", "x"], "'x' is not a valid integer"),
    (["run", TASK, "--threads", "0"], "0 is not in the range 1<=x<=4096"),
    (["run", TASK, "--budget-evaluations", "-5"], "run.budget_evaluations = -5"),
    (["run", TASK, "--preset", "smoke", "--budget-evaluations", "5"], "does not pay for one"),
    (["run", TASK, "--json", "--quiet"], "are mutually exclusive: give one of them"),
    (["run", TASK, "--sed", "1"], "--sed"),
    (["rum", TASK], "did you mean 'run'"),
    (["resume", "nothing"], "unknown run 'nothing'"),
    (["show", "."], "is not a run"),
    (["test"], "Missing argument"),
    (["list", "robots"], "'robots' is not one of"),
    (["list", "worlds", "here"], "takes no further argument, got 'here'"),
    (["list", "runs", "--method", "cone"], "'conevo list runs' takes no --method"),
    (["list", "presets", "--preset", "desk"], "takes no --preset"),
    (["list", "settings"], "For example: conevo list settings rover/complex-1"),
    (["list", "settings", "rover/complx-1"], "did you mean 'complex-1'"),
    (["list", "settings", TASK, "--method", "coen"], "did you mean 'cone'"),
    (["run", TASK, "--dry-run", "--preset", "smok"], "did you mean 'smoke'"),
    (["run", TASK, "--dry-run", "--budget-evaluations", "5"], "does not pay for one"),
    (["run", TASK, "--seed", "3", "--set", "run.seed=4"], "--seed and --set run.seed"),
    (["run", TASK, "--set", "run.world=rover/complex-2"], "WORLD/ENVIRONMENT and --set run.world"),
    (["run", TASK, "--dry-run", "--from", "nowhere"], "unknown run 'nowhere'"),
    (["run", TASK, "--seed", "3", "--set", "seed=3"], "--seed and --set seed"),
    (["run", TASK, "--preset", "smoke", "--set", "run.preset=desk"], "--preset and --set"),
    (["run", TASK, "--set", "generations=5", "--set", "run.generations=6"], "given as generations"),
    (["run", TASK, "--set", "run.epochs=5", "--set", "run.epochs=6"], "run.epochs is set twice"),
    (["run", "pursuit/team-3", "--prey", "random", "--set", "prey=random"], "--prey and --set"),
    (["list", "runs", "nowhere"], "nowhere is not a directory"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "words"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_bad_input_is_one_line_with_code_2_and_nothing_written(
    arguments: list[str], words: str, say, tmp_path: Path
) -> None:
    said = say(*arguments)
    assert said.code == 2
    assert said.out == ""
    assert said.err.startswith("conevo: error: ")
    assert said.err.count("\n") == 1
    assert words in said.err
    assert list(tmp_path.iterdir()) == []


def test_a_configuration_without_a_world_is_named(say, tmp_path: Path) -> None:
    (tmp_path / "empty.toml").write_text("")
    said = say("run", "--config", "empty.toml")
    assert (said.code, said.err.count("\n")) == (2, 1)
    assert "which world? empty.toml names none: give run.world there, or name one as" in said.err


def test_refusals_of_the_machine_are_one_line_with_code_3(say, tmp_path: Path) -> None:
    for arguments, words in (
        (tiny("--out", "/proc/run"), "cannot write /proc/run: "),
        (tiny("--config", "a" * 300), "cannot read aaa"),
    ):
        said = say(*arguments)
        assert said.code == 3
        assert said.err.startswith("conevo: error: ")
        assert said.err.count("\n") == 1
        assert words in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (tiny("--out", "file/run"), "file is a file, not a directory"),
        (tiny("--out", "file/run/x", "--dry-run"), "file is a file, not a directory"),
        (tiny("--seeds", "1", "--out", "file/x"), "file is a file, not a directory"),
        (tiny("--config", "none.toml"), "cannot read none.toml: No such file"),
        (tiny("--config", "file/x.toml"), "cannot read file/x.toml: Not a directory"),
        (["run", "pursuit/team-2", "--prey", "none.npz"], "cannot read none.npz: No such file"),
        (["run", "none.py:dark-1"], "cannot read the world file none.py: No such file"),
        (["check", "none.py"], "cannot read the world file none.py: No such file"),
        (["campaign", "start", "none.toml"], "cannot read none.toml: No such file"),
    ],
)
def test_a_missing_path_is_a_wrong_request(say, tmp_path, words, message) -> None:
    (tmp_path / "file").write_text("")
    said = say(*words)
    assert said.code == 2
    assert said.err.startswith("conevo: error: ")
    assert said.err.count("\n") == 1
    assert message in said.err
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_refusal_in_mid_run_leaves_a_run_to_resume(say, tmp_path: Path) -> None:
    """The kernel itself refuses: no file of this process may grow beyond 6000 bytes."""
    path, changes = tmp_path / "run", {"method__genotypes": 12}
    process = subprocess.Popen(
        [sys.executable, "-m", "conevo", *command(path, "cone", **changes), "--quiet"],
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000)),
    )
    _, err = process.communicate()
    assert process.returncode == 3, err
    assert re.search(rf"conevo: error: cannot write {path}/\S+: File too large; once fixed", err)
    assert f"conevo resume {path}\n" in err
    assert say("resume", "run", "--quiet").code == 0
    assert content(path) == content(evolve_tiny(tmp_path / "whole", **changes).path)


def test_existing_runs_are_refused_with_advice(say) -> None:
    say(*tiny("--quiet", "--out", "here"))
    said = say(*tiny("--out", "here"))
    assert said.code == 2
    assert "already holds a run, finished: see it with 'conevo show here'" in said.err
    said = say("resume", "here")
    assert said.code == 2
    assert "here is finished" in said.err


def test_help_lists_every_command(say) -> None:
    said = say("--help")
    assert said.code == 0
    for verb, summary in VERBS.items():
        assert re.search(rf"  {verb} +{re.escape(summary)}", said.out)
        assert say(verb, "--help").code == 0
    assert say("--version").out == f"conevo {conevo.__version__}\n"


@pytest.mark.timing
@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"]])
def test_help_is_instant(arguments: list[str]) -> None:
    times = []
    for _ in range(5):
        started = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "conevo", *arguments],
            check=True,
            capture_output=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        )
        times.append(time.perf_counter() - started)
    assert min(times) < 0.3


def test_importing_conevo_and_its_commands_loads_nothing_heavy() -> None:
    code = (
        "import sys, conevo, conevo.cli.main, conevo.cli.run, conevo.cli.show; "
        "heavy = {'numpy', 'warp', 'scipy', 'pydantic', 'rich', 'matplotlib'}; "
        "print(sorted(heavy & set(sys.modules)))"
    )
    found = subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    assert found.stdout.strip() == "[]"


def test_public_names_are_few_and_exist() -> None:
    assert len(conevo.__all__) <= 20
    for name in conevo.__all__:
        assert getattr(conevo, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'evolv'"):
        _ = conevo.evolv  # type: ignore[attr-defined]


def test_a_run_starts_with_the_results_of_another_one(say) -> None:
    assert say(*tiny("--out", "first", "--quiet")).code == 0
    same = ("--config", "first/config.toml", "--threads", "1", "--quiet")
    for option, words in (
        ("--from", "Started from the populations of first, generation 5"),
        ("--from-champion", "Bred from the champion of first, generation"),
    ):
        said = say("run", "rover/complex-2", *same, option, "first", "--out", option[2:])
        assert (said.code, said.err) == (0, "")
        assert words in say("show", option[2:]).out
    both = say("run", "rover/complex-2", *same, "--from", "first", "--from-champion", "first")
    assert (both.code, "mutually exclusive: give one of them" in both.err) == (2, True)
    noisy = ("run", "rover/complex-2", *same, "--set", "method.start_noise=.02", "--out", "noisy")
    for more in ((), ("--from", "first"), ("--dry-run",), ("--shape",), ("--shape", "--dry-run")):
        said = say(*noisy, *more)
        assert (said.code, said.err.count("\n")) == (2, 1)
        assert "method.start_noise = 0.02 does nothing here" in said.err
        assert not Path("noisy").exists()
    assert say(*noisy, "--from-champion", "first").code == 0
    smaller = say("run", "rover/complex-2", *same, "--from", "first", "--set", "genotypes=6")
    assert (smaller.code, "4 genotypes per slot became 6" in smaller.err) == (2, True)
    say(*tiny("--out", "part", "--time-limit", "0.001s", "--quiet"))
    part = say("run", "rover/complex-2", *same, "--from", "part")
    assert part.code == 2
    assert "part is not finished" in part.err
    assert "finish it with 'conevo resume part'" in part.err


def test_a_champion_is_tested_under_changed_conditions(say) -> None:
    assert say(*tiny("--out", "first", "--quiet")).code == 0
    words = ("test", "first", "--on", "complex-2", "--set", "world.iterations=20", "--robots", "2")
    said = say(*words)
    assert (said.code, said.err) == (0, "")
    assert "changed conditions: rover-v2/complex-2, 2 robots, world.iterations=20" in said.out
    assert re.search(r"^change ", said.out, flags=re.MULTILINE)
    assert set(json.loads(say(*words, "--json").out)) == {"own", "changed", "conditions", "change"}
    assert say("test", "first", "--set", "run.seed=3").code == 2
