"""A run's directory: one writer, whole lines only, nothing overwritten, every refusal one line."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.errors import EnvironmentFailure, UsageError
from conevo.evolution.methods.cone import ConeState
from conevo.runs.champions import Finalists
from conevo.runs.checkpoint import save
from conevo.runs.config import resolve
from conevo.runs.lab import Lab
from conevo.runs.provenance import describe_machine
from conevo.runs.store import Store, create
from runs.tiny import command, evolve_tiny, spawn, wait_for
from watch.followed import record

HOLD = """
import fcntl, os, sys
handle = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)
fcntl.flock(handle, fcntl.LOCK_EX)
os.write(handle, b"process 4711")
print("held", flush=True)
sys.stdin.read()
"""


def fresh_store(path: Path) -> Store:
    config = resolve("rover/complex-1", preset="smoke")
    texts = ("preset", "command", "kernel_hash", "created")
    about = dict.fromkeys(texts, "") | describe_machine("cpu")
    return create(path, config, about | {"run_id": config.run_id, "sessions": []})


def test_a_new_directory_contains_the_resolved_configuration(tmp_path: Path) -> None:
    store = fresh_store(tmp_path / "deep" / "run")
    assert store.read_config() == resolve("rover/complex-1", preset="smoke")
    assert store.read_generations() == []
    assert [p.name for p in (tmp_path / "deep").iterdir()] == ["run"]


def test_an_empty_directory_may_be_used(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    assert fresh_store(tmp_path / "run").read_generations() == []


def test_a_directory_with_other_things_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("precious")
    with pytest.raises(UsageError, match="already exists and is not a run"):
        fresh_store(tmp_path)
    with pytest.raises(UsageError, match="already exists and is not a run"):
        fresh_store(tmp_path / "thesis.txt")
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.txt"]


def test_an_unfinished_run_is_not_started_again(tmp_path: Path) -> None:
    path = tmp_path / "run"
    fresh_store(path)
    with pytest.raises(UsageError, match=f"unfinished: continue it with 'conevo resume {path}'"):
        fresh_store(path)


def test_a_finished_run_is_not_started_again(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    before = {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()}
    with pytest.raises(UsageError, match=f"finished: see it with 'conevo show {run.path}'"):
        evolve_tiny(run.path)
    assert {p: p.read_bytes() for p in run.path.rglob("*") if p.is_file()} == before


def test_a_second_process_is_kept_out(tmp_path: Path) -> None:
    store = fresh_store(tmp_path / "run")
    arguments = [sys.executable, "-c", HOLD, str(store.path / "lock")]
    with subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        assert store.is_in_use
        with pytest.raises(UsageError, match="is in use by process 4711"), store.locked():
            pass
        with pytest.raises(UsageError, match="already holds a run, in use by process 4711"):
            fresh_store(store.path)
        holder.communicate()
    assert not store.is_in_use
    with store.locked():
        assert store.is_in_use
    assert not store.is_in_use


def test_readers_do_not_disturb_a_working_process(tmp_path: Path) -> None:
    path = tmp_path / "run"
    process = spawn(*command(path, "cone", run__generations=150), "--quiet")
    wait_for(lambda: (path / "lock").exists())
    seen, statuses = [], set()
    while process.poll() is None:
        run = conevo.Run(path)
        statuses.add(run.status)
        seen.append(len(run.generations()))
    assert process.wait() == 0, process.communicate()
    assert seen == sorted(seen)
    assert len(set(seen)) > 3
    assert "running" in statuses
    assert conevo.Run(path).status == "finished"


def test_a_torn_last_line_does_not_count(tmp_path: Path) -> None:
    store = fresh_store(tmp_path / "run")
    for generation in range(3):
        store.append(record(generation))
    file = store.path / "generations.jsonl"
    for length in (*range(1, 18), 100, 380):
        whole = file.read_bytes()
        file.write_bytes(whole + json.dumps(record(3))[:length].encode())
        assert [r["generation"] for r in store.read_generations()] == [0, 1, 2]
        assert [r["generation"] for r in store.cut_generations(2)] == [0, 1]
        store.append(record(2))
        assert file.read_bytes() == whole


def test_a_damaged_line_in_the_middle_is_named(tmp_path: Path) -> None:
    store = fresh_store(tmp_path / "run")
    first = json.dumps(record(0))
    for second, words in (
        ('{"gen', "Unterminated string"),
        (json.dumps(record(2)), "generation 1 expected"),
        (json.dumps(record(1, seconds="2")), "seconds = '2': must be a valid number"),
        (json.dumps(record(1)).replace("n_hidden", "n_hiddem"), "n_hidden is missing"),
        ("[" * 50_000, "nested too deeply"),
    ):
        (store.path / "generations.jsonl").write_text(f"{first}\n{second}\n{first}\n")
        with pytest.raises(
            UsageError, match=rf"generations\.jsonl is damaged in line 2: .*{words}"
        ):
            store.read_generations()


def test_a_damaged_log_is_not_cut(tmp_path: Path) -> None:
    store = fresh_store(tmp_path / "run")
    content = json.dumps(record(0)) + "\nwhat?\n" + json.dumps(record(2)) + "\n"
    (store.path / "generations.jsonl").write_text(content)
    with pytest.raises(UsageError, match="damaged in line 2"):
        store.cut_generations(2)
    assert (store.path / "generations.jsonl").read_text() == content
    assert [one["generation"] for one in store.cut_generations(1)] == [0]  # the rest is repeated


def test_a_log_shorter_than_the_checkpoint_is_refused(tmp_path: Path) -> None:
    store = fresh_store(tmp_path / "run")
    store.append(record(0))
    with pytest.raises(UsageError, match="has 1 generation, the checkpoint is at 2"):
        store.cut_generations(2)


def test_the_seal_names_files_that_were_changed(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "run")
    assert run.changed_files == []
    sealed = json.loads((run.path / "DONE").read_text())["files"]
    there = {p.relative_to(run.path).as_posix() for p in run.path.rglob("*") if p.is_file()}
    assert set(sealed) == there - {"DONE", "lock"}
    (run.path / "test.json").write_text("{}")
    (run.path / "champion.npz").unlink()
    assert run.changed_files == ["champion.npz", "test.json"]


@pytest.mark.parametrize(
    ("key", "value"),
    [("favourites", ["low"]), ("favourite_shares", [0.5] * 21), ("favourite_shares", None)],
)
def test_every_tested_robot_has_a_favourite_and_its_share(
    key: str, value: Any, tmp_path: Path
) -> None:
    run = evolve_tiny(tmp_path / "run")
    found = json.loads((run.path / "test.json").read_text())
    found["champion"].pop(key)
    found["champion"] |= {key: value} if value else {}
    (run.path / "test.json").write_text(json.dumps(found))
    with pytest.raises(UsageError, match="champion has a different number of favourites, or of th"):
        _ = conevo.Run(run.path).test_result


def test_a_place_that_cannot_be_written_is_an_environment_failure(tmp_path: Path) -> None:
    with pytest.raises(EnvironmentFailure) as caught:
        fresh_store(Path("/proc/run"))
    assert caught.value.exit_code == 3
    assert "cannot write /proc/run: " in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("out", ["file/run", "/dev/null/run"])
def test_a_place_inside_a_file_is_a_wrong_request(out: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError) as caught:
        fresh_store(tmp_path / out)
    assert caught.value.exit_code == 2
    assert str(caught.value) == f"{(tmp_path / out).parent} is a file, not a directory"
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_other_folders_than_runs_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="is not a run"):
        conevo.Run(tmp_path)


def test_teams_and_states_of_other_shapes_are_refused_even_in_intact_files(
    tmp_path: Path,
) -> None:
    run = evolve_tiny(tmp_path / "run", run__generations=2)
    store = Store(run.path)
    team = store.load_champion()
    assert team is not None
    wide = team.active[..., None]
    for name, other, words in (
        ("champion.npz", replace(team, active=wide), r"genes of shape .* in slots of shape"),
        ("champion.npz", replace(team, fitness=team.fitness[:1]), "not of 3 robots"),
        ("champion.npz", replace(team, genes=team.genes.astype(np.float64)), "of another type"),
        ("champion.npz", replace(team, genes=team.genes + 3), r"genes outside \[-1, 1\]"),
        ("champion.npz", replace(team, generation="1"), "generation is '1'"),
        ("champion.npz", replace(team, active=3), "active is 3"),
        ("finalists.npz", replace(Finalists.of([team]), active=wide[:0]), "not every array has 1"),
        ("finalists.npz", replace(Finalists.of([team]), generation=np.zeros(0, np.int64)), "shape"),
    ):
        path = run.path / name
        whole = path.read_bytes()
        save(path, other, store._identity())
        with pytest.raises(UsageError, match=rf"{name} is damaged: .*{words}") as caught:
            store.load_champion() if name == "champion.npz" else store.load_finalists()
        assert "\n" not in str(caught.value)
        path.write_bytes(whole)
    small = replace(team, genes=team.genes[:2], active=team.active[:2])
    small = replace(small, fitness=team.fitness[:2], specialization=team.specialization[:2])
    store.save_champion(small)
    with pytest.raises(UsageError, match=r"a team of \(2, 4, \d+\) robots, neurons and genes"):
        conevo.Run(run.path).test(1, threads=1)
    blank = Lab.equip(run.config, 1, "cpu").blank_state()
    state, _ = store.load_checkpoint("cone", blank)
    assert isinstance(state, ConeState)
    header = state.progress
    (run.path / "DONE").unlink()
    for changes, name in (
        ({"genes": state.genes[:, :, :2]}, "genes"),
        ({"active": state.active[..., None]}, "active"),
        ({"past_fitness": state.past_fitness.astype(np.float32)}, "past_fitness"),
        ({"progress": replace(header, root=7)}, "root"),
        ({"progress": replace(header, team_evaluations=-1)}, "team_evaluations"),
        ({"progress": replace(header, n_hidden=header.n_hidden[:2])}, "n_hidden"),
        ({"progress": replace(header, fittest_genes=header.fittest_genes + 3)}, "fittest_genes"),
        ({"progress": replace(header, fittest_fitness=np.zeros(7))}, "fittest_fitness"),
        ({"genes": state.genes + 3}, "genes"),
        ({"phase": "elites"}, "phase"),
        ({"elite": state.elite + 100}, "elite"),
    ):
        for file in run.path.glob("checkpoint-?.npz"):
            save(file, replace(state, **changes), store._identity() | {"method": "cone"})
        with pytest.raises(UsageError, match=f"{name} of its checkpoint") as caught:
            conevo.Run(run.path).resume(threads=1)
        assert "\n" not in str(caught.value)
