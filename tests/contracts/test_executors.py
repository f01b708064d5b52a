"""The contract of executors under a coordinator; a registry entry enrols an executor.

Whichever process is killed, nothing is lost and nothing is run twice. Failures are listed with
their reason. Never do more threads run than there are cores. The tests share one Ray, except two: a
killed or interrupted coordinator stops the Ray that it has started.
"""

import importlib.util
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import conevo
from campaigns.processes import n_generations, until, workers
from conevo.campaigns.campaign import create
from conevo.campaigns.executors.protocol import RunJob
from conevo.campaigns.executors.registry import EXECUTORS, make_executor
from conevo.campaigns.plan_file import read_plan
from conevo.runs.directory import read_json

NEEDS = {
    "ray": [pytest.mark.skipif(not importlib.util.find_spec("ray"), reason="Ray is not installed")]
}
NAMES = [
    pytest.param(name, marks=[*NEEDS.get(name, []), *[pytest.mark.slow] * (name != "serial")])
    for name in EXECUTORS
]
every_executor = pytest.mark.parametrize("name", NAMES)
every_with_workers = pytest.mark.parametrize(
    "name", [one for one in NAMES if one.values != ("serial",)]
)  # "serial" has none: killing its run kills the coordinator
QUICK = {"run.generations": 2, "method.genotypes": 10, "world.iterations": 100}
LONG = {"run.generations": 10, "method.genotypes": 20, "world.iterations": 1000}
ENDLESS = LONG | {"run.generations": 100_000}
FEW = {"run.fittest_epochs": 1, "run.n_tests": 2}
PLAN = """
[campaign]
seeds = {seeds}
preset = "smoke"
studies = []
[factors]
world = ["rover/complex-1"]
method = {methods}
[settings]
{settings}
"""
FAILS = """
[[where]]  # a budget that pays for nothing: such a run always fails
method = "hetcne"
settings = { "method.genotypes" = 20, "run.budget_evaluations" = 1 }
"""

COORDINATORS: list[subprocess.Popen[str]] = []


@pytest.fixture
def campaign(tmp_path):
    """Return a function that writes out a campaign of small runs."""

    def make(settings, seeds=1, methods=("homcne",)):
        path = tmp_path / "plan.toml"
        lines = [f'"{key}" = {value}' for key, value in (settings | FEW).items()]
        text = PLAN.format(seeds=seeds, methods=list(methods), settings="\n".join(lines))
        path.write_text(text + FAILS * ("hetcne" in methods))
        return create(read_plan(path), tmp_path / "campaign")

    return make


