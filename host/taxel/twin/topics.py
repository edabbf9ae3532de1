"""Results of a twin as ROS messages: the newest frame, the events, and diagnostics."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

from taxel.ros.diagnostics import ERROR, OK, WARN, make_status
from taxel.ros.tf_tree import make_header
from taxel.ros.topics import NS_PER_S, TopicMessage
from taxel.twin.cleared import ClearedTest
from taxel.twin.events import Alarm, CauseEvent
from taxel.twin.prediction import TwinFrame
from taxel.twin.self_repair import SelfRepair
from taxel.twin.session import Update
from taxel.types import FloatArray

FRAME_TOPIC: Final = "/taxel/twin/frame"
EVENTS_TOPIC: Final = "/taxel/twin/events"
REPAIR_TOPIC: Final = "/taxel/twin/repaired"
DIAGNOSTICS_TOPIC: Final = "/diagnostics"

DIAGNOSTICS_S: Final = 1.0
"""Interval between two diagnostics messages without events, seconds."""


class TwinTopics:
    """Makes the ROS messages of a twin. epoch_offset_ns: Unix time minus stream time, nanoseconds."""

    def __init__(self, boards: Mapping[int, str], epoch_offset_ns: int = 0) -> None:
        """Create the topics of a skin.

        boards: name of each board by its I2C address. epoch_offset_ns: Unix time minus stream time, nanoseconds.
        """
        self._boards = dict(boards)
        self._offset_ns = epoch_offset_ns
        self._cause: CauseEvent | None = None
        self._diagnostics_s = float("-inf")
        self._skipped = 0

    def make(self, update: Update, active: Iterable[ClearedTest]) -> Iterator[TopicMessage]:
        """Yield the messages of an update: its events, its frame, the corrected frame, and diagnostics.

        active: tests of the alarms that are not cleared. Diagnostics follow every event, otherwise at most once per
        `DIAGNOSTICS_S`.
        """
        time_s = self._diagnostics_s
        self._skipped += update.skipped
        for event in update.events:
            time_s = event.time_s
            if isinstance(event, CauseEvent):
                self._cause = event
            text = json.dumps(event.to_json(), allow_nan=False)
            yield TopicMessage(EVENTS_TOPIC, "std_msgs/String", self._to_unix_ns(time_s), {"data": text})
        if update.frame is not None:
            time_s = update.frame.time_s
            yield self._make_frame(update.frame)
            if update.repair is not None:
                yield self._make_repair(update.frame, update.repair)
        if update.events or time_s >= self._diagnostics_s + DIAGNOSTICS_S:
            self._diagnostics_s = time_s
            yield self._make_diagnostics(time_s, [test.alarm for test in active])

    def _to_unix_ns(self, time_s: float) -> int:
        return round(time_s * NS_PER_S) + self._offset_ns

    def _make_frame(self, frame: TwinFrame) -> TopicMessage:
        """Make a taxel_msgs/TwinFrame message from the newest frame."""
        time_ns = self._to_unix_ns(frame.time_s)
        message = {
            "header": make_header(time_ns, ""),
            "condition": frame.condition,
            "measured": _to_list(frame.measured),
            "predicted": _to_list(frame.predicted),
            "residual": _to_list(frame.residual),
            "rms": frame.rms,
        }
        return TopicMessage(FRAME_TOPIC, "taxel_msgs/TwinFrame", time_ns, message)

    def _make_repair(self, frame: TwinFrame, planned: SelfRepair) -> TopicMessage:
        """Make a taxel_msgs/TwinRepair message: the newest frame after the planned corrections."""
        time_ns = self._to_unix_ns(frame.time_s)
        repaired = planned.repair.apply(frame.measured)
        message = {
            "header": make_header(time_ns, ""),
            "raw_counts": frame.raw_counts.tolist(),
            "signal": _to_list(repaired.signal),
            "flags": repaired.flags.tolist(),
            "delay_s": _to_list(planned.repair.delay_s),
            "corrections": list(planned.corrections),
        }
        return TopicMessage(REPAIR_TOPIC, "taxel_msgs/TwinRepair", time_ns, message)

    def _make_diagnostics(self, time_s: float, alarms: list[Alarm]) -> TopicMessage:
        """Make the diagnostics: one status of the twin (a warning if any alarm is active), and one of each board.

        The status of a board is an error if an alarm is active at a place of this board. The first status contains the
        probabilities of the causes while an alarm is active and a cause has been named.
        """
        time_ns = self._to_unix_ns(time_s)
        cause = self._cause if alarms else None
        text = cause.action if cause is not None else f"{len(alarms)} alarms" if alarms else "no change"
        values: dict[str, float] = {"alarms": len(alarms), "skipped frames": self._skipped}
        if cause is not None:
            values |= {name: round(value, 4) for name, value in cause.probabilities.items()}
        statuses: list[dict[str, Any]] = [make_status(WARN if alarms else OK, "taxel twin", text, "skin", values)]
        for address, name in self._boards.items():
            on_board = [alarm for alarm in alarms if alarm.place.address == address]
            state = "; ".join(f"{alarm.words} of {alarm.place} has changed" for alarm in on_board) or "no change"
            sizes = {f"alarm {alarm.number}": round(alarm.amplitude, 4) for alarm in on_board}
            level = ERROR if on_board else OK
            statuses.append(make_status(level, f"taxel twin: {name}", state, f"0x{address:02X}", sizes))
        message = {"header": make_header(time_ns, ""), "status": statuses}
        return TopicMessage(DIAGNOSTICS_TOPIC, "diagnostic_msgs/DiagnosticArray", time_ns, message)


def _to_list(values: FloatArray) -> list[float]:
    return [float(value) for value in values]
