//! A folder of DICOM slices as the user meets it: runs, choices, and nothing of the patient in any output.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

#[path = "../../volume/tests/slices/mod.rs"]
mod slices;

mod program;

use std::fs;
use std::io::Read;
use std::path::Path;

use program::{espalier, files_below, stderr};
use slices::{SECRETS, Slice, stack, write};

/// A folder `scan` of slices 2 mm apart, with names that are a patient's.
fn scan(slices: &[Slice]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    fs::create_dir(folder.path().join("scan")).expect("writable");
    write(&folder.path().join("scan"), slices, |index| format!("DOE^JANE-{}.dcm", 9 - index));
    folder
}

/// The bytes of a file, unpacked where it is compressed.
fn content(path: &Path) -> Vec<u8> {
    let bytes = fs::read(path).expect("readable");
    if !bytes.starts_with(&[0x1F, 0x8B]) {
        return bytes;
    }
    let mut unpacked = Vec::new();
    flate2::read::MultiGzDecoder::new(bytes.as_slice()).read_to_end(&mut unpacked).expect("a gzip file");
    unpacked
}

const BAND: [&str; 4] = ["--set", "volume.method=threshold", "--set", "volume.lower=-800"];

#[test]
fn nothing_of_the_patient_reaches_an_output() {
    let folder = scan(&stack(&[0.0, 2.0, 4.0, 6.0, 6.0]));
    for arguments in [["volume", "scan", "-o", "out"], ["volume", "scan/DOE^JANE-8.dcm", "-o", "out2"]] {
        let output = espalier(folder.path(), &[arguments.as_slice(), &BAND].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(stderr(&output).contains("1 images are copies"), "{}", stderr(&output));
    }
    let files = files_below(&folder.path().join("out"));
    assert!(files.len() > 5);
    for path in files {
        let bytes = content(&path);
        for secret in SECRETS {
            let holds = bytes.windows(secret.len()).any(|window| window == secret.as_bytes());
            assert!(!holds, "{secret} stands in {}", path.display());
        }
    }
    // A folder and one file of it are the same input.
    let inputs =
        |out: &str| fs::read_to_string(folder.path().join(out).join("provenance/inputs.tsv")).expect("text");
    assert_eq!(inputs("out"), inputs("out2"));
    assert_eq!(inputs("out").lines().filter(|line| line.starts_with("input\t")).count(), 4);
}

/// A run that goes on later knows its slices by their content.
#[test]
fn another_series_is_another_input() {
    let folder = scan(&stack(&[0.0, 2.0, 4.0, 6.0]));
    let first =
        espalier(folder.path(), &[["run", "scan", "--to", "volume", "-o", "out"].as_slice(), &BAND].concat());
    assert!(first.status.success(), "{}", stderr(&first));
    let again = ["run", "scan", "--from", "skeleton", "--to", "skeleton", "-o", "out"];
    let same = espalier(folder.path(), &[again.as_slice(), &BAND].concat());
    assert!(same.status.success(), "{}", stderr(&same));
    let mut changed = Slice::at(2.0);
    changed.values[0] += 1;
    fs::write(folder.path().join("scan/DOE^JANE-8.dcm"), changed.bytes()).expect("writable");
    let other = espalier(folder.path(), &[again.as_slice(), &BAND].concat());
    assert_eq!(other.status.code(), Some(2), "{}", stderr(&other));
}

#[test]
fn series_and_resampling_are_chosen() {
    let mut slices = stack(&[0.0, 2.0, 4.0]);
    slices.extend(stack(&[0.0, 2.0, 4.0, 7.0, 10.0]).into_iter().map(|slice| Slice { series: 12, ..slice }));
    let folder = scan(&slices);
    let run = |more: &[&str]| {
        let arguments = [["volume", "scan", "-o", "out"].as_slice(), &BAND, more].concat();
        let output = espalier(folder.path(), &arguments);
        (output.status.code(), stderr(&output))
    };
    let (code, text) = run(&[]);
    assert!(code == Some(2) && text.contains("--series 2: number 12, CT, 5 images"), "{text}");
    let (code, text) = run(&["--series", "2"]);
    assert!(
        code == Some(3) && text.contains("from 2.000 to 3.000 mm") && text.contains("--resample"),
        "{text}"
    );
    let (code, text) = run(&["--series", "2", "--resample"]);
    assert!(code == Some(0) && text.contains("W-DICOM-RESAMPLED"), "{text}");
    let (code, text) = run(&["--set", "input.series=0"]);
    assert!(code == Some(2) && text.contains("series count from 1"), "{text}");
}

/// A folder of slices is an input wherever a config or another input is.
#[test]
fn a_series_is_compared_and_swept_like_any_input() {
    let mut slices = stack(&[0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
    slices.iter_mut().for_each(|slice| slice.values.fill(100));
    let folder = scan(&slices);
    let band = ["--set", "volume.method=threshold", "--set", "volume.lower=-2000", "-q"];
    for arguments in [
        ["compare", "scan", "-o", "compared"].as_slice(),
        &["sweep", "scan", "--over", "embed.w_length=1,2", "-o", "swept"],
    ] {
        let output = espalier(folder.path(), &[arguments, &band].concat());
        let text = stderr(&output);
        // Six slices of a few pixels are no tree, which is told by the stage that finds out.
        assert!(!text.contains("holds no run"), "{text}");
        assert!(output.status.success() || text.contains("skeleton") || text.contains("tree"), "{text}");
    }
}
