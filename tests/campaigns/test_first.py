"""Runs of a campaign whose first stage another method evolves: one run each, at an equal budget."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conevo.campaigns.campaign import Campaign, create
from conevo.campaigns.executors.local import Serial
from conevo.campaigns.plan import Plan
from conevo.campaigns.plan_file import read_plan
from conevo.campaigns.progress import progress_of
from conevo.campaigns.tables import Tables
from conevo.campaigns.worker import planned_runs
from conevo.errors import UsageError
from conevo.reading import read_json
from conevo.report.files import write_report
from conevo.runs.directory import as_json
from conevo.runs.run import Run
from conevo.runs.shaping import Shaping
from conevo.studies.team_study import study

TEXT = """
[campaign]
title = "Clones first"
seeds = 1
preset = "smoke"
studies = ["teams"]

[factors]
world = ["rover/complex-1"]
method = ["homcne", "ccga"]

[settings]
"run.generations" = 50
"run.budget_evaluations" = 60
"run.fittest_epochs" = 1
"run.n_tests" = 2
"world.iterations" = 40

[[where]]
method = "homcne"
settings = { "method.genotypes" = 7 }

[[where]]
method = "ccga"
settings = { "method.genotypes" = 4, "method.mutation_scale" = 0.03 }
factors = { first = ["none", "homcne"] }
"""

pytest_plugins = ["report.quick_figures"]


def plan_of(folder: Path, old: str = "", new: str = "") -> Plan:
    assert old in TEXT
    path = folder / "plan.toml"
    path.write_text(TEXT.replace(old, new, 1) if old else TEXT)
    return read_plan(path)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """A finished campaign: clones, populations, and populations bred from clones."""
    folder = tmp_path_factory.mktemp("first")
    made = create(plan_of(folder), folder / "first")
    entries = made.carry_on(Serial(1))
    assert {one.state for one in entries.values()} == {"finished"}
    return made


@pytest.fixture(scope="module")
def label(campaign: Campaign) -> str:
    """The label of the run that starts with clones."""
    (found,) = (name for name, run in campaign.planned.items() if run.in_stages)
    return found


def test_the_first_stage_has_the_settings_of_its_method_and_its_share(tmp_path: Path) -> None:
    plain, none, first = plan_of(tmp_path).write_out()
    assert [run.variant for run in (plain, none, first)] == ["", "first=none", "first=homcne"]
    assert len(none.configs()) == 1
    before, config = first.configs()
    assert (before.method, before.method_config.genotypes) == ("homcne", 7)
    assert before.method_config.mutation_scale == 0.1
    assert (config.method, config.method_config.genotypes) == ("ccga", 4)
    assert config.method_config.mutation_scale == 0.03
    assert [one.run.budget_evaluations for one in (before, config)] == [30, 30]
    assert [one.run.generations for one in (before, config)] == [25, 25]
    assert list(first.courses) == [first.label]
    assert first.courses == {first.label: [f"{first.label}/stage-{k}" for k in (1, 2)]}
    again = tmp_path / "again.toml"
    again.write_text(plan_of(tmp_path).to_toml())
    assert read_plan(again).write_out() == [plain, none, first]


def test_factors_of_the_method_are_the_second_stages_and_all_others_are_of_both(
    tmp_path: Path,
) -> None:
    factors = '"run.epochs" = [1, 2], "method.start_noise" = [0.02], sizes = ["small"] }\n'
    named = '[levels.sizes]\nsmall = { "method.rounds" = 2, "controller.n_hidden" = 3 }\n'
    plan = plan_of(
        tmp_path, 'first = ["none", "homcne"] }', f'first = ["homcne"], {factors}{named}'
    )
    runs = plan.write_out()[1:]
    assert [run.variant for run in runs] == [
        f"first=homcne, epochs={n}, start_noise=0.02, sizes=small" for n in (1, 2)
    ]
    for n, run in enumerate(runs, start=1):
        before, config = run.configs()
        assert (before.run.epochs, config.run.epochs) == (n, n)
        assert (before.controller.n_hidden, config.controller.n_hidden) == (3, 3)  # type: ignore[attr-defined]
        assert (before.method_config.start_noise, config.method_config.start_noise) == (0, 0.02)
        assert config.method_config.rounds == 2


def test_it_may_also_be_a_setting_and_of_a_method_without_its_own_runs(
    tmp_path: Path,
) -> None:
    plan = plan_of(tmp_path, 'factors = { first = ["none", "homcne"] }', "")
    plan = plan.at(settings={"first_share": 0.25})
    text = plan.to_toml().replace('"homcne",\n', "", 1)
    text = text.replace('"method.genotypes" = 4', '"method.genotypes" = 4\nfirst = "homcne"')
    path = tmp_path / "other.toml"
    path.write_text(text)
    (run,) = read_plan(path).write_out()
    assert (run.method, run.variant) == ("ccga", "first=homcne")
    assert "first=homcne" in run.label
    assert [one.run.budget_evaluations for one in run.configs()] == [15, 45]
    assert run.configs()[0].method_config.genotypes == 7


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"none", "homcne"]', '"none", "homcnee"]', r"first in .*did you mean 'homcne'"),
        ('"none", "homcne"]', '"ccga"]', "first = 'ccga' in .* needs another method"),
        ('first = ["none"', 'first_share = [0.3], first = ["none"', "factor first_share in .* no"),
        ("studies =", "shape = true\nstudies =", "the environment|not both|nothing to shape"),
        ('method = "ccga"\nsettings = {', 'method = "ccga"\nfirst = "homcne"\nsettings = {',
         "unknown condition 'where.first'"),
        ('"run.generations" = 50', '"run.generations" = 1', "= 1 in .* cannot be shared"),
        ('"method.mutation_scale" = 0.03', '"world.iterations" = 41', "stages are of one task"),
        ('method = ["homcne", "ccga"]', 'method = ["ccga"]\n"run.seed" = [3]', "campaign.seeds"),
    ],
)  # fmt: skip
def test_a_wrong_plan_is_one_clear_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(UsageError, match=words) as caught:
        plan_of(tmp_path, old, new).write_out()
    assert "\n" not in str(caught.value)


def test_both_stages_are_one_run_in_the_tables(campaign: Campaign, label: str) -> None:
    first, second = Shaping(campaign.paths.run(label)).stages
    one, two = first.generations(), second.generations()
    spent = one[-1]["team_evaluations"] + two[-1]["team_evaluations"]
    steps = one[-1]["team_steps"] + two[-1]["team_steps"]
    with Tables(campaign.paths.tables) as tables:
        assert tables.query("SELECT count(*) FROM runs")[1] == [(3,)]
        rows = tables.query(
            "SELECT method, variant, generations, planned_evaluations, evaluations, team_steps "
            f"FROM runs WHERE run = '{label}'"
        )[1]
        assert rows == [("ccga", "first=homcne", len(one) + len(two), 60, spent, steps)]
        rows = tables.query(
            f"SELECT generation, evaluations, value FROM generations WHERE run = '{label}' "
            "ORDER BY generation"
        )[1]
        before = one[-1]["team_evaluations"]
        expected = [(r["team_evaluations"], r["performance"]["value"]) for r in one]
        expected += [(before + r["team_evaluations"], r["performance"]["value"]) for r in two]
        assert rows == [(k, *pair) for k, pair in enumerate(expected)]
        assert first.test_result is not None
        assert second.test_result is not None
        for team, name, test in (
            ("champion", "champion", second.test_result),
            ("generation 0", "generation_0", first.test_result),
        ):
            rows = tables.query(
                f"SELECT value FROM scores WHERE run = '{label}' AND study = 'test' AND "
                f"team = '{team}' AND measure = 'value' ORDER BY scenario"
            )[1]
            assert [value for (value,) in rows] == test[name]["performance"]["value"]["values"]
        (chosen,) = tables.query(f"SELECT DISTINCT generation FROM champions WHERE run='{label}'")[
            1
        ]
        assert chosen == (len(one) + second.test_result["validation"]["chosen"],)
        # Budgets are equal: all three runs are compared.
        assert len(tables.query("SELECT DISTINCT budget FROM budgets")[1]) == 1


def test_the_report_compares_it_with_both(
    without_ink: None, campaign: Campaign, tmp_path: Path
) -> None:
    text = write_report(campaign, tmp_path / "report").read_text()
    assert "first=homcne" in text
    assert "a stage" not in text


def test_the_second_stage_is_studied(campaign: Campaign, label: str) -> None:
    found = read_json(campaign.paths.study(label))
    made = study(Run(campaign.paths.run(f"{label}/stage-2")), threads=1)
    assert found == json.loads(as_json(made))
    assert not campaign.paths.study(f"{label}/stage-1").exists()


def test_its_progress_is_that_of_both_stages(campaign: Campaign, label: str) -> None:
    found = progress_of(campaign.paths, campaign.planned[label])
    stages = Shaping(campaign.paths.run(label)).stages
    assert found.generations == sum(len(run.generations()) for run in stages)
    assert (found.of, found.budget) == (50, 60)
    assert found.share > 0.5


def test_stages_that_have_started_keep_their_length(campaign: Campaign) -> None:
    with pytest.raises(UsageError, match="stages keep their length"):
        create(campaign.plan.at(settings={"run.budget_evaluations": 80}), campaign.path)


def test_a_list_of_runs_that_an_earlier_version_wrote_is_read(campaign: Campaign) -> None:
    lines = campaign.paths.runs.read_text().splitlines()
    earlier = [{k: v for k, v in json.loads(one).items() if k != "of_first"} for one in lines[:2]]
    root = campaign.path.parent / "earlier"
    root.mkdir()
    (root / "runs.jsonl").write_text("".join(f"{json.dumps(one)}\n" for one in earlier))
    assert [*planned_runs(root).values()] == [*campaign.planned.values()][:2]
