//! Hostile inputs made by the thousand: seeds that we write, mutants of them, and every reader that meets them.
//!
//! | step | file |
//! |---|---|
//! | well-formed files of every format, made here | `seeds`, `dicom_seeds`, `run_seeds` |
//! | a mutant of a seed | `mutate` |
//! | what reads it | `readers` |
//! | small files that unpack to much | [`bombs`] |
//! | many mutants of a reader, watched | [`campaign`] |
//!
//! **Input** a reader, a seed number and the index of a mutant. **Output** accepted, or the code of the error; how long
//! it took and how much memory at its peak.
//! **Guarantees** a mutant is a function of (reader, seed number, index): [`campaign::mutant`] makes it again.

pub mod bombs;
pub mod campaign;
mod dicom_seeds;
mod mutate;
mod readers;
mod run_seeds;
mod seeds;

pub use readers::{Reader, readers};

/// What a fuzzer calls: `bytes` as the first file of a reader's input.
///
/// # Panics
/// Where the reader does, and for a name that no reader has.
#[allow(clippy::expect_used, reason = "this is how a fuzz target speaks")]
pub fn fuzz(name: &str, bytes: &[u8]) {
    thread_local! {
        static READERS: Vec<Reader> = readers();
    }
    READERS.with(|readers| {
        let reader = readers.iter().find(|reader| reader.name == name).expect("a reader");
        let way = bytes.iter().fold(0, |way: u32, &byte| way.wrapping_mul(31).wrapping_add(byte.into()));
        drop(reader.read(&reader.with_first(bytes), way));
    });
}

/// A well-formed input: its files.
#[derive(Clone, Debug)]
pub struct Seed {
    files: Vec<SeedFile>,
}

/// A file of a seed: its name, and its parts one after another.
#[derive(Clone, Debug)]
struct SeedFile {
    name: &'static str,
    parts: Vec<Part>,
}

/// Bytes of a file as they are before they are packed.
#[derive(Clone, Debug)]
struct Part {
    plain: Vec<u8>,
    packing: Packing,
}

/// How a part stands in its file. What is packed after it was changed is whole again: no checksum gives it away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    Plain,
    Gzip,
    Bzip2,
    Deflate,
    /// A block of a VTK file: its table of lengths, and zlib.
    VtkZlib,
}

impl Seed {
    /// One file as it is.
    fn plain(name: &'static str, bytes: impl Into<Vec<u8>>) -> Self {
        Self::of(vec![SeedFile::plain(name, bytes)])
    }

    fn of(files: Vec<SeedFile>) -> Self {
        Self { files }
    }
}

impl SeedFile {
    fn plain(name: &'static str, bytes: impl Into<Vec<u8>>) -> Self {
        Self { name, parts: vec![Part::new(bytes, Packing::Plain)] }
    }
}

impl Part {
    fn new(plain: impl Into<Vec<u8>>, packing: Packing) -> Self {
        Self { plain: plain.into(), packing }
    }
}

/// A changed input: its files as they would lie on the disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mutant {
    /// Names and bytes.
    pub files: Vec<(&'static str, Vec<u8>)>,
}
