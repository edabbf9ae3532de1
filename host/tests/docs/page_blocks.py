"""The blocks of the pages: what each is, and whether it runs.

A comment in the line above a block says what is to be done with it:

    <!-- run: long -->         in `make docs-test`; elsewhere it is only checked: options, targets, imports, syntax
    <!-- run: root -->         in the folder of the repository
    <!-- run: no, REASON -->   never, only checked; where the reason is hardware the page says so just before
    <!-- file: NAME -->        written to that file, which later blocks use

Blocks of other languages, or of none, are shown, not run; a command in one of them is a mistake.
"""

import os
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
BLOCK = re.compile(r"(?:^<!-- (run|file): ([^\n]*?) -->\n)?^```([\w-]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^(?:taxel|make|python|pip|git) ", re.MULTILINE)
REASONS = (
    "hardware",
    "hours",
    "it waits for a program",
    "your own files",
    "an environment of its own",
    "part of a test file",
    "the tests themselves",
)
SKIPPED = ("build", "out")


@dataclass(frozen=True)
class Block:
    """One block. how: "", "long", "root", or why it never runs; file: the name under which it is written."""

    page: Path
    line: int
    language: str
    text: str
    how: str = ""
    file: str = ""

    @property
    def never(self) -> bool:
        """Whether it is only checked."""
        return self.how in REASONS

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def pages() -> list[Path]:
    """Every Markdown page of the repository but what is made."""
    found: list[Path] = []
    for folder, inner, names in os.walk(ROOT):
        inner[:] = [name for name in inner if not name.startswith(".") and name not in SKIPPED]
        found += [Path(folder, name) for name in names if name.endswith(".md") and not name.endswith(".template.md")]
    return sorted(found)


def blocks_of(page: Path) -> list[Block]:
    """In their order."""
    text = page.read_text()
    made = []
    for found in BLOCK.finditer(text):
        key, value, language, body = found.groups()
        how = value if key == "run" else ""
        how = how.removeprefix("no, ")
        line = text.count("\n", 0, found.start(4))
        made.append(Block(page, line, language, body, how, value if key == "file" else ""))
    return made


@cache
def _other_tests() -> str:
    folders = (ROOT / "host/tests", ROOT / "hil_tests")
    files = [path for folder in folders for path in folder.rglob("test_*.py") if path.parent != Path(__file__).parent]
    return "\n".join(text for text in (path.read_text() for path in files) if "BLOCK" in text)


def runs_elsewhere(page: Path) -> bool:
    """Whether another test runs this page's blocks, with stand-ins of its own."""
    return page.parent.name == "docs" and f'"{page.name}"' in _other_tests()
