//! Hostile bytes made here: mutants, damage, truncation, bombs. The files of others: `tests/expected.tsv`.
#![allow(clippy::expect_used, clippy::panic, reason = "this is how a test speaks")]

mod common;

use std::path::Path;

use common::outcome;
use espalier_geom::random::{Purpose, Stream};
use espalier_volume::{Error, Params, ReadError, ReadOptions, open_pieces, read, read_mask};

/// Enough for every legal file of the data, too little for the bombs.
const OPTIONS: ReadOptions = ReadOptions {
    max_bytes: 16 << 20,
    volume_index: None,
    assume_space: None,
    unit_mm: None,
    strict: false,
    series: None,
    resample: false,
};

fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder for temporary files")
}

#[test]
fn missing_folder_empty() {
    let folder = scratch();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("empty.nii.gz"), b"").expect("writable");
    assert_eq!(outcome(&path("none.nii"), &OPTIONS), "E-VOLUME-IO 74");
    // A folder is taken for one of DICOM slices.
    assert_eq!(outcome(folder.path(), &OPTIONS), "E-DICOM-NONE 3");
    assert_eq!(outcome(&path("empty.nii.gz"), &OPTIONS), "E-VOLUME-EMPTY-FILE 3");
}

/// A small valid file: 9x8x7 16-bit numbers, 4x3 in the low bits.
fn small_file() -> Vec<u8> {
    use espalier_model::{Grid, Volume, Voxels, nifti_out};
    let grid =
        Grid::axis_aligned([9, 8, 7], glam::DVec3::new(0.5, 0.5, 2.0), glam::DVec3::ZERO).expect("legal");
    let values = (0..9 * 8 * 7).map(|i: i32| (i * 37 % 1500 - 1000) as i16).collect();
    let array = ndarray::Array3::from_shape_vec((7, 8, 9), values).expect("as many as voxels");
    nifti_out::volume(&Volume::new(grid, Voxels::I16(array), 1.0, 0.0)).expect("fits")
}

fn decompressed(bytes: &[u8]) -> Vec<u8> {
    let mut plain = Vec::new();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(bytes), &mut plain).expect("a gzip file");
    plain
}

