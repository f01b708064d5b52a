"""A run in words: its state, its generations, its testing phase, and what can be done next."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import click

from conevo.cli.format import (
    castes,
    favourites,
    mean,
    n_finite,
    neurons,
    progress,
    spread,
    table,
)
from conevo.controllers.registry import DEFAULT
from conevo.evolution.methods.registry import title_of
from conevo.numbers import duration, number
from conevo.runs.code import changes_text, last_code, sessions_of
from conevo.runs.outline import Outline
from conevo.runs.provenance import declared
from conevo.runs.records import own_numbers
from conevo.runs.run import Run
from conevo.runs.shrinkage import shrinkage
from conevo.studies.exchange import exchanged, per_generation
from conevo.terms import S_SCALE, SHARE_SCALE, counted, quoted

__all__ = [
    "conditions_text",
    "controlled",
    "exchange_text",
    "generations_table",
    "heading_of",
    "measures_text",
    "next_commands",
    "print_end",
    "run_text",
    "shrinkage_text",
    "spaced",
    "test_text",
    "title",
]


def title(outline: Outline) -> str:
    """Return one line that names a run."""
    method = title_of(outline.method)
    return f"{outline.task}, {method}, preset {outline.preset}, seed {outline.seed}"


def heading_of(run: Run) -> str:
    """Return the title of a run, with its controller if that is not the default one."""
    return title(run.outline) + controlled(run)


def controlled(run: Run) -> str:
    """Return what a title says of a run's controller: nothing if it is the default one."""
    name = run.tables().get("controller", {}).get("name", DEFAULT)
    return f", controller {name}" if name != DEFAULT else ""


def print_end(run: Run, style: str) -> None:
    """Print how a run ended, in the style asked for."""
    if style == "quiet":
        click.echo(run.path)
    elif style == "json":
        end = {"run": str(run.path), "status": run.status, "test": run.test_result}
        click.echo(json.dumps(end))
    elif run.status != "finished":
        click.echo(f"\n{_state(run)}")
    else:
        result = run.test_result or {}
        commands = "\n".join(f"  {command}" for command in next_commands(run))
        click.echo(f"\n{test_text(result)}\n\n{_state(run)}\n\nWhat next:\n{commands}")


def run_text(run: Run, n_rows: int) -> str:
    """Return a finished or unfinished run as text."""
    records = run.generations()
    about = run.provenance
    parts = [heading_of(run), _state(run), *changes_text(sessions_of(about))]
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
    """Return units and directions of the measures of a run, of which conevo 0.1.0 kept nothing."""
    named = ", ".join(measure.heading for measure in declared(about).values())
    return [f"measures: {named}; S: {S_SCALE}"] if named else []


