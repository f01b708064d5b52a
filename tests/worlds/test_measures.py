"""A measure has a unit and a direction, and targets respect the direction."""

from __future__ import annotations

from pathlib import Path

import pytest

import conevo
from conevo.errors import UsageError
from conevo.worlds.measures import Measure, measures_of
from conevo.worlds.registry import WORLDS

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "light.py"
NEARNESS = 'performance: ClassVar[tuple[str, ...]] = ("nearness",)'
DISTANCE = "performance: ClassVar[tuple[Measure, ...]] = ({measure},)"
IMPORT = "from conevo.worlds.measures import Measure"
SMALLER = {"first_capture", "collisions", "collided"}


def darkness(folder: Path, measure: str) -> str:
    """Write the example world with a distance as its measure, and return its path."""
    text = EXAMPLE.read_text()
    for old, new in (
        (NEARNESS, DISTANCE.format(measure=measure)),
        ("from conevo.worlds.protocol", f"{IMPORT}\nfrom conevo.worlds.protocol"),
        ("+ team.fitness[i] / float(n)", "+ (1.0 - team.fitness[i]) / float(n)"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    (folder / "darkness.py").write_text(text)
    return f"{folder / 'darkness.py'}:dark-1"


@pytest.mark.parametrize("entry", WORLDS.values(), ids=lambda entry: entry.short_name)
def test_every_measure_of_the_package_has_a_unit_and_the_right_direction(entry) -> None:
    for one in measures_of(entry.build(entry.environments[0], entry.params_class())):
        assert one.unit
        assert one.larger_is_better == (one.name not in SMALLER)


def test_a_measure_in_words_and_by_comparison() -> None:
    first = Measure("first_capture", "iterations", larger_is_better=False)
    assert first.heading == "first capture (iterations, smaller is better)"
    assert first.axis == "first capture, iterations"
    assert (first.best([3, 1, 2]), first.is_better(1, 2), first.is_better(2, 2)) == (1, True, False)
    assert [first.reaches(value, 0.5) for value in (0.4, 0.5, 0.6)] == [True, True, False]
    plain = Measure("value")
    assert (plain.heading, plain.axis) == ("value (larger is better)", "value")
    assert (plain.best([3, 1, 2]), plain.is_better(1, 2)) == (3, False)
    assert [plain.reaches(value, 0.5) for value in (0.4, 0.5, 0.6)] == [False, True, True]


def test_a_name_alone_is_a_measure_of_which_larger_is_better() -> None:
    assert measures_of(conevo.world(f"{EXAMPLE}:dark-1")) == (Measure("nearness"),)


@pytest.mark.parametrize(
    ("measure", "words"),
    [
        ('Measure("")', "name must be text"),
        ('Measure("d", unit=3)', "'d': its unit must be text, not 3"),
        ('Measure("d", "m", "down")', "'d': its larger_is_better must be True or False"),
        ("3", "name must be text, not 3"),
        ('Measure("d", low="0")', "'d': its low must be a number: '0'"),
        ('Measure("d", high=float("nan"))', "'d': its high must be a number: nan"),
        ('Measure("d", low=1, high=0)', "'d': low 1 and high 0 must be in this order"),
        ('"d", Measure("d")', "two measures named 'd'"),
    ],
)  # fmt: skip
def test_a_wrong_measure_is_refused(measure: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=words):
        conevo.world(darkness(tmp_path, measure))


def test_a_text_is_not_taken_for_a_tuple_of_letters(tmp_path: Path) -> None:
    path = tmp_path / "light.py"
    path.write_text(EXAMPLE.read_text().replace('= ("nearness",)', '= "nearness"'))
    with pytest.raises(UsageError, match=r"must be a tuple of measures.*not 'nearness'"):
        conevo.world(f"{path}:dark-1")


@pytest.mark.parametrize(("target", "stops"), [(0.01, False), (0.9, True)])
def test_a_run_ends_when_a_distance_is_at_most_the_target(
    target: float, stops: bool, tmp_path: Path
) -> None:
    path = darkness(tmp_path, 'Measure("distance", "sides", larger_is_better=False)')
    run = conevo.evolve(
        path, "homcne", "smoke", out=tmp_path / "run",
        overrides={"run.generations": 3, "run.target": target, "world.iterations": 10,
                   "run.n_tests": 2},
    )  # fmt: skip
    reached = [record["performance"]["distance"] for record in run.generations()]
    assert run.provenance["stopped_by"] == ("target" if stops else "generations")
    assert len(reached) == (1 if stops else 3)
    assert (reached[-1] <= target) == stops
