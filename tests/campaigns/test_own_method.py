"""A method in a file: in campaigns, tables, reports and on the live page next to the others."""

from __future__ import annotations

import shutil
from pathlib import Path

import duckdb
import pytest

from campaigns.plans import write_plan
from conevo.campaigns.campaign import Campaign, create
from conevo.campaigns.executors.registry import make_executor
from conevo.campaigns.plan_file import read_plan
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.evolution.methods import registry
from conevo.runs.run import Run
from conevo.watch.state import Watched

pytest_plugins = ["report.quick_figures"]

EXAMPLE = Path(__file__).parents[2] / "examples" / "random_search.py"
WHERE = """
[[where]]
method = ["mine.py:random-search"]
settings = { "method.genotypes" = 7 }
"""


def own_plan(folder: Path) -> Path:
    """Write the plan of a campaign of CONE and of a method in a file, next to it."""
    path = write_plan(folder, "studies = []", more=WHERE)
    (folder / "mine.py").write_text(EXAMPLE.read_text())
    path.write_text(path.read_text().replace('"homcne"', '"mine.py:random-search"'))
    return path


@pytest.fixture
def made(tmp_path: Path) -> Campaign:
    """A finished campaign without the files of its plan, moved."""
    campaign = create(read_plan(own_plan(tmp_path / "plans")).at(seeds=1), tmp_path / "made")
    states = [one.state for one in campaign.carry_on(make_executor("serial", 1)).values()]
    assert states == ["finished", "finished"]
    shutil.rmtree(tmp_path / "plans")
    return Campaign(shutil.move(campaign.path, tmp_path / "moved"))


def say(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Run a command that must succeed and return its output."""
    with pytest.raises(SystemExit, match="0"):
        main(arguments)
    return capsys.readouterr().out


def test_it_is_listed_with_the_others_and_its_file_is_not_run_to_show_it(
    without_ink: None,
    made: Campaign,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = made.paths.plan.read_text() + made.paths.runs.read_text()
    assert "inputs/mine.py:random-search" in text
    assert str(made.path.parent) not in text
    for file in (made.path / "inputs" / "mine.py", *made.path.glob("runs/*/inputs/mine.py")):
        file.write_text("raise SystemExit")
    monkeypatch.setattr(registry, "_TITLES", {})  # as in a process that has loaded no such file
    assert "random-search" in say(capsys, "campaign", "status", str(made.path))
    say(capsys, "report", str(made.path))
    page = (made.path / "report" / "index.html").read_text()
    assert "random search" in page
    rows = duckdb.sql(f"SELECT method, title FROM '{made.paths.tables}/runs.parquet'").fetchall()
    assert sorted(rows) == [("cone", "CONE"), ("random-search", "random search")]
    monkeypatch.setattr(registry, "_TITLES", {})
    seen = Watched([made.path]).snapshot()
    assert {run["method"] for run in seen["runs"]} == {"cone", "random-search"}
    assert seen["methods"]["random-search"]["title"] == "random search"


def test_it_continues_from_the_campaigns_own_copy(made: Campaign) -> None:
    longer = create(made.plan.at(seeds=2), made.path)
    states = [one.state for one in longer.carry_on(make_executor("serial", 1)).values()]
    assert states == ["finished"] * 4
    runs = [Run(longer.paths.run(label)) for label in longer.planned]
    own = [run for run in runs if run.outline.method == "random-search"]
    assert [run.config.method_config.genotypes for run in own] == [7, 7]
    assert all((run.path / "inputs" / "mine.py").is_file() for run in own)


def test_two_methods_of_one_name_and_other_mistakes_are_one_line(tmp_path: Path) -> None:
    path = own_plan(tmp_path)
    (tmp_path / "other.py").write_text(EXAMPLE.read_text() + "\n")
    plan = path.read_text()
    for old, new, words in (
        ('"cone"]', '"other.py:random-search"]', "is the name of two methods, .*mine.py and "),
        ('"mine.py:random-search", ', '"mine.py:random", ', "in this file is .*mine.py:random-s"),
        ('"mine.py:random-search", ', '"none.py:random-search", ', "cannot read the method file"),
        ('"method.genotypes" = 7', '"method.genotype" = 7', "did you mean 'method.genotypes'"),
        ('method = ["mine.py:random-search"]', 'method = ["mesq"]', "did you mean 'mesp'"),
    ):
        assert old in plan
        path.write_text(plan.replace(old, new, 1))
        with pytest.raises(UsageError, match=words) as caught:
            read_plan(path).write_out()
        assert "\n" not in str(caught.value)
