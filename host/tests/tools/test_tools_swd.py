"""Programming of blank boards through OpenOCD or pyOCD: the exact command, and the refusals."""

import json
import os

import pytest

from host.tests.command_line import run_taxel
from taxel_tools.files.intel_hex import write_intel_hex

OPENOCD = ["openocd", "-f", "interface/cmsis-dap.cfg", "-c", "transport select swd", "-f", "target/psoc4.cfg", "-c"]


@pytest.fixture
def run(capsys):
    """Runs `taxel flash --swd --unsigned`; returns exit status, standard output and standard error."""

    def call(*arguments):
        status = run_taxel("flash", "--swd", "--unsigned", *arguments)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


@pytest.fixture
def install_tools(tmp_path, monkeypatch):
    """Puts fake executables on an otherwise empty PATH; each writes its arguments to a file."""
    folder = tmp_path / "bin"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))

    def make(*tool_names, body="exit 0"):
        """Install fake tools and return the folder of the PATH. body: shell commands that end each tool."""
        for name in tool_names:
            path = folder / name
            path.write_text(
                f'#!/bin/sh\nfor word in "$@"; do echo "$word"; done > {tmp_path}/{name}.arguments\n{body}\n'
            )
            path.chmod(0o755)
        return folder

    return make


@pytest.fixture
def bootloader(tmp_path):
    """A file with 32 rows from address 0."""
    path = tmp_path / "boot loader.hex"
    path.write_text(write_intel_hex(bytes(range(256)) * 16, 0))
    return path


def read_recorded_arguments(tmp_path, name):
    return (tmp_path / f"{name}.arguments").read_text().splitlines()


def test_openocd_programs_and_verifies_the_file(run, install_tools, bootloader, tmp_path):
    install_tools("openocd", "pyocd")
    status, out, err = run(bootloader)
    assert status == 0, err
    assert read_recorded_arguments(tmp_path, "openocd") == [*OPENOCD[1:], f"program {{{bootloader}}} verify reset exit"]
    assert not (tmp_path / "pyocd.arguments").exists()
    assert "32 rows, 0 to 31, are programmed by SWD (not verified on hardware):" in err
    assert out == "programmed; provision the board, then flash its application over the wire\n"


def test_pyocd_is_used_without_openocd(run, install_tools, bootloader, tmp_path):
    install_tools("pyocd")
    assert run(bootloader)[0] == 0
    assert read_recorded_arguments(tmp_path, "pyocd") == ["load", "--target", "cy8c4245axi-483", str(bootloader)]


def test_tool_and_probe_can_be_selected(run, install_tools, bootloader, tmp_path):
    install_tools("openocd", "pyocd")
    assert run(bootloader, "--swd-tool", "pyocd")[0] == 0
    assert not (tmp_path / "openocd.arguments").exists()
    assert run(bootloader, "--swd-interface", "ftdi/olimex-arm-usb-ocd-h")[0] == 0
    assert read_recorded_arguments(tmp_path, "openocd")[1] == "interface/ftdi/olimex-arm-usb-ocd-h.cfg"


def test_a_dry_run_prints_the_exact_command_and_runs_nothing(run, install_tools, bootloader, tmp_path):
    install_tools("openocd")
    status, out, err = run(bootloader, "--dry-run")
    assert (status, out) == (0, "")
    assert "would be programmed by SWD (not verified on hardware):" in err
    command_text = "openocd -f interface/cmsis-dap.cfg -c 'transport select swd' -f target/psoc4.cfg -c "
    assert f"{command_text}'program {{{bootloader}}} verify reset exit'" in err
    assert not (tmp_path / "openocd.arguments").exists()
    document = json.loads(run(bootloader, "--dry-run", "--json")[1])
    assert document == {"command": [*OPENOCD, f"program {{{bootloader}}} verify reset exit"], "done": False}


