"""Emulated hubs whose port a test unplugs and plugs in again."""

import contextlib
import os
import signal
import socket
import subprocess
import threading
from pathlib import Path

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.emulator import EmulatorLink, find_emulator_program

TIMEOUT_S = 20.0


class RestartableHub:
    """An emulated hub with a pseudo-terminal whose name stays the same when the hub is restarted."""

    def __init__(self, folder: Path, hand: str = "flat8") -> None:
        self._world = folder / "world.txt"
        self._world.write_text(format_world(load_hand(hand), WorldSettings()))
        self._name = folder / "port"
        self.url = f"serial://{self._name}"
        self._process: subprocess.Popen[str] | None = None
        self.start()

    def start(self) -> None:
        """Start the hub, and let the name of the port point to its new pseudo-terminal."""
        self._process = subprocess.Popen(
            [find_emulator_program(), "--world", self._world, "--uart", "pty"], stdout=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        device = self._process.stdout.readline().split()[-1]
        self._name.symlink_to(device)

    def stop(self) -> None:
        """End the hub, as if its power and its adapter were unplugged."""
        assert self._process is not None
        assert self._process.stdout is not None
        self._name.unlink(missing_ok=True)
        self._process.send_signal(signal.SIGCONT)
        self._process.kill()
        self._process.wait(timeout=TIMEOUT_S)
        self._process.stdout.close()

    def freeze(self) -> None:
        """Suspend the process of the hub, whose port stays open but sends nothing."""
        assert self._process is not None
        os.kill(self._process.pid, signal.SIGSTOP)


class UnpluggableHub:
    """An emulated hub that keeps running while its cable, a TCP connection, is unplugged."""

    def __init__(self, hand: str = "flat8") -> None:
        self._link = EmulatorLink(format_world(load_hand(hand), WorldSettings()))
        self._server = socket.create_server(("127.0.0.1", 0))
        self.url = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._connection: socket.socket | None = None
        self._is_plugged = threading.Event()
        self._is_plugged.set()
        self._is_closed = False
        self._threads = [threading.Thread(target=target, daemon=True) for target in (self._accept, self._send)]
        for thread in self._threads:
            thread.start()

    def _accept(self) -> None:
        """Pass the bytes of each host to the hub."""
        while not self._is_closed:
            try:
                connection, _ = self._server.accept()
            except OSError:
                return
            if not self._is_plugged.is_set():
                connection.close()
                continue
            self._connection = connection
            try:
                while data := connection.recv(4096):
                    self._link.write(data)
            except OSError:
                pass

    def _send(self) -> None:
        """Pass the bytes of the hub to the host; without a host they are lost."""
        while not self._is_closed:
            try:
                chunk = self._link.read(0.05)
            except Exception:
                return
            connection = self._connection
            if chunk is not None and connection is not None and self._is_plugged.is_set():
                with contextlib.suppress(OSError):
                    connection.sendall(chunk.data)

    def unplug(self) -> None:
        """Close the connection of the host, and refuse new ones until `plug`."""
        self._is_plugged.clear()
        if self._connection is not None:
            self._connection.shutdown(socket.SHUT_RDWR)
            self._connection.close()
            self._connection = None

    def plug(self) -> None:
        self._is_plugged.set()

    def close(self) -> None:
        self._is_closed = True
        self._server.close()
        if self._connection is not None:
            self._connection.close()
        for thread in self._threads[1:]:
            thread.join(TIMEOUT_S)
        self._link.close()
