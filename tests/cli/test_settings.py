"""Lists of presets and settings, and dry runs, which show a run without executing it."""

from __future__ import annotations

import json
import shlex
from dataclasses import fields
from pathlib import Path

import pytest

import conevo
from conevo.controllers.registry import CONTROLLERS
from conevo.evolution.methods.registry import METHODS
from conevo.runs.config import resolve
from conevo.runs.layers import PRESETS
from conevo.runs.settings import RunSettings, declared
from runs.tiny import command


@pytest.mark.parametrize("method", METHODS)
def test_every_setting_of_a_run_and_of_a_method_is_explained(method: str) -> None:
    parts = (RunSettings, METHODS[method].config_class)
    assert [one.name for part in parts for one in declared(part) if not one.meaning] == []


def test_a_setting_is_listed_with_its_declaration(say) -> None:
    rows = {row["setting"]: row for row in json.loads(
        say("list", "settings", "pursuit/team-3", "--method", "mesp", "--json").out)}  # fmt: skip
    config = resolve("pursuit/team-3", "mesp", "desk")
    parts = {"run": config.run, "world": config.world_params, "controller": config.controller}
    parts["method"] = config.method_config
    names = [f"{name}.{f.name}" for name in parts for f in fields(parts[name])]
    names.insert(names.index("controller.n_hidden"), "controller.name")
    assert list(rows) == names
    assert (rows["controller.name"]["value"], rows["controller.n_hidden"]["default"]) == ("srn", 6)
    for name, row in rows.items():
        section, _, key = name.partition(".")
        assert row["value"] == getattr(parts[section], key)
    assert rows["world.max_speed_cm"] == {
        "setting": "world.max_speed_cm",
        "value": 0.8,
        "default": 0.8,
        "unit": "cm per iteration",
        "allowed": "> 0, <= 5",
        "meaning": rows["world.max_speed_cm"]["meaning"],
    }
    assert rows["world.max_speed_cm"]["meaning"].startswith("speed of a predator at full command.")
    assert (rows["run.epochs"]["value"], rows["run.epochs"]["default"]) == (5, 10)
    assert rows["method.evaluation"]["allowed"] == "systematic, shared"
    assert rows["run.target"]["allowed"] == "number or left out"
    assert rows["run.seed"]["allowed"] == ">= 0"


def test_settings_as_text_keep_to_the_width_of_the_terminal(say, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "150")
    out = say("list", "settings", "rover/complex-1").out
    assert max(map(len, out.splitlines())) <= 150
    assert "method.fresh_rounds" in out
    assert " false " in out


def test_settings_of_your_own_world_are_listed(say) -> None:
    light = Path(__file__).parents[2] / "examples" / "light.py"
    rows = json.loads(say("list", "settings", f"{light}:dark-1", "--json").out)
    step = next(row for row in rows if row["setting"] == "world.step")
    assert (step["value"], step["allowed"]) == (0.01, "> 0, <= 0.1")
    assert (step["unit"], step["meaning"]) == ("side", "the largest step")


def test_presets_are_listed_with_their_purposes(say) -> None:
    rows = json.loads(say("list", "presets", "pursuit/team-3", "--method", "homcne", "--json").out)
    assert [row["preset"] for row in rows] == list(PRESETS)
    desk = resolve("pursuit/team-3", "homcne", "desk")
    assert rows[1]["genotypes"] == str(desk.method_config.genotypes)
    assert rows[1]["budget"] == f"{desk.run.budget_evaluations:,}"
    assert rows[0]["for"].startswith("Under twenty seconds")


def tiny(*more: str) -> list[str]:
    """Return the words of a tiny run in the default place."""
    words = command(Path("unused"), "cone")
    at = words.index("--out")
    return [*words[:at], *words[at + 2 :], "--threads", "1", *more]


def test_a_dry_run_prints_the_file_of_the_run_and_writes_nothing(say, tmp_path: Path) -> None:
    dry = say(*tiny("--dry-run"))
    assert (dry.code, dry.err) == (0, "")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "dry.toml").write_text(dry.out)
    run = conevo.Run(say(*tiny("--quiet")).out.strip())
    assert resolve(file=tmp_path / "dry.toml").run_id == run.config.run_id
    assert dry.out.startswith(f"# {run.path} (nothing was written)\n")
    first = run.generations()[0]["team_evaluations"]
    assert f" {first:,} team evaluations in the first generation" in dry.out


