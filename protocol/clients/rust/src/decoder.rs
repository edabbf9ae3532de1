//! Stream decoder: bytes of the hub in, frames with counts and losses out.

use crate::compact::{CompactAnswer, CompactReceiver, CompactResult};
use crate::crc32::crc32;
use crate::framing::{Deframer, Direction, RawFrame};
use crate::protocol::*;

/// Properties of a frame, as bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags(pub u8);

impl Flags {
    /// The frame's CRC is correct, the board's own CRC-32 is wrong.
    pub const BOARD_CRC_BAD: Self = Self(1);
    /// The hub has restarted: its sequence begins at 0.
    pub const HUB_RESTARTED: Self = Self(2);
    /// A delta frame whose key frame this host does not have: no counts.
    pub const NO_KEY_FRAME: Self = Self(4);
    /// More boards than the decoder has memory for: no loss counters, and no counts of compact frames.
    pub const NO_MEMORY: Self = Self(8);

    /// Return whether all bits of `other` are set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Set all bits of `other`.
    fn set(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// Content of a taxel frame.
#[derive(Clone, Copy, Debug)]
pub struct TaxelData<'a> {
    pub address: u8,
    pub cycle: u16,
    pub hub_time_us: u32,
    pub board_sequence: u16,
    pub board_time_us: u32,
    /// Frames of this board that are missing since its previous frame.
    pub missing_before: u16,
    /// Raw counts in the board's taxel order; empty if they are not available.
    pub counts: &'a [u16],
}

/// One frame.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    pub frame_type: FrameType,
    pub sequence: u16,
    /// Frames that the hub sent between the previous frame and this frame.
    pub lost_before: u16,
    pub flags: Flags,
    pub payload: &'a [u8],
    /// Bytes of the stream up to the delimiter behind this frame.
    pub stream_position: u64,
    /// Content of a TAXELS or COMPACT_TAXELS frame.
    pub taxels: Option<TaxelData<'a>>,
}

impl<'a> Frame<'a> {
    /// Return the payload as the structs of its type; None if the payload is too short.
    pub fn message(&self) -> Option<Message<'a>> {
        Message::parse(self.frame_type, self.payload)
    }
}

/// Counters of one board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BoardLosses {
    pub address: u8,
    pub received: u64,
    /// Frames that are missing between two received frames, by the poll cycle.
    pub missing: u64,
    /// Frames whose board CRC was wrong.
    pub damaged: u64,
    /// Delta frames without their key frame.
    pub undecoded: u64,
}

/// Counters of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    pub frames: u64,
    /// Frames lost on the wire: gaps of the frames' sequence.
    pub lost: u64,
    pub restarts: u64,
    /// Complete frames that this version does not define.
    pub unknown: u64,
}

#[derive(Clone, Copy)]
struct Board {
    losses: BoardLosses,
    last: Option<(u16, u16)>, // cycle and scan of the last frame
    receiver: CompactReceiver,
}

impl Board {
    const EMPTY: Self = Self {
        losses: BoardLosses { address: 0, received: 0, missing: 0, damaged: 0, undecoded: 0 },
        last: None,
        receiver: CompactReceiver::EMPTY,
    };

    /// Count the missing frames since the previous frame. No more can be missing than scans were skipped; a board that
    /// is polled while it codes a compact snapshot skips one scan without loss (`coding`).
    fn count_cycles(&mut self, cycle: u16, scan: u16, coding: u16) -> u16 {
        let missing = self.last.map_or(0, |(last_cycle, last_scan)| {
            let scans = scan.wrapping_sub(last_scan).saturating_sub(coding);
            cycle.wrapping_sub(last_cycle).min(scans).saturating_sub(1)
        });
        self.losses.missing += missing as u64;
        self.last = Some((cycle, scan));
        missing
    }
}

/// Decoder of the stream of a hub with at most `BOARDS` boards. Memory: about 2.6 kB and 2 kB per board.
#[derive(Clone)]
pub struct Decoder<const BOARDS: usize> {
    deframer: Deframer,
    state: State<BOARDS>,
}

/// State of a decoder except its deframer, so that the deframer can call it.
#[derive(Clone)]
struct State<const BOARDS: usize> {
    directions: Direction,
    losses: Losses,
    next_sequence: Option<u16>,
    lost_before_unknown: u16,
    boards: [Board; BOARDS],
    board_count: usize,
    counts: [u16; TAXELS_MAX as usize],
}

