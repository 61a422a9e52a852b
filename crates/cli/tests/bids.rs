//! A BIDS data set, as its user meets it.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;
use std::path::Path;

use program::{QUICK, Said, espalier, files_below, stderr};
use serde_json::Value;

/// A gzipped mask of 12³ voxels: a bar along x, or nothing.
fn mask(is_empty: bool) -> Vec<u8> {
    let grid =
        espalier_model::Grid::axis_aligned([12; 3], glam::DVec3::ONE, glam::DVec3::ZERO).expect("a grid");
    let is_bar = |idx: usize| {
        (4..8).contains(&(idx / 144)) && (4..8).contains(&(idx / 12 % 12)) && !idx.is_multiple_of(12)
    };
    let voxels: Vec<bool> = (0..12 * 12 * 12).map(|idx| is_bar(idx) && !is_empty).collect();
    espalier_model::nifti_out::mask(&espalier_model::Mask::from_voxels(grid, &voxels)).expect("bytes")
}

/// Two sessions of one participant, an empty mask of another, a third without a mask, and one who is only in the list.
fn data() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    let root = folder.path().join("in");
    let write = |file: &str, bytes: &[u8]| {
        let path = root.join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, bytes).expect("writable");
    };
    let description = r#"{ "Name": "Bars", "BIDSVersion": "1.10.0", "DatasetDOI": "doi:10.1/x" }"#;
    write("dataset_description.json", description.as_bytes());
    write("participants.tsv", b"participant_id\tage\nsub-01\t40\nsub-02\t50\nsub-03\t60\nsub-09\t70\n");
    write("sub-01/ses-A/anat/sub-01_ses-A_desc-bar_mask.nii.gz", &mask(false));
    write("sub-01/ses-A/anat/sub-01_ses-A_desc-bar_mask.json", b"{}");
    write("sub-01/ses-A/anat/sub-01_ses-A_T1w.nii.gz", &mask(false));
    write("sub-01/ses-B/anat/sub-01_ses-B_desc-bar_mask.nii.gz", &mask(false));
    write("sub-02/anat/sub-02_desc-bar_mask.nii.gz", &mask(true));
    write("sub-03/anat/sub-03_T1w.nii.gz", &mask(false));
    write("derivatives/other/sub-01/anat/sub-01_mask.nii.gz", &mask(false));
    folder
}

fn bids(folder: &Path, arguments: &[&str]) -> Said {
    let output = espalier(folder, &[&["bids"], arguments, QUICK.as_slice()].concat());
    Said::by(&output)
}

fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).expect("a table");
    text.lines().skip(1).map(|line| line.split('\t').map(str::to_owned).collect()).collect()
}

const BAR_A: &str = "sub-01/ses-A/anat/sub-01_ses-A_desc-bar_mask";

#[test]
fn participants_and_their_page() {
    let folder = data();
    let at = folder.path();
    let done = bids(at, &["in", "out", "participant", "--suffix", "mask"]);
    assert_eq!(done.code, Some(3), "{}", done.error);
    for said in [
        "1 of 3 scans failed; the first: sub-02_desc-bar_mask (E-VOLUME-EMPTY",
        "note: sub-03: no volume fits: suffix mask",
        "note: sub-09: in participants.tsv, but there is no such folder",
    ] {
        assert!(done.error.contains(said), "no {said:?} in {}", done.error);
    }
    assert!(at.join("out").join(BAR_A).join("embedding.json").exists());
    assert!(!at.join("out/group").exists());

    let page = bids(at, &["in", "out", "group", "--suffix", "mask"]);
    assert_eq!(page.code, Some(0), "{}", page.error);
    assert!(page.out.contains("5 runs, 2 certified, 3 without a map"), "{}", page.out);
    let failures = rows(&at.join("out/failures.tsv"));
    let told: Vec<(&str, &str)> = failures.iter().map(|row| (row[0].as_str(), row[1].as_str())).collect();
    let expected = [
        ("sub-02_desc-bar_mask", "E-VOLUME-EMPTY"),
        ("sub-03", "E-BIDS-NO-SCAN"),
        ("sub-09", "E-BIDS-NO-SCAN"),
    ];
    assert_eq!(told, expected);

    // Mended, the command of the list does it.
    fs::write(at.join("in/sub-02/anat/sub-02_desc-bar_mask.nii.gz"), mask(false)).expect("writable");
    let retry: Vec<&str> = failures[0][4].split(' ').skip(1).collect();
    assert_eq!(retry[..6], ["bids", "in", "out", "participant", "--participant-label", "02"]);
    let again = espalier(at, &retry);
    assert!(again.status.success(), "{}", stderr(&again));
    let page = bids(at, &["in", "out", "group", "--suffix", "mask"]);
    assert!(page.out.contains("5 runs, 3 certified, 2 without a map"), "{}", page.out);
}

