"""Tasks of JaxMARL: rules of worlds, same scenarios, whole epochs equal to single steps, ends."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.controllers.registry import controller
from conevo.errors import UsageError
from conevo.replay.playback import playback_of
from conevo.replay.recording import record
from conevo.rng import fold
from conevo.simulators.playing import TaskSimulator
from conevo.worlds.checks import findings, random_teams
from conevo.worlds.registry import world
from conevo.worlds.simulators import simulator
from extras import need
from runs.tiny import content
from simulators.refusals import check_refused

need("jax", "jaxmarl")

SPREAD, TAG = "MPE_simple_spread_v3", "MPE_simple_tag_v3"
LISTENER = "MPE_simple_speaker_listener_v4"
T = 28  # iterations: three more than the particle worlds play
SMALL = {
    "run.epochs": 2, "run.fittest_epochs": 2, "run.n_tests": 3, "run.n_validations": 2,
    "run.n_finalists": 2, "world.iterations": T, "method.genotypes": 4,
}  # fmt: skip
FLEE = """
import numpy as np

def flee(agent, observation, uniforms):
    assert agent == "agent_0" and observation.shape[1] == 14 and uniforms.shape[1] == 1
    return np.where(observation[:, 2] > 0, 2, 1)

def side(observation, action):
    return (observation[:, 2] > 0).astype(int)

side.names = ("left half", "right half")
"""


def keys(n: int) -> list[int]:
    return [fold(3, "epoch", k) for k in range(n)]


def played(task: str, n: int, heuristic: str = "", threads: int = 1, **params: Any) -> Any:
    """Return a world, its simulator, a pool, and n random teams or teams of a heuristic."""
    a_world = world(f"jaxmarl:{task}", **({"iterations": T} | params))
    genes, teams = random_teams(a_world, n)
    chosen = a_world.heuristics.index(heuristic) if heuristic else -1
    modes = np.full(teams.shape[:2], chosen, np.int32)
    return a_world, simulator(a_world, controller(world=a_world), threads), genes, teams, modes


def bits(out: Any) -> list[bytes]:
    parts = (out.fitness, out.counts, out.switches, out.steps, *out.performance.values())
    return [part.tobytes() for part in parts]


def by_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Play epochs step by step, with controllers in numpy."""
    from conevo.simulators.jaxmarl.simulator import JaxMarlSimulator

    monkeypatch.setattr(JaxMarlSimulator, "players", TaskSimulator.players)


def evolved(path: Path, generations: int, task: str = TAG, **more: Any) -> conevo.Run:
    settings = SMALL | {"run.generations": generations} | more
    return conevo.evolve(
        f"jaxmarl:{task}", "cone", "smoke", out=path, overrides=settings, threads=1
    )


def test_it_keeps_the_rules_of_a_world_with_its_own_simulator() -> None:
    found = findings(f"jaxmarl:{SPREAD}")
    assert [(one.topic, one.text) for one in found if one.status == "problem"] == []


def test_all_teams_meet_the_same_scenarios_and_batches_do_not_matter() -> None:
    """Clones of a team do alike, and a team does alone what it does among many, bit for bit."""
    a_world, made, genes, teams, modes = played(TAG, 70)
    scenarios = a_world.scenarios(keys(3))
    clones = made.evaluate(genes, np.repeat(teams[:1], 70, axis=0), scenarios)
    assert np.ptp(clones.fitness, axis=0).max() == np.ptp(clones.counts, axis=0).max() == 0
    assert len(np.unique(clones.counts[0], axis=0)) == 3  # scenarios differ
    among = made.evaluate(genes, teams, scenarios)
    assert len(np.unique(among.fitness.sum(axis=2))) > 3
    for k, e in ((0, 2), (7, 0), (69, 1)):
        alone = made.evaluate(genes, teams[k : k + 1], a_world.scenarios(keys(3)[e : e + 1]))
        assert alone.fitness[0, 0].tolist() == among.fitness[k, e].tolist()
        assert alone.counts[0, 0].tolist() == among.counts[k, e].tolist()
    mixed = modes.copy()
    mixed[1:, 0] = 1  # a robot of every other team acts at random
    assert made.evaluate(genes, teams, scenarios, mixed).fitness[0].tolist() == (
        among.fitness[0].tolist()
    )


