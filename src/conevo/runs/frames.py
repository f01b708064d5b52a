"""Tables of a run as pandas DataFrames.

conevo does not need pandas: it is imported when a frame is asked for. Columns are flat, as in
``castes.move``. A run without a generation has the same columns and no rows, except for numbers
that a method adds of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from conevo.errors import EnvironmentFailure, unknown_name
from conevo.runs.provenance import describe_world
from conevo.runs.records import own_numbers
from conevo.terms import NON_SPECIALIZED
from conevo.typing import Record

if TYPE_CHECKING:
    from pandas import DataFrame

    from conevo.runs.config import RunConfig
    from conevo.runs.run import Run

__all__ = ["TABLES", "frame_of", "generations_frame", "header_of", "pandas", "typed"]

Columns = dict[str, str]  # name -> dtype
WHOLE, REAL, TEXT = "int64", "float64", "str"
TEAMS = {"champion": "champion", "generation_0": "generation 0"}


def frame_of(run: Run, table: str) -> DataFrame:
    """Return a table of a run, one of ``TABLES``.

    ==============  ================================================================================
    generations     a row per finished generation, from ``Run.generations``. ``n_hidden`` is the
                    mean of the populations, ``favourites.X`` the number of robots that prefer X
    tests           a row per scenario of the testing phase, of the champion and of generation 0's
                    fittest team: the robots' mean fitness, and every measure
    robots          a row per robot of these teams: its caste, S, hidden neurons, and favourite
                    setting with its share, over all scenarios of the testing phase
    finalists       a row per finalist: ``selection`` in the scenarios that it was selected in,
                    ``validation`` the mean over those of validation
    ==============  ================================================================================

    Raises:
        UsageError: no such table.
        EnvironmentFailure: pandas is not installed.
    """
    if table not in TABLES:
        raise unknown_name("table", table, TABLES, "of a run")
    return TABLES[table](run, header_of(run.provenance, lambda: run.config))


def header_of(provenance: Record, config: Callable[[], RunConfig]) -> Record:
    """Return the header of a world; without one, as of conevo 0.1.0, the world is loaded."""
    return provenance.get("world") or describe_world(config().build_world())


def generations_frame(
    records: Sequence[Record], header: Record, before: Columns | None = None
) -> DataFrame:
    """Return the records of generations, a row each.

    Args:
        records: of a run, or of all stages of a shaping.
        header: of the world.
        before: further columns, which come first.
    """
    measures, own = _measures(header), own_numbers(records)
    castes = [*header["castes"], NON_SPECIALIZED]
    columns = (before or {}) | {
        **dict.fromkeys(("generation", "team_evaluations", "type_c_evaluations"), WHOLE),
        "team_steps": WHOLE,
        **dict.fromkeys(("seconds", "best_fitness", "mean_fitness", "team_fitness"), REAL),
        **{f"performance.{name}": REAL for name in measures},
        **{f"castes.{name}": WHOLE for name in castes},
        **{f"favourites.{name}": WHOLE for name in header["castes"]},
        **dict.fromkeys(("favourite_share", "specialization", "sst", "gst"), REAL),
        "recombinations": WHOLE,
        "n_hidden": REAL,
        "n_nonfinite": WHOLE,
        **{name: _kind(one.get(name) for one in records) for name in own},
    }
    rows = [
        {**_flat(one), "n_hidden": sum(one["n_hidden"]) / len(one["n_hidden"])} for one in records
    ]
    return typed(columns, rows)


def _generations(run: Run, header: Record) -> DataFrame:
    return generations_frame(run.generations(), header)


def _tests(run: Run, header: Record) -> DataFrame:
    measures = _measures(header)
    columns = {"team": TEXT, "generation": WHOLE, "scenario": WHOLE, "fitness": REAL}
    columns |= {f"performance.{name}": REAL for name in measures}

    def rows() -> Iterator[Record]:
        for team, test in _tested(run):
            spreads = {"fitness": test["fitness"]}
            spreads |= {f"performance.{name}": test["performance"][name] for name in measures}
            for k in range(test["scenarios"]):
                found = {name: _at(one["values"], k) for name, one in spreads.items()}
                yield {"team": team, "generation": test["generation"], "scenario": k, **found}

    return typed(columns, rows())


def _robots(run: Run, header: Record) -> DataFrame:
    columns = {"team": TEXT, "generation": WHOLE, "robot": WHOLE, "caste": TEXT}
    columns |= {"specialization": REAL, "n_hidden": WHOLE}
    columns |= {"favourite": TEXT, "favourite_share": REAL}

    def rows() -> Iterator[Record]:
        for team, test in _tested(run):
            for k, caste in enumerate(test["labels"]):
                yield {
                    "team": team,
                    "generation": test["generation"],
                    "robot": k,
                    "caste": caste,
                    "specialization": test["specialization"][k],
                    "n_hidden": test["n_hidden"][k],
                    "favourite": _at(test.get("favourites", ()), k),
                    "favourite_share": _at(test.get("favourite_shares", ()), k),
                }

    return typed(columns, rows())


def _finalists(run: Run, header: Record) -> DataFrame:
    names = ["fitness", *(f"performance.{name}" for name in _measures(header))]
    columns = {"generation": WHOLE, "is_champion": "bool"}
    columns |= {f"{phase}.{name}": REAL for phase in ("selection", "validation") for name in names}
    validation = (run.test_result or {}).get("validation", {"chosen": -1, "finalists": []})
    rows = []
    for one in validation["finalists"]:
        spreads = {"fitness": one["validation"]["fitness"]} | one["validation"]["performance"]
        means = {name: found["mean"] for name, found in spreads.items()}
        means = {"fitness": means.pop("fitness"), "performance": means}
        rows.append(
            {
                "generation": one["generation"],
                "is_champion": one["generation"] == validation["chosen"],
                **_flat({"selection": one["selection"], "validation": means}),
            }
        )
    return typed(columns, rows)


TABLES: dict[str, Callable[[Run, Record], DataFrame]] = {
    "generations": _generations,
    "tests": _tests,
    "robots": _robots,
    "finalists": _finalists,
}
"""The functions that return the tables of a run, by name."""


def typed(columns: Columns, rows: Iterable[Record]) -> DataFrame:
    """Return rows as a frame of exactly these columns and types.

    A row without a value is 0 in a column of whole numbers, and has none in others.
    """
    known = list(rows)
    frames = pandas()
    return frames.DataFrame(
        {
            name: frames.Series(
                [_or_zero(row.get(name)) if kind == WHOLE else row.get(name) for row in known],
                dtype=kind,
            )
            for name, kind in columns.items()
        }
    )


def pandas() -> Any:
    """Return the package.

    Raises:
        EnvironmentFailure: it is not installed.
    """
    try:
        import pandas
    except ImportError as error:
        raise EnvironmentFailure(
            "DataFrames need pandas, which is not installed: pip install pandas"
        ) from error
    return pandas


def _tested(run: Run) -> Iterator[tuple[str, Record]]:
    """Yield the tested teams of a finished run, none before."""
    test = run.test_result or {}
    for key, name in TEAMS.items():
        if key in test:
            yield name, test[key]


def _measures(header: Record) -> list[str]:
    return [one["name"] for one in header["measures"]]


def _flat(record: Record, prefix: str = "") -> dict[str, Any]:
    """Return a record without nesting: {"castes": {"move": 2}} has "castes.move"."""
    found: dict[str, Any] = {}
    for name, value in record.items():
        key = f"{prefix}{name}"
        found |= _flat(value, f"{key}.") if isinstance(value, dict) else {key: value}
    return found


def _kind(values: Iterable[Any]) -> str:
    return WHOLE if all(type(value) is int for value in values) else REAL


def _at(values: Sequence[Any], k: int) -> Any:
    """Return the k-th of values, None where earlier versions kept fewer."""
    return values[k] if k < len(values) else None


def _or_zero(value: Any) -> Any:
    return 0 if value is None else value
