"""Extension of Griffe: examples in docstrings (lines with >>>) become code blocks of the API reference.

Markdown reads >>> as a nested quotation and joins the lines of a quotation to one paragraph.
"""

import re
from typing import Any

import griffe

PROMPT = ">>> "


def fence_examples(text: str) -> str:
    """Return a docstring in which the examples (lines after >>>) are fenced code blocks.

    An example ends at an empty line.
    """
    blocks = []
    for block in re.split(r"\n\s*\n", text):
        lines = block.split("\n")
        start = next((number for number, line in enumerate(lines) if line.lstrip().startswith(PROMPT)), None)
        if start is None or "```" in block:
            blocks.append(block)
            continue
        indent = lines[start][: len(lines[start]) - len(lines[start].lstrip())]
        example = "\n".join(lines[start:]).rstrip().split("\n")
        code = [f"{indent}```pycon", *example, f"{indent}```"]
        blocks.append("\n".join([*lines[:start], *([""] if start else []), *code]))
    return "\n\n".join(blocks)


class DoctestBlocks(griffe.Extension):
    """Fences the examples of every docstring."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Change the docstring of an object after it is read."""
        if obj.docstring is not None:
            obj.docstring.value = fence_examples(obj.docstring.value)
