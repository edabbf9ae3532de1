//! Messages of the original hub (SPEC.md, part 7): without CRC, sequence number and byte stuffing.

use crate::original_formats::*;

/// Bytes that a decoder needs: the longest message, and the part of the next one that decides about it.
const CAPACITY: usize = 512;
const WORDS_MAX: usize = 128;
const TIMES: usize = ORIGINAL_REFERENCE_TIMES as usize;
const HEADER: usize = ORIGINAL_HEADER_SIZE as usize;

/// One message.
#[derive(Clone, Copy, Debug)]
pub struct OriginalMessage<'a> {
    pub address: u8,
    /// None in formats without a timestamp.
    pub timestamp_ms: Option<u32>,
    /// The time follows a recent message; a damaged time seldom does.
    pub is_time_plausible: bool,
    /// Position of the first byte in the stream.
    pub position: u64,
    pub counts: &'a [u16],
    pub accelerations: &'a [i16],
}

/// A complete candidate in the buffer. `has_evidence`: None: not yet needed.
#[derive(Clone, Copy)]
struct Candidate {
    start: usize,
    end: usize,
    has_evidence: Option<bool>,
}

/// A header at a position of the buffer.
enum Header {
    None,
    Incomplete,
    Length(usize),
}

/// Decoder of a stream. Memory: about 1 kB.
///
/// A candidate begins with start byte, length and address of a known board, and ends with the end byte. It is accepted if
/// no overlapping candidate has better evidence, or equal evidence and a later start.
#[derive(Clone)]
pub struct OriginalDecoder {
    format: &'static OriginalFormat,
    buffer: [u8; CAPACITY],
    fill: usize,
    scan: usize,                // first byte that is not searched yet
    strong_end: usize,          // end of the farthest candidate with evidence
    current: Option<Candidate>, // best candidate that overlaps the byte at `scan`
    base: u64,                  // stream position of the buffer
    covered: u64,               // stream position of the end of the settled bytes
    discarded: u64,
    rejected: u64,
    ambiguous: u64,
    times: [Option<u32>; TIMES],
    words: [u16; WORDS_MAX],
    accelerations: [i16; ORIGINAL_ACCELERATIONS as usize],
}

impl OriginalDecoder {
    /// Create a decoder without received bytes.
    pub const fn new(format: &'static OriginalFormat) -> Self {
        Self {
            format,
            buffer: [0; CAPACITY],
            fill: 0,
            scan: 0,
            strong_end: 0,
            current: None,
            base: 0,
            covered: 0,
            discarded: 0,
            rejected: 0,
            ambiguous: 0,
            times: [None; TIMES],
            words: [0; WORDS_MAX],
            accelerations: [0; ORIGINAL_ACCELERATIONS as usize],
        }
    }

    /// Return the number of bytes in no accepted message.
    pub fn discarded_bytes(&self) -> u64 {
        self.discarded
    }

    /// Return the number of headers without an end byte at their length.
    pub fn rejected_candidates(&self) -> u64 {
        self.rejected
    }

    /// Return the number of complete candidates that overlap a better one.
    pub fn ambiguous_candidates(&self) -> u64 {
        self.ambiguous
    }

