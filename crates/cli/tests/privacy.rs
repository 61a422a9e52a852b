//! Nothing of a patient in any byte of any output: marks in every text that an input can carry, and in its path.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;
use std::io::Read;

use program::{espalier, files_below, stderr};

/// In the name of the folder, in that of the file, and with a number behind it in each text.
const FOLDER: &str = "DOE^JANE~1947";
const NAME: &str = "DOEJANE19470813";
const TEXT: &str = "CANARY";

/// The voxels of a fork in 24 × 24 × 40, x fastest.
fn fork() -> Vec<u8> {
    let mut voxels = Vec::new();
    for z in 0..40_i32 {
        let arms = if z > 18 { [12, 12] } else { [12 - (18 - z) / 2, 12 + (18 - z) / 2] };
        for (y, x) in (0..24_i32).flat_map(|y| (0..24).map(move |x| (y, x))) {
            let near = |arm: i32| (x - arm) * (x - arm) + (y - 12) * (y - 12) <= 7;
            voxels.push(u8::from((4..36).contains(&z) && arms.into_iter().any(near)));
        }
    }
    voxels
}

fn nifti() -> Vec<u8> {
    let mut header = vec![0_u8; 348];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348_i32.to_le_bytes());
    [3, 24, 24, 40, 1, 1, 1, 1]
        .iter()
        .enumerate()
        .for_each(|(i, n): (usize, &i16)| put(40 + 2 * i, &n.to_le_bytes()));
    put(70, &2_i16.to_le_bytes());
    put(72, &8_i16.to_le_bytes());
    (0..4).for_each(|i| put(76 + 4 * i, &1_f32.to_le_bytes()));
    put(108, &416_f32.to_le_bytes());
    put(123, &[2]);
    // data_type, db_name, descrip, aux_file, intent_name.
    for (i, at) in [4, 14, 148, 228, 328].into_iter().enumerate() {
        put(at, format!("{TEXT}{i:02}").as_bytes());
    }
    put(254, &1_i16.to_le_bytes());
    [280, 300, 320].into_iter().for_each(|at| put(at, &1_f32.to_le_bytes()));
    put(344, b"n+1\0");
    let mut extension = [64_i32.to_le_bytes(), 6_i32.to_le_bytes()].concat();
    extension.extend(format!("{TEXT}05").as_bytes());
    extension.resize(64, 0);
    [header, vec![1, 0, 0, 0], extension, fork()].concat()
}

fn nrrd() -> Vec<u8> {
    let header = format!(
        "NRRD0005\n# {TEXT}\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: 24 24 40\n\
         space directions: (1,0,0) (0,1,0) (0,0,1)\nencoding: raw\nspace origin: (0,0,0)\ncontent: {TEXT}1\n\
         {TEXT}2:={TEXT}3\n\n"
    );
    [header.into_bytes(), fork()].concat()
}

fn metaimage() -> Vec<u8> {
    let header = format!(
        "ObjectType = Image\nComment = {TEXT}\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
         CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 0 0 0\nName = {TEXT}1\n\
         PatientName = {TEXT}2\nElementSpacing = 1 1 1\nDimSize = 24 24 40\nElementType = MET_UCHAR\n\
         ElementDataFile = LOCAL\n"
    );
    [header.into_bytes(), fork()].concat()
}

fn swc() -> Vec<u8> {
    format!("# {TEXT}\n# PATIENT {TEXT}1\n1 1 0 0 0 1 -1 {TEXT}2\n2 3 0 -9 0 .9 1\n3 3 5 -16 3 .5 2\n4 3 -6 -15 -2 .5 2\n")
        .into_bytes()
}

/// The bytes of a file, and everything in it that can be inflated: gzip, and streams of zlib in PNG, PDF and EXR.
fn layers(bytes: Vec<u8>) -> Vec<Vec<u8>> {
    let mut layers = Vec::new();
    if bytes.starts_with(&[0x1F, 0x8B]) {
        let mut plain = Vec::new();
        flate2::read::MultiGzDecoder::new(bytes.as_slice()).read_to_end(&mut plain).expect("gzip");
        layers.push(plain);
    }
    for at in bytes
        .windows(2)
        .enumerate()
        .filter(|(_, two)| matches!(two, [0x78, 1 | 0x5E | 0x9C | 0xDA]))
        .map(|(at, _)| at)
    {
        let mut plain = Vec::new();
        // What only looks like the beginning of a stream ends in an error, behind what it gave.
        let _ = flate2::read::ZlibDecoder::new(&bytes[at..]).take(1 << 22).read_to_end(&mut plain);
        layers.push(plain);
    }
    layers.push(bytes);
    layers
}

/// A mark as it stands in text of one or two bytes a letter, and in hexadecimal digits.
fn forms(mark: &str) -> Vec<Vec<u8>> {
    let wide = |of: fn(u16) -> [u8; 2]| mark.encode_utf16().flat_map(of).collect();
    let digits: String = mark.bytes().map(|byte| format!("{byte:02x}")).collect();
    vec![
        mark.into(),
        mark.to_lowercase().into(),
        wide(u16::to_le_bytes),
        wide(u16::to_be_bytes),
        digits.into(),
    ]
}

#[test]
fn no_text_and_no_path_of_an_input_reaches_a_result() {
    let marks: Vec<Vec<u8>> = [FOLDER, NAME, TEXT].into_iter().flat_map(forms).collect();
    for (end, bytes) in [("nii", nifti()), ("nrrd", nrrd()), ("mha", metaimage()), ("swc", swc())] {
        let folder = tempfile::tempdir().expect("temporary folder");
        fs::create_dir(folder.path().join(FOLDER)).expect("folder");
        let input = format!("{FOLDER}/{NAME}.{end}");
        fs::write(folder.path().join(&input), bytes).expect("write");
        let quick = ["embed.pso.particles=16", "embed.pso.iterations=3", "render.width_px=300"];
        let quick = quick.iter().flat_map(|set| ["--set", set]);
        let output = espalier(
            folder.path(),
            &["run", &input, "-o", "out"].into_iter().chain(quick).collect::<Vec<_>>(),
        );
        assert!(output.status.success(), "{}", stderr(&output));
        let files = files_below(&folder.path().join("out"));
        assert!(files.len() > 15, "{end}");
        for path in files {
            // The one file that may name the input, for stages that read it again; no digest vouches for it.
            let is_allowed = path.ends_with("provenance/run.json");
            for bytes in layers(fs::read(&path).expect("readable")) {
                let held = marks
                    .iter()
                    .find(|mark| bytes.windows(mark.len()).any(|window| window == mark.as_slice()));
                let held = held.map(|mark| String::from_utf8_lossy(mark).into_owned());
                let is_header = held.as_ref().is_some_and(|held| held.contains(TEXT));
                assert!(
                    held.is_none() || (is_allowed && !is_header),
                    "{held:?} stands in {}",
                    path.display()
                );
            }
        }
        let sums = fs::read_to_string(folder.path().join("out/SHA256SUMS")).expect("sums");
        assert!(!sums.contains("run.json"));
    }
}
