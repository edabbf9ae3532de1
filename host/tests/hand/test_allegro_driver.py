"""Driver with a virtual hand in lock step: sent frames, received values, and every error."""

import contextlib
import itertools
import pickle
from collections.abc import Iterator
from types import SimpleNamespace

import can
import numpy as np
import pytest

from taxel.errors import TaxelError
from taxel.hand.allegro import (
    JOINT_MAX_RAD,
    JOINT_MIN_RAD,
    AllegroBusError,
    AllegroCommunicationError,
    AllegroError,
    AllegroHand,
    AllegroLeftHandError,
    AllegroPoseError,
    AllegroServoOffError,
    AllegroSilentError,
    AllegroTemperatureError,
    CanUrlError,
    FreeJoints,
    VirtualAllegro,
    open_bus,
)
from taxel.hand.allegro.messages import FingerPose, Message, SetPeriod, SetTorque, SystemOff, SystemOn
from taxel.hand.allegro.protocol import RAD_PER_COUNT, decode, encode

CHANNEL_NUMBERS = itertools.count()
MIDDLE = (JOINT_MIN_RAD + JOINT_MAX_RAD) / 2


class Bench(SimpleNamespace):
    """Virtual hand, bus of the host and a listening node on one channel, in virtual time."""

    bus: can.BusABC
    virtual: VirtualAllegro
    listener: can.BusABC

    def make_hand(self, **options: object) -> AllegroHand:
        return AllegroHand(self.bus, clock=lambda: self.virtual.time_s, advance=self.virtual.step, **options)

    def read_messages(self) -> list[Message | None]:
        frames = iter(lambda: self.listener.recv(0.0), None)
        return [decode(frame) for frame in frames]

    def run(self, hand: AllegroHand, seconds: float) -> None:
        """Advance the virtual hand in 3 ms periods, and call `update` of the driver after each."""
        for _ in range(round(seconds / 0.003)):
            self.virtual.step(0.003)
            hand.update()


@pytest.fixture
def bench() -> Iterator[Bench]:
    """Connect a virtual hand, a bus for the driver and a listening node on a channel of python-can."""
    channel = f"driver-{next(CHANNEL_NUMBERS)}"
    buses = [can.Bus(channel, "virtual") for _ in range(3)]
    yield Bench(bus=buses[0], virtual=VirtualAllegro(buses[1], FreeJoints()), listener=buses[2])
    for bus in buses:
        bus.shutdown()


def assert_one_line(error: BaseException) -> str:
    """Check that an error is a one-line TaxelError that can be pickled; return its text."""
    text = str(error)
    assert isinstance(error, TaxelError)
    assert "\n" not in text
    assert str(pickle.loads(pickle.dumps(error))) == text
    return text


def test_entry_reads_the_hand_info_and_switches_the_motors_on(bench: Bench) -> None:
    with bench.make_hand() as hand:
        assert hand.get_serial() == "SAH040VR"
        assert hand.get_info().hand_type == 0
        assert hand.get_info().servo_on
        assert bench.virtual.servo_on


def test_torques_of_an_earlier_program_are_cleared_before_the_motors_are_switched_on(bench: Bench) -> None:
    bench.listener.send(encode(SetTorque(1, (1.0,) * 4)))
    bench.virtual.step(0.001)
    with bench.make_hand():
        messages = bench.read_messages()
        assert messages.index(SystemOn()) > max(messages.index(SetTorque(finger, (0.0,) * 4)) for finger in range(4))
        assert bench.virtual.torque_command.tolist() == [0.0] * 16


def test_exit_sends_zero_torque_and_then_switches_the_motors_off(bench: Bench) -> None:
    with bench.make_hand() as hand:
        hand.set_torque(np.full(16, 0.5))
        bench.read_messages()
    zero = [SetTorque(finger, (0.0,) * 4) for finger in range(4)]
    assert bench.read_messages() == [*zero, SystemOff()]


def test_exit_after_an_error_switches_the_motors_off(bench: Bench) -> None:
    with pytest.raises(KeyError), bench.make_hand():
        raise KeyError("of the user")
    assert bench.read_messages()[-1] == SystemOff()


