"""Campaigns on GPUs, which this machine need not have: requested devices, and refused ones."""

import json
import subprocess
import sys
from types import SimpleNamespace

import pytest

import conevo
from campaigns.plans import tiny_campaign
from conevo.campaigns import devices, slurm, worker
from conevo.campaigns.devices import devices_here, next_device, parse_devices
from conevo.campaigns.executors.local import worker_command
from conevo.campaigns.executors.protocol import Ending, RunJob
from conevo.campaigns.executors.registry import make_executor
from conevo.cli.campaign_run import ready
from conevo.cli.main import main
from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs.time_limit import TimeLimit


@pytest.fixture
def campaign(tmp_path):
    return tiny_campaign(tmp_path / "campaigns")


class Recorder:
    """An executor that only notes its jobs; ``finish`` ends the oldest one."""

    name = "recorder"

    def __init__(self, cores):
        self.cores, self.jobs, self.running = cores, [], []

    def submit(self, job):
        self.jobs.append(job)
        self.running.append(job)

    def wait(self, seconds):
        return [Ending(self.running.pop(0).label, "killed by signal 9")]

    def stop(self):
        self.running.clear()


@pytest.mark.parametrize(
    ("text", "expected"),
    [("cpu", ("cpu",)), ("cuda", ("cuda",)), ("cuda:1", ("cuda:1",)),
     ("cuda:0, cuda:3", ("cuda:0", "cuda:3")), ("auto", ("auto",))],
)  # fmt: skip
def test_devices_are_named_as_warp_does(text, expected):
    assert parse_devices(text) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' is not a device"),
        ("gpu", "'gpu' is not a device; allowed: auto, cpu, cuda, cuda:0, or several"),
        ("cuda:0,", "'' is not a device"),
        ("cuda:0;reboot", "is not a device"),
        ("cuda:1,cuda:1", "a device is listed twice"),
        ("cpu,cuda:0", "several devices are written cuda:0,cuda:1"),
        ("cuda,cuda:0", "several devices are written cuda:0,cuda:1"),
        ("auto,cuda:0", "several devices are written cuda:0,cuda:1"),
    ],
)
def test_other_names_than_those_of_devices_are_refused(text, message):
    with pytest.raises(UsageError, match=message):
        parse_devices(text)


def test_workers_use_devices_in_turn():
    assert next_device(["cuda:0", "cuda:1"], []) == "cuda:0"
    assert next_device(["cuda:0", "cuda:1"], ["cuda:0"]) == "cuda:1"
    assert next_device(["cuda:0", "cuda:1"], ["cuda:1", "cuda:0", "cuda:1"]) == "cuda:0"
    assert next_device([], [None, None]) is None


def test_every_worker_slot_has_a_device(campaign):
    executor = Recorder(4)
    campaign.carry_on(executor, devices=("cuda:0", "cuda:1"))
    first = [job.device for job in executor.jobs[:4]]
    assert first == ["cuda:0", "cuda:1", "cuda:0", "cuda:1"]
    # The successor of a worker that has ended takes its device.
    assert executor.jobs[4].device == "cuda:0"


def test_the_device_reaches_the_run_that_is_started(campaign, monkeypatch):
    label = next(iter(campaign.planned))
    job = RunJob(campaign.path, label, 1, "cuda:1")
    assert worker_command(job)[-4:] == [str(campaign.path.resolve()), label, "1", "cuda:1"]
    asked = []
    monkeypatch.setattr(worker, "start", lambda *_, **more: asked.append(more["device"]))
    monkeypatch.setattr(sys, "argv", ["worker", *worker_command(job)[-4:]])
    monkeypatch.setattr(worker.os, "_exit", lambda code: asked.append(code))
    monkeypatch.setattr(worker.signal, "signal", lambda *_: None)
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True, raising=False)
    worker.main()
    assert asked == ["cuda:1", 1]  # nothing was started, so nothing is finished
    monkeypatch.setattr(
        sys, "argv", ["worker", *worker_command(RunJob(campaign.path, label, 1))[-3:]]
    )
    worker.main()
    assert asked[2:] == ["cpu", 1]  # if none is named


