"""The export against the format that marl-eval documents, and the runs that it leaves out."""

from __future__ import annotations

import json
import math
from pathlib import Path

import duckdb
import pytest

from conevo.campaigns.schema import SCHEMA
from conevo.campaigns.tables import Tables
from conevo.report.marl_eval import STEPS, export, from_json, left_out, to_json
from report.benchmarl import FRAMES, write

GENERATIONS = 8
BUDGET = 800  # team-steps


class Campaign:
    """Tables of runs in which every value identifies its origin."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.connection = duckdb.connect(":memory:")
        for table, columns in SCHEMA.items():
            listed = ", ".join(f'"{name}" {kind}' for name, kind in columns.items())
            self.connection.execute(f"CREATE TABLE {table} ({listed})")

    def add(self, table, **fields):
        given = {
            name: 0 if kind != "VARCHAR" else "" for name, kind in SCHEMA[table].items()
        } | fields
        marks = ", ".join("?" for _ in given)
        self.connection.execute(f"INSERT INTO {table} VALUES ({marks})", list(given.values()))

    def run(self, method, number, seed, *, steps=BUDGET, tests=(5.0, 3.0), values=None, **fields):
        """Add a run: the value of a generation is its number, its test 5 and 3."""
        family = fields.get("family", "complex")
        about = {"world": "rover-v2", "preset": "smoke", "variant": "", "measure": "main_value"}
        about |= {"family": family, "environment": f"{family}-{number}"} | fields
        about["task"] = f"{about['world']}/{about['environment']}"
        run = "-".join(str(part) for part in (*about.values(), method, seed))
        about |= {"run": run, "run_id": run, "method": method, "number": number, "seed": seed}
        self.add("runs", **about)
        for k in range(GENERATIONS if values is None else len(values)):
            spent = steps * (k + 1) // GENERATIONS
            value = float(k) if values is None else values[k]
            self.add("generations", run=run, generation=k, team_steps=spent, value=value)
        for k, value in reversed(list(enumerate(tests))):  # not in the order of scenarios
            self.add("scores", run=run, study="test", team="champion", scenario=k, value=value)
            others = {"run": run, "scenario": k, "value": -1.0}
            self.add("scores", study="test", team="generation 0", **others)
            self.add("scores", study="lesion", team="champion", **others)
        self.connection.execute(
            "UPDATE scores SET measure = ? WHERE run = ? AND measure = ''", [about["measure"], run]
        )
        for k in range(len(tests)):
            self.add("scores", run=run, study="test", team="champion", measure="area", scenario=k)
        return run

    def tables(self):
        for table in SCHEMA:
            self.connection.execute(f"COPY {table} TO '{self.folder}/{table}.parquet'")
        return Tables(self.folder)


@pytest.fixture
def campaign(tmp_path):
    return Campaign(tmp_path)


def assert_documented(data):
    """Assert the form of marl-eval's page "Data Structure for Raw Experiment data".

    Environment, task, algorithm, run; steps with a step count and lists of numbers, at the end the
    absolute metrics; and its note: in an environment the same algorithms, number of runs and
    number of steps everywhere. Also the assumptions of its code: runs and steps have the same
    names everywhere, algorithms have no comma, and normalised metrics have no "_".
    """
    read = json.loads(json.dumps(data, allow_nan=False))
    assert read == data
    for tasks in read.values():
        assert tasks
        assert len({frozenset(algorithms) for algorithms in tasks.values()}) == 1
        every = [runs for algorithms in tasks.values() for runs in algorithms.values()]
        assert all("," not in name for algorithms in tasks.values() for name in algorithms)
        n = len(every[0])
        assert n > 0
        for runs in every:
            assert list(runs) == [f"seed_{k}" for k in range(1, n + 1)]
            for steps in runs.values():
                *points, last = steps
                assert points == [f"step_{k}" for k in range(1, STEPS + 1)]
                assert last == "absolute_metrics"
                counts = [steps[point].pop("step_count") for point in points]
                assert all(type(count) is int for count in counts)
                assert counts == sorted(set(counts))
                assert len({frozenset(metrics) for metrics in steps.values()}) == 1
                for metrics in steps.values():
                    assert metrics
                    assert all("_" not in name and "step" not in name for name in metrics)
                    for values in metrics.values():
                        assert values
                        assert all(type(value) is float for value in values)


def test_whole_campaign_has_the_documented_form(campaign):
    for seed in (1, 2, 3):
        for method in ("ccga", "cone"):
            for number in (1, 2, 10):
                campaign.run(method, number, seed)
            campaign.run(method, 4, seed, world="pursuit-v2", family="team", measure="capture_time")
    with campaign.tables() as tables:
        data = export(tables)
        assert left_out(tables) == []
    assert list(data) == ["pursuit-v2 team smoke", "rover-v2 complex smoke"]
    assert list(data["rover-v2 complex smoke"]) == ["complex-1", "complex-2", "complex-10"]
    assert list(data["pursuit-v2 team smoke"]["team-4"]) == ["ccga", "cone"]
    one = data["pursuit-v2 team smoke"]["team-4"]["cone"]
    assert list(one) == ["seed_1", "seed_2", "seed_3"]
    assert one["seed_2"]["absolute_metrics"] == {"capture-time": [5.0, 3.0]}
    assert_documented(data)


def test_steps_share_the_smallest_budget_and_show_the_last_generation_that_ended(campaign):
    campaign.run("ccga", 1, 1, steps=800)  # generations end at 100, 200, .. 800
    campaign.run("cone", 1, 1, steps=1600)  # at 200, 400, ..
    with campaign.tables() as tables:
        cells = export(tables)["rover-v2 complex smoke"]["complex-1"]
    curves = {}
    for method in ("ccga", "cone"):
        steps = list(cells[method]["seed_1"].values())[:-1]
        assert [step["step_count"] for step in steps] == [40 * k for k in range(1, 21)]
        curves[method] = [step["main-value"][0] for step in steps]
    # 40, 80: none has ended yet, so the first is shown; it ends between 80 and 120.
    assert curves["ccga"] == [0, 0, 0, 0, 1, 1, 1, 2, 2, 3, 3, 3, 4, 4, 5, 5, 5, 6, 6, 7]
    assert curves["cone"] == [0] * 9 + [1] * 5 + [2] * 5 + [3]


def test_runs_are_named_by_seeds_and_seeds_missing_in_a_cell_are_left_out(campaign):
    runs = [campaign.run("cone", 1, seed, tests=(float(seed),)) for seed in (17, 3, 5)]
    other = [campaign.run("ccga", 1, seed) for seed in (5, 17, 6)]
    with campaign.tables() as tables:
        cone = export(tables)["rover-v2 complex smoke"]["complex-1"]["cone"]
        assert left_out(tables) == sorted([runs[1], other[2]])
    values = {name: run["absolute_metrics"]["main-value"] for name, run in cone.items()}
    assert values == {"seed_5": [5.0], "seed_17": [17.0]}


def test_cells_without_a_common_seed_have_no_rectangle(campaign):
    runs = [campaign.run("cone", 1, 1), campaign.run("ccga", 1, 2)]
    with campaign.tables() as tables:
        assert export(tables) == {}
        assert left_out(tables) == sorted(runs)


def test_an_algorithm_of_few_tasks_is_left_out(campaign):
    gone = campaign.run("cone", 1, 1, variant="gst=0.1,gdm=0.2")
    for number in (1, 2, 3):
        for method in ("ccga", "cone"):
            campaign.run(method, number, 1)
    with campaign.tables() as tables:
        data = export(tables)
        assert left_out(tables) == [gone]
    assert list(data["rover-v2 complex smoke"]) == ["complex-1", "complex-2", "complex-3"]
    assert_documented(data)


def test_an_unfinished_task_is_left_out(campaign):
    for method in ("ccga", "cone", "mesp"):
        for number in (1, 2):
            campaign.run(method, number, 1)
    gone = campaign.run("ccga", 3, 1)
    with campaign.tables() as tables:
        data = export(tables)
        assert left_out(tables) == [gone]
    assert list(data["rover-v2 complex smoke"]) == ["complex-1", "complex-2"]
    assert_documented(data)


def test_tasks_without_a_common_algorithm_have_no_rectangle(campaign):
    runs = [campaign.run("ccga", 1, 1), campaign.run("cone", 2, 1)]
    with campaign.tables() as tables:
        assert export(tables) == {}
        assert left_out(tables) == sorted(runs)


def test_budgets_are_never_mixed(campaign):
    for preset in ("night", "smoke"):
        campaign.run("cone", 1, 1, preset=preset, tests=(float(len(preset)), 0.5))
    campaign.run("cone", 1, 1, family="simple")
    with campaign.tables() as tables:
        data = export(tables)
    assert list(data) == [
        "rover-v2 complex night",
        "rover-v2 complex smoke",
        "rover-v2 simple smoke",
    ]


def test_variants_are_algorithms_without_a_comma(campaign):
    campaign.run("cone", 1, 1)
    campaign.run("cone", 1, 1, variant="gst=0.1,gdm=0.2")
    with campaign.tables() as tables:
        data = export(tables)
    assert list(data["rover-v2 complex smoke"]["complex-1"]) == ["cone", "cone gst=0.1;gdm=0.2"]
    assert_documented(data)


@pytest.mark.parametrize(
    "flaw",
    [
        pytest.param({"tests": ()}, id="no test"),
        pytest.param({"values": ()}, id="no generation"),
        pytest.param({"tests": (1.0, math.nan)}, id="a test that is not a number"),
        pytest.param({"values": (1.0, math.inf)}, id="a generation that is not finite"),
        pytest.param({"tests": (1.0, None)}, id="a test without a value"),
        pytest.param({"values": (1.0, None)}, id="a generation without a value"),
    ],
)
def test_incomplete_runs_are_left_out(campaign, flaw):
    for seed in (1, 2):
        campaign.run("cone", 1, seed)
    gone = campaign.run("cone", 1, 3, **flaw)
    with campaign.tables() as tables:
        assert list(export(tables)["rover-v2 complex smoke"]["complex-1"]["cone"]) == [
            "seed_1",
            "seed_2",
        ]
        assert left_out(tables) == [gone]


def test_campaign_without_runs_exports_nothing(campaign):
    with campaign.tables() as tables:
        assert export(tables) == {}
        assert left_out(tables) == []


def test_same_tables_give_the_same_text(campaign):
    for seed in (2, 1):
        for method in ("cone", "ccga"):
            campaign.run(method, 1, seed)
    with campaign.tables() as one:
        text = json.dumps(export(one))
    with Tables(campaign.folder) as other:
        assert json.dumps(export(other)) == text


def test_a_measure_of_which_smaller_is_better_is_negated(campaign):
    run = campaign.run("cone", 1, 1, measure="first_capture")
    campaign.run("cone", 2, 1, measure="value", family="simple")
    campaign.add("measures", run=run, measure="first_capture", larger_is_better=False)
    with campaign.tables() as tables:
        data = export(tables)
    assert_documented(data)
    (less,) = data["rover-v2 complex smoke"]["complex-1"]["cone"].values()
    assert less["absolute_metrics"] == {"negated-first-capture": [-5.0, -3.0]}
    assert less[f"step_{STEPS}"]["negated-first-capture"] == [1.0 - GENERATIONS]
    (more,) = data["rover-v2 simple smoke"]["simple-2"]["cone"].values()
    assert more["absolute_metrics"] == {"value": [5.0, 3.0]}


def test_written_read_and_written_again_is_equal(campaign, tmp_path):
    for seed in (2, 1):
        for method in ("cone", "ccga"):
            campaign.run(method, 1, seed)
            campaign.run(method, 2, seed, measure="other_value", family="simple")
    with campaign.tables() as tables:
        data = export(tables)
    path = tmp_path / "own.json"
    path.write_text(json.dumps(data))
    assert len(data) == 2
    assert json.dumps(to_json(from_json(path))) == path.read_text()


def test_a_file_of_benchmarl_is_read_and_written_as_it_is(tmp_path):
    (path,) = write(tmp_path, {3: [10.0, 20.0]})
    (one,) = found = from_json(path)
    assert one[:4] == ("conevo", "pursuit_team_4", "mappo", "seed_3")
    assert [point.steps for point in one.points] == [FRAMES, 2 * FRAMES]
    assert one.points[1].values["return"] == [10.0, 20.0, 30.0]
    assert one.absolute["return"] == [30.0]
    assert to_json(found) == json.loads(path.read_text())
