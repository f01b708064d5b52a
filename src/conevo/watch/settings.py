"""Differences between runs, in settings, origin and code: only similar runs share a median."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

from conevo.watch.tail import readable

__all__ = ["CODE", "FROM", "Choices", "choices_of", "comparisons", "differences", "free_label"]

Choices = tuple[tuple[str, str], ...]  # key and value of all but names and seed
NAMES = ("run.world", "run.method", "run.preset", "run.seed")
METHOD = "method."
FROM, CODE = "run.from", "run.code"  # the origin of a run, and the code that evolved it
LISTED = 4  # settings in a label
LONGEST = 120  # characters of a label


def choices_of(settings: Mapping[str, object]) -> Choices:
    """Return settings, "method.gst" -> 0.2, as text."""
    return tuple((key, str(value)) for key, value in sorted(settings.items()) if key not in NAMES)


def differences(methods: Sequence[str], settings: Sequence[Choices]) -> list[dict[str, str]]:
    """Return the settings that distinguish runs.

    Those of methods are compared among the runs of a method, all others among all runs.

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
    """Return groups of runs to be compared, with the settings that distinguish each group.

    A setting that only runs of one method have is compared with the other runs at each of its
    values, as in a plan.

    Args:
        parts: of every run the settings that are not the same in all.

    Returns:
        For every comparison a label, "gst=0.2" or "", and the numbers of its runs.
    """
    distinct = [dict(one) for one in dict.fromkeys(tuple(sorted(p.items())) for p in parts)]
    found: dict[str, list[int]] = {}
    for one in distinct:
        if any(one.items() < other.items() for other in distinct):
            continue
        members = [k for k, part in enumerate(parts) if part.items() <= one.items()]
        found[free_label(_label(one), found)] = members
    return list(found.items())


def free_label(wanted: str, taken: Container[str]) -> str:
    """Return a label that is not taken: the one wanted, or with a number, "gst=0.2 (2)"."""
    label, n = wanted, 1
    while label in taken:
        n += 1
        label = f"{wanted} ({n})"
    return label


def _differing(tables: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    """Return the part of each table that is not the same in all.

    A run that has not begun has no code yet, and is compared with runs of any code.
    """
    keys = dict.fromkeys(key for table in tables for key in table)
    values = {key: {table.get(key) for table in tables} for key in keys}
    apart = [key for key in keys if len(values[key] - ({None} if key == CODE else set())) > 1]
    return [
        {key: table.get(key, "") for key in apart if key != CODE or key in table}
        for table in tables
    ]


def _label(settings: Mapping[str, str]) -> str:
    names = [f"{_short(k)}={v}" if v else f"no {_short(k)}" for k, v in settings.items()]
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return readable(", ".join(names[:LISTED]))[:LONGEST] + more


def _short(key: str) -> str:
    """Return a setting's name without its table, but with its stage."""
    stage = key.partition(".")[0] if key.startswith("stage-") else ""
    return f"{stage} {key.rpartition('.')[2]}".strip()
