"""Models of the JSON files of a run, against which they are checked where they are read.

Keys that a model does not have are left alone: a later version may write them. Optional keys are
those that an earlier version did not write. None stands for a number that was not finite.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NotRequired

from annotated_types import Ge, Le, MinLen
from pydantic import AllowInfNan, StringConstraints
from typing_extensions import TypedDict

__all__ = [
    "Extension",
    "FileText",
    "Generation",
    "Provenance",
    "RunId",
    "Seal",
    "ShapingText",
    "Testing",
    "contradiction",
    "own_numbers",
]

Count = Annotated[int, Ge(0), Le(2**63 - 1)]
Seconds = Annotated[float, Ge(0)]
Finite = float | None
RunId = Annotated[str, StringConstraints(pattern="^[0-9a-f]{12}$")]
Digest = Annotated[str, StringConstraints(pattern="^[0-9a-f]{32}$")]


FAVOURITES = (
    "favourites",
    "favourite_shares",
)  # of a test, one for each robot; earlier versions wrote none


class MeasureHeader(TypedDict):
    """A measure of task performance, see ``worlds.measures``."""

    name: str
    unit: str
    larger_is_better: bool


class WorldHeader(TypedDict):
    """The properties of a world that are known without loading it."""

    name: str
    environment: str
    measures: Annotated[list[MeasureHeader], MinLen(1)]
    castes: list[str]
    n_robots: Annotated[int, Ge(1)]
    iterations: Annotated[int, Ge(1)]
    optimum: Finite


class MethodHeader(TypedDict):
    """The properties of a method that are known without loading it."""

    name: str
    title: str


class Session(TypedDict):
    """One start or resume of a run."""

    started: str
    from_generation: Count
    threads: Annotated[int, Ge(1)]
    conevo: NotRequired[str]
    code: NotRequired[str]
    numpy: NotRequired[str]
    warp: NotRequired[str]
    device: NotRequired[str]


class Origin(TypedDict):
    """The run whose populations a run began with."""

    path: str
    run_id: RunId
    generation: Count
    checkpoint: Digest
    code: NotRequired[str]
    of: NotRequired[Literal["champion"]]


class Length(TypedDict):
    """The settings that end a run, see ``RunSettings``."""

    generations: Annotated[int, Ge(1)]
    budget_evaluations: Count
    target: Finite


class FormerEnd(TypedDict):
    """The actual or planned end of a run before its length was changed."""

    at: str
    run_id: RunId
    planned: Length
    generations: Count
    team_evaluations: Count
    stopped_by: str | None
    finished: str | None


class Provenance(TypedDict):
    """``provenance.json``: the origin of a run."""

    run_id: RunId
    preset: str
    command: str
    device: str
    kernel_hash: str
    created: str
    conevo: str
    python: str
    numpy: str
    warp: str
    platform: str
    cpu: str
    sessions: list[Session]
    code: NotRequired[str]
    stem_id: NotRequired[RunId]
    world: NotRequired[WorldHeader]
    method: NotRequired[MethodHeader]
    origin: NotRequired[Origin]
    extended: NotRequired[list[FormerEnd]]
    finished: NotRequired[str]
    stopped_by: NotRequired[str]


class Extension(TypedDict):
    """``extension.json``: another length that a run is being given."""

    run_id: RunId
    length: Length
    config: str
    changed: list[str]
    former: FormerEnd


class Generation(TypedDict):
    """A line of ``generations.jsonl``; a method may add numbers of its own."""

    generation: Count
    team_evaluations: Count
    team_steps: Count
    seconds: Seconds
    best_fitness: Finite
    mean_fitness: Finite
    team_fitness: Finite
    performance: Annotated[dict[str, Finite], MinLen(1)]
    castes: dict[str, Count]
    favourites: NotRequired[dict[str, Count]]
    favourite_share: NotRequired[Finite]
    specialization: Finite
    sst: Finite
    gst: Finite
    recombinations: Count
    n_hidden: Annotated[list[Count], MinLen(1)]
    n_nonfinite: Count


def own_numbers(records: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the names that a method has given numbers of its own in the lines of a log."""
    known = {*Generation.__annotations__, "type_c_evaluations", "number", "stage", "task"}
    others = dict.fromkeys(name for one in records for name in one if name not in known)
    return [name for name in others if all(_is_number(one.get(name)) for one in records)]


def _is_number(value: Any) -> bool:
    """Whether a value is null or a number that is no longer than those of a log are."""
    return value is None or (isinstance(value, (int, float)) and not abs(value) > 2**63)


class Spread(TypedDict):
    """A measure over scenarios."""

    mean: Finite
    sd: Finite
    values: list[Finite]
    n: NotRequired[Count]


class Tested(TypedDict):
    """A team's testing phase."""

    generation: Count
    scenarios: Annotated[int, Ge(1)]
    seed: Annotated[int, Ge(0), Le(2**64 - 1)]
    performance: Annotated[dict[str, Spread], MinLen(1)]
    fitness: Spread
    specialization: list[Finite]
    labels: Annotated[list[str], MinLen(1)]
    castes: dict[str, Count]
    favourites: NotRequired[list[str | None]]
    favourite_shares: NotRequired[list[Finite]]
    n_hidden: Annotated[list[Count], MinLen(1)]


class Selected(TypedDict):
    """A finalist in the scenarios that it was chosen on."""

    fitness: Finite
    performance: dict[str, Finite]


class Validated(TypedDict):
    """A finalist in the validation scenarios."""

    fitness: Spread
    performance: dict[str, Spread]


class Finalist(TypedDict):
    """One of the teams from which validation chooses the champion."""

    generation: Count
    selection: Selected
    validation: Validated


class Validation(TypedDict):
    """How the champion was chosen."""

    scenarios: Annotated[int, Ge(1)]
    chosen: Count
    finalists: Annotated[list[Finalist], MinLen(1)]


class Testing(TypedDict):
    """``test.json``: the testing phase of a run."""

    champion: Tested
    generation_0: Tested
    validation: NotRequired[Validation]


def contradiction(found: Mapping[str, Any]) -> str:
    """Return a contradiction in a testing phase, empty if there is none."""
    teams = {name: found[name] for name in ("champion", "generation_0")}
    for name, team in teams.items():
        if not len(team["labels"]) == len(team["specialization"]) == len(team["n_hidden"]):
            return f"{name} has a different number of labels and robots"
        n, likes = len(team["labels"]), [len(team[key]) for key in FAVOURITES if key in team]
        if likes not in ([], [n, n]):
            return f"{name} has a different number of favourites, or of their shares, and robots"
    parts = list(teams.values())
    if "validation" in found:
        about = found["validation"]
        if about["chosen"] not in [one["generation"] for one in about["finalists"]]:
            return f"validation.chosen = {about['chosen']} is not among the finalists"
        parts += [one[how] for one in about["finalists"] for how in ("selection", "validation")]
    if len({frozenset(part["performance"]) for part in parts}) > 1:
        return "not all teams have the same measures"
    return ""


class Seal(TypedDict):
    """``DONE``: the digest of every file when the directory was sealed."""

    files: dict[str, Digest]


class FileText(TypedDict):
    """The text of a checkpoint or team file, next to its arrays."""

    format: int
    identity: dict[str, str]
    fields: dict[str, bool | int | Annotated[float, AllowInfNan()] | str]


class ShapingText(TypedDict):
    """``shaping.toml``: the settings of every stage."""

    format: int
    command: str
    device: str
    run_ids: list[RunId]
    tasks: NotRequired[list[str]]
    stages: Annotated[list[dict[str, dict[str, bool | int | float | str]]], MinLen(1)]
