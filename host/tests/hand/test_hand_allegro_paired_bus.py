"""Two ends of a CAN channel within one thread."""

import can
import pytest

from taxel.hand.allegro import AllegroHand, FreeJoints, VirtualAllegro
from taxel.hand.allegro.paired_bus import PairedBus


@pytest.fixture
def ends():
    """Open the two ends of a channel."""
    first, second = PairedBus.open_pair()
    with first, second:
        yield first, second


def make_message(number: int) -> can.Message:
    return can.Message(arbitration_id=number, is_extended_id=False, data=[number])


def test_each_end_receives_the_messages_of_the_other_end_in_order(ends):
    first, second = ends
    for number in range(3):
        first.send(make_message(number))
    second.send(make_message(9), timeout=0.1)
    assert [second.recv(0.0).arbitration_id for _ in range(3)] == [0, 1, 2]
    assert second.recv(1.0) is None
    assert first.recv().arbitration_id == 9
    assert first.recv() is None


def test_messages_to_an_end_that_is_shut_down_are_lost():
    first, second = PairedBus.open_pair()
    second.shutdown()
    first.send(make_message(1))
    assert second.recv() is None
    first.shutdown()


def test_pairs_are_independent(ends):
    other, peer = PairedBus.open_pair()
    with other, peer:
        other.send(make_message(5))
        assert all(end.recv() is None for end in ends)


def test_driver_and_virtual_hand_communicate(ends):
    host_end, hand_end = ends
    virtual = VirtualAllegro(hand_end, FreeJoints())
    with AllegroHand(host_end, clock=lambda: virtual.time_s, advance=virtual.step) as hand:
        hand.set_torque([0.2] * 16)
        virtual.step(0.003)
        hand.update()
        assert hand.read_joint_angles().is_complete
