//! The two files of a NIfTI pair.
//!
//! **Input** the path of one. **Output** the other: it has the same name but for `.hdr` and `.img`, each with or
//! without `.gz`, in either case of the letters.
//! **Guarantees** nothing but a file in the same folder is looked at.

use std::path::{Path, PathBuf};

use crate::ReadError;
use crate::source::Source;

/// Opens the voxels of a header.
pub(super) fn open_image(header: &Path) -> Result<Source, ReadError> {
    let image = partner(header, ".hdr", ".img").ok_or(ReadError::NoPartner {
        what: "the header of a NIfTI pair, whose voxels are in another file",
        name: "with the same name and the ending .img or .img.gz",
    })?;
    Source::open_detached(&image)
}

/// The header of an image.
pub(crate) fn header_of(image: &Path) -> Result<PathBuf, ReadError> {
    partner(image, ".img", ".hdr").ok_or(ReadError::NoPartner {
        what: "perhaps the voxels of a NIfTI pair, whose header is in another file",
        name: "with the same name and the ending .hdr or .hdr.gz",
    })
}

/// The file beside `path` that has `theirs` where it has `own`; one that is compressed like it goes first.
fn partner(path: &Path, own: &str, theirs: &str) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let lower = name.to_ascii_lowercase();
    let is_packed = lower.ends_with(".gz");
    let stem_bytes = lower.trim_end_matches(".gz").strip_suffix(own)?.len();
    // Lower case changes no ASCII string's length, and only ASCII letters change.
    let stem = name.get(..stem_bytes)?;
    let packed = format!("{theirs}.gz");
    let endings = if is_packed { [packed.as_str(), theirs] } else { [theirs, packed.as_str()] };
    let cases = |ending: &str| [ending.to_owned(), ending.to_ascii_uppercase()];
    let candidates =
        endings.into_iter().flat_map(cases).map(|ending| path.with_file_name(format!("{stem}{ending}")));
    candidates.into_iter().find(|candidate| candidate.is_file())
}
