"""The UR5e over RTDE, against stand-ins for ur_rtde's two modules; a real arm has not been tried."""

from __future__ import annotations

import pickle
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from taxel.hand.arm import ArmBusyError, ArmConnectionError, ArmError, ArmLimitError, ArmPackageMissingError, Ur5eArm

HOST = "192.0.2.7"


class Controller:
    """Both interfaces of ur_rtde in one, as far as they are used."""

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.is_running = False
        self.speed = 0.0
        self.accepts = True
        self.failure: RuntimeError | None = None

    def getActualQ(self) -> list[float]:
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
        self.calls.append(("stopJ", deceleration))
        if self.failure:
            raise self.failure

    def stopScript(self) -> None:
        self.calls.append(("stopScript",))

    def disconnect(self) -> None:
        self.calls.append(("disconnect",))


@pytest.fixture
def controller(monkeypatch: pytest.MonkeyPatch) -> Controller:
    one = Controller()
    monkeypatch.setitem(sys.modules, "rtde_control", SimpleNamespace(RTDEControlInterface=lambda host: one))
    monkeypatch.setitem(sys.modules, "rtde_receive", SimpleNamespace(RTDEReceiveInterface=lambda host: one))
    return one


def one_line(error: ArmError) -> str:
    assert "\n" not in str(error)
    assert str(error).startswith(f"UR5e at {HOST}: ")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
    return str(error)


def test_without_the_package_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rtde_control", None)
    with pytest.raises(ArmPackageMissingError) as caught:
        Ur5eArm(HOST)
    assert 'pip install "taxel[arm]"' in one_line(caught.value)


def test_a_move_is_asynchronous_with_the_speed_and_acceleration_asked_for(controller: Controller) -> None:
    with Ur5eArm(HOST, acceleration_rad_s2=0.5) as arm:
        np.testing.assert_array_equal(arm.read_joint_angles(), [0.1] * 6)
        arm.move_joints(np.zeros(6), 0.25)
    assert controller.calls[0] == ("moveJ", [0.0] * 6, 0.25, 0.5, True)
    assert [call[0] for call in controller.calls[1:]] == ["stopJ", "stopScript", "disconnect", "disconnect"]


def test_nothing_is_sent_for_a_target_outside_the_limits_or_during_a_motion(controller: Controller) -> None:
    arm = Ur5eArm(HOST)
    with pytest.raises(ArmLimitError) as limit:
        arm.move_joints([0, 0, 4, 0, 0, 0], 0.25)
    one_line(limit.value)
    controller.is_running = True
    assert arm.is_moving
    with pytest.raises(ArmBusyError) as busy:
        arm.move_joints(np.zeros(6), 0.25)
    one_line(busy.value)
    assert controller.calls == []


def test_it_moves_until_its_joints_stand(controller: Controller) -> None:
    arm = Ur5eArm(HOST)
    assert not arm.is_moving
    controller.speed = 0.1
    assert arm.is_moving


def test_a_refused_move_is_an_error(controller: Controller) -> None:
    controller.accepts = False
    with pytest.raises(ArmConnectionError, match="refused the move") as caught:
        Ur5eArm(HOST).move_joints(np.zeros(6), 0.25)
    one_line(caught.value)


def test_a_controller_that_is_lost_is_one_line_and_still_disconnected(controller: Controller) -> None:
    def work() -> None:
        with Ur5eArm(HOST) as arm:
            controller.failure = RuntimeError("lost\n the link")
            arm.read_joint_angles()

    with pytest.raises(ArmConnectionError, match=r"does not answer \(lost the link\)") as caught:
        work()
    one_line(caught.value)
    assert controller.calls[-2:] == [("disconnect",), ("disconnect",)]


def test_a_controller_that_cannot_be_reached_is_one_line(
    controller: Controller, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(host: str) -> None:
        raise RuntimeError("Connection refused")

    monkeypatch.setattr(sys.modules["rtde_control"], "RTDEControlInterface", refuse)
    with pytest.raises(ArmConnectionError, match="does not hand over control") as caught:
        Ur5eArm(HOST)
    one_line(caught.value)
    assert controller.calls == [("disconnect",)]
    monkeypatch.setattr(sys.modules["rtde_receive"], "RTDEReceiveInterface", refuse)
    with pytest.raises(ArmConnectionError, match="cannot be reached"):
        Ur5eArm(HOST)
