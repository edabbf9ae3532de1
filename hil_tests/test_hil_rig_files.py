"""A rig file that is wrong is refused in one line that names the file and the field."""

from pathlib import Path

import pytest

from hil_tests.harness.errors import RigError
from hil_tests.harness.physical.power import ModemLinePower
from hil_tests.harness.physical.stimulus import OperatorStimulus
from hil_tests.harness.rig import ABILITIES, abilities_of
from hil_tests.harness.rig_file import load_rig
from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.link import PortMissingError, open_i2c

GOOD = 'hand = "allegro"\n[uart]\ndriver = "serial"\nurl = "serial:///dev/ttyUSB0"\n'
VIRTUAL = 'hand = "allegro"\n[uart]\ndriver = "virtual"\n'

WRONG = {
    "not TOML": ("= 3", "is not TOML"),
    "no hand": ('[uart]\ndriver = "virtual"\n', "'hand' is missing"),
    "hand a number": ("hand = 3\n", "hand = 3; expected a str"),
    "no uart": ('hand = "allegro"\n', r"\[uart\] is missing"),
    "unknown word": ("boards = 3\n" + GOOD, "'boards' is unknown"),
    "uart not a table": ('hand = "allegro"\nuart = "x"\n', "uart is not a table"),
    "unknown driver": (
        'hand = "allegro"\n[uart]\ndriver = "usb"\n',
        "'usb' is unknown; expected serial, virtual",
    ),
    "no url": ('hand = "allegro"\n[uart]\ndriver = "serial"\n', "'url' is missing"),
    "unknown option": (GOOD + "speed = 3\n", "'speed' is unknown; serial takes url"),
    "option of another type": (GOOD + '[i2c]\ndriver = "linux"\nbus = 1\n', "bus = 1; expected a str"),
    "mixed": (GOOD + '[i2c]\ndriver = "virtual"\n', "mixed"),
    "world of a bench": (GOOD + "[world]\nseed = 3\n", r"\[world\] is of virtual rigs only"),
    "unknown number of a world": (VIRTUAL + "[world]\nspeed = 3\n", "speed = 3; expected numbers of"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_rig_file_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    text, expected = WRONG[case]
    path = tmp_path / "bench.toml"
    path.write_text(text)
    with pytest.raises(RigError, match=expected) as caught:
        load_rig(str(path))
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_an_unknown_rig_names_those_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"physical\.example, virtual"):
        load_rig("nowhere")
    path = tmp_path / "bench.toml"
    path.write_text('hand = "octopus"\n[uart]\ndriver = "virtual"\n')
    with pytest.raises(TaxelError):
        load_rig(str(path))


def test_a_rig_can_what_its_file_names(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(GOOD + '[can]\ndriver = "python-can"\nurl = "can:virtual:x"\n')
    assert abilities_of(load_rig(str(path))) == {"uart", "can"}
    assert abilities_of(load_rig("virtual")) == set(ABILITIES)


def test_devices_that_are_not_there_are_named() -> None:
    with pytest.raises(PortMissingError, match=r"/dev/i2c-99: .*No such file.*modprobe i2c-dev"):
        open_i2c("/dev/i2c-99")
    with pytest.raises(RigError, match="power /dev/ttyNONE: cannot be opened"):
        ModemLinePower("/dev/ttyNONE")
    with pytest.raises(RigError, match="line = 'cts'; expected rts or dtr"):
        ModemLinePower("loop://", "cts")


def test_a_modem_line_switches_the_whole_rig_and_no_single_board() -> None:
    power = ModemLinePower("loop://", "rts")
    assert power._port.rts
    power.switch(False)
    assert not power._port.rts
    with pytest.raises(RigError, match="board 0x22 cannot be switched alone"):
        power.switch(False, 0x22)
    power.close()


def test_an_operator_is_told_what_to_press(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    monkeypatch.setattr("builtins.input", told.append)
    stimulus = OperatorStimulus(load_hand("allegro"))
    stimulus.press(0x22, 5, 3.0)
    stimulus.release()
    assert told[0].startswith("press taxel 5 of ")
    assert "(0x22) with 3 N" in told[0]
    assert told[1] == "let go of everything, then Return: "
