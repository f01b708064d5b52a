"""A whole run: stop conditions, record, champion, testing phase, repeated bit for bit."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.errors import EnvironmentFailure, UsageError
from conevo.evolution.methods.registry import METHODS
from conevo.rng import fold
from conevo.runs.champions import Team, finalists, sampled_generations
from conevo.runs.config import resolve
from conevo.runs.lab import price_of
from conevo.runs.shrinkage import shrinkage
from conevo.runs.start import start
from conevo.runs.testing import spread
from runs.tiny import TASK, content, evolve_tiny, tiny_settings


def make_team(generation: int, *fitness: float) -> Team:
    genes = np.ones((len(fitness), 2, 3), dtype=np.float32)
    active = np.ones((len(fitness), 2), dtype=np.bool_)
    return Team(generation, genes, active, np.array(fitness), np.zeros(len(fitness)))


def test_the_same_seed_gives_the_same_run_for_any_number_of_threads(tmp_path: Path) -> None:
    one = evolve_tiny(tmp_path / "one")
    settings = tiny_settings("cone")
    two = conevo.evolve(TASK, "cone", "smoke", out=tmp_path / "two", overrides=settings, threads=2)
    other = evolve_tiny(tmp_path / "other", run__seed=2)
    assert content(one.path) == content(two.path)
    assert content(one.path)["generations"] != content(other.path)["generations"]


@pytest.mark.parametrize("method", METHODS)
def test_a_budget_is_never_exceeded_and_nearly_spent(method: str, tmp_path: Path) -> None:
    free = evolve_tiny(tmp_path / "free", method)
    spent = [record["team_evaluations"] for record in free.generations()]
    budget = spent[2] + 1
    run = evolve_tiny(tmp_path / "bound", method, run__budget_evaluations=budget)
    assert [record["team_evaluations"] for record in run.generations()] == spent[:3]
    assert run.provenance["stopped_by"] == "budget"


def test_a_first_generation_that_searches_more_widely_is_priced_apart(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run", "hom-es", run__budget_evaluations=45)
    records = run.generations()
    spent = [record["team_evaluations"] for record in records]
    assert spent == [17, 26, 35, 44]  # four pairs, tried twice in the first generation
    price = price_of(run.config)
    assert (price.evaluations, price.generations) == (17, 4)
    assert price.team_steps == records[-1]["team_steps"]


@pytest.mark.parametrize("method", ["homcne", "cone"])
def test_a_run_on_differences_counts_every_team_that_was_played(
    method: str, tmp_path: Path
) -> None:
    """Three robots: four times the evaluations and the team-steps of a plain run."""
    settings: dict[str, Any] = {"run__generations": 1}
    if method == "cone":
        settings["method__type_c"] = "own"
    plain = evolve_tiny(tmp_path / "plain", method, **settings)
    run = evolve_tiny(tmp_path / "run", method, **settings, run__credit="difference")
    (without,), (record,) = plain.generations(), run.generations()
    for name in ("team_evaluations", "team_steps", "type_c_evaluations"):
        assert record[name] == 4 * without[name]
    price = price_of(run.config)
    assert (price.evaluations, price.team_steps) == (
        record["team_evaluations"],
        record["team_steps"],
    )
    assert run.test_result is not None
    finalist = run.test_result["validation"]["finalists"][0]
    assert finalist["selection"]["fitness"] is None  # a difference differs from the fitness
    assert finalist["selection"]["performance"]["value"] is not None


@pytest.mark.parametrize("method", ["hetcne", "ccga", "mesp"])
def test_elite_partners_and_differences_are_continued_bit_for_bit(
    method: str, tmp_path: Path
) -> None:
    settings: dict[str, Any] = {"run__credit": "difference"}
    if method != "hetcne":
        settings["method__evaluation"] = "systematic"
    whole = evolve_tiny(tmp_path / "whole", method, **settings, run__generations=3)
    part = evolve_tiny(tmp_path / "part", method, **settings, run__generations=1)
    part.resume(generations=3, threads=1)
    assert content(part.path) == content(whole.path)


@pytest.mark.parametrize(
    ("task", "settings", "words"),
    [
        (TASK, {"run.credit": "team", "method.clone_credit": "one"}, "credits all clones alike"),
        ("prey/shaping-1", {"run.credit": "difference"}, "a team of one robot has none"),
    ],
)
def test_settings_that_contradict_each_other_are_one_line(
    task: str, settings: dict[str, Any], words: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match=words) as caught:
        conevo.evolve(task, "homcne", "smoke", out=tmp_path / "run", overrides=settings)
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []
    for key in settings:
        others = {k: v for k, v in settings.items() if k != key}
        assert resolve(task, "homcne", "smoke", overrides=others).changed == tuple(others)


@pytest.mark.parametrize("task", ["rover/complex-1", "gacc/complex-1"])
def test_a_world_without_room_is_refused_before_anything_is_written(
    task: str, tmp_path: Path
) -> None:
    with pytest.raises(UsageError, match="no room for"):
        conevo.evolve(
            task, "homcne", "smoke", out=tmp_path / "run", overrides={"world.separation": 0.5}
        )
    assert list(tmp_path.iterdir()) == []


def test_a_budget_below_one_generation_is_refused_before_anything_is_written(
    tmp_path: Path,
) -> None:
    cost = evolve_tiny(tmp_path / "one", run__generations=1).generations()[0]["team_evaluations"]
    with pytest.raises(UsageError, match=f"the first takes {cost} team evaluations"):
        evolve_tiny(tmp_path / "none", run__budget_evaluations=cost - 1)
    assert not (tmp_path / "none").exists()
    run = evolve_tiny(tmp_path / "exact", run__budget_evaluations=cost)
    assert len(run.generations()) == 1


def test_a_target_ends_a_run_at_the_first_generation_that_reaches_it(tmp_path: Path) -> None:
    values = [
        record["performance"]["value"] for record in evolve_tiny(tmp_path / "free").generations()
    ]
    target = sorted(values)[-2]
    first = next(k for k, value in enumerate(values) if value >= target)
    run = evolve_tiny(tmp_path / "target", run__target=target)
    assert len(run.generations()) == first + 1
    assert run.provenance["stopped_by"] == "target"


def test_the_record_of_a_generation(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run", run__epochs=2, run__fittest_epochs=3, method__type_c="own")
    evaluations = steps = lesions = 0
    for number, record in enumerate(run.generations()):
        assert record["generation"] == number
        assert record["type_c_evaluations"] == 4 * 3 * 2  # rounds, robots, elite genotypes
        tried = 4 * 4 + record["type_c_evaluations"]
        fittest = record["team_evaluations"] - evaluations - tried  # with its lesions
        evaluations, lesions = record["team_evaluations"], lesions + fittest - 1
        steps += (tried * 2 + fittest * 3) * 12
        assert record["team_steps"] == steps
        assert sum(record["castes"].values()) == 3
        assert 0 <= record["specialization"] <= 1
        assert set(record["performance"]) == {"value", "area"}
        assert len(record["n_hidden"]) == 3
        assert record["best_fitness"] >= record["mean_fitness"]
    assert lesions > 0
    assert run.provenance["stopped_by"] == "generations"
    homcne = evolve_tiny(tmp_path / "homcne", "homcne").generations()[0]
    assert (homcne["sst"], homcne["gst"], homcne["n_hidden"]) == (None, None, [2])


def test_the_champion_is_the_best_of_the_fittest_teams_in_separate_scenarios(
    tmp_path: Path,
) -> None:
    lucky = 0
    for seed in (1, 2, 3):
        changes = {"run__seed": seed, "run__n_finalists": 3, "run__n_validations": 4}
        run = evolve_tiny(
            tmp_path / f"{seed}", world__iterations=60, world__low_range=0.3, **changes
        )
        records, champion, result = run.generations(), run.champion, run.test_result
        assert champion is not None
        assert result is not None
        about = result["validation"]
        by_fitness = sorted(records, key=lambda one: -one["team_fitness"])[:3]
        assert [one["generation"] for one in about["finalists"]] == [
            one["generation"] for one in by_fitness
        ]
        world = conevo.world(TASK, **run.config.tables()["world"])
        keys = [fold(seed, "validation", k) for k in range(4)]
        means = []
        for one, record in zip(about["finalists"], by_fitness, strict=True):
            team = run.team(one["generation"])
            assert team is not None
            played = conevo.Rollout(world, run.config.controller, 1).evaluate(
                *team.as_trial(), world.scenarios(keys)
            )
            fitness = played.fitness[0].astype(float).mean(axis=1)
            assert one["validation"]["fitness"]["values"] == fitness.tolist()
            areas = played.performance["area"][0].tolist()
            assert one["validation"]["performance"]["area"]["values"] == areas
            assert one["selection"] == {
                "fitness": record["team_fitness"],
                "performance": record["performance"],
            }
            means.append(fitness.mean())
        assert max(means) > 0
        best = about["finalists"][int(np.argmax(means))]["generation"]
        assert champion.generation == about["chosen"] == best
        assert result["champion"]["generation"] == best
        kept = run.team(best)
        assert kept is not None
        np.testing.assert_array_equal(champion.genes, kept.genes)
        lucky += best != by_fitness[0]["generation"]
    assert lucky > 0  # at least once the best by selection was not the best


def test_the_champion_of_an_unfinished_run_is_the_fittest_so_far(tmp_path: Path) -> None:
    seen: list[int] = []

    def look(run: conevo.Run, record: dict[str, Any]) -> None:
        fitness = [one["team_fitness"] for one in run.generations()]
        champion = run.champion
        assert champion is not None
        assert champion.generation == int(np.argmax(fitness))
        seen.append(champion.generation)

    settings = tiny_settings("cone", world__iterations=60, world__low_range=0.3)
    run = start(resolve(TASK, preset="smoke", overrides=settings), tmp_path / "run", threads=1)
    run.resume(threads=1, watch=look)
    assert len(set(seen)) > 1


def test_finalists_do_not_depend_on_how_often_or_in_which_order_teams_came() -> None:
    teams = [make_team(0, 2, 2), make_team(1, 1, 1), make_team(2, math.nan, 9), make_team(3, 1, 3)]
    teams += [make_team(4, 5, 5), make_team(5, 0, 2)]
    for order in itertools.permutations(teams):
        found: list[Team] = []
        for team in [*order, *order[2:]]:
            found = finalists(found, team, 4)
        assert [team.generation for team in found] == [4, 0, 3, 1]
    assert [one.generation for one in finalists(teams[:2], teams[2], 9)] == [0, 1, 2]


def test_the_shrinkage_of_a_champion_by_hand() -> None:
    def part(fitness: Any, value: Any) -> dict[str, Any]:
        return {"fitness": fitness, "performance": {"value": value}}

    a, b, c, d = ({"mean": mean} for mean in (3.0, 6.0, 2.0, None))
    chosen = {"generation": 7, "selection": part(4.0, -1.0), "validation": part(a, b)}
    other = {"generation": 9, "selection": part(5.0, 1.0), "validation": part(a, b)}
    about = {"chosen": 7, "finalists": [other, chosen]}
    assert shrinkage({"champion": part(c, d), "validation": about}) == [
        {"measure": "fitness", "selection": 4, "validation": a, "test": c, "ratio": 0.5},
        {"measure": "value", "selection": -1, "validation": b, "test": d, "ratio": None},
    ]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([1, 3], {"mean": 2, "sd": math.sqrt(2), "n": 2, "values": [1, 3]}),
        ([math.nan, 4, math.inf], {"mean": 4, "sd": None, "n": 1, "values": [None, 4, None]}),
        ([-math.inf], {"mean": None, "sd": None, "n": 0, "values": [None]}),
    ],
)
def test_values_that_are_not_finite_keep_their_place(
    values: list[float], expected: dict[str, Any]
) -> None:
    assert spread(np.array(values, np.float32)) == expected


def test_teams_are_ranked_by_their_mean_and_those_that_are_not_finite_last() -> None:
    first, same, better = make_team(0, 1, 3), make_team(1, 3, 1), make_team(2, 2, 3)
    broken = make_team(3, math.inf, 1)
    assert better.rank < first.rank == same.rank < broken.rank


def test_a_team_as_a_trial_uses_exactly_its_active_slots() -> None:
    team = make_team(0, 1, 2)
    team.active[1, 0] = False
    pool, teams = team.as_trial()
    assert pool.shape == (4, 3)
    assert teams.tolist() == [[[0, 1], [-1, 3]]]


def test_kept_generations_are_few_and_start_with_the_first() -> None:
    assert sampled_generations(3) == {0, 1, 2}
    assert sampled_generations(100) == set(range(0, 100, 8))
    for n in range(17, 300):
        assert 9 <= len(sampled_generations(n)) <= 16
        assert sampled_generations(n) & set(range(n - 1)) <= sampled_generations(n - 1)


def test_the_testing_phase_is_the_team_in_the_addressed_scenarios(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run", world__iterations=60, run__n_tests=4)
    result, champion = run.test_result, run.champion
    assert result is not None
    assert champion is not None
    tested = result["champion"]
    world = run.config
    place = conevo.world(TASK, **world.tables()["world"])
    keys = [fold(1, "test", k) for k in range(4)]
    outcome = conevo.Rollout(place, run.config.controller, 1).evaluate(
        *champion.as_trial(), place.scenarios(keys)
    )
    areas = outcome.performance["area"][0].astype(float)
    assert tested["performance"]["area"]["values"] == areas.tolist()
    assert tested["performance"]["area"]["mean"] == pytest.approx(areas.mean())
    assert tested["performance"]["area"]["sd"] == pytest.approx(areas.std(ddof=1))
    assert sum(tested["castes"].values()) == len(tested["labels"]) == 3
    assert tested["generation"] == champion.generation
    assert result["generation_0"]["generation"] == 0


def test_testing_again_gives_the_same_and_writes_nothing(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    before = {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()}
    assert run.test_result is not None
    again: dict[str, Any] = conevo.Run(run.path).test()
    assert again == run.test_result["champion"]
    assert len(run.test(7)["performance"]["area"]["values"]) == 7
    assert run.test(seed=5)["performance"] != again["performance"]
    assert {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()} == before


def test_a_run_without_a_finished_generation_has_no_team_to_test(tmp_path: Path) -> None:
    run = start(resolve(TASK, preset="smoke", overrides=tiny_settings("cone")), tmp_path / "run")
    assert (run.status, run.generations(), run.champion) == ("interrupted", [], None)
    with pytest.raises(UsageError, match="has no finished generation yet"):
        run.test()


def test_a_run_can_be_repeated_from_its_own_configuration(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    again = conevo.evolve(config=run.path / "config.toml", out=tmp_path / "again")
    assert content(again.path) == content(run.path)


def test_provenance_lists_versions_and_machine(tmp_path: Path) -> None:
    about = evolve_tiny(tmp_path / "run").provenance
    assert about["preset"] == "smoke"
    assert about["numpy"] == np.__version__
    assert len(about["kernel_hash"]) == 16
    assert [session["from_generation"] for session in about["sessions"]] == [0]
    assert about["created"] <= about["finished"]


def test_records_are_strict_json(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run", "homcne")
    for file in [*run.path.glob("*.json"), *run.path.glob("*.jsonl")]:
        assert "NaN" not in file.read_text()
        assert "Infinity" not in file.read_text()
        for line in file.read_text().splitlines() if file.suffix == ".jsonl" else []:
            json.loads(line)


def test_a_missing_device_is_an_environment_failure(tmp_path: Path) -> None:
    import warp as wp

    if wp.is_cuda_available():
        pytest.skip("this machine has the device")
    with pytest.raises(EnvironmentFailure, match="no CUDA device"):
        conevo.evolve(TASK, preset="smoke", out=tmp_path / "run", device="cuda")
    assert list(tmp_path.iterdir()) == []