def exchange_text(records: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what the populations of CONE exchanged; nothing of methods that never do."""
    text = per_generation(*exchanged(records))
    return [f"recombined between populations: {text} per generation"] if text else []


def spaced(records: list[dict[str, Any]], n: int) -> list[dict[str, Any]]:
    """Return ``n`` evenly spaced records at most, first and last among them."""
    last = len(records) - 1
    return [records[k] for k in sorted({round(last * k / (n - 1)) for k in range(n)})]


def generations_table(records: list[dict[str, Any]], *lead: str) -> str:
    """Return generations as a table; ``lead`` are entries that stand before a run's own."""
    measures = list(dict.fromkeys(name for one in records for name in one["performance"]))
    head = [*lead, "generation", *measures, "best fitness", "mean fitness", "S", "SST", "GST"]
    own = own_numbers(records)  # of the method
    head += ["recombined", *own, "neurons", "evaluations", "castes of the fittest team"]
    rows = [
        [
            *(str(record[name]) for name in (*lead, "generation")),
            *(number(record["performance"].get(name)) for name in measures),
            number(record["best_fitness"]),
            number(record["mean_fitness"]),
            number(record["specialization"]),
            number(record["sst"]),
            number(record["gst"]),
            str(record["recombinations"]),
            *(number(record.get(name)) for name in own),
            neurons(record["n_hidden"]),
            number(record["team_evaluations"]),
            castes(record["castes"]),
        ]
        for record in records
    ]
    return table(head, rows)


def test_text(result: dict[str, Any]) -> str:
    """Return the testing phase as a table."""
    teams = {name: tested for name, tested in result.items() if name != "validation"}
    some = next(iter(teams.values()))
    n, measures = some["scenarios"], list(some["performance"])
    rows = []
    for name, tested in teams.items():
        mean_s = sum(tested["specialization"]) / len(tested["specialization"])
        rows.append(
            [
                "first fittest team" if name == "generation_0" else "fittest team",
                str(tested["generation"]),
                *(spread(tested["performance"][measure], n) for measure in measures),
                number(mean_s),
            ]
        )
    head = ["", "generation", *measures, "S"]
    lines = [
        f"Testing phase, {counted(n, 'fresh scenario')} (mean +- standard deviation; S: {S_SCALE})",
        table(head, rows),
    ]
    for row, tested in zip(rows, teams.values(), strict=True):
        lines += [f"castes of the {row[0]}: {castes(tested['castes'])}"]
        lines += _favourites_text(f"of the {row[0]}", tested)
    lacking = [
        name
        for name in measures
        if any(n_finite(tested["performance"][name]) < n for tested in teams.values())
    ]
    if lacking:
        lines.append(
            f"warning: {', '.join(lacking)} is not finite in some scenarios; mean and standard "
            f"deviation are of the others (how many, in brackets)"
        )
    if "validation" in result:
        lines += ["", shrinkage_text(result)]
    return "\n".join(lines)


def _favourites_text(of: str, tested: Mapping[str, Any]) -> list[str]:
    """Return the favourite settings of a tested team, of which earlier versions kept nothing."""
    if "favourites" not in tested:
        return []
    shares = [share for share in tested["favourite_shares"] if share is not None]
    sizes = Counter(name for name in tested["favourites"] if name is not None)
    in_order = dict(sorted(sizes.items(), key=lambda one: (-one[1], one[0])))
    liked = favourites(in_order, sum(shares) / len(shares) if shares else None)
    return [f"favourite settings {of}: {liked}; {SHARE_SCALE}"]


def conditions_text(run: Run, both: dict[str, Any]) -> str:
    """Return the test of one team under its own and under changed conditions as a table."""
    n, conditions = both["own"]["scenarios"], both["conditions"]
    measures = list(dict.fromkeys([*both["own"]["performance"], *both["changed"]["performance"]]))
    rows = []
    for name in ("own", "changed"):
        tested = both[name]
        found = tested["performance"]
        mean_s = sum(tested["specialization"]) / len(tested["specialization"])
        cells = [spread(found[one], n) if one in found else "-" for one in measures]
        rows.append([name, str(len(tested["labels"])), *cells, number(mean_s)])
    rows.append(["change", "", *(number(both["change"].get(one)) for one in measures), ""])
    settings = "".join(f", {key}={value}" for key, value in conditions["settings"].items())
    if rotate := conditions["rotate"]:
        equal = ", which are all equal" if conditions["clones"] else ""
        settings += f", controllers rotated by {rotate}{equal}"
    return "\n".join(
        [
            f"Champion of {run.path} (generation {both['own']['generation']}), "
            f"{counted(n, 'fresh scenario')} (mean +- standard deviation)",
            f"own conditions: {run.config.task}",
            f"changed conditions: {conditions['task']}, "
            f"{counted(conditions['robots'], 'robot')}{settings}",
            table(["conditions", "robots", *measures, "S"], rows),
            f"castes, own: {castes(both['own']['castes'])}",
            f"castes, changed: {castes(both['changed']['castes'])}",
            *_favourites_text("under own conditions", both["own"]),
            *_favourites_text("under changed conditions", both["changed"]),
        ]
    )


def shrinkage_text(result: dict[str, Any]) -> str:
    """Return what the champion was chosen by, and how much of it is left in fresh scenarios."""
    about, n_tests = result["validation"], result["champion"]["scenarios"]
    rows = [
        [
            one["measure"],
            number(one["selection"]),
            mean(one["validation"], about["scenarios"]),
            mean(one["test"], n_tests),
            number(one["ratio"]),
        ]
        for one in shrinkage(result)
    ]
    return (
        f"The fittest team (generation {about['chosen']}) is the best of "
        f"{counted(len(about['finalists']), 'finalist')} in "
        f"{counted(about['scenarios'], 'validation scenario')}\n"
        + table(["", "selection", "validation", "test", "test / selection"], rows)
    )


def next_commands(run: Run) -> list[str]:
    """Return the exact commands for what can be done with a finished run, each after a comment."""
    config = run.config
    other = "mesp" if config.method.startswith("cone") else "cone"
    tables = config.tables()
    changes = [
        f" --set {quoted(f'{section}.{key}={tables[section][key]}')}"
        for section, _, key in (name.partition(".") for name in config.changed)
        if section != "method" and key in tables[section]
    ]
    seed = config.run.seed
    world, path = quoted(config.address), quoted(run.path)
    repeat = f"conevo run {world} --method {other} --preset {config.preset} --seed {seed}"
    again = f"conevo run --config {path}/config.toml --seed {seed + 1}"
    commands = {
        f"conevo show {path}": "its generations",
        f"conevo replay {path}": "see its team in the browser",
        f"conevo test {path} --scenarios 100": "test its team in more scenarios",
        f"conevo resume {path} --{_twice_as_long(run)}": "evolve it longer",
    }
    if "origin" not in run.provenance:  # which neither the file nor the options have
        commands[again] = "the same with another seed"
        commands[repeat + "".join(changes)] = "the same with another method"
    return [line for command, what in commands.items() for line in (f"# {what}", command)]


def _twice_as_long(run: Run) -> str:
    """Return the option that continues a finished run for as long as it has been evolved."""
    settings, stopped_by = run.config.run, run.provenance.get("stopped_by")
    if stopped_by == "budget":
        return f"budget-evaluations {2 * settings.budget_evaluations}"
    if stopped_by == "target":
        return "target none"
    return f"generations {2 * settings.generations}"


def _former_ends(run: Run) -> list[str]:
    """Return a line for each time the run was given another length."""
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
    """Return which length the testing phase is of, unless it is the one that the run has now."""
    about = run.provenance
    ends = [former for former in about.get("extended", []) if former["finished"]]
    if not ends or "finished" in about:
        return []
    length = counted(ends[-1]["generations"], "generation")
    return [f"Of the former length, {length}; the new one is tested when it is finished:"]


def _state(run: Run) -> str:
    """Return a run's place, state and cost in two lines."""
    records, about = run.generations(), run.provenance
    state = run.status
    if state == "finished":
        state += f" {about['finished']} (stopped by: {about['stopped_by']})"
        changed = run.changed_files
        state += f"; modified since the run: {', '.join(changed)}" if changed else ""
    planned, budget = run.outline.generations, run.outline.budget_evaluations
    evaluations = records[-1]["team_evaluations"] if records else 0
    done = progress(len(records), planned, evaluations, budget)
    if records:
        seconds = sum(record["seconds"] for record in records)
        done += "" if "evaluations" in done else f", {counted(evaluations, 'team evaluation')}"
        done += f", {records[-1]['team_steps']:,} team-steps, {duration(seconds)}"
    return f"{run.path}: {state}\n{done}"
