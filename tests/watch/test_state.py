import hashlib
import json
import math
import os
import shutil

import pytest

from conevo.cli.lookup import open_directory
from conevo.errors import EnvironmentFailure, UsageError
from conevo.runs.directory import kinds_in
from conevo.runs.durable import is_there
from conevo.watch.state import Watched
from watch.followed import (
    append,
    locked,
    record,
    tables,
    write_campaign,
    write_run,
    write_shaping,
)


def one(watched):
    """Return the only run of a snapshot."""
    (run,) = watched.snapshot()["runs"]
    return run


def by_label(watched):
    return {run["label"]: run for run in watched.snapshot()["runs"]}


def test_a_run_is_listed_with_the_contents_of_its_files(tmp_path):
    run = one(Watched([write_run(tmp_path / "a run", budget=1000)]))
    assert {key: run[key] for key in ("label", "task", "method", "preset", "seed")} == {
        "label": "a run",
        "task": "rover-v2/complex-1",
        "method": "cone",
        "preset": "desk",
        "seed": 1,
    }
    assert (run["status"], run["problem"], run["reason"]) == ("interrupted", "", "")
    assert (run["generation"], run["generations"], run["share"]) == (3, 10, 0.3)
    assert (run["evaluations"], run["budget"], run["seconds"]) == (300, 1000, 6.0)
    assert run["performance"] == {"value": 3.0, "area": 0.5}
    assert (run["fitness"], run["best"], run["specialization"]) == (12.0, 22.0, 0.25)
    assert (run["sst"], run["gst"], run["castes"]) == (0.5, 0.2, {"low": 2, "non-specialized": 1})
    assert (run["favourites"], run["favourite_share"]) == ({"low": 2, "hi": 1}, 0.75)
    assert run["champion"] == 2


def test_a_log_of_an_earlier_version_has_no_favourites(tmp_path):
    path = write_run(tmp_path / "run", 0)
    later = record(1, favourites={"med": 1}, favourite_share=0.5)
    old = {key: value for key, value in record(0).items() if "favourite" not in key}
    append(path, old)
    run = one(watched := Watched([path]))
    assert (run["status"], run["favourites"], run["favourite_share"]) == ("interrupted", {}, None)
    append(path, later)
    run = one(watched)
    assert (run["favourites"], run["favourite_share"]) == ({"med": 1}, 0.5)
    assert watched.details("run")["columns"]["favourite_share"] == [None, 0.5]


def test_details_have_every_generation(tmp_path):
    path = write_run(tmp_path / "run", 2)
    append(path, record(2, performance={"value": None}, castes={"hi": 3}, sst=None))
    watched = Watched([path])
    watched.snapshot()
    found = watched.details("run")
    assert found["number"] == [0, 1, 2]
    assert found["columns"]["team_fitness"] == [10.0, 11.0, 12.0]
    assert found["columns"]["sst"] == [0.5, 0.5, None]
    assert found["columns"]["neurons"] == [10.0, 10.0, 10.0]
    assert found["measures"] == {"value": [1.0, 2.0, None], "area": [0.5, 0.5, None]}
    assert found["robots"] == {
        "low": [2, 2, 0],
        "non-specialized": [1, 1, 0],
        "hi": [0, 0, 3],
    }
    assert found["status"] == "interrupted"
    with pytest.raises(UsageError, match="no run here is called 'other'"):
        watched.details("other")


def test_units_and_directions_are_those_that_the_provenance_declares(tmp_path):
    path = write_run(tmp_path / "run", 2)
    watched = Watched([path])
    (panel,) = watched.snapshot()["panels"]
    assert (panel["about"], panel["larger_is_better"]) == ("larger is better", True)
    assert one(watched)["declared"] == {}

    declared = {"name": "value", "unit": "cm", "larger_is_better": False}
    header = {"name": "rover-v2", "environment": "complex-1", "castes": [], "n_robots": 3}
    header |= {"measures": [declared], "iterations": 10, "optimum": None}
    other = write_run(tmp_path / "other", 2, about={"world": header})
    watched = Watched([other])
    (panel,) = watched.snapshot()["panels"]
    assert (panel["measure"], panel["about"]) == ("value", "cm, smaller is better")
    assert panel["larger_is_better"] is False
    assert one(watched)["declared"] == {"value": "cm, smaller is better"}


