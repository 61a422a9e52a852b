//! The file or folder that an error speaks of, and the line in it.

use std::path::Path;

use espalier_model::diagnose::Diagnose;

use super::Error;

/// The file or folder that is wrong, where there is one.
pub(super) fn file(error: &Error) -> Option<&Path> {
    match error {
        Error::Config(cause) => cause.file(),
        Error::Stage { cause, .. } => cause.file(),
        Error::File { path, cause } => cause.file().or(Some(path)),
        Error::Point { source_name, .. } => source_name.as_ref().map(Path::new),
        Error::MissingArtifact { path, .. }
        | Error::Altered { path }
        | Error::Samples { path, .. }
        | Error::BidsDataset { path, .. }
        | Error::Certificate { path, .. }
        | Error::PlotFormat { path }
        | Error::ResultInTheWay { path }
        | Error::InputInTheWay { path }
        | Error::FileInTheWay { path }
        | Error::FolderInTheWay { path }
        | Error::OtherInput { path, .. }
        | Error::Read { path, .. }
        | Error::TooLarge { path, .. }
        | Error::Create { path, .. }
        | Error::Write { path, .. } => Some(path),
        Error::NoRun { folder, .. }
        | Error::NoTree { folder, .. }
        | Error::NoBidsScan { folder, .. }
        | Error::BidsOutput { folder }
        | Error::RunInTheWay { folder }
        | Error::Settled { folder, .. }
        | Error::SettledTree { folder, .. }
        | Error::Unverified { folder, .. }
        | Error::Locked { folder } => Some(folder),
        _ => None,
    }
}

/// The line of that file, from 1, where there is one.
pub(super) fn line(error: &Error) -> Option<usize> {
    match error {
        Error::Config(cause) => cause.line(),
        Error::Stage { cause, .. } | Error::File { cause, .. } => cause.line(),
        Error::Point { cause, .. } => cause.line(),
        _ => None,
    }
}
