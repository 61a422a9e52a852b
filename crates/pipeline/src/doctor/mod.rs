//! What an input is, what is to be said of it, which command suits it, and what that would cost.
//!
//! **Input** a volume file, a DICOM folder, a traced tree or a config. **Output** [`Examined`].
//! **Steps** 1. the config, as a run would have it; 2. the input, read once as what it is (`volume`, `tree`); of a mask
//! also the first two stages of a run, which cost a twentieth of it; 3. the costs of the stages that it would pass
//! (`crate::estimate`).
//! **Guarantees** nothing is written. What a run would refuse is refused here with the same words, but that a folder of several
//! series is a finding, and a scan without a preset too.

mod tree;
mod volume;

use std::path::PathBuf;

use serde::Serialize;
use serde_json::Value;

use crate::config::{Loaded, Override, Source};
use crate::error::Error;
use crate::estimate::{self, Cost, Sizes};
use crate::run::{self, Request};
use crate::shell;
use crate::stage::Stage;

/// An input to be examined.
#[derive(Clone, Debug)]
pub struct DoctorRequest {
    /// A config, or an input with every setting at its default.
    pub config_or_input: PathBuf,
    /// As for a run.
    pub overrides: Vec<Override>,
    /// As in [`Request`].
    pub threads: Option<usize>,
    /// As in [`Request`].
    pub max_memory_bytes: u64,
    /// As in [`Request`].
    pub data_dir: Option<PathBuf>,
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Examined {
    /// The input.
    pub input: PathBuf,
    /// What it is.
    pub facts: Vec<Fact>,
    /// What is to be said of it.
    pub advice: Vec<Advice>,
    /// The commands that suit it, the likeliest first, without the program's name.
    pub commands: Vec<Vec<String>>,
    /// What a run would cost, stage by stage; empty where too little is known.
    pub costs: Vec<(Stage, Cost)>,
    /// What the costs take for granted, where something was assumed.
    pub assumed: Option<String>,
    /// The most memory that a stage may take.
    pub max_memory_bytes: u64,
}

/// One thing that an input is.
#[derive(Clone, Debug, PartialEq)]
pub struct Fact {
    /// Its name, with its unit at the end where it has one.
    pub name: &'static str,
    /// Its value.
    pub value: Value,
    /// The same in words.
    pub text: String,
}

/// Something to be said of an input, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Advice {
    /// The code of the reader's warning, or our own.
    pub code: String,
    /// The place and the fact.
    pub message: String,
    /// What to do; empty where nothing is to be done.
    pub way_out: String,
}

/// What examining an input has come to so far.
#[derive(Default)]
struct Findings {
    facts: Vec<Fact>,
    advice: Vec<Advice>,
    /// Arguments after the input; none where the input cannot be run.
    commands: Vec<Vec<&'static str>>,
    sizes: Option<Sizes>,
    assumed: Option<String>,
}

impl Findings {
    fn fact(&mut self, name: &'static str, value: impl Into<Value>, text: impl Into<String>) {
        self.facts.push(Fact { name, value: value.into(), text: text.into() });
    }

    fn advise(&mut self, code: &str, message: impl Into<String>, way_out: impl Into<String>) {
        self.advice.push(Advice { code: code.to_owned(), message: message.into(), way_out: way_out.into() });
    }
}

/// Examines an input.
///
/// # Errors
/// [`Error`] if the config is wrong or the input cannot be read.
pub fn doctor(request: &DoctorRequest) -> Result<Examined, Error> {
    let loaded = Loaded::read(&request.config_or_input, &request.overrides)?;
    let run = Request {
        loaded,
        out: PathBuf::new(),
        from: None,
        to: None,
        files: std::collections::BTreeMap::new(),
        force: false,
        wait: false,
        threads: request.threads,
        max_memory_bytes: request.max_memory_bytes,
        data_dir: request.data_dir.clone(),
        cache: None,
    };
    run::in_pool(request.threads, || examine(request, &run))
}

fn examine(request: &DoctorRequest, run: &Request) -> Result<Examined, Error> {
    let source = run::source_of(&run.loaded, request.data_dir.as_deref())?;
    let found = findings(run, &source)?;
    let costs = found.sizes.map(|sizes| costs(run, &run::stages_of(&source), sizes)).unwrap_or_default();
    let input = request.config_or_input.clone();
    let start = ["run".to_owned(), input.display().to_string()];
    // What was said here has to be said there too.
    let settings =
        request.overrides.iter().flat_map(|set| ["--set".to_owned(), format!("{}={}", set.key, set.value)]);
    let settings: Vec<String> = settings.collect();
    let command = |rest: Vec<&str>| {
        start
            .iter()
            .cloned()
            .chain(settings.iter().cloned())
            .chain(rest.into_iter().map(str::to_owned))
            .collect()
    };
    let mut examined = Examined {
        commands: found.commands.into_iter().map(command).collect(),
        input,
        facts: found.facts,
        advice: found.advice,
        costs,
        assumed: found.assumed,
        max_memory_bytes: request.max_memory_bytes,
    };
    examined.advise_on_memory();
    Ok(examined)
}

/// What a source is, as far as it can be told without doing the run.
fn findings(run: &Request, source: &Source) -> Result<Findings, Error> {
    match source {
        Source::Volume(path) => volume::examine(run, path),
        Source::Tree(path) => tree::examine(run, path, source),
        Source::PhantomScan(kind) | Source::PhantomTree(kind) => {
            let mut found = Findings::default();
            found.fact("kind", "phantom", format!("a phantom, {}: made by the run itself", kind.name()));
            found.commands.push(Vec::new());
            Ok(found)
        }
    }
}

