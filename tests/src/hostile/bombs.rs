//! Small files that claim or unpack to much.
//!
//! **Output** files with the code of the error that each must give under 1 GiB.

use std::io::{Read as _, Write};

use flate2::Compression;
use flate2::write::{DeflateEncoder, GzEncoder, ZlibEncoder};

use super::{dicom_seeds, seeds};

/// An input that must be refused.
pub struct Bomb {
    /// What is wrong with it.
    pub name: &'static str,
    /// The code of the error.
    pub code: &'static str,
    /// Its files.
    pub files: Vec<BombFile>,
    /// What it would take in memory if it were what it says, where that is allowed.
    pub legal_bytes: usize,
}

/// A file, which may end in a hole.
pub struct BombFile {
    /// Its name.
    pub name: &'static str,
    /// How it begins.
    pub bytes: Vec<u8>,
    /// How many zeros follow.
    pub n_zeros: u64,
}

/// Zeros that unpack from little.
const N_UNPACKED: u64 = 160 << 20;

/// Volumes.
#[must_use]
pub fn volumes() -> Vec<Bomb> {
    let nifti = |extent: i16| {
        let mut bytes = seeds::nifti_1(false, false);
        bytes[42..48].copy_from_slice(&[extent; 3].map(i16::to_le_bytes).concat());
        bytes
    };
    // 825 voxels a side take more than 1 GiB, and the file is large enough to hold them.
    let stored = GzEncoder::new(Vec::new(), Compression::none());
    let more = packed(stored, &nifti(825), 2 << 20, GzEncoder::finish);
    let skipping = nrrd("512 512 512", "gzip", "byte skip: -1\n");
    // A little more than the voxels, of which the checksum is wrong.
    let skipped =
        packed(GzEncoder::new(skipping, Compression::fast()), &[], (128 << 20) + 4096, GzEncoder::finish);
    let cut = bzip2::write::BzEncoder::new(nrrd("900 900 900", "bzip2", ""), bzip2::Compression::fast());
    let mut bombs = vec![
        one("more than allowed", "E-VOLUME-TOO-LARGE", "a.nii.gz", more),
        one("more than it can hold", "E-VOLUME-TRUNCATED", "a.nii.gz", gzip(&nifti(i16::MAX), 0)),
        one("zeros behind the voxels", "E-VOLUME-TRAILING", "a.nii.gz", gzip(&nifti(8), N_UNPACKED)),
        one(
            "no end of a header",
            "E-VOLUME-HEADER",
            "a.nrrd",
            [b"NRRD0005\n".to_vec(), vec![b'#'; 5 << 20]].concat(),
        ),
        Bomb {
            legal_bytes: 128 << 20,
            ..one("a damaged checksum", "E-VOLUME-CORRUPT", "a.nrrd", damaged(skipped))
        },
        Bomb {
            legal_bytes: 900 * 900 * 900,
            ..one(
                "bzip2 that is cut",
                "E-VOLUME-TRUNCATED",
                "a.nrrd",
                packed(cut, &[], 4 << 20, |bz| bz.finish()),
            )
        },
    ];
    bombs.extend(series());
    bombs
}

fn one(name: &'static str, code: &'static str, file: &'static str, bytes: Vec<u8>) -> Bomb {
    Bomb { name, code, files: vec![BombFile { name: file, bytes, n_zeros: 0 }], legal_bytes: 0 }
}

fn nrrd(sizes: &str, encoding: &str, more: &str) -> Vec<u8> {
    let header = format!(
        "NRRD0005\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: {sizes}\nspace directions: \
         (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: {encoding}\n{more}\n"
    );
    header.into_bytes()
}

/// With another checksum of gzip.
fn damaged(mut bytes: Vec<u8>) -> Vec<u8> {
    let at = bytes.len() - 6;
    bytes[at] ^= 1;
    bytes
}

