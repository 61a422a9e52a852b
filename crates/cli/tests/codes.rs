//! Errors that no other test of the program meets, each with the smallest input that raises it; and `explain`.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;
use std::io::{Read, Write};
use std::path::Path;

use program::{espalier, stderr};
use tempfile::TempDir;

const TREE: &str =
    "1 0 0 0 0 2 -1\n2 0 0 20 0 2 1\n3 0 15 30 5 1 2\n4 0 20 45 9 1 3\n5 0 -12 31 -6 1 2\n6 0 -20 40 3 1 5\n";

/// A folder with `tree.swc` and these files.
fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    for (name, bytes) in [("tree.swc", TREE.as_bytes())].iter().chain(files) {
        fs::write(folder.path().join(name), bytes).expect("write");
    }
    folder
}

/// Runs the program, which must end with this error.
#[track_caller]
fn raises(folder: &TempDir, arguments: &[&str], code: &str, exit_code: i32) {
    let output = espalier(folder.path(), arguments);
    let text = stderr(&output);
    assert!(text.contains(&format!("error[{code}]: ")), "no {code} in: {text}");
    assert_eq!(output.status.code(), Some(exit_code), "{text}");
}

/// Runs the program on one file.
#[track_caller]
fn file_raises(name: &str, bytes: &[u8], more: &[&str], code: &str, exit_code: i32) {
    let arguments = [&["run", name, "-o", "out"], more].concat();
    raises(&folder(&[(name, bytes)]), &arguments, code, exit_code);
}

