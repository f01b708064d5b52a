"""LaTeX: booktabs tables no wider than a page, captions, escaped names; it compiles."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from conevo.report.exhibits import (
    Column,
    Figure,
    Section,
    Table,
    interval,
    number,
    p_value,
    plain,
)
from conevo.report.figures.style import Drawing
from conevo.report.latex import TEXT_WIDTH, document, figures_to_latex, to_latex


def table(rows: int = 2) -> Table:
    columns = [Column("name", "name", plain), Column("p", "p & q", p_value),
               Column("ends", "95 % interval", interval)]  # fmt: skip
    made = [{"name": f"a_{k}", "p": 1 / 3, "ends": (0.5, None), "more": k} for k in range(rows)]
    return Table("own", "A table", "n: runs; p < 0.05, ±1", columns, made)


def wide(sentences: int = 0) -> Table:
    """Return a table of twelve columns, some with sentences."""
    columns = [Column("environment", "environment", plain), Column("method", "method", plain)]
    columns += [Column(f"x{k}", f"a measure named {k}", number) for k in range(10)]
    columns += [Column(f"s{k}", f"sentence {k}", plain, is_wide=True) for k in range(sentences)]
    row = {f"x{k}": 1234.5 + k for k in range(10)} | {"method": "CONE, gst=0.1, rounds=2"}
    row |= {f"s{k}": "the explanation of this row in a whole sentence, " * 4 for k in range(9)}
    names = ["complex-1", "complex-1", "complex-2"]
    return Table(
        "wide", "A wide table", "All of it.", columns, [row | {"environment": n} for n in names]
    )


def test_latex_is_booktabs_escaped_and_split_into_pages() -> None:
    text = to_latex(table(81))
    assert text.count(r"\begin{tabular}{@{}lrr@{}}") == text.count(r"\end{table}") == 3
    for rule in ("toprule", "midrule", "bottomrule"):
        assert text.count(rf"\{rule}") == 3
    assert r"\hline" not in text
    assert r"\caption[A table]{A table. n: runs; p $<$ 0.05, $\pm$1}" in text
    assert text.count(r"\caption[A table]{A table, continued.}") == 2
    assert r"name & p \& q & \shortstack[r]{95 \%\\interval} \\" in text
    assert r"a\_80 & 0.333 & -- \\" in text
    assert text.count(r"\label{tab:own}") == 1


def test_too_wide_tables_are_split_by_columns_and_repeat_the_names_of_rows() -> None:
    text = to_latex(wide())
    tabulars = text.split(r"\begin{tabular}")[1:]
    assert len(tabulars) > 1
    for part in tabulars:
        head = part.split(r"\midrule")[0].split(r"\toprule")[1]
        assert "environment & method &" in head
        assert part.count(r"\addlinespace") == 1  # before complex-2
        assert part.count("complex-1") == 1
    shown = re.findall(r"named (?:\\\\)?(\d)", text.replace(r"\\", " "))
    assert sorted(shown) == [str(k) for k in range(10)]


def test_paragraphs_have_the_width_that_the_page_allows() -> None:
    for part in to_latex(wide(2)).split(r"\begin{tabular}")[1:]:
        spec = part.splitlines()[0]
        widths = [float(w) for w in re.findall(r"p\{([\d.]+)pt\}", spec)]
        assert sum(widths) <= TEXT_WIDTH
        assert all(w >= 30 for w in widths)


def test_figures_have_captions_and_the_width_of_a_column_or_a_page() -> None:
    def figure(name: str, is_wide: bool) -> Figure:
        drawing = Drawing(b"", b"", is_wide)
        return Figure(name, "S & more", "n = 3.", (), (), drawing=drawing)

    text = figures_to_latex([figure("one", False), figure("two", True)])
    assert r"\includegraphics[width=\columnwidth]{figures/one.pdf}" in text
    assert r"\includegraphics[width=\textwidth]{figures/two.pdf}" in text
    assert r"\begin{figure*}[htbp]" in text
    assert r"\caption[S \& more]{S \& more. n = 3.}" in text
    assert r"\label{fig:two}" in text


def test_a_document_has_the_headings_of_the_page_and_no_empty_ones() -> None:
    figure = Figure("drawn", "S", "n = 3.", (), [{"x": 1}], drawing=Drawing(b"", b""))
    text = document("A & B", [
        Section("Runs", exhibits=[table()]),
        Section("Group", sections=[
            Section("Learning", exhibits=[figure]), Section("Castes", ["None was studied."]),
        ]),
        Section("How to repeat it", preformatted="conevo"),
    ])  # fmt: skip
    shown = [r"\section{Runs}", r"\input{tables/own.tex}", r"\section{Group}",
             r"\subsection{Learning}", r"{figures/drawn.pdf}"]  # fmt: skip
    assert [text.count(one) for one in shown] == [1] * 5
    assert sorted(shown, key=text.index) == shown
    assert "Castes" not in text
    assert "repeat" not in text


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no pdflatex")
def test_it_compiles_and_nothing_is_wider_than_the_page(tmp_path: Path) -> None:
    tables = [table(50), wide(), wide(2), wide(5)]
    (tmp_path / "tables").mkdir()
    tables = [replace(one, name=f"t{k}") for k, one in enumerate(tables)]
    for one in tables:
        (tmp_path / f"tables/{one.name}.tex").write_text(to_latex(one))
    parts = [Section(f"Part {k} & more", exhibits=[one]) for k, one in enumerate(tables)]
    (tmp_path / "all.tex").write_text(document("A & B", [Section("Group", sections=parts)]))
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "all.tex"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout
