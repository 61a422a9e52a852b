//! The voxels that are wanted, straight from the file.
//!
//! **Input** a [`Stored`] whose stream stands at the first voxel. **Output** one bit a voxel; no volume is held.
//! **Steps** 1. some rows' bytes; 2. the numbers in them; 3. a bit for each, by a test of scaled values, or by a
//! comparison with the first value of all while the values are counted, for a volume that may be a mask; 4. the rest
//! of the file, so that its checksum is verified.
//! **Guarantees** the bits are those that reading the whole volume first would give.
//! **Cost** O(voxels) time; memory is the bits and a buffer of some rows. Stored numbers of 8 and 16 bits are tested
//! once for all.

use std::cell::Cell;

use espalier_model::{Bits, Report};

use crate::ReadError;
use crate::choose::pack_word;
use crate::decode::{number, warn_of_inexact, whole};
use crate::kind::Census;
use crate::scalar::Scalar;
use crate::stored::Stored;

/// Numbers that are read at a time: what stays in the second cache with the decompressor's window.
const N_AT_A_TIME: usize = 1 << 16;

/// The voxels with a scaled value that `is_wanted`.
pub(crate) fn choose(
    stored: &mut Stored,
    is_wanted: impl Fn(f64) -> bool,
    report: &mut Report,
) -> Result<Bits, ReadError> {
    let (slope, intercept) = (stored.slope, stored.intercept);
    let test = |number: f64| is_wanted(slope * number + intercept);
    pack(stored, &mut Chosen { test }, report)
}

/// The values of a volume that may be a mask, and its voxels that differ from the first value of all.
pub(crate) struct Inspected {
    pub(crate) census: Census,
    pub(crate) bits: Bits,
    /// The first value; NaN where there is none that is finite.
    pub(crate) first: f64,
    /// Whether the bits say all: every value is finite.
    pub(crate) is_exact: bool,
}

/// Counts the values, and tells the first from the others.
pub(crate) fn inspect(stored: &mut Stored, report: &mut Report) -> Result<Inspected, ReadError> {
    let mut counted = Counted {
        slope: stored.slope,
        intercept: stored.intercept,
        census: Census::default(),
        first: f64::NAN,
    };
    let bits = pack(stored, &mut counted, report)?;
    let Counted { census, first, .. } = counted;
    let is_exact = !census.has_other;
    Ok(Inspected { census, bits, first, is_exact })
}

/// A test of stored numbers.
trait Test {
    fn is_one(&mut self, number: f64) -> bool;
}

struct Chosen<F> {
    test: F,
}

impl<F: Fn(f64) -> bool> Test for Chosen<F> {
    fn is_one(&mut self, number: f64) -> bool {
        (self.test)(number)
    }
}

struct Counted {
    slope: f64,
    intercept: f64,
    census: Census,
    first: f64,
}

impl Test for Counted {
    fn is_one(&mut self, number: f64) -> bool {
        let value = self.slope * number + self.intercept;
        self.census.see(value);
        if self.first.is_nan() && value.is_finite() {
            self.first = value;
        }
        value != self.first
    }
}

/// One bit for each voxel, by a test of its stored number.
fn pack(stored: &mut Stored, test: &mut impl Test, report: &mut Report) -> Result<Bits, ReadError> {
    let n_inexact = Cell::new(0_usize);
    macro_rules! test_each {
        ($file_type:ty, $convert:expr) => {{
            let convert = $convert;
            pack_rows(stored, number!(stored, $file_type), |number| test.is_one(convert(number)))?
        }};
    }
    macro_rules! test_once {
        ($file_type:ty, $unsigned:ty) => {{
            let mut known = vec![None; usize::from(<$unsigned>::MAX) + 1];
            pack_rows(stored, number!(stored, $file_type), |number| {
                *known[usize::from(number as $unsigned)].get_or_insert_with(|| test.is_one(f64::from(number)))
            })?
        }};
    }
    let bits = match stored.scalar {
        Scalar::U8 => test_once!(u8, u8),
        Scalar::I8 => test_once!(i8, u8),
        Scalar::I16 => test_once!(i16, u16),
        Scalar::U16 => test_once!(u16, u16),
        Scalar::I32 => test_each!(i32, f64::from),
        Scalar::U32 => test_each!(u32, f64::from),
        Scalar::F32 => test_each!(f32, f64::from),
        Scalar::F64 => test_each!(f64, |number| number),
        Scalar::I64 => test_each!(i64, |v: i64| whole(v.unsigned_abs(), v as f64, &n_inexact)),
        Scalar::U64 => test_each!(u64, |v: u64| whole(v, v as f64, &n_inexact)),
    };
    warn_of_inexact(n_inexact.get(), report);
    stored.stream.finish(report)?;
    Ok(bits)
}

fn pack_rows<T: Copy + PartialEq, const N: usize>(
    stored: &mut Stored,
    from_bytes: impl Fn([u8; N]) -> T,
    mut test: impl FnMut(T) -> bool,
) -> Result<Bits, ReadError> {
    let nx = stored.shape[0];
    let mut bits = Bits::new(stored.shape);
    let (n_rows, words_per_row) = (bits.n_rows(), bits.words_per_row());
    // Some rows at a time, or a part of one long row that ends with a word.
    let (rows_at_a_time, part) = ((N_AT_A_TIME / nx).max(1), nx.min(N_AT_A_TIME));
    let mut bytes = vec![0_u8; N * part * rows_at_a_time.min(n_rows)];
    let mut numbers: Vec<T> = Vec::with_capacity(part);
    for rows in bits.words_mut().chunks_mut(words_per_row * rows_at_a_time) {
        let n_numbers = rows.len() / words_per_row * nx;
        let mut n_taken = 0;
        while n_taken < n_numbers {
            let n_now = (part * rows_at_a_time).min(n_numbers - n_taken);
            stored.stream.take(&mut bytes[..N * n_now])?;
            for (i, row) in bytes[..N * n_now].chunks(N * part).enumerate() {
                numbers.clear();
                numbers.extend(row.as_chunks::<N>().0.iter().map(|&number| from_bytes(number)));
                let first_word = i * words_per_row + (n_taken % nx) / 64;
                for (word, values) in rows[first_word..].iter_mut().zip(numbers.chunks(64)) {
                    *word = pack_word(values, &mut test);
                }
            }
            n_taken += n_now;
        }
    }
    Ok(bits)
}
