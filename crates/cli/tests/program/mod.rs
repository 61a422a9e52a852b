//! The program, started in a folder, and what it leaves there.
#![allow(dead_code, reason = "each test takes what it needs")]
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Settings that make a run quick.
pub(crate) const QUICK: [&str; 8] = [
    "--set",
    "embed.pso.particles=16",
    "--set",
    "embed.pso.iterations=3",
    "--set",
    "render.width_px=300",
    "--set",
    "report.enabled=false",
];

/// What the program said, and how it ended.
pub(crate) struct Said {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) error: String,
}

impl Said {
    pub(crate) fn by(output: &Output) -> Self {
        let out = String::from_utf8_lossy(&output.stdout).into_owned();
        Self { code: output.status.code(), out, error: stderr(output) }
    }
}

/// A fork whose trunk has this length, in mm, as a tracing.
pub(crate) fn fork(length_mm: f64) -> String {
    let end = length_mm + 6.0;
    format!("1 1 0 0 0 2 -1\n2 3 0 -{length_mm} 0 2 1\n3 3 5 -{end} 0 1.2 2\n4 3 -5 -{end} 0 1.2 2\n")
}

pub(crate) fn espalier(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_espalier"))
        .args(arguments)
        .current_dir(folder)
        .env_remove("ESPALIER_DATA")
        .env_remove("ESPALIER_CACHE")
        .output()
        .expect("the program starts")
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Every file below a folder, sorted.
pub(crate) fn files_below(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    files
}
