"""Virtual hand: sent reports, their times, and the motion of the joints."""

import itertools
import threading
from collections.abc import Iterator

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from taxel.hand.allegro import JOINT_MAX_RAD, JOINT_MIN_RAD, AllegroHand, FreeJoints, VirtualAllegro
from taxel.hand.allegro.messages import (
    Config,
    FingerPose,
    HandInfo,
    Imu,
    Message,
    MessageId,
    Request,
    Serial,
    SetPeriod,
    SetPose,
    SetTorque,
    SystemOff,
    SystemOn,
    Temperature,
)
from taxel.hand.allegro.protocol import RAD_PER_COUNT, decode, encode

NAMES = itertools.count()
Pair = tuple[VirtualAllegro, can.BusABC]


@pytest.fixture
def pair() -> Iterator[Pair]:
    """Connect a virtual hand with free joints and the host's end of a CAN channel."""
    name = f"virtual-{next(NAMES)}"
    host, hand = can.Bus(name, "virtual"), can.Bus(name, "virtual")
    yield VirtualAllegro(hand, FreeJoints()), host
    host.shutdown()
    hand.shutdown()


def send(host: can.BusABC, *messages: Message) -> None:
    for message in messages:
        host.send(encode(message))


def read_messages(host: can.BusABC) -> list[Message | None]:
    return [decode(frame) for frame in iter(lambda: host.recv(0.0), None)]


def make_torques(torque: float) -> list[SetTorque]:
    return [SetTorque(finger, (torque,) * 4) for finger in range(4)]


@pytest.mark.parametrize(
    ("request_", "kind"),
    [
        (Request(MessageId.HAND_INFO), HandInfo),
        (Request(MessageId.SERIAL), Serial),
        (Request(MessageId.FINGER_POSE, 2), FingerPose),
        (Request(MessageId.IMU), Imu),
        (Request(MessageId.TEMPERATURE, 1), Temperature),
    ],
)
def test_every_request_gets_one_reply(pair: Pair, request_: Request, kind: type) -> None:
    virtual, host = pair
    send(host, request_)
    virtual.step(0.001)
    (reply,) = read_messages(host)
    assert isinstance(reply, kind)


