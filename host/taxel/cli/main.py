"""Join the commands and turn errors into one line."""

import signal
import sys
import threading
from importlib.metadata import entry_points
from typing import NoReturn

import typer

from taxel.cli.cloud import cloud_app
from taxel.cli.convert import convert
from taxel.cli.demo import demo
from taxel.cli.emulate import emulate
from taxel.cli.feel import feel
from taxel.cli.gap import gap_app
from taxel.cli.generate import generate
from taxel.cli.grasp import grasp
from taxel.cli.import_data import import_app
from taxel.cli.monitor import monitor
from taxel.cli.record import record
from taxel.cli.replay import replay
from taxel.cli.ros import ros
from taxel.cli.show import show
from taxel.cli.thesis import thesis
from taxel.errors import TaxelError

app = typer.Typer(
    name="taxel",
    help="Tactile skins: emulate, read and record them, and diagnose the gap between simulator and hand.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (convert, demo, emulate, feel, generate, grasp, monitor, record, replay, ros, show, thesis):
    app.command()(command)
app.add_typer(cloud_app, name="cloud")
app.add_typer(gap_app, name="gap")
app.add_typer(import_app, name="import")
for point in entry_points(group="taxel.commands"):
    app.command(name=point.name)(point.load())


def main() -> None:
    """Run a command; the exit status is 0 only on success."""
    # A service that is stopped closes its files and ends what it has begun, as at Ctrl-C.
    if threading.current_thread() is threading.main_thread():  # no other may say what a signal does
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        app()
    except TaxelError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error))
    except KeyboardInterrupt:
        sys.exit(130)


def _fail(text: str) -> NoReturn:
    print(f"taxel: {text.splitlines()[0] if text else 'failed'}", file=sys.stderr)
    sys.exit(1)
