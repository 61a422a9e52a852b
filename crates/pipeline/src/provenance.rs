//! How a result came about: inputs, settings, times.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use espalier_model::Report;
use espalier_model::table::{Column, Table};
use serde::{Deserialize, Serialize};

use crate::clock;
use crate::config::{Config, UNNAMED};
use crate::error::Error;
use crate::folder::{RunFolder, file_digest, hex_digest};
use crate::record::Record;
use crate::settings;
use crate::side_file::SideFile;
use crate::stage::Stage;

/// How a stage's results came to a folder.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum How {
    /// They were made.
    Made,
    /// They were taken from the store that runs share.
    Shared,
}

/// What one stage cost.
pub(crate) struct StageCost {
    pub(crate) stage: Stage,
    pub(crate) how: How,
    pub(crate) seconds: f64,
    /// Seconds of all cores together, of this program.
    pub(crate) cpu_seconds: Option<f64>,
    pub(crate) peak_mb: Option<f64>,
    /// The same of its parts, where it has any.
    pub(crate) parts: Vec<PartCost>,
}

/// What one part of a stage cost, such as a layout method.
pub(crate) struct PartCost {
    pub(crate) name: String,
    pub(crate) seconds: f64,
    pub(crate) peak_mb: Option<f64>,
}

/// The columns of `provenance/inputs.tsv`.
pub(crate) const INPUT_COLUMNS: [Column; 3] = [
    Column::new("role", "n/a", "what the file is for"),
    Column::new("bytes", "byte", "its size"),
    Column::new("sha256", "n/a", "the SHA-256 of its content"),
];

/// The columns of `provenance/timings.tsv`.
pub(crate) const TIMING_COLUMNS: [Column; 4] = [
    Column::new("stage", "n/a", "the stage"),
    Column::new("method", "n/a", "the layout method as in compare.tsv; n/a for the stage as a whole"),
    Column::new("seconds", "s", "wall time"),
    Column::new(
        "peak_mb",
        "MB",
        "the most memory that the program has held until then, not only in this row",
    ),
];

pub(crate) const INPUTS_FILE: &str = "provenance/inputs.tsv";
/// What of `provenance/` is the same for equal runs, and no stage's own.
pub(crate) const FILES: [&str; 2] = [INPUTS_FILE, settings::FILE];
/// What of it is of this machine and this hour.
pub(crate) const FILES_ASIDE: [&str; 2] = [RUN_FILE, TIMINGS_FILE];
const RUN_FILE: &str = "provenance/run.json";
const TIMINGS_FILE: &str = "provenance/timings.tsv";
/// The role of the input in `provenance/inputs.tsv`.
const INPUT: &str = "input";

/// The absolute path of the input of an earlier run in a folder, where it had one.
#[must_use]
pub fn input_of_run(folder: &Path) -> Option<String> {
    path_of_run(folder, "input")
}

/// The absolute path of a file beside the input of an earlier run in a folder, where it had one.
#[must_use]
pub fn side_file_of_run(folder: &Path, side: SideFile) -> Option<String> {
    path_of_run(folder, side.role())
}

fn path_of_run(folder: &Path, key: &str) -> Option<String> {
    let text = std::fs::read_to_string(folder.join(RUN_FILE)).ok()?;
    let record: serde_json::Value = serde_json::from_str(&text).ok()?;
    record.get(key)?.as_str().map(str::to_owned)
}

fn absolute(path: &Path) -> Option<String> {
    std::path::absolute(path).ok().map(|path| path.to_string_lossy().into_owned())
}

/// Writes `provenance/inputs.tsv` with the rows of the input.
pub(crate) fn write_inputs(folder: &mut RunFolder, rows: &str) -> Result<(), Error> {
    let table = Table::with(&INPUT_COLUMNS).into_string() + rows;
    folder.write(INPUTS_FILE, table.as_bytes())
}

/// The content of the input's files, without their names, which may be a patient's. A DICOM series has a row for each
/// slice, by position.
pub(crate) fn input_rows(input: &[PathBuf]) -> Result<String, Error> {
    input.iter().map(|path| row(INPUT, path)).collect()
}

/// Brings the rows of a file beside the input in `provenance/inputs.tsv` up to date: several of a DICOM series.
pub(crate) fn write_side_file(
    folder: &mut RunFolder,
    side: SideFile,
    files: &[PathBuf],
) -> Result<(), Error> {
    let known = rows(folder)?;
    if known.is_none() && files.is_empty() {
        return Ok(());
    }
    let known = known.unwrap_or_else(|| Table::with(&INPUT_COLUMNS).into_string());
    let mut table: String = known.split_inclusive('\n').filter(|row| !is_of(side.role(), row)).collect();
    for path in files {
        table.push_str(&row(side.role(), path)?);
    }
    folder.write(INPUTS_FILE, table.as_bytes())
}