def test_angles_are_in_joint_order_with_their_age(bench: Bench) -> None:
    with bench.make_hand() as hand:
        bench.virtual.step(0.003)
        hand.update()
        bench.virtual.step(0.002)
        reading = hand.read_joint_angles()
    np.testing.assert_allclose(reading.angles, MIDDLE, atol=RAD_PER_COUNT / 2)
    assert reading.age_s == pytest.approx(0.002)


def test_before_the_first_report_the_angles_are_nan_with_infinite_age(bench: Bench) -> None:
    reading = bench.make_hand().read_joint_angles()
    assert np.isnan(reading.angles).all()
    assert reading.age_s == np.inf
    assert not reading.is_complete


def test_a_reading_is_complete_after_new_reports_of_all_fingers(bench: Bench) -> None:
    with bench.make_hand() as hand:
        bench.run(hand, 0.009)
        assert hand.read_joint_angles().is_complete
        assert not hand.read_joint_angles().is_complete
        bench.virtual.faults.dropped_fingers = {2}
        bench.run(hand, 0.003)
        assert not hand.read_joint_angles().is_complete
        bench.virtual.faults.dropped_fingers = set()
        bench.run(hand, 0.003)
        assert hand.read_joint_angles().is_complete


def test_the_returned_angles_are_a_copy(bench: Bench) -> None:
    with bench.make_hand() as hand:
        bench.run(hand, 0.003)
        hand.read_joint_angles().angles[:] = 9.0
        assert hand.read_joint_angles().angles.max() < 9.0


def test_a_torque_above_full_pwm_is_clipped(bench: Bench) -> None:
    with bench.make_hand() as hand:
        hand.set_torque([2.0] * 8 + [-2.0] * 8)
        bench.virtual.step(0.001)
        assert bench.virtual.torque_command.tolist() == [1.0] * 8 + [-1.0] * 8


@pytest.mark.parametrize("torque", [[0.0] * 15, 0.0, [[0.0] * 16], [np.nan] + [0.0] * 15])
def test_a_torque_of_another_shape_or_not_finite_is_rejected(bench: Bench, torque: object) -> None:
    with bench.make_hand() as hand, pytest.raises(ValueError, match="torque: expected"):
        hand.set_torque(torque)  # type: ignore[arg-type]


def test_a_pose_outside_the_joint_range_is_rejected_before_sending(bench: Bench) -> None:
    target = MIDDLE.copy()
    target[13] = 1.5
    with bench.make_hand() as hand:
        bench.read_messages()
        with pytest.raises(AllegroPoseError, match=r"thumb_1: expected -0.105 to 1.163 rad, found 1.5") as caught:
            hand.set_pose(target)
        assert_one_line(caught.value)
        assert bench.read_messages() == []


def test_periods_are_set_on_entry_and_by_command(bench: Bench) -> None:
    with bench.make_hand(position_ms=5) as hand:
        assert SetPeriod(5, 0, 0) in bench.read_messages()
        hand.set_period(10, imu_ms=20, temperature_ms=50)
        bench.run(hand, 0.06)
        poses = [m for m in bench.read_messages() if isinstance(m, FingerPose)]
        assert len(poses) == 4 * 6  # four fingers, 60 ms at a period of 10 ms
        assert hand.imu is not None
        assert hand.temperatures_c == dict.fromkeys(range(4), 35)
        with pytest.raises(ValueError):
            hand.set_period(-1)


def test_with_a_period_of_zero_poses_are_sent_on_request_and_silence_is_no_error(bench: Bench) -> None:
    with bench.make_hand(position_ms=0) as hand:
        bench.run(hand, 1.0)
        assert hand.read_joint_angles().age_s == np.inf
        hand.request_poses()
        bench.run(hand, 0.003)
        assert hand.read_joint_angles().is_complete


def test_the_error_of_a_hand_without_reply_names_channel_and_device(bench: Bench) -> None:
    bench.virtual.faults.is_silent = True
    with pytest.raises(AllegroSilentError, match=r"no reply to HAND_INFO in 0\.5 s") as caught, bench.make_hand():
        pass
    assert "driver-" in assert_one_line(caught.value)
    assert "Allegro hand 0" in str(caught.value)