/// Series of two slices.
fn series() -> Vec<Bomb> {
    let explicit = "1.2.840.10008.1.2.1";
    let (a, b) = (dicom_seeds::data_set_of(0.0), dicom_seeds::data_set_of(2.5));
    // The first element has eight bytes and its text.
    let first = &a[..8 + usize::from(a[6])];
    let long = |length: u32| [first, &element(0x0009, 0x1010, length)].concat();
    let deflater = DeflateEncoder::new(dicom_seeds::start("1.2.840.10008.1.2.1.99"), Compression::fast());
    let deflated = packed(deflater, &long(N_UNPACKED as u32), N_UNPACKED, DeflateEncoder::finish);
    let of = |name, code, bytes: [Vec<u8>; 2], n_zeros: u64| {
        let mut names = ["a.dcm", "b.dcm"].into_iter();
        let files = bytes.map(|bytes| BombFile { name: names.next().unwrap_or_default(), bytes, n_zeros });
        Bomb { name, code, files: files.into(), legal_bytes: 0 }
    };
    let twice = |bytes: Vec<u8>| [bytes.clone(), bytes];
    let begun = |data_set: Vec<u8>| [dicom_seeds::start(explicit), data_set].concat();
    // A small image in fragments, of which the first has 150 MB.
    let in_fragments = |data_set: &[u8]| {
        let pixels = data_set.windows(4).rposition(|four| four == dicom_seeds::PIXELS).unwrap_or(0);
        let item = |length: u32| [vec![0xFE, 0xFF, 0x00, 0xE0], length.to_le_bytes().to_vec()].concat();
        let start = dicom_seeds::start("1.2.840.10008.1.2.5");
        [&start, &data_set[..pixels], &element(0x7FE0, 0x0010, u32::MAX), &item(0), &item(150 << 20)].concat()
    };
    vec![
        of("a deflated header without an end", "E-DICOM-DAMAGED", twice(deflated), 0),
        of("a header that is a hole", "E-DICOM-DAMAGED", twice(begun(long(N_UNPACKED as u32))), 200 << 20),
        of("a length beyond the file", "E-DICOM-DAMAGED", twice(begun(long(0xFFFF_FFF0))), 0),
        of(
            "a fragment larger than its image",
            "E-DICOM-PIXELS",
            [&a, &b].map(|d| in_fragments(d)),
            160 << 20,
        ),
    ]
}

/// The beginning of an explicit element of bytes.
fn element(group: u16, number: u16, length: u32) -> Vec<u8> {
    [&group.to_le_bytes()[..], &number.to_le_bytes(), b"OB\0\0", &length.to_le_bytes()].concat()
}

/// Bytes and zeros through an encoder. To memory, so that nothing fails.
fn packed<W: Write>(
    mut encoder: W,
    bytes: &[u8],
    n_zeros: u64,
    finish: impl Fn(W) -> std::io::Result<Vec<u8>>,
) -> Vec<u8> {
    let written = encoder
        .write_all(bytes)
        .and_then(|()| std::io::copy(&mut std::io::repeat(0).take(n_zeros), &mut encoder));
    written.and_then(|_| finish(encoder)).unwrap_or_default()
}

fn gzip(bytes: &[u8], n_zeros: u64) -> Vec<u8> {
    packed(GzEncoder::new(Vec::new(), Compression::fast()), bytes, n_zeros, GzEncoder::finish)
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).unwrap_or_default()
}

/// Files of lines.
#[must_use]
pub fn polylines() -> Vec<(&'static str, Vec<u8>)> {
    let n_points = 300_000;
    let block = zlib(&vec![0; 12 * n_points]);
    let table = [1, 12 * n_points, 0, block.len()].map(|n| (n as u32).to_le_bytes()).concat();
    let piece = format!(
        "<Piece NumberOfPoints=\"{n_points}\"><Points><DataArray type=\"Float32\" format=\"appended\" offset=\"0\"/>\
         </Points></Piece>"
    );
    let head = "<VTKFile type=\"PolyData\" compressor=\"vtkZLibDataCompressor\"><PolyData>";
    let tail = "</PolyData><AppendedData encoding=\"raw\">_";
    let shared = [
        head.as_bytes(),
        piece.repeat(200).as_bytes(),
        tail.as_bytes(),
        &table,
        &block,
        b"</AppendedData></VTKFile>",
    ]
    .concat();
    let nodes = format!("<VTKFile type=\"PolyData\">{}</VTKFile>", "<a/>".repeat(600_000));
    let cells = format!(
        "# vtk DataFile Version 3.0\nSPACE=RAS\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\nLINES 900000 900000\n{}",
        "0 ".repeat(900_000)
    );
    let words = format!(
        "# vtk DataFile Version 3.0\nSPACE=RAS\nASCII\nDATASET POLYDATA\nPOINTS 330000 float\n{}",
        "0 ".repeat(990_000)
    );
    let bytes = [
        b"# vtk DataFile Version 3.0\nSPACE=RAS\nBINARY\nDATASET POLYDATA\nPOINT_DATA 1900000\nSCALARS a char\n".to_vec(),
        vec![0; 1_900_001],
    ]
    .concat();
    vec![
        ("pieces that share a block", shared),
        ("elements", nodes.into_bytes()),
        ("empty lines", cells.into_bytes()),
        ("short numbers", words.into_bytes()),
        ("bytes as numbers", bytes),
    ]
}
