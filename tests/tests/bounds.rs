//! Inputs that claim or unpack to far more than they hold: refused by name, without the memory.
//!
//! What is held at the peak is counted by the allocator, so that no figure here depends on the machine. The table of
//! the data's files through the program: `scripts/refusals`.
#![allow(clippy::expect_used, reason = "this is how a test speaks")]

use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;

use espalier_model::swc::{self, SwcScale};
use espalier_model::{Diagnose, polydata};
use espalier_tests::hostile::bombs::{self, Bomb};
use espalier_tests::hostile::campaign::MAX_PEAK_BYTES;
use espalier_volume::{ReadOptions, read};
use glam::DVec3;
use peak_alloc::PeakAlloc;

/// Counts what is held.
#[global_allocator]
static ALLOCATOR: PeakAlloc = PeakAlloc;

const MAX_BYTES: u64 = 1 << 30;

/// The result of a call, and the most bytes that it held.
fn measured<T>(call: impl FnOnce() -> T) -> (T, usize) {
    ALLOCATOR.reset_peak_usage();
    let held = ALLOCATOR.current_usage();
    let result = call();
    (result, ALLOCATOR.peak_usage().saturating_sub(held))
}

/// One test, as memory is counted for the whole program.
#[test]
fn bombs_take_no_memory() {
    volumes();
    polylines();
    traced();
    config();
}

fn volumes() {
    let options = ReadOptions { max_bytes: MAX_BYTES, ..ReadOptions::default() };
    for Bomb { name, code, files, legal_bytes } in bombs::volumes() {
        let folder = tempfile::tempdir().expect("a folder");
        files.iter().for_each(|file| write(folder.path(), file));
        let path = if files.len() > 1 { folder.path().to_owned() } else { folder.path().join(files[0].name) };
        drop(files);
        let (result, peak) = measured(|| read(&path, &options).map(drop));
        let error = result.expect_err(name);
        assert_eq!(error.code(), code, "{name}: {error}");
        let limit = MAX_PEAK_BYTES + 2 * legal_bytes;
        assert!(peak < limit, "{name}: {} MB at the peak", peak >> 20);
    }
}

fn write(folder: &Path, file: &bombs::BombFile) {
    let mut open = File::create(folder.join(file.name)).expect("writable");
    open.write_all(&file.bytes).expect("writable");
    // The rest is a hole.
    open.set_len(file.bytes.len() as u64 + file.n_zeros).expect("writable");
}

/// Files of lines keep to any limit, the bytes of the file included.
fn polylines() {
    for (name, bytes) in bombs::polylines() {
        for max_bytes in [8 << 20, 64 << 20] {
            let scale = SwcScale::millimetres();
            let (result, peak) =
                measured(|| polydata::parse(&bytes, &scale, Some(DVec3::ONE), max_bytes).map(drop));
            assert!(peak + bytes.len() <= max_bytes as usize, "{name} of {}: {} KB", bytes.len(), peak >> 10);
            let error = result.expect_err(name);
            assert!(
                ["E-POLYDATA-TOO-LARGE", "E-POLYDATA-XML", "E-POLYDATA-NO-LINES"].contains(&error.code()),
                "{name}: {error}"
            );
        }
    }
}

/// What a text of nodes takes is told before it is read.
fn traced() {
    let chain: String = (0..40_000).map(|i| format!("{i} 1 0 0 0 1 {}\n", i - 1)).collect();
    let short = "1 1 0 0 0 1 -1\r".to_owned() + &"\n".repeat(50_000);
    for text in [chain.clone(), chain.replace('\n', "\r"), short] {
        let (result, peak) = measured(|| swc::parse(text.as_bytes(), &SwcScale::micrometres()).map(drop));
        let told = swc::memory_bytes(text.as_bytes()) as usize - text.len();
        assert!(result.is_ok() && peak <= told, "{peak} bytes, {told} were told");
    }
}

/// A config that is larger than any is not read.
fn config() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.toml");
    File::create(&path).expect("writable").set_len(3 << 30).expect("writable");
    let error = espalier_pipeline::Loaded::read(&path, &[]).map(drop).expect_err("refused");
    assert_eq!(error.class().exit_code(), 5);
    fs::remove_file(path).expect("removed");
}
