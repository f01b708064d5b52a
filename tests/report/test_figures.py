"""Figures: reproducible bytes, nothing cut, readable in grey, and the places of their parts."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from colorsys import rgb_to_hls
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from conevo.palette import METHODS, caste_colours, method_looks
from conevo.report.figures import charts as figures
from conevo.report.figures import curves, tiles
from conevo.report.figures import style as drawing
from conevo.report.figures.curves import Line
from conevo.report.figures.lettering import drawable, fitted, labels_of, width_of
from conevo.report.figures.style import DASHES, HATCHES, MARKERS, Drawing, hatches, ticks_of
from conevo.report.learning_curves import Course
from conevo.worlds.registry import colours_of

pytest_plugins = ["report.quick_figures"]
pytestmark = pytest.mark.filterwarnings("error")

X = np.array([10.0, 20.0, 30.0])
NAMES = {"homcne": "HomCNE", "cone": "CONE"}


@pytest.fixture(autouse=True)
def drawn(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """Collect the drawn figures, so that their parts can be measured."""
    found: list[Any] = []
    saved = drawing.saved

    def kept(figure: Any) -> Drawing:
        made = saved(figure)
        found.append(figure)
        return made

    for module in (figures, curves, tiles):
        monkeypatch.setattr(module, "saved", kept)
    yield found
    for figure in found:
        assert_readable(figure)


def assert_readable(figure: Any) -> None:
    """Assert that no text is cut, too small or overlapped, and that the plot is the largest."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    figure.set_dpi(144)
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    renderer = canvas.get_renderer()
    box = figure.bbox
    texts = []
    hidden = unseen_ticks(figure)
    for text in figure.findobj(Text):
        if text.get_visible() and text.get_text().strip() and text not in hidden:
            extent = text.get_window_extent(renderer)
            assert extent.x0 >= box.x0 - 1, text
            assert extent.x1 <= box.x1 + 1, text
            assert extent.y0 >= box.y0 - 1, text
            assert extent.y1 <= box.y1 + 1, text
            assert text.get_fontsize() >= 7, text
            texts.append(text)
    corners = np.array([text.get_window_extent(renderer).extents for text in texts])
    for one, other in itertools.combinations(range(len(texts)), 2):
        a, b = corners[one], corners[other]
        across, up = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
        assert not (across > 2 and up > 2), (texts[one], texts[other])
    for legend in figure.legends:
        extent = legend.get_window_extent(renderer)
        assert extent.x1 <= box.x1
        for axes in figure.axes:
            assert extent.y0 >= axes.get_window_extent(renderer).y1 - 1
    plot = sum(axes.get_window_extent(renderer).height for axes in figure.axes[:1])
    assert all(legend.get_window_extent(renderer).height <= plot for legend in figure.legends)


def unseen_ticks(figure: Any) -> list[Any]:
    """Return the labels of ticks outside their axes, which are not drawn."""
    return [
        label
        for axes in figure.axes
        for axis in (axes.xaxis, axes.yaxis)
        for tick in axis.get_major_ticks()
        if not min(axis.get_view_interval()) <= tick.get_loc() <= max(axis.get_view_interval())
        for label in (tick.label1, tick.label2)
    ]


def band(level: float) -> Course:
    return Course(X, X * level, X * level - 1, X * level + 1, 2)


def bars() -> Drawing:
    panel = {
        "homcne": [figures.Bar(1.0, 0.5), None],
        "cone": [figures.Bar(2.0, None), figures.Bar(3.0, 0.1)],
    }
    places = ["complex-1", "complex-2"]
    return figures.bars({"": panel}, places, NAMES, x_label="environment", y_label="value")


def points() -> Drawing:
    panel = {
        "homcne": [figures.Points([1.0, 2.0], (1.5, 1.0, 2.0)), None],
        "cone": [figures.Points([2.0], None), figures.Points([3.0, 4.0], (3.5, 3.0, 4.0))],
    }
    places = ["complex-1", "complex-2"]
    return figures.points(
        {"": panel}, places, NAMES, x_label="environment", y_label="value", reference=2.0
    )


def lines() -> Drawing:
    one, other = Line("homcne"), Line("cone")
    panels = {"complex-1": {one: band(1), other: band(2)}, "complex-2": {other: band(1)}}
    names = {one: "HomCNE", other: "CONE"}
    return curves.lines(panels, names, x_label="team evaluations", y_label="S")


def stacks() -> Drawing:
    half = np.full(3, 0.5)
    panels = {("complex-1", "CONE"): {"low": half, "rest": half}}
    colours = {"low": "#e69f00", "hi": "#56b4e9", "rest": "#9a9aa5"}
    return curves.stacks(panels, X, colours, x_label="x", y_label="y")


def shares() -> Drawing:
    return tiles.shares(
        {("team-1", "CONE"): {"a": 0.25, "none": 0.75}, ("team-1", "MESP"): {"none": 1.0}},
        {"a": "#e69f00", "none": "#9a9aa5"},
        x_label="share",
    )


