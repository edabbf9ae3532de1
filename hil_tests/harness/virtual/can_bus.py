"""A virtual Allegro hand on python-can's virtual bus, in lock step, and what can go wrong with both."""

import itertools
from contextlib import ExitStack

import can

from taxel.hand.allegro import FreeJoints, VirtualAllegro

_NAMES = itertools.count()


class _Channel(can.BusABC):
    """The host's end of a channel that loses frames and goes bus-off.

    .. warning::
        Not modelled: bit timing, error counters, and the 128 x 11 recessive bits after which a node comes back.
    """

    def __init__(self, bus: can.BusABC) -> None:
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
        raise NotImplementedError("the channel's state is set by its faults")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.is_off:
            raise can.CanOperationError("bus-off: the controller has left the bus")
        if self.frames_to_lose:
            self.frames_to_lose -= 1
            return
        self._bus.send(msg, timeout)

    def recv(self, timeout: float | None = None) -> can.Message | None:
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


class VirtualCanBus:
    """The channel and the hand at its other end; time is the hand's own."""

    def __init__(self, stack: ExitStack) -> None:
        name = f"hil-{next(_NAMES)}"
        self._ends = [can.Bus(name, "virtual") for _ in range(2)]
        for end in self._ends:
            stack.callback(end.shutdown)
        self.channel = _Channel(self._ends[0])
        stack.callback(self.channel.shutdown)
        self.hand = VirtualAllegro(self._ends[1], FreeJoints())

    def open(self) -> can.BusABC:
        return self.channel

    def let_pass(self, seconds: float) -> None:
        self.hand.step(seconds)

    def now_s(self) -> float:
        return self.hand.time_s


class VirtualCanFaults:
    """Faults of hand and channel."""

    def __init__(self, can_bus: VirtualCanBus) -> None:
        self._channel, self._faults = can_bus.channel, can_bus.hand.faults

    def lose_frames(self, count: int) -> None:
        self._channel.frames_to_lose = count

    def go_bus_off(self, off: bool) -> None:
        self._channel.is_off = off

    def set_temperature(self, celsius: int) -> None:
        self._faults.temperature_c = celsius

    def switch_servo_off(self, off: bool) -> None:
        self._faults.is_servo_off = off

    def silence(self, silent: bool) -> None:
        self._faults.is_silent = silent

    def silence_finger(self, finger: int, silent: bool) -> None:
        (self._faults.dropped_fingers.add if silent else self._faults.dropped_fingers.discard)(finger)
