"""``conevo run --seeds``: runs of one or more methods, as a campaign without a plan file."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

from conevo.errors import UsageError

if TYPE_CHECKING:
    from conevo.campaigns.plan import Plan
    from conevo.cli.options import Order
    from conevo.runs.config import RunConfig

__all__ = ["compare", "plan_of"]


# The same budget for every method, as in the plans of the package: the generations of a smoke run
# cost each method a different number of evaluations, and only equal budgets are compared.
SMOKE = {"run.generations": 20, "run.budget_evaluations": 430}


def plan_of(order: Order, config: RunConfig, n_seeds: int, shape: bool) -> Plan:
    """Return the plan of every method with every seed; its name lists what is compared.

    Args:
        order: options of the command line; several methods are separated by commas, "cone,mesp".
        config: of the first method.
        n_seeds: runs of each method; seeds count up from ``order.seed``, or from 1.
        shape: whether every run learns the previous environments of the family first.

    Raises:
        UsageError: --config, since a campaign cannot take its settings.
    """
    from conevo.campaigns.inputs import located
    from conevo.campaigns.plan import Plan
    from conevo.evolution.methods.registry import name_in
    from conevo.runs.layers import overridden

    if order.config is not None:
        raise UsageError("--seeds and --config are mutually exclusive; give settings with --set")
    first = 1 if order.seed is None else order.seed
    methods = tuple(located(method, Path.cwd()) for method in order.methods)
    names = [name_in(method) for method in methods]
    settings = dict(order.overrides)
    if len(methods) > 1 and config.preset == "smoke" and not config.run.budget_evaluations:
        settings = overridden(SMOKE, settings)
    parts = [config.task, *names, config.preset, *(["shaped"] if shape else [])]
    if settings:
        text = json.dumps(settings, sort_keys=True, default=str)
        parts.append(hashlib.blake2b(text.encode(), digest_size=3).hexdigest())
    return Plan(
        name=re.sub(r"[^A-Za-z0-9._-]+", "-", "-".join(parts)),
        title=f"{config.task}: {', '.join(names)}",
        produces=(),
        seeds=tuple(range(first, first + n_seeds)),
        preset=config.preset,
        shape=shape,
        studies=("teams",),
        factors={"world": (config.address,), "method": methods},
        settings=settings,
        place="on the command line",
    )


def compare(order: Order, plan: Plan, dry_run: bool) -> int:
    """Execute the campaign on all cores, or print its runs; returns the exit code."""
    from conevo.campaigns.campaign import CAMPAIGNS, create
    from conevo.cli.campaign_run import carry_on, ready
    from conevo.cli.campaign_text import print_plan

    if dry_run:
        print_plan(plan.write_out(), order.as_json)
        return 0
    execution = ready(
        executor="processes",
        cores=order.threads,
        threads=1,
        device=order.device,
        limit=order.limit,
        as_json=order.as_json,
        quiet=order.quiet,
    )
    path = Path(order.out) if order.out else CAMPAIGNS / plan.name
    campaign = create(plan, path)
    order.start_tracker(campaign.path)
    return carry_on(campaign, execution)
