"""The documentation site: its pages, their links, and the number of clicks to an answer.

``.ci/run`` builds it, which needs Zensical and npm; these tests need neither.
"""

import importlib
import json
import re
import sys
import tomllib
from collections import deque
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
sys.path.append(str(ROOT / "docs"))
import make_site  # noqa: E402
import site_links  # noqa: E402
import site_pages  # noqa: E402

CONFIG = ROOT / "docs" / "theme" / "zensical.toml"
CLICKS = 3
ANSWERS = {  # pages with the answers to a reader's first questions
    "how to write a world": "CONTRIBUTING.md#recipe-add-a-world",
    "how to write a controller": "CONTRIBUTING.md#recipe-add-a-controller",
    "how to write a method": "CONTRIBUTING.md#recipe-add-a-method",
    "what S means": "docs/method.md#4-the-fittest-team-and-its-specialization-32-eq-34",
    "what the numbers cost": "docs/campaigns.md#the-thesis-tables-and-figures",
    "how long a run takes": "docs/quickstart.md#presets",
    "how fast it is": "benchmarks/README.md",
    "how to cite": "docs/cite.md",
    "how to use it from Python": "docs/python.md",
    "whether it runs on Windows": "docs/platforms.md",
    "whether specialists pay": "docs/results/specialists.md",
}


def links(page):
    """Return the targets of a page's links in the repository, with and without the heading."""
    path = ROOT / page
    found = set()
    for m in site_pages.LINK.finditer(path.read_text(encoding="utf-8")):
        target = (path.parent / m["path"]).resolve()
        if target.is_file() and target.suffix == ".md":
            name = target.relative_to(ROOT).as_posix()
            found |= {name, name + (m["anchor"] or "")}
    return found


def clicks():
    """Return the number of clicks from the front page to each page and heading."""
    distance = {"docs/index.md": 0}
    queue = deque(distance)
    while queue:
        page = queue.popleft()
        for target in links(page.partition("#")[0]) - distance.keys():
            distance[target] = distance[page] + 1
            queue.append(target)
    return distance


@pytest.mark.parametrize("question", ANSWERS)
def test_an_answer_is_three_clicks_from_the_front_page(question):
    page, _, heading = ANSWERS[question].partition("#")
    text = (ROOT / page).read_text(encoding="utf-8")
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    slugs = [re.sub(r"[^\w\s-]", "", title.lower()).strip().replace(" ", "-") for title in titles]
    assert not heading or heading in slugs
    assert clicks()[ANSWERS[question]] <= CLICKS


def entries(nav):
    """Return the pages of a navigation, in its order."""
    for entry in nav:
        for value in entry.values():
            yield from entries(value) if isinstance(value, list) else [value]


def test_every_page_is_in_the_navigation_once():
    nav = tomllib.loads(CONFIG.read_text(encoding="utf-8"))["project"]["nav"]
    listed = list(entries(nav))
    pages = {page for page in site_pages.sources().values() if page not in site_pages.api()}
    assert len(listed) == len(set(listed))
    assert set(listed) == pages


def test_the_modules_of_the_api_reference_document_their_names():
    modules = [module for _, modules in site_pages.api().values() for module in modules]
    assert len(modules) >= 20
    assert len(modules) == len(set(modules))
    for module in map(importlib.import_module, modules):
        assert module.__doc__, module
        for name in module.__all__:
            thing = getattr(module, name)
            if callable(thing) and getattr(thing, "__module__", "").startswith("conevo"):
                assert thing.__doc__, f"{module.__name__}.{name}"


@pytest.mark.parametrize(
    ("link", "place"),
    [
        ("[a](worlds.md#parameters)", "[a](worlds.md#parameters)"),
        ("[a](../CONTRIBUTING.md#rules)", "[a](contributing.md#rules)"),
        ("[a](../README.md)", "[a](overview.md)"),
        ("[a](../examples/light.py)", "[a](examples/light.py.md)"),
        ("![a](theme/site.css)", "![a](theme/site.css)"),
        ("[a](../src/conevo/runs/run.py)", "[a](api/runs.md#conevo.runs.run)"),
        ("[a](../docs/results)", "[a](results.md)"),
        ("the folder [`tests`](../tests)", "the folder `tests`"),
        ("[a](https://example.org/x.md)", "[a](https://example.org/x.md)"),
        ("```sh\n[a](../README.md)\n```\n", "```sh\n[a](../README.md)\n```\n"),
    ],
)
def test_a_link_leads_to_the_page_of_its_file(link, place):
    assert site_pages.linked(link, "docs/method.md", site_pages.sources())[0] == place


