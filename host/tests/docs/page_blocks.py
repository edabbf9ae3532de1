"""Code blocks of the Markdown pages: their language, text and mode of execution.

A comment in the line above a block states its mode:

    <!-- run: long -->         runs in `make docs-test`; otherwise options, targets, imports and syntax are checked
    <!-- run: root -->         runs in the folder of the repository
    <!-- run: no, REASON -->   is only checked; if the reason is hardware, the text above the block must name it
    <!-- file: NAME -->        is written to this file, which later blocks use

Blocks of another language, or of none, do not run and must not contain commands.
"""

import os
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
BLOCK = re.compile(r"(?:^<!-- (run|file): ([^\n]*?) -->\n)?^```([\w-]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^(?:taxel|make|python|pip|git) ", re.MULTILINE)
REASONS_NOT_TO_RUN = (
    "hardware",
    "hours",
    "it waits for a program",
    "your own files",
    "an environment of its own",
    "part of a test file",
    "the tests themselves",
)
SKIPPED_FOLDERS = ("build", "out")


@dataclass(frozen=True)
class Block:
    """A code block of a page.

    line: number of the line before the first line of the text, from 1. mode: "" (runs), "long", "root", or a reason not
    to run. file: name of the file to which the block is written; "" if it is not written.
    """

    page: Path
    line: int
    language: str
    text: str
    mode: str = ""
    file: str = ""

    @property
    def is_only_checked(self) -> bool:
        """True if the block is checked but does not run."""
        return self.mode in REASONS_NOT_TO_RUN

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def list_pages() -> list[Path]:
    """List every Markdown page of the repository except templates and build products, sorted by path."""
    paths: list[Path] = []
    for folder, inner, names in os.walk(ROOT):
        inner[:] = [name for name in inner if not name.startswith(".") and name not in SKIPPED_FOLDERS]
        paths += [Path(folder, name) for name in names if name.endswith(".md") and not name.endswith(".template.md")]
    return sorted(paths)


def read_blocks(page: Path) -> list[Block]:
    """Read the code blocks of a page, in order."""
    text = page.read_text()
    blocks = []
    for match in BLOCK.finditer(text):
        key, value, language, body = match.groups()
        mode = value if key == "run" else ""
        mode = mode.removeprefix("no, ")
        line = text.count("\n", 0, match.start(4))
        blocks.append(Block(page, line, language, body, mode, value if key == "file" else ""))
    return blocks


@cache
def _source_of_guide_tests() -> str:
    """Return the joined source of all test files outside this folder that contain the word BLOCK.

    Tests that run the blocks of a guide use a regular expression with this name.
    """
    folders = (ROOT / "host/tests", ROOT / "hil_tests")
    files = [path for folder in folders for path in folder.rglob("test_*.py") if path.parent != Path(__file__).parent]
    return "\n".join(text for text in (path.read_text() for path in files) if "BLOCK" in text)


def is_run_elsewhere(page: Path) -> bool:
    """True if a test outside this folder runs the blocks of the page, with files of its own."""
    return page.parent.name == "docs" and f'"{page.name}"' in _source_of_guide_tests()
