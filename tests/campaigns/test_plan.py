import tomllib
from pathlib import Path

import pytest

from campaigns.plans import preset, write_plan
from conevo.campaigns.plan_file import preset_names, read_plan
from conevo.errors import UsageError
from conevo.runs.layers import PRESETS

SCALES = ("smoke", "thesis")


def test_every_combination_of_levels_is_run_with_every_seed_seed_by_seed(tmp_path):
    plan = read_plan(write_plan(tmp_path, factors='"world.n_robots" = [3, 4]'))
    runs = plan.write_out()
    cells = [(run.method, run.variant) for run in runs if run.seed == 1]
    assert cells == [
        ("homcne", "n_robots=3"),
        ("homcne", "n_robots=4"),
        ("cone", "n_robots=3"),
        ("cone", "n_robots=4"),
    ]
    assert [run.seed for run in runs] == [1] * 4 + [2] * 4
    assert len(runs) == plan.n_runs
    assert len({run.label for run in runs} | {run.run_ids for run in runs}) == 16
    (config,) = runs[5].configs()
    assert config.world_params.n_robots == 4
    assert (config.run.seed, config.run.generations, config.preset) == (2, 2, "smoke")
    assert config.run_id == runs[5].run_ids[0]


def test_conditions_select_runs_and_later_ones_override_and_factors_override_all(tmp_path):
    path = write_plan(tmp_path, factors='"run.epochs" = [1, 3]')
    with path.open("a") as file:
        file.write(
            '[[where]]\nmethod = ["cone"]\nsettings = { "run.checkpoint_every" = 2 }\n'
            '[[where]]\nworld = "rover/complex-1..3"\npreset = ["smoke"]\n'
            'settings = { "run.checkpoint_every" = 3, "run.epochs" = 9 }\n'
            '[[where]]\nmethod = "homcne"\npreset = "night"\n'
            'settings = { "run.checkpoint_every" = 4 }\n'
        )
    runs = read_plan(path).write_out()
    assert {run.configs()[0].run.checkpoint_every for run in runs} == {3}
    assert [run.configs()[0].run.epochs for run in runs] == [1, 3] * 4
    night = read_plan(path).at("night", 1).write_out()
    assert [run.configs()[0].run.checkpoint_every for run in night] == [4, 4, 2, 2]
    forced = read_plan(path).at(settings={"run.checkpoint_every": 7}).write_out()
    assert {run.configs()[0].run.checkpoint_every for run in forced} == {7}


def test_a_later_layer_wins_with_or_without_the_section_in_its_keys(tmp_path):
    path = write_plan(tmp_path, factors="epochs = [2]", more='"run.epochs" = 1\nn_tests = 3')
    path.write_text(path.read_text().replace('"run.n_tests" = 2\n', ""))
    with path.open("a") as file:
        file.write('[[where]]\nmethod = "cone"\nsettings = { "run.n_tests" = 4, genotypes = 8 }\n')
    plan = read_plan(path)
    found = [run.configs()[0] for run in plan.at(settings={"generations": 5}).write_out()]
    assert {(one.run.generations, one.run.epochs) for one in found} == {(5, 2)}
    assert [one.run.n_tests for one in found[:2]] == [3, 4]
    assert [one.method_config.genotypes for one in found[:2]] == [6, 8]
    for twice in ({"generations": 2, "run.generations": 3}, {"epochs": 1}, {"run.epochs": 1}):
        with pytest.raises(UsageError, match=r"the same setting is given|epochs is a factor in"):
            plan.at(settings=twice)
    for more in ("generations = 3", "genotypes = 3"):
        with pytest.raises(UsageError, match="the same setting is given as gen"):
            read_plan(write_plan(tmp_path, more=more)).write_out()


def test_a_factor_may_belong_to_some_runs_only(tmp_path):
    path = write_plan(tmp_path, factors='"run.epochs" = [1, 3]')
    with path.open("a") as file:
        file.write('[[where]]\nmethod = "cone"\nfactors = { "method.gst" = [0.1, 0.2] }\n')
    plan = read_plan(path)
    runs = [run for run in plan.write_out() if run.seed == 1]
    assert [(run.method, run.variant) for run in runs] == [
        ("homcne", "epochs=1"),
        ("homcne", "epochs=3"),
        ("cone", "epochs=1, gst=0.1"),
        ("cone", "epochs=1, gst=0.2"),
        ("cone", "epochs=3, gst=0.1"),
        ("cone", "epochs=3, gst=0.2"),
    ]
    assert [run.configs()[0].method_config.gst for run in runs[2:]] == [0.1, 0.2, 0.1, 0.2]
    assert plan.n_runs == 12
    again = tmp_path / "again.toml"
    again.write_text(plan.to_toml())
    assert read_plan(again) == plan


NAMED = """
[levels.ranges]
small = { "world.low_range" = 0.05, "world.hi_range" = 0.01 }
large = { "world.low_range" = 0.2 }
"""