/// The sizes that a run from this source would meet; none where they cannot be told beforehand.
pub(crate) fn sizes_of(run: &Request, source: &Source) -> Result<Option<Sizes>, Error> {
    findings(run, source).map(|found| found.sizes)
}

/// What the stages of a run would cost.
pub(crate) fn costs(run: &Request, stages: &[Stage], sizes: Sizes) -> Vec<(Stage, Cost)> {
    let sizes = sizes.and_pictures(&run.loaded.config.render).completed();
    stages.iter().map(|&stage| (stage, estimate::cost(stage, &sizes))).collect()
}

impl Examined {
    /// The seconds of all stages on so many cores. Half of the work is done on all of them at once.
    #[must_use]
    pub fn seconds(&self, threads: usize) -> f64 {
        /// Between layouts, of which two starts have a core each, and pixels, which all cores share.
        const PARALLEL: f64 = 0.5;
        let one_core: f64 = self.costs.iter().map(|(_, cost)| cost.cpu_seconds).sum();
        one_core * (1.0 - PARALLEL + PARALLEL / threads.max(1) as f64)
    }

    /// The stage that takes most memory, and how much.
    #[must_use]
    pub fn peak(&self) -> Option<(Stage, u64)> {
        self.costs.iter().map(|(stage, cost)| (*stage, cost.bytes)).max_by_key(|(_, bytes)| *bytes)
    }

    fn advise_on_memory(&mut self) {
        let Some((stage, bytes)) = self.peak().filter(|(_, bytes)| *bytes > self.max_memory_bytes) else {
            return;
        };
        let message = format!(
            "{stage} would take about {}, allowed are {}",
            readable_bytes(bytes),
            readable_bytes(self.max_memory_bytes)
        );
        let way_out =
            "allow more with --max-memory, or coarser voxels with --set volume.resample_mm=…".to_owned();
        self.advice.push(Advice { code: "E-LIMIT-MEMORY".to_owned(), message, way_out });
    }

    /// The whole as JSON, format `espalier-doctor` version 1.
    #[must_use]
    pub fn to_json(&self, threads: usize) -> Value {
        let facts: serde_json::Map<_, _> =
            self.facts.iter().map(|fact| (fact.name.to_owned(), fact.value.clone())).collect();
        let stage = |(stage, cost): &(Stage, Cost)| {
            serde_json::json!({
                "stage": stage.name(),
                "cpu_seconds": cost.cpu_seconds,
                "peak_bytes": cost.bytes,
            })
        };
        let suffices = self.peak().map(|(_, bytes)| bytes <= self.max_memory_bytes);
        serde_json::json!({
            "format": "espalier-doctor",
            "version": 1,
            "facts": facts,
            "warnings": self.advice,
            "commands": self.commands,
            "estimate": {
                "assumes": self.assumed,
                "stages": self.costs.iter().map(stage).collect::<Vec<_>>(),
                "threads": threads,
                "seconds": self.seconds(threads),
                "peak_bytes": self.peak().map(|(_, bytes)| bytes),
                "max_memory_bytes": self.max_memory_bytes,
                "max_memory_suffices": suffices,
            },
        })
    }

    /// The whole for a terminal.
    #[must_use]
    pub fn to_text(&self, threads: usize) -> String {
        let mut text = format!("{}\n", self.input.display());
        for fact in &self.facts {
            text += &format!("  {:<22}{}\n", fact.name, fact.text);
        }
        for Advice { code, message, way_out } in &self.advice {
            text += &format!("  warning[{code}]: {message}\n");
            if !way_out.is_empty() {
                text += &format!("    hint: {way_out}\n");
            }
        }
        for command in &self.commands {
            let words: Vec<String> = command.iter().map(|word| shell::word(word)).collect();
            text += &format!("  try: espalier {}\n", words.join(" "));
        }
        text + &self.costs_text(threads)
    }

    fn costs_text(&self, threads: usize) -> String {
        let Some((_, bytes)) = self.peak() else { return String::new() };
        let mut text = format!("  {}", costs_table(&self.costs).trim_end().replace('\n', "\n  "));
        let assumed =
            self.assumed.as_ref().map(|assumed| format!(", assuming {assumed}")).unwrap_or_default();
        text += &format!(
            "\n  in all about {} on {threads} threads, at most {} of memory of {} allowed{assumed}\n",
            readable_seconds(self.seconds(threads)),
            readable_bytes(bytes),
            readable_bytes(self.max_memory_bytes)
        );
        text
    }
}

/// Stage, seconds of one core and memory, a line a stage.
#[must_use]
pub fn costs_table(costs: &[(Stage, Cost)]) -> String {
    let row = |(stage, cost): &(Stage, Cost)| {
        let seconds = readable_seconds(cost.cpu_seconds);
        format!("{stage:<9} about {seconds:>9} of one core {:>9}\n", readable_bytes(cost.bytes))
    };
    costs.iter().map(row).collect()
}

fn readable_seconds(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

fn readable_bytes(bytes: u64) -> String {
    let megabytes = bytes as f64 / f64::from(1 << 20);
    if megabytes < 1024.0 { format!("{megabytes:.0} MiB") } else { format!("{:.1} GiB", megabytes / 1024.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readable() {
        assert_eq!(readable_seconds(0.25), "0.2 s");
        assert_eq!(readable_seconds(300.0), "5 min");
        assert_eq!(readable_bytes(3 << 29), "1.5 GiB");
    }
}
