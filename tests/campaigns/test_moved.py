"""A campaign has copies of its files and records its code: moved, without originals, other code."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import duckdb
import pytest

from campaigns.plans import write_plan
from conevo.campaigns.campaign import Campaign, create
from conevo.campaigns.executors.registry import make_executor
from conevo.campaigns.plan_file import read_plan
from conevo.campaigns.tables import Tables
from conevo.cli.main import main
from conevo.errors import UsageError
from conevo.report.sections.overview import overview
from conevo.runs.code import current_code
from conevo.runs.run import Run
from conevo.runs.store import Store
from conevo.worlds.pursuit import prey_sets

pytest_plugins = ["report.quick_figures"]

LIGHT = Path(__file__).parents[2] / "examples" / "light.py"
SHIPPED = Path(prey_sets.__file__).parent / prey_sets.SHIPPED
OTHER = "0.9.0 (abc123abc123)"


def carried_out(campaign: Campaign) -> list[str]:
    return [one.state for one in campaign.carry_on(make_executor("serial", 1)).values()]


def light_plan(folder: Path, head: str = "studies = []") -> Path:
    """Write the plan of a campaign in a world of one's own, next to it."""
    path = write_plan(folder, head)
    (folder / "light.py").write_text(LIGHT.read_text())
    path.write_text(path.read_text().replace("rover/complex-1", "light.py:dark-1"))
    return path


def test_a_moved_campaign_continues_without_the_files_of_its_plan(tmp_path: Path) -> None:
    plan = read_plan(light_plan(tmp_path / "plans"))
    made = create(plan.at(seeds=1), tmp_path / "made")
    assert carried_out(made) == ["finished", "finished"]
    shutil.rmtree(tmp_path / "plans")
    moved = Campaign(shutil.move(made.path, tmp_path / "moved"))
    text = (moved.path / "plan.toml").read_text() + (moved.path / "runs.jsonl").read_text()
    assert "inputs/light.py:dark-1" in text
    assert str(tmp_path) not in text
    longer = create(moved.plan.at(seeds=2), moved.path)
    assert carried_out(longer) == ["finished"] * 4
    runs = [Run(longer.paths.run(label)) for label in longer.planned]
    assert {run.outline.task for run in runs} == {"light-v1/dark-1"}
    assert all((run.path / "inputs" / "light.py").is_file() for run in runs)


def test_tables_and_reports_run_no_world_file(
    without_ink: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = create(read_plan(light_plan(tmp_path / "plans")).at(seeds=1), tmp_path / "made")
    carried_out(made)
    shutil.rmtree(made.paths.tables)
    for file in (made.path / "inputs" / "light.py", *made.path.glob("runs/*/inputs/light.py")):
        file.write_text("raise SystemExit")
    again = Campaign(made.path)
    again.seal()
    rows = duckdb.sql(
        f"SELECT task, n_robots, measure, code, changes FROM '{made.paths.tables}/runs.parquet'"
    ).fetchall()
    code = current_code().partition("(")[2].rstrip(")")
    assert rows == [("light-v1/dark-1", 3, "nearness", code, "")] * 2
    with pytest.raises(SystemExit, match="0"):
        main(["report", str(made.path)])
    capsys.readouterr()
    with pytest.raises(SystemExit, match="0"):
        main(["campaign", "status", str(made.path)])
    assert "\nlight.py:dark-1  " in capsys.readouterr().out


def test_a_factor_of_prey_files_is_kept_by_their_names(tmp_path: Path) -> None:
    path = write_plan(tmp_path / "plans", "studies = []", '"world.prey" = ["random", "own.npz"]')
    path.write_text(
        path.read_text()
        .replace("rover/complex-1", "pursuit/team-1")
        .replace('"homcne", "cone"', '"homcne"')
    )
    shutil.copy(SHIPPED, tmp_path / "plans" / "own.npz")
    made = create(read_plan(path).at(seeds=1), tmp_path / "made")
    shutil.rmtree(tmp_path / "plans")
    moved = Campaign(shutil.move(made.path, tmp_path / "moved"))
    assert [run.variant for run in moved.planned.values()] == ["prey=random", "prey=own.npz"]
    assert [run.overrides["world.prey"] for run in moved.planned.values()] == [
        "random",
        str(moved.path / "inputs" / "own.npz"),
    ]
    assert carried_out(moved) == ["finished", "finished"]
    assert create(moved.plan.at(seeds=2), moved.path).planned.keys() > moved.planned.keys()


def test_a_plan_made_in_python_names_files_relative_to_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = read_plan(light_plan(tmp_path / "plans")).at(seeds=1)
    monkeypatch.chdir(tmp_path / "plans")
    here = plan.mapped(lambda v: v.replace(f"{tmp_path}/plans/", "") if isinstance(v, str) else v)
    assert here.factors["world"] == ("light.py:dark-1",)
    made = create(here.at(), tmp_path / "made")
    shutil.rmtree(tmp_path / "plans")
    assert made.plan.factors["world"] == (f"{made.path}/inputs/light.py:dark-1",)
    assert Campaign(made.path).plan.write_out() == list(made.planned.values())


def started_by_another(folder: Path) -> Campaign:
    """Make a campaign of which another version made one half."""
    made = create(read_plan(write_plan(folder / "plans", "studies = []")), folder / "made")
    carried_out(made)
    made.paths.code.write_text(json.dumps({"codes": [OTHER]}))
    shutil.rmtree(made.paths.tables)
    first, *_, last = made.planned
    shutil.rmtree(made.paths.run(last))
    file = made.paths.run(first) / "provenance.json"
    about: dict[str, Any] = json.loads(file.read_text())
    for one in (about, *about["sessions"]):
        one |= {"conevo": "0.9.0", "code": "abc123abc123"}
    file.write_text(json.dumps(about))
    Store(file.parent).seal()
    return Campaign(made.path)


def test_other_code_does_not_continue_a_campaign_unless_it_is_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = started_by_another(tmp_path)
    here = current_code()
    with pytest.raises(UsageError, match=r"was started by conevo .*abc123.*--accept-other-code"):
        carried_out(made)
    for verb in ("start", "retry", "slurm"):
        with pytest.raises(SystemExit, match="2"):
            main(["campaign", verb, str(made.path)])
        assert "--accept-other-code" in capsys.readouterr().err
    start = ["campaign", "start", str(made.path), "--executor", "serial", "--quiet"]
    with pytest.raises(SystemExit, match="0"):
        main([*start, "--accept-other-code"])
    assert json.loads(made.paths.code.read_text()) == {"codes": [OTHER, here]}
    with pytest.raises(SystemExit, match="0"):
        main(start)
    with Tables(made.paths.tables) as tables:
        text = " ".join(overview(tables, made).text)
    assert "runs of rover-v2/complex-1 that are compared here were made by different code" in text


def test_a_campaign_of_the_first_release_is_other_code(tmp_path: Path) -> None:
    made = started_by_another(tmp_path)
    made.paths.code.unlink()
    file = next(made.path.glob("runs/*/provenance.json"))
    about = json.loads(file.read_text())
    del about["code"]
    about["conevo"], about["sessions"] = "0.1.0", []
    file.write_text(json.dumps(about))
    with pytest.raises(UsageError, match=r"started by conevo 0\.1\.0 \(code not recorded\)"):
        made.admit_code()
    made.admit_code(accept=True)
    made.admit_code()
