//! Run lengths: DICOM's own lossless compression.
//!
//! **Input** the fragments of one image. **Output** its cells. **Steps** 1. the table of segments, one for each byte
//! of a cell, the highest first; 2. each segment unpacked: runs and literal stretches.
//! **Guarantees** nothing is written beyond the declared number of pixels.
//! **Source** DICOM PS3.5 annex G.

use super::header::StoredPixels;

/// The table of segments: how many, and where each begins.
const TABLE_BYTES: usize = 64;

pub(super) fn decode(packed: &[u8], stored: &StoredPixels) -> Result<Vec<i32>, String> {
    let n_segments = (stored.bits_allocated / 8) as usize;
    let table = packed.get(..TABLE_BYTES).ok_or("its table of segments is cut short")?;
    let entry =
        |i: usize| u32::from_le_bytes([table[4 * i], table[4 * i + 1], table[4 * i + 2], table[4 * i + 3]]);
    if entry(0) as usize != n_segments {
        return Err(format!("{n_segments} segments expected, {} found", entry(0)));
    }
    let mut cells = vec![0_i32; stored.n_pixels()];
    for segment in 0..n_segments {
        let start = entry(segment + 1) as usize;
        let end = if segment + 1 < n_segments { entry(segment + 2) as usize } else { packed.len() };
        let bytes = packed.get(start..end).ok_or("a segment lies outside")?;
        unpack(bytes, &mut cells).ok_or("a segment is cut short")?;
    }
    Ok(cells)
}

/// Shifts the bytes of one segment into the cells from below.
fn unpack(mut bytes: &[u8], cells: &mut [i32]) -> Option<()> {
    let mut at = 0;
    while at < cells.len() {
        let (&control, rest) = bytes.split_first()?;
        let n_literal = usize::from(control) + 1;
        let n_run = 257 - usize::from(control);
        bytes = match control {
            0..128 => {
                let (literal, rest) = rest.split_at_checked(n_literal)?;
                for (cell, &byte) in cells[at..].iter_mut().zip(literal) {
                    *cell = *cell << 8 | i32::from(byte);
                }
                at += n_literal;
                rest
            }
            128 => rest,
            129.. => {
                let (&byte, rest) = rest.split_first()?;
                for cell in cells[at..].iter_mut().take(n_run) {
                    *cell = *cell << 8 | i32::from(byte);
                }
                at += n_run;
                rest
            }
        };
    }
    Some(())
}
