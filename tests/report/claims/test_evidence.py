"""Quantities read from the tables, run by run, from rows written by hand."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import duckdb
import pytest

from conevo.campaigns.schema import SCHEMA
from conevo.campaigns.tables import Tables
from conevo.report.claims import CLAIMS, verdicts
from conevo.report.claims.evidence import read_evidence
from conevo.report.claims.quantities import QUANTITIES
from conevo.report.claims.statements import Compare, Sample, Within
from report.claims.known_truth import Cell, rover, write_tables

RUN = {
    "run": "a",
    "task": "rover-v2/complex-1",
    "world": "rover-v2",
    "environment": "complex-1",
    "family": "complex",
    "number": 1,
    "method": "cone",
    "preset": "smoke",
    "seed": 1,
    "variant": "",
    "generations": 1,
    "evaluations": 100,
    "team_steps": 1000,
    "seconds": 1.0,
    "core_seconds": 1.0,
    "stopped_by": "budget",
    "measure": "value",
    "optimum": None,
    "n_robots": 20,
    "exchanges": None,
    "exchange_share": None,
    "run_id": "a",
    "conevo": "",
    "code": "",
    "changes": "",
    "numpy": "",
    "warp": "",
    "kernel_hash": "",
}
Row = dict[str, Any]


def write(folder: Path, **tables: Sequence[Row]) -> Path:
    """Write tables from rows."""
    for name, rows in tables.items():
        text = folder / f"{name}.jsonl"
        text.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
        duckdb.sql(
            f"COPY (SELECT * FROM read_json('{text}', format='newline_delimited',"
            f" columns={SCHEMA[name]})) TO '{folder / name}.parquet' (FORMAT parquet)"
        )
    return folder


def score(
    study: str, team: str, *values: float, measure: str = "value", run: str = "a"
) -> list[Row]:
    """Return the rows of one team, a scenario each."""
    row = {"run": run, "study": study, "team": team, "measure": measure}
    return [row | {"scenario": k, "value": value} for k, value in enumerate(values)]


def robots(castes: Iterable[str]) -> list[Row]:
    rest = {"run": "a", "specialization": 0.1, "fitness": 1.0, "hidden": 10}
    return [rest | {"robot": k, "caste": caste} for k, caste in enumerate(castes)]


def behaviours(kind: str, **counts: int) -> list[Row]:
    return [
        {"run": "a", "kind": kind, "behaviour": name.replace("_", "-"), "count": count}
        for name, count in counts.items()
    ]


def read(folder: Path, quantity: str) -> float | None:
    """Return a quantity of the run "a"."""
    with Tables(folder) as tables:
        return QUANTITIES[quantity].read(tables).get("a")


def test_measures_are_means_of_the_champions_test(tmp_path: Path) -> None:
    scores = [
        *score("test", "champion", 10, 30),
        *score("test", "champion", 0.25, 0.75, measure="area"),
        *score("test", "generation 0", 1, 1),
        *score("lesion", "whole", 90, 90),
        *score("clones", "whole", 12, 14),
    ]
    write(tmp_path, runs=[RUN | {"optimum": 40}], scores=scores)
    assert read(tmp_path, "value") == 20
    assert read(tmp_path, "area") == 0.5
    assert read(tmp_path, "share of the optimum") == 0.5
    assert read(tmp_path, "evolved") == 13
    assert read(tmp_path, "capture_time") is None


@pytest.mark.parametrize(
    ("whole", "castes", "lesioned", "loss"),
    [
        ([100, 300], {"low": [50, 50], "hi": [150, 150]}, 100, 0.5),  # losses of 3/4 and 1/4
        ([100, 100], {"low": [400, 400]}, 400, -0.75),  # a gain: -1 at worst
        ([100, 100], {"low": [0, 0]}, 0, 1),
        ([0, 0], {"low": [0, 0]}, 0, None),  # nothing to lose
        ([0, 0], {"low": [0, 0], "hi": [10, 10]}, 5, -1),
        ([100, 100], {}, None, None),
    ],
)
def test_loss_is_the_lost_share(
    whole: list[float],
    castes: dict[str, list[float]],
    lesioned: float | None,
    loss: float | None,
    tmp_path: Path,
) -> None:
    scores = score("lesion", "whole", *whole)
    scores += score("lesion", "whole", 1, 1, measure="area")
    for caste, values in castes.items():
        scores += score("lesion", caste, *values)
    write(tmp_path, runs=[RUN], scores=scores)
    assert read(tmp_path, "loss") == loss
    assert read(tmp_path, "lesioned") == lesioned
    assert read(tmp_path, "whole") == (sum(whole) / 2 if castes else None)


def test_clones_are_the_best_of_a_runs_cloned_teams(tmp_path: Path) -> None:
    scores = [
        *score("clones", "whole", 500, 500),
        *score("clones", "low", 10, 30),
        *score("clones", "hi", 60, 0),
        *score("clones", "non-specialized", 70, 90),
        *score("clones", "hi", 900, 900, measure="area"),
        *score("lesion", "hi", 900, 900),
    ]
    write(tmp_path, runs=[RUN], scores=scores)
    assert read(tmp_path, "clones") == 80
    assert read(tmp_path, "clones of a specialist") == 30


@pytest.mark.parametrize(
    ("castes", "one", "several"),
    [
        (["non-specialized", "low", "hi", "hi"], 0, 1),
        (["non-specialized", "low", "move"], 0, 0),  # moving does not detect (5.5.2)
        (["non-specialized", "low", "low"], 0, 0),
        (["low", "hi", "med"], 0, 0),  # no robot is non-specialized
        (["non-specialized"] * 3, 1, 0),
        (["hi", "hi"], 1, 0),
    ],
)
def test_castes_of_a_team(castes: list[str], one: int, several: int, tmp_path: Path) -> None:
    write(tmp_path, runs=[RUN], robots=robots(castes))
    assert read(tmp_path, "one caste") == one
    assert read(tmp_path, "several castes") == several


@pytest.mark.parametrize(
    ("castes", "found"),
    [
        (["non-specialized", "low", "med", "hi"], {"two", "mixed", "all", "low", "med", "hi"}),
        (["non-specialized", "hi", "move"], {"two", "mixed", "hi"}),
        (["low", "hi"], {"two", "low", "hi"}),
        (["hi", "move"], {"hi"}),
        (["hi", "hi"], {"hi", "only hi"}),
        (["med"], {"med", "only med"}),
        (["non-specialized"] * 2, set()),
    ],
)
def test_which_castes_a_team_has(castes: list[str], found: set[str], tmp_path: Path) -> None:
    names = {f"{k} castes": k for k in ("two", "mixed", "all")}
    names |= {f"some {k}": k for k in ("low", "med", "hi")}
    names |= {k: k for k in ("only med", "only hi")}
    write(tmp_path, runs=[RUN], robots=robots(castes))
    assert {short for name, short in names.items() if read(tmp_path, name)} == found


def test_clones_of_one_caste_and_the_lost_area(tmp_path: Path) -> None:
    scores = [
        *score("clones", "med", 10, 30),
        *score("clones", "non-specialized", 70, 90),
        *score("lesion", "whole", 1, 1),
        *score("lesion", "low", 1, 1),
        *score("lesion", "whole", 0.4, 0.6, measure="area"),
        *score("lesion", "low", 0.3, 0.3, measure="area"),
    ]
    write(tmp_path, runs=[RUN], scores=scores)
    assert read(tmp_path, "clones of med") == 20
    assert read(tmp_path, "clones of hi") is None
    assert read(tmp_path, "clones of the non-specialized") == 80
    assert read(tmp_path, "whole area") == 0.5
    assert read(tmp_path, "lesioned area") == pytest.approx(0.3)
    assert read(tmp_path, "loss of area") == pytest.approx(0.4)
    assert read(tmp_path, "loss") == 0


def test_behaviours_of_a_run(tmp_path: Path) -> None:
    rows = behaviours("collective", entrapment=0, pursuer_blocker=3, none=1)
    rows += behaviours("individual", pursuer=2, idle=0, entrapment=5)
    rows += behaviours("team", entrapment=4)
    write(tmp_path, runs=[RUN], behaviours=rows)
    assert read(tmp_path, "pursuer-blocker") == 1
    assert read(tmp_path, "entrapment") == 0
    assert read(tmp_path, "spiders-fly") == 0  # the run was studied, and had no such behaviour
    assert read(tmp_path, "idle predators") == 0


def test_captures_and_members_of_collective_behaviours(tmp_path: Path) -> None:
    rows = behaviours("collective", entrapment=0, pursuer_blocker=3, spiders_fly=1)
    rows += behaviours("member", entrapment=0, pursuer_blocker=2, spiders_fly=1, non_specialized=1)
    write(tmp_path, runs=[RUN], behaviours=rows)
    assert read(tmp_path, "captures by pursuer-blocker") == 3
    assert read(tmp_path, "captures by entrapment") == 0
    assert read(tmp_path, "members of pursuer-blocker and spiders-fly") == 1
    assert read(tmp_path, "members of spiders-fly and role-switcher") == 0
    assert read(tmp_path, "members of nothing") == 0
    write(tmp_path, behaviours=behaviours("member", entrapment=0, non_specialized=3))
    assert read(tmp_path, "members of nothing") == 1
    write(tmp_path, behaviours=behaviours("collective", entrapment=2))  # of an earlier version
    assert read(tmp_path, "members of nothing") is None


@pytest.mark.parametrize(("hidden", "is_three"), [(3.0, 1), (3.4, 1), (5.0, 0)])
def test_hidden_neurons_are_those_of_the_champions_generation(
    hidden: float, is_three: int, tmp_path: Path
) -> None:
    generations = [
        {"run": "a", "generation": 4, "hidden": hidden},
        {"run": "a", "generation": 5, "hidden": 3.0 if not is_three else 9.0},
    ]
    champions = [{"run": "a", "generation": 4, "measure": name} for name in ("path", "collided")]
    write(tmp_path, runs=[RUN], generations=generations, champions=champions)
    assert read(tmp_path, "three hidden neurons") == is_three


@pytest.mark.parametrize(
    ("labels", "is_complementary"),
    [
        ({"pursuer": 2, "blocker": 1}, True),
        ({"pursuer": 3, "blocker": 0}, False),
        ({"pursuer": 3, "non_specialized": 1}, False),
        ({"flanker": 1, "idle": 1}, True),
    ],
)
def test_complementary_teams_have_two_behaviours(
    labels: dict[str, int], is_complementary: bool, tmp_path: Path
) -> None:
    about = RUN | {"measure": "capture_time"}
    scores = score("clones", "whole", 6, 8, measure="capture_time")
    write(tmp_path, runs=[about], scores=scores, behaviours=behaviours("individual", **labels))
    assert read(tmp_path, "complementary") == (7 if is_complementary else None)


def test_every_quantity_of_a_claim_is_known() -> None:
    named = {
        sample.quantity
        for claim in CLAIMS
        for part in claim.parts
        for statement in part.statements
        for sample in statement.samples
    }
    assert named == set(QUANTITIES)


def test_world_preset_and_variant_are_judged_separately(tmp_path: Path) -> None:
    runs, scores = [], []
    for k, change in enumerate(
        [{}, {"preset": "desk"}, {"variant": "gst=0.1"}, {"world": "rover-v3"}, {"seed": 2}]
    ):
        runs.append(RUN | {"run": str(k), "run_id": str(k)} | change)
        scores += score("test", "champion", 10 * k, run=str(k))
    write(tmp_path, runs=runs, scores=scores)
    cone = Within(Sample("value", ("cone",), ("complex-1",)), 0, 1)
    with Tables(tmp_path) as tables:
        found = {
            (e.world, e.preset, e.variant): e.gather(Compare("above", cone.sample, cone.sample))
            for e in read_evidence(tables)
        }
        told = verdicts(tables, CLAIMS[:1])
    assert {key: one.samples[0] for key, one in found.items()} == {
        ("rover-v2", "desk", ""): [10.0],
        ("rover-v2", "smoke", ""): [0.0, 40.0],
        ("rover-v2", "smoke", "gst=0.1"): [20.0],
        ("rover-v3", "smoke", ""): [30.0],
    }
    # CONE alone: a comparison is impossible, but the verdict names the missing runs.
    assert [(one.budget, one.variant) for one in told] == [
        ("desk", ""),
        ("smoke", ""),
        ("smoke", "gst=0.1"),
        ("smoke", ""),
    ]
    assert {one.verdict for one in told} == {"undecided: no such runs"}
    assert all("no runs of HetCNE in 10 environments" in one.why for one in told)


def test_runs_without_a_factor_are_judged_with_each_of_its_levels(tmp_path: Path) -> None:
    runs = [
        RUN | {"run": method + variant, "method": method, "variant": variant, "run_id": str(k)}
        for k, (method, variant) in enumerate(
            [("cone", "gst=0.1"), ("cone", "gst=0.2"), ("homcne", "")]
        )
    ]
    write(tmp_path, runs=runs)
    with Tables(tmp_path) as tables:
        groups = {one.variant: one.runs for one in read_evidence(tables)}
    assert {
        variant: sorted(run.run for of in some.values() for run in of)
        for variant, some in groups.items()
    } == {"gst=0.1": ["conegst=0.1", "homcne"], "gst=0.2": ["conegst=0.2", "homcne"]}


def test_the_budget_with_most_runs_of_both_is_used(tmp_path: Path) -> None:
    runs, scores = [], []
    for method, spent in (
        ("cone", [100, 100, 900, 900, 900]),
        ("mesp", [100, 100, 900]),
        ("ccga", [5000]),
    ):
        for seed, evaluations in enumerate(spent):
            run = f"{method}-{seed}"
            about = {"run": run, "run_id": run, "method": method, "seed": seed}
            spends = {"evaluations": evaluations, "team_steps": 10 * evaluations}
            runs.append(RUN | about | spends)
            scores += score("test", "champion", evaluations + seed, run=run)
    write(tmp_path, runs=runs, scores=scores)
    cone, mesp, ccga = (Sample("value", (m,), ("complex-1",)) for m in ("cone", "mesp", "ccga"))
    with Tables(tmp_path) as tables:
        (evidence,) = read_evidence(tables)
        found = evidence.gather(Compare("above", cone, mesp))
        apart = evidence.gather(Compare("above", cone, ccga))
        alone = evidence.gather(Within(cone, 0, 1))
    assert found.samples == ([100.0, 101.0], [100.0, 101.0])
    assert found.budgets == {"smoke, about 100 team evaluations of 10 team-steps"}
    assert apart.samples == ([], [])
    assert not apart.present
    assert alone.samples == ([902.0, 903.0, 904.0],)


def test_runs_without_studies(tmp_path: Path) -> None:
    truth = {key: cell for key, cell in rover().items() if key[0] == "complex-1"}
    write_tables(tmp_path, "rover-v2", truth, n=2, studies=False)
    with Tables(tmp_path) as tables:
        found = {one.id: one.verdict for one in verdicts(tables) if one.id in ("R9", "R11", "R12")}
    assert found == {
        "R9": "undecided: no castes recorded",
        "R11": "undecided: no castes replaced",
        "R12": "undecided: no teams of clones",
    }


def test_missing_runs_of_a_quantity_are_named(tmp_path: Path) -> None:
    about = {("complex-1", m): Cell(100, several=1.0) for m in ("ccga", "mesp", "cone")}
    write_tables(tmp_path, "rover-v2", about, n=2)
    with Tables(tmp_path) as tables:
        (twelve,) = verdicts(tables, [one for one in CLAIMS if one.id == "R12"])
    assert twelve.n == "2"
    assert "no runs of CCGA in 9 environments" in twelve.why