#[test]
fn of_configs_and_run_folders() {
    let missing_data = "schema = 1\n[input]\npath = \"$ESPALIER_DATA/x.swc\"\n";
    file_raises("data.toml", missing_data.as_bytes(), &[], "E-INPUT", 2);
    file_raises("big.swc", TREE.as_bytes(), &["--max-memory", "20"], "E-LIMIT-MEMORY", 5);
    let at = folder(&[("other.swc", TREE.replace("45", "46").as_bytes())]);
    raises(&at, &["run", "tree.swc", "--from", "volume"], "E-RUN-STAGES", 2);
    raises(&at, &["run", "tree.swc", "-o", "new", "--from", "embed"], "E-RUN-MISSING-FILE", 74);
    let quick = ["--set", "embed.methods=[]", "--to", "embed", "-o", "out"];
    assert!(espalier(at.path(), &[&["run", "tree.swc"], &quick[..]].concat()).status.success());
    let again =
        |input, more: &[&'static str]| [&["run", input, "--from", "embed"], &quick[..], more].concat();
    raises(&at, &again("tree.swc", &["--set", "tree.resample=shape"]), "E-RUN-SETTINGS", 2);
    raises(&at, &again("other.swc", &[]), "E-RUN-INPUT", 2);
    let read = |file: &str| fs::read_to_string(at.path().join("out").join(file)).expect("text");
    let views = read("views.json").replacen("\"towards_camera\":[0.", "\"towards_camera\":[7.", 1);
    assert_ne!(views, read("views.json"));
    fs::write(at.path().join("views.json"), views).expect("write");
    raises(&at, &["embed", "out/tree.swc", "views.json", "-o", "e"], "E-FILE-INVALID", 3);
    // A folder stands where a result should go.
    fs::create_dir_all(at.path().join("full/tree.swc/inside")).expect("folder");
    raises(&at, &["run", "tree.swc", "-o", "full"], "E-RUN-IN-WAY", 73);
    let swarm = ["--set", "embed.pso.memory_mib=1", "--set", "embed.pso.particles=100000"];
    raises(&at, &[&["run", "tree.swc", "-o", "swarm"], &swarm[..]].concat(), "E-EMBED-MEMORY", 5);
}

/// A grey volume, plain NIfTI-1: 8³ voxels of 16 bits, all `value`.
fn nifti() -> Vec<u8> {
    let grid =
        espalier_model::Grid::axis_aligned([8, 8, 8], glam::DVec3::ONE, glam::DVec3::ZERO).expect("grid");
    let mask = espalier_model::Mask::from_voxels(grid, &[true; 512]);
    let packed = espalier_model::nifti_out::mask(&mask).expect("bytes");
    let mut plain = Vec::new();
    flate2::read::GzDecoder::new(packed.as_slice()).read_to_end(&mut plain).expect("a gzip file");
    plain
}

/// The same with a number of 16 bits put at a place of its header.
fn nifti_with(changes: &[(usize, i16)]) -> Vec<u8> {
    let mut bytes = nifti();
    for &(at, value) in changes {
        bytes[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }
    bytes
}

#[test]
fn of_volumes() {
    file_raises("4d.nii", &nifti_with(&[(40, 4), (46, 4), (48, 2)]), &[], "E-VOLUME-4D", 3);
    file_raises("complex.nii", &nifti_with(&[(70, 32), (72, 64)]), &[], "E-VOLUME-DATATYPE", 3);
    file_raises("negative.nii", &nifti_with(&[(42, -8)]), &[], "E-VOLUME-FIELD", 3);
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(&[nifti(), vec![0; 2 << 20]].concat()).expect("to memory");
    file_raises("long.nii.gz", &packed.finish().expect("to memory"), &[], "E-VOLUME-TRAILING", 3);
    let endless = [b"NRRD0004\n# ".to_vec(), vec![b'a'; 5 << 20]].concat();
    file_raises("endless.nrrd", &endless, &[], "E-VOLUME-HEADER", 3);
    let pair = [&nifti()[..344], b"ni1\0", &[0, 0, 0, 0]].concat();
    file_raises("alone.hdr", &pair, &[], "E-VOLUME-NO-PARTNER", 3);
}

/// A MetaImage of 16-bit numbers with its data in another file.
fn meta_image(size: &str, spacing: &str, data: &str) -> String {
    format!(
        "ObjectType = Image\nNDims = 3\nDimSize = {size}\nElementSpacing = {spacing}\nElementType = MET_SHORT\n\
         ElementDataFile = {data}\n"
    )
}

#[test]
fn of_volumes_in_two_files() {
    let header = |data| meta_image("4 4 4", "1 1 1", data);
    file_raises("out.mhd", header("../secret.raw").as_bytes(), &[], "E-VOLUME-ESCAPE", 3);
    file_raises("many.mhd", header("LIST").as_bytes(), &[], "E-VOLUME-SEVERAL-FILES", 3);
    let at = folder(&[("folder.mhd", header("data").as_bytes())]);
    fs::create_dir(at.path().join("data")).expect("folder");
    raises(&at, &["run", "folder.mhd", "-o", "out"], "E-VOLUME-NOT-A-FILE", 74);
}

/// A region that grows with every step of the threshold, from its seed in the corner to the last voxel.
#[test]
fn of_a_region_that_never_rests() {
    // So many voxels lie below a value that each step of the threshold adds the same share.
    let value = |i: u32| -1000 + (550.0 * espalier_geom::math::ln(f64::from(i + 1)) / 11.0) as i16;
    let ramp: Vec<u8> = (0..59_200).flat_map(|i| value(i).to_le_bytes()).collect();
    let at =
        folder(&[("ramp.mhd", meta_image("40 40 37", "1 1 1", "ramp.raw").as_bytes()), ("ramp.raw", &ramp)]);
    let seed = ["--preset", "airway", "--set", "volume.seed_voxel=[0,0,0]"];
    raises(&at, &[&["run", "ramp.mhd", "-o", "out"], &seed[..]].concat(), "E-VOLUME-NO-KNEE", 3);
}

#[test]
fn of_traced_trees() {
    let no_points =
        b"<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\"><PolyData><Piece \
                      NumberOfPoints=\"2\" NumberOfLines=\"1\"></Piece></PolyData></VTKFile>";
    file_raises("lines.vtp", no_points, &["--assume-space", "ras"], "E-POLYDATA-MISSING", 3);
}

#[test]
fn of_groups() {
    let at = folder(&[]);
    // A folder that is not there is a row too.
    let names: Vec<String> = (0..10_001).map(|index| index.to_string()).collect();
    let arguments: Vec<&str> =
        ["group", "-o", "page"].into_iter().chain(names.iter().map(String::as_str)).collect();
    raises(&at, &arguments, "E-GROUP-SIZE", 2);
}

fn said(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let output = espalier(folder, arguments);
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned() + &stderr(&output))
}

#[test]
fn codes_are_explained() {
    let at = folder(&[]);
    let (code, text) = said(at.path(), &["explain", "e-volume-no-space"]);
    assert_eq!(code, Some(0), "{text}");
    for part in ["E-VOLUME-NO-SPACE: ", "\nexit code 3: ", "\ncause    ", "\nway out  ", "--assume-space ras"]
    {
        assert!(text.contains(part), "no {part:?} in: {text}");
    }
    assert!(text.lines().all(|line| line.chars().count() <= 110), "{text}");
    let (code, text) = said(at.path(), &["explain", "E-VOLUME-NOSPACE"]);
    assert!(code == Some(2) && text.contains("error[E-EXPLAIN-CODE]"), "{text}");
    assert!(text.contains("did you mean E-VOLUME-NO-SPACE"), "{text}");
    let (code, text) = said(at.path(), &["explain"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.starts_with("command line, configs, run folders\n  E-"), "{text}");
    let (_, json) = said(at.path(), &["explain", "--json"]);
    let all: Vec<serde_json::Value> = serde_json::from_str(&json).expect("JSON");
    for entry in &all {
        assert!(text.contains(&format!("\n  {} ", entry["code"].as_str().expect("a code"))), "{entry}");
    }
    let (_, json) = said(at.path(), &["explain", "E-GRID-SHAPE", "--json"]);
    let one: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(one["exit_codes"], serde_json::json!([2, 3]));
}

/// An error points to its entry where that has more to say, and only there.
#[test]
fn errors_point_to_their_entry() {
    let at = folder(&[("scan.nrrd", b"NRRD0004\n")]);
    let (_, text) = said(at.path(), &["run", "tree.swc", "-o", "out", "--from", "embed"]);
    assert!(text.contains("\n  more: espalier explain E-RUN-MISSING-FILE"), "{text}");
    let (_, text) = said(at.path(), &["run", "nowhere.swc", "-o", "out"]);
    assert!(!text.contains("espalier explain"), "{text}");
}