@pytest.fixture(scope="module")
def executor_of():
    """Return a function that makes an executor by its name and number of cores."""
    clusters = []

    def make(name, cores):
        if name != "ray":
            return make_executor(name, cores)
        if not clusters:
            from ray.cluster_utils import Cluster

            node = {"num_cpus": 2, "object_store_memory": 80 * 2**20, "include_dashboard": False}
            with pytest.MonkeyPatch.context() as patch:
                patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
                clusters.append(Cluster(initialize_head=True, head_node_args=node))
        return make_executor(name, cores, address=clusters[0].address)

    yield make
    for cluster in clusters:
        cluster.shutdown()


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Return a function that returns the outcome of a planned run if it is not disturbed."""
    known = {}

    def make(planned):
        if planned.run_ids not in known:
            path = tmp_path_factory.mktemp("undisturbed") / "run"
            run = conevo.evolve(
                planned.world, planned.method, planned.preset, planned.seed, path,
                overrides=planned.overrides, threads=1,
            )  # fmt: skip
            known[planned.run_ids] = outcome(run)
        return known[planned.run_ids]

    return make


def outcome(run):
    """Return all results of a run, without times and sessions."""
    rows = [{k: v for k, v in row.items() if k != "seconds"} for row in run.generations()]
    return rows, run.champion.genes.tobytes(), run.test_result


def run_of(campaign, label):
    return conevo.Run(campaign.paths.run(label))


def coordinate(campaign, name):
    """Start a process that carries out a campaign, with one core for all its runs."""
    code = (
        "from conevo.campaigns.campaign import Campaign\n"
        "from conevo.campaigns.executors.registry import make_executor\n"
        f"Campaign({str(campaign.path)!r}).carry_on(make_executor({name!r}, 1))\n"
    )
    begun = subprocess.Popen(
        [sys.executable, "-c", code],
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    COORDINATORS.append(begun)
    return begun


@pytest.fixture(autouse=True)
def none_left_behind():
    """Kill the coordinators of a failed test: their runs never end."""
    yield
    for process in COORDINATORS:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    COORDINATORS.clear()


def assert_finished(campaign, undisturbed):
    """Assert that all runs are finished, bit for bit as if they had not been disturbed."""
    for label, planned in campaign.planned.items():
        run = run_of(campaign, label)
        assert (run.status, run.changed_files) == ("finished", [])
        assert outcome(run) == undisturbed(planned)


@every_executor
def test_every_run_is_carried_out_once_and_never_more_threads_run_than_there_are_cores(
    name, executor_of, campaign, undisturbed
):
    made = campaign(LONG | {"run.generations": 4}, seeds=3)
    endings, seen = [], []

    def watch(campaign, ending):
        endings.extend([ending] if ending else [])
        seen.append(sum(int(words[-1]) for words in workers(campaign.path).values()))

    executor = executor_of(name, 2)
    assert executor.cores == 2
    standings = made.carry_on(executor, threads=2 if name == "serial" else 1, watch=watch)
    assert sorted(one.label for one in endings) == sorted(made.planned)
    assert {(one.state, one.attempts) for one in standings.values()} == {("finished", 1)}
    assert_finished(made, undisturbed)
    assert workers(made.path) == {}
    assert max(seen) == (0 if name == "serial" else 2)
    sessions = [run_of(made, label).provenance["sessions"] for label in made.planned]
    used = [session["threads"] for (session,) in sessions]
    assert used == ([2, 2, 2] if name == "serial" else [1, 1, used[2]])
    assert used[2] in (1, 2)  # the last one has both cores if both are free by then
    for label in made.planned:
        ended = read_json(made.paths.ended(label))
        assert ended["status"] == "finished"
        assert 0 < ended["core_seconds"] < 60


@every_executor
def test_a_finished_campaign_is_left_alone(name, executor_of, campaign):
    made = campaign(QUICK)
    made.carry_on(make_executor("serial", 1))
    before = {path: path.stat().st_mtime_ns for path in made.path.glob("runs/**/*")}
    made.carry_on(executor_of(name, 2), watch=lambda _, one: pytest.fail(f"ran {one}"))
    assert {path: path.stat().st_mtime_ns for path in made.path.glob("runs/**/*")} == before


@every_executor
def test_a_run_that_always_fails_is_listed_with_its_reason_and_stops_no_other(
    name, executor_of, campaign
):
    made = campaign(QUICK, methods=("hetcne", "homcne"))
    standings = made.carry_on(executor_of(name, 2))
    for label, planned in made.planned.items():
        failed = planned.method == "hetcne"
        assert standings[label].state == ("failed" if failed else "finished")
        assert ("does not pay for one generation" in standings[label].reason) == failed
    assert made.retry() == [label for label in made.planned if "hetcne" in label]
    assert {one.state for one in made.carry_on(executor_of(name, 2)).values()} == {
        "failed",
        "finished",
    }


@every_with_workers
def test_a_killed_worker_costs_an_attempt_and_no_result(name, executor_of, campaign, undisturbed):
    made = campaign(LONG)
    (label,) = made.planned
    killed = []

    def kill_once(campaign, ending):
        if ending is not None and not killed:
            pytest.fail(f"{ending} before a process was killed")
        if not killed and n_generations(campaign, label) > 2:
            (worker,) = workers(campaign.path)
            killed.append(worker)
            os.kill(worker, signal.SIGKILL)

    standings = made.carry_on(executor_of(name, 1), watch=kill_once)
    assert killed
    assert (standings[label].state, standings[label].attempts) == ("finished", 2)
    first, second = run_of(made, label).provenance["sessions"]
    assert second["from_generation"] >= 2 > first["from_generation"] == 0
    assert_finished(made, undisturbed)


@every_with_workers
def test_a_worker_that_is_killed_every_time_fails_with_that_reason(name, executor_of, campaign):
    made = campaign(ENDLESS, seeds=2)
    lost = next(iter(made.planned))
    other = [label for label in made.planned if label != lost]

    def kill(campaign, _):
        for worker, words in workers(campaign.path).items():
            if lost in words or n_generations(campaign, other[0]) == 0:
                os.kill(worker, signal.SIGKILL)

    standings = made.carry_on(executor_of(name, 1), watch=kill)
    for one in standings.values():
        assert (one.state, one.attempts) == ("failed", 3)
        assert one.reason == "killed by signal 9 (attempt 3 of 3)"


@every_with_workers
def test_workers_that_are_stopped_write_their_checkpoint_and_end(name, executor_of, campaign):
    made = campaign(ENDLESS)
    (label,) = made.planned
    executor = executor_of(name, 1)
    executor.submit(RunJob(made.path, label, 1))
    until(lambda: n_generations(made, label) > 0)
    executor.stop()
    assert workers(made.path) == {}
    run = run_of(made, label)
    assert run.status == "interrupted"
    done = len(run.generations())
    executor = make_executor("processes", 1)
    executor.submit(RunJob(made.path, label, 1))
    until(lambda: n_generations(made, label) > done)
    executor.stop()
    assert run.provenance["sessions"][1]["from_generation"] in (done - 1, done)  # records go first


def test_workers_stop_even_where_interrupts_are_ignored(campaign):
    """As in a job that a shell runs in the background."""
    made = campaign(ENDLESS)
    (label,) = made.planned
    executor = make_executor("processes", 1)
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        executor.submit(RunJob(made.path, label, 1))
    finally:
        signal.signal(signal.SIGINT, before)
    until(lambda: n_generations(made, label) > 0)
    stopping = threading.Thread(target=executor.stop)
    stopping.start()
    stopping.join(timeout=20)
    left = workers(made.path)
    for process in left:
        os.kill(process, signal.SIGKILL)
    stopping.join()
    assert left == {}


@every_executor
def test_a_killed_coordinator_loses_nothing_and_nothing_is_run_twice(name, campaign, undisturbed):
    made = campaign(LONG, seeds=2)
    first, second = made.planned
    coordinator = coordinate(made, name)
    until(lambda: n_generations(made, second) > 2)
    coordinator.kill()
    coordinator.wait()
    # Ray may hand the run to another worker before it notices.
    until(lambda: not workers(made.path) and run_of(made, second).status != "running")
    assert not made.is_running
    states = [one.state for one in made.standings().values()]
    # Ray notices after a while, so a run may end meanwhile.
    assert states in [["finished", "pending"], *([["finished"] * 2] if name == "ray" else [])]
    made.carry_on(make_executor(name, 1))
    sessions = [run_of(made, label).provenance["sessions"] for label in (first, second)]
    assert [len(some) for some in sessions] == [1, 1 + states.count("pending")]
    assert all(one["from_generation"] >= 2 for one in sessions[1][1:])
    assert_finished(made, undisturbed)


@every_executor
def test_after_ctrl_c_all_write_their_checkpoints_and_end(name, campaign):
    made = campaign(ENDLESS)
    (label,) = made.planned
    coordinator = coordinate(made, name)
    until(lambda: n_generations(made, label) > 2)
    os.killpg(coordinator.pid, signal.SIGINT)  # as a terminal does: to the whole group
    assert "KeyboardInterrupt" in coordinator.communicate(timeout=90)[1]
    assert workers(made.path) == {}
    run = run_of(made, label)
    assert run.status == "interrupted"
    assert [one.state for one in made.standings().values()] == ["pending"]
    done = len(run.generations())
    executor = make_executor("processes", 1)
    executor.submit(RunJob(made.path, label, 1))
    until(lambda: n_generations(made, label) > done)
    executor.stop()
    assert run.provenance["sessions"][1]["from_generation"] in (done - 1, done)  # records go first


@every_with_workers
def test_libraries_in_a_worker_start_no_threads(name, executor_of, campaign, monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)  # the tests' own
    made = campaign(ENDLESS)
    (label,) = made.planned
    executor = executor_of(name, 1)
    executor.submit(RunJob(made.path, label, 1))
    try:
        until(lambda: n_generations(made, label) > 0)
        (worker,) = workers(made.path)
        variables = Path(f"/proc/{worker}/environ").read_text().split("\0")
        begun = time.monotonic(), _core_seconds(worker)
        until(lambda: time.monotonic() > begun[0] + 1)
        spent = _core_seconds(worker) - begun[1]
        assert spent < 1.2 * (time.monotonic() - begun[0])
    finally:
        executor.stop()
    assert {f"{library}_NUM_THREADS=1" for library in ("OMP", "OPENBLAS", "MKL")} <= set(variables)


def _core_seconds(process):
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
