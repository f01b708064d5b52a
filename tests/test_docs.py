"""The pages are correct: tables agree with the package, examples run, links lead somewhere."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.controllers.registry import controller
from conevo.errors import UsageError
from conevo.report.sections.metrics import definitions
from conevo.runs.settings import declared
from conevo.specialization.team import METRICS, Activity, Metric, measure
from conevo.worlds.checks import random_teams
from conevo.worlds.simulators import simulator

ROOT = Path(__file__).resolve().parent.parent
EXECUTED = (
    "README.md",
    *(
        f"docs/{name}.md"
        for name in ("quickstart", "python", "worlds", "campaigns", "replay", "export", "track")
    ),
)
LINKED = (
    *EXECUTED,
    "CONTRIBUTING.md",
    "examples/README.md",
    *(
        f"docs/{name}.md"
        for name in ("adapters", "api", "cite", "index", "platforms", "results", "settings")
    ),
)
MARKED = re.compile(r"<!-- ([a-z]+): (\S+) -->\n```\w+\n(.*?)```\n", re.DOTALL)


sys.path += [str(ROOT / "experiments"), str(ROOT / "docs")]  # scripts import what they share


def script(name, folder="docs"):
    """Return a script as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


make_tables = script("make_tables")
run_page = script("run_page")


@pytest.mark.parametrize("page", make_tables.PAGES)
def test_tables_are_those_of_the_package(page):
    text = (ROOT / page).read_text()
    assert make_tables.MARKED.search(text), "no table in this page"
    assert make_tables.updated(text) == text, "run: python docs/make_tables.py"


def test_every_results_page_states_its_versions():
    pages = sorted((ROOT / "docs" / "results").rglob("*.md"))
    assert len(pages) >= 10
    for page in pages:
        title, empty, mark = page.read_text().splitlines()[:3]
        assert (title[:2], empty) == ("# ", "")
        assert re.match(r"> Made with conevo \d+\.\d+\.\d+ .*\bin `[a-z]+-v\d+`", mark), page


def test_every_table_that_can_be_made_has_its_page():
    pages = "".join((ROOT / page).read_text() for page in make_tables.PAGES)
    assert sorted(m[2] for m in make_tables.MARKED.finditer(pages)) == sorted(make_tables.TABLES)


def test_a_stale_table_is_noticed_and_repaired():
    text = (ROOT / "README.md").read_text()
    stale = text.replace("| `cone-3` |", "| `cone-4` |")
    assert stale != text
    assert make_tables.updated(stale) == text


@pytest.mark.parametrize("entry", conevo.WORLDS.values(), ids=lambda entry: entry.name)
def test_every_parameter_of_a_world_is_explained(entry):
    assert [one.name for one in declared(entry.params_class) if not one.meaning] == []


SLOW = {
    f"docs/{name}.md": pytest.mark.slow
    for name in ("campaigns", "export", "python", "quickstart", "replay", "worlds")
}


@pytest.mark.parametrize("page", [pytest.param(one, marks=SLOW.get(one, ())) for one in EXECUTED])
def test_examples_run_and_print_the_output_on_the_page(page):
    executed = [block for block in run_page.blocks((ROOT / page).read_text()) if block.is_run]
    assert executed
    assert run_page.differences(ROOT / page) == []


def test_a_changed_word_is_noticed_and_a_changed_number_is_not():
    line = "value 41.4  move 5, low 4, hi 1  2 s left"
    assert run_page.shape("value 9  non-specialized 20  1 min 02 s left") == run_page.shape(line)
    assert run_page.shape("value 41.4  move 5, low 4, hi 1  2 s more") != run_page.shape(line)
    assert run_page.shape("area 41.4  move 5, low 4, hi 1  2 s left") != run_page.shape(line)


def test_an_example_that_fails_is_noticed(tmp_path):
    page = tmp_path / "page.md"
    for text in (
        "```sh\nconevo list world\n```\n",
        "```sh\nconevo list worlds\n```\n\n```text\nconevo: error: no\n```\n",
    ):
        page.write_text(text)
        with pytest.raises(RuntimeError, match="exit code"):
            run_page.differences(page)


