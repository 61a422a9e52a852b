//! Every malformed or odd file of the data: what it is read as, or which error it gives, where, with which exit code.
//!
//! `tests/expected.tsv` is complete in both directions: each file of `bad/` has a row, and each row a file. Files of a
//! DICOM folder have a row each, as if they were alone in it, and each folder one as it is and one resampled. What is
//! read has its result and the codes of its warnings, which are the repairs; what is refused has its code, its exit
//! code and the message, which names the line, the offset or the field.
//! `UPDATE_EXPECTED=1` writes the table anew; comments above its blocks, which say why, stay where they are.
#![allow(clippy::expect_used, reason = "this is how a test speaks")]
#![allow(clippy::disallowed_methods, reason = "tests find their data through the environment")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use espalier_model::swc::{self, SwcScale};
use espalier_model::{Diagnose, Report};
use espalier_tests::real_data;
use espalier_volume::{Error, ReadOptions, read};

const TABLE: &str = include_str!("../expected.tsv");

/// What the bombs among the files are refused under.
const MAX_BYTES: u64 = 1 << 30;

/// How a row's file is handed to its reader: in its folder, alone in a folder of its own, as a folder.
const WAYS: [&str; 4] = ["swc", "volume", "alone", "resample"];

/// File and way, and what comes of it.
type Rows = BTreeMap<(String, String), String>;

#[test]
fn every_bad_file_has_its_outcome() {
    let Some(data) = real_data() else { return };
    let bad = data.join("bad");
    let found = found(&bad);
    if std::env::var_os("UPDATE_EXPECTED").is_some() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("expected.tsv");
        return fs::write(path, updated(&found)).expect("writable");
    }
    let expected = expected();
    let line = |((file, way), outcome): (&(String, String), &String)| format!("{file}\t{way}\t{outcome}\n");
    let without = |rows: &Rows, others: &Rows| {
        rows.iter().filter(|(row, o)| others.get(*row) != Some(o)).map(line).collect()
    };
    let (new, gone): (String, String) = (without(&found, &expected), without(&expected, &found));
    assert!(new.is_empty() && gone.is_empty(), "found:\n{new}\nexpected:\n{gone}");
}

/// The rows of the table.
fn expected() -> Rows {
    let rows = TABLE.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    let mut expected = Rows::new();
    for row in rows {
        let mut columns = row.splitn(3, '\t').map(str::to_owned);
        let mut next = || columns.next().expect("five columns");
        let (file, way, outcome) = (next(), next(), next());
        assert!(WAYS.contains(&way.as_str()), "{way} is no way of reading");
        assert!(expected.insert((file, way), outcome).is_none(), "two rows are the same: {row}");
    }
    expected
}

/// The table with the outcomes found; rows without a file go, and new ones come last.
fn updated(found: &Rows) -> String {
    let (mut left, mut text) = (found.clone(), String::new());
    for line in TABLE.lines() {
        let mut columns = line.splitn(3, '\t').map(str::to_owned);
        let key = (columns.next().unwrap_or_default(), columns.next().unwrap_or_default());
        if line.starts_with('#') || line.is_empty() {
            text.push_str(&format!("{line}\n"));
        } else if let Some(outcome) = left.remove(&key) {
            text.push_str(&format!("{}\t{}\t{outcome}\n", key.0, key.1));
        }
    }
    left.iter().for_each(|((file, way), outcome)| text.push_str(&format!("{file}\t{way}\t{outcome}\n")));
    text
}

/// What every file and folder comes to.
fn found(bad: &Path) -> Rows {
    let name = |path: &Path| path.strip_prefix(bad).expect("below").to_string_lossy().replace('\\', "/");
    let plain = ReadOptions { max_bytes: MAX_BYTES, ..ReadOptions::default() };
    let mut rows = Rows::new();
    let mut row = |file: String, way: &str, outcome: String| rows.insert((file, way.to_owned()), outcome);
    for path in below(bad) {
        let name = name(&path);
        match () {
            () if path.is_dir() && name.starts_with("dicom") => {
                let resampled = ReadOptions { resample: true, ..plain };
                row(format!("{name}/"), "volume", volume(&path, &path, &plain));
                row(format!("{name}/"), "resample", volume(&path, &path, &resampled));
            }
            () if path.is_dir() => {}
            // The slices of a series have no row of their own.
            () if name.starts_with("dicom_") => {}
            () if name.starts_with("dicom/") => {
                let folder = tempfile::tempdir().expect("a folder");
                let copy = folder.path().join("slice");
                fs::copy(&path, &copy).expect("copied");
                row(name, "alone", volume(&copy, &copy, &plain));
            }
            () if name.ends_with(".swc") => drop(row(name, "swc", traced(&path))),
            () => drop(row(name, "volume", volume(&path, path.parent().expect("a folder"), &plain))),
        }
    }
    rows
}

/// Everything below a folder, the folder itself not.
fn below(folder: &Path) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("a readable folder") {
            let path = entry.expect("an entry").path();
            found.push(path.clone());
            if path.is_dir() {
                folders.push(path);
            }
        }
    }
    found
}

/// What reading a volume comes to. Messages show the files of `folder` by their names.
fn volume(path: &Path, folder: &Path, options: &ReadOptions) -> String {
    match read(path, options) {
        Ok(loaded) => {
            let grid = loaded.volume.grid();
            let [nx, ny, nz] = grid.shape();
            accepted(&format!("{nx}x{ny}x{nz} {}", grid.orientation()), &loaded.report)
        }
        Err(error) => {
            assert!(
                error.to_string().ends_with(&path.display().to_string()),
                "{error} does not end with the path"
            );
            let Error::Read { problem, .. } = &error else { return refused(&error) };
            let message = problem.to_string().replace(&format!("{}/", folder.display()), "");
            format!("{}\t{}\t{message}", error.code(), error.class().exit_code())
        }
    }
}

fn traced(path: &Path) -> String {
    match swc::parse(&fs::read(path).expect("readable"), &SwcScale::micrometres()) {
        Ok((traced, report)) => {
            let n_roots = traced.nodes.iter().filter(|node| node.parent.is_none()).count();
            let counts = ["radius_missing", "extra_column_lines"].into_iter().filter_map(|name| {
                report.get(name).filter(|&count| count > 0.0).map(|count| format!(" {name} {count}"))
            });
            let counts: String = counts.collect();
            accepted(&format!("nodes {} roots {n_roots}{counts}", traced.nodes.len()), &report)
        }
        Err(error) => refused(&error),
    }
}

fn accepted(what: &str, report: &Report) -> String {
    let warnings = report.warnings.iter().map(|warning| format!(" {}", warning.code));
    format!("accepted\t0\t{what}{}", warnings.collect::<String>())
}

fn refused(error: &dyn Diagnose) -> String {
    assert!(!error.hint().is_empty(), "{error} has no way out");
    format!("{}\t{}\t{error}", error.code(), error.class().exit_code())
}
