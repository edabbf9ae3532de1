"""An emulated bench in real time with the ports that drivers of physical rigs open."""

import contextlib
import selectors
import socket
import struct
import subprocess
import threading
import time
from pathlib import Path
from typing import Final, Self

import can
from smbus2 import i2c_msg

from taxel.hand.allegro import FreeJoints, VirtualAllegro, open_bus
from taxel.link.virtual import VirtualSMBus, VirtualWorld

STEP_S: Final = 0.001
_MESSAGE_HEADER: Final = struct.Struct("<HHH")


def build_shim(folder: Path) -> Path:
    """Compile fake_i2c.c into `folder`, and return the path of the library."""
    library = folder / "libfake_i2c.so"
    source = Path(__file__).with_name("fake_i2c.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-Wall", "-Werror", "-o", library, source, "-ldl"], check=True)
    return library


class FakeBench:
    """Runs `world` in a thread in real time, and serves its I2C bus on a socket. Use the bench as a context manager.

    world: an emulated world whose UART is a pseudo-terminal. i2c_socket: path of the socket to which fake_i2c.c
    connects. can_url: CAN channel with a virtual Allegro hand at its other end; None: no hand.
    """

    def __init__(
        self, world: VirtualWorld, i2c_socket: Path, can_url: str | None = None, *, is_paced: bool = False
    ) -> None:
        """Create a bench of emulated boards that looks like real hardware to another process.

        world: the emulated hub and boards. i2c_socket: path of the Unix socket that serves the emulated I2C bus.
        can_url: CAN bus on which an emulated Allegro hand answers; None: no hand. is_paced: a transfer takes as long as
        on a real bus; otherwise it ends as soon as it is computed.
        """
        self._world, self._bus, self._is_paced = world, VirtualSMBus(world, recovers=True), is_paced
        self._start_s = 0.0
        self._stop = threading.Event()
        self._server = socket.socket(socket.AF_UNIX)
        self._server.bind(str(i2c_socket))
        self._server.listen()
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._server, selectors.EVENT_READ)
        self._threads = [threading.Thread(target=self._run)]
        self._can: can.BusABC | None = None
        if can_url is not None:
            self._can = open_bus(can_url)
            hand = VirtualAllegro(self._can, FreeJoints())
            self._threads.append(threading.Thread(target=hand.run, args=(self._stop,)))

    def __enter__(self) -> Self:
        """Start the threads that run the emulated boards and, with a CAN bus, the emulated hand."""
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop the threads, and close the sockets and the CAN bus."""
        self._stop.set()
        for thread in self._threads:
            thread.join()
        self._selector.close()
        self._server.close()
        if self._can is not None:
            self._can.shutdown()

    def _run(self) -> None:
        """Serve I2C requests, and let the virtual time of the emulated boards follow the real time, until the bench
        stops.
        """
        self._start_s = time.monotonic() - self._world.now_s
        while not self._stop.is_set():
            for key, _ in self._selector.select(STEP_S):
                self._serve(key.fileobj)
            lead_s = self._compute_lead_s()
            if lead_s < 0.0:
                self._world.run(-lead_s)

    def _compute_lead_s(self) -> float:
        """Compute the time by which the world's clock is ahead of real time, seconds; negative if it is behind."""
        return self._world.now_s - (time.monotonic() - self._start_s)

    def _serve(self, stream: object) -> None:
        """Handle a readable socket: accept a new client, or execute one I2C transfer of a client. A broken client
        is closed.
        """
        assert isinstance(stream, socket.socket)
        if stream is self._server:
            self._selector.register(self._server.accept()[0], selectors.EVENT_READ)
            return
        try:
            self._serve_transfer(stream)
        except (ConnectionError, struct.error):
            self._selector.unregister(stream)
            stream.close()

    def _serve_transfer(self, stream: socket.socket) -> None:
        """Read one request from the shim, run its transfer on the emulated bus, and send the reply."""
        messages = []
        for _ in range(struct.unpack("<I", _receive_exactly(stream, 4))[0]):
            address, flags, length = _MESSAGE_HEADER.unpack(_receive_exactly(stream, _MESSAGE_HEADER.size))
            is_read = bool(flags & 1)
            messages.append(
                i2c_msg.read(address, length) if is_read else i2c_msg.write(address, _receive_exactly(stream, length))
            )
        try:
            self._bus.i2c_rdwr(*messages)
        except OSError as error:
            self._wait_for_end()
            stream.sendall(struct.pack("<i", error.errno))
            return
        self._wait_for_end()
        stream.sendall(struct.pack("<i", 0) + b"".join(bytes(message) for message in messages if message.flags & 1))

    def _wait_for_end(self) -> None:
        """Wait until the end of the transfer in real time, if the bench is paced."""
        if self._is_paced and (lead_s := self._compute_lead_s()) > 0.0:
            time.sleep(lead_s)


def _receive_exactly(stream: socket.socket, size: int) -> bytes:
    """Receive `size` bytes from a socket. Raises `ConnectionError` if the peer closes the connection before."""
    data = b""
    while len(data) < size:
        received = stream.recv(size - len(data))
        if not received:
            raise ConnectionError
        data += received
    return data


def has_multicast() -> bool:
    """Whether this machine delivers multicast to itself; some containers do not."""
    with contextlib.suppress(Exception):
        ends = [open_bus("can:udp:239.74.163.2:43999") for _ in range(2)]
        try:
            ends[0].send(can.Message(arbitration_id=1, data=b"x", is_extended_id=False))
            return ends[1].recv(1.0) is not None
        finally:
            for end in ends:
                end.shutdown()
    return False
