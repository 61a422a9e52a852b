//! What a user says of an input: the names of its labels, its space, one volume of several, a preset.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;

use program::{espalier, stderr};
use tempfile::TempDir;

/// The exit code, and what was said.
fn said(folder: &TempDir, arguments: &[&str]) -> (Option<i32>, String) {
    let output = espalier(folder.path(), arguments);
    (output.status.code(), stderr(&output))
}

/// A folder with `map.mhd` and its data: 12×6×6 voxels of 1 mm with the labels 10, 20 and 30 one beside the other.
fn label_map() -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    let header = "ObjectType = Image\nNDims = 3\nDimSize = 12 6 6\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\n\
                  ElementDataFile = map.raw\n";
    let row = [0, 10, 10, 10, 20, 20, 20, 30, 30, 30, 30, 0_u8];
    fs::write(folder.path().join("map.mhd"), header).expect("write");
    fs::write(folder.path().join("map.raw"), row.repeat(36)).expect("write");
    folder
}

fn read(folder: &TempDir, file: &str) -> String {
    fs::read_to_string(folder.path().join(file)).expect("text")
}

#[test]
fn labels_go_by_the_users_own_names() {
    let folder = label_map();
    let names = "# regions\n10 left_lung 255 0 0 255\n20 heart 0 255 0 255\n30 right_lung 0 0 255 255\n";
    fs::write(folder.path().join("names.ctbl"), names).expect("write");
    let volume = ["volume", "map.mhd", "-o", "out", "--labels", "names.ctbl", "--label"];
    let run = |label: &str| said(&folder, &[volume.as_slice(), &[label]].concat());
    let (code, text) = run("left lung, heart");
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("216 voxels") && text.contains("left lung taken for 10"), "{text}");
    // Header, data and names are all part of what the mask was made from.
    let inputs = read(&folder, "out/provenance/inputs.tsv");
    assert_eq!(inputs.lines().filter(|line| line.starts_with("input\t")).count(), 2, "{inputs}");
    assert!(inputs.contains("input_labels\t"), "{inputs}");
    assert!(read(&folder, "out/provenance/config.resolved.toml").contains("labels = \"input_labels.ctbl\""));
    // Again in the folder itself, which knows where the file lies.
    let (code, text) = said(&folder, &["volume", "out"]);
    assert!(code == Some(0) && text.contains("216 voxels"), "{text}");

    let (code, text) = run("left lnug");
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("names.ctbl") && text.contains("left_lung"), "{text}");
    assert!(text.contains("error[E-VOLUME-LABEL-UNKNOWN]"), "{text}");
    fs::write(folder.path().join("names.ctbl"), "10 left_lung\ntwenty heart\n").expect("write");
    let (code, text) = run("heart");
    assert!(code == Some(3) && text.contains("names.ctbl") && text.contains("line 2"), "{text}");
    // What a file holds does not reach the terminal as it is.
    fs::write(folder.path().join("names.ctbl"), "10 left_lung\n\u{1b}[31mred\u{7}\n").expect("write");
    let (code, text) = run("heart");
    assert!(code == Some(3) && text.contains("[31mred") && !text.contains(['\u{1b}', '\u{7}']), "{text:?}");
    let nowhere = ["volume", "map.mhd", "-o", "out", "--labels", "nowhere.txt", "--label", "heart"];
    assert_eq!(said(&folder, &nowhere).0, Some(74));
}

/// The data file changes, the header does not: it is another input all the same.
#[test]
fn the_data_of_a_header_is_part_of_the_input() {
    let folder = label_map();
    let run = |from: &str| {
        said(&folder, &["run", "map.mhd", "--label", "10", "-o", "out", "--from", from, "--to", from])
    };
    assert_eq!(run("volume").0, Some(0));
    assert_eq!(run("skeleton").0, Some(0));
    let mut data = fs::read(folder.path().join("map.raw")).expect("bytes");
    data[1] = 20;
    fs::write(folder.path().join("map.raw"), data).expect("write");
    let (code, text) = run("skeleton");
    assert_eq!(code, Some(2), "{text}");
}

#[test]
fn a_preset_is_the_same_on_the_command_line_and_in_a_config() {
    let folder = label_map();
    let config = |tree: &str| {
        let text = format!(
            "schema = 1\n[input]\npath = \"map.mhd\"\n[volume]\npreset = \"airway\"\nlabel = 10\n{tree}"
        );
        fs::write(folder.path().join("a.toml"), text).expect("write");
    };
    let root = |arguments: &[&str]| {
        let (code, text) = said(&folder, &[arguments, &["--to", "volume", "-o", "out"]].concat());
        assert_eq!(code, Some(0), "{text}");
        let resolved = read(&folder, "out/provenance/config.resolved.toml");
        let line = resolved.lines().find(|line| line.starts_with("root = ")).expect("a root").to_owned();
        fs::remove_dir_all(folder.path().join("out")).expect("the folder goes");
        line
    };
    let with_preset = root(&["run", "map.mhd", "--label", "10", "--preset", "airway"]);
    assert_eq!(with_preset, "root = \"superior\"");
    config("");
    assert_eq!(root(&["run", "a.toml"]), with_preset);
    config("[tree]\nroot = \"thickest-tip\"\n");
    assert_eq!(root(&["run", "a.toml"]), "root = \"thickest-tip\"");
    assert_eq!(root(&["run", "a.toml", "--preset", "airway"]), "root = \"thickest-tip\"");
    assert_eq!(root(&["run", "map.mhd", "--label", "10"]), "root = \"thickest-tip\"");
    let set = ["run", "map.mhd", "--label", "10", "--preset", "airway", "--set", "tree.root=thickest-tip"];
    assert_eq!(root(&set), "root = \"thickest-tip\"");
}

