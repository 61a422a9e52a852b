//! The types of stored numbers that are read, whatever the format.

/// A type of stored numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scalar {
    U8,
    I8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes for one number in the file.
    pub(crate) fn file_bytes(self) -> u64 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Bytes for one number in memory: signed bytes are widened to 16 bits.
    pub(crate) fn memory_bytes(self) -> u64 {
        if self == Self::I8 { 2 } else { self.file_bytes() }
    }
}
