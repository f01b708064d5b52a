"""The tables that reports read: all finished runs, as Parquet.

One row per run, score, generation and so on, made by DuckDB from the files of the runs and their
studies. Their columns are ``campaigns.schema.SCHEMA``. All are made again when more is finished.
"""

from __future__ import annotations

import json
import logging
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from conevo.campaigns.ended import read_ended
from conevo.campaigns.paths import Paths
from conevo.campaigns.plan import PlannedRun
from conevo.campaigns.schema import SCHEMA
from conevo.errors import ConevoError, EnvironmentFailure
from conevo.evolution.methods.registry import title_of
from conevo.reading import DamagedFile, read_json
from conevo.runs.code import changes_text, sessions_of
from conevo.runs.directory import as_json
from conevo.runs.drafts import draft_of
from conevo.runs.durable import replace_file, sync_directory, writing
from conevo.runs.outline import Outline, budget_of
from conevo.runs.provenance import describe_world
from conevo.runs.run import Run
from conevo.runs.shrinkage import shrinkage
from conevo.runs.store import Store
from conevo.studies.exchange import exchanged
from conevo.studies.records import SignalStudy, Study
from conevo.typing import Record

if TYPE_CHECKING:
    from conevo.campaigns.campaign import Campaign

__all__ = ["is_sealed", "left_out", "seal_tables", "sealed_tables"]

log = logging.getLogger("conevo")
MANIFEST = "tables.json"
PROVENANCE = ("stopped_by", "run_id", "conevo", "numpy", "warp", "kernel_hash")  # in table runs


def is_sealed(paths: Paths, finished: Sequence[PlannedRun]) -> bool:
    """Whether the tables are those of these runs as they are now, and of no others."""
    path = paths.tables / MANIFEST
    if not all((paths.tables / f"{table}.parquet").is_file() for table in SCHEMA):
        return False
    try:
        if not path.is_file() or read_json(path) != _manifest(finished) | {"left_out": {}}:
            return False
        for part in {part for run in finished for parts in run.courses.values() for part in parts}:
            Store(paths.run(part)).refuse_changed()
    except ConevoError:
        return False
    return True


@contextmanager
def sealed_tables(campaign: Campaign) -> Iterator[Path]:
    """Yield the folder with the tables of all finished runs; it is empty if there are none.

    While the campaign runs they are as its coordinator last made them. If they are out of date and
    cannot be written, as on a read-only file system, they are made in a temporary folder, and the
    reason is logged.

    Raises:
        UsageError: every run is damaged.
        EnvironmentFailure: they cannot be made anywhere.
    """
    with ExitStack() as stack:
        tables = campaign.paths.tables
        if not (campaign.is_running or is_sealed(campaign.paths, campaign.finished)):
            try:
                with campaign.locked():
                    campaign.seal()
            except EnvironmentFailure as error:
                folder = stack.enter_context(TemporaryDirectory(prefix="conevo-"))
                tables = Path(folder) / "tables"
                campaign.seal(tables)
                if tables.is_dir():
                    log.warning("%s; its tables are made for this one use", error)
        yield tables


def seal_tables(
    paths: Paths,
    finished: Sequence[PlannedRun],
    spent: Mapping[str, float],
    into: Path | None = None,
) -> None:
    """Make the tables of these runs, unless they exist.

    A run is left out if its files are damaged, or differ from those that it was sealed with. The
    manifest lists it with the reason, and the next call tries it again. A kill leaves the previous
    tables, or none.

    Args:
        paths: of the campaign.
        finished: its finished runs.
        spent: core seconds by label, as far as the ledger has them.
        into: the folder to make, by default that of the campaign.

    Raises:
        UsageError: every run is damaged.
        EnvironmentFailure: they cannot be written.
    """
    folder = into or paths.tables
    if into is None and is_sealed(paths, finished):
        return
    import duckdb

    with writing(folder), draft_of(folder) as draft:
        draft.mkdir()
        files = {name: (draft / f"{name}.jsonl").open("w", encoding="utf-8") for name in SCHEMA}
        damaged: dict[str, str] = {}
        for planned in finished:
            ended = read_ended(paths.ended(planned.label))  # of a worker without a coordinator, too
            cost = max(spent.get(planned.label, 0.0), ended["core_seconds"] if ended else 0.0)
            try:
                rows = list(_rows(paths, planned, cost))
            except ConevoError as error:
                damaged[planned.label] = str(error)
                continue
            for table, row in rows:
                files[table].write(json.dumps(row, allow_nan=False) + "\n")
        if len(damaged) == len(finished) > 0:
            raise DamagedFile(next(iter(damaged.values())))
        for file in files.values():
            file.close()
        for table, columns in SCHEMA.items():
            source, target = draft / f"{table}.jsonl", draft / f"{table}.parquet"
            duckdb.sql(
                f"COPY (SELECT * FROM read_json({_quoted(source)}, format='newline_delimited', "
                f"columns={columns})) TO {_quoted(target)} (FORMAT parquet, COMPRESSION zstd)"
            )
            source.unlink()
        replace_file(draft / MANIFEST, as_json(_manifest(finished) | {"left_out": damaged}))
        shutil.rmtree(folder, ignore_errors=True)
        draft.rename(folder)
        sync_directory(folder.parent)


def left_out(folder: Path) -> dict[str, str]:
    """Return the damaged runs that the tables in a folder lack, and what is wrong with each."""
    manifest = folder / MANIFEST
    found: dict[str, str] = read_json(manifest)["left_out"] if manifest.is_file() else {}
    return found