def test_a_run_can_be_drawn_and_shows_the_rocks_it_detected(tmp_path):
    pytest.importorskip("matplotlib")
    from PIL import Image

    draw_run = script("draw_run", "experiments")
    few = {"run.generations": 2, "run.n_tests": 3, "method.genotypes": 20}
    run = conevo.evolve(
        "rover/complex-1", "homcne", "smoke", out=tmp_path / "run", overrides=few, threads=1
    )
    values = run.test_result["champion"]["performance"]["value"]["values"]
    middle = draw_run.median_scenario(run)
    assert values[middle] == sorted(values)[1]
    scene, x, _, favourites, detected, value = draw_run.replay(run, middle)
    assert value == values[middle] > 0
    assert scene.rock_value[0, detected].sum() >= value  # the last iteration's are not recorded
    assert x.shape == (run.config.world_params.iterations, len(favourites))
    draw_run.draw([run, run], tmp_path / "run.png")
    with Image.open(tmp_path / "run.png") as picture:
        assert picture.width > picture.height > 500
        assert len(picture.convert("RGB").getcolors(2**20)) > 50


def test_a_page_without_markers_is_refused(tmp_path):
    pages = script("pages", "experiments")
    page = tmp_path / "page.md"
    page.write_text("<!-- results -->\nold\n<!-- end -->\n<!-- results -->\n<!-- end -->\n")
    for name in ("results", "behaviours"):
        with pytest.raises(SystemExit, match=f"<!-- {name} -->"):
            pages.put("new", page, name)


@pytest.mark.skipif(
    not (ROOT / "docs" / "pictures").is_dir(), reason="the source package has no pictures"
)
@pytest.mark.parametrize("page", LINKED)
def test_links_lead_somewhere(page):
    path = ROOT / page
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text())
    assert links
    assert [link for link in links if not (path.parent / link).exists()] == []


def recipes():
    """Return (mark, argument, text) of every block of the recipes that stands for a file."""
    return MARKED.findall((ROOT / "CONTRIBUTING.md").read_text())


def test_the_recipes_quote_their_examples():
    quoted = [(name, text) for mark, name, text in recipes() if mark == "from"]
    assert len(quoted) >= 5
    assert [text for name, text in quoted if text not in (ROOT / name).read_text()] == []


def test_a_parameter_is_one_field_and_one_of_the_kernels(tmp_path):
    """Follow the recipe in a copy of an example: a wind that blows along x."""
    text = (ROOT / "examples" / "light.py").read_text()
    for after, added in (
        ('    """(side) the largest step."""\n',
         '    wind: Annotated[float, Ge(0), Le(0.1)] = 0.0\n    """(side) of a moving robot."""\n'),
        ("    step: float\n", "    wind: float\n"),
        ("team.x[i] + step[0]", " + p.wind"),
    ):  # fmt: skip
        assert text.count(after) == 1
        text = text.replace(after, after + added)
    path = tmp_path / "windy.py"
    path.write_text(text)
    calm, windy = (conevo.world(f"{path}:dark-1", wind=wind) for wind in (0, 0.05))
    (of_wind,) = (one for one in declared(type(calm.params)) if one.name == "wind")
    assert (of_wind.unit, of_wind.meaning) == ("side", "of a moving robot")
    with pytest.raises(UsageError, match=r"world.wind = 1: must be less than or equal to 0.1"):
        conevo.world(f"{path}:dark-1", wind=1)
    genes, teams = random_teams(calm, 20)
    still, without, blown = (
        simulator(one, controller(world=one)).evaluate(genes, teams, one.scenarios([1]))
        for one in (conevo.world(f"{ROOT / 'examples' / 'light.py'}:dark-1"), calm, windy)
    )
    assert np.array_equal(still.fitness, without.fitness)
    assert not np.array_equal(without.fitness, blown.fitness)


