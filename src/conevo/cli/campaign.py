"""``conevo campaign``: plans of many runs, executed to the end."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from conevo.cli.run_to_end import accept_option, all_of, time_limit_option
from conevo.errors import UsageError
from conevo.terms import counted, quoted

if TYPE_CHECKING:
    from conevo.campaigns.plan import Plan

__all__ = ["campaign"]

FAILED = 1  # exit code when runs of a campaign have failed
threads_option = click.option(
    "--threads", type=click.IntRange(1, 4096), default=1, show_default=True,
    help="CPU threads per run; does not change results.",
)  # fmt: skip
execution_options = all_of(
    click.option(
        "--executor", default="processes", show_default=True, metavar="NAME",
        help="processes, serial or ray.",
    ),
    click.option(
        "--cores", type=click.IntRange(1, 4096), help="CPU cores for all runs (default: all)."
    ),
    threads_option,
    click.option(
        "--device", metavar="DEVICES",
        help="cpu, cuda, several that workers use in turn (cuda:0,cuda:1), or auto: all CUDA "
        "devices (default: cpu; runs that have begun stay on their device).",
    ),
    click.option("--address", metavar="ADDRESS", help="With ray: address of a cluster, or auto."),
    click.option(
        "--store", metavar="URI",
        help="With ray: object store, for nodes that do not see the campaign's directory.",
    ),
    time_limit_option,
    click.option("--json", "as_json", is_flag=True, help="Print one JSON object per ended run."),
    click.option("--quiet", is_flag=True, help="Print only the campaign's directory."),
)  # fmt: skip
"""Options for where and how runs are executed."""
plan_options = all_of(
    click.argument("name", metavar="NAME|FILE|DIR"),
    click.option("--preset", metavar="NAME", help="smoke, desk (default), night, thesis."),
    click.option("--seeds", type=int, help="Runs per cell (default: the plan's)."),
    click.option(
        "--set", "settings", metavar="KEY=VALUE", multiple=True,
        help="Setting of all runs, for example run.budget_evaluations=5000; may be repeated.",
    ),
    click.option("--out", metavar="DIR", help="Output directory (default: campaigns/NAME)."),
)  # fmt: skip
"""Options that select a campaign and its scale."""


@click.group()
def campaign() -> None:
    """Campaigns of many runs: methods x environments x seeds, resumable.

    Try: conevo campaign start rover-complex --preset smoke --seeds 2
    """


@campaign.command("list", short_help="List the thesis' experiments and your campaigns.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value.")
def list_(as_json: bool) -> None:
    """List the experiments that come with conevo and the campaigns in campaigns/."""
    from conevo.cli.campaign_text import campaigns_here, experiments, print_lists

    found = {"experiments": experiments(), "campaigns": campaigns_here()}
    if as_json:
        click.echo(json.dumps(found))
    else:
        print_lists(**found)


@campaign.command(short_help="Start a campaign, or finish what is missing.")
@plan_options
@click.option("--dry-run", is_flag=True, help="Print the runs; write and start nothing.")
@accept_option
@execution_options
def start(
    name: str,
    preset: str | None,
    seeds: int | None,
    settings: tuple[str, ...],
    out: str | None,
    dry_run: bool,
    accept_other_code: bool,
    **execution: Any,
) -> int:
    """Start NAME (see: conevo campaign list) or the plan in a TOML FILE, or continue in DIR.

    Starting a campaign again finishes only what is missing; interrupted runs continue from their
    checkpoints. More seeds or levels add runs; more generations or a larger budget extend existing
    runs: conevo campaign start DIR --set run.budget_evaluations=50000

    Try: conevo campaign start rover-complex --preset smoke --seeds 2
    """
    from conevo.campaigns.campaign import Campaign, check, create
    from conevo.cli.campaign_run import carry_on, ready
    from conevo.cli.campaign_text import print_plan

    execute = ready(**execution)
    path, plan = _planned(name, preset, seeds, settings, out)
    if dry_run:
        runs = check(plan, path) if plan else Campaign(path).planned.values()
        print_plan(runs, execution["as_json"])
        return 0
    found = create(plan, path, accept_other_code) if plan else Campaign(path)
    found.admit_code(accept_other_code)
    return carry_on(found, execute)


@campaign.command(short_help="Write a campaign's runs as a SLURM job array.")
@plan_options
@threads_option
@click.option(
    "--hours", type=float, default=24.0, show_default=True,
    help="Time limit per task; unfinished runs are requeued.",
)  # fmt: skip
@click.option(
    "--at-once",
    type=click.IntRange(1, 100_000),
    help="Maximum number of concurrent tasks (default: no limit).",
)
@click.option("--partition", metavar="NAME", help="SLURM partition.")
@click.option("--account", metavar="NAME", help="SLURM account.")
@click.option("--gres", metavar="GRES", help="Resources of a task, for example gpu:1.")
@click.option("--mem", metavar="SIZE", help="Memory of a task, for example 8G.")
@click.option("--device", help="auto, cpu (default) or cuda; see --gres.")
@click.option(
    "--sbatch", "others", metavar="OPTION", multiple=True,
    help="Another sbatch option, for example --sbatch=--constraint=avx512; may be repeated.",
)  # fmt: skip
@accept_option
def slurm(
    name: str,
    preset: str | None,
    seeds: int | None,
    settings: tuple[str, ...],
    out: str | None,
    threads: int,
    hours: float,
    at_once: int | None,
    device: str | None,
    others: tuple[str, ...],
    accept_other_code: bool,
    **named: str | None,
) -> None:
    """Write a job script for all unfinished runs; submit it with sbatch.

    All nodes must see the campaign's directory. conevo campaign status shows its progress, and
    conevo campaign start finishes what is missing.

    Try: conevo campaign slurm rover-complex --preset night --hours 12
    """
    from conevo.campaigns.campaign import Campaign, create
    from conevo.campaigns.slurm import check_request, write_array

    options = [f"--{key}={value}" for key, value in named.items() if value is not None]
    options += others
    check_request(hours, options, device)
    path, plan = _planned(name, preset, seeds, settings, out)
    found = create(plan, path, accept_other_code) if plan else Campaign(path)
    found.admit_code(accept_other_code)
    left = [label for label in found.planned if not found.is_finished(label)]
    script = write_array(
        found.path,
        left,
        threads=threads,
        hours=hours,
        at_once=at_once,
        options=options,
        device=device,
    )
    click.echo(f"{counted(len(left), 'run')}; submit with: sbatch {quoted(script)}")
    asks = any(option.startswith(("--gres", "--gpus")) for option in options)
    if device not in (None, "cpu") and not asks:
        click.echo("conevo: note: the tasks ask SLURM for no GPU; add --gres gpu:1", err=True)


@campaign.command(short_help="Show a campaign's progress.")
@click.argument("name", metavar="NAME")
@click.option("--runs", is_flag=True, help="Print a line for every run.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value.")
def status(name: str, runs: bool, as_json: bool) -> int:
    """Print how many runs of each cell are finished, and which failed and why.

    It writes nothing and can be used while the campaign runs. The exit code is 1 if a run failed.

    Try: conevo campaign status rover-complex --runs
    """
    from conevo.cli.campaign_text import print_status
    from conevo.cli.lookup import find_campaign

    return FAILED if print_status(find_campaign(name), runs, as_json) else 0


@campaign.command(short_help="Stop a running campaign.")
@click.argument("name", metavar="NAME")
def stop(name: str) -> None:
    """Ask the campaign's coordinator, on whatever machine, to stop.

    Runs write a checkpoint first, so nothing is lost; conevo campaign start continues them.
    """
    from conevo.cli.lookup import find_campaign

    found = find_campaign(name)
    found.stop()
    advice = f"conevo campaign start {quoted(found.path)}"
    click.echo(f"asked {found.path} to stop; continue with: {advice}")


@campaign.command(short_help="Retry the failed runs.")
@click.argument("name", metavar="NAME")
@accept_option
@execution_options
def retry(name: str, accept_other_code: bool, **execution: Any) -> int:
    """Retry the failed runs of a campaign and finish what is missing."""
    from conevo.cli.campaign_run import carry_on, ready
    from conevo.cli.lookup import find_campaign

    execute = ready(**execution)
    found = find_campaign(name)
    found.admit_code(accept_other_code)
    found.retry()
    return carry_on(found, execute)


def _planned(
    name: str, preset: str | None, seeds: int | None, settings: tuple[str, ...], out: str | None
) -> tuple[Path, Plan | None]:
    """Return the campaign's directory, and its plan; None if an existing plan stays as it is.

    The name of a plan always selects that plan, whatever is in DIR.
    """
    from conevo.campaigns.campaign import CAMPAIGNS
    from conevo.campaigns.plan_file import preset_names, read_plan, read_preset
    from conevo.cli.lookup import campaign_at
    from conevo.runs.assignments import parse_assignments

    there = campaign_at(name)
    if there is not None and out is not None and Path(out).resolve() != there.path.resolve():
        if name not in preset_names():
            raise UsageError(f"--out {out}: the campaign {there.path} continues where it is")
        there = None
    wanted = preset is not None or seeds is not None or bool(settings)
    if there is not None and not wanted:
        return there.path, None
    if there is not None:
        plan = there.plan
    elif name.endswith(".toml"):
        plan = read_plan(Path(name))
    else:
        plan = read_preset(name)
    path = there.path if there else Path(out) if out else CAMPAIGNS / plan.name
    return path, plan.at(preset, seeds, parse_assignments(settings))