@pytest.mark.parametrize("content", ["", "[]", "{", '{"world": 1}', "{}", "[" * 50_000])
def test_a_damaged_provenance_is_one_line(tmp_path, content):
    path = write_run(tmp_path / "run", 2)
    good = (path / "provenance.json").read_text()
    (path / "provenance.json").write_text(content)
    watched = Watched([path])
    run = one(watched)
    assert (run["status"], run["declared"]) == ("damaged", {})
    assert run["problem"].startswith("provenance.json is damaged: ")
    (path / "provenance.json").write_text(good)
    assert (one(watched)["problem"], one(watched)["generation"]) == ("", 2)


def test_a_run_that_may_not_be_read_is_one_line_and_other_runs_are_shown(tmp_path, monkeypatch):
    bad, _ = write_run(tmp_path / "bad"), write_run(tmp_path / "good")

    def may_enter(path):
        if path.parent == bad:
            raise PermissionError(path)
        return is_there(path)

    monkeypatch.setattr("conevo.runs.directory.is_there", may_enter)
    runs = by_label(Watched([], [tmp_path]))
    assert (runs["good"]["status"], runs["good"]["problem"]) == ("interrupted", "")
    assert runs["bad"]["status"] == "damaged"
    assert runs["bad"]["problem"].endswith("bad: this process may not read the directory")
    rows = {path.name: kind for path, kind in kinds_in(tmp_path).items()}
    assert rows == {"good": "run", "bad": "unreadable"}
    with pytest.raises(EnvironmentFailure, match="may not read the directory"):
        open_directory(bad)


def test_very_many_generations_are_thinned_evenly_and_the_first_and_last_stay(tmp_path):
    path = write_run(tmp_path / "run", 5003, generations=6000)
    watched = Watched([path])
    lines = watched.snapshot()["panels"][0]["over"]["generation"]
    assert len(lines["x"]) == 300
    assert lines["lines"][0]["performance"][-1] == 5003.0
    found = watched.details("run")
    assert len(found["number"]) == 2000
    assert (found["number"][0], found["number"][-1]) == (0, 5002)
    assert {b - a for a, b in zip(found["number"], found["number"][1:], strict=False)} == {2, 3}
    assert found["measures"]["value"] == [1.0 + k for k in found["number"]]


def test_a_torn_last_line_does_not_count_until_it_is_whole(tmp_path):
    line = json.dumps(record(3)) + "\n"
    path = write_run(tmp_path / "run", torn=line[:50])
    watched = Watched([path])
    assert (one(watched)["generation"], one(watched)["problem"]) == (3, "")
    append(path, torn=line[50:])
    assert (one(watched)["generation"], one(watched)["problem"]) == (4, "")


def damaged(**changes):
    return json.dumps(record(3, **changes)) + "\n"


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("what?\n", "Expecting value"),
        ("[1]\n", "an object expected"),
        ("null\n", "an object expected"),
        ('{"generation": 3}\n', "team_evaluations is missing"),
        (json.dumps(record(4)) + "\n", "generation 3 expected"),
        (damaged(seconds="2"), "seconds = '2': must be a valid number"),
        (damaged(seconds=None), "seconds = None: must be a valid number"),
        (damaged(seconds=math.nan), "NaN is not a finite number"),
        (damaged(team_evaluations=-1), "team_evaluations = -1: must be greater than or equal to 0"),
        (damaged(castes={"low": "two"}), "castes.low = 'two': must be a valid integer"),
        (damaged(favourites={"low": "two"}), "favourites.low = 'two': must be a valid integer"),
        (damaged(favourite_share="1"), "favourite_share = '1': must be a valid number"),
        (damaged(performance=[1]), "performance = [1]: must be a valid dictionary"),
        (damaged(n_hidden=3), "n_hidden = 3: must be a valid list"),
        (damaged(seconds=10**400), "is beyond 64 bits"),
        ("[" * 100_000 + "\n", "nested too deeply"),
    ],
)
def test_a_damaged_line_is_one_line_and_other_runs_are_shown(tmp_path, line, why):
    path = write_run(tmp_path / "bad", torn=line)
    append(path, record(4))
    good = write_run(tmp_path / "good")
    watched = Watched([path, good])
    runs = by_label(watched)
    assert runs["bad"]["status"] == "damaged"
    assert runs["bad"]["problem"].startswith("generations.jsonl is damaged in line 4: ")
    assert why in runs["bad"]["problem"]
    assert "\n" not in runs["bad"]["problem"]
    assert runs["bad"]["generation"] == 3
    assert (runs["good"]["status"], runs["good"]["problem"]) == ("interrupted", "")
    assert len(watched.details("bad")["number"]) == 3
    (path / "generations.jsonl").unlink()
    append(path, record(0))
    assert (by_label(watched)["bad"]["problem"], by_label(watched)["bad"]["generation"]) == ("", 1)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"[run", "config.toml is not valid TOML: "),
        (b"\xff", "config.toml is not valid TOML: "),
        (b"", "config.toml is damaged: it has no table [run]"),
        (b"[run]\nworld = 'w'\n", "config.toml is damaged: run.method must be text"),
        (b"run = 3", "config.toml is damaged: "),
        (b"#" * (2 * 2**20 + 1), "config.toml is too large"),
    ],
)
def test_a_damaged_configuration_is_one_line(tmp_path, content, why):
    path = write_run(tmp_path / "run")
    good = (path / "config.toml").read_bytes()
    (path / "config.toml").write_bytes(content)
    watched = Watched([path])
    assert one(watched)["status"] == "damaged"
    assert one(watched)["problem"].startswith(why)
    (path / "config.toml").write_bytes(good)
    assert (one(watched)["problem"], one(watched)["generation"]) == ("", 3)


