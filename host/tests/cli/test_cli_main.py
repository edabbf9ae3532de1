"""The program `taxel` loads only the requested command, and lists all commands on its help page."""

import signal
import subprocess
import sys

import typer

import taxel
from host.tests.command_line import run_refused_command, run_taxel
from taxel.cli.commands import COMMANDS
from taxel.cli.main import build_app
from taxel.cli.renamed_options import RENAMED


def list_command_names(app: typer.Typer) -> set[str]:
    """Return the names of the top-level commands."""
    return set(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def is_loaded(app: typer.Typer, name: str) -> bool:
    """Return whether a command has its real options or subcommands; a command that is not loaded has none."""
    command = typer.main.get_command(app).commands[name]  # type: ignore[attr-defined]
    return bool(getattr(command, "commands", None) or command.params)


def test_only_the_requested_command_is_loaded():
    app = build_app("record")
    assert is_loaded(app, "record")
    assert not is_loaded(app, "monitor")
    assert list_command_names(app) == list_command_names(build_app(loads_all=True))


def test_the_help_page_lists_all_commands_without_loading_one():
    for argument in ("", "--help", "no_such_command"):
        app = build_app(argument)
        assert {"gap", "cloud", "import", "record", "thesis", "bench", "flash"} <= list_command_names(app)
        assert not any(is_loaded(app, name) for name in list_command_names(app))


def test_the_summary_of_a_command_is_the_first_line_of_its_help():
    commands = typer.main.get_command(build_app(loads_all=True)).commands  # type: ignore[attr-defined]
    for name in ("monitor", "record", "replay", "convert", "grasp", "show", "thesis", "demo", "feel", "gap"):
        assert " ".join(commands[name].help.split("\n\n")[0].split()) == COMMANDS[name].summary, name


def test_a_former_option_name_is_refused_with_the_new_name(capsys):
    line = run_refused_command(capsys, "grasp", "--source", "sim", "--objects", "cylinder", "--out", "x.h5")
    assert line == "taxel: grasp: the option --objects is now named --object"
    line = run_refused_command(capsys, "import", "gazebo", "contacts.csv", "--threshold-mm=2", "--out", "x.h5")
    assert line == "taxel: import gazebo: the option --threshold-mm is now named --distance-mm"


def test_every_former_option_name_is_gone_and_its_new_name_exists():
    commands = typer.main.get_command(build_app(loads_all=True)).commands  # type: ignore[attr-defined]
    for path, renamed in RENAMED.items():
        group, *names = path.split()
        command = commands[group].commands[names[0]] if names else commands[group]
        options = {option for parameter in command.params for option in parameter.opts}
        assert set(renamed.values()) <= options, path
        assert not renamed.keys() & options, path


def test_an_unknown_command_or_an_invalid_option_gives_one_error_line(capsys):
    assert run_refused_command(capsys, "no_such_command").startswith("taxel: No such command 'no_such_command'")
    assert "'--port': 70000" in run_refused_command(capsys, "monitor", "emulator:", "--port", 70000)


def test_the_version_is_printed(capsys):
    assert run_taxel("--version") == 0
    assert capsys.readouterr().out == f"taxel {taxel.__version__}\n"


def test_importing_taxel_loads_no_numerical_library():
    program = "import sys, taxel; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout.split()
    assert not {"numpy", "scipy", "h5py", "matplotlib", "typer"} & set(modules)


def test_the_gap_command_does_not_load_matplotlib_or_other_commands():
    program = "import sys; from taxel.cli.main import build_app; build_app('gap'); print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True).stdout.split()
    assert "taxel.gap.diagnosis" in modules
    assert not {"matplotlib", "taxel.cli.thesis", "taxel.blind.run", "taxel_tools.bench"} & set(modules)


def test_a_command_restores_the_signal_handlers_of_its_caller(capsys):
    # Otherwise, child processes that are forked later treat SIGTERM like Ctrl-C and do not end.
    before = signal.getsignal(signal.SIGTERM)
    assert run_taxel("cloud", "convert", "none.ply", "out.ply") == 1
    assert signal.getsignal(signal.SIGTERM) is before
