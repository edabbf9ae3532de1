"""Blocks of poll cycles from a live skin: all cycles arrive once and in order, however far the reader is behind."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import pairwise

import numpy as np
import pytest

from host.tests.twin.synthetic_skin import ADDRESSES, SyntheticSkin, learn
from taxel.hand import load_hand
from taxel.skin.frame import SkinFrame
from taxel.twin import ContactSchedule, Twin
from taxel.twin.session import TwinSession
from taxel.twin.sources import LIVE_BLOCK, Block, SkinSource


class BacklogLink:
    """A link of a live skin."""

    is_real_time = True


class BacklogHub:
    """A hub that has identified one board."""

    def __init__(self) -> None:
        self.boards = {0x50: {"identity_unique_id": bytes(8)}}


class BacklogSkin:
    """A live skin that delivers a given number of poll cycles with each `poll`, and then ends with EOFError."""

    def __init__(self, arrivals: list[int]) -> None:
        self.hand, self.link, self.hub = load_hand("rig4"), BacklogLink(), BacklogHub()
        self._arrivals, self._cycle = list(arrivals), 0

    def poll(self, timeout_s: float) -> list[SkinFrame]:
        """Return the next poll cycles, here as complete frames of the skin."""
        if not self._arrivals:
            raise EOFError
        return [self._make_frame() for _ in range(self._arrivals.pop(0))]

    def collect_scans(self, frames: list[SkinFrame]) -> Iterator[SkinFrame]:
        """Yield the frames, which are complete already."""
        yield from frames

    def _make_frame(self) -> SkinFrame:
        self._cycle += 1
        n = self.hand.n_taxels
        return SkinFrame(self._cycle, 0.05 * self._cycle, np.full(n, self._cycle, np.uint16), np.ones(n, bool))


def read_blocks(arrivals: list[int]) -> list[np.ndarray]:
    """Return the times of the blocks that a twin receives from a skin with these arrivals."""
    times = []
    blocks = SkinSource(BacklogSkin(arrivals)).blocks()
    with suppress(EOFError):
        while True:
            times.append(next(blocks).time_s)
    return times


@pytest.mark.parametrize(
    "arrivals", [[1, 0, 1, 0, 1, 0], [5, 0, 1, 0], [30, 30, 30, 30, 30, 0], [500, 0], [0, 0, 2, 0]]
)
def test_every_poll_cycle_arrives_once_in_order(arrivals):
    times = np.concatenate(read_blocks(arrivals))
    assert np.allclose(times, 0.05 * np.arange(1, sum(arrivals) + 1))


def test_a_reader_in_time_receives_single_cycles_and_a_late_reader_longer_blocks():
    assert [len(block) for block in read_blocks([1, 0, 1, 0, 1, 0])] == [1, 1, 1]
    assert [len(block) for block in read_blocks([1, 0, 9, 4, 0, 1, 0])] == [1, 13, 1]
    assert max(len(block) for block in read_blocks([500, 0])) == LIVE_BLOCK


def test_a_block_has_the_counts_and_boards_of_its_cycles():
    source = SkinSource(BacklogSkin([3, 0]))  # three cycles arrive at once; the counts of cycle k are k
    block = next(iter(source.blocks()))
    assert block.raw_counts[:, 0].tolist() == [1, 2, 3]
    assert block.valid.shape == (3, len(source.skin.hand.boards))
    assert all(later > earlier for earlier, later in pairwise(block.time_s))


class LiveSource:
    """A live source without blocks of its own. unique_ids: of the processors of both boards, by I2C address."""

    is_live, is_continuous, session_starts_s = True, False, ()

    def __init__(self) -> None:
        self.unique_ids = {address: bytes([address] * 8) for address in ADDRESSES}

    def get_unique_ids(self) -> dict[int, bytes]:
        return dict(self.unique_ids)


@pytest.fixture
def make_live_session():
    """Function that makes a session of a live skin and blocks of given lengths."""

    def make(lengths: list[int]) -> tuple[TwinSession, list[Block]]:
        """Return the session, and blocks that follow each other."""
        skin = SyntheticSkin(seed=5)
        reference = learn(skin)
        _, cycles = skin.run_routine(1)
        ends = np.cumsum(lengths)
        blocks = [
            Block(*(column[end - length : end] for column in cycles)) for end, length in zip(ends, lengths, strict=True)
        ]
        return TwinSession(Twin(reference, ContactSchedule()), LiveSource(), None), blocks

    return make


def test_frames_of_a_live_skin_that_are_in_no_view_are_counted(make_live_session):
    """Each update shows one cycle of its block, so that three of the four cycles of the second block are skipped."""
    session, blocks = make_live_session([1, 4, 1])
    updates = [session.take(block) for block in blocks]
    assert [update.skipped for update in updates] == [0, 3, 0]
    assert [update.frame is not None for update in updates] == [True] * 3
    assert session.skipped == 3


def test_a_batch_of_a_recording_ends_before_the_first_cycle_of_an_exchanged_board():
    skin = BacklogSkin([])

    def iterate_scans() -> Iterator[SkinFrame]:
        """Yield 20 cycles; the hub identifies another board before cycle 8."""
        for cycle in range(1, 21):
            if cycle == 8:
                skin.hub.boards = {0x50: {"identity_unique_id": bytes([1] * 8)}}
            yield skin._make_frame()

    skin.scans, skin.link.is_real_time = iterate_scans, False
    assert [len(block.time_s) for block in SkinSource(skin).blocks()] == [7, 13]  # cycles 1 to 7, and 8 to 20


def test_an_exchanged_board_is_reported_once_and_raises_no_alarm():
    """The new board has other gains, another noise and another rest level than the board of the reference."""
    skin, seen = SyntheticSkin(seed=5), []
    reference = learn(skin)
    contacts, before = skin.run_routine(12)
    on_board = reference.places.board == 1
    skin.gain[on_board] *= np.random.default_rng(3).uniform(0.6, 1.5, int(on_board.sum()))
    more, after = skin.run_routine(12)
    source = LiveSource()
    session = TwinSession(Twin(reference, ContactSchedule([*contacts, *more])), source, None)
    for cycles in (before, after):
        if cycles is after:
            source.unique_ids[ADDRESSES[1]] = bytes([9] * 8)
        for start in range(0, len(cycles[0]), 50):
            seen += session.take(Block(*(column[start : start + 50] for column in cycles))).events
    assert [(event.kind, f"0x{ADDRESSES[1]:02X}" in event.message) for event in seen] == [("board", True)]
    assert "0909090909090909" in seen[0].message


def test_the_contacts_of_a_later_session_are_compared_although_all_counts_have_changed():
    """A session of a dataset begins with other counts without contact, as after the skin has been mounted anew."""
    skin = SyntheticSkin(seed=12)
    reference = learn(skin)
    first, before = skin.run_routine(9)
    skin.offset[:] = 700.0
    second, after = skin.run_routine(9)
    skin.gain[:16] = 0.7
    third, changed = skin.run_routine(12)

    class TwoSessions:
        """Source of the two sessions; the skin changes during the second session."""

        is_live, is_continuous, session_starts_s = False, False, (float(after[0][0]),)

        def get_unique_ids(self) -> dict[int, bytes]:
            """Return nothing."""
            return {}

        def blocks(self) -> Iterator[Block]:
            """Yield a block of each part."""
            yield from (Block(*before), Block(*after), Block(*changed))

    twin = Twin(reference, ContactSchedule([*first, *second, *third]))
    results = [result for update in TwinSession(twin, TwoSessions(), None).updates() for result in update.results]
    compared = [result for result in results if result.step.contact is not None and "gain" in result.estimates]
    assert not any(result.touched.any() for result in compared)
    alarms = [event for result in results for event in result.events]
    assert alarms[0].time_s > third[0].start_s
    assert "left" in str(alarms[0])
