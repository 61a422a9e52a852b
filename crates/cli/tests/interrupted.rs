//! Runs that are killed, cancelled, or meet in one folder: the same command afterwards gives the same digest.
#![cfg(unix)]
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod program;

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use program::{espalier, stderr};

/// A fork of three branches.
const FORK: &[u8] =
    b"1 1 0 0 0 3 -1\n2 3 0 9 0 2 1\n3 3 9 18 4 1 2\n4 3 -9 18 -4 1 2\n5 3 18 20 6 1 3\n6 3 9 30 9 1 3\n";
const RUN: [&str; 8] =
    ["run", "fork.swc", "-o", "out", "--set", "render.width_px=256", "--set", "embed.methods=[\"marino\"]"];

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    std::fs::write(folder.path().join("fork.swc"), FORK).expect("write");
    folder
}

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_espalier"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

/// The digest that a run prints last.
fn digest(folder: &Path) -> String {
    let output = espalier(folder, &RUN);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines().last().expect("a line").to_owned()
}

fn signal(child: &Child, name: &str) {
    let status = Command::new("kill").args([format!("-{name}"), child.id().to_string()]).status();
    assert!(status.expect("kill").success());
}

#[allow(clippy::disallowed_methods, reason = "a test's size, and its clock")]
fn n_kills() -> u32 {
    std::env::var("ESPALIER_KILLS").ok().and_then(|text| text.parse().ok()).unwrap_or(10)
}

/// `ESPALIER_KILLS` for more of them.
#[test]
#[allow(clippy::disallowed_methods, reason = "a test's clock")]
fn killed_at_any_instant_and_run_again() {
    let whole = folder();
    let began = Instant::now();
    let expected = digest(whole.path());
    let length = began.elapsed();
    for index in 0..n_kills() {
        let folder = folder();
        // The golden ratio spreads the instants evenly, however many there are.
        let share = (f64::from(index) * 0.618_033_988_75).fract();
        let mut child = start(folder.path(), &RUN);
        std::thread::sleep(length.mul_f64(share));
        let _ = child.kill();
        child.wait().expect("the end");
        assert_eq!(digest(folder.path()), expected, "killed after {share:.3} of a run");
    }
}

#[test]
fn a_run_that_is_told_to_stop_says_what_is_left() {
    for (name, code) in [("INT", 130), ("TERM", 143)] {
        let folder = folder();
        // Held by another, so that it is there to be told.
        std::fs::create_dir(folder.path().join("out")).expect("folder");
        let lock = std::fs::File::create(folder.path().join("out/.lock")).expect("lock file");
        lock.lock().expect("lock");
        let mut arguments = RUN.to_vec();
        arguments.push("--wait");
        let mut child = start(folder.path(), &arguments);
        let mut said = std::io::BufReader::new(child.stderr.take().expect("a pipe"));
        let mut line = String::new();
        std::io::BufRead::read_line(&mut said, &mut line).expect("a line");
        assert!(line.contains("waiting for another run"), "{line}");
        signal(&child, name);
        assert_eq!(child.wait().expect("the end").code(), Some(code));
        line.clear();
        std::io::BufRead::read_line(&mut said, &mut line).expect("a line");
        assert!(line.contains("cancelled"), "{line}");
    }
}

#[test]
fn those_who_meet_in_a_folder_wait_or_stop() {
    let folder = folder();
    let mut waiting = RUN.to_vec();
    waiting.push("--wait");
    let runs: Vec<Child> =
        (0..6).map(|index| start(folder.path(), if index % 2 == 0 { &waiting } else { &RUN })).collect();
    for (index, run) in runs.into_iter().enumerate() {
        let code = run.wait_with_output().expect("the end").status.code();
        // One that does not wait may come first, or after all others.
        let expected: &[i32] = if index % 2 == 0 { &[0] } else { &[0, 75] };
        assert!(code.is_some_and(|code| expected.contains(&code)), "run {index}: {code:?}");
    }
    let alone = self::folder();
    assert_eq!(digest(folder.path()), digest(alone.path()));
}

#[test]
fn a_dry_run_tells_what_would_be_done_and_writes_nothing() {
    let folder = folder();
    let plan = |extra: &[&str]| {
        let output = espalier(folder.path(), &[&RUN[..], &["--dry-run"], extra].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    assert!(plan(&[]).starts_with("tree      to do: not done yet\n"));
    assert!(!folder.path().join("out").exists());
    digest(folder.path());
    assert!(plan(&[]).lines().all(|line| line.ends_with("kept")), "{}", plan(&[]));
    let changed = plan(&["--set", "embed.w_angle=3"]);
    assert!(
        changed.contains("views     kept\nembed     to do: embed.w_angle is 3.0, was 2.0\n"),
        "{changed}"
    );
    let forced = plan(&["--force"]);
    let is_stage = |line: &&str| line.contains("to do: asked for");
    assert_eq!(forced.lines().filter(is_stage).count(), 5, "{forced}");
}

#[test]
fn completions_know_the_commands() {
    let folder = folder();
    let output = espalier(folder.path(), &["completions", "bash"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0));
    assert!(text.contains("juxtapose") && text.contains("--dry-run"));
}
