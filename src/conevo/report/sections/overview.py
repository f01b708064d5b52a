"""The runs of a campaign: their plan, cost, failures and versions."""

from __future__ import annotations

from collections.abc import Mapping

from conevo.campaigns.campaign import Campaign
from conevo.campaigns.ended import Ended, failures
from conevo.campaigns.sealing import left_out
from conevo.campaigns.tables import Tables
from conevo.evolution.methods.registry import name_in
from conevo.reading import read_text
from conevo.report.exhibits import Column, Section, Table, number, plain
from conevo.terms import counted

__all__ = ["overview", "repetition"]


MOST_NAMES = 12  # of runs that a sentence may list


def overview(tables: Tables, campaign: Campaign) -> Section:
    """Return the number of runs, their cost, failures, missing ones and versions."""
    runs = [run for (run,) in tables.query("SELECT run FROM runs ORDER BY run")[1]]
    finished = {run.partition("/")[0] for run in runs}
    failed, unread = failures(campaign.paths.ended("").parent)
    failed = {label: why for label, why in failed.items() if label not in finished}
    unread = {f"ended/{file}": why for file, why in unread.items()}
    unread |= {f"runs/{label}": why for label, why in left_out(tables.folder).items()}
    waiting = [x for x in campaign.planned if x not in finished and x not in failed]
    text = []
    if campaign.plan.produces:
        text.append(f"Data of the thesis' {', '.join(campaign.plan.produces)}.")
    stages = f" ({counted(len(runs), 'stage')})" if len(runs) > len(finished) else ""
    text.append(
        f"Runs finished: {len(finished):,} of {len(campaign.planned):,} planned{stages}; "
        f"failed: {len(failed):,}; not ended: "
        f"{len(waiting):,}. Only finished runs count below. Runs of different "
        "presets or budgets are never in one table or figure."
    )
    if waiting:
        more = f" and {len(waiting) - MOST_NAMES:,} more" if len(waiting) > MOST_NAMES else ""
        text.append(f"Not ended: {', '.join(waiting[:MOST_NAMES])}{more}.")
    text += _warnings(tables)
    exhibits = [_cost(tables), _versions(tables)]
    if failed:
        exhibits.insert(1, _failures(failed, campaign))
    if unread:
        # Of paths below the campaign: the same report wherever it is.
        short = {file: why.replace(f"{campaign.path}/", "") for file, why in unread.items()}
        exhibits.insert(1, _unread(short))
        text.append(f"Files that could not be read are left out: {len(short):,}, see below.")
    return Section("Runs", text, exhibits)


def _warnings(tables: Tables) -> list[str]:
    """Return warnings about runs of one comparison that were made by different code."""
    text = []
    mixed = tables.query(
        "SELECT task FROM runs JOIN budgets USING (run) GROUP BY task, budget"
        " HAVING count(DISTINCT code) > 1 ORDER BY task"
    )[1]
    if tasks := list(dict.fromkeys(task for (task,) in mixed)):
        more = f" and {len(tasks) - 3} more" if len(tasks) > 3 else ""
        text.append(
            f"Warning: runs of {', '.join(tasks[:3])}{more} that are compared here were made by "
            "different code (see Versions), so a difference between them may be one of the code."
        )
    changed = tables.query("SELECT run, changes FROM runs WHERE changes <> '' ORDER BY run")[1]
    for run, changes in changed[:3]:
        text.append(f"Warning: run {run} was {changes}.")
    if len(changed) > 3:
        text.append(f"Warning: so were {len(changed) - 3} more; the table of runs has them all.")
    return text