    /// Take any number of bytes, and call `handler` for each message that can be decided.
    pub fn push(&mut self, mut bytes: &[u8], handler: &mut impl FnMut(OriginalMessage<'_>)) {
        while !bytes.is_empty() {
            let step = bytes.len().min(CAPACITY - self.fill); // fewer than CAPACITY bytes wait for a decision
            self.buffer[self.fill..self.fill + step].copy_from_slice(&bytes[..step]);
            self.fill += step;
            bytes = &bytes[step..];
            self.process(false, handler);
        }
    }

    /// Decide the remaining bytes: at the end of a stream, or after a pause of the hub.
    pub fn finish(&mut self, handler: &mut impl FnMut(OriginalMessage<'_>)) {
        self.process(true, handler);
    }

    /// Deliver the messages that can be decided with the bytes in the buffer.
    fn process(&mut self, is_end: bool, handler: &mut impl FnMut(OriginalMessage<'_>)) {
        if self.format.record_size > 0 {
            while self.fill - self.scan >= self.format.record_size {
                let end = self.scan + self.format.record_size;
                self.accept(Candidate { start: self.scan, end, has_evidence: Some(false) }, handler);
                self.scan = end;
            }
            if is_end {
                self.scan = self.fill;
            }
        } else {
            while self.step(is_end, handler) {}
        }
        self.remove_settled_bytes();
    }

    /// Search up to the next start byte, or to the end of the current candidate; return false if bytes are missing.
    fn step(&mut self, is_end: bool, handler: &mut impl FnMut(OriginalMessage<'_>)) -> bool {
        let until = self.current.map_or(self.fill, |current| current.end);
        let found = self.buffer[self.scan..until].iter().position(|&byte| byte as u32 == ORIGINAL_START);
        match found {
            Some(distance) => {
                self.scan += distance;
                let is_decided = self.examine(is_end);
                self.scan += is_decided as usize;
                is_decided
            }
            None => {
                self.scan = until;
                match self.current.take() {
                    Some(accepted) => {
                        self.accept(accepted, handler);
                        true
                    }
                    None => false,
                }
            }
        }
    }

    /// Examine the start byte at `scan`; return false if bytes are missing.
    fn examine(&mut self, is_end: bool) -> bool {
        let start = self.scan;
        match self.match_header(start) {
            Header::None => true,
            Header::Incomplete => is_end,
            Header::Length(length) if start + length > self.fill => {
                self.rejected += is_end as u64;
                is_end
            }
            Header::Length(length) => {
                if self.buffer[start + length - 1] as u32 != ORIGINAL_END {
                    self.rejected += 1;
                    return true;
                }
                self.resolve(Candidate { start, end: start + length, has_evidence: None }, is_end)
            }
        }
    }

    /// Return the offset of the first count in a message.
    fn counts_offset(&self) -> usize {
        HEADER + if self.format.has_timestamp { ORIGINAL_TIMESTAMP_SIZE as usize } else { 0 }
    }

    /// Return the length of a message of this board; 0 for an unknown board.
    fn get_length(&self, address: usize) -> usize {
        match self.format.taxels.get(address) {
            None | Some(0) => 0,
            Some(&taxels) => {
                self.counts_offset() + 2 * (taxels as usize + self.format.accelerations[address] as usize) + 1
            }
        }
    }

    /// Examine whether a header begins at `start`.
    fn match_header(&self, start: usize) -> Header {
        let bytes = &self.buffer[start..self.fill];
        let is_length = |length: u8| (0..self.format.taxels.len()).any(|a| self.get_length(a) == length as usize);
        match *bytes {
            [] => Header::Incomplete,
            [first, ..] if first as u32 != ORIGINAL_START => Header::None,
            [_] => Header::Incomplete,
            [_, length] => {
                if is_length(length) {
                    Header::Incomplete
                } else {
                    Header::None
                }
            }
            [_, length, address, ..] => match self.get_length(address as usize) {
                0 => Header::None,
                expected if expected == length as usize => Header::Length(expected),
                _ => Header::None,
            },
        }
    }

    /// Compare a complete candidate with those that overlap it, and keep the better one.
    ///
    /// Returns false if bytes are missing.
    fn resolve(&mut self, mut candidate: Candidate, is_end: bool) -> bool {
        let mut current = self.current;
        if self.format.has_timestamp {
            candidate.has_evidence = Some(self.is_plausible(self.read_time(candidate.start)));
        } else if current.is_some() || self.strong_end > candidate.start {
            let is_found = self.find_evidence(&mut candidate, is_end)
                && current.as_mut().map_or(true, |current| self.find_evidence(current, is_end));
            if !is_found {
                return false;
            }
        }
        let is_strong = candidate.has_evidence == Some(true);
        let is_current_strong = current.map_or(false, |current| current.has_evidence == Some(true));
        if let (Some(current), true) = (current, is_current_strong) {
            self.strong_end = self.strong_end.max(current.end);
        }
        let is_beaten = !is_strong && self.strong_end > candidate.start;
        self.ambiguous += is_beaten as u64;
        if current.is_some() && (is_strong || !is_current_strong) {
            self.ambiguous += 1;
            current = None;
        }
        self.current = if is_beaten { current } else { Some(candidate) };
        if is_strong {
            self.strong_end = self.strong_end.max(candidate.end);
        }
        true
    }

    /// Find the evidence of a candidate without timestamps: a header or the end of the stream directly behind it.
    ///
    /// Returns false if bytes are missing.
    fn find_evidence(&self, candidate: &mut Candidate, is_end: bool) -> bool {
        if candidate.has_evidence.is_none() {
            candidate.has_evidence = match self.match_header(candidate.end) {
                Header::Incomplete if !is_end => return false,
                Header::None => Some(false),
                _ => Some(true),
            };
        }
        true
    }

    /// Return the timestamp of the message that begins at `start`.
    fn read_time(&self, start: usize) -> u32 {
        let bytes = &self.buffer[start + HEADER..start + HEADER + 4];
        u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
    }

    /// Return whether a time follows one of the last messages' times closely.
    ///
    /// Time 0, the start of the hub, is always a reference.
    fn is_plausible(&self, time_ms: u32) -> bool {
        let follows = |time: &u32| time_ms.wrapping_sub(*time) <= ORIGINAL_TIME_STEP_MAX_MS;
        time_ms <= ORIGINAL_TIME_STEP_MAX_MS || self.times.iter().flatten().any(follows)
    }

    /// Decode an accepted candidate, call the handler, and update counters and reference times.
    fn accept(&mut self, candidate: Candidate, handler: &mut impl FnMut(OriginalMessage<'_>)) {
        let format = self.format;
        let is_record = format.record_size > 0;
        let address = if is_record { ORIGINAL_RECORD_ADDRESS as u8 } else { self.buffer[candidate.start + 2] };
        let mut timestamp_ms = None;
        if format.has_timestamp {
            timestamp_ms = Some(self.read_time(candidate.start));
            self.times.rotate_left(1);
            self.times[TIMES - 1] = timestamp_ms;
        }
        let taxels = format.taxels[address as usize] as usize;
        let accelerations = format.accelerations[address as usize] as usize;
        let offset = candidate.start + if is_record { 0 } else { self.counts_offset() };
        let words = self.buffer[offset..offset + 2 * (taxels + accelerations)].chunks_exact(2);
        for (word, pair) in self.words.iter_mut().zip(words) {
            let pair = [pair[0], pair[1]];
            *word = if format.is_big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) };
        }
        for (acceleration, &word) in self.accelerations.iter_mut().zip(&self.words[taxels..taxels + accelerations]) {
            *acceleration = word as i16;
        }
        let position = self.base + candidate.start as u64;
        self.discarded += position - self.covered;
        self.covered = self.base + candidate.end as u64;
        handler(OriginalMessage {
            address,
            timestamp_ms,
            is_time_plausible: timestamp_ms.is_some() && candidate.has_evidence == Some(true),
            position,
            counts: &self.words[..taxels],
            accelerations: &self.accelerations[..accelerations],
        });
    }

    /// Count the bytes before the search position as discarded and remove them from the buffer.
    fn remove_settled_bytes(&mut self) {
        let settled = self.current.map_or(self.scan, |current| current.start);
        let position = self.base + settled as u64;
        if position > self.covered {
            self.discarded += position - self.covered;
            self.covered = position;
        }
        self.buffer.copy_within(settled..self.fill, 0);
        self.base = position;
        self.fill -= settled;
        self.scan -= settled;
        self.strong_end = self.strong_end.saturating_sub(settled);
        if let Some(current) = &mut self.current {
            current.start -= settled;
            current.end -= settled;
        }
    }
}
