"""A report: complete, self-contained, reproducible, and never written over a user's changes."""

from __future__ import annotations

import csv
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import duckdb
import numpy as np
import pytest

from conevo.campaigns.campaign import Campaign
from conevo.campaigns.tables import Tables
from conevo.errors import UsageError
from conevo.report.files import sections_of, write_report
from conevo.report.learning_curves import read_histories
from conevo.report.sections.behaviours import behaviours
from conevo.report.sections.castes import castes
from conevo.report.sections.champions import champions
from conevo.report.sections.interventions import interventions
from conevo.report.sections.scope import scopes
from report.finished_runs import Cell, cells, mean_of, write_campaign

pytest_plugins = ["report.quick_figures"]
pytestmark = pytest.mark.filterwarnings("error")

PLACES = ["rover/complex-1", "rover/complex-2", "pursuit/team-4"]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three environments of two worlds, three methods, four seeds; a run that failed."""
    of = cells(PLACES, ["homcne", "mesp", "cone"])
    failed = ["the disk is <full> & lost"]
    return write_campaign(tmp_path_factory.mktemp("c") / "camp", of, 4, 6, failed=failed)


@pytest.fixture(scope="module")
def report(as_svg_only: None, campaign: Path) -> Path:
    return write_report(Campaign(campaign), campaign / "report").parent


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


class Page(HTMLParser):
    """Collects ids, links, text and everything that a page would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.loads: list[str] = []
        self.tags: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs) -> None:
        found = dict(attrs)
        self.tags.add(tag)
        if "id" in found:
            self.ids.append(found["id"])
        if tag == "a":
            self.links.append(found["href"])
        elif "src" in found or (tag == "link"):
            self.loads.append(tag)


def test_the_page_is_self_contained_and_its_links_lead_somewhere(report) -> None:
    text = (report / "index.html").read_text()
    page = Page(text)
    assert page.loads == []
    assert not {"script", "img", "iframe", "object"} & page.tags
    assert not re.search(r"url\((?!#)", text)
    assert len(page.ids) == len(set(page.ids))
    for link in page.links:
        found = link[1:] in page.ids if link.startswith("#") else (report / link).is_file()
        assert found, link
    for used in re.findall(r'(?:url\(#|href="#)([^)"]+)', text):
        assert used in page.ids, used


def test_every_section_exists_and_states_n_and_tests(report) -> None:
    text = (report / "index.html").read_text()
    for title in ("Runs", r"Task performance: value \(points, larger is better\)",
                  "How champions were chosen", "Comparisons", "Learning", "Castes", "Lesions",
                  "Behavioural validation: clones",
                  "Measures of specialization", "Behaviours", "Claims of the thesis",
                  "How to repeat it"):  # fmt: skip
        assert re.search(rf"<h[23]>{title}</h[23]>", text), title
    captions = re.findall(r"<figcaption.*?</figcaption>", text, re.DOTALL)
    drawn = [one for one in captions if "<b>Figure" in one]
    assert len(drawn) == 2 * 9 + 1
    assert all("n = 4" in one or "n = 2 to 4" in one for one in drawn)
    for test in ("Student", "Welch", "Mann-Whitney", "Holm", "Kolmogorov-Smirnov", "Lilliefors"):
        assert test in text
    assert "The thesis has 20 runs per cell; here are 4." in text


def test_the_selection_of_champions_is_next_to_their_test(report) -> None:
    rows = rows_of(report / "numbers/rover-complex-chosen.csv")
    assert [(row["measure"], row["n"]) for row in rows] == [("fitness", "4")] * 6 + [
        ("value", "4")
    ] * 6
    means = {
        (row["environment"], row["method"]): float(row["mean"])
        for row in rows_of(report / "numbers/rover-complex-performance.csv")
    }
    for row in rows:
        level = means[row["environment"], row["method"]]
        expected = [8, 6, 2, 0.25]
        if row["measure"] == "value":
            expected = [float(row["test"]) * factor for factor in (2, 1.5, 1)] + [0.5]
            assert float(row["test"]) == pytest.approx(level, rel=0.1)
        found = [float(row[key]) for key in ("selection", "validation", "test", "ratio")]
        assert found == pytest.approx(expected)


