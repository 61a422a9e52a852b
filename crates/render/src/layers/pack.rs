//! A block of an OpenEXR file, packed.
//!
//! **Input** samples, line by line, in a line channel by channel. **Output** the bytes of even places before those of odd
//! ones, as differences, deflated; what does not get smaller is stored as it is.
//! **Source** OpenEXR 2, ZIP compression.

use exr::meta::attribute::SampleType;
use exr::prelude::f16;
use flate2::{Compress, FlushCompress, Status};

/// Deflate's effort: from 1 to 3 the file shrinks by 8 to 20 % and takes twice as long, from 3 to 6 by 2 to 4 % and
/// twice as long again.
const LEVEL: u32 = 1;

/// The bytes of a block, those of even places apart from those of odd ones. A sample has as many of either.
pub(super) struct Halves {
    even: Vec<u8>,
    odd: Vec<u8>,
}

impl Halves {
    /// Room for so many bytes.
    pub(super) fn with_room(n_bytes: usize) -> Self {
        // The odd bytes come behind the even ones in the end.
        Self { even: Vec::with_capacity(n_bytes), odd: Vec::with_capacity(n_bytes / 2) }
    }

    /// Appends the samples of a line.
    pub(super) fn take(&mut self, values: &[f32], sample_type: SampleType) {
        let from = self.even.len();
        let n_bytes = from + values.len() * sample_type.bytes_per_sample() / 2;
        self.even.resize(n_bytes, 0);
        self.odd.resize(n_bytes, 0);
        let (even, odd) = (&mut self.even[from..], &mut self.odd[from..]);
        if sample_type == SampleType::F16 {
            for ((value, even), odd) in values.iter().zip(even).zip(odd) {
                [*even, *odd] = f16::from_f32(*value).to_le_bytes();
            }
        } else {
            let pairs = even.chunks_exact_mut(2).zip(odd.chunks_exact_mut(2));
            for (value, (even, odd)) in values.iter().zip(pairs) {
                let [a, b, c, d] = value.to_le_bytes();
                even.copy_from_slice(&[a, c]);
                odd.copy_from_slice(&[b, d]);
            }
        }
    }

    /// The block as OpenEXR stores it.
    pub(super) fn packed(self) -> Vec<u8> {
        let Self { even: mut bytes, odd } = self;
        bytes.extend(&odd);
        let mut differences = bytes.clone();
        for (byte, before) in differences.iter_mut().skip(1).zip(&bytes) {
            *byte = byte.wrapping_sub(*before).wrapping_add(128);
        }
        let plain = || bytes.iter().zip(&odd).flat_map(|(even, odd)| [*even, *odd]).collect();
        deflate(&differences).unwrap_or_else(plain)
    }
}

/// A zlib stream; `None` if it would be larger than the bytes themselves.
fn deflate(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut packed = Vec::with_capacity(bytes.len());
    let mut packer = Compress::new(flate2::Compression::new(LEVEL), true);
    let status = packer.compress_vec(bytes, &mut packed, FlushCompress::Finish);
    packed.shrink_to_fit();
    matches!(status, Ok(Status::StreamEnd)).then_some(packed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_split_and_its_bytes_become_differences() {
        let mut halves = Halves::with_room(64);
        halves.take(&[1.0; 64], SampleType::F32);
        halves.take(&[2.0; 64], SampleType::F16);
        // 1.0 is 00 00 80 3f, 2.0 is 00 40.
        assert_eq!(halves.even[..4], [0x00, 0x80, 0x00, 0x80]);
        assert_eq!(halves.odd[..4], [0x00, 0x3f, 0x00, 0x3f]);
        assert_eq!((halves.even[128], halves.odd[128]), (0x00, 0x40));
        let bytes = [halves.even.clone(), halves.odd.clone()].concat();
        let mut plain = vec![0; bytes.len()];
        let mut unpacker = flate2::Decompress::new(true);
        unpacker
            .decompress(&halves.packed(), &mut plain, flate2::FlushDecompress::Finish)
            .expect("a zlib stream");
        for i in 1..plain.len() {
            plain[i] = plain[i].wrapping_add(plain[i - 1]).wrapping_sub(128);
        }
        assert_eq!(plain, bytes);
    }

    #[test]
    fn what_does_not_get_smaller_is_stored_as_it_is() {
        let mut halves = Halves::with_room(2);
        halves.take(&[1.5, -2.25], SampleType::F32);
        let plain: Vec<u8> = [1.5_f32, -2.25].iter().flat_map(|value| value.to_le_bytes()).collect();
        assert_eq!(halves.packed(), plain);
    }
}