def test_settings_of_the_wrong_kind_are_damage(tmp_path):
    path = write_run(tmp_path / "run")
    text = (path / "config.toml").read_text()
    for wrong in (
        text.replace("= 10", "= 0"),
        text.replace("= 10", "= -1"),
        text.replace("= 10", "= 1" + "0" * 400),
        text.replace('"cone"', "7"),
    ):
        (path / "config.toml").write_text(wrong)
        assert one(Watched([path]))["problem"].startswith("config.toml is damaged: run.")


def test_only_appended_lines_are_read(tmp_path):
    path = write_run(tmp_path / "run")
    watched = Watched([path])
    one(watched)
    log = path / "generations.jsonl"
    with log.open("r+b") as file:  # the same file: the part already read is not read again
        file.write(b"x" * 20)
    append(path, record(3))
    assert (one(watched)["generation"], one(watched)["problem"]) == (4, "")
    assert watched.details("run")["columns"]["team_fitness"] == [10.0, 11.0, 12.0, 13.0]


def test_a_log_that_is_replaced_or_cut_is_read_again(tmp_path):
    path = write_run(tmp_path / "run", 5)
    watched = Watched([path])
    assert one(watched)["generation"] == 5
    log = path / "generations.jsonl"
    lines = log.read_bytes().splitlines(keepends=True)
    (path / "new").write_bytes(b"".join(lines[:4]))
    os.replace(path / "new", log)  # as a run that is resumed from an older checkpoint does
    assert one(watched)["generation"] == 4
    append(path, record(4, team_fitness=99.0))
    assert one(watched)["fitness"] == 99.0
    os.truncate(log, len(lines[0]))
    assert one(watched)["generation"] == 1
    log.unlink()
    assert (one(watched)["generation"], one(watched)["champion"]) == (0, None)


def test_nothing_changes_while_no_file_does(tmp_path):
    path = write_run(tmp_path / "run")
    watched = Watched([path])
    first = watched.snapshot()
    assert watched.snapshot() is first
    append(path, record(3))
    second = watched.snapshot()
    assert second["version"] == first["version"] + 1
    assert watched.snapshot() is second


def test_status(tmp_path):
    path = write_run(tmp_path / "run")
    watched = Watched([path])
    assert one(watched)["status"] == "interrupted"
    with locked(path):
        assert one(watched)["status"] == "running"
        assert one(watched)["status"] == "running"  # reading has not taken the lock
    assert one(watched)["status"] == "interrupted"
    (path / "DONE").write_text("{}")
    assert (one(watched)["status"], one(watched)["share"]) == ("finished", 1.0)


def test_reading_leaves_the_lock_to_others(tmp_path):
    path = write_run(tmp_path / "run")
    (path / "lock").touch()
    one(Watched([path]))
    with locked(path):
        pass


def test_time_left_is_judged_by_the_last_ten_generations(tmp_path):
    path = write_run(tmp_path / "run", 0, generations=40)
    append(path, *(record(k, seconds=100.0 if k < 10 else 3.0) for k in range(20)))
    os.utime(path / "generations.jsonl", (1000, 1000))
    watched = Watched([path])
    assert one(watched)["ends_at"] is None  # no process is running
    with locked(path):
        assert one(watched)["ends_at"] == 1000 + 20 * 3.0


