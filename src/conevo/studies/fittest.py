"""The fittest team of a run, together with what simulates it: where every study begins."""

from __future__ import annotations

from conevo.errors import UsageError, without_team
from conevo.runs.champions import Team
from conevo.runs.lab import Lab
from conevo.runs.provenance import device_of
from conevo.runs.run import Run

__all__ = ["equip", "lab_of"]


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
    lab = lab_of(run, threads, device)
    lab.refuse_other_team(team, run.path)
    return team, lab


def lab_of(run: Run, threads: int | None = None, device: str | None = None) -> Lab:
    """Return what simulates a run.

    Args:
        run, threads, device: as for ``equip``.

    Raises:
        UsageError: made with other kernels.
    """
    about = run.provenance
    lab = Lab.equip(run.config, threads, device_of(about, device))
    if lab.simulator.fingerprint != about["kernel_hash"]:
        raise UsageError(
            f"{run.path} was made with other kernels ({about['kernel_hash']}, here "
            f"{lab.simulator.fingerprint}): its team would not behave as it did"
        )
    return lab
