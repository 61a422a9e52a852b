//! The parameters of the stage: `[embed]` in the config.

mod marino;
mod pso;
mod solver;
mod weights;
mod widths;

use std::borrow::Cow;

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use marino::MarinoParams;
pub use pso::PsoParams;
pub use solver::SolverParams;
pub use weights::WeightRule;
pub use widths::WidthsParams;

use crate::choices::{CrossingWeight, Method, PoseMode, SwarmUse, TargetMode};

/// How a tree is laid flat.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Where target angles come from. Default `intrinsic`: the exact angles can always be drawn, so nothing is
    /// lost before the layout begins. `projected` is the paper's.
    pub targets: TargetMode,
    /// The method whose layout is used. The optimisers, `solver` and `pso`, give way to any other layout that ran,
    /// is free of crossings and has a lower energy (by more than rounding); the others give way only if they have
    /// crossings. Default `solver`.
    pub method: Method,
    /// The methods that are run and compared, each one row of `compare.tsv`. `radial` and `cone` always run, here
    /// or not, for they cost next to nothing and one of them is the way out where `method` crosses; so does
    /// `method` itself. Default all.
    pub methods: Vec<Method>,
    /// What a swarm of the size of `[embed.pso]` does after the solver: `polish` searches around its layout, with all
    /// layouts of the run as particles, and is a row of its own. Default `none`: after the search of sides all of seven
    /// trees of 135 to 300 nodes had nothing left to polish, and 828 nodes gained 0.3 %. Without that search five small
    /// ones gained 0.3 to 7 % in 0.2 s, two of 1,000 nodes 0.1 to 0.2 %; 2,048 particles × 200 iterations gained no more.
    /// The swarm knows crossings but not the solver's clearance: branches may come nearer to each other.
    pub swarm: SwarmUse,
    /// How the whole is turned in the end; no energy or loss depends on it. Default `auto`: `view` for a
    /// scan, which keeps cranial up and the patient's right on the viewer's left; `root-on-top` for a traced tree,
    /// which has no such sides.
    pub pose: PoseMode,
    /// Weight w_l of the length ratios in the energy, ≥ 0. Default 2, the paper's. Larger keeps lengths and
    /// bends more.
    pub w_length: f64,
    /// Weight w_a of the angle ratios, ≥ 0. Default 2, the paper's. Larger keeps angles and stretches more.
    pub w_angle: f64,
    /// Weight w_g of the relative placement, ≥ 0: how much an edge should point as it does in the global view.
    /// Default 0.01. Up to that it decides between layouts of like angles and no more: one that meets all targets is
    /// final. Above, headings count like any loss, and exact lengths and angles give way where that is less in all. The
    /// paper has none (0).
    pub w_placement: f64,
    /// Weight w_s of the side of a turn, ≥ 0: what it costs that a bend goes to the other side of its target,
    /// beside its angle ratio: per branch, w_s times the mean of 2/π · min(a, π − a, b, π − b) over such bends, a of
    /// the target, b as drawn. The search for sides (`solver.mirrors`), where a crossing costs 1, adds it to the
    /// price of a radian that changes sides inside a branch against the local view. Default 0, the paper's: a mirror
    /// image is as true as what it mirrors. Larger keeps arcs arcs, at the cost of other losses.
    pub w_side: f64,
    /// Price of one crossing: `"auto"` or a number > 0. Default `"auto"`, section 3.2.2 of the paper: 1.5 times
    /// the largest possible loss, so that one crossing costs more than any layout without. The 0.2 of section 5
    /// can leave crossings to the swarm; such a result is never used.
    pub w_crossing: CrossingWeight,
    /// A file of manual edits, `edits.json`, relative to the config's folder: branches that are turned by hand in the
    /// layout that the run would give without them, and pinned. Default none; `""` says none too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edits: Option<String>,
    /// `[[embed.weights]]`: other weights for parts of the tree, by generation, depth, branch or node; of rules
    /// that meet the later one wins. Default none.
    pub weights: Vec<WeightRule>,
    /// `[embed.solver]`: our optimiser.
    pub solver: SolverParams,
    /// `[embed.pso]`: the paper's particle swarm.
    pub pso: PsoParams,
    /// `[embed.marino]`: the baseline of one view.
    pub marino: MarinoParams,
    /// `[embed.widths]`: what is done about tubes that overlap.
    pub widths: WidthsParams,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            targets: TargetMode::Intrinsic,
            method: Method::Solver,
            methods: vec![
                Method::Projection,
                Method::Radial,
                Method::Cone,
                Method::Marino,
                Method::Pso,
                Method::Solver,
            ],
            swarm: SwarmUse::None,
            pose: PoseMode::Auto,
            w_length: 2.0,
            w_angle: 2.0,
            w_placement: 0.01,
            w_side: 0.0,
            w_crossing: CrossingWeight::Auto,
            edits: None,
            weights: Vec::new(),
            solver: SolverParams::default(),
            pso: PsoParams::default(),
            marino: MarinoParams::default(),
            widths: WidthsParams::default(),
        }
    }
}

impl Params {
    /// The published values: sections 3.2.2 and 5 of [Hu2022]. The price of a crossing is that of section 3.2.2,
    /// because the 0.2 of section 5 can leave crossings. No sides are searched, and our solver does not run.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            targets: TargetMode::Projected,
            w_placement: 0.0,
            method: Method::Pso,
            methods: vec![Method::Projection, Method::Radial, Method::Marino, Method::Pso],
            // The paper takes the sides that its local planes show.
            solver: SolverParams { mirrors: false, ..SolverParams::default() },
            pso: PsoParams::paper(),
            ..Self::default()
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        for (key, weight) in [
            ("w_length", self.w_length),
            ("w_angle", self.w_angle),
            ("w_placement", self.w_placement),
            ("w_side", self.w_side),
        ] {
            check_weight(key, weight)?;
        }
        if let CrossingWeight::Fixed(weight) = self.w_crossing {
            let is_legal = weight > 0.0 && weight <= 1e12;
            ParamError::check(
                "w_crossing",
                is_legal,
                format!("must be \"auto\" or in (0, 1e12], is {weight}"),
            )?;
        }
        self.weights.iter().enumerate().try_for_each(|(idx, rule)| rule.validate(idx))?;
        self.solver.validate()?;
        self.pso.validate()?;
        self.marino.validate()
    }
}

/// Checks one weight of the energy.
fn check_weight(key: impl Into<Cow<'static, str>>, weight: f64) -> Result<(), ParamError> {
    ParamError::check(key, (0.0..=1e6).contains(&weight), format!("must be from 0 to 1e6, is {weight}"))
}
