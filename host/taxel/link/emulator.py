"""The emulated skin as a link: an emulator process that runs the firmware, with a socket pair as its UART."""

import contextlib
import importlib.resources
import json
import os
import select
import socket
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taxel.input_files import InputFileError, check_regular_file
from taxel.link.base import Chunk
from taxel.link.errors import LinkError, PortVanishedError
from taxel.link.stimulus import make_stimulus_header, make_stimulus_records
from taxel.native_library import emulator_message

READ_SIZE = 1 << 16
EXIT_TIMEOUT_S = 10.0
"""Time for the emulator process to exit, seconds; then the process is killed (chosen)."""


def find_emulator_program() -> Path:
    """Return the path of the emulator's executable in the installed package. Raises `LinkError` if it is missing."""
    path = importlib.resources.files("taxel") / "native" / "taxel-emulator"
    if not path.is_file():
        raise LinkError("emulator", "its program is missing from the package; install taxel again (pip install .)")
    return Path(str(path))


class EmulatorLink:
    """A link to an emulator process, which is started with the link and ended by `close()`.

    `read` raises `PortVanishedError` with the emulator's message if the emulator rejects the world or the stimulus.
    """

    is_recorded = False
    has_flow_control = False

    def __init__(
        self,
        world: str,
        stimulus: str | os.PathLike[str] | None = None,
        fast: bool = False,
        duration_s: float | None = None,
        baud: float = 1e6,
        live_taxels: int | None = None,
        threads: int = 1,
    ) -> None:
        """Start an emulator process and connect to the UART of its hub.

        world: content of a world file. stimulus: path of a stimulus file; None: no forces. fast: True for virtual time,
        as fast as the link is read; False for real time. duration_s: end of the emulation, seconds; None: until
        `close`. baud: bits per second of the UART. live_taxels: number of taxels of the skin if `apply` sets the forces
        instead of a file. threads: number of threads for the boards, 1 to 16; the bytes do not depend on this number.
        Raises LinkError if the process cannot be started.
        """
        _check_regular_files(stimulus)
        self.name = "emulator:"
        self.baud = baud
        self.is_real_time = not fast
        self._folder = tempfile.TemporaryDirectory(prefix="taxel-")
        self._statistics_path = Path(self._folder.name) / "statistics.json"
        self._stderr_path = Path(self._folder.name) / "stderr.txt"
        self._last_message: str | None = None
        self._statistics: dict[str, Any] | None = None
        self._world_path = world_path = Path(self._folder.name) / "world.txt"
        world_path.write_text(world)
        self._socket, process_socket = socket.socketpair()
        arguments = [
            str(find_emulator_program()),
            "--world",
            str(world_path),
            "--uart",
            f"fd:{process_socket.fileno()}",
            "--stats",
            str(self._statistics_path),
        ]
        arguments += ["--stimulus", os.fspath(stimulus)] if stimulus else []
        arguments += ["--fast"] if fast else []
        arguments += ["--threads", str(threads)]
        arguments += ["--duration", repr(duration_s)] if duration_s is not None else []
        self._stimulus_socket, process_stimulus_socket = socket.socketpair()
        if live_taxels is not None:
            arguments += ["--stimulus", f"fd:{process_stimulus_socket.fileno()}", "--live"]
            self._stimulus_socket.sendall(make_stimulus_header(live_taxels))
        with process_socket, process_stimulus_socket, self._stderr_path.open("wb") as stderr:
            try:
                self._process = subprocess.Popen(
                    arguments,
                    pass_fds=[process_socket.fileno(), process_stimulus_socket.fileno()],
                    stdin=subprocess.DEVNULL,
                    stderr=stderr,
                )
            except ValueError as error:  # a zero byte in a name
                raise LinkError(self.name, f"cannot be started ({error})") from None

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the next bytes of the emulated hub's UART; None if none arrives within `timeout_s` seconds.

        Raises EOFError after the normal end of the emulation, and `PortVanishedError` if the emulator has failed.
        """
        ready, _, _ = select.select([self._socket], [], [], timeout_s)
        if not ready:
            return None
        try:
            data = self._socket.recv(READ_SIZE, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None  # another reader of this link has received the bytes
        except ConnectionError:
            data = b""
        if not data:
            self._raise_ended()
        return Chunk(data, time.monotonic_ns())

    def _raise_ended(self) -> None:
        """Raise EOFError if the emulator process has ended normally, else `PortVanishedError` with its message."""
        status = self._process.wait(timeout=EXIT_TIMEOUT_S)
        if status == 0:
            raise EOFError
        raise PortVanishedError(self.name, self._get_exit_message(status))

    def _get_exit_message(self, status: int) -> str:
        """Return the last line that the emulator wrote to standard error, or a message with its exit status."""
        if self._last_message is None:
            self._last_message = _get_last_line(self._stderr_path.read_bytes(), self._world_path)
        return self._last_message or (
            "the emulator has ended" if status == 0 else f"the emulator ended with status {status}"
        )

    def write(self, data: bytes) -> None:
        """Send bytes to the UART of the emulated hub. Raises `PortVanishedError` if the emulator has ended."""
        try:
            self._socket.sendall(data)
        except OSError:
            status = self._process.wait(timeout=EXIT_TIMEOUT_S)
            raise PortVanishedError(self.name, self._get_exit_message(status)) from None

    def apply(self, forces_n: ArrayLike) -> None:
        """Apply `forces_n` [n], newtons, to the taxels from now on. Only for a link with `live_taxels`."""
        try:  # a record with a negative time takes effect at once
            self._stimulus_socket.sendall(make_stimulus_records([-1.0], np.asarray(forces_n)[None, :]))
        except OSError:
            raise PortVanishedError(self.name, "the emulator has ended, or has no live stimulus") from None

    def statistics(self) -> dict[str, Any]:
        """Return the counters of the emulator.

        The call ends the emulator process, since the emulator writes the counters at its exit. Raises `LinkError`
        without counters.
        """
        self.stop()
        if self._statistics is None:
            try:
                self._statistics = json.loads(self._statistics_path.read_text())
            except (OSError, ValueError):
                raise LinkError(self.name, "ended before it wrote its statistics") from None
        return dict(self._statistics)

    def stop(self) -> None:
        """End the emulator process. Its statistics and its error message stay available."""
        self._socket.close()
        self._stimulus_socket.close()
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(timeout=EXIT_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def close(self) -> None:
        """End the emulator process and delete its temporary files."""
        self.stop()
        if self._stderr_path.exists():  # keep the message and the statistics, whose files are deleted below
            self._get_exit_message(self._process.returncode)
            with contextlib.suppress(LinkError):
                self.statistics()
        self._folder.cleanup()


def _get_last_line(stderr: bytes, world_path: Path) -> str:
    """Return the last line of the emulator's standard error; "" if it is empty.

    In a message about the temporary world file, the path of the file is replaced by the word "file". If the message
    contains the number of a line of this file, the line is quoted.
    """
    lines = stderr.decode(errors="replace").strip().splitlines()
    if lines and str(world_path) in lines[-1]:
        return emulator_message(lines[-1], str(world_path), world_path.read_text())
    return lines[-1] if lines else ""


def _check_regular_files(*paths: str | os.PathLike[str] | None) -> None:
    """Raise LinkError for an input file that is a pipe or a device; None and missing files are not checked.

    The emulator itself reports a missing file.
    """
    for path in paths:
        if path is None or not os.path.exists(path):
            continue
        try:
            check_regular_file(path)
        except InputFileError as error:
            raise LinkError(os.fspath(path), f"cannot be read ({error.strerror})") from None


def run_emulator(
    world: str,
    capture: str | os.PathLike[str],
    duration_s: float,
    host_input: str | os.PathLike[str] | None = None,
    stimulus: str | os.PathLike[str] | None = None,
    threads: int = 1,
) -> dict[str, Any]:
    """Run an emulator for `duration_s` seconds of virtual time without a host, and return its statistics.

    world: content of a world file. capture: file to which the hub's bytes are written. host_input: capture file of the
    host's bytes with their times, or None. stimulus: path of a stimulus file; None: no forces. threads: number of
    threads for the boards, 1 to 16. The bytes are the same in every run and for every number of threads. Raises
    `LinkError` with the emulator's message if the emulator rejects its input.
    """
    _check_regular_files(stimulus, host_input)
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        world_path = Path(folder) / "world.txt"
        world_path.write_text(world)
        statistics = Path(folder) / "statistics.json"
        arguments = [
            str(find_emulator_program()),
            "--fast",
            "--world",
            str(world_path),
            "--uart",
            f"capture:{os.fspath(capture)}",
            "--threads",
            str(threads),
        ]
        arguments += ["--duration", repr(duration_s), "--stats", str(statistics)]
        arguments += ["--host-input", os.fspath(host_input)] if host_input else []
        arguments += ["--stimulus", os.fspath(stimulus)] if stimulus else []
        process = subprocess.run(arguments, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
        if process.returncode != 0:
            raise LinkError(
                "emulator", _get_last_line(process.stderr, world_path) or f"ended with status {process.returncode}"
            )
        result: dict[str, Any] = json.loads(statistics.read_text())
        return result
