"""Tasks of PettingZoo: rules of worlds, same scenarios, any workers, teams and others, ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
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
from conevo.simulators.pettingzoo.world import DEFAULTS
from conevo.worlds.checks import findings, random_teams
from conevo.worlds.registry import world
from conevo.worlds.simulators import simulator
from extras import need
from runs.tiny import content
from simulators.refusals import check_refused

need("mpe2", "pettingzoo")

TAG, SPREAD = "mpe2.simple_tag_v3", "mpe2.simple_spread_v3"
ZOO = "simulators.zoo"
SMALL = {
    "run.epochs": 2, "run.fittest_epochs": 2, "run.n_tests": 3, "run.n_validations": 2,
    "run.n_finalists": 2, "world.iterations": 6, "method.genotypes": 4,
}  # fmt: skip
FLEE = """
import numpy as np

def flee(agent, observation, uniforms):
    assert agent == "agent_0" and observation.shape[1] == 14 and uniforms.shape[1] == 1
    return np.where(observation[:, 2] > 0, 2, 1)

def bad(agent, observation, uniforms):
    return {}["nothing"]

def wrong(agent, observation, uniforms):
    return np.full(len(observation), 5)
"""


def keys(n: int) -> list[int]:
    return [fold(3, "epoch", k) for k in range(n)]


def played(task: str, n: int, heuristic: str = "", threads: int = 1, **params: Any) -> Any:
    """Return a world, its simulator, a pool, and n random teams or teams of a heuristic."""
    a_world = world(f"pettingzoo:{task}", **params)
    genes, teams = random_teams(a_world, n)
    chosen = a_world.heuristics.index(heuristic) if heuristic else -1
    modes = np.full(teams.shape[:2], chosen, np.int32)
    return a_world, simulator(a_world, controller(world=a_world), threads), genes, teams, modes


def bits(out: Any) -> list[bytes]:
    parts = (out.fitness, out.counts, out.switches, out.steps, *out.performance.values())
    return [part.tobytes() for part in parts]


def evolved(path: Path, generations: int, threads: int = 1, **more: Any) -> conevo.Run:
    settings = SMALL | {"run.generations": generations} | more
    return conevo.evolve(
        f"pettingzoo:{TAG}", "cone", "smoke", out=path, overrides=settings, threads=threads
    )


@pytest.mark.parametrize("task", [ZOO, pytest.param(TAG, marks=pytest.mark.slow)])
def test_it_keeps_the_rules_of_a_world_with_its_own_simulator(
    task: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(DEFAULTS, ZOO, {"team": "w", "iterations": 10})
    found = findings(f"pettingzoo:{task}")
    assert [(one.topic, one.text) for one in found if one.status == "problem"] == []


@pytest.mark.parametrize(
    ("task", "options"), [(TAG, ""), (SPREAD, "continuous_actions = true"), (ZOO, "")]
)
def test_all_teams_meet_the_same_scenarios(task: str, options: str) -> None:
    team = "w" if task == ZOO else ""
    a_world, made, genes, teams, _ = played(task, 5, iterations=8, options=options, team=team)
    scenarios = a_world.scenarios(keys(3))
    clones = made.evaluate(genes, np.repeat(teams[:1], 5, axis=0), scenarios)
    assert np.ptp(clones.fitness, axis=0).max() == 0
    assert len(np.unique(clones.fitness[0], axis=0)) == 3  # scenarios differ
    among = made.evaluate(genes, teams, scenarios)
    for k, e in ((0, 2), (4, 0)):
        alone = made.evaluate(genes, teams[k : k + 1], a_world.scenarios(keys(3)[e : e + 1]))
        assert alone.fitness[0, 0].tolist() == among.fitness[k, e].tolist()
        assert alone.counts[0, 0].tolist() == among.counts[k, e].tolist()


def test_results_do_not_depend_on_workers_and_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    a_world, one, genes, teams, _ = played(TAG, 5, iterations=8)
    two = simulator(a_world, controller(world=a_world), 2)
    scenarios = a_world.scenarios(keys(3))
    whole = bits(one.evaluate(genes, teams, scenarios))
    assert bits(two.evaluate(genes, teams, scenarios)) == whole
    monkeypatch.setattr("conevo.simulators.pettingzoo.epochs.SIDE_BY_SIDE", 2)
    assert bits(one.evaluate(genes, teams, scenarios)) == whole
    assert bits(two.evaluate(genes, teams, scenarios)) == whole


def test_a_run_is_continued_bit_for_bit_with_any_number_of_workers(tmp_path: Path) -> None:
    whole = evolved(tmp_path / "whole", 3)
    short = evolved(tmp_path / "short", 1, threads=2).resume(generations=3, threads=2)
    one, other = content(whole.path), content(short.path)
    assert one["generations"] == other["generations"]
    assert (one["checkpoint"], one["champion.npz"]) == (other["checkpoint"], other["champion.npz"])
    assert whole.provenance["kernel_hash"].startswith("mpe2 1.")
    assert "pettingzoo 1." in whole.provenance["kernel_hash"]
    seen = record(whole)
    assert seen.channels["x"].values.shape == (6, 3)
    assert whole.test_result is not None
    rewards = whole.test_result["champion"]["performance"]["reward"]["values"]
    assert seen.about["performance"]["reward"] == pytest.approx(rewards[0], abs=0)
    drawn = playback_of(seen)
    found = [(one.name, one.x.values.shape[-1], one.size) for one in drawn.things]
    assert found == [("agent", 1, 0.05), ("landmark", 2, 0.2)]


def test_an_epoch_ends_when_the_task_does() -> None:
    a_world, made, genes, teams, _ = played(TAG, 2, iterations=40, options="max_cycles = 7")
    out = made.evaluate(genes, teams, a_world.scenarios(keys(2)))
    assert (out.steps == 7).all()
    assert (out.counts.sum(axis=3) == 7).all()
    seen = made.record(genes, teams[0], a_world.scenarios(keys(1)))
    assert (seen["action"][:7] >= 0).all()
    assert (seen["action"][7:] == -1).all()
    assert len(seen["action"]) == 40
    longer = world(f"pettingzoo:{TAG}", options="max_cycles = 7", iterations=7)
    again = simulator(longer, controller(world=longer), 1)
    assert again.evaluate(genes, teams, longer.scenarios(keys(2))).fitness.tolist() == (
        out.fitness.tolist()
    )


def test_a_robot_that_leaves_acts_no_more() -> None:
    a_world, made, genes, teams, _ = played(ZOO, 1, iterations=30, options="leaves = 4", team="w")
    out = made.evaluate(genes, teams, a_world.scenarios(keys(2)))
    assert out.steps.tolist() == [[12, 12]]
    assert out.counts.sum(axis=3).tolist() == [[[4, 12], [4, 12]]]
    seen = made.record(genes, teams[0], a_world.scenarios(keys(1)))
    assert [(seen["action"][:, i] >= 0).sum() for i in range(2)] == [4, 12]
    assert (seen["fitness"][4:, 0] == seen["fitness"][3, 0]).all()
    assert seen["fitness"][-1].tolist() == out.fitness[0, 0].tolist()
    assert (seen["inputs"][5:, 0, :4] == 0).all()


def test_agents_may_act_one_after_another_in_each_cycle() -> None:
    found = []
    for task in (ZOO, f"{ZOO}_in_cycles"):
        options = "leaves = 4"
        a_world, made, genes, teams, _ = played(task, 3, iterations=20, options=options, team="w")
        found.append(bits(made.evaluate(genes, teams, a_world.scenarios(keys(2)))))
    assert found[0] == found[1]


@pytest.mark.parametrize("noise", ["process", "clock", "earlier"])
def test_a_task_that_does_not_do_the_same_again_is_refused(noise: str) -> None:
    with pytest.raises(UsageError, match=r"reset\(seed=1\) it does not do the same again"):
        world(f"pettingzoo:{ZOO}", options=f'noise = "{noise}"', team="w")


@pytest.mark.parametrize(
    ("crash", "code", "words"),
    [
        ("exit", 3, f"a worker process that plays pettingzoo:{ZOO} has died (exit code 7)"),
        (
            "exit in tries",
            3,
            f"a worker process that plays pettingzoo:{ZOO} has died (exit code 7)",
        ),
        ("error", 2, f"pettingzoo:{ZOO} fails: ValueError: no more food"),
        ("error in tries", 2, f"pettingzoo:{ZOO} cannot be played: ValueError: no more food"),
        ("sys.exit", 2, f"pettingzoo:{ZOO} fails: SystemExit: no more"),
    ],
)
def test_a_task_that_fails_is_one_line(
    crash: str, code: int, words: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    settings = ["world.team=w", f"world.options=crash = '{crash}'", "world.iterations=20"]
    given = [part for one in settings for part in ("--set", one)]
    with pytest.raises(SystemExit, match=str(code)):
        main(["run", f"pettingzoo:{ZOO}", "--out", str(tmp_path / "run"), *given])
    error = capfd.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "run").exists()
    assert world(f"pettingzoo:{ZOO}", team="w").n_robots == 2  # by another worker


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("wrong = 'long'", "gives guard an observation of 7 values of type float32, where"),
        ("wrong = 'text'", "gives guard an observation of 2 values of type <U4, where its"),
        ("wrong = 'no observation'", "gives no observation to guard"),
        ("wrong = 'no reward'", "gives no reward to guard"),
        ("agents = []", r"possible_agents must be names, not \[\]"),
        ("agents = [1, 2]", r"possible_agents must be names, not \[1, 2\]"),
        ("agents = ['w_0', 'w_1', 'w_0']", "two agents have the same name"),
    ],
)
def test_agents_need_names_observations_of_their_space_and_rewards(
    options: str, words: str
) -> None:
    with pytest.raises(UsageError, match=words) as refused:
        world(f"pettingzoo:{ZOO}", options=options, team="w")
    assert "\n" not in str(refused.value)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks at /proc")
def test_a_worker_ends_in_a_step_that_never_returns() -> None:
    """Its owner is killed, and so it never reads the end of the pipe."""
    script = (
        "import time; from conevo.simulators.pettingzoo.workers import workers;"
        "workers(1)[0].ask(time.sleep, 1000); print('asked', flush=True); time.sleep(1000)"
    )
    owner = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE)
    assert owner.stdout is not None
    assert owner.stdout.readline() == b"asked\n"
    (worker,) = children(owner.pid)
    time.sleep(1)  # it sleeps by now
    owner.kill()
    owner.communicate()
    until(lambda: not is_alive(worker))


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    found = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for file in found for child in file.read_text().split()]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks at /proc")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_is_left_and_the_run_goes_on(how: signal.Signals, tmp_path: Path) -> None:
    """A run is ended in its middle; then it has the same results as one that was not."""
    command = [sys.executable, "-m", "conevo", "run", f"pettingzoo:{ZOO}", "--method", "cone"]
    settings = SMALL | {"run.generations": 6, "world.iterations": 25, "world.team": "w"}
    given = [part for key, one in settings.items() for part in ("--set", f"{key}={one}")]
    where = ["--preset", "smoke", "--threads", "2", "--out", str(tmp_path / "run")]
    process = subprocess.Popen(
        [*command, *given, *where], start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        # A job in the background ignores ctrl-c, and so do its children.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    lines = tmp_path / "run" / "generations.jsonl"
    until(lambda: lines.exists() and lines.read_text().count("\n") >= 2)
    workers = children(process.pid)
    assert len(workers) == 2
    process.send_signal(how) if how == signal.SIGKILL else os.killpg(process.pid, how)
    assert process.wait(60) in (-how, 128 + how)
    until(lambda: not any(is_alive(one) for one in workers))
    again = conevo.Run(tmp_path / "run")
    assert again.status != "finished"
    again.resume(threads=1)
    whole = conevo.evolve(
        f"pettingzoo:{ZOO}", "cone", "smoke", out=tmp_path / "whole", overrides=settings, threads=1
    )
    one, other = content(whole.path), content(again.path)
    assert one["generations"] == other["generations"]
    assert (one["checkpoint"], one["champion.npz"]) == (other["checkpoint"], other["champion.npz"])


def is_alive(pid: int) -> bool:
    """Return whether a process has not ended."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state not in "ZX"


