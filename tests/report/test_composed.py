"""Teams composed of several behaviours: their members, their play, and the report."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.campaigns.tables import Tables
from conevo.report.sections.composed import composed
from conevo.report.sections.scope import scopes
from conevo.runs.champions import Team
from conevo.studies.lesions import Original
from conevo.worlds.pursuit.study.behaviours import BEHAVIOURS
from conevo.worlds.pursuit.study.captures import COMPOSITIONS
from conevo.worlds.pursuit.study.composed import COMPOSED, roles_of
from conevo.worlds.pursuit.study.predators import observe
from conevo.worlds.rollout import Rollout
from conevo.worlds.study import Composed
from report.claims.known_truth import pursuit, write_tables

LABELS = ["blocker", "pursuer", "non-specialized", "pursuer"]
FITNESS = [1.0, 2.0, 9.0, 4.0]


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    return Rollout(conevo.world("pursuit/team-3", iterations=60, arena_cm=60.0), n_threads=1)


@pytest.fixture(scope="module")
def team(rollout: Rollout) -> Team:
    genome, rng = rollout.genome, np.random.default_rng(4)
    genes = rng.uniform(-1, 1, (4, genome.max_parts, genome.n_genes)).astype(np.float32)
    active = np.arange(genome.max_parts) < rng.integers(3, 9, (4, 1))
    return Team(0, genes, active, np.zeros(4), np.zeros(4))


@pytest.mark.parametrize("n", range(2, 7))
@pytest.mark.parametrize("name", COMPOSED)
def test_a_composition_has_a_known_behaviour_for_every_predator(name: str, n: int) -> None:
    roles = roles_of(name, n)
    assert len(roles) == n
    assert set(roles) <= set(COMPOSITIONS[name]) <= set(BEHAVIOURS)


def test_teams_of_section_4_6_5() -> None:
    assert roles_of("pursuer-blocker", 3) == ["pursuer", "pursuer", "blocker"]
    assert roles_of("spiders-fly", 6) == ["pursuer"] * 3 + ["blocker"] * 3
    assert roles_of("role-switcher", 4) == ["flanker", "flanker", "knocker", "idle"]
    assert roles_of("role-switcher", 7) == []


def test_the_fittest_of_each_behaviour_plays(rollout: Rollout, team: Team) -> None:
    scenarios = rollout.world.scenarios(range(3))
    asked = [
        Composed("two and two", ["pursuer", "pursuer", "blocker", "blocker"], scenarios),
        Composed("lacking", ["pursuer", "pursuer", "blocker", "knocker"], scenarios),
        Composed("nobody", [], scenarios),
    ]
    (found,) = Original(rollout, team, LABELS, FITNESS).compose(asked)
    assert found.teams == ("two and two",)
    who = [3, 3, 0, 0]
    same = Team(0, team.genes[who], team.active[who], np.zeros(4), np.zeros(4))
    alone = rollout.evaluate(*same.as_trial(), scenarios)
    for measure, values in alone.performance.items():
        assert found.performance[measure].tolist() == values.tolist()


def test_one_prey_has_three_placed_compositions_and_two_prey_have_none(
    rollout: Rollout, team: Team
) -> None:
    genes, (rows,) = team.as_trial()
    keys = (4, 5)
    seen = observe(rollout, genes, rows, keys, 1)
    found = {one.name: one for one in seen.compositions(keys)}
    assert list(found) == list(COMPOSED)
    clones = seen.together(keys)
    for name in ("pursuer-blocker", "role-switcher"):
        assert found[name].scenarios.x.tolist() == clones.x.tolist()  # in the places of clones
    prey = np.stack([found["spiders-fly"].scenarios.x, found["spiders-fly"].scenarios.y])[:, :, 4]
    gap = np.minimum(prey, 60.0 - prey).min(axis=0)
    assert (gap < rollout.world.params.sensor_range_cm + 3).all()
    world = conevo.world("pursuit/team-8", iterations=30, arena_cm=60.0)
    two = observe(Rollout(world, n_threads=1), genes, rows, keys, 1)
    assert two.compositions(keys) == []


def test_a_report_compares_them_with_the_best_clones(tmp_path: Path) -> None:
    truth = {key: cell for key, cell in pursuit().items() if key[0] in ("team-2", "team-3")}
    truth = {key: cell for key, cell in truth.items() if key[1] in ("mesp", "cone")}
    with Tables(write_tables(tmp_path, "pursuit-v2", truth, 3)) as tables:
        (scope,) = scopes(tables)
        section = composed(scope)
    assert section is not None
    figure, table = section.exhibits
    rows = {(row["environment"], row["team"]): row for row in table.rows}
    assert len(rows) == 6
    row = rows["team-2", "spiders-fly"]
    assert row["n"] == 6
    assert row["value"] == pytest.approx(0.9 * 400)
    assert row["clones"] == pytest.approx(0.5 * 400)
    assert row["p_holm"] < 0.05
    assert {(one["study"], one["team"]) for one in figure.rows} >= {
        ("clones", "pursuer"),
        ("composed", "role-switcher"),
    }
    with Tables(tmp_path) as tables:
        (scope,) = scopes(tables)
        tables.query("DELETE FROM scores WHERE study = 'composed'")
        assert composed(scope) is None
