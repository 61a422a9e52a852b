//! A mutant of a seed.
//!
//! **Input** a seed, another of the same reader, and a stream of random numbers. **Output** [`Mutant`].
//! **Steps** 1. one file and one part of it; 2. one to four changes: bits and bytes, numbers of headers, binary or
//! written out, truncation, insertion, deletion, blocks swapped or repeated, a splice with the other seed; 3. a part
//! that was packed is packed again, so that its checksum is right; one time in four its packed bytes are changed
//! instead.
//! **Guarantees** a function of its arguments; a part grows by at most [`MAX_GROWTH`].

use std::io::Write as _;

use espalier_geom::random::Stream;
use flate2::Compression;
use flate2::write::{DeflateEncoder, GzEncoder, ZlibEncoder};

use super::{Mutant, Packing, Part, Seed, SeedFile};

/// The most bytes that one change adds: deep enough a nesting to overflow the stack of a reader that recurses.
pub(super) const MAX_GROWTH: usize = 1 << 17;
/// Half of all changes are made in this many bytes, where headers are.
const HEADER_BYTES: usize = 540;

/// Numbers at the borders of types.
const NUMBERS: [u64; 14] = [
    0,
    1,
    2,
    7,
    0x7F,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFF_FFFF,
    0xFFFF_FFFF,
    0x7FFF_FFFF_FFFF_FFFF,
    u64::MAX,
    // NaN and infinity of both precisions.
    0x7FC0_0000,
    0x7FF0_0000_0000_0000,
];

/// The same where numbers are written out.
const WORDS: [&str; 24] = [
    "0",
    "1",
    "-1",
    "-0",
    "2",
    "3",
    "255",
    "32768",
    "65536",
    "4294967296",
    "2147483647",
    "-2147483648",
    "18446744073709551616",
    "99999999999999999999999",
    "1e999",
    "-1e308",
    "1e-320",
    "0.1",
    "nan",
    "inf",
    "0x10",
    "",
    "true",
    "1,5",
];

/// What nests.
const OPENERS: [&[u8]; 8] = [b"[", b"{", b"(", b"<a>", b"{\"a\":", b"[[", b"\"", b"#"];

/// A mutant of `seed`.
pub(super) fn mutate(seed: &Seed, other: &Seed, stream: &mut Stream) -> Mutant {
    let chosen = stream.below(seed.files.len() as u32) as usize;
    let donor = &other.files[stream.below(other.files.len() as u32) as usize];
    let files = seed.files.iter().enumerate().map(|(index, file)| {
        let bytes = if index == chosen { changed(file, donor, stream) } else { packed_file(file) };
        (file.name, bytes)
    });
    Mutant { files: files.collect() }
}

/// The bytes of a file with one part changed.
fn changed(file: &SeedFile, donor: &SeedFile, stream: &mut Stream) -> Vec<u8> {
    let chosen = stream.below(file.parts.len() as u32) as usize;
    let donor = &donor.parts[stream.below(donor.parts.len() as u32) as usize].plain;
    let is_inside = stream.below(4) > 0;
    let bytes = file.parts.iter().enumerate().map(|(index, part)| match (index == chosen, is_inside) {
        (false, _) => packed(part),
        (true, true) => packed(&Part { plain: edited(&part.plain, donor, stream), ..part.clone() }),
        (true, false) => edited(&packed(part), donor, stream),
    });
    bytes.collect::<Vec<_>>().concat()
}

fn packed_file(file: &SeedFile) -> Vec<u8> {
    file.parts.iter().map(packed).collect::<Vec<_>>().concat()
}

/// A part as it stands in its file. Writing to memory does not fail.
pub(super) fn packed(part: &Part) -> Vec<u8> {
    let (level, plain) = (Compression::fast(), part.plain.as_slice());
    match part.packing {
        Packing::Plain => Some(plain.to_vec()),
        Packing::Gzip => {
            let mut encoder = GzEncoder::new(Vec::new(), level);
            encoder.write_all(plain).and_then(|()| encoder.finish()).ok()
        }
        Packing::Deflate => {
            let mut encoder = DeflateEncoder::new(Vec::new(), level);
            encoder.write_all(plain).and_then(|()| encoder.finish()).ok()
        }
        Packing::Bzip2 => {
            let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
            encoder.write_all(plain).and_then(|()| encoder.finish()).ok()
        }
        Packing::VtkZlib => {
            let mut encoder = ZlibEncoder::new(Vec::new(), level);
            encoder.write_all(plain).and_then(|()| encoder.finish()).ok().map(|block| {
                let table = [1, plain.len(), 0, block.len()].map(|n| (n as u32).to_le_bytes());
                [table.concat(), block].concat()
            })
        }
    }
    .unwrap_or_default()
}