def heat_map() -> Drawing:
    cells = {("a − b", "1"): tiles.Shade(0.75, "+ .012")}
    return tiles.heat_map(["a − b"], ["1"], cells, [(0, "no"), (0.75, "both")], x_label="x")


ALL = [bars, points, lines, stacks, shares, heat_map]


@pytest.mark.parametrize("draw", ALL, ids=lambda draw: draw.__name__)
def test_the_same_numbers_give_the_same_bytes_without_a_date(draw) -> None:
    one, other = draw(), draw()
    assert one == other
    assert one.svg.startswith(b"<?xml")
    assert one.pdf.startswith(b"%PDF")
    assert b"<dc:date>" not in one.svg
    assert b"CreationDate" not in one.pdf
    assert b"/FontFile2" in one.pdf  # outlines, embedded


OWN = [f"a_strategy_of_ones_own_with_a_long_name_{k}" for k in range(8)]
LONG = "mutation probability = 0.05, elite portion = 0.125, recombination = between populations"


ONE, TEN = ["dark-1"], [f"complex-{k}" for k in range(1, 11)]


@pytest.mark.parametrize(
    ("methods", "panels", "places"),
    [
        pytest.param(list(METHODS)[:2], 1, ONE, id="two methods"),
        pytest.param(list(METHODS)[:4], 1, ONE, id="four methods"),
        pytest.param(list(METHODS), 1, TEN, id="ten methods, ten places"),
        pytest.param(OWN, 1, ONE, id="long names"),
        pytest.param(list(METHODS)[:2], 2, TEN, id="two panels"),
        pytest.param(OWN, 8, ONE, id="eight panels"),
    ],
)
def test_any_number_of_methods_and_panels_fits(methods, panels, places, drawn, as_svg_only) -> None:
    titles = [f"gst = {k}, {LONG}" if panels > 1 else "" for k in range(panels)]
    names = {m: method_title(m) for m in methods}
    bar = figures.Bar(0.3, 0.1)
    figures.bars(
        {title: dict.fromkeys(methods, [bar] * len(places)) for title in titles},
        places,
        names,
        x_label="an environment with a long name " * 3,
        y_label="a measure with a long name and a unit (share of all of the objects)",
    )
    runs = figures.Points([0.2, 0.3], (0.25, 0.1, 0.4))
    figures.points(
        {title: dict.fromkeys(methods, [runs] * len(places)) for title in titles},
        places,
        names,
        x_label="environment",
        y_label="value",
    )
    assert len(drawn[0].axes) == panels


@pytest.mark.parametrize(
    ("methods", "panels"),
    [
        pytest.param(list(METHODS)[:1], 1, id="one line"),
        pytest.param(list(METHODS)[:4], 6, id="six panels"),
        pytest.param(OWN, 13, id="long names"),
    ],
)
def test_any_number_of_curves_fits(methods, panels, as_svg_only) -> None:
    names = {Line(method): method_title(method) for method in methods}
    course = {line: band(1 + k / 9) for k, line in enumerate(names)}
    titles = [f"complex-{k}, {LONG}" for k in range(panels)]
    curves.lines(dict.fromkeys(titles, course), names, x_label="team evaluations", y_label="value")
    castes = caste_colours(colours_of("gacc-v2"), ["A-gatherer", "B-gatherer", "move"])
    part = {name: np.full(3, 1 / len(castes)) for name in castes}
    rows = titles[:6]
    curves.stacks(
        {(row, name): part for row in rows for name in names.values()},
        X,
        castes,
        x_label="team evaluations",
        y_label="share of the robots",
    )


def test_long_names_of_pairs_and_bars_fit(as_svg_only) -> None:
    pairs = [f"CONE, {LONG} {k} − Multi-Agent ESP, {LONG}" for k in range(10)]
    cells = {(pair, place): tiles.Shade(0.5, "+ 1.000") for pair in pairs for place in "123"}
    legend = [(0.0, "neither test below 0.05"), (0.5, "Mann-Whitney only (Holm)")]
    tiles.heat_map(pairs, "123", cells, legend, x_label="an environment " * 9)
    colours = {f"a kind of behaviour, number {k}": "#e69f00" for k in range(9)}
    tiles.shares(
        {(f"team-{k}", f"{LONG} (n = 20)"): {next(iter(colours)): 1.0} for k in range(4)},
        colours,
        x_label="share",
    )


def method_title(name: str) -> str:
    return f"{name} (n = 3 to 20)"


def test_bars_go_down_for_negative_means(drawn, as_svg_only) -> None:
    cells = {"cone": [figures.Bar(-0.5, 0.1)], "homcne": [figures.Bar(-0.2, 0.1)]}
    figures.bars({"": cells}, ["dark-1"], NAMES, x_label="x", y_label="y")
    (axes,) = drawn[0].axes
    low, high = axes.get_ylim()
    assert low < -0.6
    assert high == 0
    assert sorted(bar.get_height() for bar in axes.patches) == [-0.5, -0.2]