/// A scan in place of the label map that branches are labelled by.
#[test]
fn a_scan_is_no_map_of_regions() {
    let folder = label_map();
    let header = "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 12 12 12\n\
                  space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nendian: little\nencoding: raw\n\n";
    let numbers = (0..1728_i16).flat_map(i16::to_le_bytes);
    let scan: Vec<u8> = header.bytes().chain(numbers).collect();
    fs::write(folder.path().join("scan.nrrd"), scan).expect("write");
    let arguments = ["run", "map.mhd", "--label", "10", "--set", "tree.labels=scan.nrrd", "-o", "out"];
    let (code, text) = said(&folder, &[arguments.as_slice(), &["--to", "tree"]].concat());
    assert_eq!(code, Some(3), "{text}");
    assert!(text.contains("scan.nrrd") && text.contains("error[E-VOLUME-NO-LABELS]"), "{text}");
}

#[test]
fn space_and_volume_have_options_of_their_own() {
    let folder = tempfile::tempdir().expect("temporary folder");
    // Two volumes of 4×4×4, without a word on where they lie.
    let mut header = vec![0_u8; 352];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348_i32.to_le_bytes());
    [4, 4, 4, 4, 2, 1, 1, 1]
        .iter()
        .enumerate()
        .for_each(|(i, n): (usize, &i16)| put(40 + 2 * i, &n.to_le_bytes()));
    [2_i16, 8].iter().enumerate().for_each(|(i, n)| put(70 + 2 * i, &n.to_le_bytes()));
    (0..8).for_each(|i| put(76 + 4 * i, &1_f32.to_le_bytes()));
    put(108, &352_f32.to_le_bytes());
    put(123, &[2]);
    put(344, b"n+1\0");
    let (first, second) = ([[1; 32], [0; 32]].concat(), [[0; 48], [1; 48]].concat());
    let file = [header, first, second[32..].to_vec()].concat();
    fs::write(folder.path().join("two.nii"), file).expect("write");
    let run = |more: &[&str]| said(&folder, &[&["volume", "two.nii", "-o", "out"], more].concat());
    let (code, text) = run(&[]);
    assert!(code == Some(3) && text.contains("--volume-index 0"), "{text}");
    let (code, text) = run(&["--volume-index", "1"]);
    assert!(code == Some(3) && text.contains("--assume-space ras"), "{text}");
    let (code, text) = run(&["--volume-index", "1", "--assume-space", "ras"]);
    assert!(code == Some(0) && text.contains("48 voxels"), "{text}");
    assert_eq!(run(&["--volume-index", "2", "--assume-space", "ras"]).0, Some(2));
    assert_eq!(run(&["--volume-index", "0", "--assume-space", "sar"]).0, Some(2));
    assert_eq!(run(&["--volume-index", "0", "--assume-space", "las", "--strict"]).0, Some(0));
}

#[test]
fn a_tracing_of_no_neurons_size_is_told() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let tracing = |length: f64, radius: f64| format!("1 1 0 0 0 {radius} -1\n2 3 {length} 0 0 {radius} 1\n");
    let warns = |swc: String, settings: &[&str]| {
        fs::write(folder.path().join("traced.swc"), swc).expect("write");
        let (code, text) = said(&folder, &[&["tree", "traced.swc", "-o", "out"], settings].concat());
        assert_eq!(code, Some(0), "{text}");
        text.contains("W-SWC-UNIT")
    };
    assert!(!warns(tracing(9000.0, 5.0), &[]), "a neuron");
    assert!(warns(tracing(120_000.0, 5.0), &[]), "12 cm across");
    assert!(warns(tracing(9000.0, 40.0), &[]), "voxels of 8 nm");
    assert!(!warns(tracing(9000.0, 40.0), &["--set", "input.unit=nm", "--set", "input.scale=[8,8,8]"]));
}

#[test]
fn no_result_takes_the_place_of_the_input() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let swc = "1 1 0 0 0 1 -1\n2 3 100 0 0 1 1\n";
    fs::create_dir(folder.path().join("own")).expect("folder");
    fs::write(folder.path().join("own/tree.swc"), swc).expect("write");
    let (code, text) = said(&folder, &["tree", "own/tree.swc", "-o", "own"]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("error[E-RUN-INPUT-IN-WAY]: own/tree.swc"), "{text}");
    assert_eq!(read(&folder, "own/tree.swc"), swc);
    assert_eq!(said(&folder, &["tree", "own/tree.swc", "-o", "other"]).0, Some(0));
}
