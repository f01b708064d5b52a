"""A run as text: its state, its generations and its testing phase."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from conevo.cli.format import castes, neurons, progress, table
from conevo.cli.testing_text import test_text
from conevo.controllers.registry import DEFAULT
from conevo.evolution.methods.registry import title_of
from conevo.numbers import duration, number
from conevo.runs.code import changes_text, last_code, sessions_of
from conevo.runs.outline import Outline
from conevo.runs.provenance import declared
from conevo.runs.records import own_numbers
from conevo.runs.run import Run
from conevo.runs.shaping import Shaping
from conevo.studies.exchange import exchanged, has_exchange, per_generation
from conevo.terms import S_SCALE, counted, quoted

__all__ = [
    "controlled",
    "exchange_text",
    "generations_table",
    "heading_of",
    "measures_text",
    "run_text",
    "seal_text",
    "spaced",
    "state_text",
    "title",
]

EXCHANGE = {"sst": "SST", "gst": "GST", "recombinations": "recombined"}


def title(outline: Outline) -> str:
    """Return one line that names a run."""
    method = title_of(outline.method)
    return f"{outline.task}, {method}, preset {outline.preset}, seed {outline.seed}"


def heading_of(run: Run) -> str:
    """Return the title of a run, with its controller if that is not the default one."""
    return title(run.outline) + controlled(run)


def controlled(run: Run) -> str:
    """Return the part of a title that names a run's controller: empty for the default one."""
    name = run.tables().get("controller", {}).get("name", DEFAULT)
    return f", controller {name}" if name != DEFAULT else ""


def run_text(run: Run, n_rows: int) -> str:
    """Return a finished or unfinished run as text."""
    records = run.generations()
    about = run.provenance
    parts = [heading_of(run), state_text(run), *changes_text(sessions_of(about))]
    if changed := about.get("changed"):
        parts.append(f"changed from preset {run.outline.preset}: {', '.join(changed)}")
    if records:
        parts += [*exchange_text(records), *measures_text(about)]
        parts += ["", generations_table(spaced(records, n_rows))]
    if run.test_result:
        parts += ["", *_former_test(run), test_text(run.test_result)]
    if origin := about.get("origin"):
        what = "Bred from the champion" if origin.get("of") else "Started from the populations"
        here = last_code(about)
        made = origin.get("code", here)
        other = f" (made by {made}, this run by {here})" if made != here else ""
        parts += ["", f"{what} of {origin['path']}, generation {origin['generation']}{other}"]
    if lines := _former_ends(run):
        parts += ["", *lines]
    if run.status == "interrupted":
        parts += ["", f"Continue it with: conevo resume {quoted(run.path)}"]
    return "\n".join(parts)


def measures_text(about: Mapping[str, Any]) -> list[str]:
    """Return units and directions of a run's measures; conevo 0.1.0 recorded none."""
    named = ", ".join(measure.heading for measure in declared(about).values())
    return [f"measures: {named}; S: {S_SCALE}"] if named else []


def exchange_text(records: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the exchange between populations of CONE as text; nothing for other methods."""
    text = per_generation(*exchanged(records))
    return [f"recombined between populations: {text} per generation"] if text else []


def spaced(records: list[dict[str, Any]], n: int) -> list[dict[str, Any]]:
    """Return at most ``n`` evenly spaced records, including the first and the last."""
    last = len(records) - 1
    return [records[k] for k in sorted({round(last * k / (n - 1)) for k in range(n)})]


def generations_table(records: list[dict[str, Any]], *lead: str) -> str:
    """Return generations as a table; ``lead`` are the keys of its first columns.

    Only methods with an exchange between populations have columns for it.
    """
    measures = list(dict.fromkeys(name for one in records for name in one["performance"]))
    own = [*(EXCHANGE if has_exchange(records) else ()), *own_numbers(records)]  # of the method
    head = [*lead, "generation", *measures, "best fitness", "mean fitness", "S"]
    head += [EXCHANGE.get(name, name) for name in own]
    head += ["neurons", "evaluations", "castes of the fittest team"]
    rows = [
        [
            *(str(record[name]) for name in (*lead, "generation")),
            *(number(record["performance"].get(name)) for name in measures),
            number(record["best_fitness"]),
            number(record["mean_fitness"]),
            number(record["specialization"]),
            *(number(record.get(name)) for name in own),
            neurons(record["n_hidden"]),
            number(record["team_evaluations"]),
            castes(record["castes"]),
        ]
        for record in records
    ]
    return table(head, rows)


def _former_ends(run: Run) -> list[str]:
    """Return a line for each change of the run's length."""
    return [
        f"Length changed {former['at']}: before, {counted(former['generations'], 'generation')}, "
        + (
            f"finished {former['finished']} (stopped by: {former['stopped_by']})"
            if former["finished"]
            else "not finished"
        )
        + f", run {former['run_id']}"
        for former in run.provenance.get("extended", [])
    ]


def _former_test(run: Run) -> list[str]:
    """Return a note that the testing phase is of a former length, if it is."""
    about = run.provenance
    ends = [former for former in about.get("extended", []) if former["finished"]]
    if not ends or "finished" in about:
        return []
    length = counted(ends[-1]["generations"], "generation")
    return [f"Of the former length, {length}; the new one is tested when it is finished:"]


def seal_text(found: Run | Shaping) -> str:
    """Return the names of files that were modified or are gone since the seal, "" without any."""
    changed = found.changed_files
    missing = [name for name in changed if not (found.path / name).is_file()]
    kinds = {
        "modified since the run": [name for name in changed if name not in missing],
        "missing": missing,
    }
    return "".join(f"; {kind}: {', '.join(names)}" for kind, names in kinds.items() if names)


def state_text(run: Run) -> str:
    """Return a run's directory, state and cost in two lines."""
    records, about = run.generations(), run.provenance
    state = run.status
    if state == "finished":
        state += f" {about['finished']} (stopped by: {about['stopped_by']})"
        state += seal_text(run)
    planned, budget = run.outline.generations, run.outline.budget_evaluations
    evaluations = records[-1]["team_evaluations"] if records else 0
    done = progress(len(records), planned, evaluations, budget)
    if records:
        seconds = sum(record["seconds"] for record in records)
        done += "" if "evaluations" in done else f", {counted(evaluations, 'team evaluation')}"
        done += f", {records[-1]['team_steps']:,} team-steps, {duration(seconds)}"
    return f"{run.path}: {state}\n{done}"
