"""A gantry that speaks G-code, with a spring-loaded tip: force is travel beyond touch, times the spring's stiffness.

Absolute millimetres (G21, G90), rapid moves (G0) at the clear height, slow ones (G1) towards the board, and G4 P0,
which a controller answers only when it stands still. Every line is answered with "ok" (grbl, Marlin). Not verified on
hardware.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields
from typing import Any, Final, NoReturn
from urllib.parse import parse_qs

import serial

from taxel.hand import BoardKind
from taxel.link.url import split_url
from taxel_tools.bench.probe.base import ProbeError
from taxel_tools.testing.operator import Operator

FORCE_MAX_N: Final = 60.0
"""More than the curve of the thesis's Figure 2.5 needs; a plan that asks for more is mistaken."""
ANSWER_S: Final = 30.0
"""A move across the whole gantry takes less."""
LIFT_S: Final = 5.0
"""How long a controller that has failed may take to answer that it lifts the tip."""
WAKE_S: Final = 1.0
WAKE_ATTEMPTS: Final = 6
"""Many controllers restart when their port is opened, and hear nothing for two or three seconds."""
QUIET_S: Final = 0.2
SLOW_MM_MIN: Final = 120.0


@dataclass(frozen=True)
class Gantry:
    """Where a board lies under a gantry, millimetres: taxel (TX 0, RX 0) at x, y; the tip touches at touch_z; clear is
    how far above it moves go. TX lines follow one another along +x, RX lines along +y. spring_n_mm: the tip's
    stiffness; travel: how far it gives; tip: diameter of the one in the holder, 0 if nobody knows.
    """

    x: float
    y: float
    touch_z: float
    spring_n_mm: float
    clear: float = 5.0
    travel: float = 10.0
    tip: float = 0.0
    baud: float = 115200.0


class _SilentError(ProbeError):
    """The gantry says nothing."""