def test_time_left_ends_with_the_budget(tmp_path):
    path = write_run(tmp_path / "run", 4, generations=1000, budget=750)  # 100 a generation
    os.utime(path / "generations.jsonl", (1000, 1000))
    with locked(path):
        run = one(Watched([path]))
    assert run["ends_at"] == 1000 + 3 * 2.0  # the eighth generation cannot be paid
    assert run["share"] == pytest.approx(400 / 750, abs=1e-4)


def test_no_time_left_is_shown_before_the_first_generation(tmp_path):
    path = write_run(tmp_path / "run", 0)
    with locked(path):
        run = one(Watched([path]))
    assert (run["status"], run["ends_at"], run["performance"]) == ("running", None, {})
    watched = Watched([path])
    watched.snapshot()
    with pytest.raises(UsageError, match="run has no finished generation yet"):
        watched.champion("run")


def test_the_champion_is_the_fittest_team_and_ties_go_to_the_earlier_one(tmp_path):
    path = write_run(tmp_path / "run", 0)
    fitness = [None, 3.0, 7.0, 7.0, None, 1.0]
    append(path, *(record(k, team_fitness=value) for k, value in enumerate(fitness)))
    watched = Watched([path])
    assert one(watched)["champion"] == 2
    assert watched.champion("run") == (path, 2)


def test_generations_are_numbered_through_all_stages(tmp_path):
    path = write_shaping(tmp_path / "shaping", [(3, 3), (4, 2), (5, None)])
    os.utime(path / "stage-2" / "generations.jsonl", (2000, 2000))
    os.utime(path / "stage-1" / "generations.jsonl", (1000, 1000))
    watched = Watched([path])
    with locked(path):
        run = one(watched)
    assert (run["kind"], run["stage"], run["n_stages"]) == ("shaping", 2, 3)
    assert (run["generation"], run["generations"], run["evaluations"]) == (5, 12, 500)
    assert run["task"] == "rover-v2/complex-1 to complex-3"
    assert (run["champion_stage"], run["champion"]) == (2, 1)
    assert run["share"] == pytest.approx((1 + 2 / 4 + 0) / 3, abs=1e-4)
    assert run["ends_at"] == 2000 + (2 + 5) * 2.0
    found = watched.details("shaping")
    assert found["number"] == [0, 1, 2, 3, 4]
    assert found["measures"]["value"] == [1.0, 2.0, 3.0, 1.0, 2.0]
    assert found["stages"] == [
        {"stage": 1, "task": "rover-v2/complex-1", "first": 0},
        {"stage": 2, "task": "rover-v2/complex-2", "first": 3},
    ]
    curves = watched.snapshot()["panels"][0]["over"]["evaluations"]
    at = curves["x"].index(500.0)
    assert curves["lines"][0]["performance"][at] == 2.0
    assert watched.champion("shaping") == (path / "stage-2", 1)
    write_run(path / "stage-3", 0)
    assert one(watched)["stage"] == 3
    assert watched.champion("shaping") == (path / "stage-2", 1)


def test_runs_appear_and_go_in_a_folder(tmp_path):
    folder = tmp_path / "runs"
    watched = Watched(folders=[folder])
    assert watched.snapshot()["runs"] == []  # the folder does not exist yet
    write_run(folder / "b")
    write_run(folder / ".a.draft")
    (folder / "other").mkdir()
    (folder / "file").touch()
    assert list(by_label(watched)) == ["b"]
    write_shaping(folder / "a", [(3, 1)])
    write_campaign(folder / "c")
    assert list(by_label(watched))[:3] == ["a", "b", "c/rover-v2-complex-1-homcne-s1"]
    shutil.rmtree(folder / "b")
    shutil.rmtree(folder / "c")
    assert list(by_label(watched)) == ["a"]
    write_run(folder / "b", 1)
    assert by_label(watched)["b"]["generation"] == 1


def test_a_run_that_was_named_and_goes_away_is_one_line(tmp_path):
    path = write_run(tmp_path / "run")
    watched = Watched([path])
    one(watched)
    shutil.rmtree(path)
    run = one(watched)
    assert (run["status"], run["problem"]) == ("damaged", "the run has been removed")
    assert run["generation"] == 0
    write_run(path, 1)
    assert (one(watched)["problem"], one(watched)["generation"]) == ("", 1)


