"""The live page in a real browser: runs that continue, servers that stop, names like markup."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from conevo import numbers
from conevo.replay.page import replay_page
from conevo.runs.outline import digest_of
from conevo.watch.server import LiveServer
from conevo.watch.state import Watched
from replay.synthetic import made_up
from replay.viewing import hexadecimal, inside, overflow, pixels, until
from runs.tiny import evolve_tiny
from watch.followed import append, record, write_run

pytest_plugins = ["replay.browser"]
pytestmark = pytest.mark.browser

METHODS = ("cone", "homcne")
HOSTILE = "<img src=x onerror=window.pwned=1> 50% #1?&'\"`"


@pytest.fixture(scope="module")
def evolved(tmp_path_factory):
    """Two finished tiny runs, to be copied."""
    folder = tmp_path_factory.mktemp("evolved")
    for method in METHODS:
        evolve_tiny(folder / method, method)
    return folder


@pytest.fixture
def runs(evolved, tmp_path):
    """A folder with a finished run, one that is running, one interrupted, one damaged.

    A lock is held as by the process of a run.
    """
    folder = tmp_path / "runs"
    for name, method, generations in (
        ("done", "cone", None),
        ("active", "homcne", 3),
        ("stopped", "cone", 2),
        ("broken", "cone", 1),
    ):
        shutil.copytree(evolved / method, folder / name)
        if generations is not None:
            (folder / name / "DONE").unlink()
            log = folder / name / "generations.jsonl"
            log.write_text("".join(lines_of(evolved / method)[:generations]))
    (folder / "broken" / "config.toml").write_text("[run\n")
    with held(folder / "active"):
        yield folder


@contextmanager
def held(run):
    handle = os.open(run / "lock", os.O_RDWR)
    fcntl.flock(handle, fcntl.LOCK_EX)
    yield
    os.close(handle)


def lines_of(run):
    return (run / "generations.jsonl").read_text().splitlines(keepends=True)


def records_of(run):
    return [json.loads(line) for line in lines_of(run)]


@contextmanager
def served(folder, replay=lambda label: replay_page([made_up(label)])):
    """The address of a live page that follows a folder."""
    with LiveServer(Watched(folders=[folder]), None, replay) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield server.address
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture
def live(tab, runs):
    """The live page of the runs, showing them."""
    with served(runs) as address:
        tab.goto(address)
        tab.wait_for_selector("#runs tr[data-label]")
        yield tab


def table(tab):
    """The table of runs: label -> column -> text."""
    return tab.evaluate(
        """() => {
            const names = [...document.querySelectorAll("#runs thead th")]
                .map((one) => one.textContent.trim());
            return Object.fromEntries(
                [...document.querySelectorAll("#runs tbody tr[data-label]")].map((row) => [
                    row.dataset.label,
                    Object.fromEntries([...row.cells].map((cell, k) => [
                        names[k], cell.textContent.trim()])),
                ]));
        }"""
    )


def number(text):
    return float(text.replace(",", ""))


def details(tab, field):
    return tab.locator(f"#details [data-field={field}]").inner_text()


def test_every_run_is_listed_with_its_status_and_results(live, runs):
    found = table(live)
    assert set(found) == {"done", "active", "stopped", "broken"}
    for label, status in (
        ("done", "finished"),
        ("active", "running"),
        ("stopped", "interrupted"),
    ):
        records, row = records_of(runs / label), found[label]
        assert row["status"] == status
        assert row["generation"] == f"{len(records)}/5"
        last = records[-1]
        value = next(iter(last["performance"].values()))
        assert number(row["performance"]) == pytest.approx(value, rel=5e-4)
        assert number(row["fitness"]) == pytest.approx(last["team_fitness"], rel=5e-4)
        assert number(row["S"]) == pytest.approx(last["specialization"], rel=5e-4, abs=1e-6)
    assert [found[name]["method"] for name in ("done", "active")] == ["CONE", "HomCNE"]
    assert "left" in found["active"]["time left"] or "any moment" in found["active"]["time left"]
    assert found["done"]["time left"] == ""
    assert found["broken"]["status"] == "damaged"
    assert "damaged" in found["broken"]["run"] or "config" in found["broken"]["run"]
    assert "1 finished, 1 running, 1 interrupted, 1 damaged" in live.inner_text("#summary")
    live.screenshot(path=runs / "overview.png")


def test_numbers_look_as_in_every_command(tab, tmp_path):
    values = [0.0, 0.25, 4e-4, -0.00012345, 9.99996e-5, 4e-5, -1.25e-12, 999.96, 1234567.8, 2.5e9]
    for value in values:
        append(write_run(tmp_path / f"{value}", n=0), record(0, team_fitness=value))
    with served(tmp_path) as address:
        tab.goto(address)
        tab.wait_for_selector("#runs tr[data-label]")
        shown = {label: row["fitness"] for label, row in table(tab).items()}
    assert shown == {f"{value}": numbers.number(value) for value in values}


def test_a_new_generation_appears_without_reloading(live, runs, evolved):
    live.evaluate("window.marker = 1")
    live.click("#runs tr[data-label='active'] td")
    live.wait_for_selector("#details:not([hidden])")
    line = lines_of(evolved / "homcne")[3]
    with (runs / "active" / "generations.jsonl").open("a") as log:
        log.write(line[:40])
        log.flush()
        log.write(line[40:])
    until(
        live,
        "() => document.querySelector(\"tr[data-label='active']\").innerText.includes('4/5')",
    )
    until(live, "() => document.querySelector('[data-field=generation]').innerText.includes('4')")
    record = json.loads(line)
    value = next(iter(record["performance"].values()))
    assert number(table(live)["active"]["performance"]) == pytest.approx(value, rel=5e-4)
    assert live.evaluate("window.marker") == 1


def test_a_run_that_appears_and_one_that_ends_are_shown(live, runs, evolved):
    shutil.copytree(evolved / "homcne", runs / "new")
    live.wait_for_selector("tr[data-label=new]")
    assert table(live)["new"]["status"] == "finished"
    shutil.copy(evolved / "cone" / "generations.jsonl", runs / "stopped")
    shutil.copy(evolved / "cone" / "DONE", runs / "stopped")
    until(
        live,
        "() => document.querySelector('tr[data-label=stopped]').innerText.includes('finished')",
    )
    assert table(live)["stopped"]["generation"] == "5/5"


@pytest.mark.parametrize("label", ["done", "stopped"])
def test_a_click_on_a_run_shows_its_details(live, runs, label):
    live.click(f"#runs tr[data-label={label}] td")
    live.wait_for_selector("#details:not([hidden])")
    records = records_of(runs / label)
    last = records[-1]
    assert live.inner_text("#details h2") == label
    assert f"{len(records)} of 5" in details(live, "generation")
    message = details(live, "performance")
    for name, value in last["performance"].items():
        found = re.search(rf"{name} ([\d.,]*\d)", message)
        assert found, message
        assert number(found[1]) == pytest.approx(value, rel=5e-4)
    numbers = [number(one) for one in re.findall(r"[\d.,]*\d", details(live, "fitness"))]
    assert numbers == pytest.approx([last["team_fitness"], last["best_fitness"]], rel=5e-4)
    assert number(details(live, "specialization")) == pytest.approx(
        last["specialization"], rel=5e-4, abs=1e-6
    )
    for name, n in last["castes"].items():
        assert f"{name} {n}" in details(live, "castes")
    liked = details(live, "favourites")
    for name, n in last["favourites"].items():
        assert f"{name} {n}" in liked
    share = number(re.search(r"mean share ([\d.]+), 1 = always the same one", liked)[1])
    assert share == pytest.approx(last["favourite_share"], rel=5e-4)
    numbers = [number(one) for one in details(live, "thresholds").split(", ")]
    assert numbers == pytest.approx([last["sst"], last["gst"]], rel=5e-4)
    assert number(details(live, "evaluations").split(" ")[0]) == last["team_evaluations"]


def test_castes_over_generations_are_drawn_in_their_colours(live, runs):
    live.click("#runs tr[data-label=done] td")
    live.wait_for_selector("#chart-castes canvas")
    live.locator("#chart-castes").scroll_into_view_if_needed()
    last = records_of(runs / "done")[-1]
    legend = live.locator("figure:has(#chart-castes) .legend").inner_text()
    assert "generation 4" in legend
    colours = live.evaluate("Object.values(conevo.state().castes)[0]")
    chart = pixels(live, inside(live, "#chart-castes"))
    drawn = {hexadecimal(pixel) for pixel in np.unique(chart.reshape(-1, 3), axis=0)}
    for name, n in last["castes"].items():
        assert f"{name} {n}" in legend
        assert colours[name] in drawn, name
    for name in ("performance", "fitness", "thresholds"):
        assert live.locator(f"#chart-{name} canvas").count() == 1
    live.screenshot(path=runs / "details.png")


def test_a_run_links_to_the_replay_of_its_champion(live, runs):
    live.click("#runs tr[data-label='active'] td")
    fitness = [record["team_fitness"] for record in records_of(runs / "active")]
    link = live.locator("#details a.replay")
    assert f"generation {int(np.argmax(fitness))}" in link.inner_text()
    with live.context.expect_page() as opened:
        link.click()
    replay = opened.value
    replay.wait_for_selector("body[data-ready=yes]")
    assert "active" in replay.inner_text("body")
    replay.evaluate("conevo.play()")
    until(replay, "() => conevo.state().t > 2")


def test_back_and_forward_and_reloading_keep_the_run_that_is_shown(live):
    live.click("#runs tr[data-label=done] td")
    live.wait_for_selector("#details[data-label=done]")
    live.reload()
    live.wait_for_selector("#details[data-label=done]:not([hidden])")
    live.click("#details button.close")
    live.wait_for_selector("#details", state="hidden")
    live.go_back()
    live.wait_for_selector("#details[data-label=done]:not([hidden])")


def test_runs_can_be_filtered_and_sorted(live):
    live.fill("#filter", "homcne running")
    assert live.locator("#runs tbody tr:visible").count() == 1
    live.fill("#filter", "")
    assert live.locator("#runs tbody tr:visible").count() == 4
    live.get_by_role("button", name="generation", exact=True).click()
    order = live.eval_on_selector_all(
        "#runs tbody tr", "rows => rows.map((row) => row.dataset.label)"
    )
    assert order.index("stopped") < order.index("active") < order.index("done")


def test_names_never_become_markup(tab, tmp_path, evolved):
    """Neither the name of a folder nor any text in hostile files."""
    shutil.copytree(evolved / "cone", tmp_path / "runs" / HOSTILE)
    worse = tmp_path / "runs" / "worse"
    shutil.copytree(evolved / "cone", worse)
    (worse / "DONE").unlink()
    record = records_of(worse)[-1] | {"generation": 5, "castes": {HOSTILE: 3}}
    record["performance"] = {HOSTILE: 1.5, "__proto__": 2.5}
    (worse / "generations.jsonl").write_text(json.dumps(record | {"generation": 0}) + "\n")
    config = (worse / "config.toml").read_text().replace('"cone"', json.dumps(HOSTILE), 1)
    (worse / "config.toml").write_text(config)
    about = json.loads((worse / "provenance.json").read_text())
    about["config_digest"] = digest_of(config.encode())
    (worse / "provenance.json").write_text(json.dumps(about))
    with served(tmp_path / "runs") as address:
        tab.goto(address)
        tab.wait_for_selector("#runs tr[data-label]")
        tab.get_by_role("link", name=HOSTILE).click()
        tab.wait_for_selector("#details:not([hidden])")
        assert tab.inner_text("#details h2") == HOSTILE
        with tab.context.expect_page() as opened:
            tab.click("#details a.replay")
        opened.value.wait_for_selector("body[data-ready=yes]")
        assert HOSTILE in opened.value.inner_text("body")
        opened.value.close()
        tab.click("#runs tr[data-label=worse] td")
        tab.wait_for_selector("#details[data-label=worse]")
        assert tab.locator("img, script[src], iframe").count() == 0
        assert tab.evaluate("window.pwned") is None


def test_a_server_that_stops_and_returns(tab, runs, complaints):
    """A process of its own, as a user starts it; its replay is recorded from the run."""
    command = [sys.executable, "-m", "conevo", "watch", "--no-browser"]

    def start(port="0"):
        process = subprocess.Popen(
            [*command, "--port", port], cwd=runs.parent, stdout=subprocess.PIPE, text=True
        )
        return process, re.search(r"http://127\.0\.0\.1:(\d+)/", process.stdout.readline())

    process, address = start()
    try:
        tab.goto(address[0])
        tab.wait_for_selector("#runs tr[data-label]")
        assert len(table(tab)) == 4
        assert not tab.locator("#problem").is_visible()
        tab.click("#runs tr[data-label=done] td")
        with tab.context.expect_page() as opened:
            tab.click("#details a.replay")
        opened.value.wait_for_selector("body[data-ready=yes]")
        assert opened.value.evaluate("conevo.state().teams") == 1
        opened.value.close()
        assert complaints == []
        process.kill()
        process.communicate()
        tab.wait_for_selector("#problem:visible")
        message = tab.get_by_role("alert").inner_text().strip()
        assert 10 < len(message) < 300
        assert "\n" not in message
        assert len(table(tab)) == 4  # earlier results stay
        process, _ = start(address[1])
        tab.wait_for_selector("#problem", state="hidden")
    finally:
        process.kill()
        process.communicate()
    # A browser logs every unanswered request to its console.
    assert [one for one in complaints if "net::ERR_" not in one] == []
    complaints.clear()


def test_it_fits_windows_of_all_sizes(live):
    live.click("#runs tr[data-label=done] td")
    live.wait_for_selector("#chart-castes canvas")
    for width in (1600, 900, 390):
        live.set_viewport_size({"width": width, "height": 800})
        assert overflow(live) <= 0


def test_the_table_below_a_chart_is_at_most_as_wide(live):
    live.set_viewport_size({"width": 1280, "height": 800})
    live.wait_for_selector(".standings td")
    assert overflow(live) <= 0
    wide = "all => all.map((one) => one.scrollWidth - one.clientWidth)"
    assert live.eval_on_selector_all("#panels .wide", wide) == [0]


def test_an_empty_folder_is_shown_to_have_no_runs(tab, tmp_path):
    Path(tmp_path / "runs").mkdir()
    with served(tmp_path / "runs") as address:
        tab.goto(address)
        until(tab, "() => document.querySelector('#summary').innerText.includes('0 runs')")
