"""Names and prose of a source file, each with its line number."""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

NAME: Final = "name"
PROSE: Final = "prose"

C_SUFFIXES: Final = (".c", ".h")
HASH_SUFFIXES: Final = (".toml", ".sh", ".yml", ".yaml", ".cmake")
HASH_NAMES: Final = ("Makefile", "CMakeLists.txt", "run")
"""Files whose comments begin with #."""
_C_TOKEN: Final = re.compile(r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|[A-Za-z_]\w*", re.DOTALL)
_PYTHON_TOKEN: Final = re.compile(
    r"#[^\n]*"
    r"|(?:\b[rRbBuUfF]{1,2})?(?:\"{3}(?:\\.|[^\\])*?\"{3}|'{3}(?:\\.|[^\\])*?'{3}|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*')"
    r"|[A-Za-z_]\w*",
    re.DOTALL,
)
_HASH_COMMENT: Final = re.compile(r"(?:^|\s)#(?!\!)(.*)$")
_MARKDOWN_CODE: Final = re.compile(r"`[^`\n]*`|\]\([^)\n]*\)|<!--.*?-->|https?://\S+", re.DOTALL)
_HTML_CODE: Final = re.compile(r"<[^>]*>|\{[{%].*?[%}]\}", re.DOTALL)
_TOML_PROSE: Final = re.compile(r'^\s*(?:what|help|description|reason|title|note)\s*=\s*"(.*)"\s*$')


class Text(NamedTuple):
    """A name or a piece of prose. kind: `NAME` or `PROSE`."""

    kind: str
    line: int
    text: str


def extract_texts(path: Path, content: str, is_suspicious: Callable[[str], bool] = lambda name: True) -> Iterator[Text]:
    """Yield all names and prose of a file; nothing for a file of another type.

    is_suspicious: whether a name is of interest; a Python file without such names is not parsed.
    """
    if path.suffix == ".py":
        yield from _list_python_texts(content, is_suspicious)
    elif path.suffix in C_SUFFIXES:
        yield from _list_c_texts(content)
    elif path.suffix == ".md":
        yield from _list_markdown_prose(content)
    elif path.suffix == ".html":
        yield from _html_prose(content)
    elif path.suffix in HASH_SUFFIXES or path.name in HASH_NAMES:
        yield from _hash_prose(content, is_toml=path.suffix == ".toml")


def _list_python_texts(content: str, is_suspicious: Callable[[str], bool]) -> Iterator[Text]:
    """Yield the names that a Python file defines, its comments, its docstrings and its strings that contain a space.

    is_suspicious: as in `extract_texts`.
    """
    line, counted, names = 1, 0, set()
    for match in _PYTHON_TOKEN.finditer(content):
        token = match[0]
        if token[-1] not in "\"'" and token[0] != "#":
            names.add(token)
            continue
        line += content.count("\n", counted, match.start())
        counted = match.start()
        if token[0] == "#":
            yield Text(PROSE, line, token.lstrip("#! "))
            continue
        for offset, part in enumerate(_remove_inline_code(token).split("\n")):
            if " " in part.strip():
                yield Text(PROSE, line + offset, part)
    if any(is_suspicious(name) for name in names):
        yield from _list_python_names(content)


def _list_python_names(content: str) -> Iterator[Text]:
    """Yield the names that a Python file defines; names of other packages are ignored."""
    for node in ast.walk(ast.parse(content)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield Text(NAME, node.lineno, node.name)
        elif isinstance(node, ast.arg):
            yield Text(NAME, node.lineno, node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield Text(NAME, node.lineno, node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield Text(NAME, node.lineno, node.attr)


def _list_c_texts(content: str) -> Iterator[Text]:
    """Yield the names, comments and strings with a space of a C file."""
    line, counted = 1, 0
    for match in _C_TOKEN.finditer(content):
        line += content.count("\n", counted, match.start())
        counted = match.start()
        token = match[0]
        if token[0] not in '/"':
            yield Text(NAME, line, token)
        elif token[0] == "/" or " " in token.strip('" '):
            for offset, part in enumerate(_remove_inline_code(token).split("\n")):
                yield Text(PROSE, line + offset, part)


def _list_markdown_prose(content: str) -> Iterator[Text]:
    """Yield the lines of a Markdown page without inline code, and the comments in its code blocks."""
    is_code = False
    for number, line in enumerate(_remove_inline_code(content, _MARKDOWN_CODE).split("\n"), 1):
        if line.lstrip().startswith(("```", "~~~")):
            is_code = not is_code
        elif not is_code:
            yield Text(PROSE, number, line)
        elif (comment := re.search(r"(?:^|\s)#\s(.*)$", line)) is not None:
            yield Text(PROSE, number, comment[1])


def _html_prose(content: str) -> Iterator[Text]:
    """Yield the lines of an HTML file without tags and template expressions."""
    for number, line in enumerate(_remove_inline_code(content, _HTML_CODE).split("\n"), 1):
        yield Text(PROSE, number, line)


def _hash_prose(content: str, *, is_toml: bool) -> Iterator[Text]:
    """Yield the comments of a file whose comments begin with #.

    is_toml: also yield the values of keys that contain prose, such as `description`.
    """
    for number, line in enumerate(content.split("\n"), 1):
        comment = _HASH_COMMENT.search(line)
        if comment is not None:
            yield Text(PROSE, number, comment[1])
        elif is_toml and (value := _TOML_PROSE.match(line)) is not None:
            yield Text(PROSE, number, value[1])


def _remove_inline_code(text: str, pattern: re.Pattern[str] = re.compile(r"`[^`\n]*`")) -> str:
    """Return the text with code replaced by spaces, at the same length.

    A name in code is checked where it is defined.
    """
    return pattern.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
