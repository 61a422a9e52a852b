//! The scans of a BIDS data set.
//!
//! **Input** the folder. **Output** its participants with their sessions, and every volume below them.
//! **Steps** 1. `sub-*`, and in each `ses-*` if there are any. 2. Below each, every `.nii` and `.nii.gz`.
//! **Guarantees** sorted by path; no folder deeper than [`DEEPEST`] is looked at, and none that begins with a dot, so that a
//! link to a folder above ends nowhere. At [`MOST_FILES`] volumes the search ends.

use std::fs;
use std::path::{Path, PathBuf};

use super::name::{self, Name};
use crate::error::Error;

/// How many folders a file may lie below that of its session: `anat/`, or what lies in it.
const DEEPEST: usize = 3;
/// The most volumes of a data set: ten times what a page shows.
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

/// Every volume of each visit of the data set.
pub(super) fn scans(visits: &[Visit]) -> Result<Vec<(&Visit, Vec<Scan>)>, Error> {
    let (mut found, mut n_found) = (Vec::with_capacity(visits.len()), 0);
    for visit in visits {
        let scans = scans_of(visit, n_found, MOST_FILES)?;
        n_found += scans.len();
        found.push((visit, scans));
    }
    Ok(found)
}

/// Every volume of a visit, where so many were found before, and so many may be in all.
fn scans_of(visit: &Visit, n_before: usize, limit: usize) -> Result<Vec<Scan>, Error> {
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
        let n_runs = n_before + scans.len();
        if n_runs > limit {
            return Err(Error::GroupSize { n_runs, limit });
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_are_counted_over_all_visits() {
        let folder = tempfile::tempdir().expect("a folder");
        for file in ["sub-01_mask.nii", "sub-01_ct.nii.gz", "sub-01_ct.json"] {
            fs::write(folder.path().join(file), "").expect("a file");
        }
        let visit = Visit { participant: "01".to_owned(), session: None, folder: folder.path().to_owned() };
        assert_eq!(scans_of(&visit, 3, 5).expect("volumes").len(), 2);
        assert!(matches!(scans_of(&visit, 4, 5), Err(Error::GroupSize { n_runs: 6, limit: 5 })));
    }
}