def test_a_missing_device_ends_a_campaign_before_a_run_is_started(campaign, capsys):
    for executor in ("serial", "processes"):
        with pytest.raises(SystemExit) as ended:
            main(["campaign", "start", str(campaign.path), "--executor", executor,
                  "--device", "cuda:7"])  # fmt: skip
        assert ended.value.code == 3
        output = capsys.readouterr()
        assert output.out == ""
        assert output.err.startswith("conevo: error: device 'cuda:7': ")
        assert output.err.count("\n") == 1
    assert not (campaign.path / "runs").exists()
    assert not (campaign.path / "ledger.sqlite").exists()


def test_devices_of_this_machine_are_accepted(two_cards):
    assert make_executor("processes", 2, devices=("cuda:0", "cuda:1")).cores == 2
    with pytest.raises(EnvironmentFailure, match="'cuda:2': allowed here: cpu, cuda:0, cuda:1"):
        make_executor("processes", 2, devices=("cuda:2",))


def test_auto_is_every_card_or_the_cpu(two_cards, monkeypatch):
    assert devices_here(("auto",)) == ("cuda:0", "cuda:1")
    asked = {"executor": "processes", "cores": 2, "threads": 1, "address": None, "store": None}
    asked |= {"limit": TimeLimit(None), "as_json": False, "quiet": True}
    assert ready(**asked, device="auto").devices == ("cuda:0", "cuda:1")
    monkeypatch.setattr("warp.get_cuda_devices", list)
    assert ready(**asked, device="auto").devices == ("cpu",)
    assert ready(**asked, device=None).devices == ()


def test_a_run_continues_on_its_device_or_the_cpu_or_the_named_device(campaign, caplog):
    label, other = list(campaign.planned)[:2]
    path = campaign.paths.run(label)
    run = worker.start(campaign.planned[label].configs()[0], path, threads=1)
    about = json.loads((path / "provenance.json").read_text())
    (path / "provenance.json").write_text(json.dumps(about | {"device": "cuda:7"}))
    assert not worker.carry_out(campaign.path, label, 1, device="cuda:7")
    ended = json.loads(campaign.paths.ended(label).read_text())
    assert ended["origin"] == "machine"
    assert ended["message"].startswith("device 'cuda:7': ")
    assert worker.carry_out(campaign.path, label, 1)
    assert run.status == "finished"
    assert [session["device"] for session in run.provenance["sessions"]] == ["cpu"]
    assert worker.carry_out(campaign.path, other, 1, device="auto")
    about = json.loads((campaign.paths.run(other) / "provenance.json").read_text())
    assert about["device"] == about["sessions"][0]["device"] == devices_here(("auto",))[0]


def test_an_interrupted_campaign_on_cards_shows_how_to_continue_there(
    two_cards, campaign, monkeypatch, capsys
):
    def interrupted(*_, **how):
        assert how["devices"] == ("cuda:0", "cuda:1")
        raise KeyboardInterrupt

    monkeypatch.setattr("conevo.campaigns.campaign.Campaign.carry_on", interrupted)
    with pytest.raises(SystemExit) as ended:
        main(["campaign", "start", str(campaign.path), "--device", "auto"])
    assert ended.value.code == 130
    assert capsys.readouterr().err.endswith(
        f"continue with: conevo campaign start {campaign.path} --device cuda:0,cuda:1\n"
    )


# --- clusters -------------------------------------------------------------------------------------


def test_a_slurm_task_has_its_device_and_looks_for_it_first(campaign, tmp_path):
    labels = list(campaign.planned)
    assert "cuda" not in slurm.write_array(campaign.path, labels).read_text()
    script = slurm.write_array(campaign.path, labels, device="cuda:7")
    environment = {"SLURM_ARRAY_TASK_ID": "0", "SLURM_CPUS_PER_TASK": "1", "PATH": "/usr/bin:/bin"}
    pythonpath = {"PYTHONPATH": ":".join(sys.path)}
    done = subprocess.run(["bash", str(script)], env=environment | pythonpath, check=False)
    assert done.returncode == 3
    output = (campaign.path / "logs" / "slurm-0.txt").read_text()
    assert "device 'cuda:7': " in output
    assert output.count("\n") == 1
    assert not (campaign.path / "runs").exists()
    text = script.read_text()
    assert '"$SLURM_CPUS_PER_TASK" cuda:7 \\\n' in text
    text = slurm.write_array(campaign.path, labels, device="auto").read_text()
    assert '"$SLURM_CPUS_PER_TASK" auto \\\n' in text
    assert "campaigns.devices" not in text  # it exists on every node
    with pytest.raises(UsageError, match="a task of the array has one device"):
        slurm.write_array(campaign.path, labels, device="cuda:0,cuda:1")