/// The digests of the input's files, from the text of `provenance/inputs.tsv`.
pub(crate) fn input_digests(table: &str) -> Vec<String> {
    let rows = table.lines().filter(|row| is_of(INPUT, row));
    rows.filter_map(|row| row.split('\t').nth(2)).map(str::to_owned).collect()
}

/// Whether the folder's results were made from files of other content.
pub(crate) fn is_other_input(folder: &RunFolder, input: &[PathBuf]) -> Result<bool, Error> {
    let Some(known) = rows(folder)? else { return Ok(false) };
    let known: String = known.split_inclusive('\n').filter(|row| is_of(INPUT, row)).collect();
    Ok(known != input_rows(input)?)
}

/// Whether the folder's results were made with such a file of other content.
pub(crate) fn is_other_side_file(folder: &RunFolder, side: SideFile, path: &Path) -> Result<bool, Error> {
    let Some(known) = rows(folder)? else { return Ok(false) };
    let now = row(side.role(), path)?;
    Ok(!known.split_inclusive('\n').any(|row| row == now))
}

/// The text of `provenance/inputs.tsv`, if there is one.
fn rows(folder: &RunFolder) -> Result<Option<String>, Error> {
    let has_rows = folder.path().join(INPUTS_FILE).exists();
    has_rows
        .then(|| folder.read(INPUTS_FILE).map(|bytes| String::from_utf8_lossy(&bytes).into_owned()))
        .transpose()
}

fn is_of(role: &str, row: &str) -> bool {
    row.split('\t').next() == Some(role)
}

/// The SHA-256 of a file that the user names.
pub(crate) fn digest(path: &Path) -> Result<String, Error> {
    let digest = file_digest(path).map_err(|source| Error::Read { path: path.to_owned(), source });
    digest.map(|(_, digest)| digest)
}

/// The SHA-256 of a file that the user names; of several files that make it up, one over their rows.
pub(crate) fn digest_of_all(files: &[PathBuf], path: &Path) -> Result<String, Error> {
    match files {
        [] => digest(path),
        [one] => digest(one),
        files => input_rows(files).map(|rows| hex_digest(rows.as_bytes())),
    }
}

/// The row of a file.
fn row(role: &str, path: &Path) -> Result<String, Error> {
    let (n_bytes, digest) =
        file_digest(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
    Ok(format!("{role}\t{n_bytes}\t{digest}\n"))
}

#[derive(Serialize)]
struct RunRecord<'a> {
    format: &'static str,
    version: u32,
    program: &'static str,
    program_version: &'static str,
    name: &'a str,
    seed: u64,
    /// The absolute path of the input, for stages that read it again.
    input: Option<String>,
    /// The absolute paths of files beside it, likewise.
    #[serde(flatten)]
    side_files: BTreeMap<&'static str, String>,
    stages: Vec<&'static str>,
    /// Those of them whose results were taken from the store that runs share.
    shared: Vec<&'static str>,
    /// What each of them has cost here and now.
    costs: Vec<CostRecord>,
    threads: usize,
    finished_unix_seconds: u64,
    sha256_of_sums: String,
}

/// What a stage has cost in a run.
#[derive(Serialize)]
struct CostRecord {
    stage: &'static str,
    seconds: f64,
    cpu_seconds: Option<f64>,
    /// The most memory that the program has held until its end.
    peak_mb: Option<f64>,
}

impl CostRecord {
    fn of(cost: &StageCost) -> Self {
        let StageCost { stage, seconds, cpu_seconds, peak_mb, .. } = *cost;
        Self { stage: stage.name(), seconds, cpu_seconds, peak_mb }
    }
}

/// Writes what depends on this machine and this hour: `provenance/run.json` and `provenance/timings.tsv`.
pub(crate) fn write_run(
    folder: &RunFolder,
    config: &Config,
    (input, side_paths): (Option<&Path>, &BTreeMap<SideFile, PathBuf>),
    costs: &[StageCost],
) -> Result<(), Error> {
    let names = |counts: fn(&StageCost) -> bool| {
        costs.iter().filter(|cost| counts(cost)).map(|cost| cost.stage.name()).collect()
    };
    let record = RunRecord {
        format: "espalier-run",
        version: 1,
        program: "espalier",
        program_version: env!("CARGO_PKG_VERSION"),
        name: config.own_name().unwrap_or(UNNAMED),
        seed: config.seed,
        input: input.map_or_else(|| input_of_run(folder.path()), absolute),
        side_files: side_paths
            .iter()
            .filter_map(|(side, path)| Some((side.role(), absolute(path)?)))
            .collect(),
        stages: names(|_| true),
        shared: names(|cost| cost.how == How::Shared),
        costs: costs.iter().map(CostRecord::of).collect(),
        threads: rayon::current_num_threads(),
        finished_unix_seconds: clock::unix_seconds(),
        sha256_of_sums: folder.digest_of(|_| true),
    };
    let json = serde_json::to_string_pretty(&record).unwrap_or_default() + "\n";
    folder.write_aside(RUN_FILE, json.as_bytes())?;
    // The peak is of the whole program until the end of the stage: the system keeps no other.
    let mut table = Table::with(&TIMING_COLUMNS);
    let is_kept = |stage: Stage| {
        costs.iter().all(|cost| cost.stage != stage) && folder.digest(&Record::file_of(stage)).is_some()
    };
    for cells in timings(folder).iter().filter(|cells| Stage::from_name(&cells[0]).is_some_and(is_kept)) {
        table.row_of(cells);
    }
    for cost in costs {
        let parts = cost.parts.iter().map(|part| (part.name.as_str(), part.seconds, part.peak_mb));
        for (method, seconds, peak_mb) in parts.chain([("n/a", cost.seconds, cost.peak_mb)]) {
            let peak_mb = peak_mb.map_or_else(|| "n/a".to_owned(), |mb| format!("{mb:.0}"));
            table.row(&[&cost.stage, &method, &format!("{seconds:.3}"), &peak_mb]);
        }
    }
    folder.write_aside(TIMINGS_FILE, table.into_string().as_bytes())
}

