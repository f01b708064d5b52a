"""``conevo signal``: how well the trials of a method distinguish its genotypes."""

from __future__ import annotations

import json
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conevo.cli.options import Order, settings_only
from conevo.cli.run_to_end import device_option, threads_option
from conevo.errors import UsageError

if TYPE_CHECKING:
    from conevo.runs.config import RunConfig
    from conevo.runs.run import Run

__all__ = ["signal"]


@click.command()
@click.argument("what", metavar="RUN|WORLD/ENVIRONMENT", required=False)
@settings_only
@click.option(
    "--units", type=click.IntRange(2, 1_000_000), metavar="N",
    help="Genotypes tried of each population, or of neurons each sub-population (default: 20; of a "
    "single population 3 for every robot, at least 20; with elite partners 5).",
)  # fmt: skip
@click.option(
    "--trials", type=click.IntRange(2, 10_000), metavar="N", default=50, show_default=True,
    help="Trials of each genotype.",
)  # fmt: skip
@threads_option
@device_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def signal(
    what: str | None,
    units: int | None,
    trials: int,
    threads: int | None,
    device: str | None,
    as_json: bool,
    **settings: Any,
) -> None:
    """Measure the signal of a method: the share of a fitness that is the genotype's own.

    With WORLD/ENVIRONMENT, it measures the initial populations of a run with these settings; with
    RUN (finished or not), its initial and its last populations. Nothing is written.

    The same genotypes (neurons of MESP and CONE, networks of CCGA and HetCNE, clone teams of
    HomCNE) are tried repeatedly, with different partners and in different scenarios. The output is
    the intra-class correlation with its standard error: 0 if a trial contains no information about
    genotypes, 1 if one trial is enough. The reliability is that of a genotype's mean over the
    trials that the method gives it, by Spearman-Brown.

    Each trial of all genotypes takes N team evaluations (--units), for one population or many:
    usually 1,000 to 3,000 in all, and twice that for a RUN. Where partners come from an elite
    (method.partners), it takes N for each population or sub-population: up to 50,000. The number is
    printed first.

    Try: conevo signal rover/complex-5 --method ccga
    """
    from conevo.runs.run import Run
    from conevo.studies.signal import measure_signal

    def announce(price: str) -> None:
        click.echo(price, err=as_json)

    if what is not None and _is_run(what):
        of: Run | RunConfig = _found(what, settings)
    else:
        order = Order(**settings, device=device or "cpu")
        of, device = order.resolve(what), order.device
    with ExitStack() as stack:
        bars: list[Any] = []

        def advance(done: int, total: int) -> None:
            if not bars:
                bar = click.progressbar(length=total, label="trials", file=sys.stderr)
                bars.append(stack.enter_context(bar))
            bars[0].update(done - bars[0].pos)

        found = measure_signal(
            of,
            units,
            trials,
            threads=threads,
            device=device,
            announce=announce,
            advance=advance if sys.stderr.isatty() else None,
        )
    if isinstance(of, Run):
        found = {"run": str(of.path)} | found
    click.echo(json.dumps(found) if as_json else _text(found))


def _is_run(what: str) -> bool:
    """Whether this is a run: a directory, or a name without a slash that is not a world's."""
    from conevo.runs.run import RUNS
    from conevo.worlds.families import is_task
    from conevo.worlds.registry import WORLDS

    if Path(what).is_dir() or what.startswith(f"{RUNS}/"):
        return True
    worlds = {name for entry in WORLDS.values() for name in (entry.name, entry.short_name)}
    return not ("/" in what or ".py" in what or is_task(what) or what in worlds)


def _found(what: str, settings: dict[str, Any]) -> Run:
    """Return a run; options with settings are refused."""
    from conevo.cli.lookup import find_run
    from conevo.cli.test import note_other_code

    names = {"settings": "--set"}
    for name, value in settings.items():
        if value not in (None, ()):
            raise UsageError(
                f"{names.get(name, f'--{name}')} belongs to WORLD/ENVIRONMENT; the run {what} has "
                f"its own settings"
            )
    run = find_run(what)
    note_other_code(run)
    return run


def _text(found: dict[str, Any]) -> str:
    from conevo.cli.format import table
    from conevo.evolution.methods.registry import title_of
    from conevo.numbers import number, plus_minus
    from conevo.studies.repeatability import has_signal
    from conevo.terms import counted

    rows = found["signal"]
    head = ["generation", "ICC of a trial", "trials", "reliability", "95 % interval"]
    cells = [
        [
            str(row["number"]),
            plus_minus(row["icc"], row["standard_error"], "+-"),
            str(row["scheme"]),
            number(row["icc_of_scheme"], 3),
            "-"
            if row["low_of_scheme"] is None
            else f"{row['low_of_scheme']:.3f} to {row['high_of_scheme']:.3f}",
            number(row["rounds_for_half"]),
        ]
        for row in rows
    ]
    lines = [
        "",
        f"{found['task']}, {title_of(found['method'])}: fitness of a {rows[0]['unit']}",
        table([*head, "rounds for .5"], cells),
    ]
    if not any(has_signal(row["icc_of_scheme"]) for row in rows):
        lines.append("\nNo signal: selection among these genotypes is nearly blind.")
    for row in rows:
        if row["left_out"]:
            left = counted(row["left_out"], "genotype")
            lines.append(f"Generation {row['number']}: {left} left out, with no finite fitness.")
    return "\n".join(lines)
