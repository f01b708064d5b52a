"""Where cells are drawn: panels, places and methods of campaigns with further factors."""

from __future__ import annotations

from itertools import product

from conevo.campaigns.plan import levels_of
from conevo.report.comparison import Cell, Treatment, treatments_of
from conevo.report.sections.arrangement import Arrangement, arrange, factors_of


def arranged(*cells: Cell, by_environment: bool = False) -> Arrangement:
    environments = list(dict.fromkeys(cell.environment for cell in cells))
    treatments = treatments_of(treatment for _, treatment in cells)
    return arrange(
        cells, environments, environments, treatments, "light environment",
        by_environment=by_environment,
    )  # fmt: skip


def two_factors(*environments: str, methods: tuple[str, ...] = ("cone",)) -> list[Cell]:
    return [
        Cell(environment, Treatment(method, f"gst={gst}, mutation_probability={rate}"))
        for environment, method, gst, rate in product(
            environments, methods, ("0.1", "0.2"), ("0.05", "0.2", "0.01")
        )
    ]


def test_levels_may_contain_commas() -> None:
    assert levels_of("") == {}
    assert levels_of("gst=0.1, sizes=[1, 2], prey=a=b") == {
        "gst": "0.1", "sizes": "[1, 2]", "prey": "a=b"
    }  # fmt: skip


def test_in_one_environment_places_are_the_levels_of_the_largest_factor() -> None:
    at = arranged(*two_factors("dark-1"))
    assert at.axis == "mutation probability"
    assert at.places == ["0.01", "0.05", "0.2"]
    assert at.panels == ["gst = 0.1", "gst = 0.2"]
    assert at.where[Cell("dark-1", Treatment("cone", "gst=0.2, mutation_probability=0.05"))] == (
        [1], 1
    )  # fmt: skip
    assert at.is_drawable


def test_in_several_environments_every_combination_has_a_panel() -> None:
    at = arranged(*two_factors("dark-1", "dark-2", methods=("mesp", "cone")))
    assert at.places == ["dark-1", "dark-2"]
    assert at.panels[1] == "gst = 0.1, mutation probability = 0.05"
    assert len(at.panels) == 6
    assert at.methods == ["mesp", "cone"]
    assert len(at.small_panels()) == 12


def test_a_method_without_the_factor_is_in_every_panel_and_has_a_place() -> None:
    plain = Cell("dark-1", Treatment("homcne", ""))
    at = arranged(plain, *two_factors("dark-1"))
    assert at.places == ["0.01", "0.05", "0.2", "–"]
    assert at.where[plain] == ([0, 1], 3)
    curves = arranged(plain, *two_factors("dark-1"), by_environment=True)
    assert all(plain in cells for cells in curves.small_panels().values())
    assert len(curves.panels) == 6


def test_a_factor_of_one_level_is_not_drawn_unless_it_distinguishes_runs() -> None:
    one = Treatment("cone", "gst=0.1")
    assert factors_of([one, Treatment("homcne", "")]) == {}
    assert factors_of([one, Treatment("cone", "")]) == {"gst": ["0.1"]}


def test_the_grid_has_a_gap_for_missing_runs() -> None:
    first, second = Cell("dark-1", Treatment("cone", "")), Cell("dark-2", Treatment("mesp", ""))
    at = arranged(first, second)
    assert at.grid({first: 1, second: 2}, float) == {"": {"mesp": [None, 2.0], "cone": [1.0, None]}}


def test_more_than_eight_panels_or_methods_are_a_table() -> None:
    many = [Cell(e, Treatment("cone", f"gst={k}")) for e in ("dark-1", "dark-2") for k in range(9)]
    assert not arranged(*many).is_drawable
    assert arranged(*many[:9]).is_drawable  # nine places of one panel
    own = [Cell("dark-1", Treatment(f"own-{k}", "")) for k in range(9)]
    assert not arranged(*own).is_drawable
