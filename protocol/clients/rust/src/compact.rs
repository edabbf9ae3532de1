//! Compact snapshots of one board: packed frames and delta frames to counts, key frames, and the answers to the board.

use crate::compact_model::{Taxel, COUNT_MAX};
use crate::crc32::crc32;
use crate::protocol::*;

const TAXELS: usize = COMPACT_TAXELS_MAX as usize;
const REPEAT_AFTER: u8 = 4; // snapshots that may arrive before an answer takes effect on the board

/// Result of a compact snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompactResult {
    /// The counts are decoded; `timestamp_us` is the board's clock.
    Decoded { timestamp_us: u32 },
    /// The snapshot is damaged.
    Damaged,
    /// The snapshot is a delta frame whose key frame this host does not have.
    NoKeyFrame,
}

/// Answer that the host has to send to a board in an ACKNOWLEDGE frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompactAnswer {
    None,
    Acknowledge,
    Forget,
}

/// Decoder of a range coder (Martin, 1979). Bytes after the last one are zeros.
struct RangeDecoder<'a> {
    bytes: core::slice::Iter<'a, u8>,
    code: u32,
    range: u32,
}

impl<'a> RangeDecoder<'a> {
    /// Create a decoder of the coded bytes of a delta frame.
    fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { bytes: bytes.iter(), code: 0, range: u32::MAX };
        for _ in 0..4 {
            decoder.shift_in_byte();
        }
        decoder
    }

    /// Move the next byte into the code.
    fn shift_in_byte(&mut self) {
        self.code = self.code << 8 | self.bytes.next().map_or(0, |&byte| byte as u32);
    }

    /// Return the next of 2^bits equal shares, without consuming it. Damaged bytes alone point behind the last one.
    fn peek(&self, bits: u32) -> u32 {
        (self.code / (self.range >> bits)).min((1 << bits) - 1)
    }

    /// Consume the symbol with the interval from `first` on with `size` of 2^bits equal shares.
    fn take(&mut self, first: u32, size: u32, bits: u32) {
        let share = self.range >> bits;
        self.code = self.code.wrapping_sub(first * share);
        self.range = size * share;
        while self.range < 1 << 24 {
            self.shift_in_byte();
            self.range <<= 8;
        }
    }

    /// Decode and consume an uncoded number.
    fn take_bits(&mut self, bits: u32) -> u32 {
        let value = self.peek(bits);
        self.take(value, 1, bits);
        value
    }

    /// Decode a count too far from its prediction: sign, exponent and mantissa of the distance from the centre.
    ///
    /// Returns None for bytes that no encoder produces.
    fn take_escape(&mut self, taxel: Taxel) -> Option<u16> {
        self.take(0, COMPACT_ESCAPE, COMPACT_TOTAL_BITS);
        let head = self.take_bits(5);
        let size = (1 << (head >> 1)) + self.take_bits(head >> 1);
        let count = match head & 1 {
            0 => taxel.centre().checked_add(size)?,
            _ => taxel.centre().checked_sub(size)?,
        };
        (count <= COUNT_MAX).then(|| count as u16)
    }

    /// Decode the next count; return None for bytes that no encoder produces.
    fn take_count(&mut self, taxel: Taxel) -> Option<u16> {
        let target = self.peek(COMPACT_TOTAL_BITS);
        if target < COMPACT_ESCAPE {
            return self.take_escape(taxel);
        }
        let (raw_bits, mut symbol) = (taxel.raw_bits(), taxel.find_first_symbol(target));
        let (mut first, mut next) = (taxel.cumulative(symbol), taxel.cumulative(symbol + 1));
        while next <= target && symbol < COUNT_MAX >> raw_bits {
            symbol += 1;
            first = next;
            next = taxel.cumulative(symbol + 1);
        }
        if target < first || target >= next {
            return None;
        }
        self.take(first, next - first, COMPACT_TOTAL_BITS);
        Some((symbol << raw_bits | self.take_bits(raw_bits)) as u16)
    }
}

