"""The thesis' experiments: team types have their numbers, and the page leads to all of them."""

import re
from pathlib import Path

import pytest

from conevo.campaigns.plan_file import preset_names, read_preset
from conevo.worlds.pursuit.world import PursuitWorld

PAGE = Path(__file__).resolve().parent.parent.parent / "docs" / "campaigns.md"
N_NEURONS = 6
# What the thesis shows of its experiments; all else are settings, environments and drawings.
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
    """Return what "tables C-1 to C-3, figure 5.8" is: (kind, chapter, number) of each."""
    found = set()
    for kind, listed in re.findall(r"(figure|table)s? ((?:(?!figure|table).)*)", text):
        for part in re.split(r",| and ", listed):
            ends = [(chapter, int(n)) for chapter, n in NUMBER.findall(part)]
            if ends:
                (chapter, first), (_, last) = ends[0], ends[-1]
                found |= {(kind, chapter, n) for n in range(first, last + 1)}
    return found


def rows():
    """Return what each row of the page's table shows, and its presets."""
    lines = [line.split("|")[1:-1] for line in PAGE.read_text().splitlines() if line[:2] == "| "]
    head = next(k for k, cells in enumerate(lines) if cells[0].strip() == "of the thesis")
    return [(items(cells[0]), re.findall(r"`([a-z-]+)`", cells[2])) for cells in lines[head + 1 :]]


@pytest.mark.parametrize("scale", ["night", "thesis"])
@pytest.mark.parametrize("name", [name for name in preset_names() if "pursuit" in name])
def test_populations_share_six_hundred_genotypes(name, scale):
    for planned in read_preset(name).at(scale, seeds=1).write_out():
        (config,) = planned.configs()
        genotypes, team = config.method_config.genotypes, PursuitWorld(config.environment).n_robots
        populations = {"homcne": 1, "hetcne": 1, "ccga": team}.get(planned.method, team * N_NEURONS)
        assert genotypes == round(600 / populations), planned.label
        assert 594 <= genotypes * populations <= 612


def test_all_that_the_thesis_shows_is_on_the_page():
    shown = {
        (kind, chapter, n)
        for kind, chapters in SHOWN.items()
        for chapter, numbers in chapters.items()
        for n in numbers
    }
    reported = set().union(*(found for found, _ in rows()))
    assert reported == shown


def test_a_preset_produces_what_the_page_says_it_does():
    by_preset = {}
    for found, presets in rows():
        for name in presets:
            by_preset.setdefault(name, set()).update(found)
    assert by_preset.keys() == set(preset_names()) - {"evening"}
    for name, found in by_preset.items():
        assert set().union(*map(items, read_preset(name).produces)) == found, name
