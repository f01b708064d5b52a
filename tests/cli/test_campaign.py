"""The commands for campaigns, as a user types them, and wrong ones, which write nothing."""

import json
import re
from pathlib import Path

import pytest
import tomli_w

from campaigns.plans import tiny_campaign, write_plan
from conevo.campaigns import worker
from conevo.cli.main import main
from watch.followed import record, tables
from worlds.test_outside import written

pytest_plugins = ["report.quick_figures"]


@pytest.fixture
def conevo(tmp_path, monkeypatch, capsys):
    """Run a command line in an empty folder; returns exit code, output and errors."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        said = capsys.readouterr()
        return ended.value.code, said.out, said.err

    return run


def test_a_campaign_from_start_to_answers(without_ink, conevo, tmp_path):
    write_plan(tmp_path, 'studies = ["teams"]')
    code, out, _ = conevo("campaign", "start", "tiny.toml", "--executor", "serial", "--seeds", "1")
    assert code == 0
    assert out.splitlines()[0].endswith(" (preset smoke)")
    assert "campaigns/tiny" in out
    assert "2 runs, 2 pending" in out
    assert "(2 of 2 finished" in out
    code, out, _ = conevo("campaign", "status", "tiny", "--json")
    status = json.loads(out)
    assert (code, status["running"]) == (0, False)
    assert [run["state"] for run in status["runs"]] == ["finished"] * 2
    code, out, _ = conevo("campaign", "status", "tiny", "--runs")
    assert "rover-v2-complex-1-cone-s1" in out
    code, out, _ = conevo("query", "SELECT method, seed FROM runs ORDER BY method", "--json")
    assert [json.loads(line) for line in out.splitlines()] == [
        {"method": "cone", "seed": 1},
        {"method": "homcne", "seed": 1},
    ]
    code, out, _ = conevo("query", "tiny", "SELECT method AS m FROM runs ORDER BY m", "--csv")
    assert out == "m\ncone\nhomcne\n"
    code, out, _ = conevo(
        "query", "tiny", "SELECT 'nan'::DOUBLE AS a, 'inf'::DOUBLE AS b", "--json"
    )
    assert json.loads(out) == {"a": None, "b": None}
    for nothing in ("", ";", "/* only a comment */"):
        code, out, err = conevo("query", "tiny", nothing)
        assert (code, out) == (2, "")
        assert "no SQL statement" in err
    code, out, _ = conevo("campaign", "list", "--json")
    assert json.loads(out)["campaigns"] == [
        {"campaign": "campaigns/tiny", "preset": "smoke", "runs": "2 finished"}
    ]
    code, out, _ = conevo("report", "tiny")
    assert code == 0
    assert Path(out.split(": ")[1].strip()).is_file()


def test_a_started_campaign_needs_no_plan_and_more_seeds_extend_it(conevo, tmp_path):
    tiny_campaign(tmp_path / "campaigns")
    code, out, _ = conevo("campaign", "start", "tiny", "--executor", "serial", "--json")
    lines = [json.loads(line) for line in out.splitlines()]
    assert (code, lines[-1]["finished"], lines[-1]["of"]) == (0, 4, 4)
    code, out, _ = conevo(
        "campaign", "start", "tiny", "--executor", "serial", "--json", "--seeds", "3"
    )
    lines = [json.loads(line) for line in out.splitlines()]
    assert [line["run"][-2:] for line in lines] == ["s3", "s3"]
    code, out, _ = conevo("campaign", "start", "tiny", "--executor", "serial", "--quiet")
    assert (code, out) == (0, "campaigns/tiny\n")


PLAN = """
[campaign]
seeds = 1
preset = "smoke"
studies = []
[factors]
world = ["{world}"]
method = ["{method}"]
[settings]
"run.generations" = 2
"run.n_tests" = 1
"run.n_validations" = 1
"world.iterations" = 20
"""


@pytest.mark.parametrize("command", [("start", "--dry-run"), ("start",), ("slurm",)])
def test_a_named_plan_is_never_ignored(conevo, tmp_path, command):
    """Whatever campaign is in the directory, and even if the plan does not exist."""
    (tmp_path / "a.toml").write_text(PLAN.format(world="rover/complex-1", method="homcne"))
    (tmp_path / "b.toml").write_text(PLAN.format(world="gacc/complex-1", method="mesp"))
    assert conevo("campaign", "slurm", "a.toml", "--out", "c")[0] == 0
    before = {p: p.read_bytes() for p in Path("c").rglob("*") if p.is_file()}
    verb, *more = command
    code, _, err = conevo("campaign", verb, "b.toml", "--out", "c", *more)
    assert code == 2
    assert "c holds another campaign: its run rover-v2-complex-1-homcne-s1 is one that this" in err
    code, _, err = conevo("campaign", verb, "absent.toml", "--out", "c", *more)
    assert code in (2, 3)
    assert "absent.toml" in err
    code, _, err = conevo("campaign", verb, "a.toml", "--out", "c", "--set", "run.epochs=2", *more)
    assert (code, "has other settings in this plan" in err) == (2, True)
    assert {p: p.read_bytes() for p in Path("c").rglob("*") if p.is_file()} == before
    assert conevo("campaign", verb, "a.toml", "--out", "c", *more)[0] == 0


def test_a_larger_plan_extends_and_a_smaller_one_is_refused(conevo, tmp_path):
    file = tmp_path / "a.toml"
    file.write_text(PLAN.format(world="rover/complex-1", method="homcne"))
    serial = ("--executor", "serial", "--json")
    assert conevo("campaign", "start", "a.toml", "--out", "c", *serial)[0] == 0
    code, out, _ = conevo("campaign", "start", "c", "--set", "run.generations=3", *serial)
    assert (code, json.loads(out)["state"]) == (0, "finished")
    file.write_text(file.read_text().replace('generations" = 2', 'generations" = 4'))
    code, out, _ = conevo("campaign", "start", "a.toml", "--out", "c", *serial)
    assert (code, json.loads(out)["state"]) == (0, "finished")
    (run,) = Path("c/runs").iterdir()
    assert len((run / "generations.jsonl").read_text().splitlines()) == 4
    code, _, err = conevo("campaign", "start", "c", "--set", "run.generations=3", *serial)
    assert code == 2
    assert "would be shorter in this plan (run.generations = 3, planned: 4)" in err
    code, _, err = conevo("resume", str(run), "--generations", "9")
    assert code == 2
    assert "conevo campaign start" in err
    assert "--set run.generations=9" in err


def test_a_time_limit_ends_with_0_and_shows_how_to_continue(conevo, tmp_path):
    (tmp_path / "a.toml").write_text(PLAN.format(world="rover/complex-1", method="homcne"))
    code, _, err = conevo(
        "campaign", "start", "a.toml", "--executor", "serial", "--time-limit", "0.001s"
    )
    assert code == 0
    assert "time limit reached with 1 pending; continue with: conevo campaign start camp" in err
    for wrong in ("soon", "0", "-1m", "5w"):
        code, _, err = conevo("campaign", "start", "a", "--time-limit", wrong)
        assert (code, "expected a time above 0" in err) == (2, True)


def test_failures_are_printed_with_their_reason_and_can_be_tried_again(conevo, tmp_path):
    path = write_plan(tmp_path, "studies = []")
    with path.open("a") as file:
        file.write('[[where]]\nmethod = "cone"\nsettings = { "run.budget_evaluations" = 1 }\n')
    code, out, _ = conevo("campaign", "start", "tiny.toml", "--executor", "serial")
    assert code == 1
    assert "2 finished, 2 failed" in out
    assert "does not pay for one generation" in out
    code, out, _ = conevo("campaign", "status", "tiny")
    assert code == 1
    assert "failed rover-v2-complex-1-cone-s1: run.budget_evaluations = 1" in out
    assert "its copy of" not in out  # it has no copy of a world of the package
    code, out, _ = conevo("campaign", "retry", "tiny", "--executor", "serial", "--json")
    assert code == 1
    assert [json.loads(line)["state"] for line in out.splitlines()] == ["failed"] * 2


def test_a_campaign_shows_where_a_world_fails_and_that_it_keeps_its_copy(conevo, tmp_path):
    fails = "        if int(keys[0]) % 7 == 3:\n            raise ValueError('boom')\n"
    shape = "        shape = (self"
    file = written(tmp_path / "mine.py", (shape, fails + shape))
    line = 1 + file.read_text().splitlines().index("            raise ValueError('boom')")
    plan = PLAN.format(world="mine.py:dark-1", method="homcne").replace("= 2", "= 20")
    (tmp_path / "a.toml").write_text(plan)
    start = ("campaign", "start", "a.toml", "--executor", "serial")
    copies = (
        "the campaign keeps its copy of mine.py: once yours is corrected, start another campaign "
        "with --out DIR"
    )
    for words in (start, ("campaign", "status", "a"), ("campaign", "retry", "a")):
        code, out, _ = conevo(*words)
        assert code == 1
        reason = rf"failed .*-s1: \S+/mine.py:{line}: in scenarios: ValueError: boom\n"
        assert re.search(reason, out)
        assert copies in out.splitlines()
    written(file)
    code, _, err = conevo(*start)
    assert code == 2
    assert "was planned with another mine.py, of which it keeps a copy in inputs/; continue" in err
    code, out, _ = conevo(*start, "--out", "other", "--quiet")
    assert (code, out) == (0, "other\n")


def test_the_programs_own_failure_is_recorded_with_its_place(tmp_path, monkeypatch):
    def fail(*_, **more):
        raise ValueError("boom")

    campaign = tiny_campaign(tmp_path)
    label = next(iter(campaign.planned))
    monkeypatch.setattr(worker, "start", fail)
    assert not worker.carry_out(campaign.path, label, 1)
    ended = json.loads(campaign.paths.ended(label).read_text())
    line = fail.__code__.co_firstlineno + 1
    assert ended["message"] == f"ValueError('boom') in fail ({__file__}:{line})"


def test_a_dry_run_prints_every_run_and_writes_nothing(conevo, tmp_path):
    code, out, _ = conevo("campaign", "start", "rover-complex", "--seeds", "2", "--dry-run")
    assert code == 0
    assert len(out.splitlines()) == 1 + 2 * 50
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("campaign start rover-complx", "did you mean 'rover-complex'"),
        ("campaign start none.toml", "cannot read none.toml"),
        ("campaign start rover-complex --preset smok", "did you mean 'smoke'"),
        ("campaign start rover-complex --seeds 0", "--seeds 0"),
        ("campaign start rover-complex --set epochs=x", "run.epochs"),
        ("campaign start rover-complex --executor proceses", "did you mean 'processes'"),
        ("campaign start rover-complex --address auto", "only the executor ray"),
        ("campaign start rover-complex --store s3://x", "only the executor ray"),
        ("campaign start rover-complex --cores 1 --threads 2", "--threads 2"),
        ("campaign start rover-complex --json --quiet", "are mutually exclusive: give one of them"),
        ("campaign status tin", "unknown campaign 'tin' in campaigns/; did you mean 'tiny'"),
        ("campaign slurm rover-complex --hours 0.01", "--hours 0.01: must be from 0.1"),
        ("campaign slurm rover-complex --mem 8'G", "is not an option for sbatch"),
        ("campaign slurm rover-complex --sbatch --time=9", "use conevo's --hours"),
        ("campaign stop tiny", "is not running"),
        ("campaign stpo tiny", "stpo"),
        ("report tin", "did you mean 'tiny'"),
        ("report tiny", "no finished run yet"),
        ("query tin SELECT", "did you mean 'tiny'"),
        ("query tiny SELECT", "no finished run yet"),
        ("query a b c", "a campaign and one SQL text"),
        ("query tiny SELECT --csv --json", "are mutually exclusive: give one of them"),
        ("show campaigns/tiny", "is a campaign"),
        ("run rover/complex-1 --out campaigns/tiny", "already holds a campaign"),
    ],
)
def test_a_wrong_word_is_one_clear_line_and_nothing_is_written(conevo, tmp_path, words, message):
    tiny_campaign(tmp_path / "campaigns")
    before = sorted(tmp_path.rglob("*"))
    code, out, err = conevo(*words.split())
    assert code == 2
    assert out == ""
    assert message in err
    assert len(err.splitlines()) == 1
    locks = {"lock", "ledger.sqlite"}  # created when looking, and left there
    assert [path for path in sorted(tmp_path.rglob("*")) if path.name not in locks] == before


def test_an_interrupted_campaign_shows_how_to_continue(conevo, tmp_path, monkeypatch):
    from conevo.campaigns.executors.local import Serial

    tiny_campaign(tmp_path / "campaigns")

    def interrupt(self, job):
        raise KeyboardInterrupt

    monkeypatch.setattr(Serial, "submit", interrupt)
    code, _, err = conevo("campaign", "start", "tiny", "--executor", "serial")
    assert code == 130
    assert "interrupted with 4 pending; continue with: conevo campaign start campaigns/tiny" in err


def test_a_job_array_has_the_runs_that_are_not_finished(conevo, tmp_path):
    tiny_campaign(tmp_path / "campaigns")
    code, out, _ = conevo("campaign", "slurm", "tiny", "--threads", "3", "--at-once", "2")
    assert code == 0
    assert "4 runs; submit with: sbatch " in out
    script = (tmp_path / "campaigns" / "tiny" / "slurm.sh").read_text()
    assert "--cpus-per-task=3" in script
    assert "--array=0-3%2" in script
    conevo("campaign", "start", "tiny", "--executor", "serial", "--quiet")
    code, _, err = conevo("campaign", "slurm", "tiny")
    assert (code, "no unfinished run" in err) == (2, True)


def test_status_shows_runs_that_slurm_tasks_or_a_resume_carry_out(conevo, tmp_path):
    from conevo.runs.directory import Directory

    campaign = tiny_campaign(tmp_path / "campaigns")
    first, second, *_ = campaign.planned
    for label, n in ((first, 1), (second, 0)):
        path = campaign.paths.run(label)
        path.mkdir(parents=True)
        (path / "config.toml").write_text(tomli_w.dumps(tables(generations=2)))
        lines = [f"{json.dumps(record(k, team_evaluations=9))}\n" for k in range(n)]
        (path / "generations.jsonl").write_text("".join(lines))
    with Directory(campaign.paths.run(first), "run").locked():
        code, out, _ = conevo("campaign", "status", "tiny", "--runs")
        found = json.loads(conevo("campaign", "status", "tiny", "--json")[1])
    assert code == 0
    assert "campaigns/tiny: running without a coordinator, 1 running, 3 pending\n" in out
    assert re.search(r"^last generation written \d+ s ago$", out, re.M)
    assert re.search(rf"^{first} +running +1 of 2 generations +\d+ s ago +0", out, re.M)
    assert re.search(rf"^{second} +pending +0", out, re.M)
    assert (found["running"], found["runs"][0]["state"]) == (False, "running")
    assert (found["runs"][0]["generations"], found["runs"][0]["generations_planned"]) == (1, 2)
    assert found["runs"][1]["written"] is None
    assert "not running, 3 pending, 1 interrupted\n" in conevo("campaign", "status", "tiny")[1]