def until(is_so: Callable[[], bool], seconds: float = 60) -> None:
    """Wait for something."""
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_agents_are_robots_by_the_beginning_of_their_names() -> None:
    tag = world(f"pettingzoo:{TAG}")
    assert (tag.params.team, tag.params.iterations, tag.n_robots) == ("adversary", 25, 3)
    assert tag.actions == ("stay", "left", "right", "down", "up")
    assert world(f"pettingzoo:{TAG}", team="").n_robots == 4
    assert world(f"pettingzoo:{TAG}", team="agent, adversary_1").facts.team == (1, 3)
    with pytest.raises(UsageError, match=r"unknown agents 'advresary' in world\.team; did you"):
        world(f"pettingzoo:{TAG}", team="advresary")
    with pytest.raises(UsageError, match="must all choose among actions, or all have axes"):
        world(f"pettingzoo:{ZOO}")


def test_the_others_are_random_or_a_function(tmp_path: Path) -> None:
    file = tmp_path / "flee.py"
    file.write_text(FLEE)
    found = []
    for others in ("random", "random", f"{file}:flee"):
        a_world, made, genes, teams, _ = played(TAG, 1, iterations=8, others=others)
        seen = made.record(genes, teams[0], a_world.scenarios(keys(1)))
        found.append(seen["things_x"][:, 0].tolist())
    assert found[0] == found[1] != found[2]
    assert np.all(np.abs(np.diff(found[2])) > 0.01)  # it never rests
    for name, words in (
        ("wrong", "must return numbers of actions from 0 to 4"),
        ("bad", "fails: K"),
    ):
        a_world, made, genes, teams, _ = played(TAG, 1, others=f"{file}:{name}")
        with pytest.raises(UsageError, match=f"{name} {words}"):
            made.evaluate(genes, teams, a_world.scenarios(keys(1)))
    with pytest.raises(UsageError, match=r"unknown function 'fle' in .*did you mean 'flee'"):
        world(f"pettingzoo:{TAG}", others=f"{file}:fle")
    with pytest.raises(UsageError, match=r"unknown others 'randm'.*did you mean 'random'"):
        world(f"pettingzoo:{TAG}", others="randm")


