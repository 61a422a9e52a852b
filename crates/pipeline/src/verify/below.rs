//! Which folders there are to verify: one of results, or all below one, such as a cohort's.
//!
//! **Input** a folder. **Output** whether it has results of its own, else the folders below that have.
//! **Guarantees** a folder whose own list of results is gone is not passed over: only one without any result of ours counts
//! as a folder of folders. Links are not followed; the walk ends some folders down.

use std::fs;
use std::path::{Path, PathBuf};

use super::{Malformed, SUMS};
use crate::error::Error;
use crate::failure;

/// How far down run folders lie: in a BIDS data set `sub-01/ses-A/anat/NAME`, and one more for the data set itself.
const MAX_DEPTH: usize = 6;
/// What only a folder of results has, whatever became of its list.
const OF_RESULTS: [&str; 8] = [
    "provenance",
    "stages",
    "tree.swc",
    "embedding.json",
    "compare.tsv",
    "sweep.tsv",
    "juxtaposition.tsv",
    "group.tsv",
];

/// What there is to verify.
pub(super) enum Found {
    /// The folder itself.
    Sealed,
    /// Folders below it, by their place in it.
    Below {
        /// Those with results.
        sealed: Vec<String>,
        /// Those with results that no list vouches for, as a run that was killed leaves them.
        unsealed: Vec<String>,
        /// Runs that have stopped before they had one.
        unfinished: Vec<String>,
    },
}

/// Finds what there is to verify.
///
/// # Errors
/// No list of results anywhere, and a folder that cannot be read.
pub(super) fn find(folder: &Path) -> Result<Found, Error> {
    if folder.join(SUMS).exists() {
        return Ok(Found::Sealed);
    }
    let refused = |place: &str| Error::file(&folder.join(place).join(SUMS), Malformed::Absent);
    let (mut sealed, mut unsealed, mut unfinished) = (Vec::new(), Vec::new(), Vec::new());
    let mut open: Vec<(PathBuf, usize)> = vec![(PathBuf::new(), 0)];
    while let Some((place, depth)) = open.pop() {
        let path = folder.join(&place);
        let name = place.to_string_lossy().into_owned();
        let has_results = OF_RESULTS.iter().any(|own| path.join(own).exists());
        match (path.join(SUMS).exists(), has_results) {
            (true, _) => sealed.push(name),
            (false, true) if depth > 0 && failure::read(&path).is_some() && !path.join("stages").exists() => {
                unfinished.push(name);
            }
            (false, true) if depth > 0 => unsealed.push(name),
            (false, true) => return Err(refused("")),
            (false, false) if depth < MAX_DEPTH => {
                open.extend(folders_in(&path)?.into_iter().map(|name| (place.join(name), depth + 1)));
            }
            (false, false) => {}
        }
    }
    [&mut sealed, &mut unsealed, &mut unfinished].into_iter().for_each(|names| names.sort());
    if sealed.is_empty() {
        return Err(refused(unsealed.first().map_or("", String::as_str)));
    }
    Ok(Found::Below { sealed, unsealed, unfinished })
}

/// The names of the folders in a folder but for hidden ones.
fn folders_in(path: &Path) -> Result<Vec<PathBuf>, Error> {
    let read = |source| Error::Read { path: path.to_owned(), source };
    let mut names = Vec::new();
    for entry in fs::read_dir(path).map_err(read)? {
        let entry = entry.map_err(read)?;
        let is_hidden = entry.file_name().to_string_lossy().starts_with('.');
        if !is_hidden && entry.file_type().map_err(read)?.is_dir() {
            names.push(PathBuf::from(entry.file_name()));
        }
    }
    Ok(names)
}
