"""Results of other tools next to those of a campaign: in a table and in curves, and in no test.

They have other scenarios and no castes, so the sections of the campaign's own runs, its tests and
the verdicts on claims never contain them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, stdev

import numpy as np

from conevo.campaigns.campaign import Campaign
from conevo.controllers.registry import CONTROLLERS
from conevo.errors import ConevoError
from conevo.report.comparison import Cell, Treatment
from conevo.report.exhibits import Column, Exhibit, Figure, Section, Table, plain, slug
from conevo.report.figures import curves
from conevo.report.foreign import Foreign
from conevo.report.learning_curves import Course, Histories, courses, read_histories
from conevo.report.sections.scope import Scope
from conevo.runs.run import Run

__all__ = ["ComparisonRow", "foreign"]

NOT_STATED = "not stated"


@dataclass(frozen=True)
class ComparisonRow:
    """A row of a fair comparison: the result of a method in a task, and how it was reached.

    None, or "not stated": unknown.

    Attributes:
        task: world and environment, or those of the other tool.
        method: as published; a foreign one is marked.
        team: whose result it is: of the current, best or last team or policy.
        measure: with its unit.
        values: of the runs.
        team_steps, robot_steps: spent by a run, mean.
        seconds: wall clock of a run, mean.
        machine: on which.
        parameters: of a policy, or of the controller of one robot.
        is_shared: whether all robots have the same.
        memory, actions, policy, scenarios: in words.
    """

    task: str
    method: str
    team: str
    measure: str
    values: tuple[float, ...]
    team_steps: float | None = None
    robot_steps: float | None = None
    seconds: float | None = None
    machine: str = NOT_STATED
    parameters: int | None = None
    is_shared: bool | None = None
    memory: str = NOT_STATED
    actions: str = NOT_STATED
    policy: str = NOT_STATED
    scenarios: str = NOT_STATED


COLUMNS: list[Column[ComparisonRow]] = [
    Column("task", "task", plain, of=lambda c: c.task),
    Column("method", "method", plain, of=lambda c: c.method),
    Column("team", "team", plain, of=lambda c: c.team),
    Column("measure", "measure", plain, of=lambda c: c.measure),
    Column("n", "n", of=lambda c: len(c.values)),
    Column("mean", "mean", of=lambda c: fmean(c.values)),
    Column("sd", "sd", of=lambda c: stdev(c.values) if len(c.values) > 1 else None),
    Column("team_steps", "team-steps", of=lambda c: c.team_steps),
    Column("robot_steps", "robot-steps", of=lambda c: c.robot_steps),
    Column("seconds", "wall clock, s", of=lambda c: c.seconds),
    Column("machine", "machine", plain, is_wide=True, of=lambda c: c.machine),
    Column("parameters", "parameters", of=lambda c: c.parameters),
    Column("shared", "shared", plain, of=lambda c: _yes_or_no(c.is_shared)),
    Column("memory", "memory", plain, of=lambda c: c.memory),
    Column("actions", "actions", plain, of=lambda c: c.actions),
    Column("policy", "policy at test", plain, of=lambda c: c.policy),
    Column("scenarios", "scenarios", plain, is_wide=True, of=lambda c: c.scenarios),
]


def foreign(
    scopes: Sequence[Scope], campaign: Campaign, others: Sequence[Foreign]
) -> Section | None:
    """Return foreign results with the campaign's own in the same tasks; None without any.

    Args:
        scopes: the groups of the campaign's runs.
        campaign: whose runs state their controllers and machines.
        others: the foreign results.
    """
    if not others:
        return None
    rows = [row for s in scopes for row in _own(s, campaign, _tasks(s, others))]
    has_own = bool(rows)
    rows += [row for one in others for row in _of_foreign(one, _team_size(scopes, one))]
    table = Table.of(
        "foreign-results",
        "Foreign results, and the campaign's own in the same tasks",
        "n: runs; mean and sd over runs. A champion is the best team so far, chosen in validation "
        "scenarios, in its test; last: the fittest team of the last generation, or the last "
        "evaluation of a policy; best: its highest evaluation, which is above what it would reach "
        "again. Rows marked foreign were not made by conevo.",
        COLUMNS,
        rows,
    )
    drawn = [one for scope in scopes for one in _figures(scope, others)]
    return Section("Foreign results", _text(others, has_own), [table, *drawn])


def _text(others: Sequence[Foreign], has_own: bool) -> list[str]:
    named = sorted({one.title for one in others})
    text = [
        f"Results of other tools: {', '.join(named)}. They are of other scenarios and state no "
        "castes, so they are in no test and in no verdict on a claim; differences between them and "
        "the campaign's own are not tested."
    ]
    if not has_own:
        text.append("No task is one of this campaign's, so they are listed alone.")
    if any(one.frames == "robot" and one.team_steps() is None for one in others):
        text.append(
            "Their steps are those of single robots, and the size of a team is not stated, so "
            "team-steps are unknown for some."
        )
    return text


# --- rows -----------------------------------------------------------------------------------------


def _own(scope: Scope, campaign: Campaign, tasks: set[str]) -> Iterator[ComparisonRow]:
    """Yield the champion's result, and the last generation's, of each cell in these tasks."""
    spent = {
        run: row
        for _, run, *row in scope.per_cell(
            "SELECT cell, run, r.team_steps, r.n_robots, r.seconds, arg_max(g.value, g.generation),"
            " (SELECT count(*) FROM scores s WHERE s.run = r.run AND s.study = 'test'"
            " AND s.team = 'champion' AND s.measure = r.measure)"
            " FROM own JOIN runs r USING (run) LEFT JOIN generations g USING (run)"
            " GROUP BY ALL ORDER BY run"
        )
    }
    for cell in scope.ordered(scope.cells):
        if cell.environment not in tasks:
            continue
        runs = scope.cells[cell]
        rows = [spent[one.run] for one in runs]
        steps, robots = fmean(row[0] for row in rows), rows[0][1]
        machine, parameters, is_shared, memory = _controller(campaign.paths.run(runs[0].run))
        common = ComparisonRow(
            task=runs[0].task,
            method=cell.treatment.title,
            team="champion",
            measure=scope.unit,
            values=tuple(one.value for one in runs),
            team_steps=steps,
            robot_steps=None if robots is None else steps * robots,
            seconds=fmean(row[2] for row in rows),
            machine=machine,
            parameters=parameters,
            is_shared=is_shared,
            memory=memory,
            actions="the controller's outputs",
            policy="deterministic",
            scenarios=f"fresh, {rows[0][4]}",
        )
        yield common
        last = [row[3] for row in rows if row[3] is not None and math.isfinite(row[3])]
        if last:
            about = {"team": "last", "values": tuple(last), "scenarios": "the last generation's"}
            yield ComparisonRow(**{**vars(common), **about})


def _controller(path: Path) -> tuple[str, int | None, bool | None, str]:
    """Return the machine of a run, and its champion's parameters, sharing and memory."""
    if not path.is_dir():
        return NOT_STATED, None, None, NOT_STATED
    try:
        run = Run(path)
        about = run.tables()["controller"]
        team, machine = run.champion, str(run.provenance["cpu"])
    except (ConevoError, KeyError):  # a damaged run is reported elsewhere
        return NOT_STATED, None, None, NOT_STATED
    entry = CONTROLLERS.get(about["name"])
    memory = "none"
    if entry is None or entry.remembers(about):
        memory = f"context ({about['name']})"
    if team is None:
        return machine, None, None, memory
    sizes = team.active.sum(axis=1) * team.genes.shape[2]
    is_shared = all(np.array_equal(team.genes[0], one) for one in team.genes)
    return machine, round(float(sizes.mean())), is_shared, memory


