"""A skin as its users see it: open it, iterate over its frames."""

import contextlib
import os
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any, Literal, NamedTuple, Self, cast, get_args

import numpy as np
from numpy.typing import NDArray

from taxel.emulated import open_emulator
from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand, packaged_hands
from taxel.hand.description import hand_of_text
from taxel.link import Link, LinkError, clock_of, open_link
from taxel.link.url import recorded_path
from taxel.signal import BASELINE_SAMPLES, Baseline, BaselineResult
from taxel.stream import HubClient, LossAccount, TaxelFrame
from taxel.stream.cycles import CycleSorter

FrameForm = Literal["plain", "compact"]

DEFAULT_HAND = "allegro"

DISCOVERY_TIMEOUT_S = 1.0
"""How long `open` waits for boards that the hub has not found yet: they may still be starting."""


class BoardMismatchError(TaxelError):
    """A board on the bus is not the one that the hand description has at its address."""


class SkinFrame(NamedTuple):
    """The whole skin in one poll cycle.

    `raw_counts` u16[n] in the hand's taxel order, 0 where `valid` is False; `valid` bool[n]: the board's frame arrived;
    `time_s`: when the first board's scan began, host clock; `cycle`: the hub's poll cycle.
    """

    cycle: int
    time_s: float
    raw_counts: NDArray[np.uint16]
    valid: NDArray[np.bool_]


