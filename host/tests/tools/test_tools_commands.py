"""`taxel scan`, `taxel provision`, `taxel flash`: printed output, and refusals with one error line."""

import json

import pytest

from host.tests.command_line import run_taxel
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.files.cyacd import write_cyacd
from taxel_tools.signing import load_development_key, sign_images

URL = "emulator:?hand=rig4"
BLANK = f"{URL}&word=blank 0x50"


@pytest.fixture
def run(capsys):
    """Runs `taxel`; returns exit status, standard output and standard error."""

    def call(*arguments):
        status = run_taxel(*arguments)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


@pytest.fixture
def files(tmp_path, make_image):
    """Writes the firmware files of both slots."""

    def write(name="fw", **options):
        """Write signed files of both slots and return their paths. options: of `make_image`."""
        paths = []
        for slot in (0, 1):
            image = make_image(slot, **options)
            paths.append(tmp_path / f"{name}-{'ab'[slot]}.cyacd")
            paths[-1].write_text(write_cyacd(image, LAYOUTS[image.device].first_rows[slot]))
        sign_images(paths, load_development_key())
        return paths

    return write


def test_scan_with_a_hand_names_the_branch_of_which_no_board_answers(run):
    url = "emulator:?hand=original&word=fault 0.1 branch_open 0x08 0"
    status, out, _ = run("scan", url, "--hand", "original")
    assert status == 1
    assert "branch fault: no response from branch index (all 5 boards: 0x08, 0x0A, " in out.splitlines()[-1]


def test_scan_with_a_complete_hand_succeeds(run):
    status, out, _ = run("scan", URL, "--hand", "rig4")
    assert status == 0
    assert "no response" not in out


@pytest.mark.parametrize("name", ["scan", "provision", "flash"])
def test_the_help_of_each_command_contains_an_example(run, name):
    status, out, _ = run(name, "--help")
    assert status == 0
    assert f"Example: taxel {name} " in " ".join(out.split())


@pytest.mark.parametrize("wire", ["hub", "i2c"])
def test_scan_prints_a_line_for_each_board(run, wire):
    status, out, _ = run("scan", f"{URL}&wire={wire}")
    assert status == 0
    lines = out.splitlines()
    assert lines[0].split() == ["address", "runs", "kind", "version", "taxels", "unique", "id", "health"]
    assert lines[1].split()[:4] == ["0x50", "application", "9", "0.1.0"]
    assert lines[-1] == "4 boards, 0 with notes"


def test_scan_prints_json(run):
    devices = json.loads(run("scan", URL, "--json")[1])
    assert [device["address"] for device in devices] == [0x50, 0x51, 0x52, 0x53]


def test_flash_updates_all_boards_and_prints_a_table(run, files):
    status, out, err = run("flash", URL, *files(), "--all")
    assert status == 0, err
    assert "4 boards: 8 rows of version 1.2.3 (slot A and B) will be written to the free slot of each board" in err
    assert [line.split()[:6] for line in out.splitlines()[1:]] == [
        [f"0x{address:02X}", "0.1.0", "1.2.3", "B", "8", "0"] for address in (0x50, 0x51, 0x52, 0x53)
    ]


def test_flash_updates_a_list_of_boards_and_prints_json(run, files):
    # 83 is 0x53 in decimal notation.
    status, out, _ = run("flash", URL, *files(), "--board", "0x51", "--board", "83", "--json")
    document = json.loads(out)
    assert status == 0
    assert [(outcome["address"], outcome["after"]) for outcome in document["done"]] == [
        (0x51, [1, 2, 3]),
        (0x53, [1, 2, 3]),
    ]


def test_a_dry_run_of_flash_prints_the_changes_and_writes_nothing(run, files):
    status, out, err = run("flash", URL, *files(), "--board", "0x51", "--dry-run")
    assert (status, out) == (0, "")
    assert "1 board: 8 rows of version 1.2.3 (slot A and B) would be written" in err
    assert "0x51  0.1.0 -> 1.2.3" in err


