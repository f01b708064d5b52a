"""Recording the team of a run: which team, which scenario, and refusals."""

import numpy as np
import pytest

import conevo
from conevo.errors import UsageError
from conevo.replay.recording import record
from conevo.rng import fold
from conevo.runs.lab import Lab

SMALL = {"run.generations": 4, "world.iterations": 60, "run.n_tests": 2}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def run(folder):
    return evolved(folder / "cone", "rover/complex-1", "cone")


def evolved(path, task, method, **more):
    settings = SMALL | more
    return conevo.evolve(task, method, "smoke", seed=2, out=path, overrides=settings, threads=1)


def test_the_champion_repeats_its_testing_phase(run):
    """Epoch k is the k-th scenario of the run's own test, and the numbers are the same."""
    tested = run.test_result["champion"]["performance"]
    for k in range(2):
        found = record(run, epoch=k, threads=1)
        about = found.about
        assert about["scenario"] == fold(2, "test", k)
        assert about["generation"] == run.champion.generation
        assert (about["task"], about["method"], about["seed"]) == ("rover-v2/complex-1", "cone", 2)
        for name, value in about["performance"].items():
            assert value == tested[name]["values"][k]


def test_recording_changes_nothing(run):
    before = {p: p.stat().st_mtime_ns for p in run.path.rglob("*")}
    first, again = record(run, threads=1), record(run, threads=2)
    assert {p: p.stat().st_mtime_ns for p in run.path.rglob("*")} == before
    assert first.to_bytes() == again.to_bytes()


def test_a_stored_generation_is_recorded(run):
    found = record(run, generation=0, threads=1)
    assert found.about["generation"] == 0
    tested = run.test_result["generation_0"]["performance"]
    assert found.about["performance"]["value"] == tested["value"]["values"][0]


def test_a_generation_that_was_not_stored_is_evolved_again(run, folder):
    kept = {g: run.team(g) for g in range(4)}
    for generation in (1, 3):
        (run.path / "teams" / f"generation-{generation:04d}.npz").rename(
            folder / f"kept-{generation}.npz"
        )
    progress = []
    try:
        lab = Lab.equip(run.config, 1, "cpu")
        for generation in (1, 3):
            assert run.team(generation) is None
            found = run.team_again(generation, lab, lambda *at: progress.append(at))
            assert found.genes.tobytes() == kept[generation].genes.tobytes()
            assert np.array_equal(found.fitness, kept[generation].fitness)
    finally:
        for generation in (1, 3):
            (folder / f"kept-{generation}.npz").rename(
                run.path / "teams" / f"generation-{generation:04d}.npz"
            )
    assert progress == [(1, 2), (2, 2), (1, 4), (2, 4), (3, 4), (4, 4)]


def test_a_different_log_is_noticed(folder):
    changed = evolved(folder / "changed", "rover/complex-1", "hetcne")
    lost = next(g for g in range(4) if g != changed.champion.generation)
    (changed.path / "teams" / f"generation-{lost:04d}.npz").unlink()
    log = changed.path / "generations.jsonl"
    lines = log.read_text().splitlines()
    lines[0] = lines[0].replace('"team_fitness": ', '"team_fitness": 1')
    log.write_text("\n".join(lines) + "\n")
    with pytest.raises(UsageError, match="evolves differently from its log"):
        record(changed, generation=lost, threads=1)


def test_a_missing_generation_is_refused(run):
    with pytest.raises(UsageError, match=r"no generation 4 \(it has 0 to 3\)"):
        record(run, generation=4)


def test_two_teams_meet_the_same_scenario(run, folder):
    other = evolved(folder / "homcne", "rover/complex-1", "homcne")
    first = record(run, epoch=1, threads=1)
    second = record(other, like=first, threads=1)
    assert second.about["scenario"] == first.about["scenario"]
    assert second.about["method"] == "homcne"
    for name in first.channels:
        if name.startswith("scene/"):
            assert np.array_equal(first.channels[name].values, second.channels[name].values)
    assert not np.array_equal(first.channels["x"].values, second.channels["x"].values)


@pytest.mark.parametrize(
    ("task", "more", "reason"),
    [
        ("rover/complex-2", {}, "rover-v2/complex-1 of"),
        ("pursuit/team-3", {}, "rover-v2/complex-1 of"),
        ("rover/complex-1", {"world.energy": 500.0}, r"world\.energy is 1000\.0 \(here 500\.0\)"),
    ],
)
def test_another_task_cannot_be_played(run, folder, task, more, reason):
    path = folder / f"{task.replace('/', '-')}{len(more)}"
    other = evolved(path, task, "homcne", **more)
    with pytest.raises(UsageError, match=reason):
        record(other, like=record(run, threads=1), threads=1)
