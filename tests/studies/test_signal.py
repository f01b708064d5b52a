"""The signal of a method: its trials, against teams played one by one, and methods without one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.evolution.assembly import place_on_trial
from conevo.rng import fold
from conevo.runs.config import RunConfig, resolve
from conevo.runs.evaluation import score
from conevo.runs.lab import Lab
from conevo.studies import signal
from conevo.studies.repeatability import repeatability, spearman_brown
from conevo.studies.signal import measure_signal
from runs.tiny import TASK, evolve_tiny, tiny_settings

ROOT = Path(__file__).resolve().parents[2]
TRIALS = 4
NEAR: dict[str, Any] = {"world__iterations": 100, "world__n_robots": 4} | {
    f"world__{setting}_range": 0.5 for setting in ("low", "med", "hi")
}  # so that robots meet something
UNITS = {
    "homcne": "clone team", "hetcne": "network", "ccga": "network", "mesp": "neuron",
    "cone": "neuron",
}  # fmt: skip


def say(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Return exit code, output and errors of a command."""
    with pytest.raises(SystemExit) as caught:
        main(words)
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


def tiny(method: str, **changes: Any) -> RunConfig:
    """Return the settings of a tiny run with robots that meet something."""
    settings = tiny_settings(method, **{"method__genotypes": 6, **NEAR, **changes})
    return resolve(TASK, method, "smoke", 3, overrides=settings)


def words_of(method: str) -> list[str]:
    """Return the command line that has these settings."""
    sets = tiny_settings(method, method__genotypes=6)
    return ["signal", TASK, "--method", method, "--preset", "smoke"] + [
        word for key, value in sets.items() for word in ("--set", f"{key}={value}")
    ]


def alone(config: RunConfig) -> np.ndarray:
    """Return the fitness of every trial of a method's first genotypes, played team by team."""
    lab = Lab.equip(config, 1, "cpu")
    subject = signal._subject(lab, "first", lab.first_state(), None)
    found = []
    for k in range(TRIALS):
        state, trials = subject.trial(config.run.seed, k)
        (scenario,) = [lab.world.scenarios([fold(config.run.seed, "signal scenario", k)])]
        fitness = np.concatenate(
            [
                score(lab.simulator.evaluate(trials.genes, team[None], scenario)).fitness
                for team in trials.teams
            ]
        )
        table = np.full(state.fitness.shape, np.nan)
        for team, credit in zip(trials.teams, fitness, strict=True):
            robots = range(len(team))
            if config.method == "hetcne":
                robots = [place_on_trial(state.root, 0, len(team))]
            for robot in robots:
                for row in team[robot][team[robot] >= 0]:
                    p, u, m = np.unravel_index(row, state.genes.shape[:3])
                    of_clones = credit.mean() if config.method == "homcne" else credit[robot]
                    table[(p, u, m) if table.ndim == 3 else (p, m)] = of_clones
        found.append(table)
    return np.stack(found)


@pytest.mark.parametrize("method", UNITS)
def test_trials_are_teams_played_one_by_one_each_in_its_own_scenario(method) -> None:
    config = tiny(method)
    (row,) = measure_signal(config, trials=TRIALS, threads=1)["signal"]
    fitness = alone(config)
    if fitness.ndim == 3:
        fitness = fitness[:, :, None]
    found = repeatability(fitness)
    assert np.nanstd(fitness) > 0
    assert len({one.tobytes() for one in fitness}) == TRIALS
    assert row["icc"] == pytest.approx(found.icc, rel=1e-12)
    assert row["standard_error"] == pytest.approx(found.standard_error, rel=1e-12)
    assert (row["unit"], row["generation"], row["number"]) == (UNITS[method], "first", 0)
    assert (row["genotypes"], row["of"], row["trials"], row["left_out"]) == (6, 6, TRIALS, 0)