def test_a_run_keeps_the_file_of_the_others(tmp_path: Path) -> None:
    file = tmp_path / "flee.py"
    file.write_text(FLEE)
    run = evolved(tmp_path / "run", 1, **{"world.others": f"{file}:flee"})
    file.unlink()
    moved = run.path.rename(tmp_path / "moved")
    assert conevo.Run(moved).resume(generations=2).status == "finished"
    kept = moved / "inputs" / "flee.py"
    kept.write_text(FLEE.replace("> 0", "< 0"))
    with pytest.raises(UsageError, match=r"flee\.py has changed"):
        conevo.Run(moved).resume(generations=3)


def test_heuristics_are_nothing_and_random() -> None:
    for name, most in (("nothing", 1), ("random", 5)):
        a_world, made, genes, teams, modes = played(TAG, 1, name)
        out = made.evaluate(genes, teams, a_world.scenarios(keys(4)), modes)
        assert ((out.counts > 0).sum(axis=3) <= most).all()
        assert out.counts[:, :, :, 0].max() == 25 or name == "random"
    assert (out.counts.sum(axis=(0, 1, 2)) > 30).all()  # of 300


@pytest.mark.parametrize(
    ("task", "words"),
    [
        ("mpe2.simple_tga_v3", "did you mean 'mpe2.simple_tag_v3'?"),
        ("simple_tag_v3", "did you mean 'mpe2.simple_tag_v3'?"),
        ("json", "unknown task 'json' of PettingZoo, nor a module on PYTHONPATH"),
        ("tasks_of_my_own", "unknown task 'tasks_of_my_own' of PettingZoo"),  # a folder
        ("pettingzoo.utils", "has no function parallel_env, nor env"),
        ("pettingzoo.classic.tictactoe_v3", "its agents must act at the same time"),
    ],
)
def test_a_task_that_is_not_one_is_refused_in_one_line(
    task: str,
    words: str,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "tasks_of_my_own").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    check_refused(f"pettingzoo:{task}", words, tmp_path / "run", capfd)


