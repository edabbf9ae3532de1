//! Frames on the wire: whitening, byte stuffing (COBS), and a deframer that finds every intact frame of a stream.

use crate::crc32::crc32;
use crate::protocol::*;

const BODY: usize = BODY_MAX as usize;
const ENCODED: usize = ENCODED_MAX as usize + 2;
const CHUNK: usize = 2 * ENCODED;
const HEADER: usize = FRAME_HEADER_SIZE as usize;
const CRC: usize = FRAME_CRC_SIZE as usize;

/// Frames that a receiver accepts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Direction(pub u8);

impl Direction {
    /// Frames of a hub.
    pub const TO_HOST: Self = Self(1);
    /// Frames of a host.
    pub const TO_HUB: Self = Self(2);
    /// All frames.
    pub const BOTH: Self = Self(3);

    /// Return whether frames of this type are accepted. Bit 7 of a type: from host to hub.
    pub(crate) fn accepts(self, code: u8) -> bool {
        self.0 & if code & 0x80 != 0 { 2 } else { 1 } != 0
    }
}

/// Compute the whitening sequence.
const fn make_whitening() -> [u8; BODY] {
    let mut sequence = [0u8; BODY];
    let mut value = WHITENING_SEED;
    let mut i = 0;
    while i < BODY {
        sequence[i] = value as u8;
        value = (WHITENING_FACTOR * value + WHITENING_INCREMENT) & 0xFF;
        i += 1;
    }
    sequence
}

static WHITENING: [u8; BODY] = make_whitening();

/// Return the rule of a frame type, or None for an undefined code.
pub fn find_rule(code: u8) -> Option<&'static FrameRule> {
    FRAME_RULES.iter().find(|rule| rule.frame_type as u8 == code)
}

/// Encode a frame with its two delimiters into `out`; return its size.
///
/// Returns None if the type does not allow the length of the payload, or if `out` is too small (513 bytes suffice).
pub fn encode_frame(frame_type: FrameType, sequence: u16, payload: &[u8], out: &mut [u8]) -> Option<usize> {
    let rule = find_rule(frame_type as u8)?;
    if payload.len() < rule.minimum || payload.len() > rule.maximum {
        return None;
    }
    let mut body = [0u8; BODY];
    let end = HEADER + payload.len();
    body[0] = frame_type as u8;
    body[1..3].copy_from_slice(&sequence.to_le_bytes());
    body[3..5].copy_from_slice(&(payload.len() as u16).to_le_bytes());
    body[HEADER..end].copy_from_slice(payload);
    let crc = crc32(&body[..end], 0);
    body[end..end + CRC].copy_from_slice(&crc.to_le_bytes());
    whiten_and_stuff(&body[..end + CRC], out)
}

/// Whiten and stuff a body, with a delimiter before and after it; return None if `out` is too small.
fn whiten_and_stuff(body: &[u8], out: &mut [u8]) -> Option<usize> {
    *out.get_mut(0)? = 0;
    let mut code = 1; // position of the code byte of the current block
    let mut next = 2;
    for (byte, key) in body.iter().zip(&WHITENING) {
        if next - code == 0xFF {
            *out.get_mut(code)? = 0xFF; // 254 bytes without a zero: no zero follows this block
            code = next;
            next += 1;
        }
        if byte ^ key != 0 {
            *out.get_mut(next)? = byte ^ key;
        } else {
            *out.get_mut(code)? = (next - code) as u8;
            code = next;
        }
        next += 1;
    }
    *out.get_mut(code)? = (next - code) as u8;
    *out.get_mut(next)? = 0;
    Some(next + 1)
}

/// A complete frame with a correct CRC, before its payload is decoded.
#[derive(Clone, Copy, Debug)]
pub struct RawFrame<'a> {
    /// The frame type; None if this version does not define it, or not with this payload.
    pub frame_type: Option<FrameType>,
    /// Code of the frame type.
    pub code: u8,
    pub sequence: u16,
    pub payload: &'a [u8],
    /// Bytes of the stream up to the delimiter behind this frame.
    pub stream_position: u64,
}

/// Finds the frames of a stream. Memory: about 1.6 kB.
///
/// A frame needs no delimiter: its header states its length. Every byte of a chunk (the bytes between two zeros) is
/// tried as the start of a frame until one is found, so that damage never hides an intact frame.
#[derive(Clone)]
pub struct Deframer {
    directions: Direction,
    discarded_bytes: u64,
    position: u64,
    fill: usize,
    chunk: [u8; CHUNK],
    body: [u8; BODY],
}

impl Deframer {
    /// Create a deframer without received bytes.
    pub const fn new(directions: Direction) -> Self {
        Self { directions, discarded_bytes: 0, position: 0, fill: 0, chunk: [0; CHUNK], body: [0; BODY] }
    }

    /// Return the number of bytes that were part of no frame; delimiters are not counted.
    pub fn discarded_bytes(&self) -> u64 {
        self.discarded_bytes
    }

