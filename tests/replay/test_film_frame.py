"""Frames of films: their contents, which depend on the number of the frame alone."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from conevo import palette
from conevo.errors import UsageError
from conevo.playback.quantized import Channel
from conevo.playback.schema import Backdrop, BodyKind, Kind, Ring, Things
from conevo.replay.drawing.mask import Mask
from conevo.replay.drawing.panel import PAGE, Panel
from conevo.replay.drawing.scene import Scene
from conevo.replay.drawing.timeline import Timeline
from conevo.replay.film_frame import Painter
from replay.filmed import BUILT, GONE, SIZE, T, mixed, near, playback, rgb


def world(made, t, colour_by="action"):
    return Scene(made, (SIZE, SIZE), colour_by).at(t)


def pixel(made, t, x, y, colour_by="action"):
    """Return the colour at a place of the world."""
    picture = world(made, t, colour_by)
    scale = SIZE / 10
    return picture.getpixel((int(x * scale), int((10 - y) * scale)))


# --- the world ------------------------------------------------------------------------------------


def test_robots_have_the_colour_of_their_action_at_their_place():
    made = playback()
    assert pixel(made, 0, 3, 7) == rgb(palette.ORANGE)
    assert pixel(made, 35, 3, 7) == rgb(palette.FAINT)
    assert pixel(made, 0, 2, 2) == rgb(palette.BLUE)
    assert pixel(made, 39, 5.9, 2) == rgb(palette.BLUE)


def test_a_trail_of_120_positions_stays_behind():
    t = 150
    x = 1.0 + 0.05 * np.arange(t)  # 1.2 px in an iteration
    both = {"x": Channel.of(np.stack([x, x], axis=1)), "y": Channel.of(np.tile([2.0, 5.0], (t, 1)))}
    action = Channel.of(np.ones((t, 2), int))
    made = playback(iterations=t, action=action, things=(), plan=(), **both)
    # The line, which fades, is in one or two of these four rows of pixels.
    shown = np.asarray(world(made, t - 1))[190:194].mean(axis=0)
    for x, opacity in ((8.0, 0.5), (6.8, 0.375), (5.0, 0.25), (3.3, 0.125)):
        line = mixed(palette.BLUE, palette.GROUND, opacity / 4)
        assert near(shown[int(24 * x)], line, by=2)
    assert pixel(made, t - 1, 2.2, 2) == rgb(palette.GROUND)
    assert pixel(made, 60, 7.5, 2) == rgb(palette.GROUND)


def test_a_robot_that_leaves_on_one_side_and_enters_on_the_other_draws_no_line():
    for name, low, high in (("x", 0.5, 9.5), ("y", 9.5, 0.5), ("x", 3.0, 7.5)):
        still, moves = np.full((T, 1), 5.0), np.where(np.arange(T)[:, None] < 20, low, high)
        places = {"x": Channel.of(still), "y": Channel.of(still), name: Channel.of(moves)}
        action = Channel.of(np.ones((T, 1), int))
        made = playback(
            action=action, robots=playback().robots[:1], body=(0,), things=(), plan=(), **places
        )
        is_crossed = pixel(made, 20, 5, 5) != rgb(palette.GROUND)
        assert is_crossed == (abs(high - low) <= 5)


def test_robots_have_the_colour_of_their_caste_on_request():
    assert pixel(playback(), 0, 3, 7, "caste") == rgb(palette.FAINT)
    assert pixel(playback(), 0, 2, 2, "caste") == rgb(palette.GREEN)


def test_rocks_fade_from_the_iteration_in_which_they_are_detected():
    made = playback()
    assert pixel(made, GONE - 1, 6, 8) == rgb(palette.VERMILION)
    shown = [pixel(made, t, 6, 8)[2] for t in range(GONE, GONE + 12)]
    assert all(a <= b for a, b in pairwise(shown))
    assert shown[0] < shown[4] < shown[9]
    faint = mixed(palette.VERMILION, palette.GROUND, 0.12)
    assert near(pixel(made, GONE + 10, 6, 8), faint)
    assert near(pixel(made, T - 1, 6, 8), faint)
    assert pixel(made, T - 1, 8, 8) == rgb(palette.VERMILION)


@pytest.mark.parametrize("age", [0, 9])
def test_a_ring_widens_where_something_was_detected(age):
    made = playback(rings=())
    bare = np.asarray(world(replace(made, things=()), GONE + age))
    changed = np.argwhere((np.asarray(world(made, GONE + age)) != bare).any(axis=-1))
    around = changed[np.abs(changed - (48, 144)).max(axis=1) < 36]
    assert np.ptp(around[:, 1]) / 2 == pytest.approx(0.4 * 24 + 14 * (age + 1) / 15, abs=1.5)


def test_fixed_objects_are_drawn_below_everything():
    assert pixel(playback(), 0, 5, 0.2) == rgb("#ddccbb")
    assert pixel(playback(), 0, 9, 4) == rgb(palette.GROUND)


def test_a_raster_is_drawn_with_its_first_row_at_the_bottom():
    cells = Channel.of(np.array([[1, 0], [0, 0]], np.uint8))
    part = Backdrop("raster", (0.0, 0.0, 10.0, 10.0), fill="#ddccbb", cells=cells)
    made = playback(backdrop=(part,), rings=(), things=())
    assert pixel(made, 0, 4.8, 4.8) == rgb("#ddccbb")
    assert pixel(made, 0, 4.8, 5.2) == rgb(palette.GROUND)
    assert pixel(made, 0, 5.2, 4.8) == rgb(palette.GROUND)


def test_rings_are_filled_faintly_for_the_actions_that_have_one():
    made = playback()
    assert near(pixel(made, 0, 3, 6), mixed(palette.ORANGE, palette.GROUND, 0.1))
    assert pixel(made, 35, 3, 6) == rgb(palette.GROUND)
    assert pixel(made, 0, 2, 3) == rgb(palette.GROUND)


def test_headings_point_counter_clockwise_from_the_right():
    heading = Channel.of(np.full((T, 2), np.pi / 2))
    made = playback(heading=heading, body_kinds=(BodyKind("robot", 1.0),), rings=())
    # Between two columns of pixels: each has half of a line 1 px wide.
    assert near(pixel(made, 0, 3, 7.5), mixed(palette.INK, palette.ORANGE, 0.5), by=25)
    for x, y in ((3, 6.5), (2.5, 7), (3.5, 7)):
        assert pixel(made, 0, x, y) == rgb(palette.ORANGE)


def test_other_bodies_are_kites_of_their_own_colour():
    others = (BodyKind("robot", 0.3), BodyKind("prey", 1.0, "square", palette.PURPLE))
    at = {name: Channel.of(np.full((T, 3), value)) for name, value in (("x", 5.0), ("y", 5.0))}
    made = playback(body_kinds=others, body=(0, 0, 1), rings=(), **at)
    assert pixel(made, 0, 5.6, 5) == rgb(palette.PURPLE)
    assert pixel(made, 0, 5.65, 5.65) == rgb(palette.GROUND)
    assert pixel(made, 0, 5, 5) == rgb(palette.ORANGE)  # the team lies above, its first on top


def test_carried_objects_are_drawn_above_their_robot_with_a_rim():
    things = Things(
        "objects",
        (Kind("A", palette.YELLOW),),
        Channel.of([0]),
        Channel.of(np.full((T, 1), 3.0)),
        Channel.of(np.full((T, 1), 7.0)),
        size=0.15,
        shape="square",
        state=Channel.of((np.arange(T) >= 5).astype(int)[:, None]),
        states=(Kind("lying", ""), Kind("held", palette.PURPLE)),
    )
    held = np.where(np.arange(T)[:, None] >= 5, [[0, -1]], -1)
    made = playback(things=(things,), held=Channel.of(held), plan=())
    assert pixel(made, 4, 3, 7) == rgb(palette.ORANGE)
    assert pixel(made, 5, 3, 7) == rgb(palette.YELLOW)
    assert near(pixel(made, 5, 3.2, 7), rgb(palette.PURPLE), by=40)


def test_nothing_is_drawn_outside_the_world():
    edge = {name: Channel.of(np.full((T, 2), 9.99)) for name in ("x", "y")}
    frames = [np.asarray(Painter([playback(**edge)], SIZE).frame(t)) for t in (0, 9)]
    panel = Panel(playback(**edge), SIZE, "action", alone=True)
    x0, y0, x1, y1 = panel.world
    for frame in frames:
        border = frame[y0 - 1, x0 - 1 : x1 + 1]
        assert (border == rgb(palette.FAINT)).all()
        assert (frame[y0 - 2, x0:x1] == rgb(PAGE)).all()
        assert (frame[y0:y1, x1 + 1 : x1 + 4] == rgb(PAGE)).all()


# --- the timeline ---------------------------------------------------------------------------------


def test_the_timeline_shows_every_action_robots_ordered_by_caste():
    strip = Timeline(playback(), 212, SIZE)
    page = Image.new("RGB", (212, strip.height), PAGE)
    strip.paint(page, 0, 0, T - 1)
    assert strip.order == [1, 0]
    first, second = (k * strip.row + strip.row // 2 for k in (0, 1))
    assert page.getpixel((2, first)) == rgb(palette.GREEN)
    assert page.getpixel((2, second)) == rgb(palette.FAINT)
    assert page.getpixel((100, first)) == rgb(palette.BLUE)
    assert page.getpixel((12 + 140, second)) == rgb(palette.ORANGE)
    assert page.getpixel((12 + 160, second)) == rgb(palette.FAINT)


def test_a_robot_that_always_switches_never_looks_like_one_that_does_not():
    action = np.stack([np.arange(T) % 2, np.ones(T, int)], axis=1)
    strip = Timeline(playback(action=Channel.of(action)), 32, SIZE)  # two iterations to a column
    page = Image.new("RGB", (32, strip.height), PAGE)
    strip.paint(page, 0, 0, T - 1)
    rows = np.asarray(page)[:, 12:30]
    constant, switching = rows[: strip.row - 1], rows[strip.row : 2 * strip.row - 1]
    assert (constant == rgb(palette.BLUE)).all()
    for colour in (palette.ORANGE, palette.BLUE):
        assert (switching == rgb(colour)).all(axis=-1).any(axis=0).all()


def test_the_playhead_is_at_the_current_time_and_the_future_is_pale():
    strip = Timeline(playback(), 212, SIZE)
    assert [strip.head(t) for t in (9, 19, 39)] == [61, 111, 210]
    page = Image.new("RGB", (220, strip.height), PAGE)
    strip.paint(page, 4, 0, 19)
    row = np.asarray(page)[strip.row // 2]
    assert (row[115:117] == rgb(palette.INK)).all()
    assert (row[17:115] == rgb(palette.BLUE)).all()
    pale = mixed(palette.BLUE, "#ffffff", 0.28)
    assert all(near(one, pale) for one in row[117:216].tolist())


def test_the_playhead_is_in_the_frame():
    panel = Panel(playback(), SIZE, "action", alone=True)
    frame = Painter([playback()], SIZE).frame(19)
    x, y = panel.timeline_at
    assert frame.getpixel((x + panel.timeline.head(19), y + 1)) == rgb(palette.INK)


def test_the_plan_fills_as_it_is_built():
    painter = Painter([playback(rings=())], SIZE)
    frames = [np.asarray(painter.frame(t)) for t in (BUILT - 1, BUILT)]
    x = Panel(playback(), SIZE, "action", alone=True).world[2] + 4
    count = [(f[:, x:] == rgb(palette.VERMILION)).all(axis=-1).sum() for f in frames]
    assert count[1] - count[0] == 10 * 10  # one of two parts


def test_numbers_move_with_time():
    painter = Painter([playback()], SIZE)
    panel = Panel(playback(), SIZE, "action", alone=True)
    left, top = panel.world[2], panel.world[1]
    number = [np.asarray(painter.frame(t))[top : top + 16, left + 2 :] for t in (3, 4)]
    assert (number[0] != number[1]).any()


# --- frames ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("colour_by", ["action", "caste"])
def test_a_frame_does_not_depend_on_previous_ones(colour_by):
    painter = Painter([playback(), playback(subtitle="MESP")], SIZE, colour_by)
    for t in (0, 30, GONE, 12, GONE - 1, 39, GONE + 3, 0, 21):
        fresh = Painter([playback(), playback(subtitle="MESP")], SIZE, colour_by)
        assert painter.frame(t).tobytes() == fresh.frame(t).tobytes()


def test_two_teams_are_side_by_side_each_under_its_name():
    other = playback(x=Channel.of(np.full((T, 2), 8.0)), subtitle="MESP")
    painter = Painter([playback(), other], SIZE)
    panel = Panel(playback(), SIZE, "action", alone=False)
    wide = panel.background.width
    assert painter.size[0] == 2 * wide
    frame = painter.frame(0)
    x0, y0, x1, y1 = panel.world
    y = y1 - round(2 * (y1 - y0) / 10)
    scale = (x1 - x0) / 10
    assert frame.getpixel((x0 + round(2 * scale), y)) == rgb(palette.BLUE)
    assert frame.getpixel((wide + x0 + round(8 * scale), y)) == rgb(palette.BLUE)
    heads = [np.asarray(frame.crop((dx + x0, 0, dx + x1, y0 - 2))) for dx in (0, wide)]
    assert (heads[0] != heads[1]).any()


def test_a_shorter_epoch_stays_at_its_end():
    t = 10
    cut = {name: Channel.of(getattr(playback(), name).values[:t]) for name in ("x", "y", "action")}
    short = playback(iterations=t, things=(), plan=(), **cut)
    painter = Painter([short, playback()], SIZE)
    assert painter.iterations == T
    half = (0, 0, painter.size[0] // 2, painter.size[1])
    assert painter.frame(9).crop(half) == painter.frame(T - 1).crop(half)
    assert painter.frame(5).crop(half) != painter.frame(9).crop(half)


@pytest.mark.parametrize("radius", [5.0, 40.0])
def test_shapes_have_the_given_places_and_sizes(radius):
    for x in (50.0, 50.25, 51.5, 53.75):
        image = Image.new("RGB", (110, 100))
        Mask(image, (x - radius, 50 - radius, x + radius, 50 + radius)).disc(x, 50, radius).paint(
            "#fff"
        )
        shown = np.asarray(image)[..., 0] / 255
        total = shown.sum()
        assert shown.sum(axis=0) @ (np.arange(110) + 0.5) / total == pytest.approx(x, abs=0.3)
        assert total == pytest.approx(np.pi * radius**2, rel=0.04)


def test_a_shape_beyond_an_edge_is_cut_and_not_moved():
    whole, piece = Image.new("RGB", (60, 60)), Image.new("RGB", (60, 60))
    corner = piece.crop((20, 20, 60, 60))
    for image, x in ((whole, 25.3), (corner, 5.3)):
        Mask(image, (x - 20, x - 20, x + 20, x + 20)).disc(x, x, 20).paint("#fff")
    assert whole.crop((20, 20, 60, 60)).tobytes() == corner.tobytes()


@pytest.mark.parametrize("size", [121, 333])
def test_any_size_and_shape_of_world_fits(size):
    made = playback(bounds=(-5.0, 0.0, 15.0, 10.0))
    painter = Painter([made], size)
    panel = Panel(made, size, "action", alone=True)
    x0, y0, x1, y1 = panel.world
    assert (x1 - x0, y1 - y0) == (size, round(size / 2))
    assert painter.frame(0).size == painter.size
    assert [side % 2 for side in painter.size] == [0, 0]


def test_a_single_iteration_and_a_hostile_range_can_be_drawn():
    one = {name: Channel.of(getattr(playback(), name).values[:1]) for name in ("x", "y", "action")}
    made = playback(
        iterations=1,
        things=(),
        plan=(),
        rings=(Ring("range", (1e30, 0.0), "action"),),
        body_kinds=(BodyKind("robot", 1e30),),
        title="<b>\x00\n" + "long " * 500,
        **one,
    )
    assert Painter([made], SIZE).frame(0).size[0] < 2 * SIZE


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Painter([]), "one or two teams"),
        (lambda: Painter([playback()] * 3), "one or two teams"),
        (lambda: Painter([playback()], 40), "size 40"),
        (lambda: Painter([playback()], colour_by="mood"), "not by mood"),
        (lambda: Painter([playback()], SIZE).frame(T), "no iteration 40"),
        (lambda: Painter([playback()], SIZE).frame(-1), "no iteration -1"),
    ],
)
def test_a_wrong_picture_is_refused(call, message):
    with pytest.raises(UsageError, match=message):
        call()
