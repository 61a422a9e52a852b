//! The bytes of a file, decompressed where it is compressed, counted and bounded.
//!
//! **Input** a path. **Output** a stream from which exact numbers of bytes are taken.
//! **Guarantees** whether a file is compressed is decided by its content, never by its name. Nothing is held but
//! one buffer. A stream that ends early is an error with both counts; one that goes on is read only so far.
//! **Cost** one pass.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

use crate::ReadError;

/// No byte of a deflate stream stands for more than this many: RFC 1951 has matches of at most 258 bytes in at
/// least 2 bits.
const MAX_RATIO: u64 = 1032;
const BUFFER_BYTES: usize = 1 << 16;
/// How far damage is looked for.
const MAX_DAMAGE_BYTES: u64 = 64 << 20;

/// A stream of decompressed bytes.
pub(crate) struct Source {
    reader: Box<dyn Read + Send>,
    is_compressed: bool,
    /// The most bytes that can come.
    max_bytes: u64,
    /// How many have come.
    position: u64,
    /// How many the file should have, as far as is known.
    expected: u64,
}

impl Source {
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        let metadata = std::fs::metadata(path)?;
        if !metadata.is_file() {
            let what = if metadata.is_dir() { "a folder" } else { "a device or pipe" };
            return Err(ReadError::NotAFile { what });
        }
        let mut file = BufReader::with_capacity(BUFFER_BYTES, File::open(path)?);
        let start = file.fill_buf()?;
        if start.is_empty() {
            return Err(ReadError::Empty);
        }
        let is_compressed = start.starts_with(&[0x1F, 0x8B]);
        let (reader, max_bytes): (Box<dyn Read + Send>, u64) = if is_compressed {
            (Box::new(MultiGzDecoder::new(file)), metadata.len().saturating_mul(MAX_RATIO))
        } else {
            (Box::new(file), metadata.len())
        };
        Ok(Self { reader, is_compressed, max_bytes, position: 0, expected: 0 })
    }

    /// States how many bytes the file should have; refused if it cannot have as many.
    pub(crate) fn expect(&mut self, n_bytes: u64) -> Result<(), ReadError> {
        self.expected = n_bytes;
        match (n_bytes <= self.max_bytes, self.is_compressed) {
            (true, _) => Ok(()),
            (false, false) => Err(self.truncated(self.max_bytes)),
            (false, true) => Err(ReadError::Overdeclared { expected: n_bytes, at_most: self.max_bytes }),
        }
    }

    /// The damage of the compressed data behind a header that makes no sense, where there is any.
    pub(crate) fn damage(&mut self) -> Option<ReadError> {
        if !self.is_compressed {
            return None;
        }
        self.drain(MAX_DAMAGE_BYTES).err().filter(|error| matches!(error, ReadError::Corrupt { .. }))
    }

    fn truncated(&self, found: u64) -> ReadError {
        ReadError::Truncated { expected: self.expected, found, is_compressed: self.is_compressed }
    }

    /// Fills the buffer.
    pub(crate) fn take(&mut self, buffer: &mut [u8]) -> Result<(), ReadError> {
        let mut n_filled = 0;
        while n_filled < buffer.len() {
            match self.read(&mut buffer[n_filled..])? {
                0 => return Err(self.truncated(self.position)),
                n_read => n_filled += n_read,
            }
        }
        Ok(())
    }

    /// Passes over so many bytes.
    pub(crate) fn skip(&mut self, n_bytes: u64) -> Result<(), ReadError> {
        let mut buffer = [0_u8; 8192];
        let mut n_left = n_bytes;
        while n_left > 0 {
            let n_wanted = n_left.min(buffer.len() as u64) as usize;
            self.take(&mut buffer[..n_wanted])?;
            n_left -= n_wanted as u64;
        }
        Ok(())
    }

    /// Reads to the end, so that the checksum is verified, and tells how many bytes there were. More than
    /// `limit` are refused.
    pub(crate) fn drain(&mut self, limit: u64) -> Result<u64, ReadError> {
        let mut buffer = [0_u8; 8192];
        let mut n_drained = 0;
        loop {
            match self.read(&mut buffer)? as u64 {
                0 => return Ok(n_drained),
                n_read => n_drained += n_read,
            }
            if n_drained > limit {
                return Err(ReadError::Trailing { limit });
            }
        }
    }

    /// One read, with the errors of the decompressor told apart from those of the disk.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ReadError> {
        loop {
            match self.reader.read(buffer) {
                Ok(n_read) => {
                    self.position += n_read as u64;
                    return Ok(n_read);
                }
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted => {}
                    ErrorKind::UnexpectedEof if self.is_compressed => {
                        return Err(self.truncated(self.position));
                    }
                    ErrorKind::InvalidInput | ErrorKind::InvalidData if self.is_compressed => {
                        return Err(ReadError::Corrupt { position: self.position, cause: error.to_string() });
                    }
                    _ => return Err(ReadError::Io(error)),
                },
            }
        }
    }
}
