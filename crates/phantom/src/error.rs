//! Why a phantom cannot be made.

use espalier_model::diagnose::{Class, ParamError};
use espalier_model::{Diagnose, GridError, TreeError};
use thiserror::Error;

/// Why a phantom cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter outside its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// The ground truth would have too many nodes.
    #[error("a phantom of {n_nodes} nodes exceeds the limit of {limit}")]
    TooManyNodes {
        /// The nodes asked for.
        n_nodes: usize,
        /// The limit.
        limit: usize,
    },
    /// The volume would have too many voxels.
    #[error("a volume of {:.0}x{:.0}x{:.0} voxels exceeds the limit of {limit}", .shape[0], .shape[1], .shape[2])]
    TooManyVoxels {
        /// The extents asked for; they may be beyond any integer.
        shape: [f64; 3],
        /// The limit.
        limit: usize,
    },
    /// The body and the grid are such that drawing would take hours.
    #[error(
        "drawing {n_cones} cones means {n_tests:.1e} tests of voxels, which exceeds the limit of {limit:.0e}"
    )]
    TooMuchWork {
        /// The cones of the body.
        n_cones: usize,
        /// The voxel tests they need.
        n_tests: f64,
        /// The limit.
        limit: f64,
    },
    /// The tree found no place to grow.
    #[error("the {kind} stopped at {n_grown} of {n_wanted} nodes: no free place left")]
    NoPlace {
        /// What was grown.
        kind: &'static str,
        /// The nodes that found a place.
        n_grown: usize,
        /// The nodes asked for.
        n_wanted: usize,
    },
    /// This kind has no volume.
    #[error("a {kind} phantom is a tree only: it has no mask and no CT")]
    TreeOnly {
        /// The kind.
        kind: &'static str,
    },
    /// The grid cannot be.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The shape is not a tree, such as one whose steps vanish in the rounding of positions.
    #[error("the ground truth is not a tree: {0}")]
    Tree(#[from] TreeError),
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Param(error) => error.code(),
            Self::TooManyNodes { .. } => "E-PHANTOM-NODES",
            Self::TooManyVoxels { .. } => "E-PHANTOM-VOXELS",
            Self::TooMuchWork { .. } => "E-PHANTOM-WORK",
            Self::NoPlace { .. } => "E-PHANTOM-NO-PLACE",
            Self::TreeOnly { .. } => "E-PHANTOM-TREE-ONLY",
            Self::Grid(error) => error.code(),
            Self::Tree(_) => "E-PHANTOM-TREE",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::TooManyNodes { .. } | Self::TooManyVoxels { .. } | Self::TooMuchWork { .. } => Class::Limit,
            _ => Class::Usage,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::TooManyNodes { .. } => "raise step_mm, or ask for a shorter body",
            Self::TooManyVoxels { .. } => "raise spacing_mm, or ask for a smaller body or margin",
            Self::TooMuchWork { .. } => "raise step_mm or spacing_mm, or lower the radius",
            Self::NoPlace { .. } => "ask for fewer nodes, or take another seed",
            Self::TreeOnly { .. } => {
                "use its tree, or draw the tree's mask with `rasterise` at a fine spacing"
            }
            Self::Tree(_) => "raise step_mm above the 0.0001 mm to which positions are rounded",
            Self::Param(_) | Self::Grid(_) => "",
        }
        .to_owned()
    }
}
