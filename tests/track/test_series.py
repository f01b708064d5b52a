"""Rows of a run as trackers get them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from conevo.errors import UsageError
from conevo.track.series import Series
from runs.tiny import evolve_tiny
from watch.followed import append, configure, locked, record, write_run, write_shaping

CREATED = {"created": "2026-01-01T00:00:00+00:00"}
MIDNIGHT = 1767225600.0
WORLD = {
    "name": "rover-v2",
    "environment": "complex-1",
    "measures": [{"name": "value", "unit": "points", "larger_is_better": True}],
    "castes": ["low", "hi"],
    "n_robots": 3,
    "iterations": 10,
    "optimum": None,
}


def test_a_row_has_the_numbers_of_a_generation_at_its_team_steps(tmp_path: Path) -> None:
    path = write_run(tmp_path / "run", 0, about=CREATED | {"world": WORLD})
    append(path, record(0, own=2.5, sst=None, castes={"low": 3}, performance={"value": 7.0}))
    append(path, record(1))
    first, second = Series(path).read()
    assert (first.step, first.at) == (1000, MIDNIGHT + 2)
    assert (second.step, second.at) == (2000, MIDNIGHT + 4)
    assert first.values == {
        "generation": 0,
        "team_evaluations": 100,
        "team_steps": 1000,
        "seconds": 2,
        "best_fitness": 20,
        "mean_fitness": 5,
        "team_fitness": 10,
        "performance/value": 7,
        "castes/low": 3,
        "castes/hi": 0,
        "castes/non-specialized": 0,
        "favourites/low": 2,
        "favourites/hi": 1,
        "favourite_share": 0.75,
        "specialization": 0.25,
        "gst": 0.2,
        "recombinations": 0,
        "n_hidden": 10,
        "n_nonfinite": 0,
        "own": 2.5,
    }


def test_a_torn_last_line_waits_until_it_is_whole(tmp_path: Path) -> None:
    path = write_run(tmp_path / "run", 2, torn='{"generation": 2, "te')
    series = Series(path)
    assert [row.step for row in series.read()] == [1000, 2000]
    assert series.read() == []
    log = path / "generations.jsonl"
    log.write_text(log.read_text().removesuffix('{"generation": 2, "te'))
    append(path, record(2))
    assert [row.step for row in series.read()] == [3000]


def test_generations_that_a_resumed_run_repeats_are_not_returned_again(tmp_path: Path) -> None:
    path = write_run(tmp_path / "run", 3)
    series = Series(path)
    assert len(series.read()) == 3
    log = path / "generations.jsonl"
    lines = log.read_text().splitlines(keepends=True)
    (path / "cut").write_text("".join(lines[:1]))
    (path / "cut").replace(log)  # as a resumed run does, whose checkpoint is older than its log
    assert series.read() == []
    append(path, *(record(k) for k in range(1, 5)))
    assert [row.values["generation"] for row in series.read()] == [3, 4]


def test_stages_of_a_shaping_are_one_series(tmp_path: Path) -> None:
    path = write_shaping(tmp_path / "shaped", [(2, 2), (3, 1), (3, None)])
    series = Series(path)
    rows = series.read()
    assert [row.step for row in rows] == [1000, 2000, 3000]
    assert [row.values["generation"] for row in rows] == [0, 1, 2]
    assert [row.values["stage"] for row in rows] == [1, 1, 2]
    append(path / "stage-2", record(1))
    assert [(row.step, row.values["stage"]) for row in series.read()] == [(4000, 2)]
    assert series.about.tags["task"] == "rover-v2/complex-1 to complex-3"
    assert not series.is_written
    with locked(path / "stage-2"):
        assert series.is_written


def test_a_shaping_may_be_followed_before_it_begins(tmp_path: Path) -> None:
    path = write_shaping(tmp_path / "shaped", [(2, None)])
    series = Series(path)
    assert series.read() == []
    write_run(path / "stage-1", 1, generations=2)
    assert len(series.read()) == 1


@pytest.mark.parametrize("how", ["removed", "replaced by another"])
def test_a_run_that_goes_while_it_is_read_is_noticed(tmp_path: Path, how: str) -> None:
    path = write_run(tmp_path / "run", 1)
    series = Series(path)
    series.read()
    path.rename(tmp_path / "elsewhere")
    if how != "removed":
        write_run(path, 3)
    with pytest.raises(UsageError, match=f"run was {how} while it was read"):
        series.read()


def test_rows_before_a_damaged_line_are_returned_first(tmp_path: Path) -> None:
    path = write_run(tmp_path / "run", 1)
    append(path, torn='{"generation": 7}\n')
    series = Series(path)
    assert len(series.read()) == 1
    with pytest.raises(UsageError, match=r"run: generations\.jsonl is damaged in line 2"):
        series.read()


def test_an_id_is_that_of_settings_and_code(tmp_path: Path) -> None:
    def id_of(path: Path) -> str:
        return Series(path).about.id

    run = write_run(tmp_path / "run", 1, about={"stem_id": "a" * 12, "code": "one"})
    shutil.copytree(run, tmp_path / "copy")
    assert id_of(tmp_path / "copy") == id_of(run)
    before = id_of(run)
    configure(run, {"stem_id": "a" * 12, "code": "one", "run_id": "f" * 12}, generations=20)
    assert id_of(run) == before  # extended
    origin = {"path": "x", "run_id": "0" * 12, "generation": 1, "checkpoint": "0" * 32}
    others = [
        write_run(tmp_path / name, 1, about={"stem_id": "a" * 12, "code": "one"} | about)
        for name, about in (
            ("settings", {"stem_id": "b" * 12}),
            ("code", {"code": "other"}),
            ("origin", {"origin": origin}),
        )
    ]
    assert len({before, *map(id_of, others)}) == 4


def test_the_test_of_a_finished_run_is_that_of_its_champion(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run", run__generations=1)
    series = Series(run.path)
    champion = run.test_result["champion"]
    assert series.is_finished
    assert series.test() == {
        "test/fitness": champion["fitness"]["mean"],
        "test/value": champion["performance"]["value"]["mean"],
        "test/area": champion["performance"]["area"]["mean"],
    }
    (row,) = series.read()
    (line,) = run.generations()
    assert row.step == line["team_steps"]
    assert row.values["performance/value"] == line["performance"]["value"]
    assert Series(write_run(tmp_path / "other", 1)).test() == {}