def test_a_missing_reply_is_detected_with_a_stopped_clock(bench: Bench) -> None:
    hand = AllegroHand(bench.bus, clock=lambda: 0.0, reply_timeout_s=0.01)
    with pytest.raises(AllegroSilentError), hand:
        pass


def test_another_device_id_gets_no_reply(bench: Bench) -> None:
    with pytest.raises(AllegroSilentError, match="Allegro hand 2"), bench.make_hand(device_id=2):
        pass


def test_a_hand_that_stops_responding_is_detected_after_the_limit(bench: Bench) -> None:
    with bench.make_hand() as hand:
        bench.run(hand, 0.3)
        bench.virtual.faults.is_silent = True
        bench.run(hand, 0.09)  # SILENCE_LIMIT_S is 0.1 s
        with pytest.raises(AllegroSilentError, match="index, middle, pinkie, thumb") as caught:
            bench.run(hand, 0.03)
    assert_one_line(caught.value)


def test_a_finger_that_stops_reporting_is_named(bench: Bench) -> None:
    with bench.make_hand() as hand:
        bench.virtual.faults.dropped_fingers = {1}
        with pytest.raises(AllegroSilentError, match="no pose of middle for") as caught:
            bench.run(hand, 0.2)
    assert "thumb" not in str(caught.value)


def test_the_silence_limit_is_at_least_three_periods(bench: Bench) -> None:
    with bench.make_hand(position_ms=200, silence_limit_s=0.01) as hand:
        bench.run(hand, 2.0)
        bench.virtual.faults.is_silent = True
        bench.run(hand, 0.5)
        with pytest.raises(AllegroSilentError, match=r"limit 0\.6 s"):
            bench.run(hand, 0.3)


@pytest.mark.parametrize(
    ("fault", "value", "error", "message"),
    [
        ("temperature_c", 80, AllegroTemperatureError, "80 C; remove the load"),
        ("has_communication_fault", True, AllegroCommunicationError, "internal communication fault"),
        ("is_servo_off", True, AllegroServoOffError, "power supply"),
    ],
)
def test_a_fault_is_raised_on_entry_and_in_operation_until_it_ends(
    bench: Bench, fault: str, value: object, error: type[AllegroError], message: str
) -> None:
    healthy_value = getattr(bench.virtual.faults, fault)
    setattr(bench.virtual.faults, fault, value)
    with pytest.raises(error, match=message) as caught, bench.make_hand():
        pass
    assert_one_line(caught.value)
    setattr(bench.virtual.faults, fault, healthy_value)
    with bench.make_hand() as hand:
        bench.run(hand, 0.6)
        setattr(bench.virtual.faults, fault, value)
        with pytest.raises(error, match=message):
            bench.run(hand, 0.6)
        setattr(bench.virtual.faults, fault, healthy_value)
        for _ in range(250):  # the fault is raised until the next status report
            bench.virtual.step(0.003)
            with contextlib.suppress(error):
                hand.update()
        hand.update()


def test_motors_that_stay_off_are_switched_off_on_exit(bench: Bench) -> None:
    bench.virtual.faults.is_servo_off = True
    with pytest.raises(AllegroServoOffError), bench.make_hand():
        pass
    messages = bench.read_messages()
    assert SystemOn() in messages
    assert messages[-1] == SystemOff()


def test_a_left_hand_is_rejected_and_never_switched_on(bench: Bench) -> None:
    bench.virtual.hand_type = 1
    with pytest.raises(AllegroLeftHandError, match=r"right hand \(type 0\), found type 1") as caught, bench.make_hand():
        pass
    assert_one_line(caught.value)
    assert SystemOn() not in bench.read_messages()


