"""The regime map: cells, castes and predictions by hand, and its tables of a campaign."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from conevo.campaigns.campaign import create
from conevo.campaigns.executors.local import Serial
from conevo.campaigns.plan_file import read_plan
from conevo.runs.run import Run

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "experiments"))  # scripts import what they share

import pages  # noqa: E402
import regime_map  # noqa: E402
from regime_cells import apart, cells_of, judge, threshold, trends_of  # noqa: E402
from regime_tables import PAGE_PARTS, detection_iterations, judged  # noqa: E402

PAGE = ROOT / "docs" / "results" / "regimes.md"
REGIME = {
    "ranges": "medium", "accuracies": "low", "starts": "by_robot", "iterations": 1250,
    "low_range": 0.1, "med_range": 0.08, "hi_range": 0.06,
    "low_accuracy": 0.1, "med_accuracy": 0.2, "hi_accuracy": 0.3,
}  # fmt: skip


def runs(segregation, clones, individual):
    """Return rows of runs of both methods in one regime, with these values."""
    regime = REGIME | {"segregation": segregation}
    return [
        regime | {"method": method, "seed": k + 1, "value": value}
        for method, values in (("hom-es", clones), ("cone-es", individual))
        for k, value in enumerate(values)
    ]


def used(*regions):
    """Return how often the robots of regions A to D used low, med and hi."""
    return {
        f"{region} {setting}": n
        for region, counts in zip("ABCD", regions, strict=True)
        for setting, n in zip(("low", "med", "hi"), counts, strict=True)
    }


def test_a_cell_by_hand():
    """Means 101 and 151, both deviations 1.41: Welch has 2 degrees of freedom, t is 4.303."""
    (cell,) = cells_of(runs(1.0, [100, 102], [150, 152]))
    reach = 4.30265 * math.sqrt(2)
    assert cell.value.difference == 50
    assert (cell.value.low, cell.value.high) == pytest.approx((50 - reach, 50 + reach), abs=1e-3)
    assert cell.is_clear
    assert cell.verdict == "individual"
    (line,) = [one for one in PAGE_PARTS["values"]([cell]).splitlines() if "medium" in one]
    assert line.split(" | ")[2:] == [
        "1", "2, 2", "101 (1)", "151 (1)", "**+50**", "+44 to +56", "+49.5 %",
        "+43.5 % to +55.5 %", "0.001", "individual |",
    ]  # fmt: skip


def test_the_verdict_of_two_percent():
    def verdict(clones, individual):
        return cells_of(runs(0, clones, individual))[0].verdict

    assert verdict([1000, 1001], [1001, 1002]) == "alike"
    assert verdict([1000, 1001], [900, 901]) == "clones"
    assert verdict([1000, 1001], [1019, 1020]) == "open"  # from 13.4 to 24.6 of 1,000
    assert verdict([1000, 1001], [1200]) == "open"


def test_means_over_cells_by_hand():
    """Every mean has the variance 1, so that of the mean is 1, of the slope 4; t of 4 is 2.776."""
    cells = cells_of(runs(0, [100, 102], [150, 152]) + runs(1, [200, 202], [290, 292]))
    alone = runs(0.5, [100, 102], [90])  # has no interval, so it does not count
    (trend,) = trends_of([*cells, *cells_of(alone)])
    assert (trend.mean.value, trend.slope.value) == pytest.approx((70, 40))
    assert (trend.mean.low, trend.mean.high) == pytest.approx((70 - 2.7764, 70 + 2.7764), abs=1e-3)
    assert trend.slope.high - 40 == 40 - trend.slope.low == pytest.approx(2 * 2.7764, abs=1e-3)
    (line,) = PAGE_PARTS["trends"](cells).splitlines()[2:]
    assert line == "| medium | low | 2 | **+70** | +67 to +73 | **+40** | +34 to +46 |"
    assert trends_of(cells[:1])[0].slope is None


def test_differences_between_robots_of_different_regions():
    assert apart(used((9, 9, 9), (1, 1, 1), (2, 2, 2), (5, 5, 5))) == 0
    # The mean of the four is a half low: half of the shares of A, B differ, three quarters of C, D.
    assert apart(used((3, 0, 0), (8, 0, 0), (0, 1, 0), (0, 0, 5))) == pytest.approx(0.625)
    assert apart(used((3, 0, 0), (0, 0, 0), (0, 2, 0), (0, 0, 0))) == pytest.approx(0.5)
    assert math.isnan(apart(used(*[(0, 0, 0)] * 4)))


def test_a_threshold_by_hand():
    assert threshold([(0.4, -1), (0.8, -2), (1.0, 3)]) == pytest.approx(0.9)
    assert threshold([(0.4, -1), (0.8, 2), (1.0, -3), (1.4, 4)]) == pytest.approx(1.2)  # or 0.6
    assert threshold([(0.4, 1), (0.8, 2)]) == -math.inf
    assert threshold([(0.4, -1), (0.8, -2)]) == math.inf
    assert math.isnan(threshold([]))


def test_a_threshold_is_found_without_the_cells_for_testing():
    """The rule rises with segregation: 0.51, 0.77, 1.03, 1.29, 1.55."""
    rows = runs(0.0, [100, 102], [50, 52]) + runs(0.5, [100, 102], [90, 92])
    rows += runs(1.0, [100, 102], [150, 152])
    test = runs(0.25, [100, 102], [150, 152]) + runs(0.75, [100, 102], [101, 99])
    cells = cells_of(rows + test)
    rule, at_one, segregation, slow, same = judged(cells)
    assert rule.threshold == pytest.approx((cells[2].incentive + cells[4].incentive) / 2)
    assert judged(cells_of(rows))[0].threshold == rule.threshold
    assert (rule.found, rule.tested) == ((3, 3), (1, 2))  # 0.75 is below 0, as predicted
    assert [cell.regime.segregation for cell in rule.wrong] == [0.25]
    assert rule.right == ()  # the interval of 0.75 contains 0
    assert (at_one.threshold, at_one.found, at_one.tested) == (1.0, (2, 3), (0, 2))
    assert (segregation.threshold, segregation.tested) == (0.75, (1, 2))
    assert detection_iterations(cells[0]) == pytest.approx(25)  # med: .2, both rovers
    assert (slow.threshold, slow.found) == (math.inf, (2, 3))  # alike in all cells
    assert (same.threshold, same.found, same.tested) == (math.inf, (2, 3), (1, 2))


def test_a_cell_without_runs_of_one_method_predicts_nothing():
    cells = cells_of(runs(0.25, [100, 102], []) + runs(1.0, [100], [120]))
    found = judge(cells, "the rule", lambda cell: cell.incentive)
    assert (found.found, found.tested) == ((1, 1), (0, 0))
    text = "".join(make(cells) for make in PAGE_PARTS.values())
    assert "2, 0" in text
    assert "nan" not in text
    (line,) = PAGE_PARTS["predicted"](cells_of(runs(1.0, [100], []))).splitlines()[2:]
    assert line.endswith("| finding | 1.55 | – | – | – |")


PLAN = """
[campaign]
title = "A part of the plan regimes"
seeds = 2
preset = "smoke"
studies = ["teams"]

