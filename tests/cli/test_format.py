"""Spreads, bars and tables as people read them; the live view from a few records."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from conevo.cli.format import bars, castes, neurons, progress, spread, table
from conevo.cli.progress import Display, place
from conevo.cli.run_text import exchange_text, run_text
from conevo.cli.testing_text import test_text as text_of_test
from conevo.runs.progress import Pace
from conevo.terms import counted
from runs.tiny import TASK, evolve_tiny, tiny_settings


@pytest.mark.parametrize(
    ("counts", "text"),
    [
        ((5, 30, 600, 0), "5 of 30 generations"),
        ((5, 30, 600, 10_000), "5 of 30 generations"),
        ((13, 1000, 49_920, 50_000), "13 generations, 49,920 of 50,000 evaluations"),
        ((1000, 1000, 50_000, 50_000), "1,000 of 1,000 generations"),
        ((0, 1000, 0, 50_000), "0 of 1,000 generations"),
    ],
)
def test_progress_is_towards_the_end_of_the_run(
    counts: tuple[int, int, int, int], text: str
) -> None:
    assert progress(*counts) == text


def test_units_directions_and_exchange_are_shown_with_a_run(tmp_path: Path) -> None:
    shown = run_text(evolve_tiny(tmp_path / "run"), 5)
    assert (
        "measures: value (points, larger is better), area (share of the square, larger is better); "
        "S: 0 = always the same action, 1 = switches all the time" in shown
    )
    assert re.search(r"recombined between populations: \S+ pairs \(\S+ %\) per generation", shown)
    records = [{"sst": 0.5, "gst": 0.2, "recombinations": k, "n_hidden": [10, 10]} for k in (0, 3)]
    assert exchange_text(records) == [
        "recombined between populations: 1.5 pairs (15 %) per generation"
    ]
    assert exchange_text([one | {"sst": None, "gst": None} for one in records]) == []


@pytest.mark.parametrize(
    ("found", "text"),
    [
        ({"mean": 2.0, "sd": 0.5, "n": 3, "values": [1.5, 2.0, 2.5]}, "2 +- 0.5"),
        ({"mean": 2.0, "sd": 0.5, "n": 2, "values": [1.5, None, 2.5]}, "2 +- 0.5 (2 of 3)"),
        ({"mean": 2.0, "sd": None, "n": 1, "values": [None, 2.0, None]}, "2 (1 of 3)"),
        ({"mean": None, "sd": None, "n": 0, "values": [None] * 3}, "- (0 of 3)"),
        ({"mean": 2.0, "sd": 0.0, "values": [2.0]}, "2 (1 of 3)"),  # conevo 0.1.0
    ],
)
def test_a_spread_states_its_number_of_scenarios(found: dict[str, Any], text: str) -> None:
    assert spread(found, 3) == text
    rows = table(["", "value"], [["a", text], ["b", "-"]]).splitlines()
    assert rows[2].endswith(" -")  # numbers are aligned on the right


def test_a_run_of_an_older_conevo_is_shown_without_validation() -> None:
    old = {"mean": 2.0, "sd": 0.0, "values": [2.0]}
    tested = {
        "generation": 3,
        "scenarios": 2,
        "performance": {"value": old},
        "fitness": old,
        "specialization": [0.5],
        "castes": {"low": 1},
    }
    lines = text_of_test({"champion": tested, "generation_0": tested}).splitlines()
    assert lines[0] == (
        "Testing phase, 2 fresh scenarios (mean +- standard deviation; "
        "S: 0 = always the same action, 1 = switches all the time)"
    )
    assert lines[2].split() == ["fittest", "team", "3", "2", "(1", "of", "2)", "0.5"]
    assert sum(line.startswith("warning: value is not finite") for line in lines) == 1
    assert not any("finalists" in line for line in lines)
    assert not any("favourite" in line for line in lines)  # for a run without any
    likes = {"favourites": ["hi", None, "low", "hi"], "favourite_shares": [1.0, None, 0.5, 0.75]}
    lines = text_of_test({"champion": tested | likes, "generation_0": tested}).splitlines()
    told = (
        "favourite settings of the fittest team: hi 2, low 1 (share 0.75); 1 = always the same one"
    )
    assert told in lines
    likes = {"favourites": [None], "favourite_shares": [None]}
    lines = text_of_test({"champion": tested | likes, "generation_0": tested}).splitlines()
    assert "favourite settings of the fittest team: none; 1 = always the same one" in lines


def test_bars_show_the_shape_of_a_series() -> None:
    assert bars([0, 1, 2, 3, 4, 5, 6, 7], 40) == "▁▂▃▄▅▆▇█"
    assert bars([0, 0, 7, 7], 2) == "▁█"
    assert bars([3, 3], 40) == "▁▁"
    assert bars([], 40) == ""


def test_castes_and_neurons_are_short() -> None:
    assert castes({"low": 12, "non-specialized": 8}) == "low 12, non-specialized 8"
    assert (neurons([10, 10]), neurons([8, 12, 9])) == ("10", "8-12")


def test_numbers_are_aligned_on_the_right_and_words_on_the_left() -> None:
    text = table(["name", "n"], [["a", "1,000"], ["long", "7"], ["20 rovers", "-"]])
    assert text.splitlines() == [
        "name           n",
        "a          1,000",
        "long           7",
        "20 rovers      -",
    ]


def test_pace_counts_down_to_the_last_generation_or_the_end_of_the_budget(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run", run__budget_evaluations=1000, run__generations=2)
    pace = Pace(run)
    for k in range(2):  # made again
        pace.add({"generation": k, "team_evaluations": 100 * (k + 1), "seconds": 2.0})
    assert (pace.rate, place(pace)) == (50, "generation 2/2")
    pace.outline = replace(pace.outline, generations=250, budget_evaluations=1000)
    assert pace.seconds_left == 16  # 800 evaluations left at 50 per second
    assert place(pace) == "generation 2, 200/1,000 evaluations"
    pace.outline = replace(pace.outline, generations=5, budget_evaluations=1050)
    assert pace.seconds_left == 6  # three generations of two seconds
    pace.outline = replace(pace.outline, generations=250, budget_evaluations=1050)
    assert pace.seconds_left == 16  # the ninth generation cannot be paid


def test_the_live_view_shows_everything_required(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    display = Display(run)
    for record in run.generations():
        display.add(run, record)
    console = Console(file=io.StringIO(), width=120)
    console.print(display.render())
    assert isinstance(console.file, io.StringIO)
    shown = console.file.getvalue()
    for words in (
        "rover-v2/complex-1, CONE, preset smoke, seed 1", "generation 5/5", "left", "value",
        "area", "best", "mean", "castes", "settings", "1 = always the same one", "SST", "GST",
        "recombinations between populations", "neurons", "team evaluations/s",
        "(points, larger is better)",
        "degree of specialization S (0 = always the same action, 1 = switches all the time)",
    ):  # fmt: skip
        assert words in shown
    assert shown.splitlines()[3].startswith("generation 5/5")  # the bar has its own line


def test_one_of_a_thing_is_singular() -> None:
    assert [counted(n, "fresh scenario") for n in (0, 1, 2, 1200)] == [
        "0 fresh scenarios",
        "1 fresh scenario",
        "2 fresh scenarios",
        "1,200 fresh scenarios",
    ]


def test_a_run_with_one_of_everything_is_described_in_the_singular(say) -> None:
    ones = ("generations", "n_finalists", "n_validations", "n_tests")
    settings = tiny_settings("cone") | {f"run.{name}": 1 for name in ones}
    sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    said = say("run", TASK, "--preset", "smoke", *sets, "--out", "run")
    assert "Testing phase, 1 fresh scenario (mean" in said.out
    assert "the best of 1 finalist in 1 validation scenario\n" in said.out
    assert "\n1 of 1 generation, " in said.out
    said = say("test", "run", "--on", "complex-2", "--robots", "2")
    assert ", 1 fresh scenario (mean" in said.out
    assert "complex-2, 2 robots\n" in said.out
    start = ("campaign", "start", "rover-simple", "--preset", "smoke", "--seeds", "1", "--dry-run")
    assert "only 1 core to use" in say(*start, "--threads", "2", "--cores", "1").err
    every = re.compile(r"\b1 (?!times)[a-z-]+s\b", re.I)
    for verb in ("show run", "test run", "run --config run/config.toml --dry-run"):
        said = say(*verb.split())
        assert not every.findall(said.out), verb
