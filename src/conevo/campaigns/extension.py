"""Another plan for an existing campaign: more runs, or longer ones.

Workers extend their runs, as ``conevo resume RUN --generations N`` does. The new plan replaces the
old one in one step: ``extension.json`` has it until both files are written.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.campaigns.inputs import keep_files, renamed
from conevo.campaigns.paths import Paths
from conevo.campaigns.plan import Plan, PlannedRun
from conevo.errors import UsageError
from conevo.reading import read_json
from conevo.runs.config import RunConfig
from conevo.runs.durable import replace_file, writing
from conevo.runs.inputs import INPUTS
from conevo.terms import quoted

if TYPE_CHECKING:
    from conevo.campaigns.campaign import Campaign

__all__ = ["check_plan", "settle", "texts_of"]


def texts_of(plan: Plan, runs: Iterable[PlannedRun], directory: Path) -> dict[str, str]:
    """Return the texts of ``plan.toml`` and ``runs.jsonl``, after copying the files in them.

    Args:
        plan, runs: to be written.
        directory: the campaign's.

    Returns:
        The texts by "plan" and "runs".
    """
    root = directory.resolve()
    names = keep_files([*plan.values, *(value for run in runs for value in run.values)], root)

    def rename(value: Any) -> Any:
        return renamed(value, names)

    rows = [dataclasses.asdict(run.mapped(rename)) for run in runs]
    lines = "".join(f"{json.dumps(row)}\n" for row in rows)
    return {"plan": plan.mapped(rename).to_toml(), "runs": lines}


def check_plan(campaign: Campaign, runs: Mapping[str, PlannedRun]) -> None:
    """Raise UsageError unless these are the campaign's runs, as long or longer, and perhaps more.

    Args:
        campaign: the existing one.
        runs: of the new plan, by label.
    """
    start = f"conevo campaign start {quoted(campaign.path)}"
    advice = f"continue it with '{start}', or choose another --out"
    cells: dict[str, str] = {}
    for label, planned in campaign.planned.items():
        if label not in runs:
            raise UsageError(
                f"{campaign.path} holds another campaign: its run {label} is one that this plan "
                f"does not have; {advice}"
            )
        if runs[label].run_ids == planned.run_ids:
            continue
        key = json.dumps([_cell(planned), _cell(runs[label])])
        if key not in cells:
            cells[key] = _why_not(planned.configs(), runs[label].configs())
        if why := cells[key]:
            raise UsageError(f"{campaign.path} holds another campaign: run {label} {why}; {advice}")
        if planned.in_stages and campaign.paths.run(label).exists():
            raise UsageError(
                f"{campaign.path}: {label} is a shaping that has begun, and stages keep their "
                f"length; {advice}"
            )


def settle(paths: Paths) -> None:
    """Put the plan in ``extension.json``, if any, in place; the campaign's lock is held."""
    if paths.extension.is_file():
        extension = read_json(paths.extension)
        replace_file(paths.runs, extension["runs"].encode())
        replace_file(paths.plan, extension["plan"].encode())
        with writing(paths.extension):
            paths.extension.unlink()


def _cell(planned: PlannedRun) -> list[object]:
    """Return a run's names and settings, without its seed."""
    return [planned.tasks, planned.method, planned.preset, planned.overrides, planned.of_first]


def _why_not(old: list[RunConfig], new: list[RunConfig]) -> str:
    """Return why runs of one cell cannot be continued as those of another, "" if they can."""
    for one, other in zip(old, new, strict=True):
        if one.entry.digest != other.entry.digest:
            file = Path(one.entry.file or other.entry.file).name
            return f"was planned with another {file}, of which it keeps a copy in {INPUTS}/"
        if one.stem_id != other.stem_id:
            return "has other settings in this plan"
        for name in ("generations", "budget_evaluations"):
            was, will = getattr(one.run, name), getattr(other.run, name)
            if 0 < will < (was or float("inf")):
                planned = was or "no limit"
                return f"would be shorter in this plan (run.{name} = {will}, planned: {planned})"
    return ""
