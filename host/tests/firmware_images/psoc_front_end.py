"""Model of the CapSense block: a conversion ends after its period with a count that depends on its lines."""

from collections.abc import Callable

from host.tests.firmware_images.psoc_part import Part

CONFIG, IDAC, COUNTER, STATUS, INTR = 0x40080004, 0x40080008, 0x4008000C, 0x40080010, 0x40080014
HSIOM = 0x40010000
ENABLE, SENSE_EN = 1 << 31, 1 << 12
SENSE_CLOCK, BUS_A = 4, 6
CMOD = (4, 2)


def simulate_count(tx: int, rx: int) -> int:
    """Compute the simulated count of a crossing: sample clocks in which the current source was on."""
    return 500 + 37 * tx + 401 * rx


class FrontEnd:
    """CapSense block of a part.

    tx_pins, rx_pins: (port, number) of each line. simulate: returns the count of a crossing (tx, rx). `codes`: code of
    the current source at the last conversion of each RX line. `conversions`: number of conversions.
    """

    def __init__(
        self,
        part: Part,
        tx_pins: list[tuple[int, int]],
        rx_pins: list[tuple[int, int]],
        simulate: Callable[[int, int], int] = simulate_count,
    ) -> None:
        self._part = part
        self._simulate = simulate
        self._tx, self._rx = tx_pins, rx_pins
        self._counter = 0
        self._is_running = False
        self._end_cycle = 0
        self._is_finished = False
        self.codes: dict[int, int] = {}
        self.conversions = 0
        part.on_write[CONFIG] = self._set_config
        part.on_write[COUNTER] = self._set_counter
        part.on_write[INTR] = self._clear
        part.on_read[COUNTER] = self._read_counter
        part.on_read[STATUS] = lambda: (1 << 1) * self._is_running
        part.levels[15] = self._is_due

    def _connected(self, function: int) -> list[tuple[int, int]]:
        """Return the pins (port, number) whose connection register selects a function."""
        registers = [(port, self._part.words[HSIOM + 4 * port]) for port in range(5)]
        return [(port, pin) for port, word in registers for pin in range(8) if word >> (4 * pin) & 0xF == function]

    def _set_config(self, value: int) -> None:
        """Start a conversion if the sense clock is enabled, otherwise stop it."""
        self._part.words[CONFIG] = value
        if not value & SENSE_EN:
            self._is_running = False
            return
        assert value & ENABLE
        assert self._counter >> 16, "expected a write of the counter before the sense clock"
        self._is_running = True
        self._end_cycle = self._part.cycles + (self._counter >> 16)

    def _set_counter(self, value: int) -> None:
        self._counter = value

    def _read_counter(self) -> int:
        """Return the counter, which decrements once per read during a conversion."""
        if not self._counter >> 16:
            return self._counter
        self._counter -= 1 << 16  # the counter decrements
        return self._counter

    def _is_due(self) -> bool:
        """Return whether the interrupt of a finished conversion is active; a conversion at its end stores its count."""
        if self._is_running and self._part.cycles >= self._end_cycle and self._counter >> 16:
            (tx,) = self._connected(SENSE_CLOCK)
            (rx,) = [pin for pin in self._connected(BUS_A) if pin != CMOD]
            assert CMOD in self._connected(BUS_A)
            line = self._rx.index(rx)
            self.codes[line] = self._part.words[IDAC] & 0xFF
            self._counter = self._simulate(self._tx.index(tx), line)
            self._is_finished = True
            self.conversions += 1
        return self._is_finished

    def _clear(self, value: int) -> None:
        self._is_finished &= not value & 1
