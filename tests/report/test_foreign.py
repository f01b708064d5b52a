"""Results of other tools in a report: shown and marked, and in no test."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from conevo.campaigns.campaign import Campaign
from conevo.campaigns.tables import Tables
from conevo.errors import UsageError
from conevo.report.exhibits import Section
from conevo.report.files import write_report
from conevo.report.foreign import Foreign, read_foreign
from conevo.report.sections.foreign import foreign
from conevo.report.sections.scope import scopes
from report.benchmarl import FRAMES, describe, write
from report.finished_runs import cells, write_campaign

pytest_plugins = ["report.quick_figures"]
pytestmark = pytest.mark.filterwarnings("error")
MEANS = {1: [100.0, 500.0, 300.0], 2: [80.0, 200.0, 400.0]}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One task, two methods, three seeds."""
    of = cells(["pursuit/team-4"], ["homcne", "cone"])
    return write_campaign(tmp_path_factory.mktemp("c") / "camp", of, 3, 4)


@pytest.fixture(scope="module")
def own(module_without_ink: None, campaign: Path) -> Path:
    """The report without results of others."""
    return write_report(Campaign(campaign), campaign.parent / "own").parent


@pytest.fixture(scope="module")
def with_mappo(module_without_ink: None, campaign: Path) -> Path:
    """The report with described results of MAPPO in the same task."""
    paths = write(campaign.parent / "theirs", MEANS)
    describe(paths)
    others = read_foreign(paths, "team")
    return write_report(Campaign(campaign), campaign.parent / "with", others=others).parent


def section(campaign: Path, others: Sequence[Foreign]) -> Section:
    """Return the section about foreign results alone."""
    with Tables(campaign / "tables") as tables:
        found = foreign(scopes(tables), Campaign(campaign), others)
    assert found is not None
    return found


def rows_in(found: Section) -> list[dict[str, str]]:
    return list(csv.DictReader(found.exhibits[0].to_csv().splitlines()))


