"""The command reference: what `--help` says of every command, as one page."""

import inspect
from collections.abc import Iterator
from typing import Any

import typer

from taxel.cli.main import build_app


def walk(command: Any = None, path: tuple[str, ...] = ("taxel",)) -> Iterator[tuple[str, Any]]:
    """Every command that does something, by its full name."""
    command = typer.main.get_command(build_app(loads_all=True)) if command is None else command
    inner = getattr(command, "commands", None)
    if inner is None:
        yield " ".join(path), command
        return
    for name, one in inner.items():
        yield from walk(one, (*path, name))


def reference() -> str:
    """The page."""
    parts = ["# Commands\n", "Every command, as its `--help` has it.\n"]
    for name, command in walk():
        parts.append(f"## `{name}`\n")
        parts.append(_prose(inspect.cleandoc(command.help or "")))
        parts += _rows(command.params)
    return "\n".join(parts)


def _prose(text: str) -> str:
    """The example stands apart, as one would type it."""
    prose, word, example = text.partition("Example")
    if not word:
        return f"{text}\n"
    _, _, words = example.partition(": ")
    lines = "\n".join(part.strip() for part in words.split("; "))
    return f"{prose.strip()}\n\n```sh\n{lines}\n```\n"


def _rows(params: list[Any]) -> list[str]:
    rows = ["| argument or option | | default |", "|---|---|---|"]
    for param in params:
        name = ", ".join(param.opts) if param.param_type_name == "option" else (param.metavar or param.name.upper())
        said = (getattr(param, "help", "") or "").replace("|", "\\|").replace("<", "&lt;")
        rows.append(f"| `{name}` | {said} | {_default(param)} |")
    return [*rows, ""] if len(rows) > 2 else []


def _default(param: Any) -> str:
    if param.required:
        return "required"
    value = param.default
    return "" if value is None or value is False or value in ("", [], ()) or callable(value) else f"`{value}`"
