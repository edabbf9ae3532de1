"""Formulas: what Git hosts show of a ```math block, a site shows without a script and without a network."""

import re

from latex2mathml.converter import convert

BLOCK = re.compile(r"^```math\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def with_formulas(text: str) -> str:
    """Markdown in which every block of LaTeX is MathML; a line of its own is a formula of its own."""
    return BLOCK.sub(lambda found: _formulas(found[1]), text)


def _formulas(latex: str) -> str:
    lines = [line.removesuffix(r"\\").strip() for line in latex.strip().splitlines()]
    shown = "".join(convert(line, display="block") for line in lines if line)
    return f'<div class="formula">{shown}</div>\n'