class Skin:
    """An open skin: an iterator over `TaxelFrame`s, one board's snapshot each, in the order in which they arrived.

    Use it as a context manager. The iteration ends at the end of a recording; it raises a `TaxelError` of one line if
    the port vanishes or a frame comes from a board that the hand does not have, after everything before it was
    delivered. A hub that starts anew is greeted and started again.
    """

    def __init__(self, link: Link, hand: Hand, rate_hz: float | None = None, frames: FrameForm = "plain") -> None:
        self.hand = hand
        self.hub = HubClient(link)
        self._rate_hz = rate_hz
        self._compact = frames == "compact"
        self._stream = self.hub.stream
        self._slices = {board.address: hand.slice_of(board.address) for board in hand.boards}
        self._sorter = CycleSorter(len(hand.boards))
        self._sizes = {board.address: board.kind.taxel_count for board in hand.boards}
        try:
            if not link.is_recorded:
                self._begin()
        except BaseException:
            self._stream.close()
            raise

    def _begin(self) -> None:
        self.hub.greet()
        self._discover()
        for address, fields in sorted(self.hub.boards.items()):
            self._check_board(address, fields)
        self.hub.set_rate(self._rate_hz)
        self.hub.start(self._compact)

    def _resume(self) -> None:
        """The hub has started anew, by itself or because somebody asked it to: go on as before."""
        self.hub.greet()
        self.hub.set_rate(self._rate_hz)
        self.hub.start(self._compact)

    def _discover(self) -> None:
        now_s = clock_of(self._stream.link)
        deadline = now_s() + DISCOVERY_TIMEOUT_S
        while True:
            self.hub.read_boards()
            if len(self.hub.boards) >= len(self.hand.boards) or now_s() > deadline:
                return
            self.hub.wait(0.05)

    def _check_board(self, address: int, fields: dict[str, Any]) -> None:
        board = self.hand.board(address)  # raises UnknownBoardError
        found = (fields["identity_rows"], fields["identity_columns"], fields["identity_taxel_count"])
        wanted = (board.kind.tx_count, board.kind.rx_count, board.kind.taxel_count)
        if found != wanted or fields["identity_crossing_map"] != board.kind.crossing_bitmap():
            raise BoardMismatchError(
                f"board 0x{address:02X} has {found[2]} taxels on {found[0]} TX x {found[1]} RX, but hand "
                f"'{self.hand.name}' has {board.name} ({board.kind.name}: {wanted[2]} on {wanted[0]} x {wanted[1]}) "
                "there; exchange the board or use the hand description that fits"
            )

    @property
    def missing_boards(self) -> list[str]:
        """Boards of the hand that have not answered the hub (empty for a recording)."""
        if self._stream.link.is_recorded:
            return []
        return [board.name for board in self.hand.boards if board.address not in self.hub.boards]

    @property
    def link(self) -> Link:
        """The link that the bytes come from."""
        return self._stream.link

    @property
    def losses(self) -> LossAccount:
        """Frames received, missing and lost, so far."""
        return self._stream.losses

    @property
    def bytes_received(self) -> int:
        """Bytes that have arrived so far."""
        return self._stream.bytes_received

    @property
    def bytes_discarded(self) -> int:
        """Bytes that were part of no frame."""
        return self._stream.bytes_discarded

    @property
    def bytes_waiting(self) -> int:
        """Bytes that have arrived and that nobody has polled yet: growing if the reader is too slow."""
        return self._stream.bytes_waiting

    def is_synchronised(self, address: int) -> bool:
        """Whether that board's times come from its own clock (see `taxel.stream.ClockMap`)."""
        return self._stream.clock.is_synchronised(address)

    def __iter__(self) -> Iterator[TaxelFrame]:
        frames = self._stream.frames
        while True:
            while frames:
                yield self._checked(frames.popleft())
            try:
                self._take_in()
            except EOFError:
                return

    def poll(self, timeout_s: float = 0.1) -> list[TaxelFrame]:
        """What has arrived, waiting at most `timeout_s`; an empty list if nothing has: for loops that must not block.

        Raises EOFError at the end of a recording, else as the iteration does.
        """
        if not self._stream.frames:
            self._take_in(timeout_s)
        arrived = [self._checked(frame) for frame in self._stream.frames]
        self._stream.frames.clear()
        return arrived

    def _take_in(self, timeout_s: float = 0.1) -> None:
        if not (self.hub.is_greeted or self._stream.link.is_recorded):
            self._resume()
        self._stream.poll(timeout_s)

    def _checked(self, frame: TaxelFrame) -> TaxelFrame:
        if self._sizes.get(frame.address) != len(frame.raw_counts):
            self._refuse(frame)
        return frame

    def _refuse(self, frame: TaxelFrame) -> None:
        board = self.hand.board(frame.address)  # raises UnknownBoardError
        raise BoardMismatchError(
            f"a frame of board 0x{frame.address:02X} has {len(frame.raw_counts)} taxels, but hand '{self.hand.name}' "
            f"has {board.name} with {board.kind.taxel_count} there; use the hand description that fits"
        )

    def scans(self) -> Iterator[SkinFrame]:
        """The whole skin, cycle by cycle; a board whose frame is missing is not valid in that cycle."""
        for frame in self:
            self._sorter.add(frame)  # kept between calls: a cycle half read by one is finished by the next
            while (frames := self._sorter.pop()) is not None:
                yield self._assemble(frames)
        while (frames := self._sorter.pop(is_end=True)) is not None:
            yield self._assemble(frames)

    def _assemble(self, frames: list[TaxelFrame]) -> SkinFrame:
        counts = np.zeros(self.hand.n_taxels, dtype=np.uint16)
        valid = np.zeros(self.hand.n_taxels, dtype=bool)
        for frame in frames:
            where = self._slices[frame.address]
            counts[where] = frame.raw_counts
            valid[where] = True
        return SkinFrame(frames[0].cycle, min(frame.time_s for frame in frames), counts, valid)

    def take_baseline(
        self, samples: int = BASELINE_SAMPLES, progress: Callable[[float], None] | None = None
    ) -> BaselineResult:
        """Mean, noise and disturbed taxels over the next `samples` frames of every board that answers; nothing may
        touch the skin.

        Taxels of boards that do not answer have NaN. Consumes the frames. Raises EOFError's place as `TaxelError` if a
        recording ends before.
        """
        baseline = Baseline(self.hand.n_taxels, samples=samples)
        seen = 0
        for scan in self.scans():
            seen += 1
            baseline.update(scan.raw_counts, scan.valid)
            if progress is not None:
                progress(baseline.progress)
            if baseline.ready:
                return baseline.result()
            if seen >= 2 * samples and baseline.ready_mask.any():
                return BaselineResult(baseline.mean, baseline.noise, baseline.disturbed, baseline.count)
        raise TaxelError(
            f"{self._stream.link.name}: ended after {seen} scans, before a baseline of {samples} was complete"
        )

    def close(self) -> None:
        """Stop the stream and close the link."""
        link = self._stream.link
        if not link.is_recorded:
            with contextlib.suppress(TaxelError):  # the port may be gone already: then there is nothing to stop
                self.hub.send_stop()
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _split_frames(url: str, frames: FrameForm | None) -> tuple[str, FrameForm]:
    """The URL without its option `frames`, and what it says; an argument that is given goes before it."""
    head, mark, query = url.partition("?")
    if not mark or url.startswith("file:"):
        return url, frames or "plain"
    options = query.split("&")
    asked = [option.removeprefix("frames=") for option in options if option.startswith("frames=")]
    if asked and asked[-1] not in get_args(FrameForm):
        raise LinkError(url, f"option 'frames' must be {' or '.join(get_args(FrameForm))}, found '{asked[-1]}'")
    rest = "&".join(option for option in options if not option.startswith("frames="))
    return head + (f"?{rest}" if rest else ""), frames or (cast(FrameForm, asked[-1]) if asked else "plain")


