//! CRC-32 of IEEE 802.3, four bytes at a time (slicing; Kounavis and Berry, 2005). The tables take 4 KiB.

const SLICES: usize = 4;

/// Compute the tables: `tables[k][b]` is the remainder of byte b and k zero bytes.
const fn make_tables() -> [[u32; 256]; SLICES] {
    let mut tables = [[0u32; 256]; SLICES];
    let mut byte = 0;
    while byte < 256 {
        let mut remainder = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            remainder = (remainder >> 1) ^ if remainder & 1 != 0 { 0xEDB8_8320 } else { 0 };
            bit += 1;
        }
        tables[0][byte] = remainder;
        byte += 1;
    }
    let mut slice = 1;
    while slice < SLICES {
        byte = 0;
        while byte < 256 {
            let before = tables[slice - 1][byte];
            tables[slice][byte] = (before >> 8) ^ tables[0][(before & 0xFF) as usize];
            byte += 1;
        }
        slice += 1;
    }
    tables
}

static TABLES: [[u32; 256]; SLICES] = make_tables();

/// Compute the CRC-32 of the bytes. `crc`: CRC-32 of the bytes before them, 0 at the start.
pub fn crc32(bytes: &[u8], crc: u32) -> u32 {
    let mut state = !crc;
    let mut steps = bytes.chunks_exact(SLICES);
    for step in &mut steps {
        let word = state ^ u32::from_le_bytes([step[0], step[1], step[2], step[3]]);
        state = TABLES[3][(word & 0xFF) as usize]
            ^ TABLES[2][(word >> 8 & 0xFF) as usize]
            ^ TABLES[1][(word >> 16 & 0xFF) as usize]
            ^ TABLES[0][(word >> 24) as usize];
    }
    for &byte in steps.remainder() {
        state = (state >> 8) ^ TABLES[0][((state ^ byte as u32) & 0xFF) as usize];
    }
    !state
}
