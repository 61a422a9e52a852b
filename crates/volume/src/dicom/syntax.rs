//! The transfer syntaxes: how the pixels of a file are written.

/// How pixels are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Syntax {
    /// As they are.
    Native { is_big_endian: bool },
    /// As they are, in a data set that is compressed whole.
    Deflated,
    /// Run lengths.
    Rle,
    /// JPEG, lossless or with 8 bits.
    Jpeg { is_lossless: bool },
    /// JPEG-LS.
    JpegLs { is_lossless: bool },
    /// JPEG 2000.
    Jpeg2000 { is_lossless: bool },
    /// One that is not read.
    Unknown { name: &'static str },
}

impl Syntax {
    /// The syntax of a UID, PS3.6 table A-1.
    pub(super) fn of_uid(uid: &str) -> Self {
        let Some(rest) = uid.strip_prefix("1.2.840.10008.1.2") else {
            return Self::Unknown { name: "a private one" };
        };
        match rest {
            "" | ".1" => Self::Native { is_big_endian: false },
            ".2" => Self::Native { is_big_endian: true },
            ".1.99" => Self::Deflated,
            ".5" => Self::Rle,
            ".4.50" | ".4.51" => Self::Jpeg { is_lossless: false },
            ".4.57" | ".4.70" => Self::Jpeg { is_lossless: true },
            ".4.80" => Self::JpegLs { is_lossless: true },
            ".4.81" => Self::JpegLs { is_lossless: false },
            ".4.90" => Self::Jpeg2000 { is_lossless: true },
            ".4.91" => Self::Jpeg2000 { is_lossless: false },
            ".4.92" | ".4.93" => Self::Unknown { name: "JPEG 2000 of several components" },
            ".4.94" | ".4.95" => Self::Unknown { name: "JPIP, pixels elsewhere" },
            ".4.110" | ".4.111" | ".4.112" => Self::Unknown { name: "JPEG XL" },
            ".4.201" | ".4.202" | ".4.203" => Self::Unknown { name: "high-throughput JPEG 2000" },
            _ if rest.starts_with(".4.10") => Self::Unknown { name: "a video" },
            _ if rest.starts_with(".4.") => Self::Unknown { name: "a retired kind of JPEG" },
            _ => Self::Unknown { name: "one that espalier does not know" },
        }
    }

    /// Whether the pixels stand in the data set as they are.
    pub(super) fn is_native(self) -> bool {
        matches!(self, Self::Native { .. } | Self::Deflated)
    }

    /// Whether something was lost in compression, now or before, as the header's field says.
    pub(super) fn is_lossy(self, field: Option<&str>) -> bool {
        match (self, field) {
            (_, Some("01")) => true,
            (Self::Jpeg { is_lossless: false } | Self::JpegLs { is_lossless: false }, _) => true,
            // This syntax allows lossless pixels too.
            (Self::Jpeg2000 { is_lossless: false }, field) => field != Some("00"),
            _ => false,
        }
    }
}