def test_scenarios_without_a_finite_value_are_counted_in_words(campaign, tmp_path) -> None:
    copy = shutil.copytree(campaign, tmp_path / "copy", ignore=lambda *_: ["report"])
    scores = copy / "tables" / "scores.parquet"
    first = "SELECT min(run) FROM old WHERE contains(run, 'pursuit')"
    with duckdb.connect() as connection:
        connection.sql(f"CREATE TABLE old AS FROM read_parquet('{scores}')")
        connection.sql(
            f"UPDATE old SET value = NULL WHERE run = ({first}) AND study = 'test' AND scenario < 2"
            " AND measure = 'capture_time' AND team = 'champion'"
        )
        connection.sql(f"COPY old TO '{scores}' (FORMAT parquet)")
    with Tables(copy / "tables") as tables:
        told = [champions(scope).text for scope in scopes(tables)]
    (sentence,) = [line for lines in told for line in lines]
    assert sentence.startswith(
        "Not finite: capture time in 2 of 240 values of the test of champions, of 1 of 12 runs."
    )


def test_failures_are_listed_and_escaped(report) -> None:
    text = (report / "index.html").read_text()
    assert "Runs finished: 36 of 37 planned; failed: 1; not ended: 0." in text
    assert "the disk is &lt;full&gt; &amp; lost" in text
    assert rows_of(report / "numbers/failures.csv")[0]["message"] == "the disk is <full> & lost"
    assert r"the disk is $<$full$>$ \& lost" in (report / "tables/failures.tex").read_text()


def test_the_numbers_are_those_of_the_tables(report, campaign) -> None:
    with Tables(campaign / "tables") as tables:
        values = tables.values()
    for row in rows_of(report / "numbers/rover-complex-performance.csv"):
        runs = [
            one.value
            for one in values
            if (one.environment, one.method) == (row["environment"], row["method"])
        ]
        assert int(row["n"]) == len(runs) == 4
        assert float(row["mean"]) == pytest.approx(np.mean(runs), rel=1e-9)
        assert float(row["sd"]) == pytest.approx(np.std(runs, ddof=1), rel=1e-9)
    points = rows_of(report / "numbers/rover-complex-runs.csv")
    assert len(points) == 24
    assert {row["run"]: float(row["value"]) for row in points} == pytest.approx(
        {one.run: one.value for one in values if one.world == "rover-v2"}, rel=1e-9
    )


def test_losses_are_those_of_the_same_run(report, campaign) -> None:
    with Tables(campaign / "tables") as tables:
        changed = tables.values(study="lesion", team="non-specialized")
        whole = {one.run: one.value for one in tables.values(study="lesion", team="whole")}
    value = {one.run: one.value for one in changed}
    expected = {run: 100 * (whole[run] - value[run]) / max(whole[run], value[run]) for run in value}
    found = {
        row["run"]: float(row["lost"])
        for world in ("rover-complex", "pursuit-team")
        for row in rows_of(report / f"numbers/{world}-lesion.csv")
        if row["caste"] == "non-specialized"
    }
    assert found == pytest.approx(expected, rel=1e-9)
    table = rows_of(report / "numbers/rover-complex-lesion-castes.csv")
    hom = next(r for r in table if (r["environment"], r["method"]) == ("complex-1", "homcne"))
    mine = [run for run in expected if run.startswith("rover-complex-1-homcne-")]
    assert len(mine) == 4
    assert float(hom["lost"]) == pytest.approx(np.mean([expected[r] for r in mine]), rel=1e-9)
    left = 100 * sum(value[r] for r in mine) / sum(whole[r] for r in mine)
    assert float(hom["percent"]) == pytest.approx(left, rel=1e-9)


