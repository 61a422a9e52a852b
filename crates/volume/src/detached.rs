//! The data file that a header names.
//!
//! **Input** the header's path and the name as written. **Output** the data file's path.
//! **Guarantees** the path lies in the header's folder or below it, whatever the header says: a volume from elsewhere
//! must not make espalier read other files of this machine.

use std::path::{Component, Path, PathBuf};

use crate::ReadError;

/// The path of the file that `header` names as `written`.
pub(crate) fn data_file(header: &Path, written: &str) -> Result<PathBuf, ReadError> {
    let name = Path::new(written);
    // A drive or a backslash is an ordinary letter here and a way out elsewhere.
    let has_way_out = written.contains('\\') || written.contains(':') || written.contains('\0');
    let is_below = name.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if written.is_empty() || has_way_out || !is_below {
        return Err(ReadError::Escape { written: written.chars().take(200).collect() });
    }
    Ok(header.parent().unwrap_or(Path::new("")).join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_below_the_header() {
        let below = |written| data_file(Path::new("scans/a.nhdr"), written).ok();
        assert_eq!(below("a.raw"), Some(PathBuf::from("scans/a.raw")));
        assert_eq!(below("./raw/a b.raw"), Some(PathBuf::from("scans/./raw/a b.raw")));
        for written in ["", "/etc/services", "../a.raw", "raw/../../a", "C:\\a.raw", "..\\a.raw", "a\0b"] {
            assert_eq!(below(written), None, "{written}");
        }
    }
}
