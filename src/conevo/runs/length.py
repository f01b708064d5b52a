"""The length of a run, and how a finished run is extended.

An extended run equals, bit for bit, one that was planned that long. So the new length replaces the
old one in ``config.toml``, and ``provenance.json`` keeps the former end in its list ``extended``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from conevo.errors import UsageError
from conevo.runs.config import RunConfig
from conevo.runs.directory import kind_of
from conevo.runs.lab import Lab
from conevo.runs.loop import check_budget, has_reached
from conevo.runs.outline import LENGTH
from conevo.runs.provenance import now
from conevo.runs.settings import RunSettings
from conevo.runs.store import Store
from conevo.terms import counted, quoted
from conevo.typing import Record
from conevo.worlds.measures import measures_of

__all__ = ["give_length", "length_of", "refuse_parts"]


def length_of(
    generations: int | None, budget_evaluations: int | None, target: float | str | None
) -> Record:
    """Return the given settings of a run's length; the target "none" becomes None."""
    given = zip(LENGTH, (generations, budget_evaluations, target), strict=True)
    length = {name: value for name, value in given if value is not None}
    return length | ({"target": None} if target == "none" else {})


def give_length(
    store: Store, config: RunConfig, equip: Callable[[], Lab], is_later: bool
) -> Lab | None:
    """Give a locked run the length of a configuration, unless it already has it.

    Args:
        store: of the run.
        config: the run's own with another length.
        equip: returns the run's lab; called after the first checks.
        is_later: refuse a finished run that would end where it has ended.

    Returns:
        The run's lab, None if nothing changed.

    Raises:
        UsageError: shorter than the finished part, another run's configuration, or the run was
            changed since it was finished; nothing was written.
    """
    path, current = store.path, store.read_config()
    about, records = store.read_provenance(), store.read_generations()
    _check(path, config, about, records)
    if is_later and store.is_finished:
        _check_later(path, config, current.run, about, records)
    if config.run_id == current.run_id:
        return None
    if store.is_finished and (changed := store.check_seal()):
        raise UsageError(
            f"{path} was changed since it was finished ({', '.join(changed)}): "
            f"it cannot be continued"
        )
    lab = replace(equip(), config=config)
    if not records:
        first = store.load_origin(config.method, lab.blank_state()) or lab.first_state()
        check_budget(lab.method, first, config.run)
    seal = store.read_seal() if store.is_finished else {}
    store.extend(config, _former_end(current, about, records, seal), now())
    return lab


def _check(path: Path, config: RunConfig, about: Record, records: Sequence[Record]) -> None:
    """Raise UsageError if a run cannot have this length.

    It would have ended before what has been done, or the configuration is that of another run.

    Args:
        path: the run's, for messages.
        config: with the new length.
        about: the run's provenance.
        records: of the generations that have finished.
    """
    settings = config.run
    if "stem_id" not in about and config.run_id != about["run_id"]:
        raise UsageError(
            f"{path} was made by conevo {about['conevo']}, whose runs cannot be "
            f"extended; start another run from its populations: "
            f"conevo run WORLD/ENVIRONMENT --from {quoted(path)}"
        )
    if about.get("stem_id", config.stem_id) != config.stem_id:
        raise UsageError(f"{path} has other settings: it cannot be continued as this run")
    if settings.generations < len(records):
        raise UsageError(
            f"{path} has done {counted(len(records), 'generation')}: "
            f"run.generations = {settings.generations} is fewer"
        )
    if not records:
        return
    spent = records[-1]["team_evaluations"]
    if 0 < settings.budget_evaluations < spent:
        raise UsageError(
            f"{path} has spent {spent} team evaluations: "
            f"run.budget_evaluations = {settings.budget_evaluations} is fewer"
        )
    main = measures_of(config.build_world())[0]
    for record in records[:-1]:
        if has_reached(settings.target, main, record["performance"]):
            raise UsageError(
                f"{path} reached run.target = {settings.target} in generation "
                f"{record['generation']} of {len(records)}: it would have ended there"
            )


def _check_later(
    path: Path, config: RunConfig, former: RunSettings, about: Record, records: Sequence[Record]
) -> None:
    """Raise UsageError if a finished run would end again where it has ended.

    Args:
        path: the run's, for messages.
        config: with the new length.
        former: with the length that it had.
        about: the run's provenance.
        records: of all its generations.
    """
    settings = config.run
    n, ended = len(records), f"(it was stopped by: {about.get('stopped_by')})"
    if settings.generations <= n:
        raise UsageError(
            f"{path} has finished {counted(n, 'generation')} {ended}: "
            f"continue it with --generations above {n}"
        )
    budget = settings.budget_evaluations
    if about.get("stopped_by") == "budget" and 0 < budget <= former.budget_evaluations:
        raise UsageError(
            f"{path} has spent its budget of {former.budget_evaluations} team evaluations: "
            f"continue it with --budget-evaluations above that, or 0 for no limit"
        )
    main = measures_of(config.build_world())[0]
    if has_reached(settings.target, main, records[-1]["performance"]):
        raise UsageError(
            f"{path} has reached run.target = {settings.target} in generation {n - 1}: "
            f"continue it with another --target, or --target none"
        )


def _former_end(
    config: RunConfig, about: Record, records: Sequence[Record], seal: Record
) -> Record:
    """Return the provenance entry for the former end of a run, actual or planned.

    Args:
        config: with the former length.
        about: the run's provenance.
        records: of all its generations.
        seal: digests of its files when it was finished, empty if it was not.
    """
    planned = {name: getattr(config.run, name) for name in LENGTH}
    return {
        "run_id": config.run_id,
        "planned": planned,
        "generations": len(records),
        "team_evaluations": records[-1]["team_evaluations"] if records else 0,
        "stopped_by": about.get("stopped_by"),
        "finished": about.get("finished"),
        "files": {name: seal[name] for name in ("champion.npz", "test.json") if name in seal},
    }


def refuse_parts(path: Path, length: Mapping[str, Any]) -> None:
    """Raise UsageError if a run belongs to a shaping or a campaign, which decides its length."""
    whole = path.resolve()
    if kind_of(whole.parent) == "shaping":
        raise UsageError(
            f"{path} is a stage of {path.parent}, whose stages keep their length; begin a run with "
            f"its populations: conevo run WORLD/ENVIRONMENT --from {quoted(path)}"
        )
    campaign = whole.parent.parent
    if whole.parent.name == "runs" and kind_of(campaign) == "campaign":
        sets = " ".join(f"--set run.{name}={value}" for name, value in length.items())
        raise UsageError(
            f"{path} is a run of the campaign {campaign}, which decides its length: "
            f"conevo campaign start {quoted(campaign)} {sets}"
        )
