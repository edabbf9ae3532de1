"""Models of the serial blocks: the I2C bus of a slave, the I2C bus of a master (hub), and a UART."""

from collections.abc import Callable

from host.tests.firmware_images.psoc_part import Part

SCB0, SCB1 = 0x40060000, 0x40070000
CTRL, I2C_CTRL, I2C_STATUS, M_CMD, S_CMD = 0x000, 0x060, 0x064, 0x068, 0x06C
TX_FIFO_CTRL, TX_FIFO_STATUS, TX_FIFO_WR = 0x204, 0x208, 0x240
RX_FIFO_CTRL, RX_FIFO_STATUS, RX_MATCH, RX_FIFO_RD = 0x304, 0x308, 0x310, 0x340
INTR_M, INTR_S, INTR_TX, INTR_RX = 0xF00, 0xF40, 0xF80, 0xFC0
MASK, MASKED = 8, 12
ENABLED, CLEAR, READY_DATA_ACK = 1 << 31, 1 << 16, 1 << 8
FIFO = 8
NACK, ACK, STOP, ADDRESS_MATCH, BUS_ERROR = 1 << 1, 1 << 2, 1 << 4, 1 << 6, 1 << 8
TRIGGER, NOT_EMPTY = 1 << 0, 1 << 2
START, START_ON_IDLE, M_ACK, M_NACK, M_STOP = 1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4
SLICES_MAX = 20_000
"""Maximum number of slices for which a slave may hold SCL."""


class Scb:
    """FIFOs and interrupt registers of a serial block.

    Bits that depend on a FIFO are set while their condition holds.
    """

    def __init__(self, part: Part, base: int, irq: int) -> None:
        self.part, self.base = part, base
        self.received: list[int] = []
        self.to_send: list[int] = []
        self._bits = {INTR_M: 0, INTR_S: 0, INTR_TX: 0, INTR_RX: 0}
        for group in self._bits:
            self._on_read(group, lambda group=group: self._request(group))
            self._on_read(group + MASKED, lambda group=group: self._masked(group))
            self.on_write(group, lambda value, group=group: self._clear(group, value))
        self._on_read(TX_FIFO_STATUS, lambda: len(self.to_send))
        self._on_read(RX_FIFO_STATUS, lambda: len(self.received))
        self._on_read(RX_FIFO_RD, lambda: self.received.pop(0))
        self.on_write(TX_FIFO_WR, self._send)
        self.on_write(TX_FIFO_CTRL, lambda value: self._control(TX_FIFO_CTRL, value, self.to_send))
        self.on_write(RX_FIFO_CTRL, lambda value: self._control(RX_FIFO_CTRL, value, self.received))
        part.levels[irq] = lambda: any(self._masked(group) for group in self._bits)

    def word(self, offset: int) -> int:
        """Return the value last written to the register at `offset`."""
        return self.part.words[self.base + offset]

    @property
    def is_enabled(self) -> bool:
        """CTRL.ENABLED."""
        return bool(self.word(CTRL) & ENABLED)

    def raise_event(self, group: int, bits: int) -> None:
        """Set bits of an interrupt register."""
        self._bits[group] |= bits

    def on_write(self, offset: int, model: Callable[[int], None]) -> None:
        """Set the function that models writes to a register."""
        self.part.on_write[self.base + offset] = model

    def _on_read(self, offset: int, model: Callable[[], int]) -> None:
        self.part.on_read[self.base + offset] = model

    def _request(self, group: int) -> int:
        """Return the active bits of an interrupt register, including those that follow from the fill levels of the
        FIFOs.
        """
        bits = self._bits[group]
        if group == INTR_RX and self.received:
            bits |= NOT_EMPTY
        if group == INTR_RX and len(self.received) > self.word(RX_FIFO_CTRL) & 0xF:
            bits |= TRIGGER
        if group == INTR_TX and len(self.to_send) < self.word(TX_FIFO_CTRL) & 0xF:
            bits |= TRIGGER
        return bits

    def _masked(self, group: int) -> int:
        """Return the active and enabled bits of an interrupt register; 0 if the block is disabled."""
        return self._request(group) & self.word(group + MASK) if self.is_enabled else 0

    def _clear(self, group: int, value: int) -> None:
        self._bits[group] &= ~value

    def _send(self, value: int) -> None:
        """Append a byte to the transmit FIFO, which must have space."""
        assert len(self.to_send) < FIFO, "the FIFO has 8 entries"
        self.to_send.append(value & 0xFF)

    def _control(self, offset: int, value: int, fifo: list[int]) -> None:
        """Store the control register of a FIFO, and clear the FIFO if the bit CLEAR is set."""
        self.part.words[self.base + offset] = value
        if value & CLEAR:
            fifo.clear()


