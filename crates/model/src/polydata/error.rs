//! Why a VTK file cannot be read.

use thiserror::Error;

use crate::MAX_MM;
use crate::diagnose::{Class, Diagnose};

/// Why a VTK file cannot be read.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PolydataError {
    /// No legal XML.
    #[error("not legal XML: {cause}")]
    Xml {
        /// What the parser says, with the place.
        cause: String,
    },
    /// A VTK file of another kind, or written in another way.
    #[error("{what} cannot be read: {found:?}")]
    Unknown {
        /// What it is.
        what: &'static str,
        /// What stands there.
        found: String,
    },
    /// Something that must be there is not.
    #[error("there is no {what}")]
    Missing {
        /// What.
        what: &'static str,
    },
    /// A number or word that is none.
    #[error("{what} is {found:?}")]
    Word {
        /// What it should be.
        what: &'static str,
        /// What stands there.
        found: String,
    },
    /// Another number of values than declared.
    #[error("{what:.40} has {found} values, expected {expected}")]
    Count {
        /// Of what.
        what: String,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The encoded bytes of an array are damaged.
    #[error("the bytes of {array} are damaged: {cause}")]
    Bytes {
        /// The array's name.
        array: String,
        /// What is wrong.
        cause: &'static str,
    },
    /// A point or radius that is not finite, or beyond what is allowed.
    #[error("point {index} or its radius is not finite, or beyond {MAX_MM:e} mm")]
    Point {
        /// Its index, from 0.
        index: usize,
    },
    /// A line through a point that is not there.
    #[error("line {line} goes through point {point} of {n_points}, both counted from 0")]
    MissingPoint {
        /// The line's index.
        line: usize,
        /// The point's index.
        point: usize,
        /// How many points there are.
        n_points: usize,
    },
    /// Points or a surface, but no lines.
    #[error("the file holds no lines of two or more points, but {n_other_cells} other cells")]
    NoLines {
        /// How many.
        n_other_cells: usize,
    },
    /// More numbers than memory allows.
    #[error("its points, lines and arrays need more than the {limit} bytes of memory that are allowed")]
    TooLarge {
        /// How many are allowed.
        limit: u64,
    },
    /// The space is not named.
    #[error("the file does not say whether its coordinates are RAS or LPS, which differ by half a turn")]
    NoSpace,
}

impl Diagnose for PolydataError {
    fn code(&self) -> &'static str {
        match self {
            Self::Xml { .. } => "E-POLYDATA-XML",
            Self::Unknown { .. } => "E-POLYDATA-UNKNOWN",
            Self::Missing { .. } => "E-POLYDATA-MISSING",
            Self::Word { .. } => "E-POLYDATA-WORD",
            Self::Count { .. } => "E-POLYDATA-COUNT",
            Self::Bytes { .. } => "E-POLYDATA-BYTES",
            Self::Point { .. } => "E-POLYDATA-POINT",
            Self::MissingPoint { .. } => "E-POLYDATA-MISSING-POINT",
            Self::NoLines { .. } => "E-POLYDATA-NO-LINES",
            Self::TooLarge { .. } => "E-POLYDATA-TOO-LARGE",
            Self::NoSpace => "E-POLYDATA-NO-SPACE",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::TooLarge { .. } => Class::Limit,
            _ => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Unknown { .. } => "write the lines as PolyData, .vtp or legacy .vtk, without compression or with zlib",
            Self::Point { .. } => "check the numbers, and the unit that the file is read in",
            Self::TooLarge { .. } => "allow more with `--max-memory`, if the file is what it should be",
            Self::NoLines { .. } => "give centrelines, not the surface; VMTK makes them with vmtkcenterlines",
            Self::NoSpace => {
                "say which: `--set input.assume_space=ras`, or lps, or `assume_space` under [input]; VTK files of ITK \
                 and 3D Slicer are mostly LPS, VMTK keeps the space of the image it was given"
            }
            _ => "write the file again with the program that made it",
        }
        .to_owned()
    }
}
