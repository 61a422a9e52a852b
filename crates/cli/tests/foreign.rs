//! What lies in the folder for the results and is none of ours: nothing takes its place unasked.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::fs;
use std::path::Path;

use program::{QUICK, Said, espalier, files_below, fork};

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    fs::write(folder.path().join("fork.swc"), fork(20.0)).expect("write");
    folder
}

fn run(folder: &Path, more: &[&str]) -> Said {
    Said::by(&espalier(folder, &[&["run", "fork.swc", "--set", "input.unit=mm"], &QUICK[..], more].concat()))
}

fn digest(said: &Said) -> String {
    assert_eq!(said.code, Some(0), "{}", said.error);
    said.out.lines().last().expect("a digest").to_owned()
}

#[test]
fn a_file_of_somebody_elses_stays() {
    let whole = folder();
    let expected = digest(&run(whole.path(), &["-o", "out"]));
    for (name, text) in [("tree.swc", "my own"), ("report.html", "notes"), ("SHA256SUMS", "00  other/file\n")]
    {
        let folder = folder();
        let file = folder.path().join(name);
        fs::write(&file, text).expect("write");
        let before = files_below(folder.path());
        for more in [["-o", "."].as_slice(), &["-o", ".", "--dry-run"], &["-o", "."]] {
            let said = run(folder.path(), more);
            assert_eq!(said.code, Some(73), "{name}: {}", said.error);
            assert!(
                said.error.contains("error[E-RUN-IN-WAY]: ./") && said.error.contains(name),
                "{}",
                said.error
            );
            assert!(
                said.error.contains("hint: move it away") && said.error.contains("--force"),
                "{}",
                said.error
            );
        }
        assert_eq!(files_below(folder.path()), before, "nothing is left behind");
        assert_eq!(fs::read_to_string(&file).expect("text"), text);
        assert_eq!(digest(&run(folder.path(), &["-o", ".", "--force"])), expected);
        assert_eq!(digest(&run(folder.path(), &["-o", "."])), expected, "it is ours now");
    }
}

#[test]
fn a_file_beside_results_stays_too() {
    let folder = folder();
    assert_eq!(run(folder.path(), &["-o", "out", "--to", "views"]).code, Some(0));
    let picture = folder.path().join("out/planar.png");
    fs::write(&picture, "mine").expect("write");
    let said = run(folder.path(), &["-o", "out"]);
    assert!(said.code == Some(73) && said.error.contains("out/planar.png was not made"), "{}", said.error);
    assert_eq!(fs::read(&picture).expect("bytes"), b"mine");
    fs::remove_file(&picture).expect("remove");
    // A result that was altered, or whose list is gone, is ours all the same, and made again.
    let whole = digest(&run(folder.path(), &["-o", "out"]));
    fs::write(folder.path().join("out/nodes.tsv"), "altered").expect("write");
    assert_eq!(digest(&run(folder.path(), &["-o", "out"])), whole);
    fs::remove_file(folder.path().join("out/SHA256SUMS")).expect("remove");
    assert_eq!(digest(&run(folder.path(), &["-o", "out"])), whole);
}

/// A run that ends early removes the results of later stages: those that are ones.
#[test]
fn a_file_under_the_name_of_a_later_result_stays() {
    let scan = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/y.nii.gz");
    for name in ["planar.png", "views.json", "report.html"] {
        let folder = folder();
        fs::copy(&scan, folder.path().join("mask.nii.gz")).expect("copy");
        fs::write(folder.path().join(name), "mine").expect("write");
        let before = files_below(folder.path());
        let on_mask = ["skeleton", "mask.nii.gz", "-o", "."];
        for said in [
            run(folder.path(), &["-o", ".", "--to", "tree"]),
            run(folder.path(), &["-o", ".", "--to", "tree", "--dry-run"]),
            Said::by(&espalier(folder.path(), &on_mask)),
        ] {
            assert_eq!(said.code, Some(73), "{name}: {}", said.error);
            assert!(
                said.error.contains("error[E-RUN-IN-WAY]: ./") && said.error.contains(name),
                "{}",
                said.error
            );
        }
        assert_eq!(files_below(folder.path()), before, "nothing is left behind");
        assert_eq!(fs::read(folder.path().join(name)).expect("bytes"), b"mine");
    }
}

#[test]
fn an_input_under_the_name_of_a_later_result_stays() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let scan = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/y.nii.gz");
    let input = folder.path().join("branches.nii.gz");
    fs::copy(&scan, &input).expect("copy");
    for arguments in [
        ["run", "branches.nii.gz", "-o", ".", "--to", "skeleton"].as_slice(),
        &["run", "branches.nii.gz", "-o", ".", "--to", "skeleton", "--force"],
        &["run", "branches.nii.gz", "-o", ".", "--to", "skeleton", "--dry-run"],
        &["skeleton", "branches.nii.gz", "-o", ".", "--force"],
    ] {
        let said = Said::by(&espalier(folder.path(), arguments));
        assert_eq!(said.code, Some(2), "{}", said.error);
        assert!(said.error.contains("error[E-RUN-INPUT-IN-WAY]"), "{}", said.error);
        assert_eq!(fs::read(&input).expect("bytes"), fs::read(&scan).expect("bytes"));
    }
}