def test_a_metric_is_one_entry(monkeypatch):
    share = Metric(lambda team: 0.25, "1 / R to 1", "share of the busiest robot", "made up")
    monkeypatch.setitem(METRICS, "largest_share", share)
    labels = ["non-specialized"] * 2
    nothing = Activity(np.zeros((2, 3)), np.zeros(2), labels, np.zeros(2), range(3))
    assert measure(nothing)["largest_share"] == 0.25
    (table,) = definitions().exhibits
    row = {"span": share.span, "what": share.what, "source": share.source}
    assert {"name": "largest share"} | row in table.rows


@pytest.mark.slow
def test_following_the_recipes_adds_worlds_a_method_and_a_controller(tmp_path):
    """Follow CONTRIBUTING in a copy; the contract tests enrol all new parts by their entries."""
    for name in ("src", "tests", "examples"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    package = tmp_path / "src" / "conevo"
    for example, place in (
        ("light", "worlds"),
        ("spread", "worlds"),
        ("linear", "controllers"),
        ("random_search", "evolution/methods"),
    ):
        text = (ROOT / "examples" / f"{example}.py").read_text()
        text = re.sub(r"\n\n(def main\(\)|ENTRY = ).*", "", text, flags=re.DOTALL)
        text = text.replace("from conevo.worlds.registry import WorldEntry\n", "")
        text = text.replace("from conevo.evolution.methods.registry import MethodEntry\n", "")
        text = text.replace('"ENTRY", ', "")
        (package / place / f"{example}.py").write_text(text)
    (entry,) = (text for mark, _, text in recipes() if mark == "entry" and "light-v1" in text)
    spread = entry.replace("light", "spread").replace("Light", "Spread").replace("dark-1", "open-1")
    for mark, name, text in [*recipes(), ("entry", "src/conevo/worlds/registry.py", spread)]:
        if mark == "entry":
            registry = tmp_path / name
            head, end, tail = registry.read_text().partition("\n    )\n}\n")
            registry.write_text(f"{head}\n{text.rstrip()}{end}{tail}")
        elif mark == "preset":
            with (package / "runs" / "presets" / f"{name}.toml").open("a") as file:
                file.write(f"\n{text}")
    paths = (str(tmp_path / "src"), str(ROOT / "tests" / "children"))
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}

    def run(*arguments, code=0):
        done = subprocess.run(
            [sys.executable, "-m", *arguments],
            cwd=tmp_path, env=environment, text=True, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        assert done.returncode == code, done.stdout
        return done.stdout

    assert "light-v1" in run("conevo", "list", "worlds")
    assert "random-search" in run("conevo", "list", "methods")
    assert "Linear controller" in run("conevo", "list", "controllers")
    options = ("--preset", "smoke", "--method", "random-search")
    assert "stopped by: generations" in run("conevo", "run", "light/dark-1", *options[:2],
                                            "--method", "homcne")  # fmt: skip
    assert "is that of a world of the package" in run("conevo", "run", "examples/light.py:dark-1",
                                                      code=2)  # fmt: skip
    assert "stopped by: generations" in run("conevo", "run", "rover/complex-1", *options,
                                            "--set", "run.generations=2")  # fmt: skip
    assert "stopped by: generations" in run("conevo", "run", "spread/open-1", *options,
                                            "--set", "controller.name=linear")  # fmt: skip
    for folder, words, least in (
        # Eight for each world, but three are for Warp; nine for the method, ten for the controller.
        ("tests/contracts", "light-v1 or spread-v1 or random or complex-5 and linear", 32),
        ("tests/runs/test_resume.py", "kills and (light and homcne or random-search and rover)", 2),
    ):
        marks = ("-m", "exhaustive or slow or not slow")  # CI kills each method in one task only
        output = run("pytest", "-q", "-p", "no:cacheprovider", folder, "-k", words, *marks)
        found = re.search(r"(\d+) passed", output)
        assert found, output
        assert int(found[1]) >= least
