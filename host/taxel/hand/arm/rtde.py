"""The UR5e through its controller's real-time data exchange (RTDE), by the optional package ur_rtde.

Not verified on hardware. The calls are those of ur_rtde 1.6.
"""

import importlib
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
import numpy.typing as npt

from taxel.hand.arm.base import checked_target
from taxel.hand.arm.errors import ArmBusyError, ArmConnectionError, ArmPackageMissingError
from taxel.types import FloatArray

ACCELERATION_RAD_S2: Final = 1.4  # ur_rtde's own default of a joint move
_BRAKING_RAD_S2: Final = 2.0  # likewise, of a stop
_STANDING_RAD_S = 1e-3  # chosen: above the noise of the measured joint speeds


class Ur5eArm:
    """A UR5e at the network address `host`; a context manager that stops the arm and disconnects.

    acceleration_rad_s2: of joint moves. Raises ArmPackageMissingError without ur_rtde and ArmConnectionError when the
    controller cannot be reached or does not take control.

    .. warning::
        Not verified on hardware. Only the joint limits and the speed are checked here: collisions with the table, the
        object or the hand's cables, and the payload, are the operator's and the controller's to guard against.
    """

    def __init__(self, host: str, *, acceleration_rad_s2: float = ACCELERATION_RAD_S2) -> None:
        self.name = f"UR5e at {host}"
        self._acceleration = acceleration_rad_s2
        try:
            control = importlib.import_module("rtde_control")
            receive = importlib.import_module("rtde_receive")
        except ImportError as error:
            raise ArmPackageMissingError(
                self.name, f'needs the package ur_rtde ({error}); pip install "taxel[arm]"'
            ) from error
        try:
            self._receive: Any = receive.RTDEReceiveInterface(host)
        except RuntimeError as error:
            raise self._failed("cannot be reached", error) from error
        try:
            self._control: Any = control.RTDEControlInterface(host)
        except RuntimeError as error:
            self._receive.disconnect()
            raise self._failed("does not hand over control", error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except ArmConnectionError:
            if error is None:  # an error on its way out says more
                raise

    @property
    def is_moving(self) -> bool:
        """Whether a motion is under way: a move has not ended, or a joint still turns after a stop."""
        if self._call(self._control.getAsyncOperationProgressEx).isAsyncOperationRunning():
            return True
        return bool(np.abs(self._call(self._receive.getActualQd)).max() > _STANDING_RAD_S)

    def read_joint_angles(self) -> FloatArray:
        """Measured angles, f64[6], radians."""
        return np.array(self._call(self._receive.getActualQ), dtype=np.float64)

    def move_joints(self, target: npt.ArrayLike, speed_rad_s: float) -> None:
        """Start moving to f64[6] radians. Raises ArmLimitError before any motion, ArmBusyError during one."""
        wanted = checked_target(self.name, target, speed_rad_s)
        if self.is_moving:
            raise ArmBusyError(self.name, "expected a standing arm, found it moving; wait, or stop() it first")
        if not self._call(self._control.moveJ, wanted.tolist(), speed_rad_s, self._acceleration, True):
            raise ArmConnectionError(
                self.name, "the controller refused the move; check protective stop and remote control"
            )

    def stop(self) -> None:
        """Brake along the path."""
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
        try:
            return function(*arguments)
        except RuntimeError as error:
            raise self._failed("does not answer", error) from error

    def _failed(self, what: str, error: Exception) -> ArmConnectionError:
        reason = " ".join(str(error).split()) or type(error).__name__
        return ArmConnectionError(
            self.name, f"{what} ({reason}); check power, network, remote control mode and emergency stop"
        )
