"""A champion tested under other conditions than its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import conevo
from conevo.errors import UsageError
from conevo.runs.lab import Lab
from conevo.runs.testing import test_team as play
from runs.tiny import evolve_tiny


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> conevo.Run:
    return evolve_tiny(tmp_path_factory.mktemp("run") / "run", world__iterations=60)


def test_unchanged_conditions_change_nothing(run: conevo.Run) -> None:
    before = {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()}
    both = run.test_under(threads=1)
    assert both["own"] == both["changed"] == run.test(threads=1)
    assert set(both["change"].values()) == {0.0}
    assert {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()} == before


def test_settings_and_environment_are_the_requested_ones(run: conevo.Run) -> None:
    both = run.test_under("complex-2", {"world.iterations": 90}, scenarios=4, threads=1)
    params = replace(run.config.world_params, iterations=90)
    config = replace(run.config, environment="complex-2", world_params=params)
    lab = Lab.equip(config, 1, "cpu")
    assert run.champion is not None
    expected = play(lab.simulator, lab.world, run.champion, n_scenarios=4, seed=1)
    assert both["changed"] == expected
    assert both["own"] == run.test(4, threads=1)
    assert both["conditions"]["task"] == "rover-v2/complex-2"
    name = next(iter(both["change"]))
    means = [both[which]["performance"][name]["mean"] for which in ("changed", "own")]
    assert both["change"][name] == means[0] - means[1]


@pytest.mark.parametrize(("robots", "team"), [(2, [0, 1]), (7, [0, 1, 2, 0, 1, 2, 0])])
def test_fewer_robots_are_the_first_and_more_repeat_them(
    robots: int, team: list[int], run: conevo.Run
) -> None:
    both = run.test_under(robots=robots, threads=1)
    champion = run.champion
    assert champion is not None
    assert both["changed"]["n_hidden"] == champion.active.sum(axis=1)[team].tolist()
    assert len(both["changed"]["labels"]) == both["conditions"]["robots"] == robots


def test_controllers_rotate_and_clones_are_unaffected(run: conevo.Run, tmp_path: Path) -> None:
    champion = run.champion
    assert champion is not None
    assert not (champion.genes[0] == champion.genes[1]).all()
    moved = replace(champion, genes=champion.genes[[2, 0, 1]], active=champion.active[[2, 0, 1]])
    lab = Lab.equip(run.config, 1, "cpu")
    both = run.test_under(rotate=1, threads=1)
    assert both["changed"] == play(lab.simulator, lab.world, moved, n_scenarios=3, seed=1)
    assert both["changed"]["performance"] != both["own"]["performance"]
    assert both["conditions"]["rotate"] == 1
    again = run.test_under(robots=6, rotate=3, threads=1)  # each controller twice: the same team
    assert again["changed"] == run.test_under(robots=6, threads=1)["changed"]
    clones = evolve_tiny(tmp_path / "clones", method="homcne").test_under(rotate=1, threads=1)
    assert clones["changed"] == clones["own"]
    assert [one["conditions"]["clones"] for one in (both, clones)] == [False, True]


def test_a_setting_is_given_once(run: conevo.Run) -> None:
    for world, robots in (
        ({"n_robots": 3}, 2),
        ({"iterations": 12, "world.iterations": 12}, None),
    ):
        with pytest.raises(UsageError, match="is set twice"):
            run.test_under(world=world, robots=robots)


def test_numbers_out_of_bounds_are_refused_before_anything_is_played(run: conevo.Run) -> None:
    for scenarios, seed in ((10**9, None), (0, None), (True, None), (2, -1), (2, 1.5)):
        with pytest.raises(UsageError, match="must be a whole number from"):
            run.test(scenarios, seed)


def test_impossible_conditions_are_one_line(run: conevo.Run) -> None:
    for arguments, words in (
        ({"on": "gacc/complex-1"}, "16 inputs became 27"),
        ({"on": "complex-99"}, "complex-99"),
        ({"world": {"controller.n_hidden": 3}}, "only the world can be changed"),
        ({"world": {"run.epochs": 3}}, "only the world can be changed"),
        ({"world": {"world.itertions": 3}}, "did you mean 'world.iterations'"),
        ({"world": {"world.iterations": 0}}, "must be"),
        ({"robots": 10_000}, "n_robots = 10000"),
        ({"rotate": 3}, "rotate = 3: must be a whole number from 1 to 2, .*number of robots, 3"),
        ({"rotate": -1}, "rotate = -1: must be"),
        ({"rotate": 1.5}, "rotate = 1.5: must be a whole number"),
        ({"rotate": "1"}, "rotate = '1': must be a whole number"),
    ):
        with pytest.raises(UsageError, match=words) as caught:
            run.test_under(**arguments, threads=1)
        assert "\n" not in str(caught.value)
