"""The documentation is plain, idiomatic English: phrases that read as a translation are refused.

The glossary in CONTRIBUTING.md lists the words to use. To check more files, extend ``CHECKED``:
of a page its prose is checked, of a Python file its docstrings, comments and messages.
"""

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CHECKED = (
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/*.md",
    "docs/results/*.md",
    "docs/*.py",
    "benchmarks/*.py",
    "experiments/*.py",
    "benchmarks/README.md",
    "experiments/README.md",
    "examples/*.md",
    "examples/*.py",
    "src/conevo/*.py",
    "src/conevo/campaigns/**/*.py",
    "src/conevo/cli/*.py",
    "src/conevo/controllers/*.py",
    "src/conevo/evolution/**/*.py",
    "src/conevo/export/*.py",
    "src/conevo/kernels/*.py",
    "src/conevo/playback/*.py",
    "src/conevo/replay/**/*.py",
    "src/conevo/runs/*.py",
    "src/conevo/report/**/*.py",
    "src/conevo/simulators/**/*.py",
    "src/conevo/specialization/*.py",
    "src/conevo/studies/*.py",
    "src/conevo/watch/*.py",
    "src/conevo/worlds/**/*.py",
    "tests/test_[!v]*.py",
    "tests/conftest.py",
    "tests/*/**/*.py",
    "viewer/*.py",
)  # not this file, which quotes the phrases
# Each phrase, a regular expression in which a space is any white space, and what to write.
REFUSED = (
    (r"(?<!there\s)\b(is|are|was|were) no (?!longer|more|less|better|worse)", "is not a"),
    (r"\b(tells?|told)\b", "show, identify, distinguish"),
    (r"\b(says|said)\b", "state, show, print, report"),
    (r"\bspeaks? of\b", "mention, describe"),
    (r"\bbeside\b", "next to, with"),
    (r"\bat work\b", "running"),
    (r"\bmend(s|ed|ing)?\b", "fix, repair"),
    (r"\bto the (same )?bits?\b", "bit for bit"),
    (r"\bso many\b", "that number of"),
    (r"\bas (many|much) \w+ as\b", "the same number of"),
    (r"\banew\b", "again"),
    (r"\b(hangs?|hanging) on\b", "depend on"),
    (r"(?<![\w,:;]\s)\bThere (is|are|was|were)\b", "start with the subject"),
    (r"(?<![\w,;]\s)\bWhat\b(?! next\b)(?![^.]*\?)", "a noun: results, contents, findings"),
    (r"\b(of|by|than|to|in|for|with|from|all) what\b", "a noun, or 'the ... that'"),
    (r"\bwhat(ever)? [^.,;]{1,30} (came|comes|amounts) to\b", "a noun: result, total"),
    (r"\bstands? (?!in for)(in|on|below|above|here|there|next)\b", "is listed, is, lies"),
    (r"\b(on (its|their|the) way|recorded ways?)\b", "path, trajectory"),
    (r"\bthe (one|stage|generation|epoch|event|robot|edition) before\b", "the previous one"),
    (r"\bnothing but\b", "only"),
    (r"\b(thereof|whereof|therein|wherein|hereby)\b", "of it, in which"),
)
# Literal uses: an option, a table of terms, an idiom, a function's name.
ALLOWED = (
    r"conevo says \| you may say",
    r"ask(, evaluate,| /| and) tell",
    "ask-and-tell",
    r"(``|\.|\"|\}: |def |in |ask = |ES: )tell\b",
    r"[\"{-]beside\b",
)
SKIPPED = re.compile(
    r"<!-- (?:table|words to avoid)\b.*?<!-- end -->|<!--.*?-->|^```.*?^```"
    r"|`[^`]+`|\$[^$]+\$|\]\([^)]*\)",
    re.DOTALL | re.MULTILINE,
)
TEXT = (tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING))
PATTERNS = [(re.compile(phrase.replace(" ", r"\s+")), use) for phrase, use in REFUSED]


def files():
    """Return the files to check."""
    return sorted({path for glob in CHECKED for path in ROOT.glob(glob)})


def blank(text):
    """Return as many lines as a text has, without words."""
    return "_" + "\n" * text.count("\n")


def prose(path, text):
    """Return what is read as English in a file; every line stays where it is."""
    if path.suffix == ".py":
        kept = [""] * (text.count("\n") + 2)
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type in TEXT:
                for k, line in enumerate(token.string.split("\n"), start=token.start[0]):
                    kept[k] += f" {line}"
        return "\n".join(kept[1:])
    if path.name == "CHANGELOG.md":  # released versions stay as they were
        text = re.match(r"(?:.*?^## ){2}|.*", text, re.DOTALL | re.MULTILINE)[0]
    return SKIPPED.sub(lambda m: blank(m[0]), text)


def refused(path, text):
    """Return where a file has a refused phrase, and what to write in its place."""
    text = prose(path, text)
    for literal in ALLOWED:
        text = re.sub(
            literal.replace(" ", r"\s+"), lambda m: blank(m[0]), text, flags=re.IGNORECASE
        )
    name = path.relative_to(ROOT) if path.is_absolute() else path
    return [
        f"{name}:{text.count(chr(10), 0, hit.start()) + 1}: {hit[0]!r}; write: {use}"
        for pattern, use in PATTERNS
        for hit in pattern.finditer(text)
    ]


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_no_phrase_of_a_translation(path):
    assert refused(path, path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("phrase", "name"),
    [
        ("A clone is no specialist.", "page.md"),
        ("The report says which runs failed.", "page.md"),
        ("Runs that are at work are listed.", "page.md"),
        ("The order depends on nothing\nbut the seed.", "page.md"),
        ("What a run came to is in its directory.", "page.md"),
        ("There are three worlds.", "page.md"),
        ('"""Return the sum of what robots carry."""\n', "module.py"),
        ("x = 1  # resumes to the bit\n", "module.py"),
        ('raise ValueError("there are so many robots")\n', "module.py"),
    ],
)
def test_a_phrase_is_found_with_its_line(phrase, name):
    (found,) = refused(Path(name), "x = 0\n" + phrase if name == "module.py" else "\n" + phrase)
    assert found.startswith(f"{name}:2: ")


@pytest.mark.parametrize(
    "literal",
    [
        "`--beside OTHER` shows two teams.",
        "```text\nwhat it says\nThere is\n```\n",
        "Another robot stands in for it.",
        "It is no longer used, and if there is no other it is no better.",
        "| conevo says | you may say |\nMethods ask and\ntell.",
        "state = method.tell(state)",
    ],
)
def test_a_literal_use_is_allowed(literal):
    assert refused(Path("page.md"), literal) == []
