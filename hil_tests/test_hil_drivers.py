"""Registration of drivers: built-in drivers, drivers of other packages, and single drivers without a rig."""

from contextlib import ExitStack
from pathlib import Path

import pytest

from hil_tests.harness.context import DriverContext
from hil_tests.harness.drivers import DRIVERS, list_driver_names, load_driver
from hil_tests.harness.errors import RigError
from hil_tests.harness.interfaces import INTERFACES
from hil_tests.harness.physical.power import ModemLinePower
from hil_tests.harness.physical.stimulus import OperatorStimulus
from hil_tests.harness.rig import open_rig
from hil_tests.harness.rig_file import load_rig
from host.tests.plugin_package import installed_package
from taxel.link import PortMissingError, open_i2c
from taxel.plugins import HIL_DRIVERS

VIRTUAL = 'hand = "original"\n[uart]\ndriver = "virtual"\n'
RELAY_SOURCE = """
class RelayPower:
    is_virtual = True

    def __init__(self, context, channel: int, is_inverted: bool = False) -> None:
        self.settings = (context.hand.name, channel, is_inverted)
        context.close_at_end(lambda: CLOSED.append(channel))

    def switch(self, on, address=None):
        pass


CLOSED = []
"""


@pytest.fixture
def context() -> DriverContext:
    return DriverContext(load_rig("virtual"), ExitStack())


@pytest.mark.parametrize("key", DRIVERS)
def test_every_registered_driver_implements_the_interface_of_its_device(key: str) -> None:
    device, _, name = key.partition(".")
    driver = load_driver(device, name)
    assert issubclass(driver.driver_class, INTERFACES[device])
    assert driver.is_virtual == (name == "virtual")
    assert name in list_driver_names(device)


def test_options_of_a_driver_are_the_parameters_of_its_constructor() -> None:
    options = load_driver("power", "modem-line").options
    assert [(option.name, option.type, option.is_required) for option in options] == [
        ("port", str, True),
        ("line", str, False),
        ("on_is_high", bool, False),
    ]


def test_driver_of_another_package_is_opened_with_its_options_and_closed(tmp_path: Path) -> None:
    path = tmp_path / "relay.toml"
    path.write_text(VIRTUAL + '[power]\ndriver = "relay"\nchannel = 3\n')
    with installed_package(tmp_path, "relay", RELAY_SOURCE, {HIL_DRIVERS: {"power.relay": "relay:RelayPower"}}):
        assert list_driver_names("power") == ("modem-line", "relay", "virtual")
        with open_rig(load_rig(str(path))) as rig:
            # settings: hand of the rig, `channel` from the rig file, default of `is_inverted`
            assert rig.power.settings == (rig.hand.name, 3, False)
            closed = type(rig.power).__init__.__globals__["CLOSED"]
            assert closed == []  # the driver appends its channel when the rig closes it
        assert closed == [3]


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (
            "class RelayPower:\n    def __init__(self, context): ...\n",
            "does not implement Power; add the methods switch",
        ),
        ("RelayPower = 3\n", "expected a class, found an object of type int"),
        ("raise RuntimeError('no relay')\n", "cannot be loaded .*no relay"),
        (
            "class RelayPower:\n    def __init__(self, context, channel: list): ...\n    def switch(self): ...\n",
            "parameter 'channel' of RelayPower has the type .*list.*; expected one of str, bool, int, float",
        ),
    ],
    ids=["no interface", "no class", "import error", "option type"],
)
def test_unusable_driver_of_another_package_is_rejected_with_a_one_line_message(
    tmp_path: Path, source: str, expected: str
) -> None:
    path = tmp_path / "relay.toml"
    path.write_text(VIRTUAL + '[power]\ndriver = "relay"\n')
    with (
        installed_package(tmp_path, "relay", source, {HIL_DRIVERS: {"power.relay": "relay:RelayPower"}}),
        pytest.raises(RigError, match=expected) as caught,
    ):
        load_rig(str(path))
    assert str(caught.value).startswith(f"rig {path}: [power] ")
    assert "\n" not in str(caught.value)


def test_missing_ports_are_named_in_the_error(context: DriverContext) -> None:
    with pytest.raises(PortMissingError, match=r"/dev/i2c-99: .*No such file.*modprobe i2c-dev"):
        open_i2c("/dev/i2c-99")
    with pytest.raises(RigError, match="power /dev/ttyNONE: cannot be opened"):
        ModemLinePower(context, "/dev/ttyNONE")


def test_unknown_modem_line_is_rejected_with_the_permitted_lines(context: DriverContext) -> None:
    with pytest.raises(RigError, match="line = 'cts'; expected rts or dtr"):
        ModemLinePower(context, "loop://", "cts")


def test_modem_line_switches_the_whole_rig_and_no_single_board_until_its_port_is_closed(context: DriverContext) -> None:
    power = ModemLinePower(context, "loop://", "rts")
    assert power._port.rts
    power.switch(False)
    assert not power._port.rts
    with pytest.raises(RigError, match="board 0x1C cannot be switched alone"):
        power.switch(False, 0x1C)
    context.exit_stack.close()
    assert not power._port.is_open


def test_operator_receives_the_taxel_and_the_force(context: DriverContext, monkeypatch: pytest.MonkeyPatch) -> None:
    prompts: list[str] = []
    monkeypatch.setattr("builtins.input", prompts.append)
    stimulus = OperatorStimulus(context)
    stimulus.press(0x1C, 5, 3.0)
    stimulus.release()
    assert prompts[0].startswith("press taxel 5 of ")
    assert "(0x1C) with 3 N" in prompts[0]
    assert prompts[1] == "remove the probe from the skin, then Return: "
