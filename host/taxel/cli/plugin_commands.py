"""Commands that other packages add by entry points."""

from collections.abc import Mapping
from typing import Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup

from taxel.errors import TaxelError
from taxel.optional import missing_package
from taxel.plugins import IMPORTERS, PluginError, list_plugin_names, load_plugin, unusable_plugin


def load_command(group: str, name: str, built_in: Mapping[str, str], extra: str | None = None) -> Any:
    """Load a command of the program: a typer function or a `typer.Typer` group.

    group, name: group and name of the entry point. built_in: "module:attribute" of the project's commands by name.
    extra: name of the extra that installs all optional libraries of the command; None: an error message names the extra
    of the missing library. Raises `MissingPackageError` if an optional library is not installed, `PluginError` for an
    object that is not a command.
    """
    try:
        target = load_plugin(group, name, built_in)
    except (ImportError, PluginError) as error:
        cause = error.__cause__ if isinstance(error, PluginError) else error
        replacement = missing_package(cause, f"taxel {name}", extra) if isinstance(cause, ImportError) else None
        if replacement is None:
            raise
        raise replacement from error
    if name not in built_in:
        _check_command(group, name, target)
    return target


class ImporterGroup(TyperGroup):
    """The group `taxel import`: its own commands, and one for each entry point of the group `taxel.importers`."""

    def list_commands(self, ctx: Any) -> list[str]:
        """List the names of all importers, for the help page. Raises `PluginError` if two packages use one name."""
        return [*list_plugin_names(IMPORTERS, dict.fromkeys(self.commands, ""))]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of one importer; None for an unknown name.

        The importer of another package is imported now. If that fails, the returned command raises the error when it is
        called, so that the help page can still be printed.
        """
        if cmd_name in self.commands or cmd_name not in self.list_commands(ctx):
            return super().get_command(ctx, cmd_name)
        try:
            return _as_command(cmd_name, load_command(IMPORTERS, cmd_name, {}))
        except TaxelError as error:
            return _UnusableCommand(cmd_name, error)


class _UnusableCommand(TyperCommand):
    """The command of an entry point that cannot be used: listed on the help page, refused when it is called."""

    def __init__(self, name: str, error: TaxelError) -> None:
        """Create a command that stands for a plug-in that cannot be loaded; its help is the error message."""
        super().__init__(name, help=str(error))
        self._error = error

    def make_context(self, *arguments: Any, **options: Any) -> NoReturn:
        """Raise the error of the plug-in that cannot be loaded, when its command is called."""
        raise self._error


def _check_command(group: str, name: str, target: Any) -> None:
    """Raise `PluginError` if an object cannot become a command. group, name: group and name of its entry point."""
    try:
        if not (isinstance(target, typer.Typer) or callable(target)):
            raise TypeError(f"expected a function or a typer.Typer, found an object of type {type(target).__name__}")
        _as_command(name, target)
    except Exception as error:  # typer raises RuntimeError and others for parameters that cannot become options
        raise unusable_plugin(group, name, str(error)) from error


def _as_command(name: str, target: Any) -> Any:
    """Convert a typer function or group to the command object of the library click."""
    if not isinstance(target, typer.Typer):
        app = typer.Typer()
        app.command(name)(target)
        target = app
    return typer.main.get_command(target)
