"""Two stages of one task: clones first, then populations that are bred from their champion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.errors import UsageError
from conevo.rng import stream
from conevo.runs.config import RunConfig
from conevo.runs.first import resolve_stages, take_first, without_method
from conevo.runs.shaping import Shaping, start_stages
from runs.test_shaping import genes, stages_content
from runs.tiny import TASK, TINY, evolve_tiny, killed_at

OWN_METHOD = Path(__file__).parents[2] / "examples" / "own_method.py"
SHORT = TINY | {"run.generations": 6, "first": "homcne"}


def both(method: str = "ccga", task: str = TASK, **more: Any) -> list[RunConfig]:
    """Return the tiny stages of clones, then of a method."""
    settings = SHORT | more
    rest, _ = take_first(settings, "here")
    of_first = without_method(rest, conevo.METHODS[method].config_class)
    of_first |= {"method.genotypes": 4}
    return resolve_stages([task], method, "smoke", 1, settings, of_first, "here")


def begin(path: Path, method: str = "ccga", **more: Any) -> Shaping:
    return start_stages(both(method, **more), path, threads=1)


def test_the_second_stage_starts_from_copies_of_the_champion_and_noise(tmp_path: Path) -> None:
    shaping = begin(tmp_path / "two", **{"method.start_noise": 0.02}).resume(threads=1)
    first, second = shaping.stages
    champion = first.champion
    assert champion is not None
    assert (champion.genes == champion.genes[0]).all()  # clones
    found = genes(second.path / "origin.npz")
    robots, slots, n_genes = champion.genes.shape
    assert found.shape == (robots, slots, 4, n_genes)
    noise = stream(1, "champion").standard_normal(found.shape, dtype=np.float32)
    for p, slot, genotype in np.ndindex(robots, slots, 4):
        expected = champion.genes[p, slot]
        if genotype and champion.active[p, slot]:
            expected = np.clip(
                expected + np.float32(0.02) * noise[p, slot, genotype], -1, 1, dtype=np.float32
            )
        np.testing.assert_array_equal(found[p, slot, genotype], expected)
    origin = second.provenance["origin"]
    assert (origin["of"], origin["run_id"]) == ("champion", first.config.run_id)
    assert origin["generation"] == champion.generation


def test_the_first_stage_is_an_ordinary_run_with_its_share_of_the_length(tmp_path: Path) -> None:
    shaping = begin(tmp_path / "two", first_share=1 / 3)
    shaping.resume(threads=1)
    first, second = shaping.stages
    assert shaping.methods == ["homcne", "ccga"]
    assert shaping.tasks == ["rover-v2/complex-1"] * 2
    assert [len(run.generations()) for run in shaping.stages] == [2, 4]
    alone = evolve_tiny(tmp_path / "alone", "homcne", run__generations=2)
    assert (first.path / "config.toml").read_text() == (alone.path / "config.toml").read_text()
    assert genes(next(first.path.glob("checkpoint-?.npz"))).tobytes() == (
        genes(next(alone.path.glob("checkpoint-?.npz"))).tobytes()
    )
    bred = conevo.evolve(
        TASK, "ccga", "smoke", out=tmp_path / "bred", threads=1, origin=first, of_champion=True,
        overrides=TINY | {"run.generations": 4},
    )  # fmt: skip
    assert bred.generations()[-1] | {"seconds": 0} == second.generations()[-1] | {"seconds": 0}


@pytest.mark.parametrize(
    ("budget", "share", "expected"),
    [(0, 0.5, (0, 0)), (100, 0.5, (50, 50)), (101, 0.3, (30, 71)), (7, 0.01, (1, 6))],
)
def test_both_stages_have_the_budget_of_one_run(
    budget: int, share: float, expected: tuple[int, int]
) -> None:
    stages = both(first_share=share, **{"run.budget_evaluations": budget, "run.target": 900.0})
    assert tuple(one.run.budget_evaluations for one in stages) == expected
    assert sum(one.run.generations for one in stages) == 6
    assert [one.run.target for one in stages] == [900.0, 900.0]
    assert "run.generations" in stages[0].changed


def test_the_budget_is_never_exceeded(tmp_path: Path) -> None:
    shaping = begin(
        tmp_path / "two", **{"run.generations": 1000, "run.budget_evaluations": 100}
    ).resume(threads=1)
    spent = [run.generations()[-1]["team_evaluations"] for run in shaping.stages]
    assert [run.provenance["stopped_by"] for run in shaping.stages] == ["budget", "budget"]
    assert spent == [50, 34]  # generations of M + 1 = 5 and of K M + 1 = 17


@pytest.mark.parametrize("method", ["hetcne", "mesp", "cone"])
def test_any_method_with_populations_may_follow(method: str, tmp_path: Path) -> None:
    shaping = begin(tmp_path / "two", method, **{"run.generations": 2}).resume(threads=1)
    champion = shaping.stages[0].champion
    assert champion is not None
    found = genes(shaping.stages[1].path / "origin.npz")
    for population, of in zip(found, champion.genes, strict=False):
        np.testing.assert_array_equal(population[:, 0], of)


def test_strategies_of_whole_teams_may_come_first_and_second(tmp_path: Path) -> None:
    for k, (first, method) in enumerate((("hom-es", "ccga"), ("homcne", "cone-es"))):
        small = {key: value for key, value in SHORT.items() if key != "method.genotypes"}
        of_first = {key: value for key, value in small.items() if key != "first"}
        settings = small | {"run.generations": 2, "first": first}
        stages = resolve_stages([TASK], method, "smoke", 1, settings, of_first)
        shaping = start_stages(stages, tmp_path / str(k), threads=1).resume(threads=1)
        champion = shaping.stages[0].champion
        assert champion is not None
        with np.load(shaping.stages[1].path / "origin.npz") as origin:
            found = origin["field.genes"][:, :, 0] if method == "ccga" else origin["field.mean"]
        np.testing.assert_array_equal(
            found, champion.genes if method == "ccga" else champion.genes[0]
        )


def test_a_method_that_cannot_start_from_a_team_may_come_first_only(tmp_path: Path) -> None:
    name = f"{OWN_METHOD}:team-es"
    stages = resolve_stages([TASK], "ccga", "smoke", 1, SHORT | {"first": name}, TINY)
    shaping = start_stages(stages, tmp_path / "two", threads=1).resume(threads=1)
    moved = Shaping(shaping.path.rename(tmp_path / "moved"))
    champion = moved.stages[0].champion
    assert champion is not None
    found = genes(moved.stages[1].path / "origin.npz")
    np.testing.assert_array_equal(found[:, :, 0], champion.genes)
    with pytest.raises(UsageError, match=r"no population can be bred .* Team ES has none"):
        resolve_stages([TASK], name, "smoke", 1, SHORT, TINY)


@pytest.mark.slow
def test_kills_between_and_within_the_stages_change_nothing(tmp_path: Path) -> None:
    path = tmp_path / "killed"
    settings = {k: v for k, v in SHORT.items() if k not in ("first", "method.genotypes")}
    sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    options = ["--method", "ccga", "--first", "homcne", "--preset", "smoke", "--out", str(path)]
    arguments = ["run", TASK, *options, *sets, "--set", "method.start_noise=0.02"]
    for begun, pattern in (
        (1, r"stage-1/checkpoint-b"),
        (1, r"stage-1/DONE"),
        (1, r"/\.stage-2\.\w+/stage-2/origin\.npz"),  # between the stages
        (2, r"stage-2/checkpoint-a"),  # before the second one's first generation ends
        (2, r"stage-2/test\.json"),
        (2, r"killed/DONE"),
    ):
        killed_at(pattern, *arguments)
        assert Shaping(path).status == "interrupted"
        assert len(Shaping(path).stages) == begun, pattern
        arguments = ["resume", str(path)]
    Shaping(path).resume(threads=2)
    noisy = settings | {"first": "homcne", "method.start_noise": 0.02}
    stages = resolve_stages([TASK], "ccga", "smoke", 1, noisy, settings)
    whole = start_stages(stages, tmp_path / "whole", threads=1).resume(threads=1)
    assert stages_content(path) == stages_content(whole.path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"first": "homcn"}, "first here: unknown method 'homcn'; did you mean 'homcne'"),
        ({"first": 3}, 'first = 3 here: must name a method, or "none"'),
        ({"first": "ccga"}, "first = 'ccga' here: ccga evolves the second stage"),
        ({"first_share": 0}, "first_share = 0 here: must be above 0 and below 1"),
        ({"first_share": True}, "first_share = True here: must be above 0"),
        ({"first_share": float("nan")}, "first_share = nan here: must be above 0"),
        ({"run.generations": 1}, "run.generations = 1 here cannot be shared by two stages"),
        ({"run.budget_evaluations": 1}, "run.budget_evaluations = 1 here cannot be shared"),
    ],
)
def test_wrong_stages_are_one_clear_line(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(UsageError, match=words) as caught:
        both(**changes)
    assert "\n" not in str(caught.value)


def test_the_stages_must_be_of_one_task_and_of_one_controller() -> None:
    for of_first, words in (
        ({"world.iterations": 13}, r"first = 'homcne' .*\[world\] of homcne is not that of ccga"),
        ({"controller.bias": True}, "controllers of the first stage .* do not fit"),
        ({"method.start_noise": 0.1}, "start_noise = 0.1 does nothing here in the first stage"),
        ({"method.gst": 0.1}, r"'method.gst' here \(first\)"),
    ):
        with pytest.raises(UsageError, match=words):
            resolve_stages([TASK], "ccga", "smoke", 1, SHORT, TINY | of_first, "here")
    with pytest.raises(UsageError, match="either a first stage of another method or"):
        resolve_stages([TASK, "rover/complex-2"], "ccga", "smoke", 1, SHORT, TINY, "here")


def test_none_is_one_stage() -> None:
    (config,) = both(first="none", first_share=0.3)
    assert (config.method, config.run.generations) == ("ccga", 6)
