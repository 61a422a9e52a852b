//! The order of the bytes of a number in a file.

/// The bytes of a number from the lowest, as `from_le_bytes` takes them, whichever way the file has them.
///
/// ```
/// use espalier_model::bytes::from_lowest;
/// assert_eq!(u16::from_le_bytes(from_lowest([1, 2], true)), 258);
/// ```
#[must_use]
pub fn from_lowest<const N: usize>(mut bytes: [u8; N], is_big_endian: bool) -> [u8; N] {
    if is_big_endian {
        bytes.reverse();
    }
    bytes
}
