"""Taxel frames of a rig over a period, and checks of their counts, their order and the hub's counters."""

import numpy as np
from numpy.typing import NDArray

from hil_tests.harness.rig import Rig
from taxel.hand import Hand
from taxel.skin import Skin
from taxel.stream import TaxelFrame

STEP_COUNTS = 100
"""Difference between the known counts of a taxel in two steps."""
BASE_OFFSET = 1000
"""Constant part of the base counts (`sample_base_counts`), in counts."""
POLL_S = 0.01
OUTCOMES = ("forwarded", "repeated", "nacks", "timeouts", "crc_errors", "bus_errors", "dropped")
"""Counters of the hub, of which each poll of a board increases exactly one."""


def read_frames(rig: Rig, skin: Skin, seconds: float) -> list[TaxelFrame]:
    """Receive taxel frames for `seconds` on the rig's clock, and return them in the order of their arrival."""
    frames: list[TaxelFrame] = []
    end_s = rig.clock.now_s() + seconds
    while (remaining_s := end_s - rig.clock.now_s()) > 0.0:
        frames += skin.poll(min(max(remaining_s, 1e-6), POLL_S))
    return frames


def sample_base_counts(taxels: int, seed: int) -> NDArray[np.int64]:
    """Sample the known counts of step 0, i64[taxels].

    A base count is `BASE_OFFSET` plus a random number from 1 to `STEP_COUNTS` - 1. Each step adds `STEP_COUNTS`, so the
    remainder of a count modulo `STEP_COUNTS` almost always differs between two taxels in every step.
    """
    return np.random.default_rng(seed).integers(1, STEP_COUNTS, taxels) + BASE_OFFSET


class KnownCounts:
    """Raw counts from which a test can identify the taxel and the time of every measured value.

    Taxel t measures base[t] + 100 step. base[t] modulo 100 is a random number for each taxel, so a count of another
    taxel, or a damaged count, is detected.
    """

    def __init__(self, rig: Rig, seed: int = 1) -> None:
        """Set the first known raw counts on the boards of an emulated rig, those of step 0.

        The count of a taxel is its base (`sample_base_counts`) + `STEP_COUNTS` * `step`. seed: seed of the bases.
        """
        assert rig.counts is not None
        self._source, self._hand = rig.counts, rig.hand
        self._base = sample_base_counts(rig.hand.n_taxels, seed)
        self.step = -1
        self.advance()

    def advance(self) -> None:
        """Set the raw counts of the next step: every taxel measures 100 counts more than in the step before."""
        self.step += 1
        self._source.set_counts(self._base + STEP_COUNTS * self.step)

    def check_frame(self, frame: TaxelFrame) -> None:
        """Check that all counts of a taxel frame were set by the test, for these taxels, during one scan. Fails
        otherwise.

        The count of a taxel is its base + `STEP_COUNTS` * step; the step may increase by 1 during a scan.
        """
        board = f"board 0x{frame.address:02X}"
        base = self._base[self._hand.get_slice(frame.address)]
        difference = frame.raw_counts.astype(int) - base
        wrong = np.flatnonzero(difference % STEP_COUNTS)
        assert not len(wrong), f"{board}, taxels {wrong.tolist()}: counts that were never set"
        steps = difference // STEP_COUNTS
        assert 0 <= steps.min() <= steps.max() <= self.step, f"{board}: counts of another time"
        assert not (np.diff(steps) < 0).any(), f"{board}: later taxels of the scan have older counts"
        assert steps[-1] - steps[0] <= 1, f"{board}: counts of more than one scan"


def check_order(frames: list[TaxelFrame]) -> None:
    """Check that the poll cycle numbers of each board's frames increase, modulo 65536. Fails otherwise."""
    last: dict[int, TaxelFrame] = {}
    for frame in frames:
        before = last.get(frame.address)
        if before is not None:
            assert 0 < (frame.cycle - before.cycle) % 65536 < 32768, f"board 0x{frame.address:02X}: cycle decreases"
        last[frame.address] = frame


def check_polls(skin: Skin) -> None:
    """Check that each poll of a board has exactly one outcome, success or one kind of failure. Fails otherwise.

    One poll of each board may still be in progress.
    """
    skin.hub.read_status()
    for address, fields in skin.hub.board_status.items():
        in_progress = fields["polls"] - sum(fields[name] for name in OUTCOMES)
        assert in_progress in {0, 1}, f"board 0x{address:02X}: {fields}"


def read_counters(skin: Skin, address: int) -> dict[str, int]:
    """Request the hub's status and return its present counters of one board, by name."""
    skin.hub.read_status()
    return dict(skin.hub.board_status[address])


def count_cycles_until_frame(frames: list[TaxelFrame], address: int, hub_time_us: float) -> int:
    """Count the poll cycles from a time on the hub's clock to the first frame of this board at or after that time.

    The poll cycle at this time is taken from the last frame of another board that is not later than this time. Fails if
    one of the two frames is missing.
    """
    cycles_before = [frame.cycle for frame in frames if frame.address != address and frame.hub_time_us <= hub_time_us]
    cycles_after = [frame.cycle for frame in frames if frame.address == address and frame.hub_time_us >= hub_time_us]
    assert cycles_before, "no frame of another board before that time"
    assert cycles_after, f"no frame of board 0x{address:02X} after that time"
    return (cycles_after[0] - cycles_before[-1]) % 65536


def get_address(hand: Hand, index: int) -> int:
    """Return the I2C address of board number `index` of the hand."""
    return hand.boards[index].address
