"""Tests of teams as tables: the testing phase, changed conditions, the stages of a shaping."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from conevo.cli.format import castes, favourites, mean, n_finite, spread, table
from conevo.numbers import number
from conevo.runs.run import Run
from conevo.runs.shrinkage import shrinkage
from conevo.terms import S_SCALE, SHARE_SCALE, counted
from conevo.typing import Record

__all__ = ["conditions_text", "measures_of", "spreads", "stages_test_text", "test_text"]


def measures_of(tests: Iterable[Record]) -> list[str]:
    """Return the names of the measures of tests, in the order of their first appearance."""
    return list(dict.fromkeys(name for tested in tests for name in tested["performance"]))


def spreads(tested: Record, measures: Sequence[str]) -> list[str]:
    """Return a cell for each measure of a test: "-" where its world has no such measure."""
    return [spread(tested["performance"].get(name), tested["scenarios"]) for name in measures]


def _cells(tested: Record, measures: Sequence[str]) -> list[str]:
    """Return a cell for each measure of a test, and one for its mean S."""
    s = tested["specialization"]
    return [*spreads(tested, measures), number(sum(s) / len(s))]


def test_text(result: Record) -> str:
    """Return the testing phase as a table."""
    teams = {
        "first fittest team" if name == "generation_0" else "fittest team": tested
        for name, tested in result.items()
        if name != "validation"
    }
    tests = list(teams.values())
    n, measures = tests[0]["scenarios"], measures_of(tests)
    rows = [[name, str(t["generation"]), *_cells(t, measures)] for name, t in teams.items()]
    lines = [
        f"Testing phase, {counted(n, 'fresh scenario')} (mean +- standard deviation; S: {S_SCALE})",
        table(["", "generation", *measures, "S"], rows),
    ]
    for name, tested in teams.items():
        lines += [f"castes of the {name}: {castes(tested['castes'])}"]
        lines += _favourites_text(f"of the {name}", tested)
    lacking = [
        name for name in measures if any(n_finite(one["performance"][name]) < n for one in tests)
    ]
    if lacking:
        lines.append(
            f"warning: {', '.join(lacking)} is not finite in some scenarios; mean and standard "
            f"deviation are of the others (how many, in brackets)"
        )
    if "validation" in result:
        lines += ["", _shrinkage_text(result)]
    return "\n".join(lines)


def conditions_text(run: Run, both: Record) -> str:
    """Return the test of one team under its own and under changed conditions as a table."""
    own, changed, conditions = both["own"], both["changed"], both["conditions"]
    measures = measures_of([own, changed])
    rows = [
        [name, str(len(both[name]["labels"])), *_cells(both[name], measures)]
        for name in ("own", "changed")
    ]
    rows.append(["change", "", *(number(both["change"].get(one)) for one in measures), ""])
    settings = "".join(f", {key}={value}" for key, value in conditions["settings"].items())
    if rotate := conditions["rotate"]:
        equal = ", which are all equal" if conditions["clones"] else ""
        settings += f", controllers rotated by {rotate}{equal}"
    lines = [
        f"Champion of {run.path} (generation {own['generation']}), "
        f"{counted(own['scenarios'], 'fresh scenario')} (mean +- standard deviation)",
        f"own conditions: {run.config.task}",
        f"changed conditions: {conditions['task']}, "
        f"{counted(conditions['robots'], 'robot')}{settings}",
        table(["conditions", "robots", *measures, "S"], rows),
        f"castes, own: {castes(own['castes'])}",
        f"castes, changed: {castes(changed['castes'])}",
        *_favourites_text("under own conditions", own),
        *_favourites_text("under changed conditions", changed),
    ]
    return "\n".join(lines)


def stages_test_text(results: Sequence[Record]) -> str:
    """Return the tests of one team in the environments of all stages as a table."""
    measures, last = measures_of(results), results[0]
    rows = [
        [str(one["stage"]), one["task"], *_cells(one, measures), castes(one["castes"])]
        for one in results
    ]
    return (
        f"The fittest team of stage {last['team_of']} (generation {last['generation']}), "
        f"{counted(last['scenarios'], 'fresh scenario')} of each stage "
        f"(mean +- standard deviation; S: {S_SCALE})\n"
        + table(["stage", "task", *measures, "S", "castes"], rows)
    )


def _favourites_text(of: str, tested: Mapping[str, Any]) -> list[str]:
    """Return the favourite settings of a tested team, which earlier versions did not record."""
    if "favourites" not in tested:
        return []
    shares = [share for share in tested["favourite_shares"] if share is not None]
    names = sorted(name for name in tested["favourites"] if name is not None)
    sizes = dict(Counter(names).most_common())
    liked = favourites(sizes, sum(shares) / len(shares) if shares else None)
    return [f"favourite settings {of}: {liked}; {SHARE_SCALE}"]


def _shrinkage_text(result: Record) -> str:
    """Return the values by which the champion was chosen, and those in fresh scenarios."""
    about, n_tests = result["validation"], result["champion"]["scenarios"]
    rows = [
        [
            one["measure"],
            number(one["selection"]),
            mean(one["validation"], about["scenarios"]),
            mean(one["test"], n_tests),
            number(one["ratio"]),
        ]
        for one in shrinkage(result)
    ]
    return (
        f"The fittest team (generation {about['chosen']}) is the best of "
        f"{counted(len(about['finalists']), 'finalist')} in "
        f"{counted(about['scenarios'], 'validation scenario')}\n"
        + table(["", "selection", "validation", "test", "test / selection"], rows)
    )
