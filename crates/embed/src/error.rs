//! Why a tree cannot be laid flat.

use espalier_model::Diagnose;
use espalier_model::diagnose::{Class, ParamError};
use thiserror::Error;

/// Why a tree cannot be laid flat.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter outside its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// The views were made for another tree, by its digest.
    #[error("the views were made for another tree")]
    OtherTree,
    /// The views are not complete.
    #[error("the views do not fit the tree: {n_found} {what}, expected {n_expected}")]
    Views {
        /// What was counted: planes of branches or of forks.
        what: &'static str,
        /// How many the views have.
        n_found: usize,
        /// How many the tree needs.
        n_expected: usize,
    },
    /// A tree so small or so large that coordinates would leave the range of exact arithmetic.
    #[error("the tree is {length_mm:e} mm long; only lengths from 1e-60 to 1e60 mm can be laid flat")]
    Scale {
        /// The sum of all edge lengths, in mm.
        length_mm: f64,
    },
    /// A swarm that needs more memory than it may have.
    #[error(
        "a swarm of {particles} particles with {dims} ratios each needs {needed_mib} MiB, allowed are {limit_mib} MiB"
    )]
    Memory {
        /// The particles.
        particles: u32,
        /// The ratios of one particle.
        dims: usize,
        /// What they need, in MiB.
        needed_mib: u64,
        /// What is allowed, in MiB.
        limit_mib: u64,
    },
    /// No layout passed the exact check of its rounded coordinates.
    #[error(
        "no layout is free of crossings: the best has {crossings}, the first between edges {first} and {second}"
    )]
    Uncertified {
        /// The crossings of the layout with the fewest.
        crossings: usize,
        /// An edge of its first crossing, by its lower node.
        first: usize,
        /// The other edge of it.
        second: usize,
    },
    /// The result is worse than another layout of the same run, which must never be.
    #[error("the layout by {method} has the energy {energy}, that by {other} {least}")]
    Worse {
        /// The method of the result.
        method: String,
        /// Its energy.
        energy: f64,
        /// The method of the better layout.
        other: String,
        /// The energy of that.
        least: f64,
    },
    /// Manual edits that leave crossings.
    #[error(
        "with {} pinned {} crossings are left, the first between edges {first} and {second}{}",
        edit_names(holding), crossings,
        if *can_move { "" } else { ", which nothing that is free can part" }
    )]
    Edits {
        /// The edits between the edges that cross, from 0.
        holding: Vec<usize>,
        /// The crossings left.
        crossings: usize,
        /// An edge of the first, by its lower node.
        first: usize,
        /// The other edge of it.
        second: usize,
        /// Whether between every two edges that cross something may move; if not, no layout with these pins is free
        /// of crossings.
        can_move: bool,
    },
    /// An edit that lays a branch back onto the edge that it comes from.
    #[error(
        "edits[{edit}] leaves {gap_deg:.2e}° between branch {branch} and the edge that it comes from; \
         the least is {least_deg}°"
    )]
    Fold {
        /// The edit, from 0.
        edit: usize,
        /// Its branch.
        branch: usize,
        /// The angle left, in degrees.
        gap_deg: f64,
        /// The least angle, in degrees.
        least_deg: f64,
    },
    /// Edits for another tree, by its digest.
    #[error("the edits were made for another tree")]
    EditsOfOtherTree,
}

/// `edits[0], edits[2] and edits[3]`.
fn edit_names(edits: &[usize]) -> String {
    let names: Vec<String> = edits.iter().map(|idx| format!("edits[{idx}]")).collect();
    match names.split_last() {
        Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
        _ => names.concat(),
    }
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Param(error) => error.code(),
            Self::OtherTree | Self::Views { .. } => "E-EMBED-VIEWS",
            Self::Scale { .. } => "E-EMBED-SCALE",
            Self::Memory { .. } => "E-EMBED-MEMORY",
            Self::Uncertified { .. } => "E-EMBED-UNCERTIFIED",
            Self::Edits { .. } => "E-EMBED-EDITS",
            Self::Fold { .. } => "E-EMBED-EDIT-FOLD",
            Self::EditsOfOtherTree => "E-EMBED-EDITS-TREE",
            Self::Worse { .. } => "E-EMBED-WORSE",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Param(error) => error.class(),
            Self::OtherTree
            | Self::Views { .. }
            | Self::Scale { .. }
            | Self::Fold { .. }
            | Self::EditsOfOtherTree => Class::Input,
            Self::Memory { .. } => Class::Limit,
            Self::Uncertified { .. } | Self::Edits { .. } => Class::Uncertified,
            Self::Worse { .. } => Class::Internal,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Param(error) => error.hint(),
            Self::OtherTree | Self::Views { .. } => "run the views stage again on this very tree".to_owned(),
            Self::Scale { .. } => "check the unit of the input".to_owned(),
            Self::Memory { .. } => {
                "lower `particles`, choose `freedom = \"s\"` or raise `memory_mib`".to_owned()
            }
            Self::Edits { can_move: true, .. } => {
                "turn these branches less, or raise solver.effort for a longer search".to_owned()
            }
            Self::Edits { .. } => "turn one of these branches by another angle".to_owned(),
            Self::Fold { .. } => "turn the branch a little less, or a little more".to_owned(),
            Self::EditsOfOtherTree => {
                "make them anew: numbers of branches and nodes are of one tree only".to_owned()
            }
            Self::Uncertified { .. } => {
                "edge lengths that span more than ten decades cannot be told apart in twelve digits: merge \
                 the shortest edges (tree resampling)"
                    .to_owned()
            }
            Self::Worse { .. } => "please report this with the tree".to_owned(),
        }
    }
}
