//! The participants that a data set lists: `participants.tsv`.
//!
//! **Input** the data set. **Output** labels, without `sub-`; none where there is no such file, which BIDS allows.
//! **Guarantees** a list that is there but cannot be read is an error, not an empty list: those on it without a folder would
//! be missing from the page.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::name;
use crate::error::Error;
use crate::folder::is_absent;

const FILE: &str = "participants.tsv";
/// The longest list that is read, in bytes: a hundred thousand participants, each with a line of 160.
const MAX_BYTES: u64 = 16 << 20;
const COLUMN: &str = "participant_id";

/// The labels in the list; what is none is passed over.
pub(super) fn listed(root: &Path) -> Result<BTreeSet<String>, Error> {
    let path = root.join(FILE);
    let read = |source| Error::Read { path: path.clone(), source };
    let needed = match fs::metadata(&path) {
        Err(source) if is_absent(&source) => return Ok(BTreeSet::new()),
        metadata => metadata.map_err(read)?.len(),
    };
    if needed > MAX_BYTES {
        return Err(Error::TooLarge { path, needed, limit: MAX_BYTES });
    }
    // Labels are ASCII; what else the table has may be in any encoding that keeps tabs and lines.
    let bytes = fs::read(&path).map_err(read)?;
    let text = String::from_utf8_lossy(&bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut lines = text.lines();
    let heads = lines.next().unwrap_or_default();
    let Some(column) = heads.split('\t').position(|head| head.trim() == COLUMN) else {
        return Err(Error::BidsDataset { path, problem: format!("it has no column {COLUMN}") });
    };
    let cells = lines.filter_map(|line| line.split('\t').nth(column));
    Ok(cells.filter_map(|cell| name::label(cell.trim(), "sub")).map(str::to_owned).collect())
}