class GcodeProbe:
    """A gantry at a serial port; where: the port's name; operator: who changes its tip; tips have one length.

    Raises `ProbeError` if it does not answer, or answers with an error. Then it has been told to lift the tip, and does
    nothing any more.
    """

    name = "gantry"
    is_automatic = True
    knows_force = True

    def __init__(
        self, port: Any, where: str, kind: BoardKind, pitch_m: float, gantry: Gantry, operator: Operator
    ) -> None:
        self._port = port
        self._where = where
        self._kind = kind
        self._pitch_mm = pitch_m * 1e3
        self._gantry = gantry
        self._operator = operator
        self._tip_mm = gantry.tip
        self._place = -1
        self._is_down = False
        self._owed = 0  # lines without an answer: a stopped test leaves one behind
        self._failure = ""
        self._wake()
        self._say("G90")
        self._clear()

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """As `Probe`. The operator is asked for another tip if need be."""
        gantry = self._gantry
        if not 0.0 <= force_n <= FORCE_MAX_N:
            raise ProbeError(f"{self._where}: expected a force from 0 to {FORCE_MAX_N:g} N, found {force_n:g}")
        depth = force_n / gantry.spring_n_mm
        if depth > gantry.travel:
            problem = f"{force_n:g} N press the tip in by {depth:.1f} mm, and it gives {gantry.travel:g} mm"
            raise ProbeError(f"{self._where}: {problem}; take a stiffer spring, or less force in the plan")
        self._take_tip(round(diameter_m * 1e3, 3))
        if taxel != self._place:
            self._clear()
            x = gantry.x + self._pitch_mm * float(self._kind.tx[taxel])
            y = gantry.y + self._pitch_mm * float(self._kind.rx[taxel])
            self._say(f"G0 X{x:.3f} Y{y:.3f}")
            self._place = taxel
        self._is_down = True
        self._say(f"G1 Z{gantry.touch_z - depth:.3f} F{SLOW_MM_MIN:g}")
        self._say("G4 P0")

    def release(self) -> None:
        """As `Probe`."""
        self._place = -1
        if self._is_down and not self._failure:
            self._clear()

    def close(self) -> None:
        """As `Probe`."""
        if self._port.is_open:
            with suppress(ProbeError):
                self.release()
            self._port.close()

    def _take_tip(self, diameter_mm: float) -> None:
        if diameter_mm != self._tip_mm:
            self._clear()
            self._operator.prompt(f"put the {diameter_mm:g} mm tip into the gantry's holder")
            self._tip_mm = diameter_mm

    def _clear(self) -> None:
        self._say(f"G0 Z{self._gantry.touch_z + self._gantry.clear:.3f}")
        self._say("G4 P0")
        self._is_down = False

    def _wake(self) -> None:
        """Say G21 until it is heard, and take in the answers to all of them."""
        self._port.timeout = WAKE_S
        for _ in range(WAKE_ATTEMPTS):
            try:
                self._say("G21")
                break
            except _SilentError:
                self._failure, self._owed = "", 0
        else:
            seconds = WAKE_S * WAKE_ATTEMPTS
            raise ProbeError(f"{self._where}: no answer to 'G21' in {seconds:g} s; is this the gantry's port?")
        self._port.timeout = QUIET_S
        while self._port.readline():
            pass
        self._port.timeout = ANSWER_S

    def _say(self, line: str) -> None:
        if self._failure:
            raise ProbeError(self._failure)
        try:
            self._port.write(f"{line}\n".encode("ascii"))
            self._owed += 1
            while self._owed:
                self._hear(line)
        except (OSError, serial.SerialException) as error:
            self._fail(f"{error}; check its cable")

    def _hear(self, line: str) -> None:
        """One line of what the gantry says. A line that is neither an answer nor an alarm is a remark."""
        answer = self._port.readline().decode("ascii", errors="replace").strip()
        if answer.split(" ")[0] == "ok":
            self._owed -= 1
        elif not answer:
            self._fail(f"no answer to '{line}' in {self._port.timeout:g} s; look at its cable and supply", _SilentError)
        elif answer.lower().startswith(("error", "alarm")):
            self._owed -= 1
            self._fail(f"answered '{answer}' to '{line}'; home it, and clear its way")

    def _fail(self, problem: str, error: type[ProbeError] = ProbeError) -> NoReturn:
        """Lift the tip, as far as that can be done, and never move again."""
        self._failure = f"{self._where}: {problem}"
        if self._is_down:
            with suppress(OSError, serial.SerialException):
                self._port.timeout = LIFT_S
                self._port.write(f"G0 Z{self._gantry.touch_z + self._gantry.clear:.3f}\n".encode("ascii"))
                self._port.readline()
        raise error(self._failure)


def open_gcode(url: str, kind: BoardKind, pitch_m: float, operator: Operator) -> GcodeProbe:
    """`gcode:///dev/ttyUSB1?x=..&y=..&touch_z=..&spring_n_mm=..`, and the other fields of `Gantry`.

    Raises `ProbeError`.
    """
    parts = split_url(url)
    gantry = _gantry_of(url, {name: values[-1] for name, values in parse_qs(parts.query, True).items()})
    try:
        port = serial.Serial(parts.path, int(gantry.baud), timeout=WAKE_S)
    except (OSError, ValueError) as error:
        raise ProbeError(f"{url}: {error}; check the port's name") from None
    try:
        return GcodeProbe(port, parts.path, kind, pitch_m, gantry, operator)
    except BaseException:
        port.close()
        raise


def _gantry_of(url: str, given: dict[str, str]) -> Gantry:
    known = {field.name: field.default is MISSING for field in fields(Gantry)}
    unknown = sorted(set(given) - set(known))
    if unknown:
        raise ProbeError(f"{url}: unknown option '{unknown[0]}'; known are {', '.join(known)}")
    missing = [name for name, is_needed in known.items() if is_needed and name not in given]
    if missing:
        raise ProbeError(f"{url}: option '{missing[0]}' is missing; say where the board lies under the gantry")
    gantry = Gantry(**{name: _number(url, name, text) for name, text in given.items()})
    for name in ("spring_n_mm", "clear", "travel", "baud"):
        value = getattr(gantry, name)
        if value <= 0.0:
            raise ProbeError(f"{url}: option '{name}' must be above 0, found {value:g}")
    return gantry


def _number(url: str, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ProbeError(f"{url}: option '{name}' must be a number, found '{text}'")
    return value
