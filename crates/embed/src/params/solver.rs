//! The parameters of the solver: `[embed.solver]` in the config.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::choices::KeepOut;

/// Our optimiser, part by part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SolverParams {
    /// Whether the sides of turns are searched first (exact lengths and angles stay). Default true; it chooses
    /// the targets of every method of the run.
    pub mirrors: bool,
    /// Whether untangling from the tips to the root is a second start beside the cone. Default true.
    pub untangling: bool,
    /// Whether ratios are improved one path at a time. Default true.
    pub descent: bool,
    /// Whether all ratios are improved at once under a barrier. Default true.
    pub barrier: bool,
    /// Scales the work that each part may take, 0.01 to 1000. Default 1. Larger searches longer; work is counted,
    /// so the result does not depend on the machine.
    pub effort: f64,
    /// How near edges may come that are not neighbours, as a share of the median edge length, 0 to 10. Default
    /// 0.05. Never more than a fifth of the path between them.
    pub clearance: f64,
    /// Whether branches are kept from curling back beside the root's branch, as the exact bends of a bronchial tree
    /// would make them do: the search for sides prices what enters the third of the plane behind the root. Default
    /// `auto`: where the tree has a trunk, since a tree that leaves its root in all directions has no behind, and
    /// only when something crosses; `on` searches for this alone too.
    pub root_keep_out: KeepOut,
}

impl Default for SolverParams {
    fn default() -> Self {
        Self {
            mirrors: true,
            untangling: true,
            descent: true,
            barrier: true,
            effort: 1.0,
            clearance: 0.05,
            root_keep_out: KeepOut::Auto,
        }
    }
}

impl SolverParams {
    /// Checks every range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let Self { effort, clearance, .. } = *self;
        let is_legal = (0.01..=1000.0).contains(&effort);
        ParamError::check("solver.effort", is_legal, format!("must be from 0.01 to 1000, is {effort}"))?;
        let is_legal = (0.0..=10.0).contains(&clearance);
        ParamError::check("solver.clearance", is_legal, format!("must be from 0 to 10, is {clearance}"))
    }
}
