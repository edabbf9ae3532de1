//! Decoder of the taxel protocol (`protocol/SPEC.md`): the bytes of a hub in, frames with raw counts and losses out.
//!
//! The crate uses neither the standard library nor a heap, and has no dependencies.
//!
//! ```
//! use taxel_client::{Decoder, Direction};
//!
//! let mut decoder = Decoder::<17>::new(Direction::TO_HOST); // at most 17 boards
//! let bytes = [0x00, 0x0D, 0x24, 0xA4, 0x9F, 0x85, 0x00];
//! decoder.push(&bytes, &mut |frame| {
//!     if let Some(taxels) = frame.taxels {
//!         let _counts: &[u16] = taxels.counts;
//!     }
//! });
//! assert_eq!(decoder.losses().lost, 0);
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod capture;
mod compact;
mod compact_model;
mod crc32;
mod decoder;
mod framing;
mod original;
#[rustfmt::skip]
mod original_formats;
#[rustfmt::skip]
pub mod protocol;

pub use capture::{CaptureError, CaptureReader, CaptureRecord};
pub use compact::{CompactAnswer, CompactReceiver, CompactResult};
pub use crc32::crc32;
pub use decoder::{BoardLosses, Decoder, Flags, Frame, Losses, TaxelData};
pub use framing::{encode_frame, find_rule, Deframer, Direction, RawFrame};
pub use original::{OriginalDecoder, OriginalMessage};
pub use original_formats::{OriginalFormat, ORIGINAL_FORMATS};
pub use protocol::{FrameType, Message, Value};
