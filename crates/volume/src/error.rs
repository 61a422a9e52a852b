//! Why a volume cannot be read, or has no mask.

use std::path::{Path, PathBuf};

use espalier_model::diagnose::{Class, ParamError};
use espalier_model::{Diagnose, GridError};
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
    /// A label's name is none that is known.
    #[error("no label is called {name}; the nearest names are {nearest}; the volume holds {holds}")]
    UnknownLabel {
        /// The name.
        name: String,
        /// Known names like it.
        nearest: String,
        /// The volume's values.
        holds: String,
    },
    /// A label's name is none of the user's own.
    #[error("none of the {n_names} names is {name}; the nearest are {nearest}")]
    NotNamed {
        /// The name.
        name: String,
        /// How many names there are.
        n_names: usize,
        /// Those that are nearest.
        nearest: String,
    },
    /// A label's name is known, but the volume has no such value, or others that the task has not.
    #[error(
        "the label {name} is {value} in TotalSegmentator's task {task}, but the volume is none of it: it holds {holds}"
    )]
    AbsentLabel {
        /// The name.
        name: String,
        /// Its number.
        value: f64,
        /// The task that has it.
        task: &'static str,
        /// The volume's values.
        holds: String,
    },
    /// A map of regions that holds no labels.
    #[error("this is no label map: it holds {}, from {min} to {max}", if *.n_values > 0 { format!("{n_values} different values or more") } else { "values that are not whole".to_owned() })]
    NotRegions {
        /// How many different values there are at least; 0 where some are not whole.
        n_values: usize,
        /// The smallest finite value.
        min: f64,
        /// The largest finite value.
        max: f64,
    },
    /// A label by name, of a volume that is no label map.
    #[error("the volume is no label map: it holds values from {min} to {max}, none of which can be {label}")]
    NoLabelMap {
        /// The label.
        label: String,
        /// The smallest finite value.
        min: f64,
        /// The largest finite value.
        max: f64,
    },
    /// No seed is given and no trachea is found.
    #[error(
        "no trachea found: no stack of round, walled air in the axial slices; the volume's values go from {min} to {max}"
    )]
    NoTrachea {
        /// The smallest finite value; NaN if there is none.
        min: f64,
        /// The largest finite value; NaN if there is none.
        max: f64,
    },
    /// A closing by more voxels than a gap of a mask has.
    #[error(
        "a ball of {radius_mm} mm reaches over {n_voxels:.0} voxels, which is more than any gap of a mask"
    )]
    Closing {
        /// The radius asked for.
        radius_mm: f64,
        /// How many voxels it reaches along the axis with the smallest spacing.
        n_voxels: f64,
        /// The largest radius that is taken, in mm.
        largest_mm: f64,
    },
    /// A spacing at which the volume has no legal grid.
    #[error("the volume cannot be resampled: {0}")]
    Grid(espalier_model::GridError),
    /// A step that needs more memory than allowed.
    #[error("{what} needs {needed} bytes of memory, allowed are {limit}")]
    TooLarge {
        /// The step.
        what: &'static str,
        /// How many bytes are needed.
        needed: u64,
        /// How many are allowed.
        limit: u64,
    },
    /// The mask's place in the world is beyond the largest number.
    #[error("the volume cannot be turned to right, anterior, superior: {0}")]
    Turn(#[from] GridError),
    /// The region grows with the threshold all the way.
    #[error("the region about the seed grows all the way with the threshold, so where it leaks cannot be told: {}", .curve.map(|(threshold, ml)| format!("{ml:.1} ml at {threshold}")).join(", "))]
    NoKnee {
        /// Threshold and volume in ml at five levels.
        curve: [(f64, f64); 5],
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
            Self::UnknownLabel { .. } | Self::NotNamed { .. } => "E-VOLUME-LABEL-UNKNOWN",
            Self::AbsentLabel { .. } => "E-VOLUME-LABEL-ABSENT",
            Self::NoLabelMap { .. } | Self::NotRegions { .. } => "E-VOLUME-NO-LABELS",
            Self::NoTrachea { .. } => "E-VOLUME-NO-TRACHEA",
            Self::Turn(error) => error.code(),
            Self::NoKnee { .. } => "E-VOLUME-NO-KNEE",
            Self::Closing { .. } => "E-VOLUME-CLOSING",
            Self::Grid(_) => "E-VOLUME-RESAMPLE",
            Self::TooLarge { .. } => "E-VOLUME-TOO-LARGE",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Read { problem, .. } => problem.class(),
            Self::Param(error) => error.class(),
            Self::MethodNeeded { .. }
            | Self::UnknownLabel { .. }
            | Self::NotNamed { .. }
            | Self::SeedOutside { .. }
            | Self::SeedOutOfBand { .. }
            | Self::Closing { .. }
            | Self::Grid(_) => Class::Usage,
            Self::TooLarge { .. } => Class::Limit,
            Self::AbsentLabel { .. } | Self::NoLabelMap { .. } | Self::NotRegions { .. } => Class::Input,
            Self::Turn(error) => error.class(),
            Self::Empty { .. } | Self::NoTrachea { .. } | Self::NoKnee { .. } => Class::Input,
        }
    }

    fn file(&self) -> Option<&Path> {
        match self {
            Self::Read { problem: ReadError::Detached { path, .. }, .. } | Self::Read { path, .. } => {
                Some(path)
            }
            _ => None,
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
            Self::UnknownLabel { .. } | Self::AbsentLabel { .. } => {
                "set volume.label to one of the values, which always works, or input.labels to a file with your names"
                    .to_owned()
            }
            Self::NotNamed { .. } => "set volume.label to one of these names, or to a value".to_owned(),
            Self::NoLabelMap { .. } => "set volume.preset or volume.method for a scan".to_owned(),
            Self::NotRegions { .. } => {
                "give a label map: whole numbers, one for each region, 0 outside of all".to_owned()
            }
            Self::NoTrachea { min, .. } if *min > -500.0 => {
                "nothing is as dark as air: the values are no HU (the intercept of the scan may be missing), or the scan \
                 shows no lung; set volume.seed_voxel and volume.upper"
                    .to_owned()
            }
            Self::NoTrachea { .. } => {
                "set volume.seed_voxel = [x, y, z] (or volume.seed_mm, RAS+) to a voxel inside the trachea".to_owned()
            }
            Self::Turn(_) => "move the volume nearer to the origin, or set volume.orientation = \"stored\"".to_owned(),
            Self::NoKnee { .. } => {
                "set volume.upper (airways) or volume.lower (vessels), or another volume.seed_voxel".to_owned()
            }
            Self::Closing { largest_mm, .. } => {
                format!("set volume.closing_mm to {largest_mm:.3} or less, or input.unit if the unit is wrong")
            }
            Self::Grid(_) => "set volume.resample_mm to a spacing nearer to the volume's own".to_owned(),
            Self::TooLarge { .. } => {
                "allow more with --max-memory, or set volume.closing_mm or volume.resample_mm otherwise".to_owned()
            }
            Self::SeedOutOfBand { nearest: [x, y, z], .. } => {
                format!("set seed_voxel = [{x}, {y}, {z}] if that is the organ, or widen the band")
            }
        }
    }
}

/// Refuses a step that needs more memory than allowed.
pub(crate) fn check_memory(what: &'static str, needed: u64, limit: u64) -> Result<(), Error> {
    if needed > limit { Err(Error::TooLarge { what, needed, limit }) } else { Ok(()) }
}
