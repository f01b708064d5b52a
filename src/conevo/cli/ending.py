"""The end of a run or a shaping: its results, and commands to use them."""

from __future__ import annotations

import json

import click

from conevo.cli.run_text import state_text
from conevo.cli.shaping_text import shaping_text, stage_summary
from conevo.cli.testing_text import test_text
from conevo.runs.run import Run
from conevo.runs.shaping import Shaping
from conevo.terms import quoted
from conevo.typing import Record
from conevo.worlds.registry import product_of

__all__ = ["print_end"]


def print_end(found: Run | Shaping, style: str) -> None:
    """Print how a run or a shaping ended: "quiet", "json", or as text in any other style."""
    if style == "quiet":
        click.echo(found.path)
    elif style == "json":
        click.echo(json.dumps(_summary(found)))
    elif isinstance(found, Run) and found.status != "finished":
        click.echo(f"\n{state_text(found)}")
    else:
        text = (
            f"{test_text(found.test_result or {})}\n\n{state_text(found)}"
            if isinstance(found, Run)
            else shaping_text(found)
        )
        commands = "".join(f"\n  # {why}\n  {one}" for one, why in _next_commands(found).items())
        click.echo(f"\n{text}\n\nWhat next:{commands}")


def _summary(found: Run | Shaping) -> Record:
    """Return how a run or a shaping ended, as JSON has it."""
    if isinstance(found, Run):
        return {"run": str(found.path), "status": found.status, "test": found.test_result}
    return {
        "shaping": str(found.path),
        "status": found.status,
        "stages": [stage_summary(run) for run in found.stages],
        "product": None if found.product is None else str(found.product),
    }


def _next_commands(found: Run | Shaping) -> dict[str, str]:
    """Return commands that can be used now, exactly as they are typed, and their purposes."""
    path = quoted(found.path)
    by_stage, last = ("", "") if isinstance(found, Run) else (", stage by stage", "last ")
    return {
        f"conevo show {path}": f"its generations{by_stage}",
        f"conevo replay {path}": f"see its {last}team in the browser",
        f"conevo test {path} --scenarios 100": f"test its {last}team in more scenarios",
    } | (_after_run(found) if isinstance(found, Run) else _after_shaping(found))


def _after_run(run: Run) -> dict[str, str]:
    config, path, seed = run.config, quoted(run.path), run.config.run.seed
    commands = {f"conevo resume {path} --{_twice_as_long(run)}": "evolve it longer"}
    if "origin" not in run.provenance:  # neither the file nor the options have its populations
        tables = config.tables()
        changes = [
            f" --set {quoted(f'{section}.{key}={tables[section][key]}')}"
            for section, _, key in (name.partition(".") for name in config.changed)
            if section != "method" and key in tables[section]
        ]
        other = "mesp" if config.method.startswith("cone") else "cone"
        repeat = f"conevo run {quoted(config.address)} --method {other} --preset {config.preset}"
        again = f"conevo run --config {path}/config.toml --seed {seed + 1}"
        commands[again] = "the same with another seed"
        commands[f"{repeat} --seed {seed}{''.join(changes)}"] = "the same with another method"
    return commands


def _twice_as_long(run: Run) -> str:
    """Return the option that continues a finished run for as long as it has been evolved."""
    settings, stopped_by = run.config.run, run.provenance.get("stopped_by")
    if stopped_by == "budget":
        return f"budget-evaluations {2 * settings.budget_evaluations}"
    if stopped_by == "target":
        return "target none"
    return f"generations {2 * settings.generations}"


def _after_shaping(shaping: Shaping) -> dict[str, str]:
    commands = {}
    if len({run.champion.genes.shape for run in shaping.stages if run.champion}) == 1:
        every = f"conevo test {quoted(shaping.path)} --stages"
        commands[every] = "test it in the environment of every stage"
    if shaping.product is not None:
        command, why = product_of(shaping.tasks).USE
        commands[command.format(file=quoted(shaping.product))] = why
    return commands
