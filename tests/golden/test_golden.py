"""Outcomes equal the recorded ones bit for bit; a new version of a world or method has new ones.

Kernels call no library mathematics; methods draw from numpy's generators.
"""

import json
from itertools import chain
from pathlib import Path

import pytest

from golden.outcomes import METHODS, RUNS, WORLDS, of_method, of_world

KNOWN = json.loads((Path(__file__).parent / "outcomes.json").read_text())
WORLD_OUTCOMES = {
    path: [f"{Path(path).name} {what}" for what in ("evaluate", "record")] for path in WORLDS
}
RUN_OUTCOMES = {
    (task, method): [f"{task} {method}", f"{task} {method} favourites"]
    for task in RUNS
    for method in METHODS
}


@pytest.mark.parametrize("path", WORLDS, ids=lambda path: Path(path).name)
def test_a_world_gives_the_outcomes_on_record(path: str) -> None:
    assert dict(of_world(path)) == {name: KNOWN[name] for name in WORLD_OUTCOMES[path]}


@pytest.mark.parametrize(("task", "method"), RUN_OUTCOMES)
def test_a_method_gives_the_outcomes_on_record(task: str, method: str) -> None:
    expected = {name: KNOWN[name] for name in RUN_OUTCOMES[task, method]}
    assert dict(of_method(task, method)) == expected


def test_the_record_has_no_other_outcomes() -> None:
    assert set(KNOWN) == {*chain(*WORLD_OUTCOMES.values(), *RUN_OUTCOMES.values())}
