"""Collective behaviours: compositions of section 4.6.3, near misses, and finding captures."""

from __future__ import annotations

import numpy as np
import pytest

from conevo.worlds.pursuit.study.behaviours import BEHAVIOURS, NONE, Conduct, Rules, conduct
from conevo.worlds.pursuit.study.captures import (
    COLLECTIVES,
    COMPOSITIONS,
    Capture,
    composition,
    find_captures,
    most_frequent,
    name,
)
from worlds.trajectories import PRESS, STOP, around, body, record, sizes

LETTERS = {"p": "pursuer", "b": "blocker", "f": "flanker", "k": "knocker", "i": "idle"}


def roles(text):
    """Return roles from letters: "p b - fk" is four predators, the last with two roles."""
    return [[LETTERS[c] for c in word if c != "-"] for word in text.split()]


@pytest.mark.parametrize(
    ("text", "at_wall", "switches", "expected"),
    [
        # entrapment: three or four pursuers, whatever the wall
        ("p p p", False, 0, "entrapment"),
        ("p p p p", True, 0, "entrapment"),
        ("p p p -", False, 0, "entrapment"),
        ("p p p i", False, 0, "entrapment"),
        ("p p", False, 0, "none"),
        ("p p p p p", False, 0, "none"),
        ("p p p f", False, 0, "none"),
        # pursuer-blocker: one to three of each, in the open
        ("p b", False, 0, "pursuer-blocker"),
        ("p p p b b b", False, 0, "pursuer-blocker"),
        ("p p b i i", False, 0, "pursuer-blocker"),
        ("p p p p b", False, 0, "none"),
        ("p b b b b", False, 0, "none"),
        ("b b b", False, 0, "none"),
        ("p b k", False, 0, "none"),
        # spiders-fly: one or two blockers, at a wall
        ("p b", True, 0, "spiders-fly"),
        ("p p p b b", True, 0, "spiders-fly"),
        ("p b b b", True, 0, "pursuer-blocker"),
        ("b b", True, 0, "none"),
        ("p p", True, 0, "none"),
        # role-switcher: flankers and knockers that switch
        ("f k", False, 1, "role-switcher"),
        ("f k", False, 0, "none"),
        ("f f", False, 3, "none"),
        ("k k i", False, 3, "none"),
        ("fk fk", False, 2, "role-switcher"),
        ("fk i", False, 2, "none"),
        ("fk fk fk i i i", True, 5, "role-switcher"),
        ("f f k i i i i", False, 1, "none"),
        ("f f f f k", False, 1, "none"),
        ("f k p", False, 1, "none"),
        ("f k pf", False, 1, "role-switcher"),
        # the longest role is what counts in the first three
        ("pb pb pf", False, 0, "entrapment"),
        ("- - -", False, 0, "none"),
        ("", False, 0, "none"),
    ],
)
def test_names(text, at_wall, switches, expected):
    assert name(roles(text), at_wall=at_wall, switches=switches) == expected


def test_compositions_of_the_behavioural_validation_teams_are_recognized():
    """Section 4.6.6 lists the teams of types 1 to 5 (role-switcher 5 has seven predators there)."""
    blocking = ["p b", "p p b", "p p b b", "p p p b b", "p p p b b b"]
    switching = ["f k", "f f k", "f f k i", "f f k k i"]
    for text in blocking:
        assert name(roles(text), at_wall=False, switches=0) == "pursuer-blocker"
    for text in blocking[:4]:
        assert name(roles(text), at_wall=True, switches=0) == "spiders-fly"
    for text in switching:
        assert name(roles(text), at_wall=False, switches=1) == "role-switcher"


# --- finding captures -----------------------------------------------------------------------------

T = 200


def scene(captured, behaviour=None, x=50.0, n_predators=2, prey_of=None, interacts=None):
    """Return a record of a captured prey at (x, 50), and of the predators' behaviours meanwhile."""
    captured = np.asarray(captured)
    captured = captured[:, None] if captured.ndim == 1 else captured
    bodies = n_predators + captured.shape[1]
    places = np.full((len(captured), bodies), 50.0)
    places_x = places.copy()
    places_x[:, n_predators:] = x
    shape = (len(captured), n_predators)
    doing = np.full(shape, NONE) if behaviour is None else np.asarray(behaviour)
    one = Conduct(
        doing,
        np.ones(shape, dtype=bool) if interacts is None else interacts,
        np.zeros(shape, dtype=int) if prey_of is None else prey_of,
        10,
    )
    found = {"x": places_x, "y": places, "captured": captured.astype(np.int32)}
    return find_captures(found, one, sizes(n_predators, arena=100.0), Rules())


def during(*intervals):
    held = np.zeros(T)
    for start, stop in intervals:
        held[start:stop] = 1
    return held


def test_a_capture_is_an_interval_and_the_approach_before_it():
    (one,) = scene(during((60, 100)))
    assert (one.start, one.first, one.stop) == (30, 60, 100)


def test_an_approach_starts_with_the_epoch_or_after_the_previous_capture():
    early, late = scene(during((15, 40), (55, 90)))
    assert (early.start, early.first) == (0, 15)
    assert (late.start, late.first) == (40, 55)


@pytest.mark.parametrize(("pause", "n"), [(9, 1), (10, 2)])
def test_a_short_pause_does_not_end_a_capture(pause, n):
    assert len(scene(during((50, 70), (70 + pause, 120)))) == n


def test_no_captures():
    assert scene(during()) == []


@pytest.mark.parametrize(("held", "expected"), [(20, ("pursuer",)), (19, ())])
def test_a_role_lasts_for_a_fifth_of_a_capture(held, expected):
    behaviour = np.full((T, 2), NONE)
    behaviour[50 : 50 + held, 0] = 0
    (one,) = scene(during((60, 130)), behaviour)  # 30 + 70 iterations
    assert one.roles == (expected, ())


