"""Tasks of VMAS: the rules of worlds, the same scenarios for all, early ends, continued runs."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.cli.main import main
from conevo.controllers.registry import controller
from conevo.errors import UsageError
from conevo.replay.playback import playback_of
from conevo.replay.recording import record
from conevo.rng import fold
from conevo.worlds.checks import findings, random_teams
from conevo.worlds.registry import world
from conevo.worlds.simulators import simulator
from extras import need
from runs.tiny import content

need("torch", "vmas")

SMALL = {
    "run.epochs": 2, "run.fittest_epochs": 2, "run.n_tests": 3, "run.n_validations": 2,
    "run.n_finalists": 2, "world.iterations": 20, "method.genotypes": 6,
}  # fmt: skip
MIXED = ("dispersion", "balance", "discovery", "simple_tag", "dropout")
SHARED = ("simple_speaker_listener", "het_mass")  # all environments of a batch share numbers


def keys(n: int) -> list[int]:
    return [fold(3, "epoch", k) for k in range(n)]


def played(task: str, n: int, heuristic: str = "", **params: Any) -> Any:
    """Return a world, its simulator, a pool, and n random teams or teams of a heuristic."""
    a_world = world(f"vmas:{task}", **params)
    genes, teams = random_teams(a_world, n)
    chosen = a_world.heuristics.index(heuristic) if heuristic else -1
    modes = np.full(teams.shape[:2], chosen, np.int32)
    return a_world, simulator(a_world, controller(world=a_world), 1), genes, teams, modes


def evolved(path: Path, generations: int, task: str = "dispersion", **more: Any) -> conevo.Run:
    settings = SMALL | {"run.generations": generations} | more
    return conevo.evolve(f"vmas:{task}", "cone", "smoke", out=path, overrides=settings, threads=1)


@pytest.mark.parametrize("task", ["dispersion", "balance", "simple_speaker_listener"])
def test_it_keeps_the_rules_of_a_world_with_its_own_simulator(task: str) -> None:
    found = [(one.topic, one.text) for one in findings(f"vmas:{task}") if one.status == "problem"]
    assert found == []


@pytest.mark.parametrize("task", [*MIXED, *SHARED])
def test_all_teams_meet_the_same_scenarios(task: str) -> None:
    """Clones of a team do alike, and a team does alone what it does among many, bit for bit."""
    a_world, made, genes, teams, _ = played(task, 40, iterations=25)
    clones = np.repeat(teams[:1], 40, axis=0)
    scenarios = a_world.scenarios(keys(4))
    out = made.evaluate(genes, clones, scenarios)
    assert np.ptp(out.fitness, axis=0).max() == 0
    assert len(np.unique(out.fitness[0], axis=0)) > 1  # scenarios differ
    among = made.evaluate(genes, teams, scenarios)
    for k, e in ((0, 2), (7, 0), (39, 3)):
        alone = made.evaluate(genes, teams[k : k + 1], a_world.scenarios(keys(4)[e : e + 1]))
        assert alone.fitness[0, 0].tolist() == among.fitness[k, e].tolist()
        assert alone.counts[0, 0].tolist() == among.counts[k, e].tolist()
        assert alone.performance["reward"][0, 0] == among.performance["reward"][k, e]
    assert a_world.facts.is_shared == (task in SHARED)


def test_the_size_of_a_batch_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    a_world, made, genes, teams, _ = played("balance", 150, iterations=25)
    scenarios = a_world.scenarios(keys(2))
    whole = made.evaluate(genes, teams, scenarios)
    monkeypatch.setattr("conevo.simulators.playing.MOST", 70)
    parts = made.evaluate(genes, teams, scenarios)
    assert whole.fitness.tobytes() == parts.fitness.tobytes()
    assert whole.counts.tobytes() == parts.counts.tobytes()


@pytest.mark.parametrize("task", ["dispersion", "balance"])
def test_a_run_is_continued_bit_for_bit(task: str, tmp_path: Path) -> None:
    whole = evolved(tmp_path / "whole", 4, task)
    short = evolved(tmp_path / "short", 2, task).resume(generations=4)
    one, other = content(whole.path), content(short.path)
    assert one["generations"] == other["generations"]
    assert (one["checkpoint"], one["champion.npz"]) == (other["checkpoint"], other["champion.npz"])
    assert whole.provenance["kernel_hash"].startswith("vmas 1.")


def test_an_epoch_ends_when_the_task_is_done() -> None:
    a_world, made, genes, teams, modes = played("balance", 1, "random", iterations=100)
    scenarios = a_world.scenarios(keys(5))
    out = made.evaluate(genes, teams, scenarios, modes)
    first = int(out.steps[0].argmin())
    end = int(out.steps[0, first])
    assert end < 100  # the package falls
    assert np.array_equal(out.counts.sum(axis=3), np.repeat(out.steps[:, :, None], 3, axis=2))
    seen = made.record(genes, teams[0], a_world.scenarios([keys(5)[first]]), modes[0])
    assert (seen["action"][:end] >= 0).all()
    assert (seen["action"][end:] == -1).all()
    assert seen["fitness"][-1].tolist() == out.fitness[0, first].tolist()


def test_the_packages_own_controller_is_better_than_nothing_and_random() -> None:
    mean = {}
    for name in ("nothing", "random", "scenario"):
        a_world, made, genes, teams, modes = played("balance", 1, name, iterations=100)
        out = made.evaluate(genes, teams, a_world.scenarios(keys(50)), modes)
        mean[name] = float(out.performance["reward"].mean())
    assert mean["scenario"] > 0 > mean["nothing"] > mean["random"]


def test_its_team_and_things_are_recorded_as_they_were_tested(tmp_path: Path) -> None:
    run = evolved(tmp_path / "run", 2)
    seen = record(run)
    assert seen.channels["x"].values.shape == (20, 4)
    assert run.test_result is not None
    rewards = run.test_result["champion"]["performance"]["reward"]["values"]
    assert seen.about["performance"]["reward"] == pytest.approx(rewards[0], abs=0)
    drawn = playback_of(seen)
    (food,) = drawn.things
    assert (food.name, food.x.values.shape[-1], food.size) == ("food", 4, 0.05)
    assert drawn.bounds == pytest.approx((-1.035, -1.035, 1.035, 1.035))  # and a robot's radius
    assert [state.name for state in food.states] == ["there", "taken"]


def test_options_are_the_scenarios_keywords(capsys: pytest.CaptureFixture[str]) -> None:
    assert world("vmas:dispersion", options="n_agents = 2").n_robots == 2
    with pytest.raises(UsageError, match=r"unknown option 'agents' of vmas:dispersion; did you"):
        world("vmas:dispersion", options="agents = 2")
    with pytest.raises(UsageError, match="cannot be made with options"):
        world("vmas:dispersion", options="n_agents = 'many'")
    with pytest.raises(SystemExit, match="2"):
        main(["run", "vmas:balanced"])
    error = capsys.readouterr().err
    assert "unknown scenario 'balanced' of VMAS, as in vmas:balance; did you mean" in error
    assert error.count("\n") == 1


def test_robots_that_observe_less_get_zeros() -> None:
    a_world, made, genes, teams, _ = played("simple_speaker_listener", 1, iterations=5)
    seen = made.record(genes, teams[0], a_world.scenarios(keys(1)))
    sizes = [int((seen["inputs"][:, i] != 0).any(axis=0).sum()) for i in range(2)]
    assert sizes[0] < sizes[1]
    assert (seen["inputs"][:, :, -1] == 1).all()


def test_torch_is_loaded_for_such_a_task_only() -> None:
    code = (
        "import sys, conevo; from conevo.worlds.registry import resolve;"
        "resolve('rover/complex-1'); resolve('vmas:balance'); assert 'torch' not in sys.modules;"
        "conevo.world('vmas:balance'); assert 'torch' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_torchs_functions_are_its_own_after_an_epoch() -> None:
    import torch

    before = torch.rand, torch.Tensor.uniform_, torch.get_num_threads()
    a_world, made, genes, teams, _ = played("dispersion", 1, iterations=2)
    made.evaluate(genes, teams, a_world.scenarios(keys(1)))
    assert (torch.rand, torch.Tensor.uniform_, torch.get_num_threads()) == before
    assert "uniform_" not in vars(torch.Tensor)


@pytest.mark.timing
def test_many_epochs_side_by_side_are_fast() -> None:
    """At least 80,000 team-steps in a second of a core: balance, networks, 4096 environments."""
    a_world, made, genes, teams, _ = played("balance", 4096, iterations=25)
    scenarios = a_world.scenarios(keys(1))
    made.evaluate(genes, teams, scenarios)  # makes the environments
    speeds = []
    for _ in range(3):
        began = time.process_time()
        steps = made.evaluate(genes, teams, scenarios).steps.sum()
        speeds.append(steps / (time.process_time() - began))
    assert max(speeds) >= 80_000


@pytest.mark.exhaustive
def test_clones_learn_to_balance_better_than_the_packages_controller(tmp_path: Path) -> None:
    """HomCNE, 4 million team-steps, 256 fresh scenarios: better in two of three seeds."""
    *_, modes = own = played("balance", 1, "scenario", iterations=100)
    a_world, made, genes, teams, _ = own
    fresh = a_world.scenarios([fold(9, "fresh", k) for k in range(256)])
    bar = float(made.evaluate(genes, teams, fresh, modes).performance["reward"].mean())
    sizes = {"run.budget_evaluations": 10_000, "run.epochs": 4, "run.n_tests": 256}
    found = []
    for seed in (1, 2, 3):
        run = conevo.evolve(
            "vmas:balance", "homcne", seed=seed, out=tmp_path / str(seed), overrides=sizes
        )
        assert run.generations()[-1]["team_steps"] < 4.2e6
        assert run.test_result is not None
        tested = run.test_result["champion"]["performance"]["reward"]["values"]
        found.append(float(np.mean(tested)))
    assert sum(one > bar for one in found) >= 2, (bar, found)