def test_a_folder_without_runs_is_refused(tmp_path):
    with pytest.raises(UsageError, match="is not a run, a shaping or a campaign"):
        Watched([tmp_path])


def test_links_are_not_followed(tmp_path):
    secret = write_run(tmp_path / "elsewhere" / "secret")
    folder = tmp_path / "runs"
    mine = write_run(folder / "mine")
    (folder / "link").symlink_to(secret)
    runs = by_label(Watched(folders=[folder]))
    assert runs["link"]["problem"].startswith("is a link, and links are not followed")
    assert (runs["link"]["generation"], runs["link"]["champion"]) == (0, None)
    (mine / "generations.jsonl").unlink()
    (mine / "generations.jsonl").symlink_to(secret / "generations.jsonl")
    assert by_label(Watched(folders=[folder]))["mine"]["generation"] == 0
    shaping = write_shaping(folder / "shaping", [(3, None)])
    (shaping / "stage-1").symlink_to(secret)
    assert by_label(Watched(folders=[folder]))["shaping"]["generation"] == 0
    assert by_label(Watched([folder / "link"]))["secret"]["generation"] == 3  # named by the reader


def test_pipes_do_not_stop_the_page(tmp_path):
    path = write_run(tmp_path / "run")
    for name in ("generations.jsonl", "lock"):
        (path / name).unlink(missing_ok=True)
        os.mkfifo(path / name)
    run = one(Watched([path]))
    assert (run["status"], run["generation"]) == ("interrupted", 0)


def test_labels_are_different_and_can_be_written(tmp_path):
    paths = [write_run(tmp_path / k / "same") for k in "ab"]
    odd = tmp_path / os.fsdecode(b"\xff<b>\n")
    paths.append(write_run(odd))
    labels = [run["label"] for run in Watched(paths).snapshot()["runs"]]
    assert labels == ["same", "same (2)", "\\udcff<b>\n"]
    json.dumps(Watched(paths).snapshot(), ensure_ascii=False).encode()  # also the folders


def test_a_world_in_a_file_is_named_and_its_file_is_not_run(tmp_path):
    world = tmp_path / "light.py"
    world.write_text("raise SystemExit('run')")
    run = one(Watched([write_run(tmp_path / "run", world=f"{world}:bright")]))
    assert (run["task"], run["problem"]) == ("light.py:bright", "")


def test_numbers_are_always_json(tmp_path):
    path = write_run(tmp_path / "run", 0)
    append(path, record(0, team_fitness=None, performance={"value": None}, sst=None))
    for name in ("large", "larger"):  # whose sum is infinite
        append(write_run(tmp_path / name, 0, method="mesp"), record(0, team_fitness=1.7e308))
    watched = Watched(folders=[tmp_path])
    state = watched.snapshot()
    json.dumps([state, watched.details("run"), watched.details("large")], allow_nan=False)
    run = by_label(watched)["run"]
    assert (run["fitness"], run["performance"]) == (None, {"value": None})


def test_unread_runs_are_counted_and_read_next_time(tmp_path):
    paths = [write_run(tmp_path / k) for k in "abc"]
    watched = Watched(paths)
    state = watched.snapshot(patience=-1)
    assert state["reading"] == 3
    assert [run["generation"] for run in state["runs"]] == [0, 0, 0]
    state = watched.snapshot()
    assert state["reading"] == 0
    assert [run["generation"] for run in state["runs"]] == [3, 3, 3]


def test_nothing_is_written(tmp_path):
    write_run(tmp_path / "runs" / "run")
    write_shaping(tmp_path / "runs" / "shaping", [(3, 2)])
    campaign = write_campaign(tmp_path / "runs" / "campaign")
    campaign.ledger.enrol(campaign.planned)

    def digest():
        return {
            path: (path.lstat().st_mtime_ns, path.is_file() and _digest(path.read_bytes()))
            for path in tmp_path.rglob("*")
        }

    before = digest()
    watched = Watched(folders=[tmp_path / "runs"])
    for run in watched.snapshot()["runs"]:
        watched.details(run["label"])
    watched.snapshot()
    assert digest() == before


def _digest(content):
    return hashlib.blake2b(content).hexdigest()


def test_tables_are_those_of_real_runs():
    from conevo.runs.config import resolve

    real = resolve("rover/complex-1", "cone", "desk").tables()["run"]
    assert set(tables()["run"]) <= set(real)
    assert real["world"] == tables()["run"]["world"]