@pytest.mark.parametrize("steps_s", [[0.003] * 10, [0.001] * 30, [0.03], [0.007] * 4 + [0.002]])
def test_poses_of_all_fingers_are_sent_at_multiples_of_the_period_for_any_step_length(
    pair: Pair, steps_s: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    virtual, host = pair
    sent: list[tuple[float, int]] = []
    send_frame = virtual._bus.send

    def record_pose(frame: can.Message) -> None:
        """Record time and finger of a sent pose, and send it."""
        pose = decode(frame)
        assert isinstance(pose, FingerPose)
        sent.append((virtual.time_s, pose.finger))
        send_frame(frame)

    monkeypatch.setattr(virtual._bus, "send", record_pose)
    send(host, SetPeriod(3, 0, 0))
    for dt_s in steps_s:
        virtual.step(dt_s)
    assert virtual.time_s == 0.03
    assert sent == [(3 * period / 1000, finger) for period in range(1, 11) for finger in range(4)]


def test_each_pose_is_sampled_at_its_report_time(pair: Pair) -> None:
    virtual, host = pair
    send(host, SetPeriod(3, 0, 0), SystemOn(), *make_torques(1.0))
    virtual.step(0.03)
    first_finger_angles = [m.angles[1] for m in read_messages(host) if isinstance(m, FingerPose) and m.finger == 0]
    assert len(first_finger_angles) == 10
    assert (np.diff(first_finger_angles) > 0).all()  # a joint under constant torque moves between any two reports


def test_a_period_of_zero_stops_the_reports(pair: Pair) -> None:
    virtual, host = pair
    send(host, SetPeriod(1, 1, 1))
    virtual.step(0.001)
    assert len(read_messages(host)) == 4 + 1 + 4  # poses of four fingers, the IMU, four temperatures
    send(host, SetPeriod(0, 0, 0))
    virtual.step(1.0)
    assert read_messages(host) == []


def test_angles_are_whole_encoder_counts(pair: Pair) -> None:
    virtual, host = pair
    send(host, Request(MessageId.FINGER_POSE, 3))
    virtual.step(0.0)
    (pose,) = read_messages(host)
    assert isinstance(pose, FingerPose)
    counts = np.array(pose.angles) / RAD_PER_COUNT
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
    assert np.abs(np.array(pose.angles) - virtual.dynamics.angles[12:]).max() <= RAD_PER_COUNT / 2


def test_full_pwm_gives_the_largest_torque() -> None:
    """Full PWM (a command of 1.0) is 0.5 N m here, so a command of -0.5 gives -0.25 N m. Motors that are off give 0."""
    torques: list[NDArray[np.float64]] = []

    class Recorder(FreeJoints):
        def step(self, torque_nm: object, dt_s: float) -> NDArray[np.float64]:
            torques.append(np.array(torque_nm))
            return super().step(torque_nm, dt_s)  # type: ignore[arg-type]

    host, end = can.Bus("full", "virtual"), can.Bus("full", "virtual")
    virtual = VirtualAllegro(end, Recorder(), max_torque_nm=0.5)
    send(host, *make_torques(1.0))
    virtual.step(0.001)
    send(host, SystemOn(), *make_torques(-0.5))
    virtual.step(0.001)
    send(host, SystemOff())
    virtual.step(0.001)
    assert [float(t[7]) for t in torques] == [0.0, -0.25, 0.0]
    host.shutdown()
    end.shutdown()


def test_position_commands_reach_their_target_until_a_torque_command(pair: Pair) -> None:
    virtual, host = pair
    target = JOINT_MIN_RAD + 0.7 * (JOINT_MAX_RAD - JOINT_MIN_RAD)
    send(host, SystemOn(), *(SetPose(k, tuple(target[4 * k : 4 * k + 4].tolist())) for k in range(4)))
    virtual.step(1.5)
    np.testing.assert_allclose(virtual.dynamics.angles, target, atol=0.01)
    send(host, SetTorque(0, (-1.0,) * 4))
    virtual.step(1.5)
    np.testing.assert_allclose(virtual.dynamics.angles[:4], JOINT_MIN_RAD[:4])
    np.testing.assert_allclose(virtual.dynamics.angles[4:], target[4:], atol=0.01)


def test_an_overheated_hand_reports_it_and_stops_its_motors(pair: Pair) -> None:
    virtual, host = pair
    virtual.faults.temperature_c = 71
    send(host, SystemOn(), Request(MessageId.HAND_INFO))
    virtual.step(0.001)
    (info,) = read_messages(host)
    assert isinstance(info, HandInfo)
    assert (info.temperature_c, info.high_temperature, info.servo_on) == (71, True, False)


def test_a_silent_hand_neither_sends_nor_reads(pair: Pair) -> None:
    virtual, host = pair
    send(host, SetPeriod(3, 0, 0))
    virtual.step(0.003)
    read_messages(host)
    virtual.faults.is_silent = True
    send(host, SystemOn(), Request(MessageId.SERIAL))
    virtual.step(0.1)
    assert read_messages(host) == []
    virtual.faults.is_silent = False
    virtual.step(0.003)
    assert not virtual.servo_on


def test_a_dropped_finger_sends_no_pose(pair: Pair) -> None:
    virtual, host = pair
    virtual.faults.dropped_fingers = {0, 3}
    send(host, SetPeriod(3, 0, 0))
    virtual.step(0.003)
    assert [m.finger for m in read_messages(host) if isinstance(m, FingerPose)] == [1, 2]


def test_config_changes_the_device_id(pair: Pair) -> None:
    virtual, host = pair
    send(host, Config(device_id=3))
    virtual.step(0.0)
    host.send(encode(Request(MessageId.SERIAL), 3))
    virtual.step(0.0)
    assert read_messages(host) == [Serial("SAH040VR")]


def test_malformed_and_unexpected_frames_are_counted(pair: Pair) -> None:
    virtual, host = pair
    # Ignored: a torque command of 3 bytes, and a message that only a hand sends. 0x7FF is no identifier of this hand.
    host.send(can.Message(arbitration_id=0x60 << 2, data=bytes(3), is_extended_id=False))
    host.send(can.Message(arbitration_id=0x7FF, data=bytes(3), is_extended_id=False))
    send(host, Imu((0, 0, 0)))
    virtual.step(0.001)
    assert virtual.ignored_frames == 2
    assert virtual.torque_command.tolist() == [0.0] * 16


def test_an_invalid_serial_number_or_device_id_is_rejected(pair: Pair) -> None:
    _, host = pair
    with pytest.raises(ValueError, match="serial"):
        VirtualAllegro(host, FreeJoints(), serial="far too long")
    with pytest.raises(ValueError, match="device_id"):
        VirtualAllegro(host, FreeJoints(), device_id=4)


def test_a_virtual_hand_in_a_thread_responds_in_real_time(pair: Pair) -> None:
    virtual, host = pair
    stop = threading.Event()
    thread = threading.Thread(target=virtual.run, args=(stop,))
    thread.start()
    try:
        with AllegroHand(host, reply_timeout_s=10.0, silence_limit_s=10.0) as hand:
            for _ in range(1000):
                hand.update(0.1)
                reading = hand.read_joint_angles()
                if np.isfinite(reading.angles).all():
                    break
        assert np.isfinite(reading.angles).all()
        assert hand.get_serial() == "SAH040VR"
    finally:
        stop.set()
        thread.join(10.0)


TORQUES = hnp.arrays(np.float64, 16, elements=st.floats(-1e3, 1e3))


@settings(deadline=None)
@given(TORQUES, st.floats(1e-6, 10.0))
def test_joints_stay_in_their_ranges_for_any_torque_and_step(torque: NDArray[np.float64], dt_s: float) -> None:
    joints = FreeJoints()
    for sign in (1.0, -1.0, 1.0):
        angles = joints.step(sign * torque, dt_s)
        assert (angles >= JOINT_MIN_RAD).all()
        assert (angles <= JOINT_MAX_RAD).all()
        assert np.isfinite(joints.velocities).all()


def test_a_torque_below_friction_causes_no_motion() -> None:
    joints = FreeJoints(friction_nm=0.02)
    before = joints.angles
    for _ in range(100):
        joints.step(np.full(16, 0.019), 0.003)
    np.testing.assert_array_equal(joints.angles, before)


def test_a_joint_without_torque_slows_down_to_standstill_without_reversal() -> None:
    joints = FreeJoints()
    joints.step(np.full(16, 0.5), 0.003)
    travelled = [joints.angles[1]]
    for _ in range(200):
        travelled.append(joints.step(np.zeros(16), 0.003)[1])
    assert (np.diff(travelled) >= 0).all()
    assert joints.velocities.tolist() == [0.0] * 16


def test_the_final_velocity_is_torque_minus_friction_divided_by_damping() -> None:
    joints = FreeJoints(JOINT_MIN_RAD, inertia_kg_m2=1e-4, damping_nm_s=0.5, friction_nm=0.1)
    for _ in range(20):
        joints.step(np.full(16, 0.6), 0.003)
    np.testing.assert_allclose(joints.velocities, 1.0, rtol=1e-6)


def test_a_hard_stop_sets_the_velocity_to_zero() -> None:
    joints = FreeJoints()
    for _ in range(500):
        joints.step(np.full(16, 0.7), 0.003)
    np.testing.assert_array_equal(joints.angles, JOINT_MAX_RAD)
    assert joints.velocities.tolist() == [0.0] * 16


def test_an_external_torque_is_added_to_the_motor_torque() -> None:
    joints = FreeJoints(external=lambda angles, velocities: -0.5 - 0.0 * velocities)
    before = joints.angles
    joints.step(np.full(16, 0.5), 0.003)
    np.testing.assert_array_equal(joints.angles, before)


def test_invalid_parameters_of_joints_are_rejected() -> None:
    with pytest.raises(ValueError, match="inertia above 0"):
        FreeJoints(inertia_kg_m2=0.0)
    with pytest.raises(ValueError, match="dt_s"):
        FreeJoints().step(np.zeros(16), -0.1)
    with pytest.raises(ValueError, match="external torque"):
        FreeJoints(external=lambda angles, velocities: np.zeros(3)).step(np.zeros(16), 0.001)
