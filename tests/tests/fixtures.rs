//! The fixtures are what the phantom generator makes, on every machine; and a run from them gives known bytes.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use espalier_pipeline::{Config, Override, make_phantom};
use espalier_tests::{run, set};

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

#[track_caller]
fn check(kind: &str, seed: u64, overrides: &[Override], files: &[(&str, &str)]) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut all = vec![set("input.phantom", kind), set("seed", seed)];
    all.extend(overrides.iter().cloned());
    let text = "[input]\nphantom = \"airway\"\n";
    let config = Config::parse(text, Path::new("test"), &all).expect("a config");
    make_phantom(&config, folder.path(), None).expect("a phantom");
    for (made, fixture) in files {
        let made = fs::read(folder.path().join(made)).expect("made file");
        let fixture_bytes = fs::read(repository().join("fixtures").join(fixture)).expect("fixture");
        assert!(made == fixture_bytes, "{fixture} is not what the generator makes; see scripts/fixtures");
    }
}

#[test]
fn fixtures_are_what_the_generator_makes() {
    let y = [set("phantom.length_mm", 24), set("phantom.radius_mm", 3)];
    check("y", 1, &y, &[("truth-mask.nii.gz", "y.nii.gz"), ("ct.nii.gz", "y-ct.nii.gz")]);
    let torus = [set("phantom.ring_radius_mm", 10), set("phantom.radius_mm", 2.5)];
    check("torus", 1, &torus, &[("truth-mask.nii.gz", "torus.nii.gz")]);
    check("neuron", 2, &[], &[("truth.swc", "neuron.swc")]);
}

/// The digests of whole runs, kept in `tests/golden/digests.tsv`; `UPDATE_GOLDEN=1` writes them anew.
#[test]
#[allow(clippy::disallowed_methods, reason = "the switch that updates the golden file")]
fn runs_give_known_bytes() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("golden/digests.tsv");
    let folder = tempfile::tempdir().expect("temporary folder");
    let quick =
        [set("embed.pso.particles", 64), set("embed.pso.iterations", 10), set("render.width_px", 320)];
    let mut table = String::from("fixture\tsha256_of_SHA256SUMS\n");
    for fixture in ["y.nii.gz", "torus.nii.gz", "neuron.swc"] {
        let out = folder.path().join(fixture);
        let summary = run(&repository().join("fixtures").join(fixture), &out, &quick, 2).expect("a run");
        table += &format!("{fixture}\t{}\n", summary.digest);
    }
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        fs::write(&golden, &table).expect("write");
    }
    let expected = fs::read_to_string(&golden).expect("tests/golden/digests.tsv");
    assert_eq!(
        table, expected,
        "results changed; if that is meant, set UPDATE_GOLDEN=1 and say why in the commit"
    );
}
