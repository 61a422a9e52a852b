//! The layout methods, one file each: from a frozen problem to positions.
//!
//! | file | method | crossings |
//! |---|---|---|
//! | `projection` | the best global view as it is | as many as there are |
//! | `radial` | equal angle per tip | none |
//! | `cone` | nested convex cones that keep sides | none, for any lengths |
//! | `marino` | radial, bent back towards one view: the baseline of [Marino2015] | none |
//! | `pso`, with `start`, `step` | the paper's particle swarm, Algorithm 1; a swarm around the solver's layout | none, or the incumbent wins |

pub(crate) mod cone;
pub(crate) mod marino;
pub(crate) mod projection;
pub(crate) mod pso;
pub(crate) mod radial;
pub(crate) mod start;
mod step;

use espalier_model::{Termination, TracePoint};
use glam::DVec2;

/// A layout as a method leaves it, before pose and rounding.
pub(crate) struct Layout {
    /// The method's name, with its size where that matters.
    pub(crate) name: String,
    /// Plane mm, any rigid motion.
    pub(crate) positions: Vec<DVec2>,
    /// Evaluations of the energy that it took.
    pub(crate) evaluations: u64,
    /// The convergence curve; empty for constructive methods.
    pub(crate) trace: Vec<TracePoint>,
    /// Why the method ended, were its layout to win.
    pub(crate) termination: Termination,
    /// Which targets it was made for, and is scored against.
    pub(crate) aim: Aim,
}

/// The targets that a layout was made for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Aim {
    /// Those that are frozen for the run.
    #[default]
    Frozen,
    /// Those of the local planes, before sides were searched: a row beside the others, never the result.
    Unflipped,
}

impl Layout {
    /// The layout of a method that does not search.
    pub(crate) fn constructed(name: &str, positions: Vec<DVec2>) -> Self {
        Self {
            name: name.to_owned(),
            positions,
            evaluations: 0,
            trace: Vec::new(),
            termination: Termination::Constructed,
            aim: Aim::Frozen,
        }
    }

    /// The same after a search before it that is part of its method.
    pub(crate) fn after(mut self, evaluations: u64) -> Self {
        self.evaluations += evaluations;
        self.trace.iter_mut().for_each(|point| point.evaluations += evaluations);
        self
    }
}
