"""Rig files: an invalid rig file is rejected with one line that names the file and the field."""

from pathlib import Path

import pytest

from hil_tests.harness.errors import RigError
from hil_tests.harness.rig import ABILITIES, get_abilities
from hil_tests.harness.rig_file import RIGS, load_rig
from taxel.errors import TaxelError

PHYSICAL = 'hand = "original"\n[uart]\ndriver = "serial"\nurl = "serial:///dev/ttyUSB0"\n'
VIRTUAL = 'hand = "original"\n[uart]\ndriver = "virtual"\n'

INVALID_FILES = {
    "not TOML": ("= 3", "is not TOML"),
    "no hand": ('[uart]\ndriver = "virtual"\n', "'hand' is missing"),
    "hand a number": ("hand = 3\n", "hand = 3; expected a str"),
    "no uart": ('hand = "original"\n', r"\[uart\] is missing"),
    "unknown key": ("boards = 3\n" + PHYSICAL, "'boards' is unknown"),
    "uart not a table": ('hand = "original"\nuart = "x"\n', "uart is not a table"),
    "unknown driver": (
        'hand = "original"\n[uart]\ndriver = "usb"\n',
        r"\[uart\] driver = 'usb' is unknown; expected serial, virtual",
    ),
    "no url": ('hand = "original"\n[uart]\ndriver = "serial"\n', "'url' is missing"),
    "unknown option": (PHYSICAL + "speed = 3\n", "'speed' is unknown; serial takes url"),
    "option of another type": (PHYSICAL + '[i2c]\ndriver = "linux"\nbus = 1\n', "bus = 1; expected a str"),
    "no port of the power switch": (PHYSICAL + '[power]\ndriver = "modem-line"\n', r"\[power\] 'port' is missing"),
    "number in place of a truth value": (
        PHYSICAL + '[power]\ndriver = "modem-line"\nport = "x"\non_is_high = 1\n',
        "on_is_high = 1; expected a bool",
    ),
    "virtual and physical": (PHYSICAL + '[i2c]\ndriver = "virtual"\n', "mixed"),
    "world on a physical rig": (PHYSICAL + "[world]\nseed = 3\n", "'world' applies to virtual rigs only"),
    "executed on a physical rig": ('executed = ["hub"]\n' + PHYSICAL, "'executed' applies to virtual rigs only"),
    "world not a table": ("world = 3\n" + VIRTUAL, "world is not a table"),
    "unknown setting of the world": (VIRTUAL + "[world]\nspeed = 3\n", "speed = 3; expected numbers for"),
    "unknown executed board": ("executed = [0x77]\n" + VIRTUAL, 'expected a list of "hub" and addresses'),
}


def write_rig(folder: Path, text: str) -> str:
    """Write a rig file with the given text. Returns its path."""
    path = folder / "bench.toml"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize("case", INVALID_FILES)
def test_invalid_rig_file_is_rejected_with_a_one_line_message_that_names_the_file(tmp_path: Path, case: str) -> None:
    text, expected = INVALID_FILES[case]
    path = write_rig(tmp_path, text)
    with pytest.raises(RigError, match=expected) as caught:
        load_rig(path)
    assert "\n" not in str(caught.value)
    assert path in str(caught.value)


def test_unknown_rig_name_is_rejected_with_the_names_of_the_rigs() -> None:
    with pytest.raises(RigError, match=r"physical\.example, psoc4100s, virtual"):
        load_rig("nowhere")


def test_unknown_hand_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(TaxelError, match="octopus"):
        load_rig(write_rig(tmp_path, 'hand = "octopus"\n[uart]\ndriver = "virtual"\n'))


def test_abilities_of_a_physical_rig_are_the_devices_of_its_file(tmp_path: Path) -> None:
    text = PHYSICAL + '[can]\ndriver = "python-can"\nurl = "can:virtual:x"\n'
    assert get_abilities(load_rig(write_rig(tmp_path, text))) == {"uart", "can"}


def test_virtual_rig_has_all_abilities(tmp_path: Path) -> None:
    assert get_abilities(load_rig("virtual")) == set(ABILITIES)
    assert get_abilities(load_rig(write_rig(tmp_path, VIRTUAL))) == set(ABILITIES)


def test_rig_with_executed_images_lacks_only_settable_clocks_and_long_virtual_times() -> None:
    assert set(ABILITIES) - get_abilities(load_rig("cortex-m0")) == {"clocks", "hours"}


@pytest.mark.parametrize("path", sorted(RIGS.glob("*.toml")), ids=lambda path: path.stem)
def test_every_rig_file_of_the_repository_is_valid(path: Path) -> None:
    description = load_rig(str(path))
    assert description.is_virtual == ("physical" not in path.stem)