def test_a_level_may_be_several_settings(tmp_path):
    path = write_plan(tmp_path, factors='ranges = ["small", "large"]', more=NAMED)
    plan = read_plan(path)
    runs = plan.write_out()[:4]
    assert [(run.method, run.variant) for run in runs] == [
        ("homcne", "ranges=small"),
        ("homcne", "ranges=large"),
        ("cone", "ranges=small"),
        ("cone", "ranges=large"),
    ]
    worlds = [run.configs()[0].world_params for run in runs]
    assert [(one.low_range, one.hi_range) for one in worlds] == [(0.05, 0.01), (0.2, 0.03)] * 2
    assert 0.05 in plan.values
    again = tmp_path / "again.toml"
    again.write_text(plan.to_toml())
    assert read_plan(again) == plan
    assert read_plan(again).write_out() == plan.write_out()


def test_named_levels_may_be_of_some_runs_only(tmp_path):
    some = '[[where]]\nmethod = "cone"\nfactors = { exchange = ["none", "all"] }\n'
    named = '[levels.exchange]\nnone = { "method.gst" = 0.0 }\nall = { "method.gst" = 1.0 }\n'
    runs = read_plan(write_plan(tmp_path, more=some + named)).write_out()[:3]
    assert [run.variant for run in runs] == ["", "exchange=none", "exchange=all"]
    assert [run.configs()[0].method_config.gst for run in runs[1:]] == [0.0, 1.0]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('["small", "large"]', '["small", "lage"]', "level of ranges 'lage'.*mean 'large'"),
        ("[levels.ranges]", "[levels.range]", "levels.range in .*: the plan has no factor 'range'"),
        ("[levels.ranges]", "[levels.method]", "levels.method .* needs its own name"),
        ("[levels.ranges]", '[levels."a.b"]', "levels.a.b .* needs its own name"),
        ("large =", '"so, large" =', "levels.ranges.so, large .*letters, digits"),
        ('large = { "world.low_range" = 0.2 }', "large = 2", "levels.ranges.large .* be a table"),
        ('"world.hi_range" =', '"world.high_range" =', "'world.high_range'.*'world.hi_range'"),
        ('"world.hi_range" = 0.01', '"run.seed" = 1', "seeds are campaign.seeds"),
        ("[levels.ranges]", "[[levels]]", "levels in .* must be a table"),
    ],
)
def test_a_wrong_level_is_one_clear_line(tmp_path, old, new, message):
    path = write_plan(tmp_path, factors='ranges = ["small", "large"]', more=NAMED)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(UsageError, match=message) as caught:
        read_plan(path).write_out()
    assert "\n" not in str(caught.value)


def test_two_worlds_of_one_name_are_refused(tmp_path):
    text = (Path(__file__).parents[2] / "examples" / "light.py").read_text()
    for name in ("one.py", "two.py"):
        (tmp_path / name).write_text(f"{text}\n# {name}\n")
    worlds = [f"{tmp_path}/{name}:dark-1" for name in ("one.py", "two.py")]
    file = tmp_path / "plan.toml"
    for levels, is_fine in ((worlds, False), (worlds[:1], True)):
        levels_text = ", ".join(f'"{one}"' for one in levels)
        file.write_text(
            '[campaign]\nname = "mine"\ntitle = "x"\npreset = "smoke"\nseeds = 1\n\n'
            f'[factors]\nworld = [{levels_text}]\nmethod = ["homcne"]\n'
        )
        if is_fine:
            assert len(read_plan(file).write_out()) == 1
            continue
        words = "light-v1 in .*plan.toml is the name of two worlds, .*/one.py and .*/two.py: "
        with pytest.raises(UsageError, match=words):
            read_plan(file).write_out()


def test_a_plan_is_the_same_after_being_written_and_read(tmp_path):
    path = write_plan(tmp_path, 'produces = ["figure 1"]', '"method.gst" = [0.1]')
    path.write_text(path.read_text().replace('"homcne", ', ""))
    plan = read_plan(path).at("desk", 3, {"run.epochs": 2})
    again = tmp_path / "again.toml"
    again.write_text(plan.to_toml())
    assert read_plan(again) == plan
    assert read_plan(again).write_out() == plan.write_out()


def test_a_shaping_is_one_run_with_a_configuration_for_every_stage(tmp_path):
    path = write_plan(tmp_path, "shape = true")
    path.write_text(path.read_text().replace("complex-1", "complex-3"))
    run = read_plan(path).write_out()[0]
    assert [config.environment for config in run.configs()] == [f"complex-{k}" for k in (1, 2, 3)]
    assert list(run.courses) == [f"{run.label}/stage-{k}" for k in (1, 2, 3)]


