//! The bytes of an array in a VTK XML file.
//!
//! **Input** what stands in the file: base 64 or bytes; the words of the block header have 32 or 64 bits. **Output** the
//! array's bytes.
//! **Steps** 1. base 64, of which several padded pieces may follow each other; 2. without a compressor: the number of
//! bytes, and the bytes; 3. with zlib: the number of blocks, their length, that of the last one, the compressed length
//! of each, and the blocks.
//! **Guarantees** an array is as long as the caller expects, so that what is made is bounded before it is made.

use std::io::Read as _;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use flate2::read::ZlibDecoder;

use crate::bytes::from_lowest;

/// How a file writes its arrays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Encoding {
    pub(super) is_big_endian: bool,
    /// 4 or 8.
    pub(super) word_bytes: usize,
    pub(super) is_compressed: bool,
}

/// The bytes that base 64 stands for, up to the first `=` run after which nothing follows.
pub(super) fn from_base64(text: &[u8]) -> Result<Vec<u8>, &'static str> {
    let letters: Vec<u8> = text.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).collect();
    let mut bytes = Vec::with_capacity(letters.len() / 4 * 3);
    // A piece ends with its padding, or with the text.
    for piece in letters.split_inclusive(|&byte| byte == b'=') {
        if piece == b"=" {
            continue;
        }
        let piece = piece.strip_suffix(b"=").unwrap_or(piece);
        let padding = [b'='; 3];
        let padded = [piece, &padding[..(4 - piece.len() % 4) % 4]].concat();
        BASE64_STANDARD.decode_vec(padded, &mut bytes).map_err(|_| "it is no base 64")?;
    }
    Ok(bytes)
}

/// The `expected` bytes of an array.
pub(super) fn block(bytes: &[u8], encoding: Encoding, expected: usize) -> Result<Vec<u8>, &'static str> {
    let mut rest = bytes;
    let first = word(&mut rest, encoding)?;
    if !encoding.is_compressed {
        return match rest.get(..expected) {
            Some(array) if first == expected as u64 => Ok(array.to_vec()),
            _ => Err("it is not as long as its points need"),
        };
    }
    if first == 0 && expected == 0 {
        return Ok(Vec::new());
    }
    let (block_bytes, last_bytes) = (word(&mut rest, encoding)?, word(&mut rest, encoding)?);
    let n_blocks = usize::try_from(first).ok().filter(|&n| n <= rest.len() / encoding.word_bytes);
    let n_blocks = n_blocks.ok_or("it declares more blocks than it can hold")?;
    let lengths: Vec<u64> = (0..n_blocks).map(|_| word(&mut rest, encoding)).collect::<Result<_, _>>()?;
    let n_full = if last_bytes > 0 { n_blocks.saturating_sub(1) } else { n_blocks };
    let declared = block_bytes.saturating_mul(n_full as u64).saturating_add(last_bytes);
    if declared != expected as u64 {
        return Err("it is not as long as its points need");
    }
    let mut array = Vec::new();
    for length in lengths {
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let (packed, after) = rest.split_at_checked(length).ok_or("it is cut short")?;
        rest = after;
        let limit = (expected - array.len()) as u64;
        ZlibDecoder::new(packed)
            .take(limit + 1)
            .read_to_end(&mut array)
            .map_err(|_| "its zlib stream is damaged")?;
        if array.len() > expected {
            return Err("its zlib stream is longer than declared");
        }
    }
    if array.len() == expected { Ok(array) } else { Err("its zlib stream is shorter than declared") }
}

fn word(bytes: &mut &[u8], encoding: Encoding) -> Result<u64, &'static str> {
    let (word, rest) = bytes.split_at_checked(encoding.word_bytes).ok_or("it is cut short")?;
    *bytes = rest;
    let mut little = [0_u8; 8];
    little[..word.len()].copy_from_slice(word);
    if encoding.is_big_endian {
        little[..word.len()].reverse();
    }
    Ok(u64::from_le_bytes(little))
}

/// The numbers in an array's bytes; none for a type that is not known.
pub(super) fn numbers(bytes: &[u8], scalar: &str, is_big_endian: bool) -> Option<Vec<f64>> {
    macro_rules! as_type {
        ($number:ty) => {
            bytes
                .as_chunks::<{ size_of::<$number>() }>()
                .0
                .iter()
                .map(|&number| <$number>::from_le_bytes(from_lowest(number, is_big_endian)) as f64)
                .collect()
        };
    }
    Some(match scalar {
        "Int8" => as_type!(i8),
        "UInt8" => as_type!(u8),
        "Int16" => as_type!(i16),
        "UInt16" => as_type!(u16),
        "Int32" => as_type!(i32),
        "UInt32" => as_type!(u32),
        "Int64" => as_type!(i64),
        "UInt64" => as_type!(u64),
        "Float32" => as_type!(f32),
        "Float64" => bytes
            .as_chunks::<8>()
            .0
            .iter()
            .map(|&number| f64::from_le_bytes(from_lowest(number, is_big_endian)))
            .collect(),
        _ => return None,
    })
}

/// Bytes of one number of a type; none for a type that is not known.
pub(super) fn scalar_bytes(scalar: &str) -> Option<usize> {
    Some(match scalar {
        "Int8" | "UInt8" => 1,
        "Int16" | "UInt16" => 2,
        "Int32" | "UInt32" | "Float32" => 4,
        "Int64" | "UInt64" | "Float64" => 8,
        _ => return None,
    })
}
