"""Staged runs on the command line: made, shown, listed, tested and continued like other runs."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest

import conevo
from conevo.runs.shaping import Shaping, start_shaping
from conevo.worlds.pursuit import prey_sets
from runs.tiny import TINY, evolve_tiny, spawn, wait_for

PURSUIT = {key: value for key, value in TINY.items() if key != "world.n_robots"}


def sets(settings: dict[str, Any]) -> list[str]:
    words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    return ["--preset", "smoke", *words]


def shape(*more: str, task: str = "rover/complex-3", **changes: Any) -> list[str]:
    settings = TINY | {key.replace("__", "."): value for key, value in changes.items()}
    return ["run", task, "--shape", *sets(settings), *more]


def test_a_shaping_from_run_to_the_commands_it_recommends(say, tmp_path: Path) -> None:
    said = say(*shape("--threads", "1"))
    assert (said.code, said.err) == (0, "")
    for stage in (1, 2, 3):
        assert f"stage {stage} of 3: rover-v2/complex-{stage}, CONE, preset smoke" in said.out
    assert said.out.count("generation 5/5  value") == 3
    recommended = re.findall(r"^  (conevo .*)$", said.out, flags=re.MULTILINE)
    assert [line.split()[1] for line in recommended] == ["show", "replay", "test", "test"]
    for line in recommended:
        again = say(*shlex.split(line)[1:])
        assert again.code == 0, again.err
    (path,) = (tmp_path / "runs").iterdir()
    assert path.name.startswith("rover-v2-complex-1-to-complex-3-cone-smoke-s1-")
    (row,) = json.loads(say("list", "runs", "--json").out)
    assert row == {
        "run": f"runs/{path.name}", "world": "rover-v2/complex-1 to complex-3", "method": "cone",
        "preset": "smoke", "seed": "1", "generations": "15 of 15 generations", "status": "finished",
    }  # fmt: skip
    stages = json.loads(say("list", "runs", f"runs/{path.name}", "--json").out)
    assert [row["world"] for row in stages] == [f"rover-v2/complex-{k}" for k in (1, 2, 3)]


def test_show_prints_the_stages_with_the_results_of_their_champions(say, tmp_path: Path) -> None:
    say(*shape("--out", "here", "--quiet"))
    shown = say("show", "here").out
    assert "rover-v2/complex-1 to complex-3, CONE, preset smoke, seed 1" in shown
    assert "here: finished" in shown
    rows = [line.split() for line in shown.splitlines() if re.match(r" +\d  rover", line)]
    for row, run in zip(rows, Shaping("here").stages, strict=True):
        assert run.test_result is not None
        assert run.champion is not None
        area = run.test_result["champion"]["performance"]["area"]
        done = ["5", "of", "5", "generations"]
        assert row[1:7] == [run.config.task, "finished", *done]
        assert row[8] == str(run.champion.generation)
        assert row[-3:] == [f"{area['mean']:.4g}", "+-", f"{area['sd']:.4g}"]
    table = shown[shown.index("number  stage  task") :].splitlines()
    seen = [line.split()[:4] for line in table[1:]]
    assert seen == [
        [str(5 * k + g), str(k + 1), f"rover-v2/complex-{k + 1}", str(g)]
        for k in range(3)
        for g in (0, 1, 3, 4)
    ]
    few = say("show", "here", "--rows", "2").out
    assert few[few.index("number  stage  task") :].count("\n") == 1 + 2 * 3
    everything = json.loads(say("show", "here", "--json").out)
    assert everything["generations"] == Shaping("here").generations()
    assert everything["changed_files"] == []
    assert everything["tasks"] == [f"rover-v2/complex-{k}" for k in (1, 2, 3)]
    assert [len(stage["generations"]) for stage in everything["stages"]] == [5, 5, 5]
    file = tmp_path / "here" / "stage-1" / "test.json"
    file.write_text(file.read_text() + "\n")
    assert "modified since the run: stage-1/test.json" in say("show", "here").out
    assert "SST" in say("show", "here/stage-2").out


def test_test_takes_the_team_of_the_last_stage(say) -> None:
    say(*shape("--out", "here", "--quiet"))
    last = Shaping("here").stages[-1]
    assert last.test_result is not None
    assert json.loads(say("test", "here", "--json").out) == last.test_result["champion"]


def test_test_takes_that_team_to_the_environment_of_every_stage(say) -> None:
    say(*shape("--out", "here", "--quiet"))
    tested = json.loads(say("test", "here", "--stages", "--json").out)
    assert [one["task"] for one in tested] == Shaping("here").tasks
    said = say("test", "here", "--stages", "--scenarios", "2")
    assert "The fittest team of stage 3" in said.out
    assert "2 fresh scenarios of each stage" in said.out
    rows = [line.split() for line in said.out.splitlines() if re.match(r" +\d  rover", line)]
    assert [row[:2] for row in rows] == [[str(k), f"rover-v2/complex-{k}"] for k in (1, 2, 3)]
    said = say("test", "here/stage-1", "--stages")
    assert (said.code, said.err) == (
        2, "conevo: error: here/stage-1 is a run; only a shaping has stages\n",
    )  # fmt: skip


def test_json_names_the_stage_of_every_generation(say) -> None:
    lines = [json.loads(line) for line in say(*shape("--json")).out.splitlines()]
    assert lines[-1]["status"] == "finished"
    shaping = Shaping(lines[-1]["shaping"])
    assert lines[:-1] == shaping.generations()
    assert [stage["test"] for stage in lines[-1]["stages"]] == [
        run.test_result for run in shaping.stages
    ]
    assert lines[-1]["product"] is None


def test_json_of_a_resumed_shaping_continues_its_numbers(say, tmp_path: Path) -> None:
    def stop(run: conevo.Run, record: dict[str, Any]) -> None:
        if (run.path.name, record["generation"]) == ("stage-2", 1):
            raise KeyboardInterrupt

    tasks = ["rover/complex-1", "rover/complex-2"]
    begun = start_shaping(tasks, preset="smoke", out=tmp_path / "here", overrides=TINY, threads=1)
    with pytest.raises(KeyboardInterrupt):
        begun.resume(threads=1, watch=stop)
    lines = [json.loads(line) for line in say("resume", "here", "--json").out.splitlines()]
    assert [line["number"] for line in lines[:-1]] == [7, 8, 9]
    assert lines[:-1] == begun.generations()[7:]


def test_quiet_prints_the_directory_only(say) -> None:
    said = say(*shape("--quiet"))
    assert Shaping(said.out.strip()).status == "finished"
    assert (said.err, said.out.count("\n")) == ("", 1)


def test_an_interrupted_shaping_is_shown_tested_and_resumed(say, tmp_path: Path) -> None:
    path = tmp_path / "here"
    process = spawn(*shape("--out", str(path), "--quiet", run__generations=60))
    log = path / "stage-2" / "generations.jsonl"
    wait_for(lambda: log.exists() and log.read_bytes().count(b"\n") > 2)
    process.kill()
    process.wait()
    shown = say("show", "here")
    assert "here: interrupted" in shown.out
    assert "2 of 3 stages begun" in shown.out
    assert "Continue it with: conevo resume here" in shown.out
    (row,) = json.loads(say("list", "runs", ".", "--json").out)
    assert row["status"] == "interrupted"
    assert row["generations"].endswith(" of 180 generations")
    assert say("test", "here", "--scenarios", "2").code == 0
    said = say("resume", "here")
    assert said.code == 0, said.err
    assert "stage 1 of 3" not in said.out
    assert "stage 2 of 3" in said.out
    again = say("resume", "here")
    assert (again.code, again.err) == (
        2, "conevo: error: here is finished; see it with 'conevo show here'\n",
    )  # fmt: skip


def test_a_shaping_that_has_not_started_is_shown_and_has_no_team(say, tmp_path: Path) -> None:
    start_shaping(["rover/complex-1", "rover/complex-2"], preset="smoke", out=tmp_path / "here")
    assert "0 of 2 stages begun" in say("show", "here").out
    said = say("test", "here")
    line = "conevo: error: here has no finished generation yet, so there is no team\n"
    assert (said.code, said.err) == (2, line)


def test_shape_prey_leaves_prey_for_the_pursuit_world(say) -> None:
    said = say("shape-prey", *sets(PURSUIT), "--out", "prey", "--threads", "1")
    assert (said.code, said.err) == (0, "")
    assert "stage 6 of 6: prey-v2/shaping-6" in said.out
    use = "conevo run pursuit/team-3 --prey prey/prey.npz"
    assert f"  {use}\n" in said.out
    about = prey_sets.load("prey/prey.npz").about
    assert about["command"] == shlex.join(
        ["conevo", "shape-prey", *sets(PURSUIT), "--out", "prey", "--threads", "1"]
    )
    said = say(*shlex.split(use)[1:], *sets(PURSUIT), "--out", "hunt", "--quiet")
    assert said.code == 0, said.err
    params = conevo.Run("hunt").config.world_params
    assert params.prey_digest == prey_sets.load("prey/prey.npz").digest
    listed = json.loads(say("list", "runs", ".", "--json").out)
    assert [row["world"] for row in listed] == [
        "pursuit-v2/team-3",
        "prey-v2/shaping-1 to shaping-6",
    ]


def test_a_prey_file_is_identified_by_its_content(say, tmp_path: Path) -> None:
    say("shape-prey", *sets(PURSUIT), "--out", "prey", "--quiet")
    (tmp_path / "copy.npz").write_bytes((tmp_path / "prey" / "prey.npz").read_bytes())
    ids = set()
    for name, file in (("one", "prey/prey.npz"), ("two", "copy.npz"), ("three", "shaped")):
        words = ["--prey", file, *sets(PURSUIT), "--out", name, "--quiet"]
        assert say("run", "pursuit/team-2", *words).code == 0
        ids.add(conevo.Run(name).config.run_id)
    assert len(ids) == 2


def test_prey_by_name_is_short_for_a_setting(say) -> None:
    say("run", "pursuit/team-2", "--prey", "random", *sets(PURSUIT), "--out", "one", "--quiet")
    say(
        "run", "pursuit/team-2", "--set", "world.prey=random", *sets(PURSUIT), "--out", "two",
        "--quiet",
    )  # fmt: skip
    one, two = (conevo.Run(name).config for name in ("one", "two"))
    assert one.world_params.prey == "random"
    assert one.run_id == two.run_id


BAD = [
    (["run", "rover/complex-1", "--shape"], "no environment comes before rover-v2/complex-1"),
    (["run", "--shape"], "which world"),
    (["run", "rover/complex-2", "--shape", "--set", "run.epochs=0"], "run.epochs = 0 on the comm"),
    (["run", "rover/complex-2", "--shape", "--budget-evaluations", "5"], "does not pay for one"),
    (["run", "rover/complex-2", "--prey", "random"], "rover-v2 has no prey to choose"),
    (["run", "prey/shaping-2", "--prey", "random"], "prey-v2 has no prey to choose"),
    (["run", "pursuit/team-2", "--prey", "randon"], "did you mean 'random'"),
    (["run", "pursuit/team-2", "--prey", "none.npz"], "cannot read none.npz: No such file"),
    (["shape-prey", "pursuit/team-2"], "unexpected extra argument"),
    (["shape-prey", "--method", "coen"], "did you mean 'cone'"),
    (["shape-prey", "--set", "run.generatoins=3"], "did you mean 'run.generations'"),
    (["shape-prey", "--json", "--quiet"], "are mutually exclusive"),
    (["shape-pray"], "did you mean 'shape-prey'"),
]


@pytest.mark.parametrize(("arguments", "words"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_bad_input_is_one_line_with_code_2_and_nothing_written(
    arguments: list[str], words: str, say, tmp_path: Path
) -> None:
    said = say(*arguments)
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith("conevo: error: ")
    assert said.err.count("\n") == 1
    assert words in said.err
    assert list(tmp_path.iterdir()) == []


def test_existing_places_are_refused_with_advice(say, tmp_path: Path) -> None:
    evolve_tiny(tmp_path / "run")
    said = say(*shape("--out", "run"))
    assert said.code == 2
    assert "run already holds a run, finished: see it with 'conevo show run'" in said.err
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("precious")
    assert "other already exists and is not a run" in say(*shape("--out", "other")).err
    (tmp_path / "file").write_text("")
    said = say(*shape("--out", "file/here"))
    assert said.code == 2
    assert "file is a file, not a directory" in said.err


def first(*more: str) -> list[str]:
    settings = {key: value for key, value in TINY.items() if key != "method.genotypes"}
    return ["run", "rover/complex-1", "--method", "ccga", *sets(settings), *more]


def test_clones_first_is_one_command(say, tmp_path: Path) -> None:
    said = say(*first("--first", "homcne", "--dry-run"))
    assert (said.code, list(tmp_path.iterdir())) == (0, [])
    assert "complex-1-homcne-to-ccga-smoke-s1-" in said.out
    assert "HomCNE, preset smoke, seed 1: 61 team evaluations in the first generation" in said.out
    said = say(*first("--first", "homcne", "--set", "first_share=0.4", "--threads", "1"))
    assert (said.code, said.err) == (0, "")
    assert "stage 1 of 2: rover-v2/complex-1, HomCNE, preset smoke" in said.out
    assert "rover-v2/complex-1, CCGA, preset smoke, seed 1, begun by HomCNE" in said.out
    (path,) = (tmp_path / "runs").iterdir()
    rows = [line.split() for line in said.out.splitlines() if re.match(r" +\d  rover", line)]
    assert [row[:7] for row in rows] == [
        ["1", "rover-v2/complex-1", "HomCNE", "finished", "2", "of", "2"],
        ["2", "rover-v2/complex-1", "CCGA", "finished", "3", "of", "3"],
    ]
    (row,) = json.loads(say("list", "runs", "--json").out)
    assert (row["world"], row["method"]) == ("rover-v2/complex-1", "ccga")
    assert say("test", str(path), "--stages", "--scenarios", "1").code == 0
    for line in re.findall(r"^  (conevo .*)$", said.out, flags=re.MULTILINE):
        again = say(*shlex.split(line)[1:])
        assert again.code == 0, again.err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--first", "homcnee"], "first on the command line: unknown method 'homcnee'; did you"),
        (["--first", "ccga"], "first = 'ccga' on the command line: ccga evolves the second"),
        (["--first", "homcne", "--shape"], "--first starts one run of two stages: leave out"),
        (["--first", "homcne", "--seeds", "2"], "--first starts one run of two stages: leave out"),
        (["--first", "homcne", "--from", "x"], "--first starts one run of two stages: leave out"),
        (["--first", "homcne", "--config", "x"], "--first and --config are mutually exclusive"),
        (["--first", "homcne", "--set", "first_share=2"], "first_share = 2 on the command line"),
        (["--first", "homcne", "--budget-evaluations", "60"],
         "stage 1 (homcne): run.budget_evaluations = 30 does not pay for one generation"),
    ],
)  # fmt: skip
def test_a_wrong_first_stage_is_one_line(say, words: list[str], message: str) -> None:
    said = say(*first(*words))
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith(f"conevo: error: {message}")
    assert said.err.count("\n") == 1
    assert not Path("runs").exists()
