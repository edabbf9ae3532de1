"""The UR5e through the real-time data exchange (RTDE) of its controller, with the optional package ur_rtde 1.6.

Not verified on hardware.
"""

import importlib
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt

from taxel.hand.arm.base import check_target
from taxel.hand.arm.errors import ArmBusyError, ArmConnectionError, ArmPackageMissingError
from taxel.types import FloatArray

ACCELERATION_RAD_S2: Final = 1.4  # default of a joint motion in ur_rtde
_BRAKING_RAD_S2: Final = 2.0  # default of a stop in ur_rtde
_STANDSTILL_RAD_S = 1e-3
"""Largest joint speed at standstill; chosen above the noise of the measured speeds."""


class Ur5eArm:
    """UR5e at the network address `host`; a context manager that stops the arm and disconnects.

    acceleration_rad_s2: acceleration of joint motions. Raises ArmPackageMissingError without ur_rtde, and
    ArmConnectionError if the controller is not reachable or does not grant control.

    .. warning::
        Not verified on hardware. The driver checks only joint limits and speed: use `taxel.planning` for motions that
        avoid collisions. The operator and the controller must protect the cables of the hand, and set the payload.
    """

    def __init__(self, host: str, *, acceleration_rad_s2: float = ACCELERATION_RAD_S2) -> None:
        """Connect to the controller of a UR5e arm with the package ur_rtde.

        host: network address of the controller. acceleration_rad_s2: acceleration of joint motions. Raises
        ArmPackageMissingError without ur_rtde, and ArmConnectionError if the controller is not reachable or does not
        grant control.
        """
        self.name = f"UR5e at {host}"
        self._acceleration = acceleration_rad_s2
        try:
            control = importlib.import_module("rtde_control")
            receive = importlib.import_module("rtde_receive")
        except ImportError as error:
            raise ArmPackageMissingError(
                self.name, f'requires the package ur_rtde ({error}); run pip install "taxel[hand]"'
            ) from error
        try:
            self._receive: Any = receive.RTDEReceiveInterface(host)
        except RuntimeError as error:
            raise self._make_error("is not reachable", error) from error
        try:
            self._control: Any = control.RTDEControlInterface(host)
        except RuntimeError as error:
            self._receive.disconnect()
            raise self._make_error("does not grant control", error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the UR5e arm and disconnect; an exception of the `with` block is not replaced by a connection error."""
        try:
            self.close()
        except ArmConnectionError:
            if error is None:  # an earlier exception is more informative
                raise

    @property
    def is_moving(self) -> bool:
        """Whether the arm is moving: a motion has not ended, or a joint still moves after a stop."""
        if self._call(self._control.getAsyncOperationProgressEx).isAsyncOperationRunning():
            return True
        return bool(np.abs(self._call(self._receive.getActualQd)).max() > _STANDSTILL_RAD_S)

    def read_joint_angles(self) -> FloatArray:
        """Read the measured joint angles of the UR5e arm, f64[6], radians."""
        return np.array(self._call(self._receive.getActualQ), dtype=np.float64)

    def move_joints(self, target: npt.ArrayLike, speed_rad_s: float) -> None:
        """Start a motion to `target`, f64[6], radians, and return at once.

        Raises ArmLimitError before any motion, ArmBusyError during a motion, and ArmConnectionError if the controller
        rejects it.
        """
        angles = check_target(self.name, target, speed_rad_s)
        if self.is_moving:
            raise ArmBusyError(self.name, "expected a standing arm, found a moving arm; wait, or call stop() first")
        if not self._call(self._control.moveJ, angles.tolist(), speed_rad_s, self._acceleration, True):
            raise ArmConnectionError(
                self.name, "the controller rejected the motion; check protective stop and remote control"
            )

    def stop(self) -> None:
        """Brake the UR5e arm along its path and return at once."""
        self._call(self._control.stopJ, _BRAKING_RAD_S2)

    def close(self) -> None:
        """Stop the arm, end the control script and disconnect."""
        try:
            self.stop()
            self._call(self._control.stopScript)
        finally:
            self._control.disconnect()
            self._receive.disconnect()

    def _call(self, function: Any, *arguments: object) -> Any:
        """Call a function of ur_rtde. Raises ArmConnectionError if the function fails."""
        try:
            return function(*arguments)
        except RuntimeError as error:
            raise self._make_error("does not respond", error) from error

    def _make_error(self, problem: str, error: Exception) -> ArmConnectionError:
        """Create the error for a failed call of the library ur_rtde, with the reason that the library gives."""
        reason = " ".join(str(error).split()) or type(error).__name__
        return ArmConnectionError(
            self.name, f"{problem} ({reason}); check power, network, remote control mode and emergency stop"
        )
