"""A monitor with its page as a separate process on an emulated hand."""

import re
import signal
import subprocess
import sys
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

START_TIMEOUT_S = 60.0
END_TIMEOUT_S = 30.0


class MonitorProcess:
    """`taxel monitor URL --web` as a process: its address, its memory, and its output after its end."""

    def __init__(self, url: str = "emulator:", *options: str) -> None:
        """Start the monitor, and wait until it has printed the address of its page."""
        command = [str(Path(sys.executable).with_name("taxel")), "monitor", url, "--web", "--port", "0", *options]
        # A process that a shell started in the background ignores SIGINT (Ctrl-C), and its children inherit this. `end`
        # stops the monitor by SIGINT, so the monitor gets the default action of the signal.
        self._process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        watchdog = threading.Timer(START_TIMEOUT_S, self._process.kill)
        watchdog.start()
        line = self._process.stdout.readline()
        watchdog.cancel()
        match = re.search(r"http://\S+", line)
        assert match is not None, line or self._process.stderr.read()
        self.url = match.group()
        self.errors: list[str] = []
        self._thread = threading.Thread(target=self._collect_errors, daemon=True)
        self._thread.start()

    def _collect_errors(self) -> None:
        """Store the lines of standard error."""
        assert self._process.stderr is not None
        self.errors.extend(line.rstrip("\n") for line in self._process.stderr)

    @property
    def is_running(self) -> bool:
        """Whether the process has not ended."""
        return self._process.poll() is None

    @property
    def resident_mb(self) -> float:
        """Resident memory of the process, MB."""
        text = Path(f"/proc/{self._process.pid}/status").read_text()
        match = re.search(r"VmRSS:\s+(\d+) kB", text)
        assert match is not None
        return int(match.group(1)) / 1000.0

    def end(self) -> tuple[int, str]:
        """End the monitor with Ctrl-C; return its exit status and the rest of its output."""
        self._process.send_signal(signal.SIGINT)
        assert self._process.stdout is not None
        watchdog = threading.Timer(END_TIMEOUT_S, self._process.kill)
        watchdog.start()
        output = self._process.stdout.read()
        watchdog.cancel()
        status = self._process.wait(timeout=END_TIMEOUT_S)
        self._thread.join(timeout=END_TIMEOUT_S)
        return status, output

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Kill the process if it is still running."""
        if self.is_running:
            self._process.kill()
            self._process.wait()
