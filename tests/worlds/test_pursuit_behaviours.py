"""Individual behaviours on trajectories written by hand, on both sides of every boundary."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from conevo.studies.lifetimes import lifetimes as of_executed
from conevo.worlds.pursuit.study.behaviours import (
    BEHAVIOURS,
    NONE,
    Conduct,
    Rules,
    conduct,
    executed,
    spells,
)
from worlds.trajectories import (
    AHEAD,
    PRESS,
    PREY_SPEED,
    STOP,
    around,
    body,
    record,
    sizes,
)

T = 20
PREY = (100.0, 100.0)


def slow(left, right, n=T):
    """Return a script that is refused in every second iteration and drives in the others."""
    return [(left, right, k % 2) for k in range(n)]


def watch(predator, prey=None, companion=None, rules=None, n_predators=2):
    """Return the behaviours of predator 0, by name; by default its companion idles next to it."""
    n = len(predator["x"])
    if prey is None:
        prey = body(*PREY, 0.0, [STOP] * n)
    if companion is None:
        away = float(predator["x"][0]), float(predator["y"][0]) + 20.0
        companion = body(*away, 0.0, [STOP] * n)
    seen = conduct(record(predator, companion, prey), sizes(n_predators), rules)
    return names(seen.behaviour[:, 0])


def names(behaviour):
    return ["none" if k == NONE else BEHAVIOURS[k] for k in behaviour]


def at(bearing, gap, off, script):
    """Return a predator at a bearing and gap from the prey, heading ``off`` degrees past it."""
    x, y = around(PREY, bearing, gap)
    return body(x, y, bearing + 180.0 + off, script)


def test_nothing_is_judged_before_a_whole_window():
    seen = watch(at(180, 15, 0, [AHEAD] * T))
    assert seen[:10] == ["none"] * 10
    assert set(seen[10:]) == {"pursuer"}


# --- pursuer --------------------------------------------------------------------------------------


def test_pursuer_drives_straight_at_a_fleeing_prey_from_behind():
    prey = body(*PREY, 0.0, [AHEAD] * T, PREY_SPEED)
    assert set(watch(at(180, 10, 0, [AHEAD] * T), prey)[10:]) == {"pursuer"}


def test_pursuer_drives_straight_at_a_prey_from_its_side():
    companion = body(85.0, 115.0, 0.0, [STOP] * T)
    seen = watch(at(90, 20, 0, [AHEAD] * T), companion=companion)
    assert set(seen[10:]) == {"pursuer"}


def test_pursuer_may_drive_backwards():
    assert set(watch(at(180, 15, 180, [(-1.0, -1.0, 0)] * T))[10:]) == {"pursuer"}


def test_pressing_on_a_prey_without_moving_is_pursuing_it():
    assert set(watch(at(120, 0.1, 0, [PRESS] * T))[10:]) == {"pursuer"}


@pytest.mark.parametrize(("off", "expected"), [(29, "pursuer"), (31, "none")])
def test_aim_boundary_at_a_distance(off, expected):
    # Refused for another reason at a gap of 15, so that the geometry is constant.
    assert set(watch(at(180, 15, off, [PRESS] * T))[10:]) == {expected}


@pytest.mark.parametrize(("off", "expected"), [(46, "pursuer"), (48, "none")])
def test_a_line_that_meets_the_prey_is_aimed_at_it(off, expected):
    # 7.5 cm from centre to centre: the line passes the prey's centre at 5.5 cm if asin(5.5 / 7.5).
    assert math.degrees(math.asin(5.5 / 7.5)) == pytest.approx(47.2, abs=0.1)
    assert set(watch(at(180, 2, off, [PRESS] * T))[10:]) == {expected}


def test_driving_away_from_the_prey_is_not_a_behaviour():
    assert set(watch(at(180, 5, 180, [AHEAD] * T))[10:]) == {"none"}


@pytest.mark.parametrize(("degrees", "expected"), [(4.4, "pursuer"), (4.6, "none")])
def test_straight_ends_at_a_turn_of_45_degrees_in_a_window(degrees, expected):
    turn = math.radians(degrees) * 5.3 / 0.8
    script = [(1 - turn, 1.0, 0)] * 11
    off = -5 * degrees  # the window's arc is symmetric about the prey
    assert watch(at(180, 20, off, script))[10] == expected


def test_zigzag_is_straight():
    script = [(0.6, 1.0, 0), (1.0, 0.6, 0)] * (T // 2)
    assert set(watch(at(180, 20, 0, script))[10:]) == {"pursuer"}


# --- blocker --------------------------------------------------------------------------------------


def test_blocker_drives_head_on_at_a_prey_that_comes_towards_it():
    prey = body(*PREY, 0.0, [(0.5, 0.5, 0)] * T, PREY_SPEED)
    assert set(watch(at(0, 20, 0, [(0.5, 0.5, 0)] * T), prey)[10:]) == {"blocker"}


def test_staying_in_front_of_a_prey_without_driving_is_idle_not_blocking():
    prey = body(*PREY, 0.0, [(0.5, 0.5, 0)] * T, PREY_SPEED)
    assert set(watch(at(0, 20, 0, [STOP] * T), prey)[10:]) == {"idle"}


@pytest.mark.parametrize(
    ("bearing", "expected"), [(44, "blocker"), (-44, "blocker"), (46, "pursuer"), (-46, "pursuer")]
)
def test_front_ends_at_45_degrees(bearing, expected):
    assert set(watch(at(bearing, 10, 0, [PRESS] * T))[10:]) == {expected}


def test_a_prey_that_turns_round_makes_a_pursuer_a_blocker():
    turning = math.pi * 5.3 / (2 * PREY_SPEED * 10)  # half a turn in ten iterations, on the spot
    script = [STOP] * 10 + [(-turning, turning, 0)] * 10 + [STOP] * 10
    seen = watch(at(180, 5, 0, [PRESS] * 30), body(*PREY, 0.0, script, PREY_SPEED))
    assert seen[10] == "pursuer"
    assert seen[-1] == "blocker"
    assert seen[10:] == sorted(seen[10:], reverse=True)  # one change


# --- idle -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("wheels", "expected"), [(0.062, "idle"), (0.063, "pursuer")])
def test_idle_ends_at_half_a_centimetre_in_a_window(wheels, expected):
    assert 10 * 0.8 * 0.062 < 0.5 < 10 * 0.8 * 0.063
    assert set(watch(at(180, 10, 0, [(wheels, wheels, 0)] * T))[10:]) == {expected}


def test_turning_on_the_spot_is_idle():
    assert set(watch(at(180, 10, 0, [(-1.0, 1.0, 0)] * T))[10:]) == {"idle"}


def test_idle_counts_far_from_all_bodies_and_pursuing_does_not():
    far = body(150.0, 150.0, 225.0, [STOP] * T)
    assert set(watch(far)[10:]) == {"idle"}
    driving = body(150.0, 150.0, 225.0, [AHEAD] * T)
    assert set(watch(driving)[10:]) == {"none"}


def test_a_predator_that_a_wall_refuses_is_not_idle():
    assert set(watch(at(180, 10, 180, [PRESS] * T))[10:]) == {"none"}


# --- flanker --------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1, -1])
def test_flanker_bumps_again_and_again_into_the_side_of_the_rear(side):
    assert set(watch(at(side * 120, 1.5, 0, slow(0.15, 0.15)))[10:]) == {"flanker"}


def test_flanker_keeps_alongside_a_moving_prey():
    # The prey drives on; the flanker, heading along and a little inwards, bumps and follows.
    prey = body(*PREY, 0.0, [(0.2, 0.2, 0)] * T, PREY_SPEED)
    x, y = around(PREY, 120, 0.8)
    flanker = body(x, y, -20.0, [(0.5, 0.5, k % 2) for k in range(T)])
    assert set(watch(flanker, prey)[10:]) == {"flanker"}


@pytest.mark.parametrize(
    ("bearing", "expected"),
    [(89, "pursuer"), (91, "flanker"), (164, "flanker"), (166, "pursuer"), (180, "pursuer")],
)
def test_sides_of_the_rear_have_ends(bearing, expected):
    assert set(watch(at(bearing, 1.5, 0, slow(0.14, 0.14)))[10:]) == {expected}


@pytest.mark.parametrize(("every", "expected"), [(5, "flanker"), (11, "pursuer")])
def test_one_bump_in_a_window_is_not_repeated(every, expected):
    script = [(0.1, 0.1, int(k % every == 4)) for k in range(T)]
    seen = watch(at(120, 1.7, 0, script), rules=Rules(touch_cm=1.7001))
    assert seen[11] == expected


@pytest.mark.parametrize(("gap", "expected"), [(1.79, "flanker"), (4.0, "pursuer")])
def test_refusals_away_from_the_prey_are_not_collisions_with_it(gap, expected):
    assert watch(at(120, gap, 0, slow(0.14, 0.14)))[12] == expected


def test_refusals_while_driving_away_are_not_collisions_with_the_prey():
    assert set(watch(at(120, 0.5, 180, slow(0.14, 0.14)))[10:]) == {"none"}


@pytest.mark.parametrize(("near", "expected"), [(1.5, "flanker"), (1.2, "pursuer")])
def test_flanker_stays_close_in_all_iterations(near, expected):
    seen = watch(at(120, 1.5, 0, slow(0.14, 0.14)), rules=Rules(near_cm=near))
    assert seen[10] == expected


# --- knocker --------------------------------------------------------------------------------------


def swing(degrees, n=T):
    """Return slow wheels that turn by this angle in each iteration that is not refused."""
    half = math.radians(degrees) * 5.3 / 0.8 / 2
    return slow(0.12 - half, 0.12 + half, n)


@pytest.mark.parametrize("bearing", [0, 60, 120, 180])
def test_knocker_bumps_again_and_again_on_an_arc_wherever_it_is(bearing):
    assert watch(at(bearing, 1.5, -50, swing(10)))[10] == "knocker"


@pytest.mark.parametrize(("degrees", "expected"), [(8.8, "flanker"), (9.2, "knocker")])
def test_an_arc_starts_at_45_degrees_in_a_window(degrees, expected):
    # Five of ten iterations turn: 44 or 46 degrees.
    assert watch(at(120, 1.5, -22, swing(degrees)))[10] == expected


def test_an_arc_without_collisions_is_not_knocking():
    half = math.radians(5) * 5.3 / 0.8 / 2
    script = [(0.12 - half, 0.12 + half, 0)] * T
    assert watch(at(120, 1.5, -50, script))[10] == "none"


def test_swinging_left_and_right_is_not_an_arc():
    half = math.radians(10) * 5.3 / 0.8 / 2
    script = [(0.12 + side * half, 0.12 - side * half, k % 2) for k, side in
              enumerate([1, 1, -1, -1] * 5)]  # fmt: skip
    assert watch(at(120, 1.5, 0, script))[10] == "flanker"


# --- interaction ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("gap", "expected"), [(21.9, "pursuer"), (22.1, "none")])
def test_interaction_ends_at_the_range_of_light(gap, expected):
    assert watch(at(180, gap, 0, [PRESS] * T))[-1] == expected


@pytest.mark.parametrize(("gap", "expected"), [(21.9, "pursuer"), (22.1, "none")])
def test_interaction_ends_at_the_range_of_infrared(gap, expected):
    predator = at(180, 10, 0, [PRESS] * T)
    companion = body(float(predator["x"][0]), float(predator["y"][0]) + 5.5 + gap, 0.0, [STOP] * T)
    assert watch(predator, companion=companion)[-1] == expected


def test_the_behaviour_is_about_the_closest_prey():
    t = record(
        at(180, 10, 0, [PRESS] * T),
        body(80.0, 110.0, 0.0, [STOP] * T),
        body(*PREY, 0.0, [STOP] * T),
        body(*around((84.5, 100.0), 180, 5), 0.0, [STOP] * T),
        captured=np.zeros((T, 2), dtype=np.int32),
    )
    seen = conduct(t, sizes())
    assert set(seen.prey[:, 0].tolist()) == {1}
    assert names(seen.behaviour[10:, 0]) == ["none"] * 10  # it drives away from this prey
    alone = {k: v[:, :3] if v.shape[1] == 4 else v for k, v in t.items()}
    assert names(conduct(alone, sizes()).behaviour[10:, 0]) == ["pursuer"] * 10


SCENES = {
    "pursuer": at(180, 15, 0, [AHEAD] * T),
    "blocker": at(10, 10, 0, [PRESS] * T),
    "flanker": at(120, 1.5, 0, slow(0.14, 0.14)),
    "knocker": at(150, 1.5, -50, swing(10)),
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("quarter", [1, 2, 3])
@pytest.mark.parametrize("is_mirrored", [False, True])
def test_behaviours_do_not_depend_on_orientation(name, quarter, is_mirrored):
    t = record(SCENES[name], body(100.0, 115.0, 0.0, [STOP] * T), body(*PREY, 0.0, [STOP] * T))
    expected = conduct(t, sizes())
    assert name in names(expected.behaviour[:, 0])
    x, y, angle = t["x"] - 100, t["y"] - 100, t["heading"]
    left, right = t["left"], t["right"]
    if is_mirrored:
        y, angle, left, right = -y, -angle, right, left
    c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarter]
    turned = t | {
        "x": c * x - s * y + 100,
        "y": s * x + c * y + 100,
        "heading": (angle + quarter * np.pi / 2 + np.pi) % (2 * np.pi) - np.pi,
        "left": left,
        "right": right,
    }
    seen = conduct(turned, sizes())
    assert np.array_equal(seen.behaviour, expected.behaviour)
    assert np.array_equal(seen.interacts, expected.interacts)


# --- lifetimes ------------------------------------------------------------------------------------

PURSUER, BLOCKER, FLANKER, KNOCKER, IDLE = range(5)


def lifetimes(conducts):
    """Return the study's results for these epochs."""
    return of_executed(executed(conducts), BEHAVIOURS)