def test_nothing_is_drawn_beyond_the_range_of_a_measure(drawn, as_svg_only) -> None:
    cells = {"cone": [figures.Bar(0.9, 0.5)]}
    within = (0.0, 1.0)
    figures.bars({"": cells}, ["1"], {"cone": "CONE"}, x_label="x", y_label="y", within=within)
    runs = {"cone": [figures.Points([0.1, 0.9], (0.5, -4.6, 5.6))]}
    figures.points({"": runs}, ["1"], {"cone": "CONE"}, x_label="x", y_label="y", within=within)
    wide = Course(X, X / 40, X / 40 - 3, X / 40 + 3, 2)
    line = Line("cone")
    curves.lines({"": {line: wide}}, {line: "CONE"}, x_label="x", y_label="y", within=within)
    for figure in drawn[:2]:
        for collection in figure.axes[0].collections:
            ends = np.concatenate([path.vertices[:, 1] for path in collection.get_paths()])
            assert ends.min() >= 0
            assert ends.max() <= 1
    (around,) = (one for one in drawn[2].axes[0].collections if isinstance(one, PolyCollection))
    heights = around.get_paths()[0].vertices[:, 1]  # in panels, which end at 1.04 of the highest
    assert heights.min() >= 0
    assert heights.max() <= 1 / 1.04 + 1e-9


def test_a_method_looks_the_same_next_to_any_others(drawn, as_svg_only) -> None:
    panel = {"cone": [figures.Bar(1.0, None)]}
    figures.bars({"": panel}, ["1"], {"cone": "CONE"}, x_label="x", y_label="y")
    bars()
    alone = drawn[0].axes[0].patches[0]
    beside = drawn[1].axes[0].patches[-1]
    assert alone.get_facecolor() == beside.get_facecolor()
    assert alone.get_hatch() == beside.get_hatch()


def test_places_in_the_svg_have_at_most_three_decimals() -> None:
    found = re.findall(r'\b(?:d|x|y)="([^"]*)"', lines().svg.decode())
    assert found
    assert not any(re.search(r"\.\d{4}", text) for text in found)


def test_methods_differ_without_colour() -> None:
    looks = method_looks(METHODS)
    assert sorted(look.number for look in looks.values()) == list(range(len(looks)))
    for column, n_alike in ((HATCHES, 1), (DASHES, 0), (MARKERS, 0)):
        assert len({str(one) for one in column}) == len(column) - n_alike >= len(looks) - n_alike
    plain = [look.area for look in looks.values() if not HATCHES[look.number]]
    lightness = sorted(lightness_of(colour) for colour in plain)
    assert all(b - a > 0.3 for a, b in pairwise(lightness))


def test_parts_of_a_whole_differ_from_their_neighbours_without_colour() -> None:
    for n in (2, 5, 9):
        found = hatches(n)
        assert len(found) == n
        assert found[-1] == ""
        assert all(a != b for a, b in pairwise(found))


def lightness_of(colour: str) -> float:
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return rgb_to_hls(red, green, blue)[1]


def test_text_is_broken_and_shortened_to_fit() -> None:
    assert fitted("CONE", 1.0) == "CONE"
    text = fitted("gst = 0.1, mutation probability = 0.05", 0.8)
    assert text.split("\n")[0] == "gst = 0.1,"
    assert max(map(width_of, text.split("\n"))) <= 0.8
    cut = fitted("x" * 200, 1.0, 2)
    assert cut.endswith("…")
    assert width_of(cut) <= 1.0
    assert drawable("价 ab\n\x07c") == "? ab ?c"


def test_text_is_not_broken_inside_a_number() -> None:
    text = "rover/complex-10, gst=0.125 of 61,000,-2.5 or 1e-05"
    wide = max(map(width_of, ("complex-", "0.125", "61,000,-2.5", "1e-05")))
    assert fitted(text, wide, 20).split("\n") == [
        "rover/", "complex-", "10, gst=", "0.125 of", "61,000,-2.5", "or 1e-05",
    ]  # fmt: skip


def test_names_of_places_are_turned_only_if_they_must_be() -> None:
    assert labels_of(["dark-1", "dark-2"], 1.0) == (["dark-1", "dark-2"], 0.0)
    assert labels_of(["an_environment_far_away"] * 2, 0.6).angle == 30.0


def test_ticks_are_round_and_inside() -> None:
    ticks, limits = ticks_of(0.0, 612.0)
    assert ticks == [0, 150, 300, 450, 600]
    assert limits == (0.0, pytest.approx(636.48))
    assert ticks_of(0.0, 1.0, (0.0, 1.0))[0] == pytest.approx([0, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert ticks_of(3.0, 3.0)[1] == (3.0, 4.0)
