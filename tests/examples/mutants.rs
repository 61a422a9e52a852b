//! Mutants of every reader, as many as are asked for: `scripts/mutants`.
//!
//! **Input** `N SEED [READER]`, or `--again READER SEED INDEX [FOLDER]`, or `--seeds FOLDER`. **Output** for each reader how many were
//! accepted and refused, by code; panics, the slowest, the most memory.
//! **Steps** a process for each reader, so that one that overflows its stack or is killed is told by its number; as many
//! at a time as the machine has cores.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "this is how a program speaks")]

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::Mutex;
use std::time::Duration;

use espalier_tests::hostile::campaign::{MAX_SECONDS, Tally, Watch, run};
use espalier_tests::hostile::{Reader, readers};
use peak_alloc::PeakAlloc;

/// Counts what is held.
#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

/// Mutants between two notes of how far it is.
const BLOCK: u32 = 1000;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match words.as_slice() {
        ["--again", reader, seed, index, rest @ ..] => again(reader, (seed, index), rest.first().copied()),
        ["--seeds", folder] => Some(write_seeds(Path::new(folder)).is_ok()),
        ["--worker", reader, n, seed] => worker(reader, n, seed),
        [n, seed, rest @ ..] => all(n, seed, rest.first().copied()),
        _ => None,
    };
    match done {
        Some(true) => ExitCode::SUCCESS,
        Some(false) => ExitCode::FAILURE,
        None => {
            eprintln!(
                "scripts/mutants N SEED [READER] | --again READER SEED INDEX [FOLDER] | --seeds FOLDER"
            );
            ExitCode::from(2)
        }
    }
}

/// Every reader, or one; whether none failed.
fn all(n: &str, seed: &str, only: Option<&str>) -> Option<bool> {
    let (_, _) = (n.parse::<u32>().ok()?, seed.parse::<u64>().ok()?);
    let names: Vec<&str> = readers().iter().map(|reader| reader.name).collect();
    if only.is_some_and(|only| !names.contains(&only)) {
        return None;
    }
    let left: Mutex<Vec<&str>> =
        Mutex::new(names.into_iter().rev().filter(|name| only.is_none_or(|only| only == *name)).collect());
    let n_failed = Mutex::new(0);
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(name) = left.lock().ok().and_then(|mut left| left.pop()) {
                    let is_fine = child(name, n, seed);
                    if let Ok(mut n_failed) = n_failed.lock() {
                        *n_failed += usize::from(!is_fine);
                    }
                }
            });
        }
    });
    Some(n_failed.into_inner().is_ok_and(|n_failed| n_failed == 0))
}

/// One reader in a process of its own.
fn child(name: &str, n: &str, seed: &str) -> bool {
    let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("mutants"));
    let output = Command::new(program).args(["--worker", name, n, seed]).stderr(Stdio::inherit()).output();
    let Ok(output) = output else { return false };
    let text = String::from_utf8_lossy(&output.stdout);
    // The last note of how far it was comes before what it was killed by.
    let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with("at ")).collect();
    println!("{}", lines.join("\n"));
    if !output.status.success() && lines.is_empty() {
        let last = text.lines().last().unwrap_or("at 0").trim_start_matches("at ");
        println!("{name}: ended with {} in the {BLOCK} mutants from {last}", output.status);
    }
    output.status.success()
}

fn worker(name: &str, n: &str, seed: &str) -> Option<bool> {
    let (n, seed) = (n.parse::<u32>().ok()?, seed.parse::<u64>().ok()?);
    let reader = find(name)?;
    std::panic::set_hook(Box::new(|_| {}));
    let watch = Watch::over(format!("scripts/mutants --again {name} {seed}"), Duration::from_secs(60));
    let mut tally = Tally::default();
    for start in (0..n).step_by(BLOCK as usize) {
        println!("at {start}");
        tally.extend(run(&reader, seed, start..n.min(start + BLOCK), &watch));
    }
    println!("{name}: {tally}");
    for (index, what) in &tally.failures {
        println!("  scripts/mutants --again {name} {seed} {index}: {what}");
    }
    Some(tally.failures.is_empty())
}

/// Makes a mutant again, writes its files, and reads it, without a net.
fn again(name: &str, (seed, index): (&str, &str), folder: Option<&str>) -> Option<bool> {
    let (seed, index) = (seed.parse::<u64>().ok()?, index.parse::<u32>().ok()?);
    let reader = find(name)?;
    let mutant = reader.mutant(seed, index);
    let folder = Path::new(folder.unwrap_or("mutant"));
    for (file, bytes) in &mutant.files {
        let path = folder.join(file);
        let written =
            path.parent().map(std::fs::create_dir_all).and_then(|_| std::fs::write(&path, bytes).ok());
        println!(
            "{} ({} bytes{})",
            path.display(),
            bytes.len(),
            if written.is_some() { "" } else { ", not written" }
        );
    }
    println!("{:?} (allowed: {MAX_SECONDS} s)", reader.read(&mutant, index));
    Some(true)
}

/// The first file of each seed, in a folder for each fuzz target.
fn write_seeds(folder: &Path) -> std::io::Result<()> {
    for reader in readers() {
        let corpus = folder.join(reader.name.replace(['.', '-'], "_"));
        std::fs::create_dir_all(&corpus)?;
        for (index, seed) in reader.unchanged().iter().enumerate() {
            std::fs::write(corpus.join(index.to_string()), &seed.files[0].1)?;
        }
    }
    Ok(())
}

fn find(name: &str) -> Option<Reader> {
    readers().into_iter().find(|reader| reader.name == name)
}