def test_castes_by_s_are_next_to_favourite_settings(without_ink, tmp_path) -> None:
    """Two champions of two robots: one moves and detects in turn, one is of an earlier version."""
    campaign = write_campaign(tmp_path / "c", cells(["rover/complex-1"], ["mesp"]), 3)
    robots = (
        ("s1", 0, "non-specialized", "low", 1.0),
        ("s1", 1, "non-specialized", "low", 0.5),
        ("s2", 0, "hi", "hi", 0.8),
        ("s2", 1, "non-specialized", None, None),  # which detected nothing
        ("s3", 0, "hi", None, None),
    )
    with Tables(campaign / "tables") as tables:
        runs = {run[-2:]: run for (run,) in tables.query("SELECT run FROM runs")[1]}
        tables.query("DELETE FROM robots")
        for seed, robot, caste, setting, share in robots:
            values = [f"'{runs[seed]}'", str(robot), f"'{caste}'"]
            values += ["NULL" if x is None else repr(x) for x in (setting, share)]
            tables.query(
                "INSERT INTO robots (run, robot, caste, favourite_setting, setting_share) "
                f"VALUES ({', '.join(values)})"
            )
        scope = scopes(tables)[0]
        teams, favourites = castes(scope, read_histories(tables, scope.group)).exhibits[-2:]
    assert [row["devoted"] for row in teams.rows] == [1.0]  # one from each of two champions
    method = {"treatment": "Multi-Agent ESP"}
    low = {"caste": "non-specialized", "setting": "low", "robots": 2, "share": 0.75, "devoted": 1}
    hi = {"caste": "hi", "setting": "hi", "robots": 1, "share": 0.8, "devoted": 1}
    portions = [{"portion": pytest.approx(part)} for part in (2 / 3, 1 / 3)]
    assert favourites.rows == [method | low | portions[0], method | hi | portions[1]]
    assert [{k: row[k] for k in low} for row in favourites.numbers] == [low, hi]
    assert "cannot see settings" in favourites.note


def test_intervals_of_losses_end_where_losses_do(without_ink, tmp_path) -> None:
    with Tables(write_campaign(tmp_path / "c", cells(["rover/complex-1"]), 3) / "tables") as tables:
        tables.query(
            "UPDATE scores SET value = CASE WHEN team = 'whole' THEN 1 WHEN contains(run, '-s1')"
            " THEN 0.5 ELSE 0 END WHERE study = 'lesion'"
        )
        figure, table = interventions(scopes(tables)[0])[0].exhibits
    ends = [row["interval"] for row in table.rows if row["n"] > 1 and row["interval"][0]]
    assert max(high for _, high in ends) == 100.0
    assert min(low for low, _ in ends) >= -100.0
    assert all("which ends at ±100 %, where losses do" in one.note for one in (figure, table))


def test_every_exhibit_has_its_numbers_and_every_table_its_latex(report) -> None:
    files = {path.relative_to(report).as_posix() for path in report.rglob("*.*")}
    manifest = json.loads((report / "manifest.json").read_text())["files"]
    assert set(manifest) == files - {"manifest.json"}
    for name in files:
        stem = Path(name).stem
        if name.startswith("figures/"):
            assert {f"figures/{stem}.svg", f"figures/{stem}.pdf", f"numbers/{stem}.csv"} <= files
        if name.startswith("tables/"):
            assert f"numbers/{stem}.csv" in files
    for name in ("rover-complex", "pursuit-team"):
        for what in ("bars", "runs", "significance", "learning", "specialization", "thresholds",
                     "castes", "lesion", "clones"):  # fmt: skip
            assert f"figures/{name}-{what}.pdf" in files
    assert "figures/pursuit-team-captures.svg" in files
    assert json.loads((report / "marl-eval.json").read_text())