/// One to four changes.
fn edited(bytes: &[u8], donor: &[u8], stream: &mut Stream) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..1 + stream.below(4) {
        edit(&mut bytes, donor, stream);
    }
    bytes
}

fn edit(bytes: &mut Vec<u8>, donor: &[u8], stream: &mut Stream) {
    let at = place(bytes, stream);
    let block = at..(at + 1 + stream.below(64) as usize).min(bytes.len());
    match stream.below(16) {
        0 | 1 => change_byte(bytes, at, |byte| byte ^ (1 << (at % 8))),
        2 => change_byte(bytes, at, |_| [0, 0xFF, 0x7F, 0x80, b'\n', b'-'][at % 6]),
        3 => {
            let random = stream.next_u32() as u8;
            change_byte(bytes, at, |_| random);
        }
        4 | 5 => binary_number(bytes, at, stream),
        6..9 => written_number(bytes, at, stream),
        9 => bytes.truncate(at),
        10 => {
            let random: Vec<u8> = (0..1 + stream.below(16)).map(|_| stream.next_u32() as u8).collect();
            insert(bytes, at, &random);
        }
        11 => drop(bytes.drain(block)),
        12 => swap_blocks(bytes, at, stream),
        13 => {
            let piece = bytes[block].to_vec();
            repeat(bytes, at, &piece, stream);
        }
        14 => repeat(bytes, at, OPENERS[stream.below(8) as usize], stream),
        _ => {
            let from = place(donor, stream);
            bytes.truncate(at);
            bytes.extend_from_slice(&donor[from..]);
        }
    }
}

/// A place in bytes: any, or one of the first.
fn place(bytes: &[u8], stream: &mut Stream) -> usize {
    let reach = if stream.below(2) == 0 { bytes.len().min(HEADER_BYTES) } else { bytes.len() };
    stream.below(reach as u32) as usize
}

fn change_byte(bytes: &mut [u8], at: usize, change: impl Fn(u8) -> u8) {
    if let Some(byte) = bytes.get_mut(at) {
        *byte = change(*byte);
    }
}

/// A number of a border, of 1 to 8 bytes, in either byte order, at a multiple of its length or not.
fn binary_number(bytes: &mut [u8], at: usize, stream: &mut Stream) {
    let n_bytes = 1 << stream.below(4);
    let number = NUMBERS[stream.below(NUMBERS.len() as u32) as usize];
    let start = if stream.below(4) > 0 { at / n_bytes * n_bytes } else { at };
    let mut lowest = number.to_le_bytes()[..n_bytes].to_vec();
    if stream.below(2) == 0 {
        lowest.reverse();
    }
    bytes.iter_mut().skip(start).zip(lowest).for_each(|(byte, new)| *byte = new);
}

/// The next number that is written out, another one.
fn written_number(bytes: &mut Vec<u8>, at: usize, stream: &mut Stream) {
    let is_of_number = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+' | b'e');
    let Some(start) = bytes[at.min(bytes.len())..].iter().position(u8::is_ascii_digit).map(|n| n + at) else {
        return;
    };
    let end = bytes[start..].iter().position(|byte| !is_of_number(byte)).map_or(bytes.len(), |n| n + start);
    let word = WORDS[stream.below(WORDS.len() as u32) as usize];
    bytes.splice(start..end, word.bytes());
}

fn insert(bytes: &mut Vec<u8>, at: usize, piece: &[u8]) {
    bytes.splice(at..at, piece.iter().copied());
}

/// A piece inserted many times over, mostly few.
fn repeat(bytes: &mut Vec<u8>, at: usize, piece: &[u8], stream: &mut Stream) {
    let most = [2, 2, 16, 16, 256, MAX_GROWTH as u32][stream.below(6) as usize];
    let n_times = (1 + stream.below(most) as usize).min(MAX_GROWTH / piece.len().max(1));
    insert(bytes, at, &piece.repeat(n_times));
}

fn swap_blocks(bytes: &mut [u8], at: usize, stream: &mut Stream) {
    let other = place(bytes, stream);
    let (first, second) = (at.min(other), at.max(other));
    let n_bytes = (1 + stream.below(32) as usize).min(second - first).min(bytes.len() - second);
    for i in 0..n_bytes {
        bytes.swap(first + i, second + i);
    }
}

/// A seed as it is.
pub(super) fn unchanged(seed: &Seed) -> Mutant {
    Mutant { files: seed.files.iter().map(|file| (file.name, packed_file(file))).collect() }
}
