"""Formulas: ```math blocks as MathML, which a browser shows without a script and without a network."""

import re

from latex2mathml.converter import convert

BLOCK = re.compile(r"^```math\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def convert_formulas(text: str) -> str:
    """Return the Markdown text with every ```math block as MathML; each line of a block is a separate formula."""
    return BLOCK.sub(lambda found: _convert_block(found[1]), text)


def _convert_block(latex: str) -> str:
    """Convert LaTeX formulas, whose lines are separated by double backslashes, to MathML in an HTML block."""
    lines = [line.removesuffix(r"\\").strip() for line in latex.strip().splitlines()]
    shown = "".join(convert(line, display="block") for line in lines if line)
    return f'<div class="formula">{shown}</div>\n'
