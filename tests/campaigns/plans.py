"""A campaign of tiny runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from conevo.campaigns.campaign import Campaign, create
from conevo.campaigns.plan import Plan
from conevo.campaigns.plan_file import read_plan, read_preset
from extras import need

TINY = """
[campaign]
title = "Tiny"
seeds = {seeds}
preset = "smoke"
{head}

[factors]
world = ["rover/complex-1"]
method = ["homcne", "cone"]
{factors}

[settings]
"run.generations" = 2
"run.fittest_epochs" = 1
"run.n_tests" = 2
"world.iterations" = 40
"method.genotypes" = 6
{more}
"""


def write_plan(
    folder: Path, head: str = "", factors: str = "", more: str = "", seeds: int = 2
) -> Path:
    """Write the plan of a campaign of two tiny runs per seed, or more."""
    folder.mkdir(exist_ok=True)
    path = folder / "tiny.toml"
    path.write_text(TINY.format(head=head, factors=factors, more=more, seeds=seeds))
    return path


def tiny_campaign(folder: Path, head: str = "studies = []", **parts: Any) -> Campaign:
    """Write out a campaign of tiny runs, four by default; nothing is started."""
    return create(read_plan(write_plan(folder, head, **parts)), folder / "tiny")


def preset(name: str) -> Plan:
    """Return a plan of conevo's; skip the test where the package of its tasks is missing."""
    if name == "neighbours":
        need("torch", "vmas")
    return read_preset(name)
