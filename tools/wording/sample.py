"""Sample functions, tests and paragraphs of pages for a readability review: each piece alone, without its context.

python tools/wording/sample.py --seed 1 --out out/review.md

A reviewer who has not seen the project reads each piece once, and notes whether it was understood. Left out:
generated files, the changelog, and the tables of this folder.
"""

import argparse
import ast
import random
import re
import subprocess
import sys
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import Final, NamedTuple

from taxel.output import write_whole

ROOT: Final = Path(__file__).resolve().parents[2]
EXCLUDED: Final = ("firmware/generated/*", "firmware/tests/generated*", "CHANGELOG.md", "tools/wording/*")
SHORTEST_FUNCTION: Final = 4
"""Lines; a shorter function has nothing to misunderstand."""
SHORTEST_PARAGRAPH: Final = 80
"""Characters; a shorter paragraph is a heading or a caption."""

_C_FUNCTION: Final = re.compile(
    r"((?:/\*(?:(?!\*/).)*\*/\n)?^(?:static )?[a-z][\w \*]*\b\w+\([^;{]*\)\n\{\n.*?^\}\n)", re.MULTILINE | re.DOTALL
)


class Piece(NamedTuple):
    """One piece of the review. kind: "function", "test" or "paragraph"."""

    kind: str
    source: str
    language: str
    text: str


def list_pieces() -> Iterator[Piece]:
    """Yield every piece of the repository that can be sampled, in a fixed order."""
    names = subprocess.run(["git", "-C", str(ROOT), "ls-files"], check=True, capture_output=True, text=True).stdout
    for name in sorted(names.split()):
        path = ROOT / name
        if any(fnmatch(name, pattern) for pattern in EXCLUDED) or not path.is_file():
            continue
        if name.endswith(".py"):
            yield from _list_python_pieces(name, path.read_text())
        elif name.endswith(".c"):
            yield from _list_c_pieces(name, path.read_text())
        elif name.endswith(".md"):
            yield from _list_paragraphs(name, path.read_text())


def _list_python_pieces(name: str, content: str) -> Iterator[Piece]:
    """Yield the functions of a Python file, or only the tests of a test file, with their decorators."""
    is_test = "/tests/" in name or Path(name).name.startswith("test_")
    lines = content.split("\n")
    for node in ast.walk(ast.parse(content)):
        if not isinstance(node, ast.FunctionDef) or (node.end_lineno or 0) - node.lineno < SHORTEST_FUNCTION:
            continue
        if is_test and not node.name.startswith("test_"):
            continue
        first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
        text = "\n".join(lines[first - 1 : node.end_lineno])
        yield Piece("test" if is_test else "function", f"{name}:{first}", "python", text)


def _list_c_pieces(name: str, content: str) -> Iterator[Piece]:
    """Yield the functions of a C file with the comment above each, or only the test cases of a test file."""
    is_test = name.startswith("firmware/tests/")
    for match in _C_FUNCTION.finditer(content):
        text = match[0]
        is_case = is_test and re.search(r"\btest_\w+\(", text.split("{")[0]) is not None
        if text.count("\n") > SHORTEST_FUNCTION and is_case == is_test:
            line = content.count("\n", 0, match.start()) + 1
            yield Piece("test" if is_test else "function", f"{name}:{line}", "c", text)


def _list_paragraphs(name: str, content: str) -> Iterator[Piece]:
    """Yield the paragraphs of a Markdown page, without code blocks, headings, tables and images."""
    without_code = re.sub(r"^```.*?^```$", "", content, flags=re.MULTILINE | re.DOTALL)
    for text in without_code.split("\n\n"):
        if len(text) >= SHORTEST_PARAGRAPH and not text.lstrip().startswith(("|", "#", "<!--", "![")):
            yield Piece("paragraph", name, "", text.strip())


def main() -> int:
    """Write the sample to a Markdown file and print the seed that repeats it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--functions", type=int, default=30)
    parser.add_argument("--tests", type=int, default=15)
    parser.add_argument("--paragraphs", type=int, default=10)
    parser.add_argument("--out", type=Path, required=True, help="Markdown file of the sample")
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    every = list(list_pieces())
    parts = []
    counts = {"function": arguments.functions, "test": arguments.tests, "paragraph": arguments.paragraphs}
    for kind, count in counts.items():
        for number, piece in enumerate(rng.sample([one for one in every if one.kind == kind], count), 1):
            body = f"```{piece.language}\n{piece.text}\n```" if piece.language else piece.text
            parts.append(f"## {kind} {number} ({piece.source})\n\n{body}\n")
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    write_whole(arguments.out, f"# Readability review, seed {arguments.seed}\n\n" + "\n".join(parts))
    print(f"{arguments.out}: {len(parts)} pieces, seed {arguments.seed}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