def numbers(report: Path, name: str) -> list[dict[str, str]]:
    with (report / "numbers" / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


def test_foreign_results_are_next_to_the_own_ones_of_their_task(with_mappo: Path) -> None:
    report = with_mappo
    rows = numbers(report, "foreign-results")
    assert [(row["method"], row["team"]) for row in rows] == [
        ("HomCNE", "champion"),
        ("HomCNE", "last"),
        ("CONE", "champion"),
        ("CONE", "last"),
        ("mappo (foreign)", "last"),
        ("mappo (foreign)", "best"),
    ]
    assert {row["task"] for row in rows[:4]} == {"pursuit-v2/team-4"}
    last, best = rows[4:]
    assert (float(last["mean"]), float(best["mean"])) == (350, 450)
    assert last["measure"] == "capture_time (there return)"
    assert (last["n"], float(last["team_steps"])) == ("2", 3 * FRAMES)
    assert float(last["robot_steps"]) == 20 * 3 * FRAMES
    stated = ("seconds", "machine", "parameters", "shared", "memory", "actions", "policy")
    assert [last[name] for name in stated] == [
        "541", "one core", "5573", "yes", "none", "5 discrete", "stochastic",
    ]  # fmt: skip
    assert rows[0]["policy"] == "deterministic"
    curves = numbers(report, "pursuit-team-foreign")
    assert {row["environment"] for row in curves} == {"team-4"}
    theirs = [row for row in curves if row["method"] == "mappo (foreign)"]
    assert float(theirs[-1]["team_steps"]) == 3 * FRAMES
    assert float(theirs[-1]["mean"]) == 350
    page = (report / "index.html").read_text()
    assert "mappo (foreign)" in page
    assert "in no test and in no verdict on a claim" in page


def test_a_foreign_result_changes_no_other_exhibit_and_no_export(
    own: Path, with_mappo: Path
) -> None:
    def files(report: Path) -> dict[str, bytes]:
        found = [*report.glob("numbers/*"), *report.glob("tables/*"), report / "marl-eval.json"]
        return {one.name: one.read_bytes() for one in found}

    before, after = files(own), files(with_mappo)
    added = {"foreign-results.csv", "foreign-results.tex", "pursuit-team-foreign.csv"}
    assert after.keys() - before.keys() == added
    assert {name: after[name] for name in before} == before
    assert not any(b"mappo" in content for content in before.values())


def test_a_task_that_is_not_in_the_campaign_is_listed_alone(campaign: Path, tmp_path: Path) -> None:
    others = read_foreign(write(tmp_path / "theirs", MEANS, "vmas_balance"), "team")
    found = section(campaign, others)
    rows = rows_in(found)
    assert {row["task"] for row in rows} == {"conevo/vmas_balance"}
    assert {row["measure"] for row in rows} == {"return", "predators_return"}
    assert {row["machine"] for row in rows} == {"not stated"}
    assert {row["robot_steps"] for row in rows} == {""}
    assert len(found.exhibits) == 1
    assert any("No task is one of this campaign's" in text for text in found.text)


def test_a_measure_that_is_not_the_worlds_has_no_curve(campaign: Path, tmp_path: Path) -> None:
    found = section(campaign, read_foreign(write(tmp_path / "theirs", MEANS), "team"))
    assert any(row["method"] == "CONE" for row in rows_in(found))
    assert len(found.exhibits) == 1


def test_frames_of_robots_are_divided_by_the_size_of_the_team(tmp_path: Path) -> None:
    paths = write(tmp_path, {1: [1.0, 2.0]})
    (unknown,) = [one for one in read_foreign(paths, "robot") if one.measure == "return"]
    assert unknown.team_steps() is None
    assert unknown.team_steps(10) == [[FRAMES / 10, FRAMES / 5]]
    describe(paths)
    (known,) = read_foreign(paths, "robot")
    assert known.team_steps(10) == [[FRAMES / 20, FRAMES / 10]]
    (of_team,) = read_foreign(paths, "team")
    assert of_team.team_steps() == [[FRAMES, 2 * FRAMES]]


def test_a_task_may_be_named_in_the_description(campaign: Path, tmp_path: Path) -> None:
    paths = write(tmp_path / "theirs", MEANS, "chase")
    describe(paths, '[tasks]\nchase = "pursuit/team-4"\n')
    assert len(rows_in(section(campaign, read_foreign(paths, "team")))) == 4 + 2 * 2


def test_the_export_of_another_campaign_is_foreign_too(campaign: Path, own: Path) -> None:
    others = read_foreign([own / "marl-eval.json"], "team")
    assert {one.title for one in others} == {"homcne (foreign)", "cone (foreign)"}
    _, curves = section(campaign, others).exhibits
    assert {row["method"] for row in csv.DictReader(curves.to_csv().splitlines())} == {
        "HomCNE", "CONE", "homcne (foreign)", "cone (foreign)",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ({}, "it has no run"),
        ({"e": {"t": {"a": 3}}}, r"e\.t\.a = 3"),
        ({"e": {"t": {"a": {"s": {"step_1": {"return": [1.0]}}}}}}, "step_count = None"),
        ({"e": {"t": {"a": {"s": {"step_1": {"step_count": 1, "return": 2.0}}}}}}, "return = 2.0"),
        ({"e": {"t": {"a": {"s": {"absolute_metrics": [1]}}}}}, "absolute_metrics"),
        ({"e": {"t": {"a": {"s": {"step_1": 7}}}}}, "step_1 = 7"),
    ],
)
def test_a_file_of_another_form_is_refused_in_one_line(
    tmp_path: Path, content: object, why: str
) -> None:
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(content))
    with pytest.raises(UsageError, match=why) as caught:
        read_foreign([path], "team")
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("parameter = 3\n", "unknown key 'parameter' in .*did you mean 'parameters'"),
        ("[algorithms.mappo]\nmemry = 'none'\n", "unknown key 'memry' .*did you mean 'memory'"),
        ("robots = 0\n", "robots = 0"),
        ("policy = 'lucky'\n", "policy = 'lucky'"),
    ],
)
def test_a_wrong_description_is_refused(tmp_path: Path, text: str, why: str) -> None:
    paths = write(tmp_path, MEANS)
    describe(paths, text)
    with pytest.raises(UsageError, match=why):
        read_foreign(paths, "team")


def test_a_run_counts_once(tmp_path: Path) -> None:
    (path,) = write(tmp_path, {1: [1.0]})
    with pytest.raises(UsageError, match=r"conevo\.pursuit_team_4\.mappo has seed_1 twice"):
        read_foreign([path, path], "team")
