//! What is wrong with a file.

use std::path::PathBuf;

use espalier_model::diagnose::Class;
use espalier_model::{Diagnose, GridError};
use glam::DVec3;
use thiserror::Error;

use crate::dicom::DicomError;

/// How many characters of what a file says are shown: its words may be of any length.
const N_SHOWN: usize = 300;

/// What is wrong with a file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
    /// A DICOM series that cannot be read.
    #[error(transparent)]
    Dicom(Box<DicomError>),
    /// Missing, unreadable, or the disk fails.
    #[error("cannot read: {0}")]
    Io(#[from] std::io::Error),
    /// A folder, a pipe, a device.
    #[error("this is {what}, not a file")]
    NotAFile {
        /// What it is.
        what: &'static str,
    },
    /// Nothing in it.
    #[error("the file is empty")]
    Empty,
    /// Fewer bytes than declared.
    #[error("the file is cut short: {expected} bytes expected{}, {found} found", if *.is_compressed { " after decompression" } else { "" })]
    Truncated {
        /// How many bytes the header and the voxels need.
        expected: u64,
        /// How many there are.
        found: u64,
        /// Whether both count decompressed bytes.
        is_compressed: bool,
    },
    /// More bytes declared than the compressed file can hold, whatever is in it.
    #[error(
        "the file is cut short: {expected} bytes expected after decompression, it can hold at most {at_most}"
    )]
    Overdeclared {
        /// How many bytes the header and the voxels need.
        expected: u64,
        /// The most that compressed data of this length can hold.
        at_most: u64,
    },
    /// The compressed data is damaged, or its checksum does not match.
    #[error("the compressed data is damaged after {position} decompressed bytes: {cause}")]
    Corrupt {
        /// How many bytes came out before.
        position: u64,
        /// What the decompressor says.
        cause: String,
    },
    /// More data after the voxels than any program writes.
    #[error("more bytes follow the voxels than the {limit} that may")]
    Trailing {
        /// How many are let pass.
        limit: u64,
    },
    /// More memory than allowed.
    #[error("the voxels need {needed} bytes of memory, allowed are {limit}")]
    TooLarge {
        /// How many bytes are needed.
        needed: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// More memory than the machine gives.
    #[error("the voxels need {needed} bytes of memory, which the machine does not give")]
    NoMemory {
        /// How many bytes are needed.
        needed: u64,
    },
    /// Not a file of a known format.
    #[error("not a volume that can be read: this is {what}")]
    Format {
        /// What it looks like.
        what: &'static str,
        /// What to do.
        way_out: String,
    },
    /// A header of text that goes on and on.
    #[error("the header is longer than {limit} bytes")]
    Header {
        /// How long a header may be.
        limit: usize,
    },
    /// A header that names a data file outside its folder.
    #[error("the header names the data file {:?}, which is not in its folder", brief(.written))]
    Escape {
        /// The name as written.
        written: String,
    },
    /// Voxels in more than one file.
    #[error("the header spreads its voxels over several files: {:?}", brief(.written))]
    SeveralFiles {
        /// What it says.
        written: String,
    },
    /// One of two files that belong together.
    #[error("this is {what}; there is none beside it {name}")]
    NoPartner {
        /// What it is.
        what: &'static str,
        /// How the other is called.
        name: &'static str,
    },
    /// A fault of the file that holds the voxels of a header.
    #[error("in its data file {}: {problem}", brief(&.path.to_string_lossy()))]
    Detached {
        /// What is wrong with it.
        problem: Box<ReadError>,
        /// The data file.
        path: PathBuf,
    },
    /// A header field out of its range.
    #[error("header field {field} is {}, expected {expected}", brief(.found))]
    Field {
        /// The name of the field in the format's own words.
        field: &'static str,
        /// What stands there.
        found: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// A type of numbers that is no scalar.
    #[error("the voxels are {what} ({stated:.100}), espalier reads real numbers of 8 to 64 bits")]
    NotScalar {
        /// What they are.
        what: &'static str,
        /// What the header says.
        stated: String,
    },
    /// A series of volumes.
    #[error("the file holds {n_volumes} volumes")]
    FourDimensional {
        /// How many.
        n_volumes: u64,
    },
    /// No such volume.
    #[error("volume {index} of the file was asked for, it holds {n_volumes}, counted from 0")]
    VolumeIndex {
        /// The one asked for.
        index: usize,
        /// How many there are.
        n_volumes: u64,
    },
    /// The file does not say how it lies in space.
    #[error(
        "the header does not say how its {:.4} x {:.4} x {:.4} mm voxels lie in the body: {readings}",
        .spacing_mm.x, .spacing_mm.y, .spacing_mm.z
    )]
    NoSpace {
        /// The voxel's size.
        spacing_mm: DVec3,
        /// What is missing, and what programs make of it.
        readings: &'static str,
    },
    /// The numbers that place the volume in space are no legal transform.
    #[error("the {form} cannot be used: {}", brief(.problem))]
    Form {
        /// Which numbers.
        form: &'static str,
        /// What is wrong with them.
        problem: String,
    },
    /// The voxel grid is not legal.
    #[error("the {form} cannot be used: {problem}")]
    Grid {
        /// Which numbers.
        form: &'static str,
        /// What is wrong with them.
        problem: GridError,
    },
}