def test_malformed_and_foreign_frames_are_counted(bench: Bench) -> None:
    def send(identifier: int, data: bytes) -> None:
        bench.listener.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    with bench.make_hand() as hand:
        bench.run(hand, 0.003)
        counts_before, angles = hand.frames, hand.read_joint_angles().angles
        send(0x20 << 2, bytes(7))  # a short pose
        send(0x88 << 2, b"\xff" * 8)  # no serial number
        send(0x7F << 2, bytes(8))  # no message of the protocol
        send(0x20 << 2 | 1, bytes(8))  # another hand's pose
        bench.listener.send(encode(SystemOn()))  # a command
        assert hand.poll() == 5
        counts_after = hand.frames
        np.testing.assert_array_equal(hand.read_joint_angles().angles, angles)
        assert hand.get_serial() == "SAH040VR"
    assert counts_after.accepted == counts_before.accepted
    assert counts_after.ignored - counts_before.ignored == 3
    assert counts_after.malformed - counts_before.malformed == 2


def test_info_and_serial_raise_before_the_hand_is_opened(bench: Bench) -> None:
    hand = bench.make_hand()
    for getter in (hand.get_info, hand.get_serial):
        with pytest.raises(AllegroSilentError, match="open the hand with 'with'"):
            getter()


def test_a_bus_failure_raises_a_one_line_error(bench: Bench) -> None:
    hand = bench.make_hand()
    bench.bus.shutdown()
    with pytest.raises(AllegroBusError, match="the bus cannot receive frames") as caught:
        hand.poll()
    assert_one_line(caught.value)
    with pytest.raises(AllegroBusError, match="the bus cannot send frames"):
        hand.set_torque(np.zeros(16))


def test_a_bus_failure_on_exit_is_raised_unless_another_error_is_active(bench: Bench) -> None:
    def open_and_close(error: Exception | None) -> None:
        """Open the hand on a bus that fails to send from then on, and raise `error` before the exit."""
        with bench.make_hand():
            bench.bus.send = fail  # type: ignore[method-assign]
            if error:
                raise error

    def fail(frame: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("bus off")

    with pytest.raises(KeyError):
        open_and_close(KeyError())
    del bench.bus.send  # restores the method of the class
    with pytest.raises(AllegroBusError, match=r"\(bus off\)"):
        open_and_close(None)


def test_options_out_of_range_are_rejected(bench: Bench) -> None:
    with pytest.raises(ValueError, match="device_id"):
        bench.make_hand(device_id=4)
    with pytest.raises(ValueError, match="expected values above 0"):
        bench.make_hand(silence_limit_s=0.0)


def test_a_pd_controller_reaches_its_target_in_virtual_time(bench: Bench) -> None:
    target = np.clip(MIDDLE + 0.2, JOINT_MIN_RAD, JOINT_MAX_RAD)
    with bench.make_hand() as hand:
        bench.run(hand, 0.003)
        last = hand.read_joint_angles().angles
        for _ in range(500):
            angles = hand.read_joint_angles().angles
            hand.set_torque(5.0 * (target - angles) - 0.1 * (angles - last) / 0.003)
            last = angles
            bench.run(hand, 0.003)
        np.testing.assert_allclose(hand.read_joint_angles().angles, target, atol=0.02)


def test_a_virtual_channel_opens_by_its_url() -> None:
    bus = open_bus("can:virtual:by-url")
    assert "by-url" in str(bus.channel_info)
    bus.shutdown()


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("can0", "is not the URL of a CAN channel; expected can:socketcan:can0"),
        ("can:virtual:", "is not the URL of a CAN channel"),
        ("can:other:x", "is not the URL of a CAN channel"),
        ("can:socketcan:nosuch9", "sudo ip link set nosuch9 up type can bitrate 1000000"),
        ("can:pcan:PCAN_NOSUCH9", "PCANBasic"),
        ("can:udp:10.0.0.1", "multicast group"),
        ("can:udp:239.74.163.2:x", "port: expected a number from 1 to 65535, found ':x'"),
        ("can:udp:239.74.163.2:99999", "port: expected"),
        ("can:udp:[ff15::1]7", "port: expected"),
    ],
)
def test_a_channel_that_cannot_be_opened_raises_a_one_line_error(url: str, message: str) -> None:
    with pytest.raises(CanUrlError) as caught:
        open_bus(url)
    assert message in assert_one_line(caught.value)
    assert str(caught.value).startswith(url)
