"""Sizes beyond any memory or lifetime are refused at once, and the setting is named."""

from __future__ import annotations

from pathlib import Path

import pytest

HUGE = (
    "--set genotypes=100000000",
    "--set rounds=1000000000",
    "--set epochs=1000000000",
    "--set fittest_epochs=1000000000",
    "--set n_tests=1000000000",
    "--set n_validations=1000000000",
    "--set generations=1000000000",
    "--set iterations=1000000000",
    "--set max_hidden=1000000000",
    "--set n_robots=1000000000",
    "--set stagnation_v=1000000000",
    "--set type_c_rounds=1000000000",
    "--set n_elitist=10000000000",
    "--set mutation_scale=1e308",
    "--set seed=99999999999999999999999",
    "--set seed=1e23",
    "--seed 1e23",
    "--seed 99999999999999999999999",
    "--seeds 1000000000",
    "--threads 1000000000",
    "--budget-evaluations 99999999999999999999",
)


@pytest.mark.parametrize("words", HUGE)
def test_an_extreme_number_is_one_line(words: str, say, tmp_path: Path) -> None:
    said = say("run", "rover/complex-1", "--preset", "smoke", *words.split())
    name = words.removeprefix("--set ").replace(" ", "=").partition("=")[0]
    assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert name in said.err or name[2:].replace("-", "_") in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("method", "settings", "words"),
    [
        ("cone", ("genotypes=1000000",), "method.genotypes = 1,000,000 in"),
        ("cone-es", ("pairs=1000000",), "method.pairs = 1,000,000 ask for most"),
        ("sane", ("blueprints=1000000", "epochs=10000"), "1,000,000 teams and run.epochs = 10,000"),
        ("homcne", ("genotypes=1000000", "epochs=10000"), "teams and run.epochs = 10,000 ask"),
    ],
)
@pytest.mark.parametrize("dry", [(), ("--dry-run",)])
def test_numbers_that_are_too_large_together_are_estimated_before_memory_is_taken(
    method: str, settings: tuple[str, ...], words: str, dry: tuple[str, ...], say, tmp_path: Path
) -> None:
    sets = [word for one in settings for word in ("--set", one)]
    said = say("run", "rover/complex-1", "--method", method, "--preset", "smoke", *sets, *dry)
    assert (said.code, said.out, said.err.count("\n")) == (3, "", 1)
    assert "GiB of memory and the machine has" in said.err
    assert words in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("setting", ["homcne genotypes=22000", "sane blueprints=22000"])
def test_a_population_of_clones_is_one_team_for_each_genotype(
    setting: str, say, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 8 * 2**30 // 4096}  # 8 GiB
    monkeypatch.setattr("conevo.runs.lab.os.sysconf", memory.__getitem__)
    method, values = setting.split()
    words = ("--preset", "smoke", "--dry-run", "--set", f"method.{values}")
    assert say("run", "rover/complex-1", "--method", method, *words).code == 0


PLAN = '[campaign]\nseeds = {seeds}\n[factors]\nworld = ["rover/complex-{n}"]\nmethod = ["cone"]\n'


@pytest.mark.parametrize(
    ("seeds", "n", "more", "words"),
    [
        ("1_000_000_000", "1", "", "campaign.seeds = 1000000000 in plan.toml: must be a number"),
        ("[99999999999999999999]", "1", "", "campaign.seeds = [99999999999999999999] in plan.toml"),
        ("1", "1..1000000000", "", "the numbers of a range have three digits at most"),
        ("10_000", "1..10", '"method.gst" = [0.1, 0.2]', "200,000 runs in plan.toml: a campaign"),
    ],
)
@pytest.mark.parametrize("dry", [(), ("--dry-run",)])
def test_plans_of_far_too_many_runs_are_refused(
    seeds: str, n: str, more: str, words: str, dry: tuple[str, ...], say, tmp_path: Path
) -> None:
    (tmp_path / "plan.toml").write_text(PLAN.format(seeds=seeds, n=n) + more)
    said = say("campaign", "start", "plan.toml", *dry)
    assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert words in said.err
    assert [path.name for path in tmp_path.iterdir()] == ["plan.toml"]


def test_running_out_of_memory_nevertheless_is_one_line(say, monkeypatch) -> None:
    def run_out(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("conevo.runs.config.resolve", run_out)
    said = say("run", "rover/complex-1")
    assert (said.code, said.out, said.err.count("\n")) == (3, "", 1)
    assert "not enough memory" in said.err
