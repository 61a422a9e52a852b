//! The voxels whose value is wanted.
//!
//! **Input** a volume, and a test of values. **Output** one bit a voxel.
//! **Steps** stored numbers of 8 and 16 bits are tested once each, and looked up; 64 equal voxels are tested once.
//! **Guarantees** the test sees scaled values; the result does not depend on the number of threads.
//! **Cost** O(voxels) time; one bit a voxel.

use espalier_model::{Bits, Volume, Voxels};
use ndarray::Array3;
use rayon::prelude::*;

/// The voxels with a value that `is_wanted`.
pub(crate) fn choose(volume: &Volume, is_wanted: impl Fn(f64) -> bool + Sync) -> Bits {
    let (slope, intercept) = volume.scaling();
    let test = |stored: f64| is_wanted(slope * stored + intercept);
    match volume.voxels() {
        Voxels::U8(array) => {
            let table: Vec<bool> = (0..=u8::MAX).map(|stored| test(f64::from(stored))).collect();
            pack(array, |stored| table[usize::from(stored)])
        }
        Voxels::I16(array) => {
            let table: Vec<bool> = (0..=u16::MAX).map(|bits| test(f64::from(bits.cast_signed()))).collect();
            pack(array, |stored| table[usize::from(stored.cast_unsigned())])
        }
        Voxels::U16(array) => {
            let table: Vec<bool> = (0..=u16::MAX).map(|stored| test(f64::from(stored))).collect();
            pack(array, |stored| table[usize::from(stored)])
        }
        Voxels::I32(array) => pack(array, |stored| test(f64::from(stored))),
        Voxels::U32(array) => pack(array, |stored| test(f64::from(stored))),
        Voxels::F32(array) => pack(array, |stored| test(f64::from(stored))),
        Voxels::F64(array) => pack(array, test),
    }
}

fn pack<T: Copy + PartialEq + Sync>(array: &Array3<T>, test: impl Fn(T) -> bool + Sync) -> Bits {
    let (nz, ny, nx) = array.dim();
    let mut bits = Bits::new([nx, ny, nz]);
    let words_per_row = bits.words_per_row();
    // A volume's array is in standard layout, so there is a slice.
    let voxels = array.as_slice().unwrap_or_default();
    let slices = bits.words_mut().par_chunks_mut(words_per_row * ny);
    slices.zip(voxels.par_chunks(nx * ny)).for_each(|(words, voxels)| {
        for (words, row) in words.chunks_mut(words_per_row).zip(voxels.chunks(nx)) {
            for (word, values) in words.iter_mut().zip(row.chunks(64)) {
                *word = pack_word(values, &test);
            }
        }
    });
    bits
}

/// A bit for each of up to 64 values, the first lowest.
pub(crate) fn pack_word<T: Copy + PartialEq>(values: &[T], mut test: impl FnMut(T) -> bool) -> u64 {
    if let Ok(values) = <&[T; 64]>::try_from(values)
        && *values == [values[0]; 64]
    {
        return if test(values[0]) { u64::MAX } else { 0 };
    }
    values.iter().rev().fold(0, |word, &value| word << 1 | u64::from(test(value)))
}
