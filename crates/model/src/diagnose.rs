//! What every error of espalier can say about itself.

use std::borrow::Cow;
use std::path::Path;

/// The class of an error, which decides the exit code of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// A bug of ours.
    Internal,
    /// Wrong usage or configuration.
    Usage,
    /// The input is malformed or holds nothing to work on.
    Input,
    /// A stated limit would be exceeded.
    Limit,
    /// The topology is refused by policy.
    Topology,
    /// No certified layout, or a verification failed.
    Uncertified,
    /// An output cannot be created.
    CannotCreate,
    /// A file is missing, unreadable, or the disk fails.
    Io,
    /// Another run holds the folder.
    Locked,
}

impl Class {
    /// The exit code of the program for this class.
    #[must_use]
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Internal => 1,
            Self::Usage => 2,
            Self::Input => 3,
            Self::Limit => 5,
            Self::Topology => 6,
            Self::Uncertified => 8,
            Self::CannotCreate => 73,
            Self::Io => 74,
            Self::Locked => 75,
        }
    }

    /// All classes, by exit code.
    pub const ALL: [Self; 9] = [
        Self::Internal,
        Self::Usage,
        Self::Input,
        Self::Limit,
        Self::Topology,
        Self::Uncertified,
        Self::CannotCreate,
        Self::Io,
        Self::Locked,
    ];

    /// What it means, as a phrase.
    #[must_use]
    pub fn meaning(self) -> &'static str {
        match self {
            Self::Internal => "a bug of ours",
            Self::Usage => "usage or config",
            Self::Input => "the input is malformed or holds nothing to work on",
            Self::Limit => "over a stated limit",
            Self::Topology => "topology refused by policy",
            Self::Uncertified => "no certified layout, an altered file, or a claim that does not hold",
            Self::CannotCreate => "an output cannot be created",
            Self::Io => "a missing or unreadable file, or the disk failed",
            Self::Locked => "another run holds the folder",
        }
    }
}

/// An error that names its code, its class and the way out. Its `Display` names the place and the cause.
pub trait Diagnose: std::error::Error {
    /// A short stable code such as `E-VOLUME-TRUNCATED`.
    fn code(&self) -> &'static str;
    /// The class, hence the exit code.
    fn class(&self) -> Class;
    /// What the user can do about it; empty where the message says it all.
    fn hint(&self) -> String {
        String::new()
    }
    /// The file or folder that is wrong, where the error knows it.
    fn file(&self) -> Option<&Path> {
        None
    }
    /// The line of that file, from 1, where it is one.
    fn line(&self) -> Option<usize> {
        None
    }
}

/// A parameter outside its range. The runner finds the line of `key` in the config.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct ParamError {
    /// The key inside the stage's table, such as `particles`; of a list with its place, such as `weights[2].nodes`.
    pub key: Cow<'static, str>,
    /// What is wrong with its value, with the range allowed: `must be at least 2, is 0`.
    pub message: String,
}

impl ParamError {
    /// An error at `key` unless `is_legal`.
    ///
    /// # Errors
    /// If not `is_legal`.
    pub fn check(
        key: impl Into<Cow<'static, str>>,
        is_legal: bool,
        message: impl Into<String>,
    ) -> Result<(), Self> {
        if is_legal { Ok(()) } else { Err(Self { key: key.into(), message: message.into() }) }
    }
}

impl Diagnose for ParamError {
    fn code(&self) -> &'static str {
        "E-PARAM"
    }

    fn class(&self) -> Class {
        Class::Usage
    }
}
