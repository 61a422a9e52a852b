//! The bytes of a file, decompressed where it is compressed, counted and bounded.
//!
//! **Input** a path. **Output** a stream from which exact numbers of bytes are taken.
//! **Guarantees** whether a file is compressed is decided by its content, never by its name. Nothing is held but
//! the buffers. A stream that ends early is an error with both counts; one that goes on is read only so far.
//! **Cost** one pass.

use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, ErrorKind, Read};
use std::path::{Path, PathBuf};

use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::ZlibDecoder;

use crate::ReadError;
use crate::gzip::{self, GzipReader};

const BUFFER_BYTES: usize = 1 << 16;
/// How far damage is looked for.
const MAX_DAMAGE_BYTES: u64 = 64 << 20;

/// How bytes are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Packing {
    Gzip,
    Zlib,
    Bzip2,
}

impl Packing {
    /// No compressed byte stands for more than this many.
    fn max_ratio(self) -> u64 {
        match self {
            // RFC 1951 has matches of at most 258 bytes in at least 2 bits.
            Self::Gzip | Self::Zlib => 1032,
            // A block of 900,000 bytes, each fifth of which stands for up to 255 more, takes at least 32 bytes.
            Self::Bzip2 => 1 << 21,
        }
    }
}

/// A stream of decompressed bytes.
pub(crate) struct Source {
    reader: Box<dyn Read + Send>,
    /// Bytes that were looked at before they were taken, and how many of them have been taken.
    ahead: Cursor<Vec<u8>>,
    is_compressed: bool,
    /// The most bytes that can come.
    max_bytes: u64,
    /// How many have come.
    position: u64,
    /// How many the file should have, as far as is known.
    expected: u64,
    /// The file, where it is not the one that the user named.
    detached: Option<PathBuf>,
}

