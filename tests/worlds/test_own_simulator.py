"""A world with its own simulator: checked, evolved, continued and recorded like any other."""

from __future__ import annotations

from pathlib import Path

import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import EnvironmentFailure, UsageError
from conevo.replay.recording import record
from conevo.worlds.checks import findings
from conevo.worlds.simulators import simulator
from runs.tiny import content

EXAMPLE = Path(__file__).parents[2] / "examples" / "spread.py"
TASK = f"{EXAMPLE}:open-1"
SMALL = {
    "run.epochs": 2, "run.fittest_epochs": 2, "run.n_tests": 3, "run.n_validations": 2,
    "run.n_finalists": 2, "world.iterations": 12, "method.genotypes": 6,
}  # fmt: skip


def code_of(*arguments: str) -> int:
    """Return the exit code of a command."""
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return int(ended.value.code or 0)


def evolved(path: Path, generations: int, method: str = "cone") -> conevo.Run:
    settings = SMALL | {"run.generations": generations}
    return conevo.evolve(TASK, method, "smoke", out=path, overrides=settings, threads=1)


@pytest.mark.parametrize("method", ["cone", "homcne", "ccga"])
def test_a_run_of_it_is_continued_bit_for_bit(method: str, tmp_path: Path) -> None:
    whole = evolved(tmp_path / "whole", 5, method)
    short = evolved(tmp_path / "short", 2, method).resume(generations=5)
    one, other = content(whole.path), content(short.path)
    assert one["generations"] == other["generations"]
    assert (one["checkpoint"], one["champion.npz"]) == (other["checkpoint"], other["champion.npz"])


def test_its_team_is_recorded_as_it_was_tested(tmp_path: Path) -> None:
    run = evolved(tmp_path / "run", 2)
    seen = record(run)
    assert seen.about["inputs"] == ["closest x", "closest y"]
    assert seen.channels["x"].values.shape == (12, 4)
    assert run.test_result is not None
    gaps = run.test_result["champion"]["performance"]["gap"]["values"]
    assert seen.about["performance"]["gap"] == pytest.approx(gaps[0], abs=0)


def test_it_works_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "run")
    assert (
        code_of("run", TASK, "--preset", "smoke", "--out", out, "--quiet", "--method", "mesp") == 0
    )
    assert code_of("show", out) == 0
    assert code_of("test", out, "--scenarios", "2", "--set", "world.step=0.05") == 0
    assert "spread-v1/open-1, Multi-Agent ESP" in capsys.readouterr().out


def test_it_plays_on_the_cpu_only_and_with_controllers_that_fit(tmp_path: Path) -> None:
    world = conevo.world(TASK)
    with pytest.raises(EnvironmentFailure, match="its own simulator, on the cpu"):
        simulator(world, conevo.controller(world=world), device="cuda")
    lacking = tmp_path / "lacking.py"
    lacking.write_text(EXAMPLE.read_text().replace("def is_shared", "def is_common"))
    with pytest.raises(UsageError, match="its simulator, SpreadSimulator, needs is_shared"):
        conevo.evolve(f"{lacking}:open-1", preset="smoke", out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_the_example_has_no_faults(capsys: pytest.CaptureFixture[str]) -> None:
    assert code_of("check", TASK) == 0
    assert capsys.readouterr().out.endswith("no problems\n")


MISTAKES = {
    "rounds": ("[part]", "[0 * part]", "evaluate(rounds=2) gives other results"),
    "batch": ("= starts.copy(), ", "= starts + np.float32(len(starts) / 1000), ",
              "than among others"),
    "again": ("= starts.copy(), ", "= starts + np.random.default_rng().random() / 9, ",
              "when it is called again"),
    "shape": ("fitness=fitness.reshape(n, e, r)", "fitness=fitness.reshape(n, r, e)",
              "fitness must be"),
    "count": ("counts += action", "counts += 2 * (action", "counts of evaluate are not those"),
    "finite": ("np.linalg.norm(_closest(place), axis=2)",
               "np.linalg.norm(_closest(place), axis=2) * np.inf", "fitness is not finite"),
    "name": ('performance={"gap"', 'performance={"hole"', "performance must have gap, got hole"),
    "drawn": ("stream(key, self.name).random", "stream(len(keys), self.name).random",
              "changes with the other keys"),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # of the mistake itself
@pytest.mark.parametrize("name", MISTAKES)
def test_each_mistake_is_found(name: str, tmp_path: Path) -> None:
    old, new, words = MISTAKES[name]
    text = EXAMPLE.read_text()
    assert text.count(old) == 1
    if name == "count":
        text = text.replace(
            "np.arange(len(self.world.actions))\n", "np.arange(len(self.world.actions)))\n", 1
        )
    file = tmp_path / "spread.py"
    file.write_text(text.replace(old, new))
    found = [one.text for one in findings(f"{file}:open-1") if one.status == "problem"]
    assert any(words in text for text in found), found


def test_cone_learns_a_task_that_clones_cannot(tmp_path: Path) -> None:
    """The largest gap is 1, with an agent in each corner: they must not all do the same."""
    settings = {"run.generations": 15, "run.fittest_epochs": 3, "method.genotypes": 20}
    gaps = {}
    for method in ("cone", "homcne"):
        out = tmp_path / method
        run = conevo.evolve(TASK, method, "smoke", out=out, overrides=settings)
        assert run.test_result is not None
        gaps[method] = run.test_result["champion"]["performance"]["gap"]["mean"]
    assert gaps["cone"] > 0.9 > 0.6 > gaps["homcne"]
