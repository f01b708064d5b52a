"""Presets and settings as tables, and a planned run as a configuration file."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from conevo.cli.format import table
from conevo.cli.run_text import title
from conevo.errors import UsageError
from conevo.numbers import number
from conevo.runs.config import RunConfig, resolve
from conevo.runs.lab import price_of
from conevo.runs.layers import PRESETS
from conevo.runs.settings import preset_purpose, settings_of
from conevo.terms import counted

__all__ = ["preset_rows", "print_dry_run", "print_settings", "setting_rows"]

TASK = "rover/complex-1"  # its sizes are listed by default
SENTENCE = re.compile(r"\. (?=[A-Z])")
NARROWEST = 30  # characters for meanings, even on a narrower terminal


def preset_rows(task: str | None, method: str | None) -> list[dict[str, str]]:
    """Return the purpose of each preset, and its sizes in a task."""
    rows = []
    for preset in PRESETS:
        config = resolve(task or TASK, method, preset)
        run = config.run
        rows.append(
            {
                "preset": preset,
                "generations": number(run.generations),
                "budget": number(run.budget_evaluations) if run.budget_evaluations else "none",
                "epochs": str(run.epochs),
                "iterations": number(config.world_params.iterations),
                "genotypes": str(getattr(config.method_config, "genotypes", "-")),
                "tests": str(run.n_tests),
                "for": preset_purpose(preset),
            }
        )
    return rows


def setting_rows(
    task: str | None, method: str | None, preset: str | None, controller: str | None
) -> list[dict[str, Any]]:
    """Return every setting of a run, with its value under a preset.

    Raises:
        UsageError: no task, or an unknown name.
    """
    if task is None:
        raise UsageError(f"whose settings? For example: conevo list settings {TASK}")
    chosen = {} if controller is None else {"controller.name": controller}
    return [
        {
            "setting": f"{section}.{setting.name}",
            "value": value,
            "default": setting.default,
            "unit": setting.unit,
            "allowed": setting.allowed,
            "meaning": setting.meaning,
        }
        for section, setting, value in settings_of(resolve(task, method, preset, overrides=chosen))
    ]


def print_settings(rows: list[dict[str, Any]], as_json: bool) -> None:
    """Print settings, with the first sentence of each meaning wrapped to the terminal's width."""
    if as_json:
        click.echo(json.dumps(rows))
        return
    head = ["setting", "value", "default", "allowed", "unit"]
    texts = [[_text(row[name]) for name in head] for row in rows]
    first, *lines = table(head, texts).splitlines()
    width = max(map(len, [first, *lines]))
    room = max(shutil.get_terminal_size((120, 24)).columns - width - 2, NARROWEST)
    click.echo(f"{first.ljust(width)}  meaning")
    for line, row in zip(lines, rows, strict=True):
        wrapped = textwrap.wrap(SENTENCE.split(row["meaning"])[0], room) or [""]
        click.echo(f"{line.ljust(width)}  {wrapped[0]}".rstrip())
        for more in wrapped[1:]:
            click.echo(" " * (width + 2) + more)


def print_dry_run(
    configs: Sequence[RunConfig],
    path: Path,
    as_json: bool,
    ancestors: Sequence[Any],
    ancestry: Any,
) -> None:
    """Print the settings and costs of a run, or of every stage of a shaping.

    The text is a configuration file for ``conevo run --config`` (of a shaping: that of the last
    stage). Comments at its top show the directory and the costs.

    Args:
        configs: of the run, or of every stage.
        path: directory of the run.
        as_json: whether to print JSON.
        ancestors: initial populations of the run, or of each stage; None for random ones.
        ancestry: the provenance's entry for them.
    """
    prices = [price_of(*one) for one in zip(configs, ancestors, strict=True)]
    if as_json:
        stages = [
            {"run_id": one.run_id, **dataclasses.asdict(price), "config": one.tables()}
            for one, price in zip(configs, prices, strict=True)
        ]
        click.echo(json.dumps({"path": str(path), "runs": stages, **ancestry}))
        return
    click.echo(f"# {path} (nothing was written)")
    if ancestry:
        click.echo(
            f"# begins with populations of {ancestry['origin']['path']}; --from is not in the file"
        )
    for one, price in zip(configs, prices, strict=True):
        click.echo(
            f"# {title(one.outline)}: {counted(price.evaluations, 'team evaluation')} in the first "
            f"generation, at most {counted(price.generations, 'generation')}, "
            f"about {price.team_steps:.2g} team-steps"
        )
    click.echo(configs[-1].to_toml().rstrip())


def _text(value: Any) -> str:
    """Return a value as a configuration file has it, without quotes; "-" for none."""
    if value is None:
        return "-"
    return str(value).lower() if isinstance(value, bool) else str(value)
