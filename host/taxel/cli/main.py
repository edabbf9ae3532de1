"""Join the commands and turn errors into one line."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import entry_points
from types import MappingProxyType
from typing import Any, Final, NoReturn

import typer

from taxel.errors import TaxelError

COMMANDS: Final[tuple[str, ...]] = (
    *("convert", "demo", "emulate", "feel", "generate", "grasp"),
    *("monitor", "record", "replay", "ros", "show", "thesis"),
)
"""Commands; each is a function in a file of its name in this folder."""

GROUPS: Final = MappingProxyType({"cloud": "cloud:cloud_app", "gap": "gap:gap_app", "import": "import_data:import_app"})
"""Groups of commands: file, and the group in it."""

PLUGINS: Final = "taxel.commands"
"""Entry points of commands from elsewhere."""


def app_of(name: str = "") -> typer.Typer:
    """The program with one command or group; with all of them if that has no such name. What others need is not loaded
    then: half of the time of a short command.
    """
    app = typer.Typer(
        name="taxel",
        help="Tactile skins: emulate, read and record them, and diagnose the gap between simulator and hand.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(lambda: None)  # one command alone is a group as well
    plugins = entry_points(group=PLUGINS)
    every = {*COMMANDS, *GROUPS, *plugins.names}
    wanted = {name} if name in every else every
    for one in [one for one in COMMANDS if one in wanted]:
        app.command(one)(_loaded(f"{one}:{one}"))
    for one in [one for one in GROUPS if one in wanted]:
        app.add_typer(_loaded(GROUPS[one]), name=one)
    for point in [point for point in plugins if point.name in wanted]:
        app.command(point.name)(point.load())
    return app


def _loaded(place: str) -> Any:
    module, _, name = place.partition(":")
    return getattr(import_module(f"taxel.cli.{module}"), name)


def main() -> None:
    """Run a command; the exit status is 0 only on success."""
    try:
        with _ended_as_by_ctrl_c():
            app_of(sys.argv[1] if len(sys.argv) > 1 else "")()
    except TaxelError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error))
    except KeyboardInterrupt:
        sys.exit(130)


@contextmanager
def _ended_as_by_ctrl_c() -> Iterator[None]:
    """A service that is stopped closes its files and ends what it has begun, as at Ctrl-C.

    What SIGTERM did before, it does again afterwards: a program that runs a command may have children of its own, which
    must end at it.
    """
    if threading.current_thread() is not threading.main_thread():  # no other may say what a signal does
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)


def _fail(text: str) -> NoReturn:
    print(f"taxel: {text.splitlines()[0] if text else 'failed'}", file=sys.stderr)
    sys.exit(1)