def open_skin(
    url: str,
    hand: Hand | str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    frames: FrameForm | None = None,
) -> Skin:
    """Open the skin at `url` and start it.

    `url`: `serial:///dev/ttyUSB0`, `emulator:` (options after `?`, see docs), `file:capture.bin`, `file:skin.mcap`, or
    any pyserial URL. `hand`: a packaged description's name, a file, or a `Hand`; None: the one that a recording
    carries, else "allegro". `rate_hz`: at most so many scans a second; None: all that the bus gives. `frames`: "plain"
    (16-bit counts) or "compact" (the same counts in fewer bytes, from boards and a hub that have them; also
    `frames=compact` in the URL): what comes out is the same. Raises `TaxelError` with one line: port missing, no hub,
    another protocol version, a board that the hand does not have.
    """
    url, form = _split_frames(url, frames)
    link, description = open_source(url, hand)
    return Skin(link, description, rate_hz, form)


def open_source(url: str, hand: Hand | str | os.PathLike[str] | None = None) -> tuple[Link, Hand]:
    """The link that `url` names, and the hand at its end; arguments and errors as those of `open_skin`."""
    if url.startswith("emulator:"):
        description = _given(hand or DEFAULT_HAND)
        return open_emulator(url, description), description
    path = recorded_path(url)
    if path is None:
        description = _given(hand or DEFAULT_HAND)
        return open_link(url), description
    from taxel.ros.mcap_link import is_mcap, open_mcap  # MCAP and its compression take a tenth of a second to import

    link = open_mcap(path) if is_mcap(path) else open_link(url)
    try:
        return link, recorded_hand(link) if hand is None else _given(hand)
    except BaseException:
        link.close()
        raise


def recorded_hand(link: Link) -> Hand:
    """The hand that a recording carries, or the packaged one that it names, else the default one."""
    head = getattr(link, "header", {})
    text = head.get("hand_description")
    if isinstance(text, str):
        return hand_of_text(text.encode(), f"{link.name} (its hand)")
    name = head.get("hand")
    return load_hand(name if isinstance(name, str) and name in packaged_hands() else DEFAULT_HAND)


def _given(hand: Hand | str | os.PathLike[str]) -> Hand:
    return hand if isinstance(hand, Hand) else load_hand(hand)