/// Unpack the counts of a packed frame, each of `width` bits, lowest bits first.
fn unpack_counts(bytes: &[u8], width: u32, counts: &mut [u16]) {
    let (mut buffer, mut bits, mut bytes) = (0u32, 0, bytes.iter());
    for count in counts {
        while bits < width {
            buffer |= bytes.next().map_or(0, |&byte| byte as u32) << bits;
            bits += 8;
        }
        *count = (buffer & ((1 << width) - 1)) as u16;
        buffer >>= width;
        bits -= width;
    }
}

/// Key frame of a board: the predictions against which delta frames are coded.
#[derive(Clone, Copy)]
struct KeyFrame {
    is_valid: bool,
    taxel_count: u8,
    updates: u8,
    id: u16,
    timestamp_us: u32,
    taxels: [Taxel; TAXELS],
}

impl KeyFrame {
    const EMPTY: Self =
        Self { is_valid: false, taxel_count: 0, updates: 0, id: 0, timestamp_us: 0, taxels: [Taxel::EMPTY; TAXELS] };
}

/// State of the compact snapshots of one board. Memory: about 2 kB.
#[derive(Clone, Copy)]
pub struct CompactReceiver {
    answer: CompactAnswer,
    snapshots_until_repeat: u8,
    key_frame: KeyFrame,
    pending: KeyFrame,
}

impl CompactReceiver {
    /// The state without any key frame.
    pub const EMPTY: Self = Self {
        answer: CompactAnswer::None,
        snapshots_until_repeat: 0,
        key_frame: KeyFrame::EMPTY,
        pending: KeyFrame::EMPTY,
    };

    /// Decode a compact snapshot, the bytes from `sequence` to `crc32`, into `counts`, one element per taxel.
    pub fn receive(&mut self, address: u8, bytes: &[u8], counts: &mut [u16]) -> CompactResult {
        self.try_receive(address, bytes, counts).unwrap_or(CompactResult::Damaged)
    }

    /// Return the answer that has not been sent yet.
    pub fn answer(&self) -> CompactAnswer {
        self.answer
    }

    /// Return the answer as an element of an ACKNOWLEDGE payload, which then counts as sent; None if there is none.
    pub fn take_answer(&mut self, address: u8) -> Option<Acknowledgement> {
        let acknowledgement = match self.answer {
            CompactAnswer::None => return None,
            CompactAnswer::Acknowledge => Acknowledgement { address, key_frame: self.pending.id },
            CompactAnswer::Forget => Acknowledgement { address: address | ACKNOWLEDGE_FORGET as u8, key_frame: 0 },
        };
        self.answer = CompactAnswer::None;
        Some(acknowledgement)
    }

    /// Decode a compact snapshot; return None if it is damaged.
    fn try_receive(&mut self, address: u8, bytes: &[u8], counts: &mut [u16]) -> Option<CompactResult> {
        if bytes.len() < COMPACT_OVERHEAD_DELTA as usize || counts.is_empty() || counts.len() > TAXELS {
            return None;
        }
        let (content, tail) = bytes.split_at(bytes.len() - 4);
        let crc = crc32(content, crc32(&[address], 0));
        let format = CompactHeader::unpack(content)?.format as u32;
        let (width, start) = (format & COMPACT_WIDTH_MASK, format & COMPACT_START_MASK);
        let is_key_frame = format & COMPACT_KEY_FRAME != 0;
        if crc.to_le_bytes() != tail || width > 16 || (start != 0 && !(width != 0 && is_key_frame)) {
            return None;
        }
        let result =
            if width != 0 { self.receive_packed(content, counts)? } else { self.receive_delta(content, counts)? };
        if let (CompactResult::Decoded { timestamp_us }, true) = (result, is_key_frame) {
            let id = crc as u16;
            // no board marks a snapshot whose id equals that of the key frame in use
            self.pending.is_valid = !(self.key_frame.is_valid && self.key_frame.id == id);
            if self.pending.is_valid {
                self.pending.id = id;
                self.pending.timestamp_us = timestamp_us;
                self.set_answer(CompactAnswer::Acknowledge);
            }
        }
        Some(result)
    }