def _manifest(finished: Sequence[PlannedRun]) -> Record:
    return {
        "columns": SCHEMA,
        "runs": {run.label: list(run.run_ids) for run in finished},
        "studies": {run.label: list(run.studies) for run in finished},
    }


def _quoted(path: Path) -> str:
    return "'" + str(path).replace("'", "''") + "'"


def _rows(paths: Paths, planned: PlannedRun, cost: float) -> Iterator[tuple[str, Record]]:
    """Yield all rows of a finished run, each with the name of its table."""
    for name, parts in planned.courses.items():
        runs = [Run(paths.run(part)) for part in parts]
        tests = [_tested(run) for run in runs]
        run, provenance = runs[-1], runs[-1].provenance
        records, sessions, before = _joined(runs)
        test = tests[-1] | {"generation_0": tests[0]["generation_0"]}
        world = provenance.get("world") or describe_world(run.config.build_world())  # 0.1.0: none
        measures = world["measures"]
        exchanges, share = exchanged(run.generations())
        yield (
            "runs",
            _run_row(planned, run.outline, world["name"], provenance, records, sessions)
            | {
                "run": name,
                "planned_evaluations": budget_of(one.outline for one in runs) or None,
                "measure": measures[0]["name"],
                "optimum": world["optimum"],
                "n_robots": world["n_robots"],
                "core_seconds": cost / len(planned.courses),
                "exchanges": exchanges,
                "exchange_share": share,
            },
        )
        for one in measures:
            about = {key: one.get(key) for key in ("unit", "larger_is_better", "low", "high")}
            yield "measures", {"run": name, "measure": one["name"]} | about
        for team, title in (("champion", "champion"), ("generation_0", "generation 0")):
            for measure, values in test[team]["performance"].items():
                about = {"run": name, "study": "test", "team": title, "measure": measure}
                for scenario, value in enumerate(values["values"]):
                    yield "scores", about | {"scenario": scenario, "value": value}
        for row in shrinkage(test) if "validation" in test else ():
            yield "champions", _champion_row(name, test["validation"], row, before)
        for record in records:
            yield from _generation_rows(name, record)
        if paths.study(name).is_file():
            yield from _study_rows(name, read_json(paths.study(name), Study))
        if paths.study(name, "signal").is_file():
            for row in read_json(paths.study(name, "signal"), SignalStudy)["signal"]:
                yield "signal", {"run": name} | {k: row[k] for k in SCHEMA["signal"] if k in row}


def _tested(run: Run) -> Record:
    """Return the testing phase of a run, after checking that the run is as it was sealed."""
    test = run.test_result
    if test is None or not run.generations():
        raise DamagedFile(f"{run.path} is sealed, but lacks its generations or its testing phase")
    Store(run.path).refuse_changed()
    return test


def _joined(runs: Sequence[Run]) -> tuple[list[Record], list[Record], int]:
    """Return the generations and sessions of a run, or of its stages as those of one run.

    Generations, team evaluations and team-steps are counted through the stages. The third value
    is the number of generations before the last stage.
    """
    records: list[Record] = []
    sessions: list[Record] = []
    before = 0
    for run in runs:
        before, last = len(records), records[-1] if records else {}
        sessions += map(dict, sessions_of(run.provenance, before))
        for record in run.generations():
            summed = {k: record[k] + last.get(k, 0) for k in ("team_evaluations", "team_steps")}
            records.append(record | summed | {"generation": before + record["generation"]})
    return records, sessions, before


def _run_row(
    planned: PlannedRun,
    run: Outline,
    world: str,
    provenance: Record,
    records: Sequence[Record],
    sessions: Sequence[Record],
) -> Record:
    environment = run.environment
    family, _, number = environment.rpartition("-")
    is_numbered = bool(family) and number.isdecimal()
    return {
        "task": f"{world}/{environment}",
        "world": world,
        "environment": environment,
        "family": family if is_numbered else environment,
        "number": int(number) if is_numbered else 0,
        "method": run.method,
        "title": title_of(run.method),
        "preset": run.preset,
        "seed": run.seed,
        "variant": planned.variant,
        "generations": len(records),
        "evaluations": records[-1]["team_evaluations"],
        "team_steps": records[-1]["team_steps"],
        "seconds": sum(record["seconds"] for record in records),
        "code": ", ".join(dict.fromkeys(one.get("code", "") for one in sessions)),
        "changes": "; ".join(changes_text(sessions)),
    } | {name: provenance[name] for name in PROVENANCE}


def _generation_rows(name: str, record: Record) -> Iterator[tuple[str, Record]]:
    about = {"run": name, "generation": record["generation"]}
    as_recorded = {key: record[key] for key in SCHEMA["generations"] if key in record}
    of_others = {
        "evaluations": record["team_evaluations"],
        "value": next(iter(record["performance"].values())),
        "fitness": record["team_fitness"],
        "hidden": sum(record["n_hidden"]) / len(record["n_hidden"]),
    }
    yield "generations", as_recorded | of_others | about
    for caste, robots in record["castes"].items():
        yield "castes", about | {"caste": caste, "robots": robots}


def _champion_row(name: str, validation: Record, row: Record, before: int) -> Record:
    means = {key: row[key]["mean"] for key in ("validation", "test")}
    about = {"run": name, "generation": before + validation["chosen"]}
    return about | {"finalists": len(validation["finalists"])} | row | means


def _study_rows(name: str, study: Record) -> Iterator[tuple[str, Record]]:
    for metric, value in study["metrics"].items():
        yield "metrics", {"run": name, "metric": metric, "value": value}
    for table in ("scores", "robots", "actions", "behaviours"):
        for row in study[table]:
            yield table, {"run": name} | row