class SlaveBus(Scb):
    """Bus master for a part that is a slave. Every method executes the part during the transfer."""

    def __init__(self, part: Part) -> None:
        super().__init__(part, SCB0, 10)
        self._reply_code = 0
        self.on_write(S_CMD, self._set_reply)

    def write(self, address: int, data: bytes) -> int:
        """Write and stop. Returns the number of acknowledged bytes, including the address."""
        acknowledged = int(self.start(address, reading=False))
        for byte in data if acknowledged else b"":
            self.received.append(byte)
            if not self._is_acknowledged():
                break
            acknowledged += 1
        self.stop()
        return acknowledged

    def read(self, address: int, size: int, first: bytes = b"") -> bytes | None:
        """Read bytes, or None if the slave does not respond. first: bytes written before, without a stop in between."""
        if first:
            if not self.start(address, reading=False):
                return None
            for byte in first:
                self.received.append(byte)
                assert self._is_acknowledged()
        if not self.start(address, reading=True):
            self.stop()
            return None
        data = bytes(self._next_byte() for _ in range(size))
        self.stop()
        return data

    def start(self, address: int, reading: bool) -> bool:
        """Send a start condition and the address; return whether it was acknowledged."""
        if not self.is_enabled or self.word(RX_MATCH) & 0xFE != address << 1:
            return False
        self.part.words[self.base + I2C_STATUS] = reading << 4
        self.raise_event(INTR_S, ADDRESS_MATCH)
        return self._is_acknowledged()

    def stop(self) -> None:
        """Send a stop condition."""
        if self.is_enabled:
            self.raise_event(INTR_S, STOP)
        self.part.run()

    def _set_reply(self, value: int) -> None:
        self._reply_code = value

    def _is_acknowledged(self) -> bool:
        """Execute the part until it acknowledges or refuses the last byte; return whether it acknowledges.

        A disabled block does not acknowledge.
        """
        self._reply_code = 0
        self.part.run_until(lambda: self._reply_code != 0 or not self.is_enabled, SLICES_MAX)
        return self._reply_code == 1

    def _next_byte(self) -> int:
        """Execute the part until it provides a byte to read, and return the byte."""
        self.part.run_until(lambda: bool(self.to_send), SLICES_MAX)
        return self.to_send.pop(0)


class Uart(Scb):
    """Remote end of a hub's UART."""

    def __init__(self, part: Part) -> None:
        super().__init__(part, SCB1, 11)

    def send(self, data: bytes) -> None:
        """Send bytes to the part, one per slice."""
        for byte in data:
            self.received.append(byte)
            self.part.run()

    def take(self) -> bytes:
        """Return and remove the bytes that the part has sent."""
        data = bytes(self.to_send)
        self.to_send.clear()
        return data


class MasterBus(Scb):
    """I2C bus of a hub.

    A device is a function of (bytes written, whether a read follows). It is called when it is addressed and returns the
    bytes to read, or None to refuse. At the stop after a write it is called with the written bytes. `probed`: addresses
    in the order in which they were sent.
    """

    def __init__(self, part: Part, devices: dict[int, Callable[[bytes, bool], bytes | None]]) -> None:
        super().__init__(part, SCB0, 10)
        self.devices = devices
        self.probed: list[int] = []
        self._state = "idle"
        self._address, self._written, self._reply = 0, b"", b""
        for port in range(5):
            part.on_read[0x40040004 + 0x100 * port] = lambda port=port: part.words[0x40040000 + 0x100 * port] | 3
        self.on_write(M_CMD, self._command)
        self.on_write(TX_FIFO_WR, self._byte)
        self.on_write(I2C_CTRL, self._set_settings)
        self._on_read(RX_FIFO_RD, self._pop_received)
        self.on_write(CTRL, self._set_control)

    def _set_control(self, value: int) -> None:
        """Store the control register; disabling the block makes the bus idle."""
        self.part.words[self.base + CTRL] = value
        if not value & ENABLED:
            self._state = "idle"

    def _set_settings(self, value: int) -> None:
        """Store the I2C settings; a read continues once the block acknowledges by itself."""
        self.part.words[self.base + I2C_CTRL] = value
        self._continue_read()

    def _pop_received(self) -> int:
        """Return the oldest received byte; a read continues, because the FIFO has space again."""
        byte = self.received.pop(0)
        self._continue_read()
        return byte

    def _byte(self, value: int) -> None:
        """Process a byte from the part: written data, an address, or the address of a later start."""
        if self._state == "writing":
            self._written += bytes([value & 0xFF])
            self.raise_event(INTR_M, ACK)
        elif self._state == "address":
            self._send_address(value & 0xFF)
        else:
            self._send(value)

    def _send_address(self, value: int) -> None:
        """Address a device, and raise the event of its acknowledge or refusal.

        value: address and read bit, as on the bus. A read starts at once.
        """
        self._address, reading = value >> 1, bool(value & 1)
        self.probed.append(self._address)
        device = self.devices.get(self._address)
        reply = device(self._written, reading) if device else None
        if reply is None:
            self._state = "refused"
            self.raise_event(INTR_M, NACK)
            return
        self._written = b"" if not reading else self._written
        self._state = "reading" if reading else "writing"
        self.raise_event(INTR_M, ACK)
        if reading:
            self._reply = reply
            self._push_reply_byte()

    def _push_reply_byte(self) -> None:
        """Append the next byte of the device to the receive FIFO; 0xFF after the end of its reply."""
        assert len(self.received) < FIFO, "the receive FIFO overflows"
        self.received.append(self._reply[0] if self._reply else 0xFF)
        self._reply = self._reply[1:]
        self._continue_read()

    def _continue_read(self) -> None:
        """Receive the next byte if the block acknowledges by itself and its FIFO has space."""
        if self._state == "reading" and self.word(I2C_CTRL) & READY_DATA_ACK and len(self.received) < FIFO:
            self._push_reply_byte()

    def _command(self, value: int) -> None:
        """Execute a start, a repeated start, a stop or an acknowledge of the master."""
        if value & START_ON_IDLE:
            assert self._state == "idle"
            self._written = b""
            self._send_address(self.to_send.pop(0))
        elif value & START:
            assert self._state == "writing"
            self._state = "address"
        elif value & M_STOP:
            assert bool(value & M_NACK) == (self._state == "reading")
            if self._state == "writing" and self._written:
                self.devices[self._address](self._written, False)
            self._state = "idle"
            self.raise_event(INTR_M, STOP)
        elif value & M_ACK:
            assert self._state == "reading"
            self._push_reply_byte()
