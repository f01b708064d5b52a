"""By what runs differ, settings, origin and code: only runs that are alike have a common median."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from conevo.watch.tail import readable

__all__ = ["CODE", "FROM", "Choices", "choices_of", "comparisons", "differences"]

Choices = tuple[tuple[str, str], ...]  # key and value of all but names and seed
NAMES = ("run.world", "run.method", "run.preset", "run.seed")
METHOD = "method."
FROM, CODE = "run.from", "run.code"  # the origin of a run, and what evolved it
LISTED = 4  # settings that a label names
LONGEST = 120  # characters of a label


def choices_of(settings: Mapping[str, object]) -> Choices:
    """Return settings, "method.gst" -> 0.2, as text."""
    return tuple((key, str(value)) for key, value in sorted(settings.items()) if key not in NAMES)


def differences(methods: Sequence[str], settings: Sequence[Choices]) -> list[dict[str, str]]:
    """Return what sets runs apart: settings of worlds and runs, and of runs of the same method.

    Args:
        methods: of the runs.
        settings: of the runs.

    Returns:
        For every run the settings that are not the same in all; "" for one that it does not have.
    """
    tables = [dict(one) for one in settings]
    common = _differing([{k: v for k, v in t.items() if METHOD not in k} for t in tables])
    own: list[dict[str, str]] = [{}] * len(tables)
    for method in dict.fromkeys(methods):
        members = [k for k, name in enumerate(methods) if name == method]
        parts = _differing([{k: v for k, v in tables[m].items() if METHOD in k} for m in members])
        for member, part in zip(members, parts, strict=True):
            own[member] = part
    return [one | other for one, other in zip(common, own, strict=True)]


def comparisons(parts: Sequence[Mapping[str, str]]) -> list[tuple[str, list[int]]]:
    """Return which runs are compared, and what sets them apart from the others.

    A setting that only runs of one method have is compared with the other runs at each of its
    values, as in a plan.

    Args:
        parts: of every run the settings by which runs differ.

    Returns:
        For every comparison a label, "gst=0.2" or "", and the numbers of its runs.
    """
    distinct = [dict(one) for one in dict.fromkeys(tuple(sorted(p.items())) for p in parts)]
    found: dict[str, list[int]] = {}
    for one in distinct:
        if any(one.items() < other.items() for other in distinct):
            continue
        members = [k for k, part in enumerate(parts) if part.items() <= one.items()]
        found[_label(one, found)] = members
    return list(found.items())


def _differing(tables: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    """Return of each table what is not the same in all.

    A run that has not begun has no code yet, and goes with runs of any.
    """
    keys = dict.fromkeys(key for table in tables for key in table)
    values = {key: {table.get(key) for table in tables} for key in keys}
    apart = [key for key in keys if len(values[key] - ({None} if key == CODE else set())) > 1]
    return [
        {key: table.get(key, "") for key in apart if key != CODE or key in table}
        for table in tables
    ]


def _label(settings: Mapping[str, str], taken: Iterable[str]) -> str:
    """Return settings as a label that is not taken yet."""
    names = [f"{_short(k)}={v}" if v else f"no {_short(k)}" for k, v in settings.items()]
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    text = label = readable(", ".join(names[:LISTED]))[:LONGEST] + more
    n = 2
    while label in taken:
        label, n = f"{text} ({n})", n + 1
    return label


def _short(key: str) -> str:
    """Return a setting's name without its table; that of a stage keeps the stage."""
    stage = key.partition(".")[0] if key.startswith("stage-") else ""
    return f"{stage} {key.rpartition('.')[2]}".strip()
