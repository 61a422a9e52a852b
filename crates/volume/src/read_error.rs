//! What is wrong with a file.

use espalier_model::diagnose::Class;
use espalier_model::{Diagnose, GridError};
use glam::DVec3;
use thiserror::Error;

/// What is wrong with a file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReadError {
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
    #[error("more than {limit} bytes follow the voxels")]
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
    #[error("not a NIfTI-1 file: {what}")]
    Format {
        /// What it looks like.
        what: &'static str,
        /// What to do.
        way_out: &'static str,
    },
    /// A header field out of its range.
    #[error("header field {field} is {found}, expected {expected}")]
    Field {
        /// The name of the field in the NIfTI-1 standard.
        field: &'static str,
        /// What stands there.
        found: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// A type of numbers that is no scalar.
    #[error("the voxels are {what} (datatype {code}), espalier reads real numbers of 8 to 64 bits")]
    NotScalar {
        /// What they are.
        what: &'static str,
        /// The number in the header.
        code: i16,
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
        "neither sform nor qform is set: by the NIfTI-1 standard the axes of these {:.4} x {:.4} x {:.4} mm voxels \
         are RAS, many programs read LAS, which mirrors left and right",
        .spacing_mm.x, .spacing_mm.y, .spacing_mm.z
    )]
    NoSpace {
        /// The voxel's size by `pixdim`.
        spacing_mm: DVec3,
    },
    /// The numbers that place the volume in space are no legal transform.
    #[error("the {form} is not usable: {problem}")]
    Form {
        /// Which numbers.
        form: &'static str,
        /// What is wrong with them.
        problem: String,
    },
    /// The voxel grid is not legal.
    #[error("the {form} is not usable: {problem}")]
    Grid {
        /// Which numbers.
        form: &'static str,
        /// What is wrong with them.
        problem: GridError,
    },
}

impl Diagnose for ReadError {
    fn code(&self) -> &'static str {
        match self {
            Self::Io(_) => "E-VOLUME-IO",
            Self::NotAFile { .. } => "E-VOLUME-NOT-A-FILE",
            Self::Empty => "E-VOLUME-EMPTY-FILE",
            Self::Truncated { .. } | Self::Overdeclared { .. } => "E-VOLUME-TRUNCATED",
            Self::Corrupt { .. } => "E-VOLUME-CORRUPT",
            Self::Trailing { .. } => "E-VOLUME-TRAILING",
            Self::TooLarge { .. } => "E-VOLUME-TOO-LARGE",
            Self::NoMemory { .. } => "E-VOLUME-NO-MEMORY",
            Self::Format { .. } => "E-VOLUME-FORMAT",
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
            Self::Io(_) | Self::NotAFile { .. } => Class::Io,
            Self::TooLarge { .. } | Self::NoMemory { .. } => Class::Limit,
            Self::VolumeIndex { .. } => Class::Usage,
            _ => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Io(error) if error.kind() == std::io::ErrorKind::NotFound => {
                "check the path; input.path is relative to the config file"
            }
            Self::Io(_) => "check the permissions and the disk",
            Self::NotAFile { .. } => "give the .nii or .nii.gz file itself",
            Self::Empty | Self::Truncated { .. } | Self::Overdeclared { .. } | Self::Corrupt { .. } => {
                "the copy or download was not completed: fetch the file again"
            }
            Self::Trailing { .. } => "write the file again with the program that made it",
            Self::NoMemory { .. } => "crop or resample the volume, or use a larger machine",
            Self::TooLarge { .. } => "allow more with --max-memory, or crop or resample the volume",
            Self::Format { way_out, .. } => way_out,
            Self::Field { .. } => "write the file again with a program that checks its headers",
            Self::NotScalar { .. } => "convert the volume to one number a voxel",
            Self::FourDimensional { .. } => "choose one, counted from 0: `--set input.volume_index=0`, or `volume_index = 0` under [input]",
            Self::VolumeIndex { .. } => "choose another: `--set input.volume_index=0`, or `volume_index = 0` under [input]",
            Self::NoSpace { .. } => "say which: `--set input.assume_space=ras`, or las or lps, or `assume_space` under [input]",
            Self::Grid { problem: GridError::Sheared { .. }, .. } => {
                "with `--set input.strict=false`, the default, the volume is resampled to orthogonal axes"
            }
            Self::Form { .. } | Self::Grid { .. } => {
                "set sform or qform right in the program that made the file"
            }
        }
        .to_owned()
    }
}
