"""Probe on a G-code gantry with a spring-loaded tip: force = travel beyond the touch point * spring stiffness.

Absolute millimetres (G21, G90), rapid moves (G0) at the clear height, slow moves (G1) towards the board, and G4 P0,
which a controller answers only at standstill. The controller answers every line with "ok" (grbl, Marlin). Not verified
on hardware.
"""

import math
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields
from typing import Any, Final, NoReturn
from urllib.parse import parse_qs

import numpy as np
import serial

from taxel.hand import BoardKind
from taxel.hand.flat_board import compute_flat_positions
from taxel.link.url import split_url
from taxel_tools.bench.probe.base import ProbeError, ProbeRequest
from taxel_tools.testing.operator import Operator

FORCE_MAX_N: Final = 60.0
"""Limit of the force, above the range of the curve in Figure 2.5 of the thesis; a larger value in a plan is an error.
"""
ANSWER_TIMEOUT_S: Final = 30.0
"""Longest wait for an answer; a move across the whole gantry takes less."""
LIFT_TIMEOUT_S: Final = 5.0
"""Longest wait for the answer to a lift of the tip after a failure."""
CONNECT_TIMEOUT_S: Final = 1.0
CONNECT_ATTEMPTS: Final = 6
"""Many controllers restart when their port is opened and do not respond for two or three seconds."""
DRAIN_TIMEOUT_S: Final = 0.2
FEED_MM_PER_MIN: Final = 120.0


@dataclass(frozen=True)
class Gantry:
    """Position of a board under a gantry, in millimetres, and properties of the tip.

    `x`, `y`: position of the taxel (TX 0, RX 0); TX lines follow along +x, RX lines along +y. For a board with a
    described layout: position of its first taxel; its rows follow along +x, its columns along +y. `touch_z`: height at
    which the tip touches the board; `clear`: height of moves above `touch_z`. `spring_n_mm`: stiffness of the spring in
    N/mm; `travel`: travel of the spring; `tip`: diameter of the mounted tip, 0 if unknown.
    """

    x: float
    y: float
    touch_z: float
    spring_n_mm: float
    clear: float = 5.0
    travel: float = 10.0
    tip: float = 0.0
    baud: float = 115200.0


class _NoAnswerError(ProbeError):
    """The gantry does not answer."""