def repetition(tables: Tables, campaign: Campaign) -> Section:
    """Return the commands that repeat the campaign, and its plan."""
    versions = tables.query("SELECT DISTINCT conevo FROM runs ORDER BY 1")[1]
    presets = tables.query("SELECT DISTINCT preset FROM runs ORDER BY 1")[1]
    text = [
        "Save the plan below as plan.toml; with conevo "
        + " or ".join(version for (version,) in versions)
        + " the same commands give the same runs, bit for bit on the same kind of processor, and "
        "from the same runs the same report, byte for byte.",
    ]
    if any(preset != "night" for (preset,) in presets):
        text.append("At a larger scale: conevo campaign start plan.toml --preset night")
    commands = f"conevo campaign start plan.toml\nconevo report {campaign.plan.name}\n"
    plan = read_text(campaign.paths.plan)
    return Section("How to repeat it", text, preformatted=f"{commands}\n# plan.toml\n{plan}")


def _cost(tables: Tables) -> Table:
    rows = tables.records(
        """
        SELECT r.world, r.family, b.budget, count(DISTINCT environment) AS environments,
               count(DISTINCT method || variant) AS methods, count(DISTINCT seed) AS seeds,
               count(*) AS runs, min(r.generations) AS least_generations,
               max(r.generations) AS most_generations, min(evaluations) AS least_evaluations,
               max(evaluations) AS most_evaluations, sum(team_steps) / 1e6 AS million_team_steps,
               sum(core_seconds) / 3600 AS core_hours
        FROM runs r JOIN budgets b USING (run) GROUP BY ALL ORDER BY ALL
        """
    )
    for row in rows:
        for what in ("generations", "evaluations"):
            row[what] = (row.pop(f"least_{what}"), row.pop(f"most_{what}"))
    shown = [
        Column("world", "world", plain),
        Column("family", "environments", plain),
        Column("budget", "budget", plain, is_wide=True),
        Column("environments", "how many"),
        Column("methods", "methods"),
        Column("seeds", "seeds"),
        Column("runs", "runs"),
        Column("generations", "generations", _span),
        Column("evaluations", "team evaluations", _span),
        Column("million_team_steps", "team-steps, million"),
        Column("core_hours", "core hours"),
    ]
    note = "Generations and team evaluations of a run, lowest to highest; the rest of all runs."
    return Table("runs", "Runs and their cost", note, shown, rows)


def _span(value: tuple[int, int]) -> str:
    low, high = value
    return number(low) if low == high else f"{low:,} to {high:,}"


def _failures(failed: Mapping[str, Ended], campaign: Campaign) -> Table:
    rows = []
    for label, why in failed.items():
        planned = campaign.planned.get(label)
        method, seed = (name_in(planned.method), planned.seed) if planned else ("", None)
        about = {"run": label, "method": method, "seed": seed}
        rows.append(about | {"origin": why["origin"], "message": why["message"]})
    columns = [
        Column("run", "run", plain),
        Column("method", "method", plain),
        Column("seed", "seed", plain),
        Column("origin", "origin", plain),
        Column("message", "reason", plain, is_wide=True),
    ]
    note = (
        "Origin: machine, the environment failed; request, it could not be carried out; program, "
        "conevo failed."
    )
    return Table("failures", "Runs that failed", note, columns, rows)


def _unread(unread: Mapping[str, str]) -> Table:
    columns = [Column("file", "run or file", plain), Column("why", "reason", plain, is_wide=True)]
    rows = [{"file": file, "why": why} for file, why in unread.items()]
    note = "Damaged files; of a damaged run nothing counts below."
    return Table("left-out", "Files that could not be read", note, columns, rows)


def _versions(tables: Tables) -> Table:
    rows = tables.records(
        "SELECT conevo, code, numpy, warp, world, kernel_hash, count(*) AS runs FROM runs"
        " GROUP BY ALL ORDER BY ALL"
    )
    shown = [
        Column("conevo", "conevo", plain),
        Column("code", "code", plain),
        Column("numpy", "numpy", plain),
        Column("warp", "Warp", plain),
        Column("world", "world", plain),
        Column("kernel_hash", "kernels", plain),
        Column("runs", "runs"),
    ]
    note = (
        "Code: digest of all text of conevo that decides results, several if others continued the "
        "run. Kernels: digest of the simulation's program. Runs with the same ones are comparable."
    )
    return Table("versions", "Versions", note, shown, rows)
