"""The CapSense block of a part under test: a conversion ends after its period with a count of its lines."""

from __future__ import annotations

from host.tests.firmware_images.psoc_part import Part

CONFIG, IDAC, COUNTER, STATUS, INTR = 0x40080004, 0x40080008, 0x4008000C, 0x40080010, 0x40080014
HSIOM = 0x40010000
ENABLE, SENSE_EN = 1 << 31, 1 << 12
SENSE_CLOCK, BUS_A = 4, 6
CMOD = (4, 2)


def count_of(tx: int, rx: int) -> int:
    """Sample clocks in which the current source was on."""
    return 500 + 37 * tx + 401 * rx


class FrontEnd:
    """tx_pins, rx_pins: (port, number) of each line. `codes`: IDAC code of each RX line that was converted."""

    def __init__(self, part: Part, tx_pins: list[tuple[int, int]], rx_pins: list[tuple[int, int]]) -> None:
        self._part = part
        self._tx, self._rx = tx_pins, rx_pins
        self._counter = 0
        self._runs = False
        self._ends = 0
        self._is_over = False
        self.codes: dict[int, int] = {}
        self.conversions = 0
        part.on_write[CONFIG] = self._set_config
        part.on_write[COUNTER] = self._set_counter
        part.on_write[INTR] = self._clear
        part.on_read[COUNTER] = self._read_counter
        part.on_read[STATUS] = lambda: (1 << 1) * self._runs
        part.levels[15] = self._is_due

    def _connected(self, function: int) -> list[tuple[int, int]]:
        words = [(port, self._part.words[HSIOM + 4 * port]) for port in range(5)]
        return [(port, pin) for port, word in words for pin in range(8) if word >> (4 * pin) & 0xF == function]

    def _set_config(self, value: int) -> None:
        self._part.words[CONFIG] = value
        if not value & SENSE_EN:
            self._runs = False
            return
        assert value & ENABLE
        assert self._counter >> 16, "the counter before the sense clock"
        self._runs = True
        self._ends = self._part.cycles + (self._counter >> 16)

    def _set_counter(self, value: int) -> None:
        self._counter = value

    def _read_counter(self) -> int:
        if not self._counter >> 16:
            return self._counter
        self._counter -= 1 << 16  # it counts down
        return self._counter

    def _is_due(self) -> bool:
        if self._runs and self._part.cycles >= self._ends and self._counter >> 16:
            (tx,) = self._connected(SENSE_CLOCK)
            (rx,) = [pin for pin in self._connected(BUS_A) if pin != CMOD]
            assert CMOD in self._connected(BUS_A)
            line = self._rx.index(rx)
            self.codes[line] = self._part.words[IDAC] & 0xFF
            self._counter = count_of(self._tx.index(tx), line)
            self._is_over = True
            self.conversions += 1
        return self._is_over

    def _clear(self, value: int) -> None:
        self._is_over &= not value & 1
