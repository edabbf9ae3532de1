"""The monitor reads the fault record of a board that the hub reports as restarted, once."""

import pytest

from taxel.stream.fault_record import HARD_FAULT, FaultRecord
from taxel.stream.hub_client import HubError
from taxel_protocol.names import BoardFault, FaultCode

RECORD = FaultRecord(FaultCode.EXCEPTION, HARD_FAULT, 1, 0x1A2C, 0x1B47)


@pytest.fixture
def skin(fake_skin):
    """A skin with a complete baseline; `read_addresses` lists the boards whose fault record was read."""
    skin = fake_skin()
    skin.read_addresses = []

    def read_board_fault(address):
        skin.read_addresses.append(address)
        return RECORD

    skin.hub.read_board_fault = read_board_fault
    skin.pass_time(2.0)
    return skin


def report_fault(skin, fault):
    """Let the hub report a fault of the first board; return the address of this board."""
    address = skin.hand.boards[0].address
    skin.hub.faults.append({"address": address, "fault": int(fault)})
    return address


def test_advice_states_the_fault_of_a_restarted_board_in_every_reading(skin):
    assert skin.read().advice is None
    address = report_fault(skin, BoardFault.RESTARTED)
    for _ in range(3):
        text = f"board 0x{address:02X} has restarted: HardFault at PC 0x00001A2C, LR 0x00001B47"
        assert skin.read().advice == text


def test_fault_record_is_read_once_for_each_restart(skin):
    address = report_fault(skin, BoardFault.RESTARTED)
    skin.read()
    skin.read()
    assert skin.read_addresses == [address]
    report_fault(skin, BoardFault.RESTARTED)
    skin.read()
    assert skin.read_addresses == [address, address]


def test_fault_other_than_a_restart_causes_no_advice_and_no_reading_of_a_record(skin):
    report_fault(skin, BoardFault.NACK)
    assert skin.read().advice is None
    assert skin.read_addresses == []


def test_restarted_board_without_a_fault_record_causes_no_advice(skin):
    skin.hub.read_board_fault = lambda address: None
    report_fault(skin, BoardFault.RESTARTED)
    assert skin.read().advice is None


def test_restarted_board_that_does_not_answer_causes_no_advice_and_no_exception(skin):
    def refuse_reading(address):
        raise HubError("nack")

    skin.hub.read_board_fault = refuse_reading
    report_fault(skin, BoardFault.RESTARTED)
    assert skin.read().advice is None
