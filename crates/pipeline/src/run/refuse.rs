//! What a run will not do: build on results made from something else, or write over what is not its own.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::Run;
use super::source::{input_files, stages_of};
use crate::config::Source;
use crate::error::Error;
use crate::failure;
use crate::folder::{DIGEST_FILE, RunFolder};
use crate::provenance;
use crate::record::Record;
use crate::settings::Settings;
use crate::stage::Stage;

impl Run<'_> {
    /// Checks what stages hand over that are not done in this run: results made from it count as long as it is what it was.
    pub(super) fn check_hand_over(&self, folder: &RunFolder, stages: &[Stage]) -> Result<(), Error> {
        let is_made_here =
            |file: &str| stages.iter().any(|stage| stage.writes().iter().any(|own| own == file));
        let handed = stages.iter().flat_map(|stage| stage.reads());
        let handed = handed.filter(|artifact| !self.artifacts.files.contains_key(artifact));
        for file in handed.map(|artifact| artifact.file()).filter(|file| !is_made_here(file)) {
            let (stated, found) = (folder.digest(file), folder.digest_if_there(file)?);
            if stated.is_some() && found.is_some() && found.as_ref() != stated {
                return Err(Error::Altered { path: folder.path().join(file) });
            }
        }
        Ok(())
    }

    /// No result may take the place of what it is made from, nor may that go as a result that does not hold any more.
    pub(super) fn refuse_own_input(&self, files: &[PathBuf], stages: &[Stage]) -> Result<(), Error> {
        let Ok(out) = std::fs::canonicalize(&self.request.out) else { return Ok(()) };
        let changed = files_from(stages.first().copied());
        for path in files {
            let place = std::fs::canonicalize(path).ok();
            let name = place.as_ref().and_then(|place| place.strip_prefix(&out).ok()?.to_str());
            if name.is_some_and(|name| changed.contains(name)) {
                return Err(Error::InputInTheWay { path: path.clone() });
            }
        }
        Ok(())
    }

    /// No result may take the place of a file that no run has made, unless that is asked for; of a folder in no case. A run
    /// that ends early changes the files of the later stages too: it removes them.
    pub(super) fn refuse_to_overwrite(&self, folder: &RunFolder, stages: &[Stage]) -> Result<(), Error> {
        let beside =
            provenance::FILES.into_iter().chain(provenance::FILES_ASIDE).chain([failure::FILE, DIGEST_FILE]);
        let beside: BTreeSet<String> = beside.map(str::to_owned).collect();
        let changed = files_from(stages.first().copied());
        let recorded = recorded(folder);
        // The list of somebody else's files vouches for none of ours.
        let is_list_ours = !recorded.is_empty()
            || ["stages/", "provenance/"].iter().any(|place| folder.vouches_below(place))
            || std::fs::metadata(folder.path().join(DIGEST_FILE)).is_ok_and(|list| list.len() == 0);
        let left = folder.cut_short().map(|stage| files_from(Some(stage)));
        let may_write = |file: &String| {
            let is_left = left.as_ref().is_some_and(|left| left.contains(file) || beside.contains(file));
            self.request.force || is_left
        };
        for file in changed.union(&beside) {
            let path = folder.path().join(file);
            let Ok(there) = std::fs::symlink_metadata(&path) else { continue };
            if there.is_dir() {
                return Err(Error::FolderInTheWay { path });
            }
            let is_listed = is_list_ours && (file == DIGEST_FILE || folder.digest(file).is_some());
            // In folders of the names that ours have nobody else writes.
            if !may_write(file) && !file.contains('/') && !is_listed && !recorded.contains(file) {
                return Err(Error::FileInTheWay { path });
            }
        }
        Ok(())
    }

    /// A run that begins in the middle builds on results that were made with the same settings, or not at all.
    /// Files that the user names are the user's to answer for.
    pub(super) fn refuse_other_settings(
        &self,
        folder: &RunFolder,
        settings: &Settings,
        stages: &[Stage],
    ) -> Result<(), Error> {
        let available = stages_of(&self.source);
        let (Some(from), true) = (self.request.from, self.request.files.is_empty()) else { return Ok(()) };
        let earlier: Vec<Stage> =
            available.iter().copied().filter(|stage| Some(stage) < stages.first()).collect();
        if earlier.is_empty() {
            return Ok(());
        }
        if let Some(difference) = settings.difference(&earlier, available[0]) {
            return Err(Error::OtherSettings { from, difference: Box::new(difference) });
        }
        let sides = self.artifacts.side_paths.iter().filter(|(_, path)| path.is_file());
        for (side, path) in sides.filter(|(side, _)| earlier.contains(&side.stage())) {
            if provenance::is_other_side_file(folder, *side, path)? {
                return Err(Error::OtherInput { from, path: path.clone(), first: side.stage() });
            }
        }
        // Scans of many patients share one name; their content tells them apart. A scan that lies elsewhere now, or
        // nowhere, is no reason to stop: nothing will be read from it.
        let (Source::Volume(input) | Source::Tree(input)) = &self.source else { return Ok(()) };
        if input.exists() && self.is_other_input(folder, available[0], input)? {
            return Err(Error::OtherInput { from, path: input.clone(), first: available[0] });
        }
        Ok(())
    }

    fn is_other_input(&self, folder: &RunFolder, first: Stage, input: &Path) -> Result<bool, Error> {
        let files = input_files(&self.source, &self.artifacts, (first, input))?;
        provenance::is_other_input(folder, &files)
    }
}

/// Every file that a stage or a later one may write.
fn files_from(first: Option<Stage>) -> BTreeSet<String> {
    Stage::ALL.into_iter().filter(|stage| Some(*stage) >= first).flat_map(Stage::writes).collect()
}

/// The files that the records in a folder name.
fn recorded(folder: &RunFolder) -> BTreeSet<String> {
    let record = |stage: Stage| {
        let bytes = folder.bytes_if_there(&Record::file_of(stage)).ok().flatten()?;
        Record::parsed(stage, &bytes)
    };
    let records = Stage::ALL.into_iter().filter_map(record);
    records.flat_map(|record| record.files().keys().cloned().collect::<Vec<_>>()).collect()
}
