"""The fittest team of a run, together with what simulates it: where every study begins."""

from __future__ import annotations

from conevo.errors import without_team
from conevo.runs.champions import Team
from conevo.runs.lab import Lab
from conevo.runs.run import Run

__all__ = ["equip"]


def equip(run: Run, threads: int | None = None, device: str | None = None) -> tuple[Team, Lab]:
    """Return the fittest team of a run and what simulates it.

    Args:
        run: finished or not.
        threads: CPU threads, all by default.
        device: as for ``Run.resume``.

    Raises:
        UsageError: no generation has finished yet, or made with other kernels.
    """
    team = run.champion
    if team is None:
        raise without_team(run.path, run.generations())
    lab = run.equip(threads, device)
    lab.refuse_other_team(team, run.path)
    return team, lab