    /// Decode a packed frame; if it is marked as a key frame, it becomes the pending one.
    fn receive_packed(&mut self, content: &[u8], counts: &mut [u16]) -> Option<CompactResult> {
        let head = CompactPacked::unpack(content)?;
        let (format, taxels) = (head.format as u32, counts.len());
        let width = format & COMPACT_WIDTH_MASK;
        let packed = content.get(CompactPacked::SIZE..CompactPacked::SIZE + (width as usize * taxels + 7) / 8)?;
        unpack_counts(packed, width, counts);
        if format & COMPACT_KEY_FRAME != 0 {
            let start = (format & COMPACT_START_MASK) >> COMPACT_START_SHIFT;
            self.key_frame.is_valid = false; // the board has discarded its earlier key frame
            self.pending.taxel_count = taxels as u8;
            self.pending.updates = 1;
            for (taxel, &count) in self.pending.taxels.iter_mut().zip(counts.iter()) {
                *taxel = Taxel::start(count, start);
            }
        }
        Some(CompactResult::Decoded { timestamp_us: head.timestamp_us })
    }

    /// Decode a delta frame against the key frame that it names.
    fn receive_delta(&mut self, content: &[u8], counts: &mut [u16]) -> Option<CompactResult> {
        let head = CompactDelta::unpack(content)?;
        if self.pending.is_valid && self.pending.id == head.key_frame {
            self.key_frame = self.pending; // the board has received the acknowledgement
            self.pending.is_valid = false;
            self.answer = CompactAnswer::None;
        }
        let key_frame = &self.key_frame;
        let is_available =
            key_frame.is_valid && key_frame.id == head.key_frame && key_frame.taxel_count as usize == counts.len();
        if !is_available || !self.decode_counts(&content[CompactDelta::SIZE..], counts) {
            return Some(self.reject_delta());
        }
        let [low, middle, high] = head.timestamp_low;
        let since = u32::from_le_bytes([low, middle, high, 0]).wrapping_sub(self.key_frame.timestamp_us);
        let timestamp_us = self.key_frame.timestamp_us.wrapping_add(since & 0xFF_FFFF);
        if head.format as u32 & COMPACT_KEY_FRAME != 0 {
            self.update_pending(counts);
        } else if self.pending.is_valid {
            self.repeat_answer(CompactAnswer::Acknowledge);
        }
        Some(CompactResult::Decoded { timestamp_us })
    }

    /// Decode the counts of a delta frame; return false for bytes that no encoder produces.
    fn decode_counts(&self, coded: &[u8], counts: &mut [u16]) -> bool {
        let mut decoder = RangeDecoder::new(coded);
        for (count, &taxel) in counts.iter_mut().zip(&self.key_frame.taxels) {
            match decoder.take_count(taxel) {
                Some(value) => *count = value,
                None => return false,
            }
        }
        true
    }

    /// Compute the pending key frame from the key frame in use and the counts after it.
    fn update_pending(&mut self, counts: &[u16]) {
        let gain = COMPACT_GAINS[self.key_frame.updates as usize - 1] as u32;
        let states = self.pending.taxels.iter_mut().zip(&self.key_frame.taxels);
        for ((taxel, before), &count) in states.zip(counts) {
            *taxel = before.update(count, gain);
        }
        self.pending.taxel_count = self.key_frame.taxel_count;
        self.pending.updates = (self.key_frame.updates + 1).min(COMPACT_GAINS.len() as u8);
    }

    /// Discard both key frames after a delta frame that cannot be decoded, and report this to the board.
    fn reject_delta(&mut self) -> CompactResult {
        if self.key_frame.is_valid || self.pending.is_valid {
            self.key_frame.is_valid = false;
            self.pending.is_valid = false;
            self.snapshots_until_repeat = 0;
        }
        self.repeat_answer(CompactAnswer::Forget);
        CompactResult::NoKeyFrame
    }

    /// Store an answer to be sent.
    fn set_answer(&mut self, answer: CompactAnswer) {
        self.answer = answer;
        self.snapshots_until_repeat = REPEAT_AFTER;
    }

    /// Store an answer again if several snapshots have arrived without its effect.
    fn repeat_answer(&mut self, answer: CompactAnswer) {
        if self.snapshots_until_repeat > 0 {
            self.snapshots_until_repeat -= 1;
        } else {
            self.set_answer(answer);
        }
    }
}
