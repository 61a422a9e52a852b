//! The scans of a BIDS data set.
//!
//! **Input** the folder. **Output** its participants with their sessions, and every volume below them.
//! **Steps** 1. `sub-*`, and in each `ses-*` if there are any. 2. Below each, every `.nii` and `.nii.gz`.
//! **Guarantees** sorted by path; no folder deeper than [`DEEPEST`] is looked at, and none that begins with a dot, so that a
//! link to a folder above ends nowhere.

use std::fs;
use std::path::{Path, PathBuf};

use super::name::{self, Name};
use crate::error::Error;

/// How many folders a file may lie below that of its session: `anat/`, or what lies in it.
const DEEPEST: usize = 3;
/// The most volumes of a data set.
const MOST_FILES: usize = 100_000;

/// A participant, or one session of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Visit {
    /// The label after `sub-`.
    pub(super) participant: String,
    /// The label after `ses-`, where there are sessions.
    pub(super) session: Option<String>,
    pub(super) folder: PathBuf,
}

impl Visit {
    /// `sub-01`, or `sub-01/ses-A`.
    pub(super) fn relative(&self) -> String {
        let session = self.session.as_ref().map(|session| format!("/ses-{session}"));
        format!("sub-{}{}", self.participant, session.unwrap_or_default())
    }
}

/// A volume.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Scan {
    pub(super) path: PathBuf,
    /// The folders between that of the visit and the file, such as `anat`.
    pub(super) between: PathBuf,
    pub(super) name: Name,
}

/// Every participant, or session, of a data set.
pub(super) fn visits(root: &Path) -> Result<Vec<Visit>, Error> {
    let mut visits = Vec::new();
    for (participant, folder) in labelled(root, "sub")? {
        let sessions = labelled(&folder, "ses")?;
        if sessions.is_empty() {
            visits.push(Visit { participant: participant.clone(), session: None, folder });
        }
        visits.extend(sessions.into_iter().map(|(session, folder)| Visit {
            participant: participant.clone(),
            session: Some(session),
            folder,
        }));
    }
    Ok(visits)
}

/// The folders `KEY-*` in a folder, with their labels.
fn labelled(folder: &Path, key: &str) -> Result<Vec<(String, PathBuf)>, Error> {
    let entries = sorted(folder)?.into_iter().filter(|path| path.is_dir());
    let labelled = |path: PathBuf| {
        let label = name::label(path.file_name()?.to_str()?, key)?.to_owned();
        Some((label, path))
    };
    Ok(entries.filter_map(labelled).collect())
}

/// Every volume of a visit.
pub(super) fn scans(visit: &Visit) -> Result<Vec<Scan>, Error> {
    let mut scans = Vec::new();
    let mut folders = vec![(visit.folder.clone(), PathBuf::new(), 0)];
    while let Some((folder, between, depth)) = folders.pop() {
        for path in sorted(&folder)? {
            let Some(file_name) = path.file_name().map(PathBuf::from) else { continue };
            if path.is_dir() {
                let is_hidden = file_name.to_string_lossy().starts_with('.');
                if depth < DEEPEST && !is_hidden {
                    folders.push((path, between.join(file_name), depth + 1));
                }
            } else if let Some(name) = Name::of(&path) {
                scans.push(Scan { path, between: between.clone(), name });
            }
        }
        if scans.len() > MOST_FILES {
            return Err(Error::GroupSize { n_runs: scans.len(), limit: MOST_FILES });
        }
    }
    scans.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(scans)
}

fn sorted(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let read = |source| Error::Read { path: folder.to_owned(), source };
    let entries = fs::read_dir(folder).map_err(read)?;
    let mut paths: Vec<PathBuf> =
        entries.map(|entry| Ok(entry.map_err(read)?.path())).collect::<Result<_, Error>>()?;
    paths.sort();
    Ok(paths)
}