    /// Take any number of bytes, and call `handler` for each frame that they complete.
    pub fn push(&mut self, mut bytes: &[u8], handler: &mut impl FnMut(RawFrame<'_>)) {
        while !bytes.is_empty() {
            let zero = bytes.iter().position(|&byte| byte == 0);
            let (piece, used) = match zero {
                Some(length) => (&bytes[..length], length + 1),
                None => (bytes, bytes.len()),
            };
            self.position += used as u64;
            self.append(piece, handler);
            if zero.is_some() {
                self.finish(handler);
            }
            bytes = &bytes[used..];
        }
    }

    /// Search the remaining bytes, as if a delimiter followed: at the end of a stream.
    pub fn finish(&mut self, handler: &mut impl FnMut(RawFrame<'_>)) {
        self.search(self.fill, handler);
        self.fill = 0;
    }

    /// Append bytes without a zero to the chunk; search its front when the buffer is full.
    fn append(&mut self, mut bytes: &[u8], handler: &mut impl FnMut(RawFrame<'_>)) {
        while !bytes.is_empty() {
            if self.fill == CHUNK {
                let used = self.search(CHUNK - ENCODED, handler); // the rest may be the start of a frame
                self.chunk.copy_within(used..CHUNK, 0);
                self.fill = CHUNK - used;
            }
            let step = bytes.len().min(CHUNK - self.fill);
            self.chunk[self.fill..self.fill + step].copy_from_slice(&bytes[..step]);
            self.fill += step;
            bytes = &bytes[step..];
        }
    }

    /// Try every byte before `until` as the start of a frame; return where the search ended.
    fn search(&mut self, until: usize, handler: &mut impl FnMut(RawFrame<'_>)) -> usize {
        let mut start = 0;
        while start < until {
            match self.unstuff(start) {
                Some((end, length)) => {
                    let payload = &self.body[HEADER..HEADER + length];
                    let (code, sequence) = (self.body[0], u16::from_le_bytes([self.body[1], self.body[2]]));
                    let frame_type = self.find_type(code, payload);
                    handler(RawFrame { frame_type, code, sequence, payload, stream_position: self.position });
                    start = end;
                }
                None => {
                    self.discarded_bytes += 1;
                    start += 1;
                }
            }
        }
        start
    }

    /// Unstuff the frame that begins at `start`; return the end of its stuffed bytes and its payload's length.
    fn unstuff(&mut self, start: usize) -> Option<(usize, usize)> {
        let (mut position, mut length) = (start, 0);
        let mut size: Option<usize> = None;
        while position < self.fill {
            let code = self.chunk[position] as usize;
            let block = self.chunk[position..self.fill].get(1..code)?;
            let end = length + block.len();
            let keys = WHITENING.get(length..end)?;
            for ((out, byte), key) in self.body[length..end].iter_mut().zip(block).zip(keys) {
                *out = byte ^ key;
            }
            length = end;
            position += code;
            if size.is_none() && length >= HEADER {
                size = Some(self.compute_expected_size()?);
            }
            if let Some(size) = size {
                if length >= size {
                    let is_frame = length == size && self.is_crc_correct(size);
                    return is_frame.then(|| (position, size - HEADER - CRC));
                }
            }
            if code != 0xFF {
                *self.body.get_mut(length)? = WHITENING[length]; // the zero between two blocks
                length += 1;
            }
        }
        None
    }

    /// Return the size of the body that begins with this header; None if no frame has this length.
    ///
    /// A newer sender may use types and lengths that this version does not define.
    fn compute_expected_size(&self) -> Option<usize> {
        let length = u16::from_le_bytes([self.body[3], self.body[4]]) as usize;
        (length <= PAYLOAD_MAX as usize).then(|| HEADER + length + CRC)
    }

    /// Return whether the CRC of the body is correct.
    fn is_crc_correct(&self, size: usize) -> bool {
        let (content, crc) = self.body[..size].split_at(size - CRC);
        crc32(content, 0).to_le_bytes() == crc
    }

    /// Return the frame type if this version defines it with this length, address and number of taxels.
    fn find_type(&self, code: u8, payload: &[u8]) -> Option<FrameType> {
        let rule = find_rule(code).filter(|_| self.directions.accepts(code))?;
        if payload.len() < rule.minimum || payload.len() > rule.maximum {
            return None;
        }
        if rule.has_address && !(ADDRESS_MIN..=ADDRESS_MAX).contains(&(payload[0] as u32)) {
            return None;
        }
        let snapshot = (SNAPSHOT_OVERHEAD as usize) + 2 * payload.get(1).map_or(0, |&count| count as usize);
        let is_complete = rule.frame_type != FrameType::Taxels || payload.len() == TaxelHeader::SIZE + snapshot;
        is_complete.then(|| rule.frame_type)
    }
}
