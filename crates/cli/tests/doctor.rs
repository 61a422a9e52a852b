//! `espalier doctor`: what an input is, which command suits it, and what that would cost.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::path::Path;

use program::{espalier, stderr};
use serde_json::Value;

/// Two roots, a fork, a node without a radius.
const TRACED: &str =
    "1 1 0 0 0 3 -1\n2 3 0 9 0 2 1\n3 3 9 18 4 1 2\n4 3 -9 18 -4 0 2\n5 1 90 0 0 1 -1\n6 3 95 0 0 1 5\n";

/// A MetaImage of 12 x 12 x 12 bytes.
fn image(folder: &Path, name: &str, value: impl Fn([usize; 3]) -> u8) {
    let header = "ObjectType = Image\nNDims = 3\nDimSize = 12 12 12\nElementSpacing = 0.5 0.5 2\n\
                  ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
    let voxels: Vec<u8> = (0..1728).map(|index| value([index % 12, index / 12 % 12, index / 144])).collect();
    std::fs::write(folder.join(name), [header.as_bytes(), &voxels].concat()).expect("write");
}

/// As [`image`], of numbers that are no whole ones.
fn scan(folder: &Path, name: &str) {
    let header = "ObjectType = Image\nNDims = 3\nDimSize = 12 12 12\nElementSpacing = 1 1 1\n\
                  ElementType = MET_FLOAT\nElementDataFile = LOCAL\n";
    let voxels: Vec<u8> = (0..1728_u16).flat_map(|index| (f32::from(index) * 0.3).to_le_bytes()).collect();
    std::fs::write(folder.join(name), [header.as_bytes(), &voxels].concat()).expect("write");
}

/// A ring about the z axis, with a rod through its wall, and a dot apart.
fn ring([x, y, z]: [usize; 3]) -> u8 {
    let is_ring = (2..8).contains(&x) && (2..8).contains(&y) && !((4..6).contains(&x) && (4..6).contains(&y));
    let is_rod = x == 2 && y == 2 && z < 11;
    u8::from((is_ring && (3..6).contains(&z)) || is_rod || [x, y, z] == [10, 10, 10])
}

fn doctor(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = espalier(folder, &[&["doctor"], arguments].concat());
    (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned(), stderr(&output))
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    let (code, text, said) = doctor(folder, &[arguments, &["--json"]].concat());
    assert_eq!(code, Some(0), "{said}");
    serde_json::from_str(&text).expect("JSON")
}

#[test]
fn a_traced_tree() {
    let folder = tempfile::tempdir().expect("temporary folder");
    std::fs::write(folder.path().join("a cell.swc"), TRACED).expect("write");
    let found = &json(folder.path(), &["a cell.swc"])["inputs"][0]["found"];
    let facts = &found["facts"];
    for (name, value) in [("nodes", 6), ("roots", 2), ("branch_points", 1), ("tips", 3), ("zero_radii", 1)] {
        assert_eq!(facts[name], value, "{name} of {facts}");
    }
    let codes: Vec<&str> =
        found["warnings"].as_array().expect("a list").iter().filter_map(|w| w["code"].as_str()).collect();
    for code in ["W-DOCTOR-ROOTS", "W-DOCTOR-RADII", "W-SWC-UNIT"] {
        assert!(codes.contains(&code), "{codes:?}");
    }
    assert_eq!(found["estimate"]["max_memory_suffices"], true);
    assert_eq!(found["estimate"]["stages"].as_array().map(Vec::len), Some(5));
    let (_, text, _) = doctor(folder.path(), &["a cell.swc"]);
    assert!(text.contains("try: espalier run 'a cell.swc'\n"), "{text}");
}

#[test]
fn a_mask_with_a_loop() {
    let folder = tempfile::tempdir().expect("temporary folder");
    image(folder.path(), "mask.mha", ring);
    let found = &json(folder.path(), &["mask.mha"])["inputs"][0]["found"];
    let facts = &found["facts"];
    assert_eq!(facts["format"], "MetaImage");
    assert_eq!(facts["kind"], "mask");
    assert_eq!(facts["scalar"], "uint8");
    assert_eq!(facts["spacing_mm"], serde_json::json!([0.5, 0.5, 2.0]));
    let n = (0..1728).filter(|i| ring([i % 12, i / 12 % 12, i / 144]) > 0).count();
    assert_eq!(facts["foreground_voxels"], n);
    assert_eq!((&facts["components"], &facts["loops"]), (&2.into(), &1.into()));
    let text = found["warnings"].to_string();
    for code in ["W-DOCTOR-COMPONENTS", "W-DOCTOR-LOOPS", "W-DOCTOR-SPACING", "W-DOCTOR-BORDER"] {
        assert!(text.contains(code), "{text}");
    }
    assert_eq!(found["estimate"]["stages"].as_array().map(Vec::len), Some(8));
}

