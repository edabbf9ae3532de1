"""The monitor reads the fault record of a board that the hub reports as restarted, once."""

import pytest

from taxel.stream.fault_record import HARD_FAULT, FaultRecord
from taxel.stream.hub_client import HubError
from taxel_protocol.names import BoardFault, FaultCode

RECORD = FaultRecord(FaultCode.EXCEPTION, HARD_FAULT, 1, 0x1A2C, 0x1B47)


@pytest.fixture
def skin(fake_skin):
    """A skin whose boards deliver frames, with a complete baseline; `reads` counts the fault records read."""
    skin = fake_skin()
    skin.reads = []

    def read(address):
        skin.reads.append(address)
        return RECORD

    skin.hub.read_board_fault = read
    skin.pass_time(2.0)
    return skin


def report(skin, fault):
    address = skin.hand.boards[0].address
    skin.hub.faults.append({"address": address, "fault": int(fault)})
    return address


def test_the_fault_of_a_restarted_board_is_shown_and_read_once(skin):
    assert skin.read().advice is None
    address = report(skin, BoardFault.RESTARTED)
    for _ in range(3):
        text = f"board 0x{address:02X} has restarted: HardFault at PC 0x00001A2C, LR 0x00001B47"
        assert skin.read().advice == text
    assert skin.reads == [address]
    report(skin, BoardFault.RESTARTED)
    skin.read()
    assert skin.reads == [address, address]


def test_other_faults_and_boards_without_a_record_give_no_advice(skin):
    report(skin, BoardFault.NACK)
    skin.hub.read_board_fault = lambda address: None
    report(skin, BoardFault.RESTARTED)
    assert skin.read().advice is None


def test_a_board_that_does_not_answer_gives_no_error(skin):
    def refuse(address):
        raise HubError("nack")

    skin.hub.read_board_fault = refuse
    report(skin, BoardFault.RESTARTED)
    assert skin.read().advice is None