def test_a_difference_is_measured_as_in_selection(monkeypatch) -> None:
    """Each team once more for each of four robots, in batches of trials or alone."""
    config = tiny("ccga", run__credit="difference")
    prices: list[str] = []
    whole = measure_signal(config, trials=5, threads=1, announce=prices.append)
    private = measure_signal(tiny("ccga"), trials=5, threads=1, announce=prices.append)
    (row,), (other,) = whole["signal"], private["signal"]
    assert (whole["credit"], private["credit"]) == ("difference", "robot")
    assert np.isfinite(row["icc"])
    assert row["icc"] != other["icc"]
    assert ["150 team evaluations" in price for price in prices] == [True, False]
    monkeypatch.setattr(signal, "BATCH", 1)
    assert measure_signal(config, trials=5, threads=2) == whole


@pytest.mark.parametrize("method", ["ccga", "mesp"])
def test_batches_and_threads_change_nothing(method, monkeypatch) -> None:
    whole = measure_signal(tiny(method), trials=5, threads=1)
    monkeypatch.setattr(signal, "BATCH", 7)
    assert measure_signal(tiny(method), trials=5, threads=2) == whole


def test_the_scheme_has_rounds_times_epochs_trials() -> None:
    config = tiny("ccga", run__epochs=3, method__evaluation="shared", method__rounds=4)
    (row,) = measure_signal(config, trials=TRIALS, threads=1)["signal"]
    assert row["scheme"] == 12
    assert row["icc_of_scheme"] == pytest.approx(spearman_brown(row["icc"], 12))
    assert row["high_of_scheme"] == pytest.approx(spearman_brown(min(row["high"], 1), 12))
    if row["icc"] > 0:
        assert row["rounds_for_half"] == pytest.approx((1 - row["icc"]) / row["icc"] / 3)
    elite = {"method__evaluation": "systematic", "method__partners": "elite"}
    systematic = tiny("ccga", run__epochs=3, **elite)
    (other,) = measure_signal(systematic, trials=TRIALS, threads=1)["signal"]
    assert (other["scheme"], other["icc"]) == (3, row["icc"])  # tried alike, at a third of the cost


def test_a_sample_of_genotypes_keeps_their_genes_for_every_method() -> None:
    for method in UNITS:
        config = tiny(method, method__genotypes=9)
        lab = Lab.equip(config, 1, "cpu")
        state = lab.first_state()
        sample = signal._subject(lab, "first", state, 5).state
        assert sample.genes.shape[2] == sample.fitness.shape[-1] == 5
        everyone = [genes.tobytes() for genes in state.genes.swapaxes(0, 2)]
        chosen = [everyone.index(genes.tobytes()) for genes in sample.genes.swapaxes(0, 2)]
        assert chosen == sorted(set(chosen))


@pytest.mark.parametrize(
    ("method", "teams"),
    [("hetcne", 3 * 6 + 3 * 6), ("cone", 3 * 6 + 3 * 6),
     ("ccga", 3 * 6 + 3 * 4 * 5)],  # in the end partners are an elite: a team tries one genotype
)  # fmt: skip
def test_a_run_has_the_signal_of_its_first_and_last_populations(method, teams, tmp_path) -> None:
    sizes = {"method__genotypes": 6, **NEAR}
    if method == "ccga":
        sizes["method__evaluation"] = "systematic"
    run = evolve_tiny(tmp_path / "run", method, **sizes)
    said: list[str] = []
    found = measure_signal(run, trials=3, threads=1, announce=said.append)
    first, last = found["signal"]
    assert [first["generation"], last["generation"]] == ["first", "last"]
    assert (first["number"], last["number"]) == (0, 5)
    assert first == measure_signal(run.config, trials=3, threads=1)["signal"][0]
    assert last["icc"] != first["icc"]
    assert "at first and at last, 3 trials each: " in said[0]
    assert said[0].endswith(f" {teams} team evaluations of 100 iterations")


