"""conevo report --foreign as a user gives it."""

from __future__ import annotations

from pathlib import Path

from report.benchmarl import write
from report.finished_runs import cells, write_campaign

pytest_plugins = ["report.quick_figures"]


def test_foreign_results_are_shown_and_their_steps_must_be_named(without_ink, say) -> None:
    write_campaign(Path("camp"), cells(["pursuit/team-4"], ["homcne"]), 2, 3)
    paths = write(Path("theirs"), {1: [100.0, 200.0], 2: [50.0, 300.0]})
    files = [word for path in paths for word in ("--foreign", str(path))]
    words = ("report", "camp", "--out", "page", *files)
    said = say(*words)
    assert (said.code, said.out) == (2, "")
    assert "--foreign needs --frames-are team (BenchMARL) or robot" in said.err
    assert "give both, or neither" in say(*words[:4], "--frames-are", "team").err
    assert "did you mean 'team'" in say(*words, "--frames-are", "teams").err
    assert "cannot read none.json" in say(*words, "--foreign", "none.json", *FRAMES).err
    assert not Path("page").exists()
    assert say(*words, *FRAMES).code == 0
    assert "mappo (foreign)" in Path("page/index.html").read_text()


FRAMES = ("--frames-are", "team")