/// The seconds of each part of a stage in a run folder; none where the folder has no such table.
pub(crate) fn method_seconds(folder: &RunFolder, stage: Stage) -> Vec<(String, f64)> {
    let of_method = |[of, method, seconds, _]: [String; 4]| {
        let is_method = of == stage.name() && method != "n/a";
        Some((method, seconds.parse().ok()?)).filter(|_| is_method)
    };
    timings(folder).into_iter().filter_map(of_method).collect()
}

/// The rows of the times that a folder has, by stages of this version.
fn timings(folder: &RunFolder) -> Vec<[String; 4]> {
    let text = std::fs::read_to_string(folder.path().join(TIMINGS_FILE)).unwrap_or_default();
    let cells = |line: &str| line.split('\t').map(str::to_owned).collect::<Vec<_>>().try_into().ok();
    let rows = text.lines().skip(1).filter_map(cells);
    rows.filter(|cells: &[String; 4]| Stage::from_name(&cells[0]).is_some()).collect()
}

/// The largest memory that this process has held so far, in MB, where the system tells it.
pub(crate) fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kb| kb / 1024.0)
}

/// Seconds that this process has worked so far on all cores together, where the system tells it.
pub(crate) fn cpu_seconds() -> Option<f64> {
    /// What Linux counts in, whatever its own clock ticks.
    const TICKS_PER_SECOND: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The program's name is in parentheses and may hold blanks; user and system time are the 14th and 15th field.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(14)? + ticks(15)?) / TICKS_PER_SECOND)
}

/// The counts in the report of a stage; none if there is none.
pub(crate) fn counts(folder: &RunFolder, stage: Stage) -> BTreeMap<String, f64> {
    #[derive(Deserialize)]
    struct Counted {
        counts: BTreeMap<String, Option<f64>>,
    }
    let text = folder.text_if_there(&format!("{}/report.json", stage.folder())).ok().flatten();
    let counted = text.and_then(|text| serde_json::from_str::<Counted>(&text).ok());
    // What is no finite number, JSON has not.
    let counts = counted.into_iter().flat_map(|counted| counted.counts);
    counts.map(|(name, value)| (name, value.unwrap_or(f64::NAN))).collect()
}

#[derive(Serialize)]
struct ReportRecord<'a> {
    format: &'static str,
    version: u32,
    stage: &'static str,
    counts: serde_json::Map<String, serde_json::Value>,
    warnings: Vec<WarningRecord<'a>>,
}

#[derive(Serialize)]
struct WarningRecord<'a> {
    code: &'static str,
    message: &'a str,
}

/// The warnings that a stage gave when its results were made: codes and messages.
pub(crate) fn warnings(folder: &RunFolder, stage: Stage) -> Result<Vec<(String, String)>, Error> {
    #[derive(Deserialize)]
    struct Said {
        warnings: Vec<Warned>,
    }
    #[derive(Deserialize)]
    struct Warned {
        code: String,
        message: String,
    }
    let text = folder.text_if_there(&format!("{}/report.json", stage.folder()))?;
    let said = text.and_then(|text| serde_json::from_str::<Said>(&text).ok());
    let warned = said.into_iter().flat_map(|said| said.warnings);
    Ok(warned.map(|warned| (warned.code, warned.message)).collect())
}

/// The text of a stage's `report.json`.
pub(crate) fn report_json(stage: Stage, report: &Report) -> String {
    let record = ReportRecord {
        format: "espalier-report",
        version: 1,
        stage: stage.name(),
        counts: report.counts.iter().map(|count| (count.name.to_owned(), count.value.into())).collect(),
        warnings: report
            .warnings
            .iter()
            .map(|warning| WarningRecord { code: warning.code, message: &warning.message })
            .collect(),
    };
    serde_json::to_string_pretty(&record).unwrap_or_default() + "\n"
}
