"""A fake gantry that processes G-code as grbl does, as a port object or behind a pseudo-terminal."""

import os
import re
import select
import threading
import tty
from collections.abc import Callable

TOUCH_Z = 2.0
SPRING = 10.0
X, Y = 10.0, 20.0
PITCH_MM = 5.0


class FakeGantry:
    """Answers "ok", "error:9" or nothing; has the methods of `serial.Serial` that the probe uses.

    `on_press` is called with the position (x, y) in millimetres and the force in newtons. `answer`: answer to a line.
    `ignored_lines`: number of lines that the gantry ignores at first.
    """

    def __init__(self, on_press=lambda x, y, force: None, banner=b"", ignored_lines=0):
        self.on_press = on_press
        self.answer: Callable[[str], bytes] = lambda line: b"ok\r\n"
        self.lines: list[str] = []
        self.position = {"X": 0.0, "Y": 0.0, "Z": 50.0}
        self.deepest = 50.0
        self.port = "/dev/ttyFAKE"
        self.is_open = True
        self.timeout = 0.0
        self._ignored_lines = ignored_lines
        self._output = banner

    def write(self, data):
        for line in data.decode().splitlines():
            self._output += self.process(line)

    def readline(self):
        line, newline, self._output = self._output.partition(b"\n")
        return line + newline

    def process(self, line):
        """Execute a line; returns the answer."""
        if self._ignored_lines:
            self._ignored_lines -= 1
            return b""
        self.lines.append(line)
        answer = self.answer(line)
        if b"ok" in answer:
            self._move(line)
        return answer

    def _move(self, line):
        """Move to the position in a line of G-code, and report the position and the force to `on_press`."""
        axes = {axis: float(value) for axis, value in re.findall(r"([XYZ])(-?[\d.]+)", line)}
        if axes.keys() & {"X", "Y"}:
            assert self.position["Z"] > TOUCH_Z  # The tip must never move across the board while it touches.
        self.position |= axes
        self.deepest = min(self.deepest, self.position["Z"])
        if axes:
            self.on_press(self.position["X"], self.position["Y"], max(TOUCH_Z - self.position["Z"], 0.0) * SPRING)

    def close(self):
        self.is_open = False


class PtyGantry(FakeGantry):
    """A fake gantry behind a pseudo-terminal that pyserial opens."""

    def __init__(self, **options):
        super().__init__(**options)
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        os.write(self._master, self._output)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        """Execute the lines that arrive at the pseudo-terminal, until the gantry is closed."""
        received = b""
        while self.is_open:
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            received += os.read(self._master, 256)
            while b"\n" in received:
                line, _, received = received.partition(b"\n")
                os.write(self._master, self.process(line.decode()))

    def close(self):
        super().close()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)


def press_with(kind, probe):
    """Return a callback for `on_press` that applies the force with a probe on an emulated board of a kind."""
    taxel_at = {(int(tx), int(rx)): taxel for taxel, (tx, rx) in enumerate(zip(kind.tx, kind.rx, strict=True))}

    def apply_force(x, y, force):
        """Apply a force at a position in mm to the nearest taxel, or release the board for a force of 0."""
        if force > 0.0:
            probe.press(taxel_at[round((x - X) / PITCH_MM), round((y - Y) / PITCH_MM)], force, 3e-3)
        else:
            probe.release()

    return apply_force
