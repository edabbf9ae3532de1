"""The UR5e over RTDE with simulated modules of ur_rtde; not verified on hardware."""

import pickle
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.hand.arm import ArmBusyError, ArmConnectionError, ArmError, ArmLimitError, ArmPackageMissingError, Ur5eArm

HOST = "192.0.2.7"


class Controller:
    """Simulated control and receive interfaces of ur_rtde, limited to the functions in use."""

    def __init__(self) -> None:
        """Create the interfaces of an arm at rest that accepts every motion."""
        self.calls: list[tuple[object, ...]] = []
        self.is_running = False
        self.speed = 0.0
        self.accepts = True
        self.failure: RuntimeError | None = None

    def getActualQ(self) -> list[float]:
        """Return the joint angles, or raise the failure."""
        if self.failure:
            raise self.failure
        return [0.1] * 6

    def getActualQd(self) -> list[float]:
        return [0.0, -self.speed, 0.0, 0.0, 0.0, 0.0]

    def getAsyncOperationProgressEx(self) -> SimpleNamespace:
        return SimpleNamespace(isAsyncOperationRunning=lambda: self.is_running)

    def moveJ(self, *arguments: object) -> bool:
        self.calls.append(("moveJ", *arguments))
        return self.accepts

    def stopJ(self, deceleration: float) -> None:
        """Record the call, and raise the failure if there is one."""
        self.calls.append(("stopJ", deceleration))
        if self.failure:
            raise self.failure

    def stopScript(self) -> None:
        self.calls.append(("stopScript",))

    def disconnect(self) -> None:
        self.calls.append(("disconnect",))


@pytest.fixture
def controller(monkeypatch: pytest.MonkeyPatch) -> Controller:
    """Replace the modules of ur_rtde, whose two interfaces become one simulated controller."""
    result = Controller()
    monkeypatch.setitem(sys.modules, "rtde_control", SimpleNamespace(RTDEControlInterface=lambda host: result))
    monkeypatch.setitem(sys.modules, "rtde_receive", SimpleNamespace(RTDEReceiveInterface=lambda host: result))
    return result


def assert_one_line(error: ArmError) -> str:
    """Check that an error is one line that names the arm, and can be pickled; return its text."""
    assert "\n" not in str(error)
    assert str(error).startswith(f"UR5e at {HOST}: ")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
    return str(error)


def test_the_error_of_a_missing_package_names_the_command_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rtde_control", None)
    with pytest.raises(ArmPackageMissingError) as caught:
        Ur5eArm(HOST)
    assert 'pip install "taxel[hand]"' in assert_one_line(caught.value)


def test_a_motion_is_asynchronous_with_the_requested_speed_and_acceleration(controller: Controller) -> None:
    with Ur5eArm(HOST, acceleration_rad_s2=0.5) as arm:
        np.testing.assert_array_equal(arm.read_joint_angles(), [0.1] * 6)
        arm.move_joints(np.zeros(6), 0.25)
    # The last argument of moveJ, True, selects an asynchronous motion. In the end both RTDE interfaces disconnect.
    assert controller.calls[0] == ("moveJ", [0.0] * 6, 0.25, 0.5, True)
    assert [call[0] for call in controller.calls[1:]] == ["stopJ", "stopScript", "disconnect", "disconnect"]


def test_no_motion_is_sent_for_a_target_outside_the_limits_or_during_a_motion(controller: Controller) -> None:
    arm = Ur5eArm(HOST)
    with pytest.raises(ArmLimitError) as limit:
        arm.move_joints([0, 0, 4, 0, 0, 0], 0.25)
    assert_one_line(limit.value)
    controller.is_running = True
    assert arm.is_moving
    with pytest.raises(ArmBusyError) as busy:
        arm.move_joints(np.zeros(6), 0.25)
    assert_one_line(busy.value)
    assert controller.calls == []


def test_the_arm_is_moving_until_its_joints_are_at_standstill(controller: Controller) -> None:
    arm = Ur5eArm(HOST)
    controller.speed = 0.1
    assert arm.is_moving
    controller.speed = 0.0
    assert not arm.is_moving


def test_a_rejected_motion_raises_an_error(controller: Controller) -> None:
    controller.accepts = False
    with pytest.raises(ArmConnectionError, match="rejected the motion") as caught:
        Ur5eArm(HOST).move_joints(np.zeros(6), 0.25)
    assert_one_line(caught.value)


def test_a_lost_controller_raises_a_one_line_error_and_is_disconnected(controller: Controller) -> None:
    def read_after_loss() -> None:
        """Read the joint angles after the connection to the controller is lost."""
        with Ur5eArm(HOST) as arm:
            controller.failure = RuntimeError("lost\n the link")
            arm.read_joint_angles()

    with pytest.raises(ArmConnectionError, match=r"does not respond \(lost the link\)") as caught:
        read_after_loss()
    assert_one_line(caught.value)
    assert controller.calls[-2:] == [("disconnect",), ("disconnect",)]


def test_an_unreachable_controller_raises_a_one_line_error(
    controller: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(host: str) -> None:
        raise RuntimeError("Connection refused")

    monkeypatch.setattr(sys.modules["rtde_control"], "RTDEControlInterface", refuse)
    with pytest.raises(ArmConnectionError, match="does not grant control") as caught:
        Ur5eArm(HOST)
    assert_one_line(caught.value)
    assert controller.calls == [("disconnect",)]
    monkeypatch.setattr(sys.modules["rtde_receive"], "RTDEReceiveInterface", refuse)
    with pytest.raises(ArmConnectionError, match="is not reachable"):
        Ur5eArm(HOST)
