"""The performance of a champion in scenarios that did not select it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["shrinkage"]


def shrinkage(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Compare a champion's values in the scenarios that selected it with those in fresh ones.

    Args:
        result: the testing phase of a run, with its "validation".

    Returns:
        A row for its robots' mean fitness ("fitness"), by which it was selected, and for each
        performance measure: its mean at "selection", its ``spread`` in "validation" and "test", and
        the "ratio" of test to selection, None where selection has no positive value.
    """
    about, tested = result["validation"], result["champion"]
    chosen = next(one for one in about["finalists"] if one["generation"] == about["chosen"])
    parts = (chosen["selection"], chosen["validation"], tested)
    found = {"fitness": [part["fitness"] for part in parts]}
    found |= {name: [part["performance"][name] for part in parts] for name in tested["performance"]}
    rows = []
    for measure, (selection, validation, test) in found.items():
        is_positive = selection is not None and selection > 0 and test["mean"] is not None
        ratio = test["mean"] / selection if is_positive else None
        row = {"measure": measure, "selection": selection, "validation": validation, "test": test}
        rows.append(row | {"ratio": ratio})
    return rows
