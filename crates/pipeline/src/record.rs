//! What a stage's results were made from: `stages/NN-NAME/record.json`, written when all of them are in place.
//!
//! **Input** the settings that a stage reads, and the digests of the files that it reads. **Output** its key, and
//! whether the results in a run folder are those of the key.
//! **Guarantees** no path, time or host is in a key: equal keys, equal results, wherever and whenever they were made.
//! Results count only if every file is there with the bytes that the record states.
//! **Source** constructive traces: Mokhov, Mitchell, Peyton Jones, Build Systems à la Carte, 2018.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::folder::{RunFolder, hex_digest};
use crate::stage::Stage;

const FORMAT: &str = "espalier-record";
const VERSION: u32 = 1;

/// All that a stage's results depend on, by name: its version, settings, and the digests of files.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct MadeFrom(pub(crate) BTreeMap<String, String>);

/// A stage's results: from what they were made, and which they are.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Record {
    format: String,
    version: u32,
    stage: String,
    /// The SHA-256 of what it was made from.
    key: String,
    made_from: MadeFrom,
    /// The SHA-256 of each of its files.
    files: BTreeMap<String, String>,
    /// What the stage had to say, as a phrase.
    pub(crate) line: String,
}

/// Why a stage's results are not those of its key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reason {
    /// There are none.
    Absent,
    /// The record is not as it was written.
    RecordAltered,
    /// A file is missing or is not as it was written.
    FileAltered {
        /// The file, relative to the run folder.
        file: String,
    },
    /// They were made from something else.
    MadeFrom {
        /// What it is: a setting's key, or a file.
        what: String,
        /// What it was then; none if it was not there.
        then: Option<String>,
        /// What it is now.
        now: Option<String>,
    },
    /// An earlier stage is to be done first, and this one reads what it makes: if that comes out as before, nothing is to
    /// be done.
    After {
        /// The earlier stage.
        stage: Stage,
    },
    /// They are to be made again in any case.
    Forced,
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Absent => f.write_str("not done yet"),
            Self::RecordAltered => f.write_str("its record is not as it was written"),
            Self::FileAltered { file } => write!(f, "{file} is missing or not as it was written"),
            Self::MadeFrom { what, then: Some(then), now: Some(now) } if !is_digest(then) => {
                write!(f, "{what} is {now}, was {then}")
            }
            Self::MadeFrom { what, now: Some(now), .. } if !is_digest(now) => {
                write!(f, "{what} is {now} now")
            }
            Self::MadeFrom { what, now: Some(_), .. } => write!(f, "{what} is another"),
            Self::MadeFrom { what, now: None, .. } => write!(f, "{what} is there no more"),
            Self::After { stage } => write!(f, "reads what {stage} makes"),
            Self::Forced => f.write_str("asked for"),
        }
    }
}

