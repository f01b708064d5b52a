"""The verbs for campaigns, as a user types them; also what is refused, with nothing written."""

import json
import re
from pathlib import Path

import pytest

from campaigns.plans import tiny_campaign, write_plan
from conevo.cli.main import main


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


def test_a_campaign_from_start_to_answers(conevo, tmp_path):
    write_plan(tmp_path, 'studies = ["teams"]')
    code, out, _ = conevo("campaign", "start", "tiny.toml", "--executor", "serial", "--seeds", "1")
    assert code == 0
    assert "campaigns/tiny" in out
    assert "2 runs, 2 pending" in out
    assert "(2 of 2 finished" in out
    code, out, _ = conevo("campaign", "status", "tiny", "--json")
    status = json.loads(out)
    assert (code, status["running"]) == (0, False)
    assert [run["state"] for run in status["runs"]] == ["finished"] * 2
    code, out, _ = conevo("campaign", "status", "tiny", "--runs")
    assert "rover-v1-complex-1-cone-s1" in out
    code, out, _ = conevo("query", "SELECT method, seed FROM runs ORDER BY method", "--json")
    assert [json.loads(line) for line in out.splitlines()] == [
        {"method": "cone", "seed": 1},
        {"method": "homcne", "seed": 1},
    ]
    code, out, _ = conevo("query", "tiny", "SELECT method AS m FROM runs ORDER BY m", "--csv")
    assert out == "m\ncone\nhomcne\n"
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


def test_failures_are_said_with_their_reason_and_can_be_tried_again(conevo, tmp_path):
    path = write_plan(tmp_path, "studies = []")
    with path.open("a") as file:
        file.write('[[where]]\nmethod = "cone"\nsettings = { "run.budget_evaluations" = 1 }\n')
    code, out, _ = conevo("campaign", "start", "tiny.toml", "--executor", "serial")
    assert code == 1
    assert "2 finished, 2 failed" in out
    assert "does not pay for one generation" in out
    code, out, _ = conevo("campaign", "status", "tiny")
    assert code == 1
    assert "failed rover-v1-complex-1-cone-s1: run.budget_evaluations = 1" in out
    code, out, _ = conevo("campaign", "retry", "tiny", "--executor", "serial", "--json")
    assert code == 1
    assert [json.loads(line)["state"] for line in out.splitlines()] == ["failed"] * 2


def test_a_dry_run_prints_every_run_and_writes_nothing(conevo, tmp_path):
    code, out, _ = conevo("campaign", "start", "rover-complex", "--seeds", "2", "--dry-run")
    assert code == 0
    assert len(out.splitlines()) == 1 + 2 * 50
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "says"),
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
        ("campaign start rover-complex --json --quiet", "are mutually exclusive"),
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
        ("query tiny SELECT --csv --json", "are mutually exclusive"),
        ("show campaigns/tiny", "is a campaign"),
        ("run rover/complex-1 --out campaigns/tiny", "already holds a campaign"),
    ],
)
def test_a_wrong_word_is_one_clear_line_and_nothing_is_written(conevo, tmp_path, words, says):
    tiny_campaign(tmp_path / "campaigns")
    before = sorted(tmp_path.rglob("*"))
    code, out, err = conevo(*words.split())
    assert code == (3 if "cannot read" in says else 2)
    assert out == ""
    assert says in err
    assert len(err.splitlines()) == 1
    locks = {"lock", "ledger.sqlite"}  # taken to look, and left
    assert [path for path in sorted(tmp_path.rglob("*")) if path.name not in locks] == before


def test_an_interrupted_campaign_says_how_to_go_on(conevo, tmp_path, monkeypatch):
    from conevo.campaigns.executors import Serial

    tiny_campaign(tmp_path / "campaigns")

    def interrupt(self, job):
        raise KeyboardInterrupt

    monkeypatch.setattr(Serial, "submit", interrupt)
    code, _, err = conevo("campaign", "start", "tiny", "--executor", "serial")
    assert code == 130
    assert "interrupted with 4 pending; go on with: conevo campaign start campaigns/tiny" in err


def test_a_job_array_has_the_runs_that_are_not_finished(conevo, tmp_path):
    tiny_campaign(tmp_path / "campaigns")
    code, out, _ = conevo("campaign", "slurm", "tiny", "--threads", "3", "--at-once", "2")
    assert code == 0
    assert "4 runs; submit them with: sbatch " in out
    script = (tmp_path / "campaigns" / "tiny" / "slurm.sh").read_text()
    assert "--cpus-per-task=3" in script
    assert "--array=0-3%2" in script
    conevo("campaign", "start", "tiny", "--executor", "serial", "--quiet")
    code, _, err = conevo("campaign", "slurm", "tiny")
    assert (code, "no run left" in err) == (2, True)


def test_status_shows_runs_that_slurm_tasks_or_a_resume_carry_out(conevo, tmp_path):
    from conevo.runs.directory import Directory

    campaign = tiny_campaign(tmp_path / "campaigns")
    first, second, *_ = campaign.planned
    for label, n in ((first, 1), (second, 0)):
        path = campaign.places.run(label)
        path.mkdir(parents=True)
        (path / "config.toml").write_text("[run]\ngenerations = 2\nbudget_evaluations = 0\n")
        lines = [f'{{"generation": {k}, "team_evaluations": 9}}\n' for k in range(n)]
        (path / "generations.jsonl").write_text("".join(lines))
    with Directory(campaign.places.run(first), "run").locked():
        code, out, _ = conevo("campaign", "status", "tiny", "--runs")
        found = json.loads(conevo("campaign", "status", "tiny", "--json")[1])
    assert code == 0
    assert "campaigns/tiny: running without a coordinator, 3 pending, 1 running\n" in out
    assert re.search(r"^last generation written \d+ s ago$", out, re.M)
    assert re.search(rf"^{first} +running +1 of 2 generations +\d+ s ago +0", out, re.M)
    assert re.search(rf"^{second} +pending +0", out, re.M)
    assert (found["running"], found["runs"][0]["state"]) == (False, "running")
    assert (found["runs"][0]["generations"], found["runs"][0]["generations_planned"]) == (1, 2)
    assert found["runs"][1]["written"] is None
    assert "not running, 4 pending" in conevo("campaign", "status", "tiny")[1]
