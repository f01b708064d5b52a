"""Methods and simulators from files are tried before a run is written: each mistake is one line."""

from __future__ import annotations

from pathlib import Path

import pytest

import conevo
from conevo.cli.main import main
from conevo.errors import UsageError

EXAMPLES = Path(__file__).parents[2] / "examples"
METHOD = (EXAMPLES / "own_method.py").read_text()
WORLD = (EXAMPLES / "spread.py").read_text()
FEW = {
    "run.epochs": 2, "run.fittest_epochs": 1, "run.n_tests": 2, "run.n_validations": 2,
    "run.n_finalists": 2, "world.iterations": 5, "method.genotypes": 6, "run.generations": 2,
}  # fmt: skip

FIRST = "            mean=np.zeros(shape),\n"
LATER = "            mean=mean,\n"
ASKS = "return Trials(generation, *as_pool(self.teams(state), n_slots))"
STATE = "the state of Team ES cannot be kept: "
METHODS = {
    "list": (FIRST, "            mean=[0.0],\n", f"{STATE}mean is list; a state has arrays of"),
    "objects": (FIRST, FIRST.replace("shape", "shape, object"), f"{STATE}mean is an array of obj"),
    "dict": ("        return TeamEsState(\n            progress=Progress.first",
             "        return dict(\n            progress=Progress.first",
             "the state of Team ES must be a dataclass, not dict"),
    "late type": (LATER, "            mean=mean.astype(np.float32),\n",
                  f"{STATE}after a generation mean is another kind of array"),
    "late set": ("            step_size=step_size,\n", "            step_size={step_size},\n",
                 f"{STATE}step_size is set"),
    "late number": ("            step_size=step_size,\n", "            step_size=float('nan'),\n",
                    "the state of Team ES has a wrong step_size after the first generation"),
    "problem": ("def problem(self, first: TeamEsState)", "def problem(self)",
                "the state of Team ES must have problem(first), or none"),
    "no trials": (ASKS, "return []", "Team ES: ask must return Trials, not list"),
    "rows": (ASKS, "return Trials(generation, *as_pool(self.teams(state), 9))",
             "what ask returns cannot be evaluated: teams must be [N, 4, 8] int32, not [6, 4, 9]"),
    "not crowned": ("            progress = progress.crowned(trials, scores)\n", "",
                    "tell must record the team of the portrait as the fittest"),
    "no portrait": (", portrait=True", "", "without a portrait"),
    "endless": ("generation=progress.generation + 1", "generation=progress.generation",
                "Team ES: tell has not ended the first generation after 1000 requests"),
    "luck": ('stream(state.progress.root, "steps", state.progress.generation)',
             "np.random.default_rng()", "Team ES: ask returns other teams when it is asked again"),
    "words": ("with_numbers(step_size=state.step_size)", "with_numbers(step_size='wide')",
              "Team ES: step_size is not a number: 'wide'"),
}  # fmt: skip
FITNESS = "fitness=fitness.reshape(n, e, r)"
GAP = '{"gap": fitness.mean(axis=1).reshape(n, e)}'
SIMULATORS = {
    "shape": (FITNESS, "fitness=fitness.reshape(n, r, e)",
              "evaluate: fitness must be [2, 1, 4], got [2, 4, 1]"),
    "list": (FITNESS, f"{FITNESS}.tolist()", "fitness must be an array [2, 1, 4], not list"),
    "complex": (FITNESS, f"{FITNESS} * 1j", "must be an array of floats, not of complex"),
    "halves": ("counts=counts", "counts=0.5 * counts", "counts must be an array of whole numbers"),
    "below": ("counts=counts", "counts=-counts", "counts must be 0 or more, not -5"),
    "names": (GAP, GAP.replace("gap", "hole"), "performance must have gap, got hole"),
    "measure": (GAP, GAP.replace(".reshape(n, e)", ""), "gap must be [2, 1], got [2]"),
    "nothing": ("return Outcome(", "return dict(", "it must return an Outcome, not dict"),
    "arguments": ("        rounds: int = 1,\n    ) -> Outcome", "    ) -> Outcome",
                  "must have evaluate(genes, teams, scenarios, heuristic, rounds)"),
    "fingerprint": ("ClassVar[str] = SpreadWorld.name", "ClassVar[int] = 3",
                    "needs a text as fingerprint, not 3"),
    "threads": ("(self, controller: Controller, n_threads: int)", "(self, controller: Controller)",
                "simulator must be declared as simulator(controller, n_threads)"),
}  # fmt: skip


