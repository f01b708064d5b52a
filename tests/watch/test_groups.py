import json
import time

import pytest

from conevo.campaigns.campaign import Campaign
from conevo.watch.state import Watched
from conevo.worlds.rover import drawn as rover
from watch.followed import append, locked, record, write_campaign, write_run


def by_label(watched):
    return {run["label"]: run for run in watched.snapshot()["runs"]}


@pytest.fixture
def campaign(tmp_path):
    made = write_campaign(tmp_path / "three")
    made.ledger.enrol(made.planned)
    return made


def labels_of(campaign):
    return list(campaign.planned)


def test_runs_of_a_campaign_are_listed_from_its_ledger_and_their_files(campaign):
    homcne_1, mesp_1, homcne_2, _ = labels_of(campaign)
    write_run(campaign.paths.run(homcne_1), 4, is_finished=True, method="homcne", generations=4)
    campaign.ledger.end(homcne_1, "finished", core_seconds=8.0)
    plan_run(campaign, homcne_1)
    write_run(campaign.paths.run(mesp_1), 2, method="mesp", generations=4)
    campaign.ledger.begin(mesp_1, 1, time.time() - 3.0)
    campaign.ledger.end(homcne_2, "failed", "out of luck")
    watched = Watched([campaign.path])
    with locked(campaign.path):
        for _ in range(3):
            state = watched.snapshot()
    assert [run["status"] for run in state["runs"]] == ["finished", "running", "failed", "pending"]
    assert state["runs"][2]["reason"] == "out of luck"
    assert state["runs"][3]["method"] == "mesp"  # by the plan
    (group,) = state["groups"]
    assert group["counts"] == {"finished": 1, "running": 1, "failed": 1, "pending": 1}
    assert (group["title"], group["running"]) == ("Two methods, two seeds", True)
    # 8 seconds for each run, one core, three of them over
    assert group["ends_at"] - time.time() == pytest.approx(8 - 3 + 8, abs=1.0)
    state = watched.snapshot()  # the coordinator has ended
    assert [run["status"] for run in state["runs"]] == [
        "finished",
        "interrupted",
        "failed",
        "pending",
    ]
    assert (state["groups"][0]["running"], state["groups"][0]["ends_at"]) == (False, None)
    with locked(campaign.paths.run(mesp_1)):  # a worker that outlived it
        assert watched.snapshot()["runs"][1]["status"] == "running"


def plan_run(campaign, label):
    """Make a run match the one that is planned."""
    file = campaign.paths.run(label) / "provenance.json"
    about = json.loads(file.read_text()) | {"run_id": campaign.planned[label].run_ids[0]}
    file.write_text(json.dumps(about | {"finished": "now", "stopped_by": "generations"}))


def test_a_finished_run_that_is_not_in_the_ledger_yet_is_finished(campaign):
    label = labels_of(campaign)[0]
    watched = Watched([campaign.path])
    assert by_label(watched)[label]["status"] == "pending"
    path = write_run(campaign.paths.run(label), 4, method="homcne", generations=4)
    assert by_label(watched)[label]["status"] == "interrupted"
    plan_run(campaign, label)
    (path / "DONE").write_text("{}")
    watched.snapshot()
    assert by_label(watched)[label]["status"] == "finished"


@pytest.mark.parametrize("name", ["runs.jsonl", "plan.toml", "ledger.sqlite"])
def test_a_damaged_campaign_is_one_line_and_comes_back(campaign, name):
    write_run(campaign.path.parent / "run")
    good = (campaign.path / name).read_bytes()
    watched = Watched([campaign.path, campaign.path.parent / "run"])
    assert len(watched.snapshot()["runs"]) == 5
    (campaign.path / name).write_bytes(b"what? " * 1000)
    state = watched.snapshot()
    problems = {group["kind"]: group["problem"] for group in state["groups"]}
    assert name in problems["campaign"]
    assert problems["runs"] == ""
    assert "run" in by_label(watched)
    (campaign.path / name).write_bytes(good)
    state = watched.snapshot()
    assert (state["groups"][1]["problem"], len(state["runs"])) == ("", 5)


def test_runs_that_lie_elsewhere_are_not_followed(campaign, tmp_path):
    (tmp_path / "scratch").mkdir()
    (campaign.path / "runs").symlink_to(tmp_path / "scratch")
    (group,) = Watched([campaign.path]).snapshot()["groups"]
    assert "is a link, and links are not followed" in group["problem"]


