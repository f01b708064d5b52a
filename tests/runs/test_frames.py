"""Tables of a run as DataFrames: the contents of the records, typed and flat."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import conevo
from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs.frames import TABLES
from conevo.runs.start import start
from runs.tiny import TASK, evolve_tiny, tiny_settings

pandas = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> conevo.Run:
    return evolve_tiny(tmp_path_factory.mktemp("frames") / "run")


@pytest.fixture(scope="module")
def unbegun(tmp_path_factory: pytest.TempPathFactory) -> conevo.Run:
    from conevo.runs.config import resolve

    config = resolve(TASK, "cone", "smoke", overrides=tiny_settings("cone"))
    return start(config, tmp_path_factory.mktemp("frames") / "unbegun", threads=1)


def test_generations_are_flat_and_typed(run: conevo.Run) -> None:
    frame, records = run.frame(), run.generations()
    assert frame["generation"].tolist() == [0, 1, 2, 3, 4]
    castes = [name for name in frame if name.startswith("castes.")]
    assert castes == [f"castes.{c}" for c in ("low", "med", "hi", "move", "non-specialized")]
    for row, record in zip(frame.to_dict("records"), records, strict=True):
        assert row["performance.value"] == record["performance"]["value"]
        assert {c[7:]: row[c] for c in castes if row[c]} == record["castes"]
        assert row["n_hidden"] == sum(record["n_hidden"]) / len(record["n_hidden"])
        assert row["sst"] == record["sst"]
    assert (frame[castes].sum(axis=1) == 3).all()
    assert not any(frame.map(lambda value: isinstance(value, dict | list)).any())
    kinds = frame.dtypes.astype(str)
    assert set(kinds[castes]) == {kinds["team_evaluations"]} == {"int64"}
    assert {kinds["seconds"], kinds["performance.area"], kinds["gst"]} == {"float64"}


def test_a_number_that_is_not_finite_is_missing(run: conevo.Run) -> None:
    from conevo.runs.frames import generations_frame

    header, record = run.provenance["world"], run.generations()[0]
    record = record | {"best_fitness": None, "sst": None, "step": 2, "odd": None}
    frame = generations_frame([record, record | {"odd": 0.5}], header)
    assert frame[["best_fitness", "sst"]].isna().all(axis=None)
    assert frame["step"].tolist() == [2, 2]
    assert frame["step"].dtype == "int64"
    assert frame["odd"].isna().tolist() == [True, False]


def test_numbers_of_a_method_are_columns_even_if_a_generation_lacks_them(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run", "cone-es")
    frame, records = run.frame(), run.generations()
    assert "individual_share" not in records[0]
    share = [record.get("individual_share") for record in records]
    assert frame["individual_share"].isna().tolist() == [value is None for value in share]
    assert frame["individual_share"].tolist()[-1] == share[-1]


def test_tests_and_robots_are_those_of_the_testing_phase(run: conevo.Run) -> None:
    tests, robots, result = run.frame("tests"), run.frame("robots"), run.test_result
    assert result is not None
    for key, team in (("champion", "champion"), ("generation_0", "generation 0")):
        of = tests[tests["team"] == team]
        assert of["scenario"].tolist() == [0, 1, 2]
        assert of["performance.area"].tolist() == result[key]["performance"]["area"]["values"]
        assert of["fitness"].mean() == pytest.approx(result[key]["fitness"]["mean"])
        of = robots[robots["team"] == team]
        assert of["robot"].tolist() == [0, 1, 2]
        assert of["caste"].tolist() == result[key]["labels"]
        assert of["specialization"].tolist() == result[key]["specialization"]
        liked = of["favourite"].astype(object).where(of["favourite"].notna(), None)
        assert liked.tolist() == result[key]["favourites"]


def test_one_finalist_is_the_champion(run: conevo.Run) -> None:
    frame, champion = run.frame("finalists"), run.champion
    assert champion is not None
    assert frame["is_champion"].dtype == bool
    assert frame.loc[frame["is_champion"], "generation"].tolist() == [champion.generation]
    assert run.test_result is not None
    finalists = run.test_result["validation"]["finalists"]
    for column, phase in (("selection", "selection"), ("validation", "validation")):
        values = [one[phase]["performance"]["value"] for one in finalists]
        means = [v if phase == "selection" else v["mean"] for v in values]
        assert frame[f"{column}.performance.value"].tolist() == means


@pytest.mark.parametrize("table", TABLES)
def test_a_run_without_a_generation_has_the_same_columns(
    run: conevo.Run, unbegun: conevo.Run, table: str
) -> None:
    empty, full = unbegun.frame(table), run.frame(table)
    assert (len(empty), len(full) > 0) == (0, True)
    assert empty.dtypes.to_dict() == full.dtypes.to_dict()


def test_an_unknown_table_and_a_missing_pandas_are_one_line(
    run: conevo.Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(UsageError, match=r"unknown table 'test' of a run; did you mean 'tests'\?"):
        run.frame("test")
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(EnvironmentFailure, match=r"DataFrames need pandas, .* pip install"):
        run.frame()
    assert len(run.generations()) == 5


def test_a_shaping_shows_the_stage_of_every_generation(tmp_path: Path) -> None:
    from conevo.runs.shaping import start_shaping

    tasks = ["rover/complex-1", "rover/complex-2"]
    small = tiny_settings("homcne", run__generations=2)
    shaping = start_shaping(tasks, "homcne", "smoke", out=tmp_path / "s", overrides=small)
    empty = shaping.frame()
    frame = shaping.resume(threads=1).frame()
    assert frame["number"].tolist() == [0, 1, 2, 3]
    assert frame["stage"].tolist() == [1, 1, 2, 2]
    assert frame["task"].tolist() == ["rover-v2/complex-1"] * 2 + ["rover-v2/complex-2"] * 2
    assert empty.dtypes.to_dict() == frame.dtypes.to_dict()
