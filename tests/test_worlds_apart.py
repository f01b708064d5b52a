"""No file outside ``worlds/`` names a world in its code, except those listed here."""

import ast
import re
from pathlib import Path

import conevo

SOURCE = Path(conevo.__file__).parent
WORLDS = re.compile(r"rover|pursuit|gacc|prey|predator", re.IGNORECASE)

# Claims are a registry of the thesis' statements about its worlds.
FOLDERS = ("worlds/", "report/claims/")
ALLOWED = {
    # The command line: a command, an option and examples.
    "cli/main.py": "its table of commands has shape-prey",
    "cli/run.py": "its option --prey",
    "cli/settings_text.py": "the task whose sizes are listed unless another is named",
    "cli/shape_prey.py": "the command shape-prey",
    "cli/listing.py": "a hint",
    "runs/config.py": "a hint",
}


def names_a_world(path: Path) -> bool:
    """Whether a name or a text in a file's code, except docstrings and comments, names a world."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    prose = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            texts = [node.value]
        elif isinstance(node, ast.ImportFrom):
            texts = [node.module or "", *(one.name for one in node.names)]
        else:
            texts = [getattr(node, key, None) for key in ("id", "attr", "arg", "name")]
        if any(isinstance(text, str) and WORLDS.search(text) for text in texts):
            return True
    return False


def test_only_listed_files_name_a_world() -> None:
    naming = {
        name
        for path in sorted(SOURCE.rglob("*.py"))
        if not (name := path.relative_to(SOURCE).as_posix()).startswith(FOLDERS)
        and names_a_world(path)
    }
    assert naming - ALLOWED.keys() == set()
    assert ALLOWED.keys() - naming == set()  # a file that no longer names a world leaves the list