class GcodeProbe:
    """A gantry on a serial port. The operator changes its tips; all tips have the same length.

    Raises `ProbeError` for a board that is bent, and if the gantry does not answer or answers with an error. The probe
    then requests a lift of the tip and moves no more.
    """

    name = "gantry"
    is_automatic = True
    has_known_force = True

    def __init__(
        self, port: Any, port_name: str, kind: BoardKind, pitch_m: float, gantry: Gantry, operator: Operator
    ) -> None:
        """Connect to a gantry with G-code firmware that indents the taxels of a board, and lift its tip.

        port: open serial port; port_name: its name in messages. pitch_m: distance between taxels. gantry: positions
        and limits from the URL of the probe. operator: the person who changes the tips.
        """
        self._port = port
        self._port_name = port_name
        positions_m = compute_flat_positions(kind, pitch_m)
        if positions_m is None:
            problem = (
                f"expected a flat board, found the bent board kind {kind.name!r}, whose taxels have no common height"
            )
            raise ProbeError(f"{port_name}: {problem}; use --probe operator")
        self._positions_mm = 1e3 * positions_m
        self._gantry = gantry
        self._operator = operator
        self._tip_mm = gantry.tip
        self._taxel = -1
        self._is_down = False
        self._unanswered_lines = 0  # A stopped test leaves one line without an answer.
        self._failure = ""
        self._connect()
        self._send("G90")  # absolute positions
        self._move_clear()

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """Move the gantry to the taxel and apply the force. The operator changes the tip if necessary.

        The force follows from the compression of the spring in the tip: force / stiffness is the depth below the height
        at which the tip touches the board.
        """
        gantry = self._gantry
        if not 0.0 <= force_n <= FORCE_MAX_N:
            raise ProbeError(f"{self._port_name}: expected a force from 0 to {FORCE_MAX_N:g} N, found {force_n:g}")
        depth = force_n / gantry.spring_n_mm
        if depth > gantry.travel:
            problem = f"{force_n:g} N compress the spring by {depth:.1f} mm, its travel is {gantry.travel:g} mm"
            raise ProbeError(f"{self._port_name}: {problem}; use a stiffer spring, or reduce the force in the plan")
        self._change_tip(round(diameter_m * 1e3, 3))
        if taxel != self._taxel:
            self._move_clear()
            x, y = np.array([gantry.x, gantry.y]) + self._positions_mm[taxel]
            self._send(f"G0 X{x:.3f} Y{y:.3f}")
            self._taxel = taxel
        self._is_down = True
        self._send(f"G1 Z{gantry.touch_z - depth:.3f} F{FEED_MM_PER_MIN:g}")
        self._send("G4 P0")

    def release(self) -> None:
        """Lift the tip of the gantry from the board."""
        self._taxel = -1
        if self._is_down and not self._failure:
            self._move_clear()

    def close(self) -> None:
        """Lift the tip of the gantry and close its serial port."""
        if self._port.is_open:
            with suppress(ProbeError):
                self.release()
            self._port.close()

    def _change_tip(self, diameter_mm: float) -> None:
        """Instruct the operator to insert the tip with a diameter in mm, unless this tip is in place."""
        if diameter_mm != self._tip_mm:
            self._move_clear()
            self._operator.prompt(f"insert the {diameter_mm:g} mm tip into the holder of the gantry")
            self._tip_mm = diameter_mm

    def _move_clear(self) -> None:
        """Lift the tip above the board and wait (G4) until the movement has ended."""
        self._send(f"G0 Z{self._gantry.touch_z + self._gantry.clear:.3f}")
        self._send("G4 P0")
        self._is_down = False

    def _connect(self) -> None:
        """Repeat the G-code G21 (millimetres) until the controller of the gantry answers, then read all remaining
        answers.
        """
        self._port.timeout = CONNECT_TIMEOUT_S
        for _ in range(CONNECT_ATTEMPTS):
            try:
                self._send("G21")
                break
            except _NoAnswerError:
                self._failure, self._unanswered_lines = "", 0
        else:
            seconds = CONNECT_TIMEOUT_S * CONNECT_ATTEMPTS
            raise ProbeError(f"{self._port_name}: no answer to 'G21' in {seconds:g} s; is this the port of the gantry?")
        self._port.timeout = DRAIN_TIMEOUT_S
        while self._port.readline():
            pass
        self._port.timeout = ANSWER_TIMEOUT_S

    def _send(self, line: str) -> None:
        """Send a line of G-code and wait until the gantry has answered it. Raises `ProbeError` if the connection
        has failed.
        """
        if self._failure:
            raise ProbeError(self._failure)
        try:
            self._port.write(f"{line}\n".encode("ascii"))
            self._unanswered_lines += 1
            while self._unanswered_lines:
                self._read_answer(line)
        except (OSError, serial.SerialException) as error:
            self._fail(f"{error}; check the cable")

    def _read_answer(self, line: str) -> None:
        """Read one line from the gantry and count an answer to a sent line.

        A line that is neither an answer nor an alarm is ignored. line: last line that was sent, for error messages.
        Raises `ProbeError` for an error, an alarm, or no line in time.
        """
        answer = self._port.readline().decode("ascii", errors="replace").strip()
        if answer.split(" ")[0] == "ok":
            self._unanswered_lines -= 1
        elif not answer:
            self._fail(f"no answer to '{line}' in {self._port.timeout:g} s; check cable and supply", _NoAnswerError)
        elif answer.lower().startswith(("error", "alarm")):
            self._unanswered_lines -= 1
            self._fail(f"answered '{answer}' to '{line}'; home the gantry and clear its path")

    def _fail(self, problem: str, error: type[ProbeError] = ProbeError) -> NoReturn:
        """Request a lift of the tip of the gantry if possible, refuse all further moves, and raise `ProbeError`."""
        self._failure = f"{self._port_name}: {problem}"
        if self._is_down:
            with suppress(OSError, serial.SerialException):
                self._port.timeout = LIFT_TIMEOUT_S
                self._port.write(f"G0 Z{self._gantry.touch_z + self._gantry.clear:.3f}\n".encode("ascii"))
                self._port.readline()
        raise error(self._failure)


def open_gcode_probe(request: ProbeRequest) -> GcodeProbe:
    """Open `gcode:///dev/ttyUSB1?x=..&y=..&touch_z=..&spring_n_mm=..`, with further fields of `Gantry`.

    Raises `ProbeError`.
    """
    url = request.url
    parts = split_url(url)
    gantry = _parse_gantry(url, {name: values[-1] for name, values in parse_qs(parts.query, True).items()})
    try:
        port = serial.Serial(parts.path, int(gantry.baud), timeout=CONNECT_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise ProbeError(f"{url}: {error}; check the port's name") from None
    try:
        return GcodeProbe(port, parts.path, request.kind, request.pitch_m, gantry, request.operator)
    except BaseException:
        port.close()
        raise


def _parse_gantry(url: str, options: dict[str, str]) -> Gantry:
    """Parse position and properties of the gantry from the options of its URL.

    Raises `ProbeError` with the URL and the option for an unknown, missing or invalid option.
    """
    is_required = {field.name: field.default is MISSING for field in fields(Gantry)}
    unknown = sorted(set(options) - set(is_required))
    if unknown:
        raise ProbeError(f"{url}: unknown option '{unknown[0]}', expected one of {', '.join(is_required)}")
    missing = [name for name, required in is_required.items() if required and name not in options]
    if missing:
        raise ProbeError(f"{url}: option '{missing[0]}' is missing; add it to the URL")
    gantry = Gantry(**{name: _parse_number(url, name, text) for name, text in options.items()})
    for name in ("spring_n_mm", "clear", "travel", "baud"):
        value = getattr(gantry, name)
        if value <= 0.0:
            raise ProbeError(f"{url}: option '{name}' must be above 0, found {value:g}")
    return gantry


def _parse_number(url: str, name: str, text: str) -> float:
    """Parse the finite number in option `name` of a probe's URL. Raises `ProbeError` for any other text."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ProbeError(f"{url}: option '{name}' must be a number, found '{text}'")
    return value
