//! Voxels written out as text.
//!
//! **Input** a stream of numbers parted by white space. **Output** a stream of their bytes, little-endian.
//! **Steps** 1. one word after the other; 2. each as a whole number, or for floats as a decimal one.
//! **Guarantees** a word is at most 64 letters; a number that the type cannot hold is an error with its place; the
//! checksum of compressed text is verified.

use std::io::Write as _;

use espalier_model::Report;

use crate::ReadError;
use crate::scalar::Scalar;
use crate::source::Source;
use crate::stored::{MAX_TRAILING_BYTES, VoxelStream};

/// No number that a program writes is longer.
const MAX_WORD_BYTES: usize = 64;

/// The bytes of numbers in a text.
pub(crate) struct AsciiStream {
    source: Source,
    scalar: Scalar,
    /// How many numbers there should be, and how many have come.
    n_declared: u64,
    n_numbers: u64,
    /// Bytes of a number that did not fit the buffer.
    left: Vec<u8>,
}

impl AsciiStream {
    /// The numbers from where `source` stands. `n_numbers` of them must fit what is left of the file.
    pub(crate) fn new(mut source: Source, scalar: Scalar, n_numbers: u64) -> Result<Self, ReadError> {
        // Each number but the last has at least one digit and one space.
        let shortest = source.position().saturating_add(n_numbers.saturating_mul(2) - 1);
        source.expect(shortest)?;
        Ok(Self { source, scalar, n_declared: n_numbers, n_numbers: 0, left: Vec::new() })
    }

    /// Passes over so many numbers.
    pub(crate) fn skip(&mut self, n_numbers: u64) -> Result<(), ReadError> {
        (0..n_numbers).try_for_each(|_| self.number().map(|_| ()))
    }

    /// The bytes of the next number.
    fn number(&mut self) -> Result<Vec<u8>, ReadError> {
        let mut word = Vec::with_capacity(MAX_WORD_BYTES);
        let mut byte = [0_u8];
        loop {
            let is_end = self.source.read(&mut byte)? == 0;
            match (is_end || byte[0].is_ascii_whitespace(), word.is_empty()) {
                (true, true) if is_end => return Err(self.source.truncated(self.source.position())),
                (true, true) => {}
                (true, false) => break,
                (false, _) if word.len() == MAX_WORD_BYTES => return Err(self.fault(&word)),
                (false, _) => word.push(byte[0]),
            }
        }
        let text = String::from_utf8_lossy(&word);
        let bytes = bytes_of(&text, self.scalar).ok_or_else(|| self.fault(&word))?;
        self.n_numbers += 1;
        Ok(bytes)
    }

    fn fault(&self, word: &[u8]) -> ReadError {
        let found = format!("{:?} as number {}", String::from_utf8_lossy(word), self.n_numbers);
        ReadError::Field { field: "data", found, expected: "numbers of the type that the header states" }
    }
}

fn bytes_of(text: &str, scalar: Scalar) -> Option<Vec<u8>> {
    macro_rules! as_type {
        ($number:ty) => {
            text.parse::<$number>().ok().map(|number| number.to_le_bytes().to_vec())
        };
    }
    match scalar {
        Scalar::U8 => as_type!(u8),
        Scalar::I8 => as_type!(i8),
        Scalar::I16 => as_type!(i16),
        Scalar::U16 => as_type!(u16),
        Scalar::I32 => as_type!(i32),
        Scalar::U32 => as_type!(u32),
        Scalar::I64 => as_type!(i64),
        Scalar::U64 => as_type!(u64),
        Scalar::F32 => as_type!(f32),
        Scalar::F64 => as_type!(f64),
    }
}

impl VoxelStream for AsciiStream {
    fn take(&mut self, mut buffer: &mut [u8]) -> Result<(), ReadError> {
        while !buffer.is_empty() {
            if self.left.is_empty() {
                self.left = self.number()?;
            }
            // Writing to memory does not fail.
            let n_written = buffer.write(&self.left).unwrap_or(0);
            self.left.drain(..n_written);
        }
        Ok(())
    }

    /// What follows the numbers is not looked at, for further volumes may; compressed text is read to its end, so that
    /// its checksum is verified.
    fn finish(&mut self, _report: &mut Report) -> Result<(), ReadError> {
        if self.source.is_compressed() {
            let n_left = self.n_declared.saturating_sub(self.n_numbers);
            let longest = n_left.saturating_mul(MAX_WORD_BYTES as u64 + 1);
            self.source.drain(longest.saturating_add(MAX_TRAILING_BYTES))?;
        }
        Ok(())
    }
}
