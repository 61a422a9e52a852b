//! All that a stage's results depend on, as it is now.

use std::path::Path;

use super::Run;
use super::source::input_files;
use crate::error::Error;
use crate::folder::{RunFolder, hex_digest};
use crate::provenance;
use crate::record::MadeFrom;
use crate::settings::Settings;
use crate::stage::{Artifact, Stage};
use crate::{scan_of_map, scan_of_walls};

impl Run<'_> {
    /// All that a stage's results depend on, as it is now.
    pub(super) fn made_from(
        &self,
        folder: &RunFolder,
        settings: &Settings,
        stage: Stage,
    ) -> Result<MadeFrom, Error> {
        let mut facts = settings.of(stage);
        let version = format!("{} of espalier {}", stage.version(), env!("CARGO_PKG_VERSION"));
        facts.insert("version".to_owned(), version);
        let is_traced = stage == Stage::Tree && self.artifacts.is_traced(&self.source);
        let artifacts = if is_traced { &[Artifact::Traced] } else { stage.reads() };
        // Of the files that the user names it may read others too; and what lies in the folder beside them does not count.
        let named = self.request.files.keys();
        for artifact in artifacts.iter().chain(named) {
            let digest = match self.artifacts.files.get(artifact) {
                Some(path) => Some(self.digest_of_input(*artifact, path)?),
                None => folder.digest(artifact.file()).cloned(),
            };
            facts.extend(digest.map(|digest| (artifact.what().to_owned(), digest)));
        }
        facts.insert("files named".to_owned(), (!self.request.files.is_empty()).to_string());
        for file in stage.reads_beside() {
            facts.extend(folder.digest(&file).cloned().map(|digest| (file, digest)));
        }
        for (side, path) in self.artifacts.side_paths.iter().filter(|(side, _)| side.stage() == stage) {
            let digest = provenance::digest_of_all(&self.artifacts.files_beside(*side, stage)?, path)?;
            facts.insert(side.key().to_owned(), digest);
        }
        // A map that shows the run's own input depends on it, and so do radii that look for walls in it.
        let config = &self.request.loaded.config;
        let looks_at_input = match stage {
            Stage::Radius => scan_of_walls::is_of_input(config, &self.source),
            Stage::Render => scan_of_map::is_of_input(config),
            _ => false,
        };
        if let (true, Some(path)) = (looks_at_input, self.artifacts.files.get(&Artifact::Volume)) {
            let rows = provenance::input_rows(&input_files(&self.source, &self.artifacts, (stage, path))?)?;
            facts.insert(Artifact::Volume.what().to_owned(), hex_digest(rows.as_bytes()));
        }
        Ok(MadeFrom(facts))
    }

    /// The digest of a file that the user names; of a series, or a header with its data, one over all of its files.
    fn digest_of_input(&self, artifact: Artifact, path: &Path) -> Result<String, Error> {
        match (&self.input_rows, artifact) {
            (Some(rows), Artifact::Volume | Artifact::Traced) => Ok(hex_digest(rows.as_bytes())),
            (_, Artifact::Volume | Artifact::Mask | Artifact::Skeleton) => {
                // What cannot be read is told by the stage that reads it.
                let files = espalier_volume::files(path, &self.artifacts.read_options).unwrap_or_default();
                provenance::digest_of_all(&files, path)
            }
            _ => provenance::digest(path),
        }
    }
}