def life(*windows, start=10, interacts=None):
    """Return the conduct of one predator that shows each of these behaviours for a window."""
    behaviour = np.repeat(np.array([NONE, *windows], dtype=np.int64), start)[:, None]
    with_others = np.ones_like(behaviour, dtype=bool)
    if interacts is not None:
        with_others = np.repeat(np.array([False, *interacts]), start)[:, None]
    return Conduct(behaviour, with_others, np.zeros_like(behaviour), start)


def test_a_predator_that_always_does_the_same_is_specialized_to_it():
    (own,) = lifetimes([life(*[BLOCKER] * 6)])
    assert (own.label, own.specialization, own.switches, own.windows) == ("blocker", 0.0, 0, 6)
    assert own.shares["blocker"] == 1.0


def test_a_switch_in_every_window_is_the_worst_s():
    (own,) = lifetimes([life(*[PURSUER, KNOCKER] * 5)])
    assert own.specialization == 1.0
    assert own.label == "non-specialized"


@pytest.mark.parametrize(
    ("windows", "s", "label"),
    [
        ([PURSUER, PURSUER, BLOCKER, BLOCKER, PURSUER], 0.5, "non-specialized"),
        ([PURSUER, PURSUER, PURSUER, BLOCKER, BLOCKER, PURSUER], 0.4, "pursuer"),
    ],
)
def test_s_of_a_half_is_no_longer_specialized(windows, s, label):
    (own,) = lifetimes([life(*windows)])
    assert own.specialization == pytest.approx(s)
    assert own.label == label


