"""CAN channel to a virtual hand in the thread of its driver."""

import pytest

from taxel.hand.allegro import AllegroHand, AllegroSilentError
from taxel.hand.allegro.emulated_bus import EmulatedBus


class Clock:
    def __init__(self) -> None:
        self.now_s = 50.0

    def __call__(self) -> float:
        return self.now_s


def test_pause_of_the_program_is_no_silence_of_the_hand() -> None:
    clock = Clock()
    bus = EmulatedBus(clock)
    with AllegroHand(bus, clock=clock) as hand:
        clock.now_s += 5.0
        assert hand.update() >= 4 * 1000  # a report of each finger in each of at least 1,000 periods
        assert hand.read_joint_angles().is_complete
    bus.shutdown()


def test_silent_virtual_hand_is_an_error() -> None:
    clock = Clock()
    bus = EmulatedBus(clock)
    with AllegroHand(bus, clock=clock) as hand:
        bus.hand.faults.is_silent = True
        clock.now_s += 0.2
        with pytest.raises(AllegroSilentError, match="no pose of index, middle, pinkie, thumb"):
            hand.update()
    bus.shutdown()


def test_motors_are_off_after_the_driver_is_closed() -> None:
    bus = EmulatedBus(Clock())
    with AllegroHand(bus, clock=Clock()):
        bus.recv()
        assert bus.hand.servo_on
    bus.shutdown()
    assert not bus.hand.servo_on
    assert bus.recv() is None