def test_a_run_started_with_other_populations_is_measured_with_them(tmp_path) -> None:
    first = evolve_tiny(tmp_path / "first", "ccga", method__genotypes=6, **NEAR)
    settings = tiny_settings("ccga", method__genotypes=6, **NEAR)
    second = conevo.evolve(
        TASK, "ccga", "smoke", 9, tmp_path / "second", overrides=settings, origin=first, threads=1
    )
    begun = measure_signal(second, trials=3, threads=1)["signal"][0]
    assert begun["icc"] != measure_signal(second.config, trials=3, threads=1)["signal"][0]["icc"]


def test_a_fitness_that_is_always_the_same_has_no_signal(capsys) -> None:
    blind = [f"world.{setting}_range=0.0001" for setting in ("low", "med", "hi")]
    words = [word for one in blind for word in ("--set", one)]
    code, out, err = say(capsys, *words_of("ccga"), *words, "--trials", "3")
    assert (code, err) == (0, "")
    assert "No signal" in out


def test_the_command_prints_its_cost_first_and_then_the_results(capsys, tmp_path) -> None:
    words = [*words_of("cone"), "--trials", "3", "--threads", "1"]
    code, out, err = say(capsys, *words)
    assert (code, err) == (0, "")
    assert out.startswith("6 genotypes of 6 in 6 sub-populations, 3 trials each: 18 team evaluatio")
    assert "rover-v2/complex-1, CONE: fitness of a neuron" in out
    code, out, err = say(capsys, *words, "--json")
    assert code == 0
    assert err.startswith("6 genotypes of 6")
    assert json.loads(out)["signal"][0]["unit"] == "neuron"
    run = evolve_tiny(tmp_path / "run", "cone", method__genotypes=6)
    code, out, err = say(capsys, "signal", str(run.path), "--trials", "3", "--json")
    assert code == 0
    assert json.loads(out)["run"] == str(run.path)
    assert [row["number"] for row in json.loads(out)["signal"]] == [0, 5]


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["rover/complx-1"], "unknown environment 'complx-1' of world 'rover'; did you mean"),
        (["rovr/complex-1"], "unknown world 'rovr'; did you mean 'rover'?"),
        (["nowhere"], "unknown run 'nowhere' in runs/"),
        ([], "which world? Name one as WORLD/ENVIRONMENT"),
        ([TASK, "--trials", "1"], "Invalid value for '--trials': 1 is not in the range"),
        ([TASK, "--trials", "1000000"], "1000000 is not in the range 2<=x<=10000"),
        ([TASK, "--units", "1"], "Invalid value for '--units': 1 is not in the range"),
        ([TASK, "--method", "hetcne", "--units", "5"], "genotypes (5) must be at least the robots"),
        (["rover/complex-1", "--method", f"{ROOT}/examples/own_method.py:team-es"],
         "Team ES has no populations whose genotypes could be tried one by one"),
    ],
)  # fmt: skip
def test_a_wrong_request_is_one_line(words, line, capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = say(capsys, "signal", *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert line in err


def test_a_run_takes_no_settings(capsys, tmp_path) -> None:
    run = evolve_tiny(tmp_path / "run", "homcne")
    code, _, err = say(capsys, "signal", str(run.path), "--set", "run.epochs=2")
    assert (code, err.count("\n")) == (2, 1)
    assert "--set belongs to WORLD/ENVIRONMENT" in err


def test_numbers_are_refused_in_python_too() -> None:
    for numbers in ({"trials": 1}, {"trials": 10_001}, {"units": 1}):
        with pytest.raises(UsageError, match=r"= 1(0001)?: a signal takes (2 to 10,000|two)"):
            measure_signal(tiny("ccga"), **numbers)


def test_progress_counts_the_trials_of_all_populations(tmp_path) -> None:
    run, seen = evolve_tiny(tmp_path / "run", "homcne"), []
    measure_signal(run, trials=4, advance=lambda *done: seen.append(done))
    assert seen[-1] == (8, 8)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)
    assert (4, 8) in seen