def test_roles_are_ordered_by_how_long_they_last_and_switches_counted():
    behaviour = np.full((T, 2), NONE)
    behaviour[30:60, 0] = BEHAVIOURS.index("flanker")
    behaviour[60:65, 0] = BEHAVIOURS.index("pursuer")  # behaviours in between do not count
    behaviour[65:70, 0] = BEHAVIOURS.index("flanker")
    behaviour[70:130, 0] = BEHAVIOURS.index("knocker")
    behaviour[30:130, 1] = BEHAVIOURS.index("flanker")
    (one,) = scene(during((60, 130)), behaviour)
    assert one.roles == (("knocker", "flanker"), ("flanker",))
    assert (one.switches, one.collective) == (1, "role-switcher")


def test_distant_behaviour_or_one_about_another_prey_is_not_a_role():
    behaviour = np.zeros((T, 2), dtype=int)
    two = np.stack([during((60, 100)), during()], axis=1)
    prey_of = np.zeros((T, 2), dtype=int)
    prey_of[:, 1] = 1
    (one,) = scene(two, behaviour, prey_of=prey_of)
    assert one.roles == (("pursuer",), ())
    apart = np.ones((T, 2), dtype=bool)
    apart[:, 0] = False
    (one,) = scene(during((60, 100)), behaviour, interacts=apart)
    assert one.roles == ((), ("pursuer",))


@pytest.mark.parametrize(
    ("x", "at_wall"), [(8.2, True), (8.3, False), (91.8, True), (91.7, False), (50, False)]
)
def test_a_wall_is_near_if_no_robot_fits_between(x, at_wall):
    (one,) = scene(during((60, 100)), x=x)
    assert one.at_wall is at_wall


def test_each_prey_has_its_own_captures():
    found = scene(np.stack([during((60, 100)), during((20, 50), (150, 170))], axis=1))
    assert [(one.prey, one.first) for one in found] == [(0, 60), (1, 20), (1, 150)]


def test_a_triangle_of_pursuers_and_a_pincer_from_trajectories():
    """The whole chain: predators press on a prey from three sides, then one from the front."""
    n = 60
    prey = body(100.0, 100.0, 0.0, [STOP] * n)
    held = np.zeros((n, 1), dtype=np.int32)
    held[20:] = 1
    for bearings, expected in (
        ((60, 180, -60), "entrapment"),
        ((0, 150, -150), "pursuer-blocker"),
    ):
        predators = [
            body(*around((100.0, 100.0), b, 0.1), b + 180.0, [PRESS] * n) for b in bearings
        ]
        seen = record(*predators, prey, captured=held)
        where = sizes(3)
        (one,) = find_captures(seen, conduct(seen, where), where)
        assert one.collective == expected
        near_wall = seen | {"x": seen["x"] - 92.0}  # the prey's rim is 5.25 cm from a wall
        (one,) = find_captures(near_wall, conduct(near_wall, where), where)
        assert one.collective == {"pursuer-blocker": "spiders-fly"}.get(expected, expected)


def test_the_most_frequent():
    def of(collective):
        return Capture(0, 0, 1, 2, ((), ()), False, 0, collective)

    some = [of("none"), of("spiders-fly"), of("spiders-fly"), of("entrapment")]
    most, counts = most_frequent(some)
    assert most == "spiders-fly"
    assert counts == {
        "entrapment": 1, "pursuer-blocker": 0, "spiders-fly": 2, "role-switcher": 0, "none": 1,
    }  # fmt: skip
    assert most_frequent([of("none"), of("role-switcher")])[0] == "role-switcher"
    assert most_frequent([])[0] == "none"


def test_every_role_is_a_behaviour():
    assert {role for one in COMPOSITIONS.values() for role in one} == set(BEHAVIOURS)


def instance(collective: str, *roles: str) -> Capture:
    return Capture(
        0, 0, 1, 2, tuple((role,) if role else () for role in roles), False, 0, collective
    )


def test_composition_counts_predators_by_the_captures_they_took_part_in() -> None:
    captures = [
        instance("pursuer-blocker", "pursuer", "pursuer", "blocker", ""),
        instance("pursuer-blocker", "pursuer", "pursuer", "blocker", ""),
        instance("spiders-fly", "", "pursuer", "blocker", "flanker"),
        instance("spiders-fly", "", "pursuer", "blocker", ""),
        instance("spiders-fly", "", "pursuer", "blocker", ""),
        instance("none", "flanker", "", "", "flanker"),
    ]
    labels = ["pursuer", "pursuer", "non-specialized", "flanker"]
    assert composition(labels, captures) == {
        "entrapment": None,
        "pursuer-blocker": 1,
        "spiders-fly": 1,
        "role-switcher": None,
        "non-specialized": 2,
    }


def test_composition_of_a_team_that_shows_a_behaviour_without_being_specialized_to_it() -> None:
    """Table 4.4's first row: entrapment 0/3, the rest not applicable, 3/3 non-specialized."""
    captures = [instance("entrapment", "pursuer", "pursuer", "pursuer")]
    table = composition(["non-specialized"] * 3, captures)
    assert table["entrapment"] == 0
    assert table["non-specialized"] == 3
    assert [table[name] for name in ("pursuer-blocker", "spiders-fly", "role-switcher")] == [
        None
    ] * 3


def test_composition_without_captures() -> None:
    assert composition(["idle", "pursuer"], []) == dict.fromkeys(COLLECTIVES[:-1]) | {
        "non-specialized": 2
    }
