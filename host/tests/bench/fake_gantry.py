"""A gantry in a program: it takes G-code as grbl does, from a port that it is handed or behind a pseudo-terminal."""

from __future__ import annotations

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
    """Answers "ok", "error:9", or nothing at all; also a port, with what the probe needs of `serial.Serial`.

    on_press: told of place (x, y) in millimetres and force in newtons. answer: what it says to a line, if not "ok".
    deaf_lines: how many lines it does not hear at first.
    """

    def __init__(self, on_press=lambda x, y, force: None, greeting=b"", deaf_lines=0):
        self.on_press = on_press
        self.answer: Callable[[str], bytes] = lambda line: b"ok\r\n"
        self.lines: list[str] = []
        self.at = {"X": 0.0, "Y": 0.0, "Z": 50.0}
        self.deepest = 50.0
        self.port = "/dev/ttyFAKE"
        self.is_open = True
        self.timeout = 0.0
        self._deaf_lines = deaf_lines
        self._said = greeting

    def write(self, data):
        for line in data.decode().splitlines():
            self._said += self.take(line)

    def readline(self):
        line, found, self._said = self._said.partition(b"\n")
        return line + found

    def take(self, line):
        """Do what a line says; the answer."""
        if self._deaf_lines:
            self._deaf_lines -= 1
            return b""
        self.lines.append(line)
        answer = self.answer(line)
        if b"ok" in answer:
            self._move(line)
        return answer

    def _move(self, line):
        moved = {axis: float(value) for axis, value in re.findall(r"([XYZ])(-?[\d.]+)", line)}
        if moved.keys() & {"X", "Y"}:
            assert self.at["Z"] > TOUCH_Z  # never across the board while it presses
        self.at |= moved
        self.deepest = min(self.deepest, self.at["Z"])
        if moved:
            self.on_press(self.at["X"], self.at["Y"], max(TOUCH_Z - self.at["Z"], 0.0) * SPRING)

    def close(self):
        self.is_open = False


class PtyGantry(FakeGantry):
    """The same behind a pseudo-terminal that pyserial opens."""

    def __init__(self, **options):
        super().__init__(**options)
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        os.write(self._master, self._said)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self):
        waiting = b""
        while self.is_open:
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            waiting += os.read(self._master, 256)
            while b"\n" in waiting:
                line, _, waiting = waiting.partition(b"\n")
                os.write(self._master, self.take(line.decode()))

    def close(self):
        super().close()
        self._thread.join()
        os.close(self._slave)
        os.close(self._master)


def pressing(kind, finger):
    """What a gantry does to an emulated board: `finger` presses where it stands."""
    places = {(int(tx), int(rx)): taxel for taxel, (tx, rx) in enumerate(zip(kind.tx, kind.rx, strict=True))}

    def press(x, y, force):
        if force > 0.0:
            finger.press(places[round((x - X) / PITCH_MM), round((y - Y) / PITCH_MM)], force, 3e-3)
        else:
            finger.release()

    return press
