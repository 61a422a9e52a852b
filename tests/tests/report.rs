//! The page of a run, from end to end: what it is made from, what it must not say, and where it begins.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use espalier_pipeline::{Override, Stage};
use espalier_tests::{run, run_from, set, small_swarm};

/// A name that a file may have and no result may repeat.
const PATIENT: &str = "DOE_JOHN_19700101";

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures").join(name)
}

/// A scan that is named after a patient, and the settings that make a mask of it.
fn scan(folder: &Path) -> (PathBuf, Vec<Override>) {
    let path = folder.join(format!("{PATIENT}.nii.gz"));
    fs::copy(fixture("y-ct.nii.gz"), &path).expect("a copy");
    let mut overrides = small_swarm();
    overrides.extend([set("volume.method", "threshold"), set("volume.lower", 150)]);
    (path, overrides)
}

fn text(folder: &Path, file: &str) -> String {
    fs::read_to_string(folder.join(file)).expect("a text")
}

#[test]
fn the_page_of_a_scan_names_no_file() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (path, overrides) = scan(folder.path());
    let out = folder.path().join("out");
    run(&path, &out, &overrides, 2).expect("a run");
    for file in ["report.html", "provenance/methods.md", "provenance/references.bib"] {
        let text = text(&out, file);
        assert!(!text.contains(PATIENT), "{file}");
        assert!(!text.contains(&*folder.path().to_string_lossy()), "{file}");
        assert!(text.len() < 5_000_000);
    }
    let page = text(&out, "report.html");
    let n_pictures = page.matches("data:image/png;base64,").count();
    assert_eq!(n_pictures, 7, "three strips of slices, three shadows, the organ in space");
    assert!(page.contains("volume.lower") && page.contains("(a file)"), "settings without names");
    let digest = text(&out, "provenance/inputs.tsv")
        .lines()
        .nth(1)
        .expect("a row")
        .split('\t')
        .nth(2)
        .map(str::to_owned);
    assert!(page.contains(&digest.expect("a digest")), "the input by its content");
    let sums = text(&out, "SHA256SUMS");
    assert!(sums.contains("  report.html") && sums.contains("  provenance/methods.md"));
    assert!(sums.contains("  stages/01-volume/slices-axial.png"));
}

#[test]
fn the_page_is_the_same_at_any_number_of_threads_and_from_the_middle() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (path, overrides) = scan(folder.path());
    let pages = [1, 3].map(|threads| {
        let out = folder.path().join(threads.to_string());
        run(&path, &out, &overrides, threads).expect("a run");
        text(&out, "report.html")
    });
    assert!(pages[0] == pages[1]);
    // The scan is gone; the page has its slices all the same.
    let out = folder.path().join("3");
    fs::remove_file(&path).expect("removed");
    run_from(&path, &out, &overrides, Stage::Report).expect("a run");
    assert!(text(&out, "report.html") == pages[0]);
}

#[test]
fn the_page_of_a_traced_tree_says_that_there_is_no_scan() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut overrides = small_swarm();
    run(&fixture("neuron.swc"), folder.path(), &overrides, 2).expect("a run");
    let page = text(folder.path(), "report.html");
    assert!(page.contains("there is no scan and no mask"));
    assert_eq!(page.matches("data:image").count(), 1, "the tree in space");
    assert!(!page.contains("<code>volume."), "no settings of stages that did not run");
    // Without a page its methods are still there.
    overrides.push(set("report.enabled", false));
    run_from(&fixture("neuron.swc"), folder.path(), &overrides, Stage::Report).expect("a run");
    assert!(!folder.path().join("report.html").exists());
    assert!(folder.path().join("provenance/methods.md").exists());
}