@pytest.mark.parametrize(
    ("arguments", "expected_text"),
    [
        (["--board", "0x60"], "board 0x60: does not answer; run taxel scan to list the boards"),
        (["--board", "x"], "--board: expected an I2C address from 0x08 to 0x77, found 'x'"),
        ([], "flash: expected --board ADDRESS (repeatable) or --all, found neither"),
        (
            ["--all", "--board", "0x50"],
            "flash: expected one of --board ADDRESS (repeatable), --all and --hub, found several",
        ),
        (["--all", "--hub"], "flash: expected one of --board ADDRESS (repeatable), --all and --hub, found several"),
    ],
)
def test_flash_refuses_missing_boards_and_contradicting_options(run, files, arguments, expected_text):
    status, out, err = run("flash", URL, *files(), *arguments)
    assert (status, out) == (1, "")
    assert err.startswith(f"taxel: {expected_text}")
    assert err.count("\n") == 1


def test_flash_refuses_a_file_of_another_kind(run, files):
    status, _, err = run("flash", URL, *files(kind=77), "--all")
    assert status == 1
    assert "expected a board of kind 77 on the bus, found none" in err
    assert "board 0x50: the board is of kind 9, but " in run("flash", URL, *files(kind=77), "--board", "0x50")[2]


def test_flash_refuses_a_damaged_file_and_a_missing_file(run, files, tmp_path):
    path = files()[0]
    path.write_text(path.read_text()[:-31])  # without the last 15 bytes (30 digits) and the end of the line
    status, _, err = run("flash", URL, path, "--all")
    assert status == 1
    assert f"{path}: line 9: expected 128 bytes of data, found 113; the line is truncated" in err
    assert "No such file" in run("flash", URL, tmp_path / "none.hex", "--all")[2]


def test_flash_that_fails_on_a_board_ends_with_the_error_of_the_board(run, files):
    status, _, err = run("flash", URL, files()[0], "--board", "0x50")
    assert status == 1
    assert "taxel: not updated: 1 of 1 board: board 0x50: the free slot is B, but " in err


@pytest.mark.parametrize("options", [[], ["--hub"]])
def test_flash_of_a_file_for_the_hub_updates_the_hub(run, files, options):
    status, out, err = run("flash", URL, *files("hub", device=BootDevice.HUB), *options)
    assert status == 0, err
    assert "the hub: 8 rows of version 1.2.3 (slot A and B) will be written to its free slot" in err
    assert "0.1.0 -> 1.2.3, 4 boards polled" in err
    assert out.splitlines()[1].split()[:6] == ["hub", "0.1.0", "1.2.3", "B", "8", "0"]
    assert out.splitlines()[1].endswith("confirmed, 4 boards polled")


def test_flash_of_the_hub_prints_json(run, files):
    status, out, _ = run("flash", URL, *files("hub", device=BootDevice.HUB), "--json")
    document = json.loads(out)
    assert status == 0
    assert (document["done"]["after"], document["boards"]) == ([1, 2, 3], [0x50, 0x51, 0x52, 0x53])


def test_a_dry_run_for_the_hub_prints_the_changes_and_writes_nothing(run, files):
    hub = files("hub", device=BootDevice.HUB)
    status, out, err = run("flash", URL, *hub, "--dry-run")
    assert (status, out) == (0, "")
    assert "the hub: 8 rows of version 1.2.3 (slot A and B) would be written to its free slot" in err
    document = json.loads(run("flash", URL, *hub, "--dry-run", "--json")[1])
    assert document == {"hub": "0.1.0", "boards": [0x50, 0x51, 0x52, 0x53], "version": "1.2.3"}


def test_boards_and_the_hub_are_not_flashed_by_one_command(run, files):
    mixed_files = [files()[0], files("hub", device=BootDevice.HUB)[1]]
    status, out, err = run("flash", URL, *mixed_files, "--all")
    assert (status, out) == (1, "")
    assert err.endswith("found hub; flash boards and the hub with separate commands\n")
    assert f"{mixed_files[1]}: image device: expected board, as in {mixed_files[0]}" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("device", "url", "options", "problem"),
    [
        (BootDevice.HUB, URL, ["--all"], "found an image for the hub; leave --board and --all out"),
        (BootDevice.HUB, URL, ["--board", "0x50"], "found an image for the hub; leave --board and --all out"),
        (BootDevice.BOARD, URL, ["--hub"], "found an image for sensor boards; leave --hub out"),
        (BootDevice.HUB, f"{URL}&wire=i2c", [], "is the boards' bus; the hub accepts firmware only on its UART"),
        (BootDevice.HUB, "/dev/i2c-1", ["--unsigned"], "/dev/i2c-1: is the boards' bus"),
        (BootDevice.HUB, "serial:///dev/ttyNONE", ["--unsigned"], "/dev/ttyNONE: cannot be opened"),
    ],
)
def test_flash_refuses_files_options_and_urls_that_do_not_fit_the_hub(run, files, device, url, options, problem):
    status, out, err = run("flash", url, *files(device=device), *options)
    assert (status, out) == (1, "")
    assert problem in err
    assert err.count("\n") == 1


