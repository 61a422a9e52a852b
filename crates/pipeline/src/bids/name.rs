//! Names of files as BIDS has them: `sub-01_ses-A_desc-airway_mask.nii.gz`.

use std::path::Path;

/// The ends of the files that are read, longest first.
const EXTENSIONS: [&str; 2] = [".nii.gz", ".nii"];

/// A name of a file, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Name {
    /// All of it but its extension.
    pub(super) stem: String,
    /// `sub`, `ses`, `acq`, … with their values, in their order.
    entities: Vec<(String, String)>,
    /// What kind of image it is: `mask`, `dseg`, `ct`.
    pub(super) suffix: String,
}

impl Name {
    /// The name of a volume; none for any other file.
    pub(super) fn of(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let stem =
            EXTENSIONS.iter().find_map(|end| name.strip_suffix(end)).filter(|stem| !stem.is_empty())?;
        if stem.starts_with('.') {
            return None;
        }
        let (rest, suffix) = stem.rsplit_once('_').unwrap_or(("", stem));
        let pairs = rest.split('_').filter_map(|part| part.split_once('-'));
        let entities = pairs.map(|(key, value)| (key.to_owned(), value.to_owned())).collect();
        Some(Self { stem: stem.to_owned(), entities, suffix: suffix.to_owned() })
    }

    /// The value of an entity.
    pub(super) fn entity(&self, key: &str) -> Option<&str> {
        self.entities.iter().find(|(known, _)| known == key).map(|(_, value)| value.as_str())
    }
}

/// The label of a folder such as `sub-01`.
pub(super) fn label<'a>(name: &'a str, key: &str) -> Option<&'a str> {
    let label = name.strip_prefix(key)?.strip_prefix('-')?;
    let is_label =
        !label.is_empty() && label.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '_'));
    is_label.then_some(label)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_taken_apart() {
        let name = Name::of(Path::new("a/sub-01_ses-A_desc-airway_mask.nii.gz")).expect("a name");
        assert_eq!((name.suffix.as_str(), name.stem.as_str()), ("mask", "sub-01_ses-A_desc-airway_mask"));
        assert_eq!(
            (name.entity("sub"), name.entity("desc"), name.entity("run")),
            (Some("01"), Some("airway"), None)
        );
        assert_eq!(Name::of(Path::new("mask.nii")).map(|name| name.suffix), Some("mask".to_owned()));
        for other in ["sub-01_mask.json", ".nii.gz", "._sub-01_mask.nii.gz", "sub-01_mask.nii.gz.part"] {
            assert_eq!(Name::of(Path::new(other)), None, "{other}");
        }
        assert_eq!(
            (label("sub-01", "sub"), label("sub-", "sub"), label("ses-a", "sub")),
            (Some("01"), None, None)
        );
        assert_eq!(label("sub-../x", "sub"), None);
    }
}
