"""Files and names of the package that a page, a docstring or a comment points to are there."""

import importlib
import re
import subprocess
from pathlib import Path

import pytest

import plumbob

ROOT = Path(__file__).parents[2]
FOREIGN = {"mtdevice.py", "kalibr_common/ConfigReader.py", "plumbob_lean.py", "plumbob_tag.py", "plumbob_seven.py"}
"""Of other programs."""
WORDS = ["git", "ls-files", "-co", "--exclude-standard"]
LISTED = subprocess.run(WORDS, cwd=ROOT, capture_output=True, text=True, check=False).stdout.splitlines()
PATHS = [path for path in LISTED if (ROOT / path).is_file()]
ENDS = {"/".join(path.split("/")[-n:]) for path in PATHS for n in range(1, path.count("/") + 2)} | FOREIGN
READ = [
    path for path in PATHS if path.endswith((".py", ".md", ".toml", ".h")) and not path.startswith(("tests/", "CH"))
]

pytestmark = pytest.mark.skipif(not PATHS, reason="this is no checkout of git")


def pointed_to(pattern):
    for path in READ:
        text = (ROOT / path).read_text(encoding="utf-8")
        for match in re.finditer(pattern, text):
            yield f"{path}:{text.count(chr(10), 0, match.start()) + 1}", match[1]


def exists(name):
    """Whether a dotted name is that of a module, of something in it, or of a field of that."""
    place = plumbob
    for part in name.split(".")[1:]:
        if part in getattr(place, "__dataclass_fields__", {}):
            return True
        try:
            place = (
                getattr(place, part) if hasattr(place, part) else importlib.import_module(f"{place.__name__}.{part}")
            )
        except (ModuleNotFoundError, AttributeError):
            return False
    return True


def test_a_file_that_is_pointed_to_is_there():
    named = pointed_to(r"(?<![\w./{}-])([a-z_][\w/]*\.py)\b")
    assert [f"{place} {name}" for place, name in named if name not in ENDS] == []


def test_a_name_that_is_pointed_to_is_there():
    named = pointed_to(r"`(plumbob(?:\.[A-Za-z_]\w*)+)")
    assert [f"{place} {name}" for place, name in named if not exists(name)] == []