#[test]
fn the_results_are_a_data_set_of_derivatives() {
    let folder = data();
    let at = folder.path();
    let chosen = ["in", "in/derivatives/espalier", "participant", "--suffix", "mask"];
    let labels = ["--participant-label", "sub-01", "02", "--session_label", "A"];
    let done = bids(at, &[&chosen[..], &labels].concat());
    assert_eq!(done.code, Some(0), "{}", done.error);
    let out = at.join("in/derivatives/espalier");
    let maps = files_below(&out).into_iter().filter(|path| path.ends_with("embedding.json")).count();
    assert_eq!(maps, 1, "one session of one participant");
    let text = fs::read_to_string(out.join("dataset_description.json")).expect("a description");
    let description: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(description["DatasetType"], "derivative");
    assert_eq!(description["GeneratedBy"][0]["Name"], "espalier");
    assert!(description["GeneratedBy"][0]["Version"].is_string() && description["BIDSVersion"].is_string());
    assert_eq!(description["SourceDatasets"][0]["DOI"], "doi:10.1/x");
    assert!(!text.contains(&at.display().to_string()));
    let ignored = fs::read_to_string(out.join(".bidsignore")).expect("a list");
    assert!(ignored.lines().any(|line| line == "sub-*/") && ignored.lines().any(|line| line == "group/"));
    // The same volume by `espalier run` has the same results.
    let input = "in/sub-01/ses-A/anat/sub-01_ses-A_desc-bar_mask.nii.gz";
    assert!(espalier(at, &[&["run", input, "-o", "run"], QUICK.as_slice()].concat()).status.success());
    let sums = |folder: &Path| fs::read(folder.join("SHA256SUMS")).expect("sums");
    assert_eq!(sums(&out.join(BAR_A)), sums(&at.join("run")));
}

#[test]
fn what_is_not_clear_is_refused() {
    let folder = data();
    let at = folder.path();
    let refused = |arguments: &[&str], code: i32, part: &str| {
        let said = bids(at, arguments);
        assert_eq!(said.code, Some(code), "{arguments:?}: {}", said.error);
        assert!(said.error.contains(part), "no {part:?} in {}", said.error);
    };
    refused(
        &["in", "out", "participant"],
        2,
        "error[E-BIDS-SUFFIX]: the data set has volumes of several kinds: T1w (2), mask (3)",
    );
    refused(&["in", "out", "participants"], 2, "participant");
    refused(&["in", "out", "participant", "--suffix", "ct"], 74, "has no volume that is meant: suffix ct");
    let label = ["in", "out", "participant", "--suffix", "mask", "--participant-label", "7"];
    refused(&label, 2, "error[E-BIDS-LABEL]: there is no participant 7; there are 01, 02, 03, 09");
    let filter = ["in", "out", "group", "--filter", "desc=other"];
    refused(&filter, 74, "suffix any, desc-other");
    refused(&["in", "in", "participant", "--suffix", "mask"], 73, "error[E-BIDS-OUTPUT]: in holds");
    refused(&["none", "out", "participant"], 74, "cannot read none");
    refused(
        &["in/sub-01", "out", "participant"],
        3,
        "error[E-BIDS-DATASET]: in/sub-01/dataset_description.json: there is no such file",
    );
    refused(&["none", "out", "participant", "--skip-bids-validation"], 74, "cannot read none");
    assert!(!at.join("out").exists());

    // One kind is left, so that it need not be named; and one session.
    let filter = ["in", "out", "group", "--filter", "desc=bar", "--session-label", "B"];
    let said = bids(at, &filter);
    assert_eq!(said.code, Some(0), "{}", said.error);
    assert!(said.out.contains("E-GROUP-NO-RUN"), "{}", said.out);

    // A list that cannot be read is not an empty one.
    let list = at.join("in/participants.tsv");
    let whole = fs::read(&list).expect("a list");
    let group = ["in", "out", "group", "--suffix", "mask"];
    fs::write(&list, "participant\tage\nsub-01\t40\n").expect("writable");
    refused(&group, 3, "in/participants.tsv: it has no column participant_id");
    assert_eq!(bids(at, &[&group[..], &["--skip-bids-validation"]].concat()).code, Some(0));
    fs::remove_file(&list).expect("removed");
    fs::create_dir(&list).expect("a folder");
    refused(&group, 74, "cannot read in/participants.tsv");
    fs::remove_dir(&list).expect("removed");
    fs::File::create(&list).and_then(|file| file.set_len((16 << 20) + 1)).expect("a long file");
    refused(&group, 5, "in/participants.tsv has 16777217 bytes, allowed are 16777216");
    // What is not UTF-8 stands in other columns.
    fs::write(&list, b"participant_id\tname\nsub-01\tM\xfcller\nsub-09\tx\n").expect("writable");
    assert!(bids(at, &group).out.contains("sub-09"));
    fs::write(&list, whole).expect("writable");

    fs::write(at.join("in/sub-02/anat/sub-05_desc-bar_mask.nii.gz"), mask(false)).expect("writable");
    refused(&["in", "out", "group", "--suffix", "mask"], 3, "its name is not that of sub-02");
    fs::remove_file(at.join("in/dataset_description.json")).expect("removed");
    refused(
        &["in", "out", "group", "--suffix", "mask"],
        3,
        "dataset_description.json: there is no such file",
    );
    let said = bids(at, &["in", "out", "group", "--suffix", "mask", "--skip_bids_validation"]);
    assert_eq!(said.code, Some(0), "{}", said.error);
}