/// The same numbers as text headers with raw, compressed and written-out data.
fn text_files() -> [(&'static str, Vec<u8>); 5] {
    let plain = decompressed(&small_file());
    let raw = &plain[352..];
    let written = raw.as_chunks::<2>().0.iter().map(|&pair| i16::from_le_bytes(pair).to_string());
    let written = written.collect::<Vec<_>>().join(" ").into_bytes();
    let packed = |zlib: bool| {
        let (level, mut packed) = (flate2::Compression::fast(), Vec::new());
        let mut gz = flate2::read::GzEncoder::new(raw, level);
        let mut zl = flate2::read::ZlibEncoder::new(raw, level);
        let source: &mut dyn std::io::Read = if zlib { &mut zl } else { &mut gz };
        source.read_to_end(&mut packed).expect("to memory");
        packed
    };
    let nrrd = |encoding: &str, data: &[u8]| {
        let header = format!(
            "NRRD0005\n# a comment\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 9 8 7\n\
             space directions: (0.5,0,0) (0,0.5,0) (0,0,2)\nkinds: domain domain domain\nendian: little\n\
             encoding: {encoding}\nspace origin: (1,2,3)\nkey:=value\n\n"
        );
        [header.as_bytes(), data].concat()
    };
    let meta = |is_compressed: &str, data: &[u8]| {
        let header = format!(
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nCompressedData = {is_compressed}\n\
             TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\nElementSpacing = 0.5 0.5 2\nDimSize = 9 8 7\n\
             ElementType = MET_SHORT\nElementDataFile = LOCAL\n"
        );
        [header.as_bytes(), data].concat()
    };
    [
        ("raw.nrrd", nrrd("raw", raw)),
        ("packed.nrrd", nrrd("gzip", &packed(false))),
        ("written.nrrd", nrrd("ascii", &written)),
        ("raw.mha", meta("False", raw)),
        ("packed.mha", meta("True", &packed(true))),
    ]
}

/// Text headers say the same as a binary one.
#[test]
fn formats_agree() {
    let folder = scratch();
    let expected = decompressed(&small_file())[352..].to_vec();
    for (name, bytes) in text_files() {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("writable");
        let loaded = read(&path, &OPTIONS).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(loaded.volume.grid().orientation(), "LPS", "{name}");
        assert_eq!(loaded.volume.grid().world_from_voxel().translation, glam::DVec3::new(-1.0, -2.0, 3.0));
        let bytes: Vec<u8> =
            loaded.volume.map_values(|v| (v as i16).to_le_bytes()).into_iter().flatten().collect();
        assert_eq!(bytes, expected, "{name}");
        assert!(loaded.report.warnings.is_empty(), "{name}: {:?}", loaded.report.warnings);
    }
}

/// Hundreds of mutants of a file of each kind: none may panic, and none may yield more than the limit.
#[test]
fn mutants_never_panic() {
    let folder = scratch();
    let compressed = small_file();
    let plain = decompressed(&compressed);
    let options = ReadOptions { max_bytes: 1 << 20, ..OPTIONS };
    let mut stream = Stream::new(11, Purpose::Test, 0, 0);
    let (mut n_read, mut n_refused) = (0, 0);
    let binary = [("plain.nii", plain), ("packed.nii.gz", compressed)];
    for (name, original) in binary.into_iter().chain(text_files()) {
        let path = folder.path().join(name);
        for _ in 0..400 {
            let mutant = mutate(&original, &mut stream);
            std::fs::write(&path, &mutant).expect("writable");
            let streamed = read_mask(&path, &options, &Params::default());
            let whole = read(&path, &options);
            let pieces = values_by_piece(&path, &options).map_err(|error| error.to_string());
            let values = whole.as_ref().map(|loaded| loaded.volume.map_values(f64::to_bits));
            assert_eq!(pieces, values.map_err(Error::to_string), "by piece and at once");
            match whole {
                Ok(loaded) => {
                    n_read += 1;
                    assert!(!matches!(streamed, Err(Error::Read { .. })), "read whole, but not as a mask");
                    assert!(loaded.volume.grid().n_voxels() <= 1 << 20);
                }
                Err(Error::Read { problem, .. }) => {
                    n_refused += 1;
                    assert!(!matches!(problem, ReadError::Io(_)), "{problem} is no fault of the disk");
                }
                Err(error) => panic!("{error}"),
            }
        }
    }
    assert!(
        n_read > 100 && n_refused > 100,
        "{n_read} read, {n_refused} refused: too one-sided to test much"
    );
}

/// The values of a volume by piece, each in its place; as bits, so that one that is not a number equals itself. What is
/// larger than the limit is read all the same, as nothing of it is held.
fn values_by_piece(path: &Path, options: &ReadOptions) -> Result<Vec<u64>, Error> {
    let pieces = open_pieces(path, options)?;
    let n_voxels = pieces.grid().n_voxels();
    let mut values = Vec::new();
    pieces.for_each(|start, piece| {
        assert_eq!(start, values.len(), "in order");
        values.extend(piece.iter().map(|value| value.to_bits()));
    })?;
    assert_eq!(values.len(), n_voxels, "all of them");
    Ok(values)
}

/// Up to four changes: bytes set at random (mostly in the header) or to extremes, a piece cut out, the end cut.
fn mutate(original: &[u8], stream: &mut Stream) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for _ in 0..1 + stream.below(4) {
        let n_bytes = bytes.len() as u32;
        let at =
            if stream.below(4) > 0 { stream.below(n_bytes.min(352)) } else { stream.below(n_bytes) } as usize;
        match stream.below(8) {
            0 => bytes.truncate((at + 300).min(bytes.len())),
            1 => drop(bytes.drain(at..(at + 3).min(n_bytes as usize))),
            2 => bytes[at] = 0xFF,
            3 => bytes[at] = 0x7F,
            4 => bytes[at] = 0,
            _ => bytes[at] = stream.next_u32() as u8,
        }
        if bytes.len() < 2 {
            break;
        }
    }
    bytes
}