[factors]
world = ["rover/complex-5"]
method = ["hom-es", "cone-es"]
segregation = ["0.5"]
accuracies = ["low"]
ranges = ["medium"]

[settings]
"world.starts" = "by_robot"
"world.iterations" = 60
"run.budget_evaluations" = 0
"run.generations" = 2
"run.n_tests" = 2
"method.pairs" = 5

[levels]
segregation."0.5" = { "world.segregation" = 0.5 }
ranges.medium = { "world.low_range" = 0.1, "world.med_range" = 0.08, "world.hi_range" = 0.06 }

[levels.accuracies]
low = { "world.low_accuracy" = 0.1, "world.med_accuracy" = 0.2, "world.hi_accuracy" = 0.3 }
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """A finished campaign of one cell, two tiny runs of each method."""
    folder = tmp_path_factory.mktemp("regimes")
    (folder / "regimes.toml").write_text(PLAN)
    made = create(read_plan(folder / "regimes.toml"), folder / "regimes")
    made.carry_on(Serial(1))
    return made


def test_the_page_of_a_campaign(campaign, tmp_path, capsys):
    page = tmp_path / "regimes.md"
    page.write_text("".join(f"<!-- {name} -->\n<!-- end -->\n" for name in ("cost", *PAGE_PARTS)))
    regime_map.main([str(campaign.path), "--write", str(page)])
    rows = pages.read(page.with_suffix(".csv"))
    assert [(row["method"], row["seed"]) for row in rows] == [
        ("cone-es", 1), ("cone-es", 2), ("hom-es", 1), ("hom-es", 2),
    ]  # fmt: skip
    for row in rows:
        (label,) = (
            label for label in campaign.planned if f"-{row['method']}-" in label
            and label.endswith(f"-s{row['seed']:g}")
        )  # fmt: skip
        tested = Run(campaign.paths.run(label)).test_result["champion"]["performance"]["value"]
        assert row["value"] == pytest.approx(np.mean(tested["values"]), rel=1e-5)
        (*_, last) = Run(campaign.paths.run(label)).generations()
        assert row.get("individual_share") == last.get("individual_share")
        study = json.loads(campaign.paths.study(label).read_text())
        of_c = [one["count"] for one in study["actions"]
                if one["robot"] in (2, 6, 10, 14, 18) and one["action"] == "med"]  # fmt: skip
        assert row["C med"] == sum(of_c)
        shares = [one["setting_share"] for one in study["robots"]]
        known = [one for one in shares if one is not None]
        assert row["favourite share"] == pytest.approx(np.mean(known), rel=1e-5)
        assert {name: row[name] for name in (*REGIME, "segregation")} == REGIME | {
            "segregation": 0.5,
            "iterations": 60,
        }
    means = [np.mean([row["value"] for row in rows if row["method"] == m])
             for m in ("hom-es", "cone-es")]  # fmt: skip
    text = page.read_text()
    assert {row["method"] for row in rows if "individual_share" in row} == {"cone-es"}
    assert "| runs finished, of those planned | 4 of 4 |" in text
    assert f"| medium | low | 0.5 | 2, 2 | {means[0]:.0f} (" in text
    assert f"| {means[1]:.0f} (" in text
    assert page.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    regime_map.main(["--again", "--write", str(page)])
    assert page.read_text() == text
    assert text.split("<!-- values -->\n")[1].split("<!-- end -->")[0] in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ([], "name a CAMPAIGN, or --again"),
        (["nowhere"], "nowhere"),
        (["nowhere", "--write", "no.md"], "no.md: there is no such page"),
        (["--again"], "--again with --write PAGE"),
    ],
)
def test_bad_arguments_are_one_line(arguments, line, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as ended:
        regime_map.main(arguments)
    assert ended.value.code == 2
    message = capsys.readouterr().err
    assert line in message.splitlines()[-1]
    assert "Traceback" not in message


@pytest.mark.skipif(
    not PAGE.with_suffix(".csv").is_file(), reason="the source package has no results"
)
def test_the_page_s_tables_are_those_of_its_numbers():
    text = PAGE.read_text()
    cells = cells_of(pages.read(PAGE.with_suffix(".csv")))
    for name, make in PAGE_PARTS.items():
        assert f"<!-- {name} -->\n{make(cells)}<!-- end -->" in text, name
