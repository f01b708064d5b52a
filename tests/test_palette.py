"""A method has one colour in all figures; a caste has that of its replay."""

from itertools import combinations
from pathlib import Path

from conevo import palette
from conevo.evolution.methods.registry import METHODS
from conevo.worlds.outside import load
from conevo.worlds.registry import WORLDS, colours_of


def test_every_method_of_the_registry_has_its_own_look() -> None:
    assert set(palette.METHODS) == set(METHODS)
    for parts in zip(*palette.METHODS.values(), strict=True):
        assert len(set(parts)) == len(METHODS)


def test_a_look_does_not_depend_on_what_else_is_drawn() -> None:
    everything = palette.method_looks([*METHODS, "annealing"])
    for names in combinations([*METHODS, "annealing"], 2):
        assert palette.method_looks(names) == {name: everything[name] for name in names}


def test_methods_from_elsewhere_never_share_a_look() -> None:
    names = [f"method-{k}" for k in range(12)]
    looks = palette.method_looks([*METHODS, *names])
    assert len({look.line for look in looks.values()}) == len(METHODS) + 12
    assert palette.method_looks(reversed(names)) == {name: looks[name] for name in names}


def test_castes_have_the_colours_of_a_replay_and_unknown_ones_others() -> None:
    rover = palette.caste_colours(colours_of("rover-v2"), ["hi", "idle"])
    assert rover == palette.caste_colours(colours_of("rover"), ["idle"])
    assert list(rover) == ["low", "med", "hi", "move", "idle", "non-specialized"]
    assert len(set(rover.values())) == 6
    for entry in WORLDS.values():
        assert set(colours_of(entry.name)) == set(entry.world_class.castes) - {"non-specialized"}
    assert colours_of("light-v1") == {}


def test_a_world_without_a_module_of_drawing_has_its_declared_colours(monkeypatch):
    ball = load(Path(__file__).parents[1] / "examples" / "ball.py")
    monkeypatch.setitem(WORLDS, ball.name, ball)  # as if it belonged to the package
    assert colours_of("ball") == {"rest": "#9a9aa5", "push": "#d55e00"}
