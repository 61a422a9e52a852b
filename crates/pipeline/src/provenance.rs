//! How a result came about: inputs, settings, times.

use std::path::Path;

use espalier_model::Report;
use serde::Serialize;

use crate::clock;
use crate::config::Config;
use crate::error::Error;
use crate::folder::{RunFolder, hex_digest};
use crate::stage::Stage;

/// What one stage cost.
pub(crate) struct StageCost {
    pub(crate) stage: Stage,
    pub(crate) seconds: f64,
}

/// Writes `provenance/config.resolved.toml`: every key of the run, and nothing of this machine.
pub(crate) fn write_config(folder: &mut RunFolder, config: &Config) -> Result<(), Error> {
    let mut portable = config.clone();
    if let Some(path) = portable.input.path.as_mut().filter(|path| Path::new(path).is_absolute()) {
        let name = Path::new(path).file_name().unwrap_or_default().to_string_lossy().into_owned();
        *path = name;
    }
    folder.write("provenance/config.resolved.toml", portable.to_toml().as_bytes()).map(|_| ())
}

/// Writes `provenance/inputs.tsv`: the input's content, without its name, which may be a patient's.
pub(crate) fn write_inputs(folder: &mut RunFolder, input: Option<&Path>) -> Result<(), Error> {
    let mut table = espalier_model::table::Table::new(&["role", "bytes", "sha256"]);
    if let Some(path) = input {
        let bytes = std::fs::read(path).map_err(|source| Error::Read { path: path.to_owned(), source })?;
        table.row(&[&"input", &bytes.len(), &hex_digest(&bytes)]);
    }
    folder.write("provenance/inputs.tsv", table.into_string().as_bytes()).map(|_| ())
}

#[derive(Serialize)]
struct RunRecord<'a> {
    format: &'static str,
    version: u32,
    program: &'static str,
    program_version: &'static str,
    name: &'a str,
    seed: u64,
    input: Option<String>,
    threads: usize,
    finished_unix_seconds: u64,
    sha256_of_sums: &'a str,
}

/// Writes what depends on this machine and this hour: `provenance/run.json` and `provenance/timings.tsv`.
pub(crate) fn write_run(
    folder: &RunFolder,
    config: &Config,
    costs: &[StageCost],
    digest: &str,
) -> Result<(), Error> {
    let record = RunRecord {
        format: "espalier-run",
        version: 1,
        program: "espalier",
        program_version: env!("CARGO_PKG_VERSION"),
        name: &config.name,
        seed: config.seed,
        input: config.input.path.clone(),
        threads: rayon::current_num_threads(),
        finished_unix_seconds: clock::unix_seconds(),
        sha256_of_sums: digest,
    };
    let json = serde_json::to_string_pretty(&record).unwrap_or_default() + "\n";
    folder.write_aside("provenance/run.json", json.as_bytes())?;
    let mut table = espalier_model::table::Table::new(&["stage", "seconds", "peak_mb"]);
    let peak_mb = peak_memory_mb().map_or_else(|| "n/a".to_owned(), |mb| format!("{mb:.0}"));
    for cost in costs {
        table.row(&[&cost.stage, &format!("{:.3}", cost.seconds), &peak_mb]);
    }
    folder.write_aside("provenance/timings.tsv", table.into_string().as_bytes())
}

/// The largest memory that this process has held so far, in MB, where the system tells it.
fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kb| kb / 1024.0)
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
