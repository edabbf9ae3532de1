"""Frames of a rig over a time, and whether they are the right ones."""

import numpy as np

from hil_tests.harness.rig import Rig
from taxel.hand import Hand
from taxel.skin import Skin
from taxel.stream import TaxelFrame

STEP_COUNTS = 100
LARGEST_BASE = 1000
POLL_S = 0.01
OUTCOMES = ("forwarded", "repeated", "nacks", "timeouts", "crc_errors", "bus_errors", "dropped")


def watch(rig: Rig, skin: Skin, seconds: float) -> list[TaxelFrame]:
    """The frames of the next `seconds` on the rig's clock."""
    frames: list[TaxelFrame] = []
    end = rig.clock.now_s() + seconds
    while (left := end - rig.clock.now_s()) > 0.0:
        frames += skin.poll(min(max(left, 1e-6), POLL_S))
    return frames


class KnownCounts:
    """Counts of which every value tells its taxel and when it was shown: a wrong one is seen at once.

    Taxel t shows base[t] + 100 step, base[t] below 100 in an order of its own for each taxel and board.
    """

    def __init__(self, rig: Rig, seed: int = 1) -> None:
        assert rig.counts is not None
        self._show, self._hand = rig.counts.show, rig.hand
        self._base = np.random.default_rng(seed).integers(1, STEP_COUNTS, rig.hand.n_taxels) + LARGEST_BASE
        self.step = -1
        self.go_on()

    def go_on(self) -> None:
        """The next step's counts, from now on."""
        self.step += 1
        self._show(self._base + STEP_COUNTS * self.step)

    def check(self, frame: TaxelFrame) -> None:
        """Fail unless every count was shown, by this taxel, in one scan."""
        base = self._base[self._hand.get_slice(frame.address)]
        difference = frame.raw_counts.astype(int) - base
        wrong = np.flatnonzero(difference % STEP_COUNTS)
        assert not len(wrong), f"board 0x{frame.address:02X}, taxels {wrong.tolist()}: counts that were never shown"
        steps = difference // STEP_COUNTS
        assert 0 <= steps.min() <= steps.max() <= self.step, f"board 0x{frame.address:02X}: counts of another time"
        assert not (np.diff(steps) < 0).any(), f"board 0x{frame.address:02X}: a scan that goes back in time"
        assert steps[-1] - steps[0] <= 1, f"board 0x{frame.address:02X}: half a scan"


def check_order(frames: list[TaxelFrame]) -> None:
    """Sequence, cycle and clock of each board go forward (modulo their range), unless the board has restarted."""
    last: dict[int, TaxelFrame] = {}
    for frame in frames:
        before = last.get(frame.address)
        if before is not None:
            assert 0 < (frame.cycle - before.cycle) % 65536 < 32768, f"board 0x{frame.address:02X}: cycles go back"
        last[frame.address] = frame


def check_polls(skin: Skin) -> None:
    """Every poll has had exactly one outcome, but one that may be under way."""
    skin.hub.read_status()
    for address, fields in skin.hub.board_status.items():
        in_flight = fields["polls"] - sum(fields[name] for name in OUTCOMES)
        assert in_flight in {0, 1}, f"board 0x{address:02X}: {fields}"


def counters_of(skin: Skin, address: int) -> dict[str, int]:
    """A board's counters as the hub has them now."""
    skin.hub.read_status()
    return dict(skin.hub.board_status[address])


def cycles_until(frames: list[TaxelFrame], address: int, hub_time_us: float) -> int:
    """Poll cycles from a time on the hub's clock until that board's first frame after it."""
    others = [frame.cycle for frame in frames if frame.address != address and frame.hub_time_us <= hub_time_us]
    back = [frame.cycle for frame in frames if frame.address == address and frame.hub_time_us >= hub_time_us]
    assert others, "no other board was heard before"
    assert back, f"board 0x{address:02X} has not come back"
    return (back[0] - others[-1]) % 65536


def board_at(hand: Hand, place: int) -> int:
    """The address of the hand's board number `place`."""
    return hand.boards[place].address