@pytest.mark.parametrize(
    ("options", "advice"),
    [([], True), (["--gres", "gpu:1"], False), (["--sbatch", "--gpus-per-task=1"], False)],
)
def test_a_slurm_array_on_gpus_that_requests_none_is_noted(campaign, capsys, options, advice):
    with pytest.raises(SystemExit) as ended:
        main(["campaign", "slurm", str(campaign.path), "--device", "cuda", *options])
    assert ended.value.code == 0
    assert ("add --gres gpu:1" in capsys.readouterr().err) == advice


class FakeRay:
    """The part of Ray that an executor uses, on a cluster with that number of GPUs."""

    def __init__(self, gpus):
        self.gpus, self.asked = gpus, []

    def init(self, address, **options):
        pass

    def shutdown(self):
        pass

    def nodes(self):
        return [{"Alive": True, "Resources": {"CPU": 4.0, "GPU": self.gpus}}]

    def cluster_resources(self):
        return {"CPU": 4.0} | ({"GPU": self.gpus} if self.gpus else {})

    def remote(self, **resources):
        def task(_):
            return SimpleNamespace(remote=lambda *words: self.asked.append((resources, words)))

        return task


@pytest.fixture
def ray_with(monkeypatch):
    """Return a function that replaces Ray by a cluster with a given number of GPUs."""

    def make(gpus):
        fake = FakeRay(gpus)
        monkeypatch.setattr("conevo.campaigns.executors.ray.import_module", lambda _: fake)
        return fake

    return make


def test_a_ray_task_requests_a_gpu_if_its_device_is_one(campaign, ray_with):
    label = next(iter(campaign.planned))
    fake = ray_with(2)
    executor = make_executor("ray", 4, devices=("cuda",))
    executor.submit(RunJob(campaign.path, label, 1, "cuda"))
    executor.submit(RunJob(campaign.path, label, 1))
    (on_gpu, words), (on_cpu, others) = fake.asked
    assert (on_gpu["num_gpus"], on_gpu["num_cpus"], words[-1]) == (1, 1, "cuda")
    assert ("num_gpus" in on_cpu, others[-1]) == (False, None)


@pytest.mark.parametrize(("gpus", "asked"), [(2, 1), (0, None)])
def test_auto_is_a_gpu_per_task_if_ray_has_any(campaign, ray_with, gpus, asked):
    label = next(iter(campaign.planned))
    fake = ray_with(gpus)
    make_executor("ray", 4, devices=("auto",)).submit(RunJob(campaign.path, label, 1, "auto"))
    ((resources, words),) = fake.asked
    assert (resources.get("num_gpus"), words[-1]) == (asked, "auto")


def test_a_ray_cluster_without_gpus_or_with_numbered_ones_is_refused(ray_with):
    ray_with(0)
    with pytest.raises(EnvironmentFailure, match="no node has a GPU, for --device cuda"):
        make_executor("ray", 4, devices=("cuda",))
    assert make_executor("ray", 4).cores == 4
    with pytest.raises(UsageError, match="with the executor ray it is auto, cpu or cuda"):
        make_executor("ray", 4, devices=("cuda:0", "cuda:1"))


def test_the_check_of_a_node_is_quiet_if_all_is_well(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["devices", "cpu"])
    devices.main()
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("device", "code", "words"),
    [("gpu", 2, "'gpu' is not a device; allowed: auto, cpu, cuda, cuda:N"),
     ("cuda:", 2, "allowed: auto, cpu"),
     ("cuda:7", 3, "device 'cuda:7': ")],
)  # fmt: skip
def test_a_name_of_no_device_is_a_wrong_request(device, code, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as caught:
        main(["run", "rover/complex-1", "--preset", "smoke", "--device", device])
    assert caught.value.code == code
    assert words in capsys.readouterr().err
    with pytest.raises(UsageError if code == 2 else EnvironmentFailure, match=words):
        conevo.Rollout(conevo.world("rover/complex-1"), device=device)
    assert not any(tmp_path.iterdir())
