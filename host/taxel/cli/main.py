"""The program `taxel`: finds the requested command, runs it, and prints an error as one line."""

import os
import sys
from typing import Annotated, Any, Final, NoReturn

import typer

from taxel.cli.commands import COMMANDS, OTHER, CommandEntry
from taxel.cli.plugin_commands import load_command
from taxel.cli.renamed_options import refuse_renamed
from taxel.cli.termination import interrupted_by_sigterm
from taxel.errors import LONGEST_MESSAGE, TaxelError, fit_line
from taxel.optional import missing_package
from taxel.plugins import COMMANDS as COMMANDS_GROUP
from taxel.plugins import list_plugin_names, plugin_distribution
from taxel.version import VERSION

COMPLETION_VARIABLE: Final = "_TAXEL_COMPLETE"
"""Environment variable that the shell's completion script sets."""

_TARGETS: Final = {name: entry.target for name, entry in COMMANDS.items() if entry.target}


def build_app(name: str = "", *, loads_all: bool = False) -> typer.Typer:
    """Build the command-line program `taxel` as a typer application.

    name: the command that will run; only this command is imported, and the others are listed with their summaries. With
    "" or an unknown name no command is imported, which is sufficient for the help page. loads_all: import all commands.
    """
    app = typer.Typer(
        name="taxel",
        help="Tactile skins: read, record and emulate them, and diagnose the gap between simulator and hand.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_declare_options)
    available = list_plugin_names(COMMANDS_GROUP, _TARGETS)
    in_order = [command for command in COMMANDS if command in available]
    for command in [*in_order, *(command for command in available if command not in COMMANDS)]:
        entry = COMMANDS.get(command)
        if loads_all or command == name:
            _add_loaded(app, command, entry)
        else:
            package = plugin_distribution(COMMANDS_GROUP, command)
            summary = entry.summary if entry is not None else f"Command of the package '{package}'; see its own --help."
            panel = entry.panel if entry is not None else OTHER
            app.command(command, help=summary, rich_help_panel=panel)(_not_loaded)
    return app


def _add_loaded(app: typer.Typer, name: str, entry: CommandEntry | None) -> None:
    """Import a command and add it to the application. entry: summary and panel of a built-in command; None: plug-in."""
    target = load_command(COMMANDS_GROUP, name, _TARGETS, entry.extra if entry is not None else None)
    panel = entry.panel if entry is not None else OTHER
    if isinstance(target, typer.Typer):
        app.add_typer(target, name=name, rich_help_panel=panel)
    else:
        app.command(name, rich_help_panel=panel)(target)


def _print_version(is_requested: bool) -> None:
    """Print the version and exit, if the option `--version` was given."""
    if is_requested:
        print(f"taxel {VERSION}")
        raise typer.Exit


def _declare_options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Declare the options of the program itself, which precede the command; --version exits in its callback."""


def _not_loaded() -> NoReturn:
    """Stand for a command that is listed on the help page but not imported; a call is an error."""
    raise AssertionError("only the help page uses a command that is not loaded")


def main() -> None:
    """Run the command of `sys.argv` and exit.

    The exit status is 0 for success, 1 for an error, which is printed as one line, 2 for a wrong command line, and 130
    after Ctrl-C or SIGTERM. A command may exit with a status of its own.
    """
    name = _get_requested_command()
    try:
        with interrupted_by_sigterm():
            refuse_renamed(sys.argv[1:])
            status = typer.main.get_command(build_app(name))(prog_name="taxel", standalone_mode=False)
    except TaxelError as error:
        _fail(str(error))
    except typer.BadParameter.__base__ as error:  # type: ignore[misc] # click's UsageError, which typer does not export
        _fail_usage(error)
    except ModuleNotFoundError as error:
        entry = COMMANDS.get(name)
        replacement = missing_package(error, f"taxel {name}", entry.extra if entry is not None else None)
        if replacement is None:
            raise
        _fail(str(replacement))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error))
    except KeyboardInterrupt:
        sys.exit(130)
    except typer.Abort:
        _fail("interrupted at a question")
    sys.exit(status if isinstance(status, int) else 0)


def _fail_usage(error: Any) -> NoReturn:
    """Print one line for a wrong command line and exit with status 2; print the help page if there is no argument.

    error: `UsageError` of the library click.
    """
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        sys.exit(2)
    path = error.ctx.command_path if error.ctx is not None else "taxel"
    message = " ".join(error.format_message().split()).rstrip(".")
    subject = path.removeprefix("taxel").strip()
    print(
        f"taxel: {subject}: {message}" if subject else f"taxel: {message}",
        f"see {path} --help",
        sep="; ",
        file=sys.stderr,
    )
    sys.exit(2)


def _get_requested_command() -> str:
    """Return the first argument after `taxel`: the command to run, or the command that the shell completes.

    "" if there is no argument.
    """
    if COMPLETION_VARIABLE in os.environ:
        arguments = os.environ.get("COMP_WORDS", os.environ.get("_TYPER_COMPLETE_ARGS", "")).split()
    else:
        arguments = sys.argv
    return arguments[1] if len(arguments) > 1 else ""


def _fail(text: str) -> NoReturn:
    """Print the first line of an error message to standard error and exit with status 1."""
    first = text.splitlines()[0] if text else "failed"
    print(f"taxel: {fit_line(first, LONGEST_MESSAGE)}", file=sys.stderr)
    sys.exit(1)
