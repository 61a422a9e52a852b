//! Why a volume cannot be read, or has no mask.

use std::path::PathBuf;

use espalier_model::Diagnose;
use espalier_model::diagnose::{Class, ParamError};
use thiserror::Error;

use crate::ReadError;

/// Why a volume cannot be read, or has no mask.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be used.
    #[error("{problem}: {}", .path.display())]
    Read {
        /// What is wrong with it.
        problem: ReadError,
        /// The file.
        path: PathBuf,
    },
    /// A parameter out of its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// The volume does not say by itself which voxels are the organ.
    #[error("{found}, so the method must be given")]
    MethodNeeded {
        /// What the volume looks like, with its range of values.
        found: String,
        /// The keys to set.
        way_out: String,
    },
    /// No voxel was chosen.
    #[error("{what} holds no voxel; the values of the volume go from {min} to {max}")]
    Empty {
        /// The choice that came out empty.
        what: String,
        /// The smallest finite value; NaN if there is none.
        min: f64,
        /// The largest finite value; NaN if there is none.
        max: f64,
    },
    /// The seed lies outside the volume.
    #[error("the seed {seed} lies outside the volume of {}x{}x{} voxels", .shape[0], .shape[1], .shape[2])]
    SeedOutside {
        /// The seed as given, with its unit.
        seed: String,
        /// Voxels along x, y, z.
        shape: [usize; 3],
    },
    /// The seed's value is not in the band.
    #[error(
        "the seed voxel ({}, {}, {}) has the value {value}, outside {lower} to {upper}; the nearest voxel inside \
         is ({}, {}, {}), {distance_mm:.1} mm away",
        .seed[0], .seed[1], .seed[2], .nearest[0], .nearest[1], .nearest[2]
    )]
    SeedOutOfBand {
        /// The seed.
        seed: [usize; 3],
        /// Its value.
        value: f64,
        /// The band's lower end.
        lower: f64,
        /// The band's upper end.
        upper: f64,
        /// The nearest voxel in the band.
        nearest: [usize; 3],
        /// How far away that is.
        distance_mm: f64,
    },
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Read { problem, .. } => problem.code(),
            Self::Param(error) => error.code(),
            Self::MethodNeeded { .. } => "E-VOLUME-METHOD",
            Self::Empty { .. } => "E-VOLUME-EMPTY",
            Self::SeedOutside { .. } => "E-VOLUME-SEED-OUTSIDE",
            Self::SeedOutOfBand { .. } => "E-VOLUME-SEED-BAND",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Read { problem, .. } => problem.class(),
            Self::Param(error) => error.class(),
            Self::MethodNeeded { .. } | Self::SeedOutside { .. } | Self::SeedOutOfBand { .. } => Class::Usage,
            Self::Empty { .. } => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Read { problem, .. } => problem.hint(),
            Self::Param(error) => error.hint(),
            Self::MethodNeeded { way_out, .. } => way_out.clone(),
            Self::Empty { .. } => "check the file, or choose another band or label".to_owned(),
            Self::SeedOutside { .. } => {
                "voxels count from 0 on the file's own axes; points are RAS+ mm".to_owned()
            }
            Self::SeedOutOfBand { nearest: [x, y, z], .. } => {
                format!("set seed_voxel = [{x}, {y}, {z}] if that is the organ, or widen the band")
            }
        }
    }
}
