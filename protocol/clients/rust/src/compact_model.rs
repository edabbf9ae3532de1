//! Prediction of the count of a taxel: the model of the compact coding (SPEC.md, "Coding of compact snapshots"). Integers
//! and rounding are part of the protocol.

use crate::protocol::*;

pub const COUNT_MAX: u32 = 0xFFFF;
const MIDDLE: u32 = COMPACT_ESCAPE + COMPACT_CUMULATIVE[(COMPACT_REACH >> COMPACT_STEP_BITS) as usize] as u32;
const LAST_CORNER: u32 = (COMPACT_REACH >> COMPACT_STEP_BITS) - 1;

/// State of one taxel: the predicted count in 64ths, and the logarithm of the expected spread; 22 and 10 bits of a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taxel(u32);

impl Taxel {
    pub const EMPTY: Self = Self(0);

    /// Create the state of a taxel; mean in 64ths of a count.
    pub fn new(mean: u32, level: u32) -> Self {
        Self(mean << COMPACT_LEVEL_BITS | level)
    }

    /// Return the state after a packed key frame. `start`: bits 5 and 6 of its format.
    pub fn start(count: u16, start: u32) -> Self {
        Self::new((count as u32) << COMPACT_FRACTION_BITS, COMPACT_LEVEL_START + COMPACT_LEVEL_START_STEP * start)
    }

    /// Return the predicted count in 64ths.
    pub fn mean(self) -> u32 {
        self.0 >> COMPACT_LEVEL_BITS
    }

    /// Return the logarithm of the expected spread.
    pub fn level(self) -> u32 {
        self.0 & COMPACT_LEVEL_MAX
    }

    /// Return the predicted count.
    pub fn centre(self) -> u32 {
        ((self.mean() + 32) >> COMPACT_FRACTION_BITS).min(COUNT_MAX)
    }

    /// Return the octave of the scale; it has eight steps.
    fn octave(self) -> u32 {
        self.level() >> 6
    }

    /// Return the factor of the scale's step within its octave.
    fn multiplier(self) -> u32 {
        COMPACT_MULTIPLIERS[(self.level() >> 3 & 7) as usize] as u32
    }

    /// Return the number of low bits of a count that are sent uncoded.
    pub fn raw_bits(self) -> u32 {
        self.octave().saturating_sub(COMPACT_COARSE_OCTAVE)
    }

    /// Convert a magnitude in 64ths of a count to 1024ths of the scale.
    fn distance(self, difference: u32) -> u32 {
        (difference * self.multiplier()) >> self.octave()
    }

    /// Return the probability of all counts below `symbol` (a count without its raw bits) and of the escape, in 2^-16.
    pub fn cumulative(self, symbol: u32) -> u32 {
        let edge = symbol << (self.raw_bits() + COMPACT_FRACTION_BITS);
        let from = self.mean() + 32;
        let size = self.distance(if edge < from { from - edge } else { edge - from }).min(COMPACT_REACH);
        let corner = (size >> COMPACT_STEP_BITS) as usize;
        let fraction = size & ((1 << COMPACT_STEP_BITS) - 1);
        let mut share = COMPACT_CUMULATIVE[corner] as u32;
        if fraction != 0 {
            share += ((COMPACT_CUMULATIVE[corner + 1] as u32 - share) * fraction) >> COMPACT_STEP_BITS;
        }
        if edge < from {
            MIDDLE - share
        } else {
            MIDDLE + share
        }
    }

    /// Return a symbol at or below the symbol of the probability `target`, at most a few symbols away: the end of the
    /// segment of the cumulative table that contains the target.
    pub fn find_first_symbol(self, target: u32) -> u32 {
        let shift = self.raw_bits() + COMPACT_FRACTION_BITS;
        let step = COMPACT_STEP_BITS + self.octave();
        let from = self.mean() + 32;
        let edge = if target >= MIDDLE {
            from + (find_corner(target - MIDDLE) << step) / self.multiplier()
        } else {
            let corner = find_corner(MIDDLE - target - 1) + 1;
            from.saturating_sub(((corner << step) + self.multiplier() - 1) / self.multiplier())
        };
        (edge >> shift).min(COUNT_MAX >> self.raw_bits())
    }

    /// Return the state after one more key frame. `gain`: weight of the new count, in 256ths.
    pub fn update(self, count: u16, gain: u32) -> Self {
        let centre = self.centre() as i64;
        let residual = count as i64 - centre;
        let size = quantise(residual.unsigned_abs() as u32) as i64;
        let difference = 64 * (centre + if residual < 0 { -size } else { size }) - self.mean() as i64;
        let magnitude = difference.unsigned_abs() as u32;
        let scales = self.distance(magnitude);
        if scales >= COMPACT_JUMP {
            return Self::new(move_limited(self.mean(), difference < 0, magnitude, COMPACT_MEAN_MAX), self.level());
        }
        let spread = (scales.min(COMPACT_CLIP) * COMPACT_MEAN_DEVIATION) >> 10;
        let excess = if spread < COMPACT_UNIT { COMPACT_UNIT - spread } else { spread - COMPACT_UNIT };
        let step = (excess * gain * COMPACT_LEVEL_STEP + (1 << 17)) >> 18;
        let level = move_limited(self.level(), spread < COMPACT_UNIT, step, COMPACT_LEVEL_MAX);
        Self::new(move_limited(self.mean(), difference < 0, (magnitude * gain + 128) >> 8, COMPACT_MEAN_MAX), level)
    }
}

/// Return the largest corner of the cumulative table with at most this share.
fn find_corner(share: u32) -> u32 {
    let corners = &COMPACT_CUMULATIVE[1..=LAST_CORNER as usize];
    corners.partition_point(|&corner| corner as u32 <= share) as u32
}

/// Round the difference between count and centre as a board stores it in one byte: exact below 64, else the middle of
/// its quarter of an octave.
fn quantise(size: u32) -> u32 {
    if size < 64 {
        return size;
    }
    let low_bits = 29 - size.leading_zeros();
    (size >> low_bits << low_bits) + (1 << low_bits >> 1)
}

/// Return `value` moved down or up, limited to 0 to `largest`.
fn move_limited(value: u32, is_down: bool, step: u32, largest: u32) -> u32 {
    if is_down {
        value.saturating_sub(step)
    } else {
        value.saturating_add(step).min(largest)
    }
}
