//! DICOM series of three slices in every way of writing that can be made here.

#[path = "../../../crates/volume/tests/slices/mod.rs"]
mod slices;

use super::{Packing, Part, Seed, SeedFile};
use slices::{Slice, stack};

const NAMES: [&str; 3] = ["a.dcm", "b.dcm", "c.dcm"];
const HEIGHTS: [f64; 3] = [0.0, 2.5, 5.0];
/// The tag of the pixels.
pub(super) const PIXELS: [u8; 4] = [0xE0, 0x7F, 0x10, 0x00];
/// The preamble, the letters, and the transfer syntax up to its text.
const SYNTAX_AT: usize = 128 + 4 + 8;

/// What writes the data set of a slice.
type Write = fn(&Slice) -> Vec<u8>;

/// The series, each in a syntax of its own.
pub(super) fn series() -> Vec<Seed> {
    let syntaxes: [(&str, Write); 5] = [
        ("1.2.840.10008.1.2.1", data_set),
        ("1.2.840.10008.1.2", |slice| written_as(slice, false)),
        ("1.2.840.10008.1.2.2", |slice| written_as(slice, true)),
        ("1.2.840.10008.1.2.5", |slice| in_fragments(slice, &run_lengths(slice))),
        ("1.2.840.10008.1.2.4.80", |slice| in_fragments(slice, &jpeg_ls(slice))),
    ];
    let mut seeds: Vec<Seed> = syntaxes.map(|(uid, write)| seed(uid, write, Packing::Plain)).to_vec();
    seeds.push(seed("1.2.840.10008.1.2.1.99", data_set, Packing::Deflate));
    seeds
}

fn seed(uid: &str, write: Write, packing: Packing) -> Seed {
    let start = start(uid);
    let file = |(name, slice): (&'static str, &Slice)| SeedFile {
        name,
        parts: vec![Part::new(start.clone(), Packing::Plain), Part::new(write(slice), packing)],
    };
    Seed::of(NAMES.into_iter().zip(&stack(&HEIGHTS)).map(file).collect())
}

/// What stands before a data set of a transfer syntax.
pub(super) fn start(uid: &str) -> Vec<u8> {
    let mut start = [vec![0; 128], b"DICM".to_vec()].concat();
    start.extend(slices::element(0x0002_0010, "UI", uid.as_bytes().to_vec()));
    start
}

/// The data set of a slice at a height.
pub(super) fn data_set_of(height_mm: f64) -> Vec<u8> {
    data_set(&Slice::at(height_mm))
}

/// The elements behind the meta group, which has one.
fn data_set(slice: &Slice) -> Vec<u8> {
    let bytes = slice.bytes();
    let length = usize::from(u16::from_le_bytes([bytes[SYNTAX_AT - 2], bytes[SYNTAX_AT - 1]]));
    bytes[SYNTAX_AT + length..].to_vec()
}

/// The elements of a data set: tag, representation, value.
fn elements(slice: &Slice) -> Vec<([u16; 2], [u8; 2], Vec<u8>)> {
    let (bytes, mut at, mut found) = (data_set(slice), 0, Vec::new());
    let short = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
    while at + 8 <= bytes.len() {
        let representation = [bytes[at + 4], bytes[at + 5]];
        let (length, start) = if representation == *b"OW" {
            (usize::from(short(at + 8)) | usize::from(short(at + 10)) << 16, at + 12)
        } else {
            (usize::from(short(at + 6)), at + 8)
        };
        found.push(([short(at), short(at + 2)], representation, bytes[start..start + length].to_vec()));
        at = start + length;
    }
    found
}

/// Implicit and little-endian, or explicit and big-endian.
fn written_as(slice: &Slice, is_big_endian: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (tag, representation, mut value) in elements(slice) {
        let is_long = representation == *b"OW";
        if !is_big_endian {
            bytes.extend(tag.map(u16::to_le_bytes).concat());
            bytes.extend((value.len() as u32).to_le_bytes());
            bytes.extend(value);
            continue;
        }
        bytes.extend(tag.map(u16::to_be_bytes).concat());
        bytes.extend(representation);
        match is_long {
            true => bytes.extend([&[0, 0], (value.len() as u32).to_be_bytes().as_slice()].concat()),
            false => bytes.extend((value.len() as u16).to_be_bytes()),
        }
        if is_long || representation == *b"US" {
            value.as_chunks_mut::<2>().0.iter_mut().for_each(|pair| pair.reverse());
        }
        bytes.extend(value);
    }
    bytes
}

/// The data set with its pixels in one fragment behind an empty table of offsets.
fn in_fragments(slice: &Slice, stream: &[u8]) -> Vec<u8> {
    let mut bytes = data_set(slice);
    let start = bytes.windows(4).rposition(|four| four == PIXELS).unwrap_or(bytes.len());
    bytes.truncate(start);
    let item = |length: u32| [vec![0xFE, 0xFF, 0x00, 0xE0], length.to_le_bytes().to_vec()].concat();
    let padding = vec![0; stream.len() % 2];
    bytes.extend(
        [PIXELS.as_slice(), b"OB\0\0", &[0xFF; 4], &item(0), &item((stream.len() + padding.len()) as u32)]
            .concat(),
    );
    bytes.extend([stream, &padding, &[0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0]].concat());
    bytes
}

/// Two segments of literal stretches: the high bytes, then the low ones.
fn run_lengths(slice: &Slice) -> Vec<u8> {
    let segment = |shift: u32| {
        let bytes: Vec<u8> = slice.values.iter().map(|value| (value >> shift) as u8).collect();
        bytes.chunks(128).flat_map(|part| [&[part.len() as u8 - 1], part].concat()).collect::<Vec<u8>>()
    };
    let (high, low) = (segment(8), segment(0));
    let mut table = [0_u32; 16];
    table[..3].copy_from_slice(&[2, 64, 64 + high.len() as u32]);
    [table.map(u32::to_le_bytes).concat(), high, low].concat()
}

fn jpeg_ls(slice: &Slice) -> Vec<u8> {
    let pixels: Vec<u16> = slice.values.iter().map(|value| value.cast_unsigned()).collect();
    let [width, height] = slice.size.map(u32::from);
    let mut stream = Vec::new();
    // To memory.
    let _ = jpegls::encode(&pixels, width, height, &mut stream);
    stream
}