def test_some_runs_of_a_plan_may_be_shapings(tmp_path):
    path = write_plan(tmp_path)
    path.write_text(
        path.read_text().replace('"rover/complex-1"', '"rover/complex-1", "rover/complex-3"')
        + '[[where]]\nworld = "rover/complex-3"\nshape = true\n'
    )
    plan = read_plan(path)
    stages = {(run.world[-1], run.shape): len(run.configs()) for run in plan.write_out()}
    assert stages == {("1", False): 1, ("3", True): 3}
    again = tmp_path / "again.toml"
    again.write_text(plan.to_toml())
    assert read_plan(again) == plan


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[settings]", "[setings]", "'setings'.*did you mean 'settings'"),
        ("title =", "tittle =", "'campaign.tittle'.*'campaign.title'"),
        ("seeds = 2", "seeds = 0", "campaign.seeds = 0"),
        ("seeds = 2", "seeds = [1, 1]", "planned twice"),
        ("seeds = 2", "seeds = [1.5]", "campaign.seeds"),
        ('"smoke"', '"smok"', "'smok'.*did you mean 'smoke'"),
        ('"cone"]', '"coen"]', "method 'coen'.*did you mean 'cone'"),
        ("complex-1", "complx-1", "complx-1"),
        ('["homcne", "cone"]', "[]", "factors.method.*at least one"),
        ('["homcne", "cone"]', '"cone"', "factors.method"),
        ('"run.generations"', '"run.generation"', "run.generation'.*run.generations"),
        ('"method.genotypes" = 6', '"method.genotypes" = -6', "genotypes = -6"),
        ('title = "Tiny"', "title = 3", "campaign.title = 3"),
        ('title = "Tiny"', r'title = "a\u0007b"', "campaign.title = .*: must be one line"),
        ('title = "Tiny"', 'name = "../x"', "names a folder"),
        ('title = "Tiny"', 'studies = ["team"]', "'team'.*did you mean 'teams'"),
        ('title = "Tiny"', "shape = 1", "campaign.shape"),
        ("[settings]", '[[where]]\nmetod = "cone"\n[settings]', "where.metod"),
        ("[settings]", "[[where]]\nshape = 2\n[settings]", "where.shape = 2"),
        ("[settings]", "[where]\n[settings]", r"\[\[where\]\]"),
        ("[campaign]", "[campaign", "not valid TOML"),
        ("[settings]", '[[where]]\nfactors = { "run.epochs" = 3 }\n[settings]', "at least one"),
        ("[settings]", '[[where]]\nfactors = { method = ["cone"] }\n[settings]', "for all runs"),
        (
            "[settings]",
            '[[where]]\nmethod = "homcne"\nfactors = { "method.gst" = [0.1] }\n[settings]',
            "unknown key 'method.gst'",
        ),
        ("[settings]", '[settings]\n"run.seed" = 4', "seeds are campaign.seeds"),
        ("[settings]", '[[where]]\nmethod = "conne"\n[settings]', "did you mean 'cone'"),
        ("[settings]", '[[where]]\npreset = "smok"\n[settings]', "did you mean 'smoke'"),
        ("[settings]", '[[where]]\nworld = "rovr/complex-1"\n[settings]', "did you mean 'rover'"),
        (
            "[settings]",
            '[[where]]\nmethod = ["mesp", "ccga"]\n[settings]',
            r"where.method = \['mesp', 'ccga'\] in .* matches no run: .*method is homcne, cone",
        ),
        ("[settings]", "[[where]]\nmethod = []\n[settings]", r"where.method = \[\] in .* no run"),
        ("[settings]", '[[where]]\nworld = "rover/simple-1"\n[settings]', "matches no run"),
        ("[settings]", '"run.method" = ["mesp", "ccga"]\n[settings]', "the method is given as"),
        ("[settings]", '[settings]\n"run.method" = "mesp"', "run.method = 'mesp'.*is given as"),
        ("[settings]", '[settings]\n"run.preset" = "desk"', "the preset is given as smoke"),
        ("[settings]", '[settings]\n"run.world" = "rover/complex-2"', "the world is given as"),
        ("complex-1", "complex-5..2", "starts with its smaller number"),
        (
            "[settings]",
            '[settings]\n"method.start_noise" = 0.1',
            r"start_noise = 0.1 does nothing in .*tiny.toml: it is for populations bred from",
        ),
    ],
)
def test_a_wrong_plan_is_one_clear_line(tmp_path, old, new, message):
    path = write_plan(tmp_path)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(UsageError, match=message) as caught:
        read_plan(path).write_out()
    assert "\n" not in str(caught.value)


def test_a_missing_plan_is_a_wrong_request(tmp_path):
    with pytest.raises(UsageError, match="No such file"):
        read_plan(tmp_path / "none.toml")


def test_a_change_of_defaults_after_planning_is_noticed(tmp_path):
    import dataclasses

    run = read_plan(write_plan(tmp_path)).write_out()[0]
    with pytest.raises(UsageError, match="planned with other defaults"):
        dataclasses.replace(run, run_ids=("0" * 12,)).configs()


@pytest.mark.parametrize("name", preset_names())
def test_experiments_of_the_thesis_can_be_written_out_at_every_scale(name):
    plan = preset(name)
    assert plan.title
    assert plan.preset in PRESETS
    for scale in SCALES:
        runs = plan.at(scale, 1).write_out()
        assert len(runs) * len(plan.seeds) == plan.n_runs
    assert tomllib.loads(plan.to_toml())["campaign"]["name"] == name