impl Source {
    /// Opens a file; one that begins like a gzip member is decompressed.
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        let mut source = Self::open_plain(path)?;
        match source.peek(gzip::MAGIC.len())? {
            [] => Err(ReadError::Empty),
            start if start == gzip::MAGIC => Ok(source.unpack(Packing::Gzip)),
            _ => Ok(source),
        }
    }

    /// Opens a file that another one names; its faults are told with its own path.
    pub(crate) fn open_detached(path: &Path) -> Result<Self, ReadError> {
        Self::detached(path, Self::open(path))
    }

    /// The same for its bytes as they are.
    pub(crate) fn open_detached_plain(path: &Path) -> Result<Self, ReadError> {
        Self::detached(path, Self::open_plain(path))
    }

    fn detached(path: &Path, opened: Result<Self, ReadError>) -> Result<Self, ReadError> {
        match opened {
            Ok(source) => Ok(Self { detached: Some(path.to_owned()), ..source }),
            Err(problem) => Err(ReadError::Detached { problem: Box::new(problem), path: path.to_owned() }),
        }
    }

    /// Opens a file for its bytes as they are.
    pub(crate) fn open_plain(path: &Path) -> Result<Self, ReadError> {
        let metadata = std::fs::metadata(path)?;
        if !metadata.is_file() {
            let what = if metadata.is_dir() { "a folder" } else { "a device or pipe" };
            return Err(ReadError::NotAFile { what });
        }
        let file = BufReader::with_capacity(BUFFER_BYTES, File::open(path)?);
        Ok(Self::over(Box::new(file), metadata.len(), false))
    }

    fn over(reader: Box<dyn Read + Send>, max_bytes: u64, is_compressed: bool) -> Self {
        Self {
            reader,
            ahead: Cursor::default(),
            is_compressed,
            max_bytes,
            position: 0,
            expected: 0,
            detached: None,
        }
    }

    /// The stream of what the rest of this one decompresses to.
    pub(crate) fn unpack(self, packing: Packing) -> Self {
        let n_left = self.max_bytes.saturating_sub(self.position);
        let rest: Box<dyn BufRead + Send> =
            Box::new(BufReader::with_capacity(BUFFER_BYTES, self.ahead.chain(self.reader)));
        let reader: Box<dyn Read + Send> = match packing {
            Packing::Gzip => Box::new(GzipReader::new(rest)),
            Packing::Zlib => Box::new(ZlibDecoder::new(rest)),
            Packing::Bzip2 => Box::new(MultiBzDecoder::new(rest)),
        };
        let unpacked = Self::over(reader, n_left.saturating_mul(packing.max_ratio()), true);
        Self { detached: self.detached, ..unpacked }
    }

    /// The next bytes without taking them; fewer where the stream ends.
    pub(crate) fn peek(&mut self, n_bytes: usize) -> Result<&[u8], ReadError> {
        let taken = self.ahead.position() as usize;
        while self.ahead.get_ref().len() - taken < n_bytes {
            let mut more = vec![0_u8; n_bytes - (self.ahead.get_ref().len() - taken)];
            match self.read_on(&mut more) {
                // What is cut short is told where it is missed.
                Err(error) if error.is_truncated() && self.ahead.get_ref().len() > taken => break,
                Err(error) => return Err(error),
                Ok(0) => break,
                Ok(n_read) => self.ahead.get_mut().extend_from_slice(&more[..n_read]),
            }
        }
        let ahead = &self.ahead.get_ref()[taken..];
        Ok(&ahead[..ahead.len().min(n_bytes)])
    }

    /// States how many bytes the stream should have in all; refused if it cannot have as many.
    pub(crate) fn expect(&mut self, n_bytes: u64) -> Result<(), ReadError> {
        self.expected = n_bytes;
        match (n_bytes <= self.max_bytes, self.is_compressed) {
            (true, _) => Ok(()),
            (false, false) => Err(self.truncated(self.max_bytes)),
            (false, true) => {
                Err(self.fault(ReadError::Overdeclared { expected: n_bytes, at_most: self.max_bytes }))
            }
        }
    }

    /// How many bytes have been taken.
    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    pub(crate) fn is_compressed(&self) -> bool {
        self.is_compressed
    }

    /// Whether another file named this one.
    pub(crate) fn is_detached(&self) -> bool {
        self.detached.is_some()
    }

    /// The files of a volume whose header is at `header` and whose voxels this stream has.
    pub(crate) fn files(&self, header: &Path) -> Vec<PathBuf> {
        std::iter::once(header.to_owned()).chain(self.detached.clone()).collect()
    }

    /// The most bytes that the stream can have in all; exact where it is not compressed.
    pub(crate) fn max_bytes(&self) -> u64 {
        self.max_bytes
    }

    /// The damage of the compressed data behind a header that makes no sense, where there is any.
    pub(crate) fn damage(&mut self) -> Option<ReadError> {
        if !self.is_compressed {
            return None;
        }
        self.drain(MAX_DAMAGE_BYTES)
            .err()
            .filter(|error| matches!(error.innermost(), ReadError::Corrupt { .. }))
    }

    pub(crate) fn truncated(&self, found: u64) -> ReadError {
        let is_compressed = self.is_compressed;
        self.fault(ReadError::Truncated { expected: self.expected, found, is_compressed })
    }

    /// A fault with the file's path where the user did not name it.
    fn fault(&self, problem: ReadError) -> ReadError {
        match &self.detached {
            Some(path) => ReadError::Detached { problem: Box::new(problem), path: path.clone() },
            None => problem,
        }
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
                return Err(self.fault(ReadError::Trailing { limit }));
            }
        }
    }

    /// Takes some bytes, none only at the end.
    pub(crate) fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ReadError> {
        // Reading from memory does not fail.
        let n_ahead = self.ahead.read(buffer).unwrap_or(0);
        let n_read = if n_ahead > 0 { n_ahead } else { self.read_on(buffer)? };
        self.position += n_read as u64;
        Ok(n_read)
    }

    /// One read behind what was looked at, with the errors of the decompressor told apart from those of the disk.
    fn read_on(&mut self, buffer: &mut [u8]) -> Result<usize, ReadError> {
        loop {
            match self.reader.read(buffer) {
                Ok(n_read) => return Ok(n_read),
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted => {}
                    ErrorKind::UnexpectedEof if self.is_compressed => {
                        return Err(self.truncated(self.position));
                    }
                    ErrorKind::InvalidInput | ErrorKind::InvalidData if self.is_compressed => {
                        let (position, cause) = (self.position, error.to_string());
                        return Err(self.fault(ReadError::Corrupt { position, cause }));
                    }
                    _ => return Err(self.fault(ReadError::Io(error))),
                },
            }
        }
    }
}
