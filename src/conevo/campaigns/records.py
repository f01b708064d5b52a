"""What a line of a campaign's ``runs.jsonl`` holds, as a model that it is checked against."""

from __future__ import annotations

from typing import Annotated, NotRequired

from annotated_types import Ge, Le, MinLen
from pydantic import StringConstraints
from typing_extensions import TypedDict

from conevo.runs.records import RunId

__all__ = ["PlannedLine"]

Label = Annotated[str, StringConstraints(pattern=r"^[^/.\x00-\x1f][^/\x00-\x1f]*$")]


class PlannedLine(TypedDict):
    """A line of ``runs.jsonl``, see ``PlannedRun``."""

    label: Label
    world: str
    method: str
    preset: str
    seed: Annotated[int, Ge(0), Le(2**63 - 1)]
    variant: str
    overrides: dict[str, bool | int | float | str]
    shape: bool
    studies: list[str]
    run_ids: Annotated[list[RunId], MinLen(1)]
    of_first: NotRequired[
        dict[str, bool | int | float | str]
    ]  # conevo 0.2.0.dev0 had none at first
