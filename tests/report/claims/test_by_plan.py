"""Claims that need their own plans: changed settings, direct evolution and shaping."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import duckdb
import pytest

from conevo.campaigns.plan_file import read_preset
from conevo.campaigns.tables import Tables
from conevo.report.claims import CLAIMS, Verdict, verdicts
from report.claims.known_truth import METHODS, TRUTHS, Cell, Truth, write_tables

BY_ID = {claim.id: claim for claim in CLAIMS}
SETTINGS = {
    "R22": ("rover", "rover-sensitivity", "med_range", (0.035, 0.05, 0.065), 0.25),
    "P15": ("pursuit", "pursuit-sensitivity", "sensor_range_cm", (17.6, 22.0, 26.4), 0.15),
    "G14": ("gacc", "gacc-sensitivity", "object_range", (0.04, 0.05, 0.06), 0.09),
}


def merged(folder: Path, parts: list[Path]) -> Path:
    """Put the tables of several campaigns together."""
    folder.mkdir()
    for file in parts[0].glob("*.parquet"):
        some = [str(part / file.name) for part in parts if (part / file.name).is_file()]
        duckdb.sql(f"COPY (FROM read_parquet({some})) TO '{folder / file.name}' (FORMAT parquet)")
    return folder


def judged(folder: Path, identity: str) -> dict[str, Verdict]:
    """Return the verdicts of a claim, by the levels concerned."""
    with Tables(folder) as tables:
        return {one.variant: one for one in verdicts(tables, [BY_ID[identity]])}


def changed(
    folder: Path, identity: str, name: str, levels: tuple[float, ...], factors: tuple[float, ...]
) -> dict[str, Verdict]:
    """Judge runs at levels of a setting, whose performance is multiplied by a factor at each."""
    world, make = TRUTHS[BY_ID[identity].world]
    place = BY_ID[identity].parts[0].statements[0].environments[0]
    parts = []
    for level, factor in zip(levels, factors, strict=True):
        truth: Truth = {
            (place, m): Cell(factor * cell.value) for m in METHODS for cell in [make()[place, m]]
        }
        parts.append(
            write_tables(
                folder / str(level),
                world,
                truth,
                n=10,
                noise=0.02,
                variant=f"{name}={level}",
                studies=False,
            )
        )
    return judged(merged(folder / "all", parts), identity)


@pytest.mark.parametrize("identity", SETTINGS)
def test_a_setting_that_changes_little_and_one_that_changes_much(
    identity: str, tmp_path: Path
) -> None:
    _, _, name, levels, most = SETTINGS[identity]
    found = changed(tmp_path, identity, name, levels, (1 - most / 2, 1.0, 1 + 2 * most))
    low, usual, high = (found[f"{name}={level}"] for level in levels)
    assert low.verdict == "reproduced"
    assert low.cells[0].estimate is not None
    assert low.cells[0].estimate.value == pytest.approx(-most / 2)
    assert high.verdict == "not reproduced"
    assert usual.verdict == "undecided: no runs of changed and unchanged settings"
    assert usual.n == "0"


@pytest.mark.parametrize("identity", SETTINGS)
def test_between_little_and_much_is_undecided(identity: str, tmp_path: Path) -> None:
    _, _, name, levels, most = SETTINGS[identity]
    found = changed(tmp_path, identity, name, levels, (1 - most, 1.0, 1 + most))
    assert found[f"{name}={levels[0]}"].verdict == "undecided: n too small"


@pytest.mark.parametrize(
    ("name", "levels", "is_told"),
    [
        ("mutation_probability", (0.04, 0.05, 0.06), True),
        ("mutation_probability", (0.035, 0.05, 0.065), False),  # of learning a fifth
        ("med_range", (0.035, 0.05, 0.065), True),
        ("med_range", (0.03, 0.05, 0.07), False),
        ("epochs", (3, 4, 5), True),
        ("epochs", (2, 4, 6), False),
        ("gst", (0.1, 0.2), False),  # nothing in between
    ],
)
def test_only_changes_made_by_the_thesis_are_judged(
    name: str, levels: tuple[float, ...], is_told: bool, tmp_path: Path
) -> None:
    found = changed(tmp_path, "R22", name, levels, (1.0,) * len(levels))
    assert (found[f"{name}={levels[0]}"].n != "0") == is_told


@pytest.mark.parametrize("identity", SETTINGS)
def test_the_plan_named_by_a_claim_can_be_judged(identity: str) -> None:
    claim = BY_ID[identity]
    world, plan, name, levels, _ = SETTINGS[identity]
    assert plan in claim.caution
    factors = read_preset(plan).factors
    (place,) = claim.parts[0].statements[0].environments
    assert factors["world"] == (f"{world}/{place}",)
    assert set(factors["method"]) == set(METHODS)
    assert factors[f"world.{name}"] == levels


def place_of(task: str) -> str:
    return task.rpartition("/")[2]


def shaping(folder: Path, truth: Truth, direct: Truth) -> Verdict:
    """Judge runs that learned the environments in turn, and others that learned each separately."""
    parts = [
        write_tables(folder / "shaped", "gacc-v2", truth, n=10, studies=False),
        write_tables(folder / "direct", "gacc-v2", direct, n=10, studies=False),
    ]
    return judged(merged(folder / "all", parts), "G12")[""]


def test_direct_evolution_and_shaping(tmp_path: Path) -> None:
    truth = {key: cell for key, cell in TRUTHS["gacc"][1]().items() if key[0][:7] == "complex"}
    truth = {(e, m): cell for (e, m), cell in truth.items() if m in METHODS}
    direct = {
        key: dataclasses.replace(cell, stage=0, value=cell.value / 4)
        for key, cell in truth.items()
        if key[0] not in ("complex-1", "complex-9")
    }
    found = shaping(tmp_path / "a", truth, direct)
    assert found.verdict == "reproduced"
    assert "a stage of" in found.budget
    direct["complex-5", "mesp"] = dataclasses.replace(direct["complex-5", "mesp"], value=0.9)
    wrong = shaping(tmp_path / "b", truth, direct)
    assert wrong.verdict == "not reproduced"
    assert "complex-5 delivered after shaping, MESP - delivered directly, MESP" in wrong.why
    few = {key: cell for key, cell in direct.items() if key[0] == "complex-2"}
    assert shaping(tmp_path / "c", truth, few).verdict == "undecided: 1 of 7 environments"


def test_the_plan_of_direct_evolution_has_the_environments_of_the_claim() -> None:
    claim = BY_ID["G12"]
    assert "gacc-shaping" in claim.caution
    runs = read_preset("gacc-shaping").at(seeds=1).write_out()
    direct = {(place_of(run.world), run.method) for run in runs if not run.shape}
    turn = {(place_of(task), run.method) for run in runs if run.shape for task in run.tasks}
    asked = {
        (place, method)
        for statement in claim.parts[0].statements
        for place in statement.environments
        for method in statement.samples[0].methods
    }
    assert direct == asked
    assert asked < turn
