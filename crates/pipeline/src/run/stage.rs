//! One stage of a run: kept where its results stand, taken where another run has them, else made.

use std::collections::BTreeSet;
use std::path::PathBuf;

use super::Run;
use crate::cache::{Cache, Taken};
use crate::clock::Stopwatch;
use crate::error::Error;
use crate::event::{Event, Took};
use crate::folder::RunFolder;
use crate::provenance::{self, How, StageCost};
use crate::record::{MadeFrom, Reason, Record};
use crate::settings::Settings;
use crate::stage::{Artifact, Stage};
use crate::steps::{self, Step};

/// The second words of the codes of warnings that speak of the input as it lies on the disk.
const READERS: [&str; 7] = ["VOLUME", "NIFTI", "NRRD", "META", "DICOM", "SWC", "POLYDATA"];

impl Run<'_> {
    /// The record of a stage's results, if they are to be kept; else why not.
    pub(super) fn standing(
        &self,
        folder: &RunFolder,
        stage: Stage,
        made_from: &MadeFrom,
    ) -> Result<Result<Record, Reason>, Error> {
        if self.request.force { Ok(Err(Reason::Forced)) } else { Record::standing(folder, stage, made_from) }
    }

    /// Keeps a stage's results, and repeats what was said of them. The folder's inputs and settings are brought up to date
    /// only with the next results that are written: until then they are those of all that lies there.
    pub(super) fn keep(&mut self, folder: &mut RunFolder, stage: Stage, record: Record) -> Result<(), Error> {
        let record_file = Record::file_of(stage);
        let own = folder.digest_if_there(&record_file)?.map(|digest| (record_file, digest));
        folder.adopt(record.files().clone().into_iter().chain(own));
        self.kept.push(stage);
        self.repeat_warnings(folder, stage)?;
        let counts = provenance::counts(folder, stage);
        (self.events)(Event::Kept { stage, line: record.line, counts });
        Ok(())
    }

    /// Says again what a stage had to say when its results were made.
    fn repeat_warnings(&mut self, folder: &RunFolder, stage: Stage) -> Result<(), Error> {
        for (code, message) in provenance::warnings(folder, stage)? {
            self.n_warnings += 1;
            let file = self.file_of_warning(stage, &code);
            (self.events)(Event::Warning { stage, code, message, file });
        }
        Ok(())
    }

    /// The user's file that a warning speaks of: the input, where a reader gave the warning.
    fn file_of_warning(&self, stage: Stage, code: &str) -> Option<PathBuf> {
        let read = match stage {
            Stage::Volume => Artifact::Volume,
            Stage::Tree => Artifact::Traced,
            _ => return None,
        };
        let is_of_reader = code.split('-').nth(1).is_some_and(|word| READERS.contains(&word));
        self.artifacts.files.get(&read).filter(|_| is_of_reader).cloned()
    }

    /// The store that runs share, unless all is to be made again.
    pub(super) fn cache_to_read(&self) -> Option<&Cache> {
        self.request.cache.as_ref().filter(|_| !self.request.force)
    }

    /// A stage's results from the store that runs share.
    pub(super) fn shared(&self, stage: Stage, made_from: &MadeFrom) -> Option<Taken> {
        self.cache_to_read()?.take(stage, made_from, self.request.max_memory_bytes)
    }

    /// Puts a stage's results in place that another run has made, and repeats what was said of them.
    pub(super) fn take(
        &mut self,
        folder: &mut RunFolder,
        settings: &mut Settings,
        (stage, made_from): (Stage, MadeFrom),
        (reason, taken): (Reason, Taken),
    ) -> Result<(), Error> {
        let watch = Stopwatch::start();
        let Taken { files, line } = taken;
        self.put_in_place(folder, settings, (stage, made_from), (&files, &line))?;
        let (how, seconds) = (How::Shared, watch.seconds());
        let cost = StageCost { stage, how, seconds, cpu_seconds: None, peak_mb: None, parts: Vec::new() };
        self.note_cost(folder, cost)?;
        self.repeat_warnings(folder, stage)?;
        let counts = provenance::counts(folder, stage);
        (self.events)(Event::Taken { stage, reason, line, counts });
        Ok(())
    }

    /// Does a stage and writes what it made.
    pub(super) fn make(
        &mut self,
        folder: &mut RunFolder,
        settings: &mut Settings,
        (stage, made_from): (Stage, MadeFrom),
        reason: Reason,
    ) -> Result<(), Error> {
        let (config, events) = (&self.request.loaded.config, self.events);
        events(Event::Started { stage, reason });
        let (watch, cpu_before) = (Stopwatch::start(), provenance::cpu_seconds());
        let (source, artifacts) = (&self.source, &mut self.artifacts);
        let mut step = Step { stage, config, source, artifacts, events, folder, parts: Vec::new() };
        folder.take_reads();
        let steps::Outcome { mut files, report, line } = steps::perform(&mut step)?;
        let parts = step.parts;
        debug_assert_eq!(undeclared(stage, folder.take_reads()), [""; 0], "read by {stage}");
        let report_file = format!("{}/report.json", stage.folder());
        files.push((report_file, provenance::report_json(stage, &report).into_bytes()));
        let record = self.put_in_place(folder, settings, (stage, made_from), (&files, &line))?;
        let (seconds, peak_mb) = (watch.seconds(), provenance::peak_memory_mb());
        let cpu_seconds = provenance::cpu_seconds().zip(cpu_before).map(|(now, before)| now - before);
        let told = parts.iter().map(|part| (part.name.clone(), part.seconds, part.peak_mb)).collect();
        self.note_cost(folder, StageCost { stage, how: How::Made, seconds, cpu_seconds, peak_mb, parts })?;
        self.share(stage, &record, &files);
        self.n_warnings += report.warnings.len();
        for warning in report.warnings {
            let (code, file) = (warning.code.to_owned(), self.file_of_warning(stage, warning.code));
            events(Event::Warning { stage, code, message: warning.message, file });
        }
        let counts = report.counts.iter().map(|count| (count.name.to_owned(), count.value)).collect();
        events(Event::Finished { stage, line, counts, cost: Took { seconds, peak_mb, parts: told } });
        Ok(())
    }
}

/// The files that a stage has read without being known to: its results would be kept when one of them changes.
fn undeclared(stage: Stage, reads: BTreeSet<String>) -> Vec<String> {
    let known: Vec<String> = stage.files_read().collect();
    reads.into_iter().filter(|file| !known.contains(file)).collect()
}
