"""Contracts of Ray alone: lost nodes and workers, clusters by address, results through a store."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import conevo
from campaigns.plans import tiny_campaign
from campaigns.processes import n_generations, until, workers
from conevo.campaigns.executors.protocol import RunJob
from conevo.campaigns.executors.ray import RayCluster
from conevo.campaigns.executors.registry import make_executor
from conevo.errors import EnvironmentFailure
from conevo.runs.start import start

pytest.importorskip("ray")
pytestmark = pytest.mark.slow
LONG = """[[where]]
method = "homcne"
settings = { "run.generations" = 30, "method.genotypes" = 40, "world.iterations" = 400 }"""


def parent(process):
    """Return the process number of a process' parent, 0 if it has ended."""
    try:
        return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0


@pytest.fixture
def long_run(tmp_path):
    """A campaign and its first run, which takes some seconds."""
    campaign = tiny_campaign(tmp_path, more=LONG, seeds=1)
    return campaign, next(iter(campaign.planned))


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Return the outcome of the first run if it is not disturbed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    planned = next(iter(tiny_campaign(folder, more=LONG, seeds=1).planned.values()))
    return outcome(start(planned.configs()[0], folder / "run", threads=1).resume())


def outcome(run):
    rows = [{k: v for k, v in row.items() if k != "seconds"} for row in run.generations()]
    return rows, run.champion.genes.tobytes(), run.test_result


def assert_it_starts_no_usage_reports_and_no_dashboard():
    """Look at the processes of the Ray that this process has started."""
    mine = [one for one in Path("/proc").glob("[0-9]*") if parent(one.name) == os.getpid()]
    texts = {one: (one / "cmdline").read_text() for one in mine}
    ray = [one for one in mine if "gcs_server" in texts[one] or "dashboard.py" in texts[one]]
    assert ray
    for one in ray:
        assert "RAY_USAGE_STATS_ENABLED=0" in (one / "environ").read_text().split("\0")
        assert "dashboard.py" not in texts[one] or "--disable-frontend" in texts[one]


def end_of(executor):
    """Wait for one ending."""
    return until(lambda: executor.wait(0.1))


def test_ray_itself_continues_a_run_whose_ray_worker_was_killed(long_run, undisturbed):
    campaign, label = long_run
    executor = make_executor("ray", 1)
    try:
        assert_it_starts_no_usage_reports_and_no_dashboard()
        executor.submit(RunJob(campaign.path, label, 1))
        until(lambda: n_generations(campaign, label) > 2)
        (worker,) = workers(campaign.path)
        os.kill(parent(worker), signal.SIGKILL)
        until(lambda: worker not in workers(campaign.path))  # it ends when its parent has ended
        (ending,) = end_of(executor)
    finally:
        executor.stop()
    assert (ending.label, ending.lost) == (label, "")
    run = conevo.Run(campaign.paths.run(label))
    assert run.provenance["sessions"][1]["from_generation"] >= 2
    assert outcome(run) == undisturbed


def test_results_come_through_an_object_store_where_nodes_do_not_see_the_campaign(
    long_run, undisturbed, monkeypatch, bucket
):
    campaign, label = long_run
    scratch = Path(tempfile.mkdtemp())  # short, since Ray makes sockets below it
    monkeypatch.setenv("TMPDIR", str(scratch))  # of the workers
    executor = RayCluster(1, store=bucket)
    executor.submit(RunJob(campaign.path, label, 1))
    (folder,) = until(lambda: list(scratch.glob("conevo-*")))
    made = folder / "runs" / label / "generations.jsonl"
    until(lambda: made.is_file() and made.read_bytes().count(b"\n") > 2)
    assert not campaign.paths.run(label).exists()
    executor.stop()
    done = n_generations(campaign, label)
    assert 2 < done < 30
    standings = campaign.carry_on(RayCluster(2, store=bucket))
    assert {one.state for one in standings.values()} == {"finished"}
    assert list(scratch.glob("conevo-*")) == []
    run = conevo.Run(campaign.paths.run(label))
    assert run.changed_files == []
    assert run.provenance["sessions"][1]["from_generation"] in (done - 1, done)  # records go first
    assert outcome(run) == undisturbed
    shutil.rmtree(scratch)
    for label in campaign.planned:
        assert campaign.paths.log(label).is_file()
        assert campaign.paths.ended(label).is_file()


def test_a_cluster_by_address_has_the_cores_of_its_nodes_and_survives_the_loss_of_one(
    long_run, undisturbed
):
    from ray.cluster_utils import Cluster

    campaign, label = long_run
    least = {"object_store_memory": 80 * 2**20}
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, **least})
    try:
        with pytest.raises(EnvironmentFailure, match="no node has CPU cores"):
            make_executor("ray", address=cluster.address)
        node = cluster.add_node(num_cpus=1, **least)
        other = cluster.add_node(num_cpus=1, **least)
        executor = make_executor("ray", address=cluster.address)
        assert executor.cores == 2
        executor.submit(RunJob(campaign.path, label, 2))  # as the last one of a campaign
        until(lambda: n_generations(campaign, label) > 2)
        (worker,) = workers(campaign.path)
        raylet = parent(parent(worker))
        lost = next(n for n in (node, other) if n.all_processes["raylet"][0].process.pid == raylet)
        cluster.remove_node(lost, allow_graceful=False)
        (ending,) = end_of(executor)
        executor.stop()
    finally:
        cluster.shutdown()
    assert ending.lost == ""
    run = conevo.Run(campaign.paths.run(label))
    assert [one["threads"] for one in run.provenance["sessions"]] == [1, 1]
    assert outcome(run) == undisturbed


def test_no_cluster_at_an_address_is_one_clear_line(monkeypatch):
    """Ray's own message, made up here: the cluster of another test may be running."""
    import ray

    def init(address, **_):
        raise ConnectionError(f"Could not find any running Ray instance at {address}.\nMore.")

    monkeypatch.setattr(ray, "init", init)
    with pytest.raises(EnvironmentFailure, match=r"Ray at auto: .*Could not find any running"):
        make_executor("ray", address="auto")


def test_a_node_that_does_not_start_in_time_is_one_clear_line(monkeypatch):
    import ray

    def init(*_, **options):
        raise Exception("The current node timed out during startup.\nMore.")

    monkeypatch.setattr(ray, "init", init)
    with pytest.raises(EnvironmentFailure, match=r"^Ray at this machine: .* startup\. More\.$"):
        make_executor("ray", 1)


def test_a_missing_ray_is_one_line(tmp_path):
    code = (
        "import sys; sys.modules['ray'] = None\n"
        "from conevo.campaigns.executors.registry import make_executor\n"
        "from conevo.errors import UsageError\n"
        "try:\n    make_executor('ray')\nexcept UsageError as error:\n    sys.exit(str(error))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == "executor 'ray' needs Ray: pip install 'conevo[ray]'\n"