def test_none_within_an_interaction_counts_and_is_not_a_specialization():
    (own,) = lifetimes([life(NONE, NONE, NONE, PURSUER)])
    assert own.shares["none"] == 0.75
    assert own.specialization == pytest.approx(1 / 3)
    assert own.label == "non-specialized"


def test_behaviour_outside_interactions_counts_only_if_it_is_idling():
    (own,) = lifetimes(
        [life(NONE, PURSUER, IDLE, NONE, PURSUER, interacts=[False, True, False, False, True])]
    )
    assert own.windows == 3
    assert own.shares["pursuer"] == pytest.approx(2 / 3)
    assert own.switches == 2


def test_epochs_are_one_life():
    (own,) = lifetimes([life(PURSUER, PURSUER), life(BLOCKER, BLOCKER, BLOCKER)])
    assert (own.windows, own.switches, own.specialization) == (5, 1, 0.25)
    assert own.label == "blocker"


def test_a_predator_without_any_behaviour_that_counts():
    (own,) = lifetimes([life(NONE, NONE, interacts=[False, False])])
    assert (own.windows, own.specialization, own.label) == (0, 0.0, "non-specialized")


def test_windows_follow_the_rules():
    t = record(SCENES["pursuer"], body(80.0, 110.0, 0.0, [STOP] * T), body(*PREY, 0.0, [STOP] * T))
    for window in (4, 5):
        seen = conduct(t, sizes(), replace(Rules(), window=window))
        assert (seen.behaviour[:window, 0] == NONE).all()
        assert lifetimes([seen])[0].windows == T // window - 1


def test_spells():
    assert spells(np.array([1, 1, 0, 1, 0, 0, 1], dtype=bool)) == [(0, 2), (3, 4), (6, 7)]
    assert spells(np.zeros(3, dtype=bool)) == []
    assert spells(np.ones(3, dtype=bool)) == [(0, 3)]