def test_methods_are_compared_by_medians_over_team_evaluations(tmp_path):
    values = {"a": [1.0, 5.0, 9.0], "b": [3.0, 6.0], "c": [8.0, 7.0]}
    for name, column in values.items():
        path = write_run(tmp_path / name, 0, method="mesp", budget=400, is_finished=name == "c")
        append(path, *(record(k, performance={"value": v}) for k, v in enumerate(column)))
    write_run(tmp_path / "d", 1, method="cone", budget=400)
    broken = write_run(tmp_path / "e", 3, method="mesp", budget=400, torn="what?\n")
    assert broken.is_dir()
    (panel,) = Watched(folders=[tmp_path]).snapshot()["panels"]
    assert (panel["task"], panel["by"], panel["measure"]) == (
        "rover-v2/complex-1",
        "method",
        "value",
    )
    curves = panel["over"]["evaluations"]
    assert (curves["x"][0], curves["x"][-1], len(curves["x"])) == (0.0, 400.0, 300)
    assert [line["label"] for line in curves["lines"]] == ["a", "b", "c", "d"]  # none of "e"
    mesp = {one["series"]: one for one in curves["medians"]}["mesp"]
    median, of = mesp["performance"], mesp["performance_runs"]
    at = {x: next(k for k, g in enumerate(curves["x"]) if g >= x) for x in (100, 200, 300)}
    assert curves["lines"][0]["performance"][at[300]] == 9.0
    assert curves["lines"][1]["performance"][at[200] : at[200] + 2] == [6.0, None]
    assert median[at[100] - 1] is None  # nothing has ended there
    assert [median[at[x]] for x in (100, 200)] == [3.0, 6.0]
    # b has not reached this point; c has ended, and its curve ends there too
    assert curves["lines"][2]["performance"][at[300]] is None
    assert median[at[300]] is None
    assert [of[at[x]] for x in (100, 200, 300)] == [3, 3, 1]
    assert median[-1] is None
    row = next(row for row in panel["rows"] if row["series"] == "mesp")
    assert (row["of"], row["status"]) == (4, {"interrupted": 2, "finished": 1, "damaged": 1})
    assert (row["performance"], row["lowest"], row["highest"]) == (7.0, 6.0, 9.0)


def test_presets_and_environments_are_never_mixed(tmp_path):
    write_run(tmp_path / "a")
    write_run(tmp_path / "b", run__preset="night")
    write_run(tmp_path / "c", world="rover-v2/complex-2")
    panels = Watched(folders=[tmp_path]).snapshot()["panels"]
    assert [(p["task"], p["preset"]) for p in panels] == [
        ("rover-v2/complex-1", "desk"),
        ("rover-v2/complex-1", "night"),
        ("rover-v2/complex-2", "desk"),
    ]


def test_colours_of_methods_and_castes_do_not_depend_on_the_other_runs(tmp_path):
    path = write_run(tmp_path / "a", method="new", n=0)
    append(path, record(0, castes={"hi": 1, "odd": 1, "non-specialized": 1}))
    state = Watched([path]).snapshot()
    castes = state["castes"]["rover-v2"]
    assert castes["hi"] == rover.ACTIONS["hi"]  # as in its replay
    assert list(castes) == ["low", "med", "hi", "move", "odd", "non-specialized"]
    assert len(set(castes.values())) == 6
    assert state["methods"]["new"]["title"] == "new"
    colours = [entry["colour"] for entry in state["methods"].values()]
    assert len(set(colours)) == len(colours)
    assert (
        state["methods"]["cone"]
        == Watched([write_run(tmp_path / "b")]).snapshot()["methods"]["cone"]
    )


DAMAGE = {
    "nested": b"[" * 100_000 + b"\n",
    "nested toml": b"a = " + b"[" * 100_000 + b"\n",
    "nested deeper": b'{"a":' * 100_000 + b"\n",
    "null": b"null\n",
    "list": b"[1, 2]\n",
    "wrong keys": b'{"labl": 3}\n',
    "utf-16": "{}\n".encode("utf-16"),
    "random": bytes(range(256)) * 50,
    "empty": b"",
    "huge number": b'{"generation": ' + b"9" * 5000 + b"}\n",
}


@pytest.mark.parametrize("content", DAMAGE.values(), ids=DAMAGE)
@pytest.mark.parametrize("name", ["runs.jsonl", "plan.toml", "ledger.sqlite"])
def test_a_damaged_campaign_is_named_and_all_others_are_shown(campaign, name, content):
    folder = campaign.path.parent
    write_run(folder / "run")
    write_campaign(folder / "other")
    (campaign.path / name).write_bytes(content)
    state = Watched(folders=[folder]).snapshot()
    json.dumps(state, allow_nan=False)
    problems = {group["name"]: group["problem"] for group in state["groups"]}
    assert problems.pop(campaign.path.name) or (name, content) == ("ledger.sqlite", b"")
    assert set(problems.values()) == {""}
    labels = {run["label"] for run in state["runs"]}
    assert {"run", "other/rover-v2-complex-1-mesp-s2"} <= labels


@pytest.mark.parametrize("content", DAMAGE.values(), ids=DAMAGE)
@pytest.mark.parametrize("name", ["config.toml", "generations.jsonl"])
def test_a_damaged_run_is_named_and_all_others_are_shown(tmp_path, name, content):
    write_run(tmp_path / "good")
    write_run(tmp_path / "bad")
    (tmp_path / "bad" / name).write_bytes(content)
    state = Watched(folders=[tmp_path]).snapshot()
    json.dumps(state, allow_nan=False)
    problems = {run["label"]: run["problem"] for run in state["runs"]}
    assert problems["good"] == ""
    assert problems["bad"] or (name, content) == ("generations.jsonl", b"")


def test_an_error_in_one_place_leaves_all_others_shown(campaign, monkeypatch):
    write_run(campaign.path.parent / "run")
    watched = Watched([campaign.path, campaign.path.parent / "run"])
    monkeypatch.setattr(Campaign, "standings", lambda self: 1 / 0)
    state = watched.snapshot()
    problems = {group["kind"]: group["problem"] for group in state["groups"]}
    assert problems == {"runs": "", "campaign": "is damaged: ZeroDivisionError('division by zero')"}
    monkeypatch.setattr("conevo.watch.groups.panels_of", lambda *_: 1 / 0)
    watched = Watched([campaign.path, campaign.path.parent / "run"])
    for group in watched.snapshot()["groups"]:
        assert group["problem"].startswith("cannot be shown: ZeroDivisionError")