def test_the_price_of_a_dry_run_is_what_the_run_costs(say) -> None:
    options = ("--budget-evaluations", "200", "--set", "method.evaluation=systematic")
    [dry] = json.loads(say(*tiny("--dry-run", "--json", *options)).out)["runs"]
    run = conevo.Run(say(*tiny("--quiet", *options)).out.strip())
    records = run.generations()
    assert (dry["run_id"], dry["config"]) == (run.config.run_id, run.config.tables())
    assert dry["evaluations"] == records[0]["team_evaluations"]
    assert dry["generations"] == len(records) > 1
    assert dry["team_steps"] == pytest.approx(records[-1]["team_steps"], rel=0.1)  # lesions


def test_a_dry_run_of_a_shaping_names_every_stage(say, tmp_path: Path) -> None:
    out = say("run", "rover/complex-3", "--shape", "--preset", "smoke", "--dry-run").out
    assert [f"# rover-v2/complex-{k}, CONE" in out for k in (1, 2, 3, 4)] == [True] * 3 + [False]
    assert list(tmp_path.iterdir()) == []


def test_a_dry_run_refuses_the_places_that_the_run_would_refuse(say, tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "file").write_text("")
    for more in ((), ("--dry-run",)):
        message = say(*tiny("--out", "taken", *more))
        assert (message.code, message.out) == (2, "")
        assert "taken exists" in message.err or "taken already exists" in message.err


def test_settings_of_another_controller_are_listed(say) -> None:
    rows = json.loads(say("list", "controllers", "--json").out)
    assert [row["controller"] for row in rows] == list(CONTROLLERS)
    for name in CONTROLLERS:
        listed = say("list", "settings", "gacc/complex-1", "--controller", name, "--json").out
        found = {row["setting"]: row["value"] for row in json.loads(listed)}
        assert found["controller.name"] == name
        expected = vars(resolve("gacc/complex-1", overrides={"controller.name": name}).controller)
        assert {k[11:]: v for k, v in found.items() if k[:11] == "controller."} == {
            "name": name,
            **expected,
        }


def test_a_controller_is_named_and_kept_in_the_advice(say, tmp_path: Path) -> None:
    chosen = ("--set", "controller.name=ctrnn", "--set", "controller.slowest=5")
    message = say(*tiny(*chosen, "--out", "ct"))
    assert (message.code, message.err) == (0, "")
    assert message.out.splitlines()[0].endswith(", controller ctrnn")
    advice = next(line for line in message.out.splitlines() if " --method mesp " in line)
    assert " --set controller.name=ctrnn " in advice
    assert " --set controller.slowest=5.0" in advice
    again = say(*shlex.split(advice)[1:], "--dry-run").out
    assert 'name = "ctrnn"' in again
    assert "slowest = 5" in again
    shown = say("show", "ct").out
    assert shown.splitlines()[0].endswith(", controller ctrnn")
    changed = next(line for line in shown.splitlines() if line.startswith("changed from preset"))
    assert {"controller.name", "controller.slowest"} <= set(changed.split(": ")[1].split(", "))


def test_advice_keeps_the_requested_length(say, monkeypatch) -> None:
    say(*tiny("--quiet", "--out", "here"))
    monkeypatch.setattr("conevo.kernels.devices.cards_here", lambda: ())
    message = say("resume", "here", "--generations", "9", "--device", "cuda")
    assert message.code == 3
    assert message.err.endswith("; once fixed: conevo resume here --generations 9\n")


def test_watch_refuses_a_missing_device(say, monkeypatch) -> None:
    say(*tiny("--quiet", "--out", "here"))
    monkeypatch.setattr("conevo.kernels.devices.cards_here", lambda: ())
    monkeypatch.setattr("conevo.watch.server.serve", lambda *_: None)
    message = say("watch", "here", "--device", "cuda:7", "--no-browser")
    assert message.code == 3
    assert message.err.startswith("conevo: error: device 'cuda:7': no CUDA device on this machine")
    assert say("watch", "here", "--device", "cpu", "--no-browser").code == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("rover/complex-1 --method cone-2 --set sd=label", "method.sd = 'label' on the command"),
        ("rover/complex-1 --method cone-3 --set exchange_share=0.5", "method.exchange_share = 0.5"),
        ("prey/shaping-1 --method mesp --set migration_every=2", "method.migration_every = 2"),
    ],
)  # fmt: skip
def test_a_setting_without_effect_is_one_line_and_nothing_is_written(
    words: str, message: str, say, tmp_path: Path
) -> None:
    for dry in ((), ("--dry-run",)):
        output = say("run", *words.split(), "--preset", "smoke", *dry)
        assert (output.code, output.out, output.err.count("\n")) == (2, "", 1)
        assert message in output.err
    assert list(tmp_path.iterdir()) == []
