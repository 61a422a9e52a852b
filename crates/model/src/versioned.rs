//! Versioned JSON files: every file names its format and version, and a reader refuses what it does not know.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::diagnose::{Class, Diagnose};
use crate::tree::Tree;

/// Why a stage file cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FileError {
    /// Not JSON, or not of this shape.
    #[error("not a readable {format} file: {}", brief(source))]
    Malformed {
        /// The format expected.
        format: &'static str,
        /// What the parser found, with line and column.
        source: serde_json::Error,
    },
    /// Another format, or another version of it.
    #[error(
        "a file of format {found_format:.40} version {found_version}, expected {format} version {version}"
    )]
    Unknown {
        /// The format expected.
        format: &'static str,
        /// The version expected.
        version: u32,
        /// The format found.
        found_format: String,
        /// The version found.
        found_version: u32,
    },
    /// Well formed, but an invariant of the data does not hold.
    #[error("{format} file breaks an invariant: {what:.300}")]
    Invalid {
        /// The format expected.
        format: &'static str,
        /// The invariant and the place.
        what: String,
    },
    /// Well formed, but made for another tree.
    #[error("{format} file was made for another tree: for tree {found:.12}…, this one is {expected:.12}…")]
    OtherTree {
        /// The format expected.
        format: &'static str,
        /// The digest of the tree that the file was made for.
        found: String,
        /// The digest of this tree.
        expected: String,
    },
}

/// How much of what a parser says is shown: it quotes the file, whose words may be of any length.
const N_SHOWN: usize = 240;

/// What a parser says, with the place.
fn brief(error: &serde_json::Error) -> String {
    let text = error.to_string();
    if text.len() <= N_SHOWN {
        return text;
    }
    let start: String = text.chars().take(N_SHOWN).collect();
    format!("{start}… at line {} column {}", error.line(), error.column())
}

impl Diagnose for FileError {
    fn code(&self) -> &'static str {
        match self {
            Self::Malformed { .. } => "E-FILE-MALFORMED",
            Self::Unknown { .. } => "E-FILE-VERSION",
            Self::Invalid { .. } => "E-FILE-INVALID",
            Self::OtherTree { .. } => "E-FILE-OTHER-TREE",
        }
    }

    fn class(&self) -> Class {
        Class::Input
    }

    fn hint(&self) -> String {
        match self {
            Self::OtherTree { .. } => {
                "take the tree that the file was made for, or make the file again for this tree"
            }
            Self::Malformed { format, .. } | Self::Unknown { format, .. } | Self::Invalid { format, .. }
                if *format == crate::edits::FORMAT =>
            {
                "pipelines/README.md shows such a file; nodes.tsv has the numbers of branches and nodes"
            }
            Self::Malformed { format, .. } | Self::Invalid { format, .. }
                if *format == crate::views::VIEW_FORMAT =>
            {
                "take a views.json, or write { \"towards_camera\": [0, 1, 0], \"up\": [0, 0, 1] } with two vectors in RAS+"
            }
            _ => "write the file again with this version of espalier: run the stage that makes it",
        }
        .to_owned()
    }

    fn line(&self) -> Option<usize> {
        match self {
            Self::Malformed { source, .. } => Some(source.line()).filter(|line| *line > 0),
            _ => None,
        }
    }
}

#[derive(Serialize, Deserialize)]
struct Envelope<T> {
    format: String,
    version: u32,
    #[serde(flatten)]
    body: T,
}

#[derive(Deserialize)]
struct EnvelopeHead {
    format: String,
    version: u32,
}

/// Whether a file is for `tree`, by the digest in it.
pub(crate) fn check_tree(format: &'static str, found: &str, tree: &Tree) -> Result<(), FileError> {
    let expected = tree.digest();
    if found == expected {
        Ok(())
    } else {
        Err(FileError::OtherTree { format, found: found.to_owned(), expected })
    }
}

/// The JSON text of `body` under its format and version.
pub(crate) fn to_json<T: Serialize>(format: &'static str, version: u32, body: T) -> String {
    let envelope = Envelope { format: format.to_owned(), version, body };
    // Plain structs of numbers, strings and vectors: serialisation cannot fail.
    serde_json::to_string(&envelope).unwrap_or_default() + "\n"
}

/// The body of a JSON text, if its format and version are the expected ones.
pub(crate) fn from_json<T: DeserializeOwned>(
    format: &'static str,
    version: u32,
    text: &str,
) -> Result<T, FileError> {
    check_head(format, version, text)?;
    let malformed = |source| FileError::Malformed { format, source };
    let envelope: Envelope<T> = serde_json::from_str(text).map_err(malformed)?;
    Ok(envelope.body)
}

/// Whether a JSON text is of the expected format and version.
pub(crate) fn check_head(format: &'static str, version: u32, text: &str) -> Result<(), FileError> {
    let malformed = |source| FileError::Malformed { format, source };
    let head: EnvelopeHead = serde_json::from_str(text).map_err(malformed)?;
    if head.format != format || head.version != version {
        return Err(FileError::Unknown {
            format,
            version,
            found_format: head.format,
            found_version: head.version,
        });
    }
    Ok(())
}
