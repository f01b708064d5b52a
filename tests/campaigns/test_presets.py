"""Plans that are part of conevo: the page lists all of them, and their stated costs are right."""

import itertools
import re
from pathlib import Path

import pytest

import conevo.campaigns.plan_file
from campaigns.plans import preset
from conevo.campaigns.plan_file import preset_names, read_preset
from conevo.worlds.pursuit.world import PursuitWorld

PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "campaigns.md"
PRESETS = Path(conevo.campaigns.plan_file.__file__).parent / "presets"
N_NEURONS = 6
# Figures and tables of results; the others show settings, environments and drawings.
SHOWN = {
    "figure": {
        "4": range(10, 13), "5": range(8, 18), "6": range(7, 10), "B": range(1, 10),
        "D": range(1, 4),
    },
    "table": {
        "4": range(4, 6), "5": range(7, 17), "6": range(9, 14), "A": range(1, 3),
        "C": range(1, 28), "D": range(1, 18),
    },
}  # fmt: skip
NUMBER = re.compile(r"\b(4|5|6|A|B|C|D)[.-](\d+)\b")


def items(text):
    """Return the items of "tables C-1 to C-3, figure 5.8": (kind, chapter, number) of each."""
    found = set()
    for kind, listed in re.findall(r"(figure|table)s? ((?:(?!figure|table).)*)", text):
        for part in re.split(r",| and ", listed):
            ends = [(chapter, int(n)) for chapter, n in NUMBER.findall(part)]
            if ends:
                (chapter, first), (_, last) = ends[0], ends[-1]
                found |= {(kind, chapter, n) for n in range(first, last + 1)}
    return found


def table(first):
    """Return the rows of the page's table whose first column has this title."""
    lines = PAGE.read_text().splitlines()
    begin = next(k for k, line in enumerate(lines) if line.startswith(f"| {first} |")) + 2
    rows = itertools.takewhile(lambda line: line[:2] == "| ", lines[begin:])
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in rows]


def rows():
    """Return the figures and tables of each row of the page's table, and its presets."""
    return [
        (items(cells[0]), re.findall(r"`([a-z-]+)`", cells[2])) for cells in table("of the thesis")
    ]


def questions():
    """Return the presets of open questions, and the cost of each according to the page."""
    return {cells[0].strip("`"): cells[2] for cells in table("preset")}


def team_steps(plan):
    """Return the team-steps of a plan's evolution, without studies and tests."""
    total = 0
    for planned in plan.write_out():
        for config in planned.configs():
            teams = config.run.budget_evaluations
            if not teams:  # the thesis' sizes: every genotype once, 10,000 in all
                teams = 10_000 * config.run.generations
            total += teams * config.run.epochs * config.world_params.iterations
    return total


@pytest.mark.parametrize("scale", ["night", "thesis"])
@pytest.mark.parametrize("name", [name for name in preset_names() if "pursuit" in name])
def test_populations_share_six_hundred_genotypes(name, scale):
    for planned in read_preset(name).at(scale, seeds=1).write_out():
        (config,) = planned.configs()
        genotypes, team = config.method_config.genotypes, PursuitWorld(config.environment).n_robots
        populations = {"homcne": 1, "hetcne": 1, "ccga": team}.get(planned.method, team * N_NEURONS)
        assert genotypes == round(600 / populations), planned.label
        assert 594 <= genotypes * populations <= 612


def test_all_results_of_the_thesis_are_on_the_page():
    shown = {
        (kind, chapter, n)
        for kind, chapters in SHOWN.items()
        for chapter, numbers in chapters.items()
        for n in numbers
    }
    reported = set().union(*(found for found, _ in rows()))
    assert reported == shown


def test_a_preset_produces_the_results_that_the_page_lists():
    by_preset = {}
    for found, presets in rows():
        for name in presets:
            by_preset.setdefault(name, set()).update(found)
    assert by_preset.keys() == set(preset_names()) - {"evening"} - questions().keys()
    for name, found in by_preset.items():
        assert set().union(*map(items, read_preset(name).produces)) == found, name


@pytest.mark.parametrize("name", questions())
def test_an_open_question_has_the_cost_that_its_plan_and_the_page_state(name):
    plan = preset(name)
    lines = (PRESETS / f"{name}.toml").read_text().partition("\n\n[")[0].splitlines()
    comment = " ".join(line.strip("# ") for line in lines)
    assert comment.startswith("Decides ")
    (price,) = re.findall(r"Price: (\d\.\d x 10\^\d+) team-steps", comment)
    assert price == questions()[name]
    factor, _, power = price.partition(" x 10^")
    assert team_steps(plan) == pytest.approx(float(factor) * 10 ** int(power), rel=0.03)
    assert plan.produces == ()


@pytest.mark.parametrize("name", questions())
def test_an_open_question_can_be_asked_at_any_scale(name):
    for scale in ("smoke", "desk", "night", "thesis"):
        runs = preset(name).at(scale, seeds=1).write_out()
        assert len({run.run_ids for run in runs}) == len(runs)  # no two cells are the same
        if scale == "smoke":
            assert {run.configs()[0].run.budget_evaluations for run in runs} == {430}
