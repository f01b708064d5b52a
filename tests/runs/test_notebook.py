"""Runs in a notebook: the bar while they evolve, and their cards."""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import conevo
from conevo.numbers import number
from conevo.runs.html import card
from conevo.runs.start import start
from runs.tiny import TASK, evolve_tiny, tiny_settings


class Notebook:
    """Replaces IPython in a kernel: stores displayed objects and their updates."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.shown: list[dict[str, str]] = []
        display = SimpleNamespace(display=self.display)
        shell = SimpleNamespace(kernel=object())
        ipython = SimpleNamespace(get_ipython=lambda: shell, display=display)
        monkeypatch.setitem(sys.modules, "IPython", ipython)
        monkeypatch.setitem(sys.modules, "IPython.display", display)

    def display(self, data: dict[str, str], *, raw: bool, display_id: bool) -> Notebook:
        assert raw
        assert display_id
        self.shown.append(data)
        return self

    def update(self, data: dict[str, str], *, raw: bool) -> None:
        assert raw
        self.shown.append(data)


@pytest.fixture
def notebook(monkeypatch: pytest.MonkeyPatch) -> Notebook:
    monkeypatch.setattr("conevo.runs.notebook.PAUSE", 0)
    return Notebook(monkeypatch)


def unbegun(path: Path) -> conevo.Run:
    from conevo.runs.config import resolve

    return start(resolve(TASK, "cone", "smoke", overrides=tiny_settings("cone")), path, threads=1)


def shares(notebook: Notebook) -> list[float]:
    """The values of the bar, one for each display."""
    return [float(re.findall(r'value="([\d.]+)"', one["text/html"])[0]) for one in notebook.shown]


def test_a_notebook_shows_one_bar_and_nothing_is_printed(
    tmp_path: Path, notebook: Notebook, capsys: pytest.CaptureFixture[str]
) -> None:
    run = evolve_tiny(tmp_path / "run")
    assert shares(notebook) == [0, 0.2, 0.4, 0.6, 0.8, 1, 1]
    texts = [one["text/plain"] for one in notebook.shown]
    assert texts[0] == f"generation 0 of 5 · starts · {run.path}"
    value = run.generations()[1]["performance"]["value"]
    assert re.fullmatch(rf"generation 2 of 5 · value {number(value)} · \d s left · .*", texts[2])
    assert " · testing · " in texts[-2]
    assert " · finished · " in texts[-1]
    assert capsys.readouterr().out == ""


def test_an_interrupted_run_shows_how_to_continue_it(tmp_path: Path, notebook: Notebook) -> None:
    run = unbegun(tmp_path / "a<b")

    def stop(run: conevo.Run, record: dict[str, Any]) -> None:
        if record["generation"] == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.resume(watch=stop)
    again = f"conevo.Run({str(run.path)!r}).resume() continues it"
    assert again in notebook.shown[-1]["text/plain"]
    assert "a&lt;b" in notebook.shown[-1]["text/html"]
    assert shares(notebook)[-1] == 0.6
    notebook.shown.clear()
    run.resume()
    assert shares(notebook) == [0.6, 0.8, 1, 1]


def test_a_bar_can_be_left_out(tmp_path: Path, notebook: Notebook) -> None:
    unbegun(tmp_path / "run").resume(progress=False)
    assert notebook.shown == []


def test_elsewhere_lines_are_printed_only_on_request(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    run = unbegun(tmp_path / "run").resume()
    assert capsys.readouterr().out == ""
    run.resume(generations=7, progress=True)
    lines = capsys.readouterr().out.splitlines()
    values = [record["performance"]["value"] for record in run.generations()[5:]]
    assert lines == [
        f"generation {k}/7  value {number(v)}" for k, v in zip((6, 7), values, strict=True)
    ]


class Balanced(HTMLParser):
    """Refuses HTML whose elements do not close as they open, and keeps its text."""

    VOID = frozenset({"br"})

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.names: list[str] = []
        self.text = ""
        self.feed(html)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += "" if self.open[-1:] == ["style"] else f"{data} "


def test_names_on_a_card_are_text() -> None:
    text = card("<b>title</b>", ["<i>fact</i>"], lambda: ["<p>below</p>"])
    assert "&lt;b&gt;title&lt;/b&gt;" in text
    assert "&lt;i&gt;fact&lt;/i&gt;" in text
    assert "<b>" not in text
    assert "<i>" not in text
    assert "<p>below</p>" in text


def test_the_card_of_a_run_shows_its_curve_its_test_and_its_castes(tmp_path: Path) -> None:
    run = evolve_tiny(tmp_path / "<script>alert(1)</script>")
    html = run._repr_html_()
    card = Balanced(html)
    assert "script" not in card.names
    assert str(run.path) in card.text
    test = run.test_result
    assert test is not None
    for part in ("rover-v2/complex-1, CONE, preset smoke", "seed 1", "finished", "5 of 5 gen"):
        assert part in card.text
    points = re.findall(r'<polyline points="([^"]*)"', html)
    assert [len(one.split()) for one in points] == [5]
    area = test["champion"]["performance"]["area"]
    assert f"{number(area['mean'])} ± {number(area['sd'])}" in card.text
    for caste, robots in test["champion"]["castes"].items():
        assert re.search(rf"{caste} +{robots}\b", card.text)


def test_a_run_that_has_not_started_or_is_damaged_has_a_card(tmp_path: Path) -> None:
    run = unbegun(tmp_path / "run")
    assert "0 of 5 generations, 0 team evaluations" in Balanced(run._repr_html_()).text
    (run.path / "generations.jsonl").write_text("{<b>}\n")
    card = Balanced(run._repr_html_())
    assert "b" not in card.names
    assert "generations.jsonl" in card.text


def test_the_card_of_a_team_has_a_row_for_every_robot(tmp_path: Path) -> None:
    team = evolve_tiny(tmp_path / "run").champion
    assert team is not None
    card = Balanced(team._repr_html_())
    assert f"Fittest team of generation {team.generation}" in card.text
    assert card.names.count("tr") == 1 + 3
    for s, parts in zip(team.specialization, team.active.sum(axis=1), strict=True):
        assert re.search(rf" {parts} .* {number(s)} ", card.text)
