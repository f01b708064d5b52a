"""Build the documentation site: ``python docs/make_site.py [--out site]``.

It writes ``OUT/VERSION/``, keeps the versions that are already there, and makes ``OUT/latest/``
lead to the newest one; ``OUT/versions.json`` lists them, for the list of versions on every page. It
replaces only what it has made: anything else in these places is refused. It needs the packages of
the extra ``docs`` and npm. Warnings, formulas with errors, and links that lead nowhere are errors.

Pages are those of the repository, in Zensical's dialect of Markdown. A link from one of them to a
file that is not a page leads to a copy of the file.
"""

import argparse
import html
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import site_links
import site_pages

ROOT = Path(__file__).resolve().parent.parent
THEME = ROOT / "docs" / "theme"
FORMULA = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\(?P<kind>[(\[])(?P<tex>.*?)\\[)\]]</(?P=tag)>',
    re.DOTALL,
)
MARK = ".made-by-make-site"  # a file in OUT and in each of its folders
LONG_CELL = re.compile(r"<td>(?=[^\n]{60})")


def run(*command, cwd):
    """Run a command; end with its output if it fails."""
    try:
        done = subprocess.run(
            command, cwd=cwd, text=True, check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
    except FileNotFoundError:
        sys.exit(f"{command[0]} is missing; see CONTRIBUTING.md, Set up")
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}: exit code {done.returncode}\n{done.stdout}")


def formula_tools(folder):
    """Return a new folder in ``folder`` with KaTeX, which npm installs, and the script for it."""
    tools = folder / "theme"
    shutil.copytree(THEME, tools)
    if not (tools / "node_modules").is_dir():
        run("npm", "ci", "--silent", cwd=tools)
    return tools


def build(folder, tools, version):
    """Build the pages in an empty folder and return the site's folder."""
    pages = folder / "pages"
    site_pages.write_pages(pages)
    site_pages.write_sources(folder / "src")
    katex = tools / "node_modules" / "katex" / "dist"
    shutil.copytree(
        katex / "fonts", pages / "theme" / "fonts", ignore=shutil.ignore_patterns("*.ttf", "*.woff")
    )
    for style in (THEME / "site.css", katex / "katex.min.css"):
        shutil.copy(style, pages / "theme")
    config = (THEME / "zensical.toml").read_text(encoding="utf-8")
    entries = "".join(
        f'{{ "{title}" = "{path}" }},\n' for path, (title, _) in site_pages.api().items()
    )
    config = config.replace("# API: docs/make_site.py\n", entries)
    head = '[project]\ndocs_dir = "pages"\nsite_dir = "built"\n'
    (folder / "zensical.toml").write_text(config.replace("[project]\n", head, 1), encoding="utf-8")
    run(Path(sys.executable).parent / "zensical", "build", "--strict", cwd=folder)
    return folder / "built"


def finish(built, tools):
    """Render the formulas of all pages, and mark cells of much text; return their number."""
    texts = {page: page.read_text(encoding="utf-8") for page in sorted(built.rglob("*.html"))}
    found = [
        {"tex": html.unescape(m["tex"]), "display": m["kind"] == "["}
        for text in texts.values()
        for m in FORMULA.finditer(text)
    ]
    done = subprocess.run(
        ["node", "formulas.mjs"], cwd=tools, text=True, check=False, capture_output=True,
        input=json.dumps(found),
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"a formula has an error:\n{done.stderr}")
    rendered = iter(json.loads(done.stdout))
    for page, text in texts.items():
        new = FORMULA.sub(lambda m: f"<{m['tag']}>{next(rendered)}</{m['tag']}>", text)
        new = LONG_CELL.sub('<td class="long">', new)
        if new != text:
            page.write_text(new, encoding="utf-8")
    return len(found)


def order(version):
    """Return the sort key of a version: releases come after their development versions."""
    numbers, _, rest = version.partition(".dev")
    return [int(n) for n in numbers.split(".")], not rest, int(rest or 0)


def foreign(out, version):
    """Return the first thing that ``publish`` would replace and has not made, or None."""
    folders = {out / name: out / name / MARK for name in (version, "latest")}
    files = {out / name: out / MARK for name in ("versions.json", "index.html")}
    if out.exists() and not out.is_dir():
        return out
    for place, mark in (folders | files).items():
        if place.is_symlink() or (place.exists() and not mark.is_file()):
            return place
    return None


def publish(built, out, version):
    """Put a built site into its folder, and update the list of versions and ``latest``."""
    target = out / version
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(built, target)
    shutil.rmtree(out / "latest", ignore_errors=True)
    (out / "latest").mkdir()
    for folder in (out, target, out / "latest"):
        (folder / MARK).touch()
    versions = sorted(
        (path.parent.name for path in out.glob("*.*/index.html")), key=order, reverse=True
    )
    released = [one for one in versions if ".dev" not in one]
    latest = (released or versions)[0]
    listed = [
        {"version": one, "title": one, "aliases": ["latest"] * (one == latest)} for one in versions
    ]
    (out / "versions.json").write_text(json.dumps(listed, indent=1) + "\n", encoding="utf-8")
    pages = [page.relative_to(out / latest) for page in (out / latest).rglob("index.html")]
    for page in pages:
        up = "../" * len(page.parts)
        redirect(out / "latest" / page, f"{up}{latest}/{page.parent}")
    redirect(out / "index.html", "latest")


def redirect(page, target):
    """Write a page that leads to another one."""
    page.parent.mkdir(parents=True, exist_ok=True)
    target = f"{os.path.normpath(target)}/"
    page.write_text(
        f'<!doctype html><meta charset="utf-8"><title>conevo</title>'
        f'<meta http-equiv="refresh" content="0; url={target}"><a href="{target}">{target}</a>\n',
        encoding="utf-8",
    )


def main():
    """Build the site of this version."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "site", help="default: site/")
    arguments = parser.parse_args()
    began = time.monotonic()
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    if place := foreign(arguments.out, version):
        parser.error(f"{place} was not made by this script; move it away, or choose another --out")
    with tempfile.TemporaryDirectory() as folder:
        tools = formula_tools(Path(folder))
        built = build(Path(folder), tools, version)
        n_formulas = finish(built, tools)
        if faults := site_links.faults(built):
            sys.exit("\n".join(faults))
        publish(built, arguments.out, version)
    n_pages = len(list((arguments.out / version).rglob("index.html")))
    seconds = time.monotonic() - began
    print(f"{arguments.out / version}: {n_pages} pages, {n_formulas} formulas, {seconds:.0f} s")


if __name__ == "__main__":
    main()
