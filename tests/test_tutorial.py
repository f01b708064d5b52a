"""The tutorial notebook: it is committed without outputs, and runs from top to bottom."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import conevo

NOTEBOOK = Path(__file__).resolve().parent.parent / "examples" / "tutorial.ipynb"


def test_it_is_committed_without_outputs() -> None:
    notebook = json.loads(NOTEBOOK.read_text())
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(code) >= 10
    assert all((cell["outputs"], cell["execution_count"]) == ([], None) for cell in code)
    assert set(notebook["metadata"]) == {"kernelspec", "language_info"}


@pytest.mark.slow
def test_it_runs_from_top_to_bottom(tmp_path: Path) -> None:
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    pytest.importorskip("pandas")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    place = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources=place).execute()

    outputs = [one for cell in notebook.cells for one in cell.get("outputs", [])]
    assert [one for one in outputs if one.get("name") == "stderr"] == []
    html = [text for one in outputs if (text := _data(one).get("text/html"))]
    bars = [text for text in html if "<progress" in text]
    assert len(bars) == 1
    assert 'value="1.0000"' in bars[0]
    assert "generation 20 of 20" in bars[0]
    assert "finished" in bars[0]
    assert sum("<iframe sandbox" in text for text in html) == 1
    assert sum("image/png" in _data(one) for one in outputs) == 3
    campaigns = [text for text in html if "Two methods" in text]
    assert ["4 pending" in campaigns[0], "4 finished" in campaigns[1]] == [True, True]
    assert "whole" in html[-1]

    run = conevo.Run(tmp_path / "runs" / "tutorial")
    assert run.test_result is not None
    champion, first = (
        run.test_result[team]["performance"]["value"]["mean"]
        for team in ("champion", "generation_0")
    )
    assert champion > 2 * first  # "already learns a little"


def _data(output: Any) -> Any:
    return output.get("data", {})