def test_options_are_the_tasks_keywords() -> None:
    assert world(f"pettingzoo:{SPREAD}", options="N = 4").n_robots == 4
    with pytest.raises(UsageError, match=r"unknown option 'max_cycle' of .*did you mean 'max_cyc"):
        world(f"pettingzoo:{TAG}", options="max_cycle = 4")
    with pytest.raises(UsageError, match="cannot be made with options 'num_good"):
        world(f"pettingzoo:{TAG}", options="num_good = 'many'")


def test_the_task_is_loaded_by_workers_only(tmp_path: Path) -> None:
    script = tmp_path / "script.py"  # without a guard against being run again by its workers
    script.write_text(
        f"import sys, conevo; print('once', conevo.world('pettingzoo:{TAG}').n_robots);"
        "assert not {'mpe2', 'pettingzoo', 'gymnasium', 'pygame'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, script], check=True, capture_output=True, text=True)
    assert done.stdout == "once 3\n"


def busy(pid: int) -> float:
    """Return the seconds that a process has computed."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.timing
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks at /proc")
def test_two_workers_share_the_work() -> None:
    """In 256 epochs; in the processor's time, which other work on the machine changes less."""
    seconds = {}
    for threads in (1, 2):
        a_world, made, genes, teams, _ = played(SPREAD, 64, threads=threads)
        scenarios = a_world.scenarios(keys(4))
        made.evaluate(genes, teams[:8], scenarios)
        before = {pid: busy(pid) for pid in children(os.getpid())}
        made.evaluate(genes, teams, scenarios)
        seconds[threads] = max(busy(pid) - start for pid, start in before.items())
    assert 64 * 4 * 25 / seconds[1] > 400  # team-steps
    assert seconds[2] < 0.7 * seconds[1]
