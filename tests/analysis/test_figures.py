"""Figures: the same bytes, readable in grey, and what they show where."""

from __future__ import annotations

import re
from colorsys import rgb_to_hls
from itertools import pairwise

import numpy as np
import pytest

from conevo.analysis import figures
from conevo.analysis.drawing import STYLES, Drawing, shade_of, short, ticks_of

NAMES = ["HomCNE (n = 2)", "CONE (n = 2)"]
X = np.array([10.0, 20.0, 30.0])


def band(level: float) -> figures.Band:
    return figures.Band(X, X * level, X * level - 1, X * level + 1)


def bars() -> Drawing:
    return figures.bars(
        ["complex-1", "complex-2"],
        {NAMES[0]: [1.0, None], NAMES[1]: [2.0, 3.0]},
        {NAMES[0]: [0.5, None], NAMES[1]: [None, 0.1]},
        x_label="environment",
        y_label="value",
    )


def points() -> Drawing:
    return figures.points(
        ["complex-1", "complex-2"],
        {NAMES[0]: [[1.0, 2.0], []], NAMES[1]: [[2.0], [3.0, 4.0]]},
        {NAMES[0]: [(1.5, 1.0, 2.0), None], NAMES[1]: [None, (3.5, 3.0, 4.0)]},
        x_label="environment",
        y_label="value",
        reference=2.0,
    )


def lines() -> Drawing:
    panels = {"complex-1": {NAMES[0]: band(1), NAMES[1]: band(2)}, "complex-2": {NAMES[1]: band(1)}}
    return figures.lines(panels, NAMES, x_label="team evaluations", y_label="S")


def stacks() -> Drawing:
    half = np.full(3, 0.5)
    panels = {("complex-1", "CONE"): {"low": half, "rest": half}}
    return figures.stacks(panels, X, ["low", "hi", "rest"], x_label="x", y_label="y")


def shares() -> Drawing:
    return figures.shares(
        {("team-1", "CONE"): {"a": 0.25, "none": 0.75}, ("team-1", "MESP"): {"none": 1.0}},
        ["a", "none"],
        x_label="share",
    )


def heat_map() -> Drawing:
    cells = {("a − b", "1"): figures.Shade(0.75, "+ .012")}
    return figures.heat_map(["a − b"], ["1"], cells, [(0, "no"), (0.75, "both")], x_label="x")


ALL = [bars, points, lines, stacks, shares, heat_map]


@pytest.mark.parametrize("draw", ALL, ids=lambda draw: draw.__name__)
def test_the_same_numbers_give_the_same_bytes_without_a_date(draw) -> None:
    one, other = draw(), draw()
    assert one == other
    assert one.svg.startswith(b"<?xml")
    assert one.pdf.startswith(b"%PDF")
    assert b"<dc:date>" not in one.svg
    assert b"CreationDate" not in one.pdf


def test_another_number_gives_another_drawing() -> None:
    with_more = figures.bars(
        ["complex-1"], {"CONE": [2.5]}, {"CONE": [0.1]}, x_label="environment", y_label="value"
    )
    with_less = figures.bars(
        ["complex-1"], {"CONE": [2.4]}, {"CONE": [0.1]}, x_label="environment", y_label="value"
    )
    assert with_more.svg != with_less.svg


def test_places_in_the_svg_have_at_most_three_decimals() -> None:
    found = re.findall(r'\b(?:d|x|y)="([^"]*)"', lines().svg.decode())
    assert found
    assert not any(re.search(r"\.\d{4}", text) for text in found)


def test_treatments_differ_without_colour() -> None:
    for column, least in ((2, 8), (3, 8), (4, 8)):  # hatches, lines, markers
        distinct = {str(style[column]) for style in STYLES}
        assert len(distinct) >= least - (column == 2)  # CONE is told from HomCNE by its darkness
    plain = [style[0] for style in STYLES if not style[2]]
    lightness = sorted(lightness_of(colour) for colour in plain)
    assert all(b - a > 0.3 for a, b in pairwise(lightness))


def test_parts_of_a_whole_differ_from_their_neighbours_without_colour() -> None:
    for n in (2, 5, 9):
        shades = [shade_of(k, n) for k in range(n)]
        assert len(set(shades)) == n
        for (colour, hatch), (above, other) in pairwise(shades):
            assert hatch != other or abs(lightness_of(colour) - lightness_of(above)) > 0.2


def lightness_of(colour: str) -> float:
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return rgb_to_hls(red, green, blue)[1]


def test_ticks_are_round_and_inside() -> None:
    ticks, limits = ticks_of(0.0, 612.0)
    assert ticks == [0, 150, 300, 450, 600]
    assert limits == (0.0, pytest.approx(636.48))
    assert ticks_of(0.0, 1.0, (0.0, 1.0))[0] == pytest.approx([0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert ticks_of(3.0, 3.0)[1] == (3.0, 4.0)


def test_thousands_are_short() -> None:
    assert [short(v) for v in (0, 0.25, 950, 20000, 1.5e6)] == ["0", "0.25", "950", "20k", "1.5M"]
