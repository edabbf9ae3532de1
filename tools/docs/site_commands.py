"""The command reference: the `--help` of every command on one page."""

import inspect
from collections.abc import Iterator
from typing import Any

import typer

from taxel.cli.main import build_app


def list_commands(command: Any = None, path: tuple[str, ...] = ("taxel",)) -> Iterator[tuple[str, Any]]:
    """Yield the full name and the object of each command that has no subcommands.

    command: command or group at which the listing begins; default: `taxel`, so that all commands are listed. path: the
    words of its full name.
    """
    command = typer.main.get_command(build_app(loads_all=True)) if command is None else command
    inner = getattr(command, "commands", None)
    if inner is None:
        yield " ".join(path), command
        return
    for name, subcommand in inner.items():
        yield from list_commands(subcommand, (*path, name))


def make_reference() -> str:
    """Return the Markdown page of all commands with their help, arguments and options."""
    parts = ["# Commands\n", "The help text, arguments and options of every command.\n"]
    for name, command in list_commands():
        parts.append(f"## `{name}`\n")
        parts.append(_format_help(inspect.cleandoc(command.help or "")))
        parts += _make_rows(command.params)
    return "\n".join(parts)


def _format_help(text: str) -> str:
    """Return a command's help text as Markdown; its example becomes a code block with one command per line."""
    prose, separator, example = text.partition("Example")
    if not separator:
        return f"{text}\n"
    _, _, commands = example.partition(": ")
    lines = "\n".join(part.strip() for part in commands.split("; "))
    return f"{prose.strip()}\n\n```sh\n{lines}\n```\n"


def _make_rows(params: list[Any]) -> list[str]:
    """Return the rows of the Markdown table of a command's arguments and options; [] if it has none."""
    rows = ["| argument or option | meaning | default |", "|---|---|---|"]
    for param in params:
        name = ", ".join(param.opts) if param.param_type_name == "option" else (param.metavar or param.name.upper())
        help_text = (getattr(param, "help", "") or "").replace("|", "\\|").replace("<", "&lt;")
        rows.append(f"| `{name}` | {help_text} | {_format_default(param)} |")
    return [*rows, ""] if len(rows) > 2 else []


def _format_default(param: Any) -> str:
    """Return the default of a command-line parameter as shown in the table: "required", the value, or "" without a
    default.
    """
    if param.required:
        return "required"
    value = param.default
    return "" if value is None or value is False or value in ("", [], ()) or callable(value) else f"`{value}`"
