//! Why two trees cannot be held against each other.

use espalier_model::TreeError;
use espalier_model::diagnose::{Class, Diagnose, ParamError};
use thiserror::Error;

/// Why two trees cannot be held against each other.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter outside its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// More pairs of branches than the table of pairs may have.
    #[error("{n_baseline} branches against {n_followup} are over the limit of {limit} pairs")]
    TooManyPairs {
        /// Branches of the baseline.
        n_baseline: usize,
        /// Branches of the follow-up.
        n_followup: usize,
        /// How many pairs are allowed.
        limit: usize,
    },
    /// Coordinates so large that sums of squares of them are no numbers.
    #[error("a coordinate of {largest_mm:e} mm is over the limit of {limit_mm:e} mm")]
    TooFar {
        /// The largest coordinate.
        largest_mm: f64,
        /// How large it may be.
        limit_mm: f64,
    },
    /// The tree of both cannot be made.
    #[error("the tree that holds both cannot be made: {0}")]
    Tree(#[from] TreeError),
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Param(_) => "E-PARAM",
            Self::TooManyPairs { .. } => "E-JUXTAPOSE-PAIRS",
            Self::TooFar { .. } => "E-JUXTAPOSE-FAR",
            Self::Tree(_) => "E-JUXTAPOSE-TREE",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Param(_) => Class::Usage,
            Self::TooManyPairs { .. } => Class::Limit,
            Self::TooFar { .. } | Self::Tree(_) => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::TooManyPairs { .. } => {
                "prune both trees alike, such as by --set tree.prune_factor=3, or take the parts of interest"
            }
            Self::TooFar { .. } => "check the unit of both inputs",
            Self::Param(_) | Self::Tree(_) => "",
        }
        .to_owned()
    }
}