@pytest.mark.parametrize(
    ("task", "options"), [(TAG, ""), (SPREAD, 'action_type = "Continuous"'), (LISTENER, "")]
)
def test_whole_epochs_equal_single_steps(
    task: str, options: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Networks of jax and numpy, and one program and another, agree bit for bit."""
    a_world, made, genes, teams, modes = played(task, 30, options=options)
    assert "fused" not in a_world.facts.versions
    modes[3:5], modes[5, 0] = 0, 1
    scenarios = a_world.scenarios(keys(3))
    whole = made.evaluate(genes, teams, scenarios, modes)
    seen = made.record(genes, teams[0], scenarios)
    assert seen["fitness"][-1].tolist() == whole.fitness[0, 0].tolist()
    by_steps(monkeypatch)
    assert bits(made.evaluate(genes, teams, scenarios, modes)) == bits(whole)
    stepped = made.record(genes, teams[0], scenarios)
    assert {name: one.tobytes() for name, one in stepped.items()} == {
        name: one.tobytes() for name, one in seen.items()
    }
    assert np.ptp(seen["hidden"][:, :, :5], axis=0).all()


def test_results_do_not_depend_on_threads() -> None:
    a_world, one, genes, teams, _ = played(TAG, 70)
    two = simulator(a_world, controller(world=a_world), 2)
    scenarios = a_world.scenarios(keys(3))
    assert bits(one.evaluate(genes, teams, scenarios)) == bits(
        two.evaluate(genes, teams, scenarios)
    )


def test_an_epoch_ends_when_the_task_does() -> None:
    a_world, made, genes, teams, _ = played(TAG, 2)
    out = made.evaluate(genes, teams, a_world.scenarios(keys(2)))
    assert (out.steps == 26).all()  # JaxMARL counts its 25 steps from 0, and so plays one more
    assert (out.counts.sum(axis=3) == 26).all()
    seen = made.record(genes, teams[0], a_world.scenarios(keys(1)))
    assert (seen["action"][:26] >= 0).all()
    assert (seen["action"][26:] == -1).all()
    assert len(seen["action"]) == T


def test_a_run_is_continued_bit_for_bit(tmp_path: Path) -> None:
    whole = evolved(tmp_path / "whole", 3)
    short = evolved(tmp_path / "short", 1).resume(generations=3)
    one, other = content(whole.path), content(short.path)
    assert one["generations"] == other["generations"]
    assert (one["checkpoint"], one["champion.npz"]) == (other["checkpoint"], other["champion.npz"])
    assert whole.provenance["kernel_hash"].startswith("jaxmarl 0.2.")
    assert ", jax 0." in whole.provenance["kernel_hash"]
    assert whole.generations()[-1]["team_steps"] % 26 == 0
    seen = record(whole)
    assert seen.channels["x"].values.shape == (T, 3)
    assert whole.test_result is not None
    rewards = whole.test_result["champion"]["performance"]["reward"]["values"]
    assert seen.about["performance"]["reward"] == pytest.approx(rewards[0], abs=0)
    drawn = playback_of(seen)
    found = [(one.name, one.x.values.shape[-1], one.size) for one in drawn.things]
    assert found == [
        ("agent", 1, pytest.approx(0.05)),
        ("landmark", 2, pytest.approx(0.2)),
    ]


def test_other_processes_get_the_same_results(tmp_path: Path) -> None:
    """One that has used jax before has fused operations, and is not continued by others."""
    code = (
        "import numpy as np{0}; from conevo.worlds.registry import world;"
        "from conevo.worlds.checks import random_teams;"
        "from conevo.controllers.registry import controller;"
        f"w = world('jaxmarl:{TAG}', iterations={T}); g, t = random_teams(w, 70);"
        "s = w.simulator(controller(world=w), 1);"
        f"out = s.evaluate(g, t, w.scenarios({keys(3)}));"
        "print(w.fingerprint, '|', out.fitness.tobytes().hex())"
    )

    def of(before: str) -> list[str]:
        environment = {key: value for key, value in os.environ.items() if key != "XLA_FLAGS"}
        ran = subprocess.run(
            [sys.executable, "-c", code.format(before)],
            capture_output=True, text=True, check=True, env=environment,
        )  # fmt: skip
        assert ran.stderr == ""
        return ran.stdout.split("|")

    a_world, made, genes, teams, _ = played(TAG, 70)
    fitness = made.evaluate(genes, teams, a_world.scenarios(keys(3))).fitness
    fingerprint, other = of("")
    assert fingerprint.strip() == a_world.fingerprint
    assert other.strip() == fitness.tobytes().hex()
    fused, near = of(", jax; jax.numpy.ones(3)")
    assert ", fused: " in fused or fused == fingerprint  # without fused operations on this machine
    found = np.frombuffer(bytes.fromhex(near.strip()), np.float32).reshape(fitness.shape)
    assert np.isclose(found, fitness, atol=1e-4).mean() > 0.9


@pytest.mark.parametrize("kind", ["gru", "ctrnn"])
def test_other_controllers_are_played_step_by_step(kind: str) -> None:
    a_world, _, _, _, _ = played(TAG, 1)
    mind = controller(kind, world=a_world)
    made = simulator(a_world, mind, 1)
    genome = mind.genome(len(a_world.inputs), len(a_world.outputs))
    rng = np.random.default_rng(1)
    genes = rng.uniform(-1, 1, (40, genome.n_genes)).astype(np.float32)
    teams = rng.integers(40, size=(3, 3, genome.max_parts)).astype(np.int32)
    among = made.evaluate(genes, teams, a_world.scenarios(keys(2)))
    alone = made.evaluate(genes, teams[2:], a_world.scenarios(keys(2)))
    assert alone.fitness[0].tolist() == among.fitness[2].tolist()
    assert alone.counts[0].tolist() == among.counts[2].tolist()
    assert len(np.unique(among.counts)) > 5


def test_the_others_and_labels_are_functions_of_a_file(tmp_path: Path) -> None:
    file = tmp_path / "flee.py"
    file.write_text(FLEE)
    found = []
    for others in ("random", "random", f"{file}:flee"):
        a_world, made, genes, teams, _ = played(TAG, 1, others=others)
        seen = made.record(genes, teams[0], a_world.scenarios(keys(1)))
        found.append(seen["things_x"][:, 0].tolist())
    assert found[0] == found[1] != found[2]
    a_world, made, genes, teams, _ = played(TAG, 1, labels=f"{file}:side")
    out = made.evaluate(genes, teams, a_world.scenarios(keys(2)))
    seen = made.record(genes, teams[0], a_world.scenarios(keys(1)))
    sides = (seen["inputs"][:26, :, 2] > 0).sum(axis=0)
    assert out.counts[0, 0, :, 1].tolist() == sides.tolist()
    assert 0 < sides.sum() < 3 * 26


def test_heuristics_are_nothing_and_random() -> None:
    for name, most in (("nothing", 1), ("random", 5)):
        a_world, made, genes, teams, modes = played(TAG, 1, name)
        out = made.evaluate(genes, teams, a_world.scenarios(keys(4)), modes)
        assert ((out.counts > 0).sum(axis=3) <= most).all()
        assert out.counts[:, :, :, 0].max() == 26 or name == "random"
    assert (out.counts.sum(axis=(0, 1, 2)) > 30).all()  # of 312


def test_agents_are_robots_by_the_beginning_of_their_names() -> None:
    tag = world(f"jaxmarl:{TAG}")
    assert (tag.params.team, tag.params.iterations, tag.n_robots) == ("adversary", 25, 3)
    assert tag.actions == ("stay", "left", "right", "down", "up")
    assert world(f"jaxmarl:{TAG}", team="").n_robots == 4
    with pytest.raises(UsageError, match=r"unknown agents 'advresary' in world\.team; did you"):
        world(f"jaxmarl:{TAG}", team="advresary")


def test_options_are_the_tasks_keywords() -> None:
    assert world(f"jaxmarl:{SPREAD}", options="num_agents = 4").n_robots == 4
    with pytest.raises(UsageError, match=r"unknown option 'num_agent' of .*did you mean 'num_ag"):
        world(f"jaxmarl:{SPREAD}", options="num_agent = 4")
    with pytest.raises(UsageError, match="cannot be made with options 'local_ratio = 2'"):
        world(f"jaxmarl:{SPREAD}", options="local_ratio = 2")
    with pytest.raises(UsageError, match="has no agents with options 'num_agents = 0'"):
        world(f"jaxmarl:{SPREAD}", options="num_agents = 0")


@pytest.mark.parametrize(
    ("task", "words"),
    [
        ("MPE_simple_spread", "did you mean 'MPE_simple_spread_v3'?"),
        ("simple_tag_v3", "did you mean 'MPE_simple_tag_v3'?"),
        ("JaxRobotarium_foraging", "jaxrobotarium package, which is not installed"),
    ],
)
def test_a_task_that_is_not_one_is_refused_in_one_line(
    task: str, words: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    check_refused(f"jaxmarl:{task}", words, tmp_path / "run", capfd)


def test_jax_is_loaded_for_such_a_task_only_and_leaves_streams_and_environment() -> None:
    code = (
        "import os, sys, conevo; from conevo.worlds.registry import resolve;"
        "sys.stdout, before = sys.stderr, dict(os.environ);"
        f"resolve('rover/complex-1'); resolve('jaxmarl:{TAG}'); assert 'jax' not in sys.modules;"
        f"conevo.world('jaxmarl:{TAG}'); assert 'jax' in sys.modules;"
        "assert sys.stdout is sys.stderr and dict(os.environ) == before"
    )
    ran = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    assert (ran.stdout, ran.stderr) == (b"", b"")


@pytest.mark.timing
def test_whole_epochs_are_fast() -> None:
    """Spread with networks, 2000 teams in 4 scenarios, two threads: 80,000 team-steps a second.

    It is measured in the processor's time, of which two threads have two seconds in each second.
    """
    a_world, made, genes, teams, _ = played(SPREAD, 2000, threads=2, iterations=25)
    scenarios = a_world.scenarios(keys(4))
    made.evaluate(genes, teams[:1], scenarios)  # compiles
    speeds = []
    for _ in range(3):
        began = time.process_time()
        steps = made.evaluate(genes, teams, scenarios).steps.sum()
        speeds.append(2 * steps / (time.process_time() - began))
    assert steps == 2000 * 4 * 25
    assert max(speeds) >= 80_000
