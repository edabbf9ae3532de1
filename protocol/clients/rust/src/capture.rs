//! Capture files: bytes of a wire with their arrival times (SPEC.md, part 4). The caller has the file in memory.

const MAGIC: &[u8] = b"TAXELCAP";
const VERSION: u16 = 1;
const START_SIZE: usize = 16;
const HEAD_SIZE: usize = 12;

/// Reason why a file is no capture, or no complete one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CaptureError {
    /// The file does not begin with TAXELCAP.
    NoCapture,
    /// The file has another version of the format; this crate reads version 1.
    Version(u16),
    /// The length of the header is impossible.
    Header,
    /// The file ends inside a record; the records before are complete.
    Truncated,
}

impl core::fmt::Display for CaptureError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NoCapture => write!(formatter, "is not a taxel capture (it does not begin with TAXELCAP)"),
            Self::Version(version) => {
                write!(formatter, "is a capture of version {}; this program reads version {}", version, VERSION)
            }
            Self::Header => write!(formatter, "has a damaged header (its length is impossible)"),
            Self::Truncated => write!(formatter, "ends inside a record; the records before are complete"),
        }
    }
}

/// Bytes that arrived in one piece, and the time of their arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaptureRecord<'a> {
    pub time_ns: u64,
    pub bytes: &'a [u8],
}

/// Iterator over the records of a capture file.
#[derive(Clone, Debug)]
pub struct CaptureReader<'a> {
    header: &'a [u8],
    rest: &'a [u8],
}

impl<'a> CaptureReader<'a> {
    /// Create a reader of the content of a file.
    pub fn new(content: &'a [u8]) -> Result<Self, CaptureError> {
        if content.len() < START_SIZE || !content.starts_with(MAGIC) {
            return Err(CaptureError::NoCapture);
        }
        let version = u16::from_le_bytes([content[8], content[9]]);
        if version != VERSION {
            return Err(CaptureError::Version(version));
        }
        let size = u32::from_le_bytes([content[12], content[13], content[14], content[15]]) as usize;
        let rest = &content[START_SIZE..];
        if size > rest.len() {
            return Err(CaptureError::Header);
        }
        let (header, rest) = rest.split_at(size);
        Ok(Self { header, rest })
    }

    /// Return the header of the file, a JSON object in UTF-8.
    pub fn header(&self) -> &'a [u8] {
        self.header
    }

    /// Split the remaining bytes into the next record and the bytes after it; None if the record is incomplete.
    fn split_record(&self) -> Option<(CaptureRecord<'a>, &'a [u8])> {
        let head = self.rest.get(..HEAD_SIZE)?;
        let mut time = [0; 8];
        time.copy_from_slice(&head[..8]);
        let size = u32::from_le_bytes([head[8], head[9], head[10], head[11]]) as usize;
        let bytes = self.rest[HEAD_SIZE..].get(..size)?;
        let record = CaptureRecord { time_ns: u64::from_le_bytes(time), bytes };
        Some((record, &self.rest[HEAD_SIZE + size..]))
    }
}

impl<'a> Iterator for CaptureReader<'a> {
    type Item = Result<CaptureRecord<'a>, CaptureError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        match self.split_record() {
            Some((record, rest)) => {
                self.rest = rest;
                Some(Ok(record))
            }
            None => {
                self.rest = &[];
                Some(Err(CaptureError::Truncated))
            }
        }
    }
}
