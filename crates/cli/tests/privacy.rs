//! Nothing of a patient in any byte of any output: marks in every text that an input can carry, and in its path.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

#[path = "../../volume/tests/slices/mod.rs"]
mod slices;

mod marks;
mod program;

use std::fs;
use std::path::Path;

use marks::Marks;
use program::{espalier, files_below, stderr};
use slices::{SECRETS, Slice, element};

/// In the name of the folder, in that of the file, and with a number behind it in each text.
const FOLDER: &str = "ROE^RICHARD~1947";
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
    // Behind the voxels too, where no reader looks.
    let mut extension = [64_i32.to_le_bytes(), 6_i32.to_le_bytes()].concat();
    extension.extend(format!("{TEXT}05").as_bytes());
    extension.resize(64, 0);
    [header, vec![1, 0, 0, 0], extension, fork(), format!("{TEXT}06").into_bytes()].concat()
}

/// The same packed, with marks in the texts of gzip's own header.
fn packed_nifti() -> Vec<u8> {
    let named = flate2::GzBuilder::new().filename(TEXT).comment(TEXT).extra(TEXT);
    let mut writer = named.write(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut writer, &nifti()).expect("to memory");
    writer.finish().expect("to memory")
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

fn vtk() -> Vec<u8> {
    format!(
        "# vtk DataFile Version 4.2\n{TEXT} SPACE=LPS\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n\
         0 0 0 0 -9 0 5 -16 3 0 -9 0 -6 -15 -2\nLINES 2 7\n3 0 1 2\n2 3 4\nPOINT_DATA 5\n\
         SCALARS radius float 1\nLOOKUP_TABLE default\n1 .9 .5 .9 .5\nFIELD {TEXT} 1\n{TEXT}1 1 5 float\n1 2 3 4 5\n"
    )
    .into_bytes()
}

/// The groups of tags that marks stand in: of files, patients, acquisitions, relations, pictures, studies, visits and
/// procedures, and of no standard.
const GROUPS: [u32; 12] =
    [0x0008, 0x0009, 0x0010, 0x0011, 0x0018, 0x0020, 0x0028, 0x0032, 0x0038, 0x0040, 0x0088, 0x4008];
/// Representations of texts, and of bytes that may hold any.
const TEXTS: [&str; 17] =
    ["PN", "LO", "SH", "ST", "LT", "UT", "UC", "UR", "AE", "CS", "UI", "DA", "TM", "DT", "AS", "UN", "OB"];
/// What a reader needs to know the geometry and the intensities; these have no room for marks.
const NEEDED: [u32; 27] = [
    0x0008_0008,
    0x0008_0016,
    0x0008_0060,
    0x0018_0050,
    0x0018_0086,
    0x0020_000E,
    0x0020_0011,
    0x0020_0012,
    0x0020_0032,
    0x0020_0037,
    0x0020_0100,
    0x0028_0002,
    0x0028_0004,
    0x0028_0006,
    0x0028_0008,
    0x0028_0010,
    0x0028_0011,
    0x0028_0030,
    0x0028_0100,
    0x0028_0101,
    0x0028_0102,
    0x0028_0103,
    0x0028_0120,
    0x0028_0121,
    0x0028_1052,
    0x0028_1053,
    0x0028_2110,
];

/// A slice of the fork with a mark in every tag of [`GROUPS`] up to 00FF and from 1000 to 10FF that is not needed, in a
/// sequence, in the meta group and before everything.
fn dicom(z: usize) -> Vec<u8> {
    let values = fork()[24 * 24 * z..][..24 * 24].iter().map(|&voxel| i16::from(voxel)).collect();
    let base = Slice::at(z as f64);
    let mut slice = Slice { size: [24, 24], pixel_spacing: [1.0, 1.0], slope: 1000.0, values, ..base };
    let tags = GROUPS.into_iter().flat_map(|group| {
        (0x0001..=0x00FF_u32).chain(0x1000..=0x10FF).map(move |element| (group << 16) | element)
    });
    for (i, tag) in tags.filter(|tag| !NEEDED.contains(tag)).enumerate() {
        slice = slice.with(tag, TEXTS[i % TEXTS.len()], format!("{TEXT}{i:04}").as_bytes());
    }
    let inner = element(0x0010_0010, "PN", format!("{TEXT}^NESTED").into_bytes());
    let item = [vec![0xFE, 0xFF, 0x00, 0xE0], (inner.len() as u32).to_le_bytes().to_vec(), inner].concat();
    let slice = slice.with(0x0040_0275, "SQ", &item).with(
        0x0008_0008,
        "CS",
        format!("ORIGINAL\\PRIMARY\\AXIAL\\{TEXT}").as_bytes(),
    );
    let mut bytes = slice.bytes();
    bytes[..TEXT.len()].copy_from_slice(TEXT.as_bytes());
    bytes.splice(132..132, element(0x0002_0003, "UI", TEXT.into()));
    bytes
}

fn swc() -> Vec<u8> {
    format!("# {TEXT}\n# PATIENT {TEXT}1\n1 1 0 0 0 1 -1 {TEXT}2\n2 3 0 -9 0 .9 1\n3 3 5 -16 3 .5 2\n4 3 -6 -15 -2 .5 2\n")
        .into_bytes()
}

/// No mark in any file of a folder, but those of the path in the one file that may name the input, for stages that read it
/// again; no digest vouches for that one.
fn check(folder: &Path, marks: &Marks) {
    let files = files_below(folder);
    assert!(!files.is_empty());
    for path in files {
        let found = marks.found_in(fs::read(&path).expect("readable"));
        let is_allowed = path.ends_with("provenance/run.json");
        let held = found.iter().find(|mark| !is_allowed || ![FOLDER, NAME].contains(&mark.as_str()));
        assert!(held.is_none(), "{held:?} stands in {}", path.display());
    }
}

const QUICK: [&str; 6] =
    ["--set", "embed.pso.particles=16", "--set", "embed.pso.iterations=3", "--set", "render.width_px=300"];

fn run(folder: &Path, input: &str, out: &str, more: &[&str]) {
    let output = espalier(folder, &[["run", input, "-o", out, "-q"].as_slice(), &QUICK, more].concat());
    assert!(output.status.success(), "{input}: {}", stderr(&output));
    assert!(files_below(&folder.join(out)).len() > 15, "{input}");
    let sums = fs::read_to_string(folder.join(out).join("SHA256SUMS")).expect("sums");
    assert!(!sums.contains("run.json"));
    assert!(folder.join(out).join("report.html").exists());
}

fn all_marks() -> Marks {
    Marks::new(&[[FOLDER, NAME, TEXT].as_slice(), &SECRETS].concat())
}

#[test]
fn no_text_and_no_path_of_an_input_reaches_a_result() {
    let marks = all_marks();
    let folder = tempfile::tempdir().expect("temporary folder");
    fs::create_dir(folder.path().join(FOLDER)).expect("folder");
    for (end, bytes) in [
        ("nii", nifti()),
        ("nii.gz", packed_nifti()),
        ("nrrd", nrrd()),
        ("mha", metaimage()),
        ("swc", swc()),
        ("vtk", vtk()),
    ] {
        assert!(!marks.found_in(bytes.clone()).is_empty(), "{end}");
        let input = format!("{FOLDER}/{NAME}.{end}");
        fs::write(folder.path().join(&input), bytes).expect("write");
        run(folder.path(), &input, end, &[]);
        check(&folder.path().join(end), &marks);
    }
    // Labels are folders as they are typed, or numbers; what lies above stays above.
    let shown = folder.path().join(FOLDER).join("runs");
    fs::create_dir(&shown).expect("folder");
    for end in ["nii", "mha"] {
        fs::rename(folder.path().join(end), shown.join(end)).expect("renamed");
    }
    fs::rename(folder.path().join("swc"), folder.path().join(NAME)).expect("renamed");
    let shown = shown.display().to_string();
    for arguments in
        [["group", &shown, "nrrd", "-o", "typed"], ["group", ".", "--anonymous", "-o", "numbered"]]
    {
        let output = espalier(folder.path(), &arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        check(&folder.path().join(arguments[arguments.len() - 1]), &marks);
    }
    let table = fs::read_to_string(folder.path().join("typed/group.tsv")).expect("a table");
    let labels: Vec<&str> = table.lines().skip(1).filter_map(|line| line.split('\t').next()).collect();
    assert_eq!(labels, ["mha", "nii", "nrrd"]);
}

#[test]
fn no_text_of_a_dicom_series_reaches_a_result() {
    let marks = all_marks();
    let folder = tempfile::tempdir().expect("temporary folder");
    let scan = folder.path().join(FOLDER);
    fs::create_dir(&scan).expect("folder");
    for z in 0..40 {
        let bytes = dicom(z);
        assert_eq!(marks.found_in(bytes.clone()).first().map(String::as_str), Some(TEXT));
        fs::write(scan.join(format!("{NAME}-{z}.dcm")), bytes).expect("write");
    }
    let band = ["--set", "volume.method=threshold", "--set", "volume.lower=-500"];
    run(folder.path(), FOLDER, "out", &band);
    // A scan, so that the page has slices of it.
    assert!(folder.path().join("out/stages/01-volume/slices-axial.png").exists());
    check(&folder.path().join("out"), &marks);
}