def test_lists_are_written_as_python_markdown_reads_them():
    github = "Two:\n- one,\n  wrapped\n\n  more of it\n- two\n\n3. three\n\n   more\n\nText.\n"
    assert site_pages.dialect(github) == (
        "Two:\n\n- one,\n    wrapped\n\n    more of it\n- two\n\n3. three\n\n    more\n\nText.\n"
    )


def test_a_notebook_is_shown_as_its_cells():
    cells = [("markdown", ["# Title\n", "Text."]), ("code", ["x = 1\n", "x\n"])]
    text = json.dumps({"cells": [{"cell_type": kind, "source": lines} for kind, lines in cells]})
    assert site_pages.notebook(text) == "# Title\nText.\n\n```python\nx = 1\nx\n```\n"


def test_tables_and_examples_of_docstrings_are_markdown():
    rule = "=====  ======="
    table = f"{rule}\nname   meaning\n{rule}\n``x``  a\n{rule}"
    code = f'"""A file.\n\n::\n\n    x = 1\n\n{table}\n"""'
    assert site_pages.docstrings(code) == (
        '"""A file.\n\n\n    x = 1\n\n| name | meaning |\n| --- | --- |\n| ``x`` | a |\n"""'
    )
    assert site_pages.docstrings('"""So (``x``)::\n\n    x[::2]\n"""') == (
        '"""So (``x``):\n\n    x[::2]\n"""'
    )


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ('<a href="other/">x</a><a href="other/#here">x</a><a href="#top">x</a>', None),
        ('<a href="nowhere/">x</a>', "leads nowhere"),
        ('<img src="no.png">', "leads nowhere"),
        ('<a href="other/#there">x</a>', "no such heading"),
        ('<a href="https://example.org">x</a>', None),
        ('<script src="https://example.org/x.js"></script>', "is loaded from elsewhere"),
        ('<link rel="stylesheet" href="//example.org/x.css">', "is loaded from elsewhere"),
    ],
)
def test_a_broken_link_of_the_built_site_is_noticed(tmp_path, body, fault):
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "index.html").write_text('<h1 id="here">Other</h1>')
    (tmp_path / "index.html").write_text(f'<h1 id="top">Site</h1>{body}')
    found = site_links.faults(tmp_path)
    assert len(found) == (fault is not None)
    assert all(one.startswith("index.html: ") and one.endswith(fault) for one in found)


def test_versions_are_kept_and_latest_leads_to_the_newest_release(tmp_path):
    built, out = tmp_path / "built", tmp_path / "site"
    (built / "method").mkdir(parents=True)
    for page in ("index.html", "method/index.html"):
        (built / page).write_text("page")
    for version in ("0.9.0", "0.10.0.dev0", "0.2.0"):
        make_site.publish(built, out, version)
    listed = json.loads((out / "versions.json").read_text())
    assert [one["version"] for one in listed] == ["0.10.0.dev0", "0.9.0", "0.2.0"]
    assert [one["version"] for one in listed if one["aliases"] == ["latest"]] == ["0.9.0"]
    (target,) = re.findall(r"url=([^\"]+)", (out / "latest" / "method" / "index.html").read_text())
    assert (out / "latest" / "method" / target).resolve() == out / "0.9.0" / "method"
    (target,) = re.findall(r"url=([^\"]+)", (out / "latest" / "index.html").read_text())
    assert (out / "latest" / target).resolve() == out / "0.9.0"
    assert 'url=latest/"' in (out / "index.html").read_text()


def test_only_folders_made_by_the_script_are_replaced(tmp_path, monkeypatch, capsys):
    built, out = tmp_path / "built", tmp_path / "site"
    built.mkdir()
    (built / "index.html").write_text("page")
    make_site.publish(built, out, "0.2.0")
    assert make_site.foreign(out, "0.2.0") is None
    assert make_site.foreign(tmp_path / "absent", "0.2.0") is None
    assert make_site.foreign(built / "index.html", "0.2.0") == built / "index.html"
    assert make_site.foreign(built, "0.2.0") == built / "index.html"
    (out / "0.3.0").mkdir()
    assert make_site.foreign(out, "0.3.0") == out / "0.3.0"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "latest").symlink_to(out)
    assert make_site.foreign(tmp_path / "mine", "0.2.0") == tmp_path / "mine" / "latest"

    monkeypatch.setattr("sys.argv", ["make_site.py", "--out", str(built)])
    monkeypatch.setattr(make_site, "formula_tools", lambda _: pytest.fail("it started to build"))
    with pytest.raises(SystemExit, match=r"^2$"):
        make_site.main()
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.endswith(
        f"error: {built / 'index.html'} was not made by this script; move it away, "
        "or choose another --out"
    )
    assert [path.name for path in built.iterdir()] == ["index.html"]