def _of_foreign(one: Foreign, robots: int | None) -> Iterator[ComparisonRow]:
    """Yield the last and the best evaluations of a foreign method."""
    found = one.team_steps(robots)
    steps = None if found is None else fmean(of[-1] for of in found)
    size, about = one.about.get("robots", robots), one.about
    if one.frames == "robot":
        counted: float | None = fmean(run[-1][0] for run in one.runs)
    else:
        counted = None if size is None or steps is None else steps * size
    same = "" if slug(one.is_measure) == slug(one.measure) else f" (there {one.measure})"
    for team, values in (("last", one.last), ("best", one.best)):
        yield ComparisonRow(
            task=one.task,
            method=one.title,
            team=team,
            measure=f"{one.is_measure}{same}",
            values=tuple(values),
            team_steps=steps,
            robot_steps=counted,
            seconds=about.get("seconds"),
            machine=about.get("machine", NOT_STATED),
            parameters=about.get("parameters"),
            is_shared=about.get("shared"),
            memory=about.get("memory", NOT_STATED),
            actions=about.get("actions", NOT_STATED),
            policy=about.get("policy", NOT_STATED),
            scenarios=about.get("scenarios", NOT_STATED),
        )


def _yes_or_no(value: bool | None) -> str:
    return NOT_STATED if value is None else "yes" if value else "no"


