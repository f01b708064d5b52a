"""The start of a run: its configuration, its initial populations and its directory."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from conevo.runs import provenance
from conevo.runs.directory import refuse_existing
from conevo.runs.run import RUNS, Run
from conevo.runs.store import create
from conevo.typing import Record

if TYPE_CHECKING:
    from conevo.evolution.protocol import Method, State
    from conevo.runs.champions import Team
    from conevo.runs.config import RunConfig

__all__ = ["beginning", "evolve", "start"]


def evolve(
    world: str | None = None,
    method: str | Method | None = None,
    preset: str | None = None,
    seed: int | None = None,
    out: str | Path | None = None,
    config: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    threads: int | None = None,
    device: str = "cpu",
    progress: bool | None = None,
    origin: Run | str | Path | None = None,
    of_champion: bool = False,
) -> Run:
    """Evolve a team and test it; everything is written to one directory.

    Args:
        world: world and environment, "rover/complex-1".
        method: "cone" (default), "mesp" ..., "FILE.py:NAME", or an object of a class in a file.
        preset: "smoke" (seconds), "desk" (minutes, default), "night" (hours), "thesis".
        seed: the same seed gives the same run, bit for bit.
        out: the run's directory; by default a new one under ``runs/``.
        config: a TOML file with settings, for example the ``config.toml`` of another run.
        overrides: single settings, for example ``{"run.generations": 5}``.
        threads: CPU threads, all by default; results do not depend on it.
        device: "cpu", "cuda", or "auto": "cuda" if there is one; results do not depend on it.
        progress: as for ``Run.resume``.
        origin: a finished run; start from its final populations, if its controllers fit.
        of_champion: breed the populations from the origin's champion instead.

    Raises:
        UsageError: a name or value that is not allowed, or ``out`` exists; nothing was written.
        EnvironmentFailure: no such device, full disk, no permission.
    """
    from conevo.evolution.methods.objects import as_settings
    from conevo.runs.config import resolve

    name, overrides = as_settings(method, overrides or {})
    settings = resolve(world, name, preset, seed, config, overrides)
    origin = origin if origin is None or isinstance(origin, Run) else Run(origin)
    how: Record = {"threads": threads, "device": device, "of_champion": of_champion}
    run = start(settings, out, origin=origin, **how)
    return run.resume(threads=threads, progress=progress)


def start(
    config: RunConfig,
    out: str | Path | None = None,
    *,
    threads: int | None = None,
    device: str = "cpu",
    command: str = "conevo.evolve",
    origin: Run | None = None,
    of_champion: bool = False,
) -> Run:
    """Create the directory of a run; ``Run.resume`` then evolves it.

    Args:
        config: of the run.
        out: the run's directory; by default a new one under ``runs/``.
        threads: CPU threads, all by default.
        device: "cpu", "cuda", or "auto": "cuda" if there is one; results do not depend on it.
        command: that started the run, for the provenance.
        origin: a finished run; the new one starts from its final populations, which are copied
            into the new directory.
        of_champion: breed the populations from the origin's champion instead.

    Raises:
        UsageError: the directory exists, the budget does not pay for one generation, or the
            origin is unfinished, was changed, or its populations do not fit.
        EnvironmentFailure: no such device, full disk, no permission; nothing was written.
    """
    from conevo.runs.lab import Lab

    path, ancestor, ancestry = beginning(config, out, origin, of_champion)
    lab = Lab.equip(config, threads, device)
    first = lab.rehearsed(lab.first_state(ancestor))
    about = {
        "run_id": config.run_id,
        "stem_id": config.stem_id,
        "preset": config.preset,
        "changed": list(config.changed),
        "command": command,
        "kernel_hash": lab.simulator.fingerprint,
        "created": provenance.now(),
        **provenance.describe_machine(lab.device),
        **provenance.describe(lab.world, lab.method),
        **ancestry,
        "sessions": [],
    }
    refuse_existing(path, is_new=True)
    return Run(create(path, config, about, first if ancestry else None), lab)


def beginning(
    config: RunConfig, out: str | Path | None, origin: Run | None, of_champion: bool
) -> tuple[Path, State | Team | None, Record]:
    """Return a new run's directory, its initial populations and their provenance entry.

    Raises:
        UsageError: as ``start``.
    """
    from conevo.runs.ancestry import ancestor_of, refuse_other_controllers

    ancestor: State | Team | None = None
    ancestry: Record = {}
    if origin is not None:
        ancestor, ancestry = ancestor_of(origin._store, lambda: origin.config, of_champion)
    suffix = f"-from-{ancestry['origin']['checkpoint'][:6]}" if ancestry else ""
    path = Path(out) if out is not None else RUNS / f"{config.label}{suffix}"
    refuse_existing(path)
    if origin is not None:
        refuse_other_controllers(str(origin.path), origin.config, config)
    return path, ancestor, ancestry
