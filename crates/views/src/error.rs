//! Why a tree gets no views.

use espalier_model::Diagnose;
use espalier_model::diagnose::{Class, ParamError};
use thiserror::Error;

/// Why a tree gets no views.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter outside its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// Coordinates whose squares leave the range of the numbers.
    #[error("node {node} lies {distance_mm:e} mm from the origin, more than the {limit_mm:e} mm allowed")]
    TooFar {
        /// The node.
        node: usize,
        /// The largest of its coordinates without its sign, in mm.
        distance_mm: f64,
        /// The largest coordinate allowed, in mm.
        limit_mm: f64,
    },
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Param(error) => error.code(),
            Self::TooFar { .. } => "E-VIEWS-TOO-FAR",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Param(error) => error.class(),
            Self::TooFar { .. } => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Param(error) => error.hint(),
            Self::TooFar { .. } => "check the unit and the scale of the input".to_owned(),
        }
    }
}
