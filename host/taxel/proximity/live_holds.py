"""Holds of a live skin: the frames that arrive while a target rests at a distance."""

import time
from collections.abc import Callable, Sequence

from taxel.proximity.hold_signals import HoldCounts, make_hold_counts
from taxel.proximity.holds import REST, Hold
from taxel.stream import TaxelFrame


def take_hold(
    poll: Callable[[float], Sequence[TaxelFrame]],
    board: tuple[int, str],
    target: tuple[str, float | None],
    seconds: float,
) -> HoldCounts:
    """Collect the frames of one board that are scanned from now on, for `seconds` of the stream's clock.

    poll: `Skin.poll`. board: address and name. target: name and distance in metres; the distance None stands for no
    target. Waiting frames, which were scanned before the call, are discarded. Raises `ProximityError` for too few
    frames, and the errors of `poll`.
    """
    address, name = board
    while any(poll(0.0)):  # frames that waited while the operator moved the target
        pass
    kept: list[TaxelFrame] = []
    deadline = time.monotonic() + 3.0 * seconds + 5.0  # a board that does not respond ends the wait
    while time.monotonic() < deadline:
        kept += [frame for frame in poll(0.1) if frame.address == address]
        if kept and kept[-1].time_s - kept[0].time_s >= seconds:
            break
    begin, end = (kept[0].time_s, kept[-1].time_s) if kept else (0.0, seconds)
    hold = Hold(begin, end, name, REST if target[1] is None else target[0], target[1])
    return make_hold_counts(hold, kept)