#[test]
fn labels_and_scans_need_a_word() {
    let folder = tempfile::tempdir().expect("temporary folder");
    image(folder.path(), "labels.mha", |[x, y, z]| u8::from(x > 3) + u8::from(y > 3) + u8::from(z > 3));
    scan(folder.path(), "scan.mha");
    let found = |arguments: &[&str]| json(folder.path(), arguments)["inputs"][0]["found"].clone();
    let labels = found(&["labels.mha"]);
    assert_eq!(labels["facts"]["kind"], "labels");
    assert_eq!(labels["commands"], serde_json::json!([["run", "labels.mha", "--label", "VALUE"]]));
    assert_eq!(labels["estimate"]["stages"], serde_json::json!([]), "of which organ?");
    let told = found(&["labels.mha", "--label", "3"]);
    assert_eq!(told["estimate"]["stages"].as_array().map(Vec::len), Some(8));
    let scan = found(&["scan.mha"]);
    assert_eq!(scan["facts"]["kind"], "scan");
    assert!(scan["warnings"].to_string().contains("W-DOCTOR-NOT-HU"));
}

#[test]
fn one_that_cannot_be_read_does_not_hide_the_others() {
    let folder = tempfile::tempdir().expect("temporary folder");
    image(folder.path(), "mask.mha", ring);
    std::fs::write(folder.path().join("cut.mha"), "ObjectType = Image\nNDims = 3\n").expect("write");
    let (code, text, said) = doctor(folder.path(), &["cut.mha", "mask.mha", "nowhere.nii"]);
    assert_eq!(code, Some(3), "{said}");
    assert!(
        text.contains("mask.mha\n") && said.contains("cut.mha") && said.contains("nowhere.nii"),
        "{text}{said}"
    );
    let (code, text, _) = doctor(folder.path(), &["nowhere.nii", "mask.mha", "--json"]);
    let whole: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(code, Some(74));
    assert_eq!(whole["inputs"].as_array().map(Vec::len), Some(2), "{whole}");
}

#[test]
fn memory_that_does_not_suffice_is_told_before_and_refused_then() {
    let folder = tempfile::tempdir().expect("temporary folder");
    image(folder.path(), "mask.mha", ring);
    let found = &json(folder.path(), &["mask.mha", "--max-memory", "20M"])["inputs"][0]["found"];
    assert_eq!(found["estimate"]["max_memory_suffices"], false);
    assert!(found["warnings"].to_string().contains("E-LIMIT-MEMORY"));
    let output = espalier(folder.path(), &["run", "mask.mha", "-o", "out", "--max-memory", "20M"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(5), "{said}");
    assert!(
        said.contains("error[E-LIMIT-MEMORY]: render would take") && said.contains("--max-memory"),
        "{said}"
    );
    // The stages before have kept to it, and the results stand.
    let output = espalier(folder.path(), &["run", "mask.mha", "-o", "out"]);
    assert!(stderr(&output).contains("embed        kept"), "{}", stderr(&output));
    // The page too keeps to it.
    let output = espalier(folder.path(), &["report", "out", "--force", "--max-memory", "15M"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(5), "{said}");
    assert!(said.contains("error[E-LIMIT-MEMORY]: report would take"), "{said}");
}

#[test]
fn a_dry_run_tells_the_cost_of_what_is_to_do() {
    let folder = tempfile::tempdir().expect("temporary folder");
    image(folder.path(), "mask.mha", ring);
    let plan = |more: &[&str]| {
        let arguments = [&["run", "mask.mha", "-o", "out", "--set", "render.width_px=256"], more].concat();
        let output = espalier(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let n_costs = |text: &str| text.lines().filter(|line| line.contains("of one core")).count();
    assert_eq!(n_costs(&plan(&["--dry-run"])), 8);
    plan(&[]);
    assert_eq!(n_costs(&plan(&["--dry-run"])), 0, "nothing is to do");
    let text = plan(&["--dry-run", "--set", "render.theme=dark"]);
    assert_eq!(n_costs(&text), 2, "{text}");
}
