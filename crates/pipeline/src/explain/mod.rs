//! What each error and warning code means: cause, way out, exit code.
//!
//! **Input** a code such as `E-VOLUME-4D`. **Output** its [`Entry`]. The texts stand in the TOML files beside this one, a
//! file for each part of the program; a message of a run says what is wrong with this input, an entry what is so in
//! general.
//! **Guarantees** every code that a source file can give has an entry, every entry has a source, and exit codes are
//! those of the errors: `tests/tests/codes/` fails otherwise.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// The parts of the program in the order of the data, and what is said of the codes of each.
const PARTS: [(&str, &str); 10] = [
    ("command line, configs, run folders", include_str!("run.toml")),
    ("volumes, masks, label maps", include_str!("volume.toml")),
    ("DICOM", include_str!("dicom.toml")),
    ("traced trees", include_str!("traced.toml")),
    ("skeleton, radius, tree", include_str!("tree.toml")),
    ("views, embed", include_str!("embed.toml")),
    ("render, report", include_str!("picture.toml")),
    ("compare, juxtapose, sweep, group, cohort, bids, profile, locate", include_str!("runs.toml")),
    ("phantom", include_str!("phantom.toml")),
    ("doctor", include_str!("doctor.toml")),
];

/// How many characters may differ between a code as typed and one that it is taken for.
const MAX_EDIT_DISTANCE: usize = 6;

/// What a code means.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// The code, such as `E-VOLUME-4D`; `W-…` for warnings.
    pub code: String,
    /// The part of the program that it is of.
    pub part: &'static str,
    #[serde(flatten)]
    what: What,
}

/// What stands in the files, below the code.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct What {
    #[serde(default, rename(serialize = "exit_codes"))]
    exit: Exits,
    title: String,
    cause: String,
    way_out: String,
    #[serde(default)]
    example: Option<String>,
}

/// No exit code, one, or several.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "OneOrMore")]
struct Exits(Vec<u8>);

#[derive(Deserialize)]
#[serde(untagged)]
enum OneOrMore {
    One(u8),
    More(Vec<u8>),
}

impl From<OneOrMore> for Exits {
    fn from(written: OneOrMore) -> Self {
        match written {
            OneOrMore::One(code) => Self(vec![code]),
            OneOrMore::More(codes) => Self(codes),
        }
    }
}

impl Entry {
    /// What it is, in a few words.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.what.title
    }

    /// How it comes about.
    #[must_use]
    pub fn cause(&self) -> &str {
        &self.what.cause
    }

    /// What can be done.
    #[must_use]
    pub fn way_out(&self) -> &str {
        &self.what.way_out
    }

    /// A command that does it, where there is one.
    #[must_use]
    pub fn example(&self) -> Option<&str> {
        self.what.example.as_deref()
    }

    /// The exit codes that the program may end with: none for a warning, mostly one for an error.
    #[must_use]
    pub fn exit_codes(&self) -> &[u8] {
        &self.what.exit.0
    }
}

/// All codes, by part of the program, errors before warnings.
#[must_use]
pub fn catalogue() -> Vec<Entry> {
    PARTS.iter().flat_map(|(part, text)| entries(part, text)).collect()
}

fn entries(part: &'static str, text: &str) -> Vec<Entry> {
    // The texts are part of the program, and a test reads them all.
    let read: BTreeMap<String, What> = toml::from_str(text).unwrap_or_default();
    read.into_iter().map(|(code, what)| Entry { code, part, what }).collect()
}

/// What a code means; in whatever case, blanks about it do not count.
///
/// # Errors
/// [`Error::UnknownCode`] with the nearest ones.
pub fn explain(code: &str) -> Result<Entry, Error> {
    let wanted = code.trim().to_ascii_uppercase();
    let all = catalogue();
    let nearest = nearest(&wanted, &all);
    let found = all.into_iter().find(|entry| entry.code == wanted);
    found.ok_or_else(|| Error::UnknownCode { code: code.to_owned(), nearest })
}

/// Up to three codes like this one.
fn nearest(wanted: &str, all: &[Entry]) -> Vec<String> {
    let mut near: Vec<(usize, &str)> = all
        .iter()
        .map(|entry| (strsim::damerau_levenshtein(wanted, &entry.code), entry.code.as_str()))
        .filter(|(distance, code)| {
            *distance <= MAX_EDIT_DISTANCE.min(wanted.len() / 2) || is_part(wanted, code)
        })
        .collect();
    near.sort_unstable_by_key(|&(distance, code)| (!is_part(wanted, code), distance, code));
    near.into_iter().take(3).map(|(_, code)| code.to_owned()).collect()
}

fn is_part(wanted: &str, code: &str) -> bool {
    wanted.len() > 2 && code.contains(wanted)
}

/// Whether an entry has more to say than a message with a hint: an example, or the only way out there is.
#[must_use]
pub fn is_worth_reading(code: &str, hint: &str) -> bool {
    explain(code).is_ok_and(|entry| hint.is_empty() || entry.example().is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_read_whole() {
        for (part, text) in PARTS {
            let read: Result<BTreeMap<String, What>, _> = toml::from_str(text);
            assert!(read.as_ref().is_ok_and(|codes| !codes.is_empty()), "{part}: {read:?}");
        }
        let codes: Vec<String> = catalogue().into_iter().map(|entry| entry.code).collect();
        let distinct: std::collections::BTreeSet<&String> = codes.iter().collect();
        assert_eq!(distinct.len(), codes.len());
    }

    #[test]
    fn texts_are_sentences() {
        for entry in catalogue() {
            let Entry { code, .. } = &entry;
            for text in [entry.cause(), entry.way_out()] {
                assert!(text.ends_with('.') && text.len() > 10, "{code}: {text}");
                let begin: Vec<&str> = text.split(' ').take(2).collect();
                let is_name = begin[0].contains(['.', '_']) || begin[1] == "=" || begin[0] == "espalier";
                assert!(is_name || !text.starts_with(char::is_lowercase), "{code}: {text}");
            }
            assert!(!entry.title().ends_with('.') && !entry.title().is_empty(), "{code}");
            assert!(code.starts_with("E-") || entry.exit_codes().is_empty(), "{code}: a warning ends no run");
        }
    }

    #[test]
    fn codes_are_found_and_missed() {
        assert_eq!(explain(" e-volume-4d ").expect("an entry").exit_codes(), [3]);
        let missed = |code: &str| match explain(code) {
            Err(Error::UnknownCode { nearest, .. }) => nearest,
            other => panic!("{other:?}"),
        };
        assert_eq!(missed("E-VOLUM-4D")[0], "E-VOLUME-4D");
        assert_eq!(missed("TRACHEA"), ["E-VOLUME-NO-TRACHEA"]);
        assert_eq!(missed("completely something else"), Vec::<String>::new());
    }
}
