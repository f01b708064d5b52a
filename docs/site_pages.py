"""The pages of the documentation site: the source of each, in Markdown for Zensical."""

import json
import os
import re
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Pages outside docs/, and folders that a page represents.
OTHERS = {
    "README.md": "overview.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "benchmarks/README.md": "benchmarks.md",
    "examples/README.md": "examples/index.md",
    "examples/tutorial.ipynb": "examples/tutorial.md",
    "experiments/README.md": "experiments.md",
}
FOLDERS = {"docs/results": "results.md"}
LANGUAGES = {".py": "python", ".toml": "toml", ".cff": "yaml"}
SECTION = re.compile(r"^## (.+)\n\n((?:- .*\n(?: .*\n)*)+)", re.MULTILINE)
MODULE = re.compile(r"\[conevo\.[a-z_.]+\]\(\.\./src/(\S+)\.py\)")
RST_TABLE = re.compile(r"^(=+ +=+)\n(.*?)\n=+ +=+\n(.*?)\n=+ +=+$", re.DOTALL | re.MULTILINE)
FENCED = re.compile(r"^( *)(```|~~~).*?^\1\2 *$", re.DOTALL | re.MULTILINE)
LINK = re.compile(
    r"(?P<before>!?\[(?:[^\[\]]|\[[^\]]*\])*\]\()(?P<path>[^)#:\s]+)(?P<anchor>#[^)\s]*)?\)"
)


def sources():
    """Return the page of the site on which each page or module of the repository is."""
    pages = {
        path.relative_to(ROOT).as_posix(): path.relative_to(ROOT / "docs").as_posix()
        for path in sorted((ROOT / "docs").rglob("*.md"))
        if "node_modules" not in path.parts
    }
    pages |= OTHERS
    for page, (_, modules) in api().items():
        for module in modules:
            pages[f"src/{module.replace('.', '/')}.py"] = page
    return pages


def place_of(path, pages):
    """Return the place of a repository's file on the site, None for a folder without a page."""
    if path in pages:
        return pages[path]
    if path in FOLDERS:
        return FOLDERS[path]
    if (ROOT / path).is_dir():
        return None
    if Path(path).suffix in LANGUAGES and not path.startswith("docs/"):
        return f"{path.removeprefix('src/')}.md"
    return path.removeprefix("docs/")


def dialect(text):
    """Return GitHub's Markdown in the form for Python-Markdown: lists apart, with four spaces."""
    fences = []

    def put_away(match):
        fences.append(match[0])
        return f"\x00{len(fences) - 1}\x00"

    lines, is_list = [], False
    for line in FENCED.sub(put_away, text).split("\n"):
        if re.match(r"(- |\d+\. )", line):
            if lines and lines[-1] and not is_list:
                lines.append("")
            is_list = True
        elif is_list and re.match(r" {2,3}\S", line):
            line = "    " + line.lstrip(" ")
        elif line and not line.startswith(" "):
            is_list = is_list and bool(lines[-1])  # a wrapped line of an item
        lines.append(line)
    joined = "\n".join(lines)
    return re.sub("\x00(\\d+)\x00", lambda m: fences[int(m[1])], joined)


def linked(text, source, pages):
    """Return a page with its links changed for the site, and the files that they lead to."""
    files = set()

    def moved(match):
        path = os.path.normpath(os.path.join(os.path.dirname(source), match["path"]))
        if not (ROOT / path).exists():
            raise SystemExit(f"{source}: {match['path']} does not exist")
        place = place_of(path, pages)
        if place is None:
            return match["before"][:-1].strip("[]")
        if path not in pages and path not in FOLDERS:
            files.add(path)
        anchor = match["anchor"] or ""
        if path.startswith("src/") and path in pages:
            anchor = f"#{path.removeprefix('src/').removesuffix('.py').replace('/', '.')}"
        target = os.path.relpath(place, os.path.dirname(pages[source]) or ".")
        return f"{match['before']}{target}{anchor})"

    parts, at = [], 0
    for fence in FENCED.finditer(text):
        parts += [LINK.sub(moved, text[at : fence.start()]), fence[0]]
        at = fence.end()
    return "".join(parts) + LINK.sub(moved, text[at:]), files


def api():
    """Return the modules of each page of the API reference, as docs/api.md lists them."""
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    return {
        f"api/{m[1].lower()}.md": (m[1], [one.replace("/", ".") for one in MODULE.findall(m[2])])
        for m in SECTION.finditer(text)
    }


def write_pages(folder):
    """Write all pages of the site, and the files that they lead to, into an empty folder."""
    ignored = shutil.ignore_patterns("theme", "*.py", "*.md", "__pycache__")
    shutil.copytree(ROOT / "docs", folder, ignore=ignored)
    pages, files = sources(), set()
    for source, page in pages.items():
        if source.endswith(".py"):
            continue
        text = (ROOT / source).read_text(encoding="utf-8")
        text = notebook(text) if source.endswith(".ipynb") else text
        text, more = linked(text, source, pages)
        files |= more
        write(folder / page, dialect(text))
    for file in sorted(files):
        target = folder / place_of(file, pages)
        if target.suffix == ".md":
            code = (ROOT / file).read_text(encoding="utf-8")
            write(target, f"# {file}\n\n{fenced(code, LANGUAGES[Path(file).suffix])}")
        elif not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / file, target)
    for path, (title, modules) in api().items():
        directives = "\n\n".join(f"::: {module}" for module in modules)
        write(folder / path, f"# {title}\n\n{directives}\n")


def notebook(text):
    """Return the cells of a notebook as a page, without their outputs."""
    cells = [(one["cell_type"], "".join(one["source"])) for one in json.loads(text)["cells"]]
    return "\n".join(
        f"{source}\n" if kind == "markdown" else fenced(source, "python") for kind, source in cells
    )


def fenced(code, language):
    """Return code as a block of a page."""
    return f"```{language}\n{code.rstrip()}\n```\n"


def write_sources(folder):
    """Copy the package into a folder, with the docstrings of its API in Markdown."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "src", folder, ignore=ignored)
    for source in sources():
        if source.startswith("src/"):
            path = folder / source.removeprefix("src/")
            write(path, docstrings(path.read_text(encoding="utf-8")))


def docstrings(code):
    """Return code whose docstrings have Markdown's tables and examples, not reStructuredText's."""

    def table(match):
        column = match[1].index(" =") + 1
        rows = [
            f"| {line[:column].strip()} | {line[column:].strip()} |"
            for line in f"{match[2]}\n{match[3]}".split("\n")
        ]
        return "\n".join([rows[0], "| --- | --- |", *rows[1:]])

    code = re.sub(r"^::\n", "", RST_TABLE.sub(table, code), flags=re.MULTILINE)
    return re.sub(r"::$", ":", code, flags=re.MULTILINE)


def write(path, text):
    """Write a text, in a folder that need not exist."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