impl<const BOARDS: usize> Decoder<BOARDS> {
    /// Create a decoder without received bytes.
    pub const fn new(directions: Direction) -> Self {
        let state = State {
            directions,
            losses: Losses { frames: 0, lost: 0, restarts: 0, unknown: 0 },
            next_sequence: None,
            lost_before_unknown: 0,
            boards: [Board::EMPTY; BOARDS],
            board_count: 0,
            counts: [0; TAXELS_MAX as usize],
        };
        Self { deframer: Deframer::new(directions), state }
    }

    /// Take any number of bytes, and call `handler` for each frame that they complete.
    pub fn push(&mut self, bytes: &[u8], handler: &mut impl FnMut(&Frame<'_>)) {
        let state = &mut self.state;
        self.deframer.push(bytes, &mut |raw| state.deliver(raw, handler));
    }

    /// Decode the remaining bytes at the end of a stream.
    pub fn finish(&mut self, handler: &mut impl FnMut(&Frame<'_>)) {
        let state = &mut self.state;
        self.deframer.finish(&mut |raw| state.deliver(raw, handler));
    }

    /// Return the counters of the stream.
    pub fn losses(&self) -> Losses {
        self.state.losses
    }

    /// Return the counters of each board, in the order of the first frames.
    pub fn boards(&self) -> impl Iterator<Item = BoardLosses> + '_ {
        self.state.boards[..self.state.board_count].iter().map(|board| board.losses)
    }

    /// Return the number of bytes that were part of no frame; delimiters are not counted.
    pub fn discarded_bytes(&self) -> u64 {
        self.deframer.discarded_bytes()
    }

    /// Forget the poll cycles of all boards.
    ///
    /// To be called when the host sends START: frames of the interrupted poll cycle then do not count as missing.
    pub fn forget_cycles(&mut self) {
        self.state.forget_cycles();
    }

    /// Write pending acknowledgements as the payload of an ACKNOWLEDGE frame, which the caller has to send.
    ///
    /// Returns its size, 0 if there are none; 66 bytes suffice. Acknowledgements that do not fit remain pending.
    pub fn take_acknowledgements(&mut self, payload: &mut [u8]) -> usize {
        let (mut size, state) = (0, &mut self.state);
        let boards = &mut state.boards[..state.board_count];
        while size + Acknowledgement::SIZE <= payload.len().min(Acknowledgement::SIZE * ACKNOWLEDGE_MAX as usize) {
            let pending = boards.iter_mut().filter(|board| board.receiver.answer() != CompactAnswer::None);
            let first = pending.min_by_key(|board| board.losses.address);
            match first.and_then(|board| board.receiver.take_answer(board.losses.address)) {
                Some(answer) => answer.pack(&mut payload[size..]),
                None => break,
            }
            size += Acknowledgement::SIZE;
        }
        size
    }
}

impl<const BOARDS: usize> State<BOARDS> {
    /// Decode a frame of the deframer and call the handler.
    fn deliver(&mut self, raw: RawFrame<'_>, handler: &mut impl FnMut(&Frame<'_>)) {
        let frame_type = match raw.frame_type {
            Some(frame_type) => frame_type,
            None => return self.count_unknown(raw.code, raw.sequence),
        };
        let mut frame = Frame {
            frame_type,
            sequence: raw.sequence,
            lost_before: 0,
            flags: Flags::default(),
            payload: raw.payload,
            stream_position: raw.stream_position,
            taxels: None,
        };
        self.count_sequence(&mut frame);
        match frame.message() {
            Some(Message::Taxels { header, snapshot_header, .. }) => {
                self.decode_taxels(&mut frame, header, snapshot_header, handler)
            }
            Some(Message::CompactTaxels { header, snapshot, .. }) => {
                self.decode_compact(&mut frame, header, snapshot, handler)
            }
            _ => handler(&frame),
        }
    }

    fn forget_cycles(&mut self) {
        for board in &mut self.boards {
            board.last = None;
        }
    }

    /// Count a frame and the frames that were lost before it.
    fn count_sequence(&mut self, frame: &mut Frame<'_>) {
        let is_start_of_hub =
            matches!(frame.message(), Some(Message::HubHandshake { fields }) if fields.tag == 0 && frame.sequence == 0);
        if is_start_of_hub {
            self.forget_cycles();
            if self.next_sequence.is_some() {
                frame.flags.set(Flags::HUB_RESTARTED);
                self.losses.restarts += 1;
            }
            self.count_frame(frame.sequence, 0);
        } else {
            let lost = self.compute_lost_before(frame.sequence);
            frame.lost_before = lost.wrapping_add(self.lost_before_unknown);
            self.count_frame(frame.sequence, lost);
        }
        self.lost_before_unknown = 0;
    }