#[test]
fn damage_is_told_from_truncation() {
    let folder = scratch();
    let path = folder.path().join("x.nii.gz");
    let whole = small_file();
    let outcome_of = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("writable");
        read(&path, &OPTIONS).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(outcome_of(&whole), Ok(()));

    // The last four bytes are the length, the four before them the checksum.
    let mut bad_checksum = whole.clone();
    let n_bytes = bad_checksum.len();
    bad_checksum[n_bytes - 8] ^= 1;
    assert!(outcome_of(&bad_checksum).is_err_and(|text| text.contains("damaged after 1360")));

    let cut = outcome_of(&whole[..n_bytes / 2]).expect_err("cut short");
    assert!(cut.contains("1360 bytes expected after decompression"), "{cut}");

    let plain = decompressed(&whole);
    let cut = outcome_of(&plain[..plain.len() - 1]).expect_err("cut short");
    assert!(cut.contains("1360 bytes expected, 1359 found"), "{cut}");

    // Content, not the name, says what is compressed; several members are one stream.
    assert_eq!(outcome_of(&plain), Ok(()));
    let member = |part: &[u8]| {
        let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut gz, part).expect("to memory");
        gz.finish().expect("to memory")
    };
    assert_eq!(outcome_of(&[member(&plain[..700]), member(&plain[700..])].concat()), Ok(()));

    // A legal stream that goes on far beyond the voxels.
    let bomb = [plain, vec![0; 2 << 20]].concat();
    assert!(
        outcome_of(&member(&bomb))
            .is_err_and(|text| text.contains("more bytes follow the voxels than the 1048576"))
    );
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gz, bytes).expect("to memory");
    gz.finish().expect("to memory")
}

/// Numbers written out have no checksum of their own, but the gzip file around them has.
#[test]
fn compressed_text_is_verified() {
    let folder = scratch();
    let path = folder.path().join("written.nrrd.gz");
    let [.., (name, written), _, _] = text_files();
    assert_eq!(name, "written.nrrd");
    let packed = gzipped(&written);
    std::fs::write(&path, &packed).expect("writable");
    assert_eq!(outcome(&path, &OPTIONS), "9x8x7 LPS");
    let mut damaged = packed;
    let checksum = damaged.len() - 8;
    damaged[checksum] ^= 1;
    std::fs::write(&path, &damaged).expect("writable");
    assert_eq!(outcome(&path, &OPTIONS), "E-VOLUME-CORRUPT 3");
}

/// `byte skip: -1` counts from the end of the stream, which must not be unpacked for a volume that is not allowed.
#[test]
fn what_is_refused_is_not_unpacked() {
    let folder = scratch();
    let path = folder.path().join("skip.nrrd");
    let nrrd = |sizes: &str, data: &[u8]| {
        let header = format!(
            "NRRD0005\ntype: uchar\ndimension: 3\nspace: left-posterior-superior\nsizes: {sizes}\n\
             space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: gzip\nbyte skip: -1\n\n"
        );
        std::fs::write(&path, [header.as_bytes(), &gzipped(data)].concat()).expect("writable");
        outcome(&path, &OPTIONS)
    };
    assert_eq!(nrrd("2 2 2", b"skipped 12345678"), "2x2x2 LPS");
    // 64 MiB of zeros, where 16 may be held: refused at the header, not after the drain.
    assert_eq!(nrrd("512 512 256", &vec![0; 64 << 20]), "E-VOLUME-TOO-LARGE 5");
    assert_eq!(nrrd("100000 100000 1000", b"few bytes"), "E-VOLUME-TRUNCATED 3");
}