fn is_digest(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

impl MadeFrom {
    /// The key: a digest of all of it.
    pub(crate) fn key(&self) -> String {
        // A map of texts: serialisation cannot fail, and its order is that of the names.
        hex_digest(serde_json::to_string(self).unwrap_or_default().as_bytes())
    }

    /// The first thing that differs from what an earlier result was made from.
    fn difference(&self, earlier: &Self) -> Option<Reason> {
        let names = self.0.keys().chain(earlier.0.keys());
        names.into_iter().find_map(|what| {
            let (then, now) = (earlier.0.get(what), self.0.get(what));
            let differs = Reason::MadeFrom { what: what.clone(), then: then.cloned(), now: now.cloned() };
            (then != now).then_some(differs)
        })
    }
}

impl Record {
    pub(crate) fn new(
        stage: Stage,
        made_from: MadeFrom,
        files: BTreeMap<String, String>,
        line: String,
    ) -> Self {
        let (format, stage) = (FORMAT.to_owned(), stage.name().to_owned());
        Self { format, version: VERSION, stage, key: made_from.key(), made_from, files, line }
    }

    /// Where a stage's record is, relative to the run folder.
    pub(crate) fn file_of(stage: Stage) -> String {
        format!("{}/record.json", stage.folder())
    }

    pub(crate) fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// The files of the stage and their digests, without the record itself.
    pub(crate) fn files(&self) -> &BTreeMap<String, String> {
        &self.files
    }

    /// The digest of what they were made from.
    pub(crate) fn key(&self) -> &str {
        &self.key
    }

    pub(crate) fn made_from(&self) -> &MadeFrom {
        &self.made_from
    }

    /// The record of a stage's results as they lie in the folder, if they are just what would be made again.
    ///
    /// # Errors
    /// [`Error`] if a file cannot be read, though it is there.
    pub(crate) fn standing(
        folder: &RunFolder,
        stage: Stage,
        made_from: &MadeFrom,
    ) -> Result<Result<Self, Reason>, Error> {
        let Some(bytes) = folder.bytes_if_there(&Self::file_of(stage))? else {
            return Ok(Err(Reason::Absent));
        };
        let record = match Self::parsed(stage, &bytes) {
            Some(record) if folder.check(&Self::file_of(stage), &bytes).is_ok() => record,
            _ => return Ok(Err(Reason::RecordAltered)),
        };
        if let Some(reason) = made_from.difference(&record.made_from) {
            return Ok(Err(reason));
        }
        for (file, digest) in &record.files {
            if folder.digest_if_there(file)?.as_ref() != Some(digest) {
                return Ok(Err(Reason::FileAltered { file: file.clone() }));
            }
        }
        Ok(Ok(record))
    }

    /// A record that says what it can know of: of this stage, its key that of what it was made from, its files those
    /// that the stage may write.
    pub(crate) fn parsed(stage: Stage, bytes: &[u8]) -> Option<Self> {
        let record: Self = serde_json::from_slice(bytes).ok()?;
        let is_own = record.format == FORMAT && record.version == VERSION && record.stage == stage.name();
        let may_write = stage.writes();
        let is_whole =
            record.key == record.made_from.key() && record.files.keys().all(|file| may_write.contains(file));
        (is_own && is_whole).then_some(record)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made_from(facts: &[(&str, &str)]) -> MadeFrom {
        MadeFrom(facts.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect())
    }

    #[test]
    fn a_key_depends_on_every_name_and_value() {
        let base = made_from(&[("a", "1"), ("b", "2")]);
        for other in [
            &[("a", "1"), ("b", "3")][..],
            &[("a", "1")],
            &[("a", "1"), ("c", "2")],
            &[("a", "12"), ("b", "")],
        ] {
            assert_ne!(base.key(), made_from(other).key(), "{other:?}");
        }
    }

    #[test]
    fn the_reason_names_the_setting_and_both_values() {
        let (then, now) = (made_from(&[("embed.w_angle", "1.0")]), made_from(&[("embed.w_angle", "3.0")]));
        let reason = now.difference(&then).map(|reason| reason.to_string());
        assert_eq!(reason.as_deref(), Some("embed.w_angle is 3.0, was 1.0"));
        let (then, now) =
            (made_from(&[("tree.swc", &"a".repeat(64))]), made_from(&[("tree.swc", &"b".repeat(64))]));
        assert_eq!(now.difference(&then).map(|r| r.to_string()).as_deref(), Some("tree.swc is another"));
        assert_eq!(now.difference(&now), None);
    }

    #[test]
    fn a_record_is_read_back_and_any_flip_of_its_key_part_is_seen() {
        let facts = made_from(&[("seed", "7"), ("tree.swc", &"0".repeat(64))]);
        let files = BTreeMap::from([("views.json".to_owned(), "1".repeat(64))]);
        let json = Record::new(Stage::Views, facts, files, "a line".to_owned()).to_json();
        assert!(Record::parsed(Stage::Views, json.as_bytes()).is_some());
        assert!(Record::parsed(Stage::Embed, json.as_bytes()).is_none(), "of another stage");
        assert!(Record::parsed(Stage::Views, json.replace("\"7\"", "\"8\"").as_bytes()).is_none());
        assert!(Record::parsed(Stage::Views, json.replace("views.json", "../etc").as_bytes()).is_none());
    }
}