    /// Count a frame that this version does not define. It takes a number of the sender's sequence, and is no loss; a
    /// frame of the other direction has the sequence of another sender.
    fn count_unknown(&mut self, code: u8, sequence: u16) {
        self.losses.unknown += 1;
        if self.directions.accepts(code) {
            let lost = self.compute_lost_before(sequence);
            self.lost_before_unknown = self.lost_before_unknown.wrapping_add(lost);
            self.count_frame(sequence, lost);
        }
    }

    /// Return the number of frames that are missing in the sequence before this frame.
    fn compute_lost_before(&self, sequence: u16) -> u16 {
        self.next_sequence.map_or(0, |expected| sequence.wrapping_sub(expected))
    }

    /// Count a frame with the number of frames that were lost before it.
    fn count_frame(&mut self, sequence: u16, lost: u16) {
        self.losses.frames += 1;
        self.losses.lost += lost as u64;
        self.next_sequence = Some(sequence.wrapping_add(1));
    }

    /// Return the index of the board of this address; None if it is new and there is no memory for it.
    fn find_board(&mut self, address: u8) -> Option<usize> {
        let known = self.boards[..self.board_count].iter().position(|board| board.losses.address == address);
        if known.is_none() && self.board_count < BOARDS {
            self.boards[self.board_count].losses.address = address;
            self.board_count += 1;
            return Some(self.board_count - 1);
        }
        known
    }

    /// Decode a TAXELS frame, check the CRC of its board, and call the handler.
    fn decode_taxels(
        &mut self,
        frame: &mut Frame<'_>,
        header: TaxelHeader,
        snapshot: SnapshotHeader,
        handler: &mut impl FnMut(&Frame<'_>),
    ) {
        let (content, crc) = frame.payload[TaxelHeader::SIZE..].split_at(frame.payload.len() - TaxelHeader::SIZE - 4);
        let counts = &mut self.counts[..header.taxel_count as usize];
        for (count, bytes) in counts.iter_mut().zip(content[SnapshotHeader::SIZE..].chunks_exact(2)) {
            *count = u16::from_le_bytes([bytes[0], bytes[1]]);
        }
        let is_correct = crc32(content, crc32(&[header.address], 0)).to_le_bytes() == crc;
        if !is_correct {
            frame.flags.set(Flags::BOARD_CRC_BAD);
        }
        let mut missing_before = 0;
        if let Some(i) = self.find_board(header.address) {
            let board = &mut self.boards[i];
            *(if is_correct { &mut board.losses.received } else { &mut board.losses.damaged }) += 1;
            missing_before = board.count_cycles(header.cycle, snapshot.sequence, 0);
        } else {
            frame.flags.set(Flags::NO_MEMORY);
        }
        let counts = &self.counts[..header.taxel_count as usize];
        let times = (snapshot.sequence, snapshot.timestamp_us);
        handler(&Frame { taxels: Some(make_taxels(header, times, missing_before, counts)), ..*frame });
    }

    /// Decode a COMPACT_TAXELS frame and call the handler.
    fn decode_compact(
        &mut self,
        frame: &mut Frame<'_>,
        header: TaxelHeader,
        snapshot: CompactHeader,
        handler: &mut impl FnMut(&Frame<'_>),
    ) {
        let (mut size, mut time, mut missing_before) = (0, 0, 0);
        if let Some(i) = self.find_board(header.address) {
            let board = &mut self.boards[i];
            let bytes = &frame.payload[TaxelHeader::SIZE..];
            let counts = self.counts.get_mut(..header.taxel_count as usize).unwrap_or_default();
            match board.receiver.receive(header.address, bytes, counts) {
                CompactResult::Decoded { timestamp_us } => {
                    size = counts.len();
                    time = timestamp_us;
                    board.losses.received += 1;
                }
                CompactResult::NoKeyFrame => {
                    frame.flags.set(Flags::NO_KEY_FRAME);
                    board.losses.undecoded += 1;
                }
                CompactResult::Damaged => {
                    frame.flags.set(Flags::BOARD_CRC_BAD);
                    board.losses.damaged += 1;
                }
            }
            missing_before = board.count_cycles(header.cycle, snapshot.sequence, 1);
        } else {
            frame.flags.set(Flags::NO_MEMORY);
        }
        let taxels = make_taxels(header, (snapshot.sequence, time), missing_before, &self.counts[..size]);
        handler(&Frame { taxels: Some(taxels), ..*frame });
    }
}

/// Build the content of a taxel frame. times: sequence of the snapshot, and time of the board.
fn make_taxels(header: TaxelHeader, times: (u16, u32), missing_before: u16, counts: &[u16]) -> TaxelData<'_> {
    TaxelData {
        address: header.address,
        cycle: header.cycle,
        hub_time_us: header.hub_time_us,
        board_sequence: times.0,
        board_time_us: times.1,
        missing_before,
        counts,
    }
}
