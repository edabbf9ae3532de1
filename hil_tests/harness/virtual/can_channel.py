"""A CAN channel that can lose frames and enter the state bus-off."""

import can


class FaultyChannel(can.BusABC):
    """The host's end of a CAN channel with faults.

    .. warning::
        Not modelled: bit timing, error counters, and the 128 x 11 recessive bits after which a node leaves bus-off.
    """

    def __init__(self, bus: can.BusABC) -> None:
        """Wrap the host's end of a CAN bus so that frames can be lost.

        `frames_to_lose`: number of next frames, of either direction, that disappear. `is_off`: whether the
        controller has left the bus after too many errors (bus-off).
        """
        self._bus = bus
        self.frames_to_lose = 0
        self.is_off = False
        self.channel_info = bus.channel_info
        self._is_shutdown = False
        self._filters = None
        self._periodic_tasks = []

    @property
    def state(self) -> can.BusState:
        return can.BusState.ERROR if self.is_off else can.BusState.ACTIVE

    @state.setter
    def state(self, new_state: can.BusState) -> None:
        raise NotImplementedError("the state of the channel is set by its faults")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a CAN frame, unless it is to be lost. Raises `can.CanOperationError` while the controller is bus-off."""
        if self.is_off:
            raise can.CanOperationError("bus-off: the controller has left the bus")
        if self.frames_to_lose:
            self.frames_to_lose -= 1
            return
        self._bus.send(msg, timeout)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next CAN frame that is not lost; None if none arrives within `timeout` seconds.

        Frames are lost while the controller is bus-off.
        """
        while (frame := self._bus.recv(timeout)) is not None:
            if self.is_off:
                continue
            if self.frames_to_lose:
                self.frames_to_lose -= 1
                continue
            return frame
        return None

    def shutdown(self) -> None:
        self._is_shutdown = True