def test_a_dry_run_needs_no_program_for_the_debug_port(run, install_tools, bootloader):
    install_tools()
    for options, tool in (((), "openocd"), (("--swd-tool", "pyocd"), "pyocd")):
        status, out, err = run(bootloader, "--dry-run", *options)
        assert (status, out) == (0, "")
        assert f"  {tool} " in err
        assert f"note: {tool} is not on the PATH; install it before the board is programmed" in err
    assert json.loads(run(bootloader, "--dry-run", "--json")[1])["command"][0] == "openocd"


def test_the_command_does_not_use_a_shell(run, install_tools, tmp_path):
    install_tools("pyocd")
    path = tmp_path / "a;touch evil $(touch evil) `touch evil`.hex"
    path.write_text(write_intel_hex(bytes(128), 0))
    assert run(path)[0] == 0
    assert read_recorded_arguments(tmp_path, "pyocd")[-1] == str(path)
    assert "evil" not in os.listdir()


@pytest.mark.parametrize(
    ("installed_tools", "arguments", "problem"),
    [
        ([], [], "--swd: neither openocd nor pyocd is on the PATH; install one: sudo apt install openocd"),
        (["openocd"], ["--swd-tool", "pyocd"], "--swd-tool: pyocd is not on the PATH; install it: pip install pyocd"),
        (["openocd"], ["--swd-tool", "x"], "--swd-tool: expected openocd or pyocd, found 'x'"),
        (["openocd"], ["--swd-interface", "a b"], "--swd-interface: expected a name such as cmsis-dap or jlink"),
        (["openocd"], ["--swd-interface", "../x"], "--swd-interface: expected a name such as cmsis-dap or jlink"),
        (["openocd"], ["--all"], "flash: --swd programs the board on the probe; leave --board, --all"),
        (["openocd"], ["other.hex"], "flash: expected one .hex and no URL with --swd"),
    ],
)
def test_each_refusal_is_one_error_line(run, install_tools, bootloader, installed_tools, arguments, problem):
    install_tools(*installed_tools)
    status, out, err = run(bootloader, *arguments)
    assert (status, out) == (1, "")
    assert problem in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.bin", b"", "file name: expected .hex, found '.bin'; provide the bootloader as Intel HEX"),
        ("a.hex", b"\xff", "file: expected ASCII text, found other bytes"),
        ("a.hex", b":00000001FF\n", "rows: expected a bootloader, from row 0 on, found none"),
        ("a.hex", write_intel_hex(bytes(128), 4096).encode(), "found row 32 first; use the bootloader's file"),
        ("a.hex", write_intel_hex(bytes(128), 0)[:-12].encode(), "file: expected an end record"),
        ("a{.hex", write_intel_hex(bytes(128), 0).encode(), "openocd accepts no braces, quotes, $ or backslashes"),
    ],
)
def test_a_file_without_a_bootloader_is_refused_before_a_tool_runs(
    run, install_tools, tmp_path, name, content, problem
):
    install_tools("openocd")
    path = tmp_path / name
    path.write_bytes(content)
    status, out, err = run(path)
    assert (status, out) == (1, "")
    assert problem in err
    assert err.count("\n") == 1
    assert not (tmp_path / "openocd.arguments").exists()


def test_a_failed_tool_gives_one_error_line_with_its_last_output(run, install_tools, bootloader):
    install_tools("openocd", body="echo one; echo 'Error: no device found' >&2; exit 3")
    status, _, err = run(bootloader)
    assert status == 1
    assert err.splitlines()[-1] == (
        "taxel: openocd: ended with status 3: Error: no device found; check probe, wires and power"
    )


def test_a_tool_that_hangs_is_stopped(run, install_tools, bootloader, monkeypatch):
    monkeypatch.setattr("taxel_tools.swd.TIMEOUT_S", 0.2)
    install_tools("openocd", body="exec /bin/sleep 20")
    assert "taxel: openocd: did not end within 0.2 s; check probe and power" in run(bootloader)[2]


def test_flash_without_files_is_refused(capsys):
    assert run_taxel("flash", "emulator:") == 1
    assert "flash: expected firmware files after the URL, found none" in capsys.readouterr().err
