//! Results put in place with all that speaks of them: first goes what does not hold any more, the record comes last.

use std::collections::BTreeSet;

use super::Run;
use super::source::stages_of;
use crate::error::Error;
use crate::event::Event;
use crate::folder::RunFolder;
use crate::provenance::{self, StageCost};
use crate::record::{MadeFrom, Record};
use crate::settings::Settings;
use crate::side_file::SideFile;
use crate::stage::Stage;

impl Run<'_> {
    /// Writes a stage's files with all that speaks of them.
    pub(super) fn put_in_place(
        &mut self,
        folder: &mut RunFolder,
        settings: &mut Settings,
        (stage, made_from): (Stage, MadeFrom),
        (files, line): (&[(String, Vec<u8>)], &str),
    ) -> Result<Record, Error> {
        self.clear_away(folder, stage)?;
        self.settle_kept(folder, settings)?;
        let record = write_files(folder, (stage, made_from), files, line)?;
        self.write_provenance(folder, settings, stage)?;
        folder.seal()?;
        Ok(record)
    }

    /// Notes what a stage has cost, beside the results.
    pub(super) fn note_cost(&mut self, folder: &RunFolder, cost: StageCost) -> Result<(), Error> {
        self.costs.push(cost);
        let files = (self.input.as_deref(), &self.artifacts.side_paths);
        provenance::write_run(folder, &self.request.loaded.config, files, &self.costs)
    }

    /// Stores what a stage has made for other runs. This one has its results: a store that cannot be written to is said,
    /// once, and no reason to stop.
    pub(super) fn share(&mut self, stage: Stage, record: &Record, files: &[(String, Vec<u8>)]) {
        let Some(cache) = &self.request.cache else { return };
        match cache.keep(stage, record, files) {
            Ok(()) => self.has_stored = true,
            Err(error) if !self.is_store_lost => {
                self.is_store_lost = true;
                self.n_warnings += 1;
                let message = format!("results are not shared: {error}");
                let code = "W-RUN-CACHE".to_owned();
                (self.events)(Event::Warning { stage, code, message, file: Some(cache.folder.clone()) });
            }
            Err(_) => {}
        }
    }

    /// Inputs and settings of the stages that were kept.
    pub(super) fn settle_kept(
        &mut self,
        folder: &mut RunFolder,
        settings: &mut Settings,
    ) -> Result<(), Error> {
        std::mem::take(&mut self.kept)
            .into_iter()
            .try_for_each(|stage| self.write_provenance(folder, settings, stage))
    }

    /// Inputs and settings as far as they are a stage's.
    fn write_provenance(
        &self,
        folder: &mut RunFolder,
        settings: &mut Settings,
        stage: Stage,
    ) -> Result<(), Error> {
        if Some(stage) == stages_of(&self.source).first().copied() {
            provenance::write_inputs(folder, self.input_rows.as_deref().unwrap_or_default())?;
        }
        for side in SideFile::ALL.into_iter().filter(|side| side.stage() == stage) {
            provenance::write_side_file(folder, side, &self.artifacts.files_beside(side, stage)?)?;
        }
        settings.adopt(folder, stage)
    }

    /// The stages whose files in the folder are not of this run: all, if input or seed are others; else those that a run
    /// from this input does not have.
    pub(super) fn foreign(&self, settings: &Settings) -> Vec<Stage> {
        let available = stages_of(&self.source);
        let is_foreign = |stage: &Stage| settings.is_other_run() || !available.contains(stage);
        if self.request.files.is_empty() {
            Stage::ALL.into_iter().filter(is_foreign).collect()
        } else {
            Vec::new()
        }
    }

    /// Removes the files of another run, but for those of this stage and the ones before, which are in place.
    pub(super) fn clear_away(&mut self, folder: &mut RunFolder, done: Stage) -> Result<(), Error> {
        let available = stages_of(&self.source);
        let foreign = std::mem::take(&mut self.foreign).into_iter();
        let outdated = foreign.filter(|stage| *stage > done || !available.contains(stage));
        folder.discard(&outdated.flat_map(Stage::writes).collect::<Vec<_>>())
    }
}

/// Writes a stage's files, its record last. What was made from another version of them goes first.
fn write_files(
    folder: &mut RunFolder,
    (stage, made_from): (Stage, MadeFrom),
    files: &[(String, Vec<u8>)],
    line: &str,
) -> Result<Record, Error> {
    let is_written = |file: &String| files.iter().any(|(written, _)| written == file);
    let gone = stage.writes().into_iter().filter(|file| !is_written(file) && folder.digest(file).is_some());
    let new = files.iter().filter(|(file, bytes)| !folder.vouches_for(file, bytes));
    let changed: BTreeSet<String> = gone.chain(new.map(|(file, _)| file.clone())).collect();
    folder.discard(&outdated(stage, changed))?;
    for (file, bytes) in files {
        folder.write(file, bytes)?;
    }
    let digest = |(file, _): &(String, Vec<u8>)| Some((file.clone(), folder.digest(file)?.clone()));
    let digests = files.iter().filter_map(digest).collect();
    let record = Record::new(stage, made_from, digests, line.to_owned());
    folder.write(&Record::file_of(stage), record.to_json().as_bytes())?;
    Ok(record)
}

/// The files that do not hold any more once some files of a stage change: those of the stage itself, and those of later
/// stages that read one of them.
fn outdated(stage: Stage, mut changed: BTreeSet<String>) -> Vec<String> {
    let earlier: BTreeSet<String> =
        Stage::ALL.into_iter().filter(|s| *s < stage).flat_map(Stage::writes).collect();
    let kept: BTreeSet<String> = stage.writes().into_iter().filter(|file| !changed.contains(file)).collect();
    for later in Stage::ALL.into_iter().filter(|later| *later > stage) {
        if later.files_read().any(|file| changed.contains(&file)) {
            changed.extend(later.writes());
        }
    }
    changed.into_iter().filter(|file| !earlier.contains(file) && !kept.contains(file)).collect()
}
