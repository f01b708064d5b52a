"""Runs with other settings have their own curves, medians and names."""

from conevo.campaigns.plan import levels_of
from conevo.watch.settings import comparisons, differences
from conevo.watch.state import Watched
from watch.followed import session, write_run, write_shaping


def with_settings(path, method="cone", **settings):
    """Write a run of two generations with settings: method__gst=0.2."""
    write_run(path, 2, method=method, **settings)


def panels_in(folder):
    """Return the panels of a folder: by, variant, and series -> labels of its lines."""
    found = []
    for panel in Watched(folders=[folder]).snapshot()["panels"]:
        series = {}
        for line in panel["over"]["generation"]["lines"]:
            series.setdefault(line["series"], []).append(line["label"])
        found.append((panel["by"], panel["variant"], series))
        assert [row["series"] for row in panel["rows"]] == list(series)
    return found


def test_runs_with_other_settings_have_their_own_median_that_names_them(tmp_path):
    with_settings(tmp_path / "a", seed=1, method__gst=0.1, world__n_robots=5)
    with_settings(tmp_path / "b", seed=2, method__gst=0.1, world__n_robots=5)
    with_settings(tmp_path / "c", seed=1, method__gst=0.2, world__n_robots=5)
    assert panels_in(tmp_path) == [("variant", "", {"gst=0.1": ["a", "b"], "gst=0.2": ["c"]})]


def test_a_setting_of_one_method_is_compared_with_the_others_at_each_value(tmp_path):
    with_settings(tmp_path / "a", method__gst=0.1)
    with_settings(tmp_path / "b", method__gst=0.2)
    with_settings(tmp_path / "c", "homcne", method__genotypes=9)
    assert panels_in(tmp_path) == [
        ("method", "gst=0.1", {"cone": ["a"], "homcne": ["c"]}),
        ("method", "gst=0.2", {"cone": ["b"], "homcne": ["c"]}),
    ]


def test_methods_in_worlds_with_other_settings_are_not_compared(tmp_path):
    with_settings(tmp_path / "a", world__n_robots=5)
    with_settings(tmp_path / "b", "homcne", world__n_robots=5)
    with_settings(tmp_path / "c", "homcne", world__n_robots=6, run__extra="x")
    assert panels_in(tmp_path) == [
        ("method", "no extra, n_robots=5", {"cone": ["a"], "homcne": ["b"]}),
        ("method", "extra=x, n_robots=6", {"homcne": ["c"]}),
    ]


def test_runs_with_very_many_differences_are_still_distinguished(tmp_path):
    for k in range(3):
        names = {f"world__n_{n}": k if n > 5 else 0 for n in range(9)} | {"method__z": k}
        with_settings(tmp_path / f"r{k}", **names)
    ((by, _, series),) = panels_in(tmp_path)
    assert by == "variant"
    assert len(series) == 3
    assert all(len(name) < 150 for name in series)


def test_a_shaping_is_not_a_run_of_its_last_stage(tmp_path):
    write_shaping(tmp_path / "shaped", [(3, 3), (3, 3)])
    write_run(tmp_path / "run", 3, world="rover-v2/complex-2", generations=3)
    titles = [panel["task"] for panel in Watched(folders=[tmp_path]).snapshot()["panels"]]
    assert titles == ["rover-v2/complex-2", "rover-v2/complex-1 to complex-2"]
    assert panels_in(tmp_path) == [
        ("method", "", {"cone": ["run"]}),
        ("method", "", {"cone": ["shaped"]}),
    ]


def begun_with(path, digit):
    """Return the origin of a run."""
    return {"path": path, "run_id": "0" * 12, "generation": 9, "checkpoint": digit * 32}


def test_runs_from_other_origins_have_their_own_medians(tmp_path):
    begun = [("a", 1, "A", "a"), ("b", 2, "A", "a"), ("c", 1, "B", "b")]
    for name, seed, origin, checkpoint in begun:
        about = {"origin": begun_with(f"runs/{origin}", checkpoint)}
        write_run(tmp_path / name, 2, seed=seed, about=about)
    champion = begun_with("runs/A", "c") | {"of": "champion"}
    write_run(tmp_path / "d", 2, about={"origin": champion})
    write_run(tmp_path / "e", 2)
    assert panels_in(tmp_path) == [
        (
            "variant",
            "",
            {
                "from=A (aaaaaa)": ["a", "b"],
                "from=B (bbbbbb)": ["c"],
                "from=champion of A (cccccc)": ["d"],
                "no from": ["e"],
            },
        )
    ]


def test_runs_by_other_code_have_their_own_medians_once_they_have_started(tmp_path):
    sessions = {name: [session(conevo="0.2", code=name)] for name in "xy"}
    for name, made in (("a", "x"), ("b", "x"), ("c", "y")):
        write_run(tmp_path / name, 2, about={"sessions": sessions[made]})
    write_run(tmp_path / "d", 2, about={"sessions": sessions["x"] + sessions["y"] * 2})
    assert panels_in(tmp_path)[0][2] == {
        "code=0.2 (x)": ["a", "b"],
        "code=0.2 (y)": ["c"],
        "code=0.2 (x) + 0.2 (y)": ["d"],
    }
    assert differences(["cone"] * 2, [(("run.code", "x"),), ()]) == [{}, {}]


def test_factors_of_some_runs_of_a_plan_are_compared_with_the_others():
    parts = [levels_of(v) for v in ("", "gst=0.1", "gst=0.2", "gst=0.1", "")]
    assert comparisons(parts) == [("gst=0.1", [0, 1, 3, 4]), ("gst=0.2", [0, 2, 4])]
    parts = [levels_of(v) for v in ("n=1", "n=2", "n=1, gst=0.1", "n=2, gst=0.1")]
    assert [members for _, members in comparisons(parts)] == [[0, 2], [1, 3]]
    assert comparisons([{}, {}]) == [("", [0, 1])]
