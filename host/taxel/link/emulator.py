"""The emulated skin as a link: a process that runs the real firmware, and a socket pair for its UART."""

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

from taxel.link.base import Chunk
from taxel.link.errors import LinkError, PortVanishedError
from taxel.link.stimulus import stimulus_header, stimulus_records

READ_SIZE = 1 << 16
END_TIMEOUT_S = 10.0


def emulator_program() -> Path:
    """The emulator's executable inside the installed package. Raises `LinkError` if it was not built."""
    path = importlib.resources.files("taxel") / "native" / "taxel-emulator"
    if not path.is_file():
        raise LinkError("emulator", "its program is missing from the package; install taxel again (pip install .)")
    return Path(str(path))


class EmulatorLink:
    """An emulator process of our own, ended with the link.

    `world` is the text of a world file; `stimulus` a stimulus file or None; `fast` runs as fast as the reader reads
    (virtual time), else in real time; `threads` share its work on the boards (1 to 16; the bytes are the same). With
    `live_taxels`, the number of the skin's taxels, forces come from `apply()` instead of a file. Raises `LinkError`
    with the emulator's own line if it refuses world or stimulus.
    """

    is_recorded = False
    holds_back = False

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
        self.name = "emulator:"
        self.baud = baud
        self.is_real_time = not fast
        self._folder = tempfile.TemporaryDirectory(prefix="taxel-")
        self._stats = Path(self._folder.name) / "statistics.json"
        self._stderr = Path(self._folder.name) / "stderr.txt"
        self._last_words: str | None = None
        self._counted: dict[str, Any] | None = None
        world_path = Path(self._folder.name) / "world.txt"
        world_path.write_text(world)
        self._socket, theirs = socket.socketpair()
        arguments = [str(emulator_program()), "--world", str(world_path), "--uart", f"fd:{theirs.fileno()}"]
        arguments += ["--stats", str(self._stats)]
        arguments += ["--stimulus", os.fspath(stimulus)] if stimulus else []
        arguments += ["--fast"] if fast else []
        arguments += ["--threads", str(threads)]
        arguments += ["--duration", repr(duration_s)] if duration_s is not None else []
        self._live, their_live = socket.socketpair()
        if live_taxels is not None:
            arguments += ["--stimulus", f"fd:{their_live.fileno()}", "--live"]
            self._live.sendall(stimulus_header(live_taxels))
        with theirs, their_live, self._stderr.open("wb") as complaints:
            try:
                self._process = subprocess.Popen(
                    arguments,
                    pass_fds=[theirs.fileno(), their_live.fileno()],
                    stdin=subprocess.DEVNULL,
                    stderr=complaints,
                )
            except ValueError as error:  # a zero byte in a name
                raise LinkError(self.name, f"cannot be started ({error})") from None

    def read(self, timeout_s: float) -> Chunk | None:
        """The next bytes of the hub's UART."""
        ready, _, _ = select.select([self._socket], [], [], timeout_s)
        if not ready:
            return None
        try:
            data = self._socket.recv(READ_SIZE, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None  # somebody else who reads this link has taken it meanwhile
        except ConnectionError:
            data = b""
        if not data:
            self._raise_ended()
        return Chunk(data, time.monotonic_ns())

    def _raise_ended(self) -> None:
        status = self._process.wait(timeout=END_TIMEOUT_S)
        if status == 0:
            raise EOFError
        raise PortVanishedError(self.name, self._complaint(status))

    def _complaint(self, status: int) -> str:
        if self._last_words is None:
            self._last_words = _last_line(self._stderr.read_bytes())
        return self._last_words or (
            "the emulator has ended" if status == 0 else f"the emulator ended with status {status}"
        )

    def write(self, data: bytes) -> None:
        """Send bytes to the hub."""
        try:
            self._socket.sendall(data)
        except OSError:
            status = self._process.wait(timeout=END_TIMEOUT_S)
            raise PortVanishedError(self.name, self._complaint(status)) from None

    def apply(self, forces_n: ArrayLike) -> None:
        """Let `forces_n` [n] newtons act on the taxels from now on; only for a link with `live_taxels`."""
        try:
            self._live.sendall(stimulus_records([-1.0], np.asarray(forces_n)[None, :]))
        except OSError:
            raise PortVanishedError(self.name, "the emulator has ended, or takes no live forces") from None

    def statistics(self) -> dict[str, Any]:
        """What the emulator counted itself; only after `close()` or the end of the stream."""
        self.stop()
        if self._counted is None:
            try:
                self._counted = json.loads(self._stats.read_text())
            except (OSError, ValueError):
                raise LinkError(self.name, "was ended before it had counted anything") from None
        return dict(self._counted)

    def stop(self) -> None:
        """End the process; keep its statistics."""
        self._socket.close()
        self._live.close()
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(timeout=END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def close(self) -> None:
        """End the process and forget its files."""
        self.stop()
        if self._stderr.exists():
            self._complaint(self._process.returncode)
            with contextlib.suppress(LinkError):
                self.statistics()
        self._folder.cleanup()


def _last_line(stderr: bytes) -> str:
    lines = stderr.decode(errors="replace").strip().splitlines()
    return lines[-1] if lines else ""


def run_emulator(
    world: str,
    capture: str | os.PathLike[str],
    duration_s: float,
    host_input: str | os.PathLike[str] | None = None,
    stimulus: str | os.PathLike[str] | None = None,
    threads: int = 1,
) -> dict[str, Any]:
    """Run an emulator from start to end without a host: virtual time only, repeatable to the byte.

    `host_input` is a capture of what a host would send and when. The hub's bytes go to `capture`; returns the
    emulator's statistics. `threads` (1 to 16) share its work; the bytes are the same whatever their number. Raises
    `LinkError` with the emulator's own line if it refuses its input.
    """
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        world_path = Path(folder) / "world.txt"
        world_path.write_text(world)
        statistics = Path(folder) / "statistics.json"
        arguments = [
            str(emulator_program()),
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
        done = subprocess.run(arguments, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False)
        if done.returncode != 0:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            raise LinkError("emulator", lines[-1] if lines else f"ended with status {done.returncode}")
        result: dict[str, Any] = json.loads(statistics.read_text())
        return result