def test_flash_of_the_hub_that_fails_ends_with_the_error_of_the_hub(run, files):
    status, _, err = run("flash", URL, files("hub", device=BootDevice.HUB)[0])
    assert status == 1
    assert err.splitlines()[-1].startswith("taxel: not updated: hub: the free slot is B, but ")


def test_provision_assigns_an_address_to_a_blank_board(run):
    status, out, err = run(
        "provision", BLANK, "--new-address", "0x50", "--kind", "1", "--serial", "FT-7", "--idac", "16,17"
    )
    assert status == 0
    assert "boards at 0x77 restart into their bootloaders" in err
    assert " at 0x77 -> 0x50, kind 1, serial 'FT-7' is written" in err
    assert out.splitlines()[1].split()[1:] == ["0x77", "0x50", "1", "FT-7", "16", "17", "written"]
    assert out.splitlines()[-1] == "1 board found, 1 changed"


def test_provision_search_and_dry_run_write_nothing(run):
    search_output = run("provision", f"{BLANK}&word=blank 0x51", "--search")[1]
    assert "2 boards found, 0 changed" in search_output
    identity = search_output.splitlines()[1].split()[0]
    dry_run = run(
        "provision", f"{BLANK}&word=blank 0x51", "--id", identity, "--new-address", "0x30", "--dry-run", "--json"
    )
    document = json.loads(dry_run[1])
    assert (document["written"], document["changes"][0]["configuration"]["address"]) == (False, 0x30)


@pytest.mark.parametrize(
    ("url", "arguments", "expected_text"),
    [
        (URL, ["--new-address", "0x30"], "board 0x77: no board answers at this address; check power and address"),
        (BLANK, ["--new-address", "0x51"], "board 0x51: the address is in use already"),
        (BLANK, [], "provision: expected values to write"),
        (BLANK, ["--new-address", "0x99"], "--new-address: expected an I2C address from 0x08 to 0x77, found '0x99'"),
        (BLANK, ["--kind", "999"], "provision: --kind: expected 0 to 255, found 999"),
        (BLANK, ["--idac", "1,x"], "provision: --idac_codes: expected at most 16 numbers"),
        (BLANK, ["--plan", "none.toml"], "none.toml: No such file"),
        (BLANK, ["--plan", "none.toml", "--kind", "1"], "--plan: expected no other values"),
        (f"{BLANK}&word=blank 0x51", ["--new-address", "0x30"], "board 0x77: 2 boards answer ("),
    ],
)
def test_provision_refuses_invalid_values_and_missing_boards(run, url, arguments, expected_text):
    status, out, err = run("provision", url, *arguments)
    assert (status, out) == (1, "")
    assert err.splitlines()[-1].startswith(f"taxel: {expected_text}")


@pytest.mark.parametrize(
    ("url", "expected_text"),
    [
        ("nothing", "nothing: is not a URL that can be opened"),
        ("/dev/i2c-99", "/dev/i2c-99: cannot be opened (No such file or directory); "),
        ("serial:///dev/ttyNONE", "/dev/ttyNONE: "),
        ("emulator:?colour=1", "unknown option 'colour'"),
        ("emulator:?wire=x", "option 'wire' must be hub or i2c"),
        ("emulator:?baud=x", "option 'baud' must be a number, found 'x'"),
        ("emulator:?word=nonsense", "virtual rig: "),
        ("emulator:?hand=none", "none"),
    ],
)
def test_a_bus_that_cannot_be_opened_gives_one_error_line(run, url, expected_text):
    status, out, err = run("scan", url)
    assert (status, out) == (1, "")
    assert expected_text in err
    assert err.count("\n") == 1
