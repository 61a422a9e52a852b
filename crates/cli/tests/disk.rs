//! Disks that are full and folders that take nothing: the code and the file are named, what was there before stays whole, and
//! the same command with room gives what it would have given.
#![cfg(target_os = "linux")]
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::path::Path;
use std::process::{Command, Output};

use program::{espalier, files_below, stderr};

const FORK: &[u8] = b"1 1 0 0 0 3 -1\n2 3 0 9 0 2 1\n3 3 9 18 4 1 2\n4 3 -9 18 -4 1 2\n";
const RUN: [&str; 8] =
    ["run", "fork.swc", "-o", "out", "--set", "render.width_px=256", "--set", "embed.methods=[\"marino\"]"];

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    std::fs::write(folder.path().join("fork.swc"), FORK).expect("write");
    folder
}

/// The program where no file may grow beyond so many blocks: a write that would is refused, or, if the signal is not
/// ignored, ends the program in the middle of it.
fn limited(folder: &Path, blocks: u32, is_signal_ignored: bool, arguments: &[&str]) -> Output {
    let ignore = if is_signal_ignored { "trap '' XFSZ; " } else { "" };
    Command::new("sh")
        .args(["-c", &format!("{ignore}ulimit -f {blocks}; exec \"$@\""), "sh"])
        .arg(env!("CARGO_BIN_EXE_espalier"))
        .args(arguments)
        .current_dir(folder)
        .env_remove("ESPALIER_DATA")
        .output()
        .expect("the program starts")
}

/// The digest that a run prints last.
fn digest(folder: &Path, arguments: &[&str]) -> String {
    let output = espalier(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().last().expect("a line").to_owned()
}

/// What `SHA256SUMS` names is there, and nothing is left half-written.
fn assert_whole(folder: &Path) {
    let output = Command::new("sha256sum")
        .args(["--quiet", "-c", "SHA256SUMS"])
        .current_dir(folder.join("out"))
        .output()
        .expect("sha256sum");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
}

fn leftovers(folder: &Path) -> Vec<String> {
    let names =
        files_below(folder).into_iter().filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()));
    names.filter(|name| name.starts_with('.') && name != ".lock").collect()
}

#[test]
fn a_full_disk_is_told_and_harms_nothing() {
    let whole = folder();
    let expected = digest(whole.path(), &RUN);
    let mut n_refused = 0;
    for blocks in [1, 8, 40, 200] {
        let folder = folder();
        let output = limited(folder.path(), blocks, true, &RUN);
        let said = stderr(&output);
        if output.status.code() == Some(0) {
            continue;
        }
        n_refused += 1;
        assert_eq!(output.status.code(), Some(74), "{blocks} blocks: {said}");
        assert!(
            said.contains("error[E-IO-WRITE]: cannot write") && said.contains("hint: check the free space"),
            "{said}"
        );
        assert!(said.contains("stopped: "), "{said}");
        assert_eq!(leftovers(folder.path()), [""; 0]);
        assert_eq!(digest(folder.path(), &RUN), expected);
    }
    assert!(n_refused >= 2, "the limits were no limits");
}

#[test]
fn earlier_results_stay_as_they_are() {
    let folder = folder();
    let first = digest(folder.path(), &RUN);
    let other = [&RUN[..], &["--set", "embed.w_angle=3", "--set", "render.theme=dark"]].concat();
    // Enough for the tables, not for the pictures.
    let output = limited(folder.path(), 40, true, &other);
    assert_eq!(output.status.code(), Some(74), "{}", stderr(&output));
    assert_whole(folder.path());
    assert_eq!(digest(folder.path(), &RUN), first);
}

#[test]
fn killed_in_the_middle_of_a_write() {
    let whole = folder();
    let expected = digest(whole.path(), &RUN);
    let folder = folder();
    for blocks in [1, 8, 40, 200] {
        let output = limited(folder.path(), blocks, false, &RUN);
        assert!(output.status.code() != Some(74), "{}", stderr(&output));
        if folder.path().join("out/SHA256SUMS").exists() {
            assert_whole(folder.path());
        }
    }
    assert_eq!(digest(folder.path(), &RUN), expected);
    assert_eq!(leftovers(folder.path()), [""; 0]);
}

#[test]
fn a_folder_that_cannot_be_made() {
    let folder = folder();
    std::fs::write(folder.path().join("file"), "no folder").expect("write");
    for out in ["file/out", "/proc/espalier/out"] {
        let mut arguments = RUN.to_vec();
        arguments[3] = out;
        let output = espalier(folder.path(), &arguments);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(73), "{said}");
        assert!(said.contains("error[E-IO-CREATE]: cannot create") && said.contains("with -o"), "{said}");
    }
}

#[test]
fn results_that_cannot_be_printed() {
    let folder = folder();
    for arguments in [&RUN[..], &["--help"], &["--version"], &["embed", "--help"], &["explain"]] {
        let full = std::fs::File::options().write(true).open("/dev/full").expect("/dev/full");
        let output = Command::new(env!("CARGO_BIN_EXE_espalier"))
            .args(arguments)
            .current_dir(folder.path())
            .stdout(full)
            .output()
            .expect("the program starts");
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(74), "{arguments:?}: {said}");
        assert_eq!(said.matches("error[E-IO-PRINT]: cannot print results").count(), 1, "{said}");
    }
    assert_whole(folder.path());
}
