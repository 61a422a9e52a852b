//! Headers of text, line by line, bounded.
//!
//! **Input** a stream. **Output** lines without their ends; numbers and lists in them.
//! **Guarantees** no more than [`MAX_HEADER_BYTES`] are read for a header; the stream then stands behind the line's
//! end. Bytes that are no UTF-8 are replaced, never refused: they stand in comments.

use crate::ReadError;
use crate::source::Source;

/// More than the segment tables that 3D Slicer writes into its headers; few headers have a thousandth.
const MAX_HEADER_BYTES: usize = 1 << 22;

/// The lines of a header.
pub(crate) struct Lines<'a> {
    source: &'a mut Source,
    n_bytes: usize,
}

impl<'a> Lines<'a> {
    pub(crate) fn of(source: &'a mut Source) -> Self {
        Self { source, n_bytes: 0 }
    }

    /// The next line, ended by `\n` or `\r\n` or the end of the file; none at the end.
    pub(crate) fn next(&mut self) -> Result<Option<String>, ReadError> {
        let mut line = Vec::new();
        let mut byte = [0_u8];
        loop {
            if self.source.read(&mut byte)? == 0 {
                if line.is_empty() {
                    return Ok(None);
                }
                break;
            }
            self.n_bytes += 1;
            if self.n_bytes > MAX_HEADER_BYTES {
                return Err(ReadError::Header { limit: MAX_HEADER_BYTES });
            }
            if byte[0] == b'\n' {
                break;
            }
            line.push(byte[0]);
        }
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        Ok(Some(String::from_utf8_lossy(&line).into_owned()))
    }
}

/// A list of numbers, parted by white space.
pub(crate) fn numbers<T: std::str::FromStr>(text: &str) -> Option<Vec<T>> {
    text.split_whitespace().map(|word| word.parse().ok()).collect()
}

/// Mm for a unit of length by its name; none for a name that is not known.
pub(crate) fn unit_mm(name: &str) -> Option<f64> {
    match name.trim().trim_matches('"').to_ascii_lowercase().as_str() {
        "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Some(1.0),
        "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" => Some(1e-3),
        "nm" | "nanometer" | "nanometers" => Some(1e-6),
        "cm" | "centimeter" | "centimeters" => Some(10.0),
        "m" | "meter" | "meters" => Some(1e3),
        _ => None,
    }
}