/// The beginning of a text, with a mark where it was cut.
fn brief(text: &str) -> String {
    match text.char_indices().nth(N_SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

impl ReadError {
    /// The fault itself, whichever file it is in.
    pub(crate) fn innermost(&self) -> &Self {
        match self {
            Self::Detached { problem, .. } => problem.innermost(),
            other => other,
        }
    }

    /// Whether there are fewer bytes than there should be.
    pub(crate) fn is_truncated(&self) -> bool {
        matches!(self.innermost(), Self::Truncated { .. })
    }
}

impl From<DicomError> for ReadError {
    fn from(error: DicomError) -> Self {
        Self::Dicom(Box::new(error))
    }
}

impl Diagnose for ReadError {
    fn code(&self) -> &'static str {
        match self {
            Self::Dicom(error) => error.code(),
            Self::Io(_) => "E-VOLUME-IO",
            Self::NotAFile { .. } => "E-VOLUME-NOT-A-FILE",
            Self::Empty => "E-VOLUME-EMPTY-FILE",
            Self::Truncated { .. } | Self::Overdeclared { .. } => "E-VOLUME-TRUNCATED",
            Self::Corrupt { .. } => "E-VOLUME-CORRUPT",
            Self::Trailing { .. } => "E-VOLUME-TRAILING",
            Self::TooLarge { .. } => "E-VOLUME-TOO-LARGE",
            Self::NoMemory { .. } => "E-VOLUME-NO-MEMORY",
            Self::Format { .. } => "E-VOLUME-FORMAT",
            Self::Header { .. } => "E-VOLUME-HEADER",
            Self::Escape { .. } => "E-VOLUME-ESCAPE",
            Self::SeveralFiles { .. } => "E-VOLUME-SEVERAL-FILES",
            Self::NoPartner { .. } => "E-VOLUME-NO-PARTNER",
            Self::Detached { problem, .. } => problem.code(),
            Self::Field { .. } => "E-VOLUME-FIELD",
            Self::NotScalar { .. } => "E-VOLUME-DATATYPE",
            Self::FourDimensional { .. } => "E-VOLUME-4D",
            Self::VolumeIndex { .. } => "E-VOLUME-VOLUME-INDEX",
            Self::NoSpace { .. } => "E-VOLUME-NO-SPACE",
            Self::Form { .. } => "E-VOLUME-FORM",
            Self::Grid { problem: GridError::Sheared { .. }, .. } => "E-VOLUME-SHEAR",
            Self::Grid { .. } => "E-VOLUME-FORM",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Dicom(error) => error.class(),
            Self::Io(_) | Self::NotAFile { .. } => Class::Io,
            Self::TooLarge { .. } | Self::NoMemory { .. } => Class::Limit,
            Self::VolumeIndex { .. } => Class::Usage,
            Self::Detached { problem, .. } => problem.class(),
            _ => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Dicom(error) => return error.hint(),
            Self::Io(error) if error.kind() == std::io::ErrorKind::NotFound => {
                "check the path; input.path is relative to the config file"
            }
            Self::Io(_) => "check the permissions and the disk",
            Self::NotAFile { .. } => "give the file of the volume itself",
            Self::Empty | Self::Truncated { .. } | Self::Overdeclared { .. } | Self::Corrupt { .. } => {
                "the copy or download was not completed: fetch the file again"
            }
            Self::Trailing { .. } => "write the file again with the program that made it",
            Self::NoMemory { .. } => "crop or resample the volume, or use a larger machine",
            Self::TooLarge { .. } => "allow more with --max-memory, or crop or resample the volume",
            Self::Format { way_out, .. } => way_out,
            Self::Header { .. } => "check that this is the file of a volume",
            Self::Escape { .. } => "put the data file beside the header, and its bare name into the header",
            Self::SeveralFiles { .. } => "convert the volume to one file, .nrrd, .mha or .nii.gz",
            Self::NoPartner { .. } => "put both files of the pair into one folder, or convert them to one .nii.gz",
            Self::Detached { problem, .. } => return problem.hint(),
            Self::Field { .. } => "write the file again with a program that checks its headers",
            Self::NotScalar { .. } => "convert the volume to one number a voxel",
            Self::FourDimensional { .. } => "choose one, counted from 0: `--volume-index 0`, or `volume_index = 0` under [input]",
            Self::VolumeIndex { .. } => "choose another: `--volume-index 0`, or `volume_index = 0` under [input]",
            Self::NoSpace { .. } => "say which: `--assume-space ras`, or las or lps, or `assume_space` under [input]",
            Self::Grid { problem: GridError::Sheared { .. }, .. } => {
                "without `--strict`, and `strict = true` under [input], the volume is resampled to orthogonal axes"
            }
            Self::Form { .. } | Self::Grid { .. } => {
                "set sform or qform right in the program that made the file"
            }
        }
        .to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_file_says_is_cut_in_messages() {
        let long = "aé".repeat(100_000);
        let field = ReadError::Field { field: "line", found: long.clone(), expected: "a number" };
        let detached = ReadError::Detached { problem: Box::new(field), path: long.clone().into() };
        for error in [
            detached,
            ReadError::Escape { written: long.clone() },
            ReadError::SeveralFiles { written: long.clone() },
            ReadError::Form { form: "sform", problem: long },
        ] {
            let text = error.to_string();
            assert!(text.len() < 2000 && text.contains("aéaé") && text.contains('…'), "{text:.100}");
        }
    }
}