# --- tasks ----------------------------------------------------------------------------------------


def _tasks(scope: Scope, others: Sequence[Foreign]) -> set[str]:
    """Return the environments of a group that are the task of a foreign result."""
    return {e for e in scope.environments if any(_is_task(scope, e, one) for one in others)}


def _is_task(scope: Scope, environment: str, one: Foreign) -> bool:
    world = scope.group.world
    short = world.rpartition("-v")[0] or world
    return not one.names.isdisjoint({slug(f"{name}/{environment}") for name in (world, short)})


def _team_size(scopes: Sequence[Scope], one: Foreign) -> int | None:
    """Return the robots of a team in the task of a foreign result, None if they are not known."""
    for scope in scopes:
        for environment in scope.environments:
            if _is_task(scope, environment, one):
                sizes = {
                    size
                    for cell, size in scope.per_cell(
                        "SELECT cell, n_robots FROM own JOIN runs USING (run)"
                    )
                    if cell.environment == environment
                }
                return sizes.pop() if len(sizes) == 1 else None
    return None


# --- curves ---------------------------------------------------------------------------------------


def _figures(scope: Scope, others: Sequence[Foreign]) -> Iterator[Exhibit]:
    """Yield the learning curves over team-steps of a group with foreign results of its measure."""
    lines: dict[str, dict[curves.Line, Course]] = {}
    titles: dict[curves.Line, str] = {}
    rows = []
    own = courses(read_histories(scope.tables, scope.group, "team_steps"), "value")
    for environment in scope.environments:
        same = [
            (one, steps)
            for one in others
            if _is_task(scope, environment, one)
            and slug(one.is_measure) == slug(scope.main.name)
            and (steps := one.team_steps(_team_size([scope], one))) is not None
        ]
        if not same:
            continue
        found = {
            cell.treatment: course
            for cell, course in own.items()
            if cell.environment == environment
        }
        for one, steps in same:
            (course,) = courses(_history(one, steps), "value").values()
            found[Treatment(one.title, "")] = course
        for treatment, course in found.items():
            title = treatment.title
            line = curves.Line(title if treatment.variant else treatment.method)
            titles[line] = title
            lines.setdefault(environment, {})[line] = course
            rows += [
                {"environment": environment, "method": title, "team_steps": x, "mean": mean}
                | {"interval": (low, high), "n": course.n}
                for x, mean, low, high in zip(*course[:4], strict=True)
            ]
    if lines:
        yield Figure(
            f"{scope.stem}-foreign",
            f"Task performance ({scope.unit}; {scope.main.direction}) over team-steps, with "
            "foreign results",
            "Mean over runs at equal numbers of team-steps, with Student's 95 % interval as a band "
            "where there are several. Own: the fittest team of each generation; foreign: each "
            "evaluation, in scenarios of its own.",
            rows=rows,
            drawing=curves.lines(
                lines, titles, x_label="team-steps", y_label=scope.unit, within=scope.within
            ),
        )


def _history(one: Foreign, steps: Sequence[Sequence[float]]) -> Histories:
    """Return the evaluations of a foreign method as if they were generations."""
    cell = Cell(one.task, Treatment(one.title, ""))
    values = [value for run in one.runs for _, value in run]
    return Histories(
        cells=[cell] * len(one.runs),
        starts=np.cumsum([0, *map(len, one.runs)]),
        evaluations=np.array([x for run in steps for x in run], dtype=np.float64),
        columns={"value": np.array(values, dtype=np.float64)},
        castes=[],
        shares=np.zeros((len(values), 0)),
    )