def test_the_same_tables_give_the_same_bytes(report, campaign, without_ink, tmp_path) -> None:
    """All but the figures' ink, of which test_figures.py compares each kind."""
    again = write_report(Campaign(campaign), tmp_path / "again").parent

    def files(root: Path) -> dict[str, bytes]:
        found = {path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*.*")}
        found["index.html"] = re.sub(rb"(?s)<svg.*?</svg>\s*", b"", found["index.html"])
        assert json.loads(found.pop("manifest.json"))["files"].keys() == found.keys()
        return {name: b"" if name[:8] == "figures/" else own for name, own in found.items()}

    assert files(again) == files(report)


def empty(folder: Path) -> Path:
    """Return a campaign of which no run is finished: a report of few pages."""
    root = write_campaign(folder / "camp", cells(["rover/complex-1"], ["mesp", "cone"]), 2, 3)
    with duckdb.connect() as connection:
        for path in (root / "tables").glob("*.parquet"):
            connection.execute(f"CREATE OR REPLACE TABLE t AS FROM read_parquet('{path}') LIMIT 0")
            connection.execute(f"COPY t TO '{path}' (FORMAT parquet)")
    return root


def test_only_an_unchanged_report_is_replaced(tmp_path) -> None:
    root = empty(tmp_path)
    out = tmp_path / "out"
    page = write_report(Campaign(root), out)
    assert write_report(Campaign(root), out) == page
    page.write_text(page.read_text() + "<!-- mine -->")
    with pytest.raises(UsageError, match=r"index\.html was changed"):
        write_report(Campaign(root), out)
    assert page.read_text().endswith("<!-- mine -->")
    write_report(Campaign(root), tmp_path / "other")
    (tmp_path / "other" / "notes.txt").write_text("mine")
    with pytest.raises(UsageError, match=r"notes\.txt was changed"):
        write_report(Campaign(root), tmp_path / "other")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "thesis.tex").write_text("mine")
    with pytest.raises(UsageError, match="is not a report"):
        write_report(Campaign(root), tmp_path / "own")
    with pytest.raises(UsageError, match=r"thesis\.tex is a file, not a directory"):
        write_report(Campaign(root), tmp_path / "own" / "thesis.tex" / "report")
    assert (tmp_path / "own" / "thesis.tex").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camp", "other", "out", "own"]


def test_budgets_are_separate(without_ink, tmp_path) -> None:
    of = [
        *cells(["rover/complex-1"], ["mesp", "cone"], budget=1000),
        *cells(["rover/complex-1"], ["mesp", "cone"], budget=5000),
    ]
    root = write_campaign(tmp_path / "c", of, 2, 3)
    with Tables(root / "tables") as tables:
        sections = sections_of(tables, Campaign(root))
    groups = [section for section in sections if section.sections]
    assert [section.name for section in groups] == ["rover-complex", "rover-complex-budget-2"]
    assert [section.title for section in groups] == [
        f"rover-v2, complex, smoke, {budget} team evaluations of 500 team-steps"
        for budget in ("1,000", "5,000")
    ]
    assert groups[1].text[0] == (
        "Each of the 4 runs spent 5,000 team evaluations, 2,500,000 team-steps; preset smoke; "
        "conevo 0.1.0."
    )
    names = [one.name for section in sections for one in section.all_exhibits()]
    assert len(names) == len(set(names))
    for section in groups:
        (table,) = [e for e in section.all_exhibits() if e.name == f"{section.name}-performance"]
        assert [row["n"] for row in table.rows] == [2, 2]


@pytest.mark.parametrize(
    "of",
    [
        [Cell("rover", "complex-1", "cone")],
        [Cell("gacc", "complex-1", m, variant=v) for m in ("mesp", "cone") for v in ("a=1", "a=2")],
        [Cell("rover", "complex-1", "cone"), Cell("rover", "complex-2", "own_method")],
    ],
    ids=["one run", "variants", "cells missing, a method of one's own"],
)
def test_odd_campaigns_have_a_report_too(of, as_svg_only, tmp_path) -> None:
    root = write_campaign(tmp_path / "c", of, 1, 2, without=["behaviours", "robots", "castes"])
    text = write_report(Campaign(root), tmp_path / "out").read_text()
    assert text.count("One run per cell: no deviation, no interval, and nothing") == 1
    assert "Mann-Whitney" not in re.sub(r"(?s)<section id=.section-claims.*?</section>", "", text)
    assert "95 % interval" not in re.sub(r"(?s)<section id=.section-claims.*?</section>", "", text)