def changed(path: Path, text: str, old: str, new: str) -> Path:
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return path


def refused(tmp_path: Path, world: Path, method: str) -> str:
    """Return the reason why no run starts; nothing must have been written."""
    with pytest.raises(UsageError) as caught:
        conevo.evolve(
            f"{world}:open-1", method, "smoke", out=tmp_path / "run", overrides=FEW, threads=1
        )
    assert not (tmp_path / "run").exists()
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", METHODS)
def test_a_mistake_in_a_method_is_one_line_before_the_run(name: str, tmp_path: Path) -> None:
    old, new, words = METHODS[name]
    file = changed(tmp_path / "mine.py", METHOD, old, new)
    assert words in refused(tmp_path, EXAMPLES / "spread.py", f"{file}:team-es")


@pytest.mark.parametrize("name", SIMULATORS)
def test_a_mistake_in_a_simulator_is_one_line_before_the_run(name: str, tmp_path: Path) -> None:
    old, new, words = SIMULATORS[name]
    assert words in refused(tmp_path, changed(tmp_path / "mine.py", WORLD, old, new), "homcne")


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("if (teams < 0).all(axis=2).any(): raise ValueError('no brain')", "no brain"),
        ("genes = genes if (teams >= 0).any(axis=2).all() else np.nan * genes", "not finite"),
    ],
)
def test_a_simulator_that_cannot_play_empty_networks_has_no_difference_credit(
    fault: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    line = "        n, r = teams.shape[:2]\n        e = len(scenarios) // rounds\n"
    world = changed(tmp_path / "mine.py", WORLD, line, f"        {fault}\n{line}")
    monkeypatch.setitem(FEW, "run.generations", 1)
    conevo.evolve(f"{world}:open-1", "homcne", "smoke", out=tmp_path / "plain", overrides=FEW)
    monkeypatch.setitem(FEW, "run.credit", "difference")
    reason = refused(tmp_path, world, "homcne")
    assert 'run.credit = "difference" needs robots with an empty network' in reason
    assert words in reason


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("raise SystemExit(3)", "in ask: SystemExit: 3"),
        ("return 1 / 0", "in ask: ZeroDivisionError: division by zero"),
    ],
)
def test_a_method_that_ends_the_process_does_not(
    fault: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = changed(tmp_path / "mine.py", METHOD, ASKS, fault)
    with pytest.raises(SystemExit) as caught:
        main(["run", f"{EXAMPLES / 'spread.py'}:open-1", "--method", f"{file}:team-es", "--preset",
              "smoke", "--out", str(tmp_path / "run")])  # fmt: skip
    out, err = capsys.readouterr()
    assert (caught.value.code, out, err.count("\n")) == (2, "", 1)
    assert err.endswith(f"{words}\n")
    assert not (tmp_path / "run").exists()


def test_a_record_of_another_shape_is_one_line(tmp_path: Path) -> None:
    from conevo.replay.recording import record

    old = '"outputs": outputs,'
    world = changed(tmp_path / "mine.py", WORLD, old, '"outputs": outputs[:, :, :1],')
    out = tmp_path / "run"
    run = conevo.evolve(f"{world}:open-1", "homcne", "smoke", out=out, overrides=FEW, threads=1)
    with pytest.raises(UsageError, match=r"record: outputs must be \[5, 4, 4\], got \[5, 4, 1\]$"):
        record(run)