/// As a run leaves it that was killed while results of a stage changed.
#[test]
fn what_a_killed_run_has_left_counts_as_ours_from_its_stage_on() {
    let whole = folder();
    let expected = digest(&run(whole.path(), &["-o", "out"]));
    let killed_at = |stage: &str, left: &str| {
        let folder = folder();
        fs::create_dir(folder.path().join("out")).expect("folder");
        fs::write(folder.path().join("out/.lock"), format!("changing{stage}\n")).expect("write");
        fs::write(folder.path().join("out").join(left), "left").expect("write");
        folder
    };
    for (stage, left) in
        [(" tree", "tree.swc"), (" tree", "planar.png"), (" embed", "dictionary.tsv"), ("", "tree.swc")]
    {
        let folder = killed_at(stage, left);
        let dry = run(folder.path(), &["-o", "out", "--dry-run"]);
        assert_eq!(dry.code, Some(0), "{stage} {left}: {}", dry.error);
        assert_eq!(fs::read(folder.path().join("out").join(left)).expect("bytes"), b"left");
        assert_eq!(digest(&run(folder.path(), &["-o", "out"])), expected);
    }
    for (stage, left) in [(" embed", "tree.swc"), (" report", "planar.png")] {
        let folder = killed_at(stage, left);
        for more in [["-o", "out"].as_slice(), &["-o", "out", "--dry-run"]] {
            let said = run(folder.path(), more);
            assert_eq!(said.code, Some(73), "{stage} {left}: {}", said.error);
        }
        assert_eq!(fs::read(folder.path().join("out").join(left)).expect("bytes"), b"left");
    }
}

#[test]
fn a_folder_in_place_of_a_result_is_named() {
    for name in ["tree.swc", "stages/04-tree/report.json", "SHA256SUMS", "provenance/run.json"] {
        let folder = folder();
        fs::create_dir_all(folder.path().join("out").join(name).join("inside")).expect("folder");
        for more in [["-o", "out"].as_slice(), &["-o", "out", "--force"], &["-o", "out", "--dry-run"]] {
            let said = run(folder.path(), more);
            assert_eq!(said.code, Some(73), "{}", said.error);
            assert!(
                said.error.contains(&format!("error[E-RUN-IN-WAY]: out/{name} is a folder")),
                "{}",
                said.error
            );
            assert!(said.error.contains("hint: move it away"), "{}", said.error);
        }
        fs::remove_dir_all(folder.path().join("out").join(name)).expect("remove");
        digest(&run(folder.path(), &["-o", "out"]));
    }
}

/// What a dry run cannot read, the run cannot either.
#[test]
fn a_dry_run_tells_of_an_input_that_cannot_be_read() {
    let folder = folder();
    let put = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).expect("write");
    put("bad.swc", b"1 0 0 0 0 2 -1\n2 0 0 x 0 2 1\n");
    put("cut.nii", &[92, 1, 0, 0, 1, 2, 3]);
    for (input, code) in [("bad.swc", "E-SWC-NUMBER"), ("cut.nii", "E-VOLUME-"), ("nowhere.swc", "E-IO-READ")]
    {
        let dry = Said::by(&espalier(folder.path(), &["run", input, "-o", "out", "--dry-run"]));
        let wet = Said::by(&espalier(folder.path(), &["run", input, "-o", "out"]));
        assert_eq!(dry.code, wet.code, "{}", dry.error);
        let first =
            |said: &Said| said.error.lines().find(|line| line.starts_with("error[")).map(str::to_owned);
        assert!(first(&dry).is_some_and(|line| line.contains(code)), "{}", dry.error);
        assert_eq!(first(&dry), first(&wet));
    }
    // What stands is not read again.
    assert_eq!(run(folder.path(), &["-o", "done"]).code, Some(0));
    assert_eq!(run(folder.path(), &["-o", "done", "--dry-run"]).code, Some(0));
}

#[test]
fn a_config_that_is_there_is_told_as_a_file() {
    let folder = folder();
    let init = || Said::by(&espalier(folder.path(), &["config", "init", "neuron", "-o", "my.toml"]));
    assert_eq!(init().code, Some(0));
    let again = init();
    assert_eq!(again.code, Some(73));
    assert!(again.error.contains("my.toml") && again.error.contains("another place"), "{}", again.error);
    assert!(!again.error.contains("folder"), "{}", again.error);
}