def test_many_variants_are_tables_if_drawings_would_be_unreadable(tmp_path) -> None:
    of = [
        Cell("rover", f"complex-{n}", "cone", variant=f"gst=0.{k}")
        for n in (1, 2)
        for k in range(1, 10)
    ]
    out = write_report(Campaign(write_campaign(tmp_path / "c", of, 2, 2)), tmp_path / "out").parent
    assert sorted(path.name for path in (out / "figures").glob("*")) == []
    for name in ("runs", "learning", "specialization", "lesion", "clones", "performance"):
        assert (out / f"tables/rover-complex-{name}.tex").is_file(), name
    assert len(rows_of(out / "numbers/rover-complex-runs.csv")) == 36


def test_a_world_where_nothing_was_achieved_has_no_losses(without_ink, tmp_path) -> None:
    of = cells(["rover/complex-1"], ["mesp", "cone"])
    root = write_campaign(tmp_path / "c", of, 2, 3, mean=lambda cell: -1e6)
    text = write_report(Campaign(root), tmp_path / "out").read_text()
    assert (
        len(re.findall(r"Teams left out, as neither they nor the unchanged ones scored: \d+", text))
        == 2
    )


def test_a_report_without_a_finished_run_states_it(tmp_path) -> None:
    root = empty(tmp_path)
    text = write_report(Campaign(root), tmp_path / "out").read_text()
    assert "Runs finished: 0 of 4 planned; failed: 0; not ended: 4." in text


def test_the_best_method_is_found(report) -> None:
    """The known truth of the runs is found: each method is 80 above the previous one."""
    rows = rows_of(report / "numbers/rover-complex-comparisons.csv")
    pair = next(
        r for r in rows if (r["environment"], r["first"], r["second"]) ==
        ("complex-1", "CONE", "HomCNE")
    )  # fmt: skip
    truth = mean_of(Cell("rover", "complex-1", "cone")) - mean_of(
        Cell("rover", "complex-1", "homcne")
    )
    assert float(pair["interval_low"]) < truth < float(pair["interval_high"])
    assert pair["verdict"] == "better (t-test only)"


def test_diversity_that_pays_is_computed_from_the_runs_of_a_cell(campaign, report) -> None:
    with Tables(campaign / "tables") as tables:
        value_of = {one.run: one.value for one in tables.values()}
        _, found = tables.query(
            "SELECT run, value FROM metrics JOIN runs USING (run) WHERE task = 'rover-v2/complex-2'"
            " AND method = 'cone' AND metric = 'hierarchic_social_entropy'"
        )
    diversity = [value for _, value in found]
    correlation = np.corrcoef(diversity, [value_of[run] for run, _ in found])[0, 1]
    file = next((report / "numbers").glob("rover-complex*-specialization-measures.csv"))
    (row,) = [
        row
        for row in rows_of(file)
        if (row["environment"], row["method"], row["metric"])
        == ("complex-2", "cone", "diversity that pays")
    ]
    assert float(row["mean"]) == pytest.approx(np.mean(diversity) * correlation, rel=1e-6)
    assert row["n"] == "4"


def test_behaviours_of_an_unknown_study_are_shown_by_name(
    without_ink, campaign, monkeypatch: pytest.MonkeyPatch
) -> None:
    def shown() -> list[str]:
        with Tables(campaign / "tables") as tables:
            (scope,) = (one for one in scopes(tables) if one.group.world.startswith("pursuit"))
            found = behaviours(scope)
            assert found is not None
            figure, table = found.exhibits
            assert [column.key for column in table.columns if column.key.startswith("runs ")]
        return [figure.name, *dict.fromkeys(row["behaviour"] for row in figure.rows)]

    names = ["entrapment", "pursuer-blocker", "spiders-fly", "role-switcher", "none"]
    assert shown() == ["pursuit-team-captures", *names]
    monkeypatch.setattr("conevo.report.sections.behaviours.studies", dict)
    assert shown() == ["pursuit-team-occurrences", *sorted(names[:-1]), "none"]
