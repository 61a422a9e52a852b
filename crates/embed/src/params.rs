//! The parameters of the stage: `[embed]` in the config.

use espalier_model::diagnose::ParamError;
use serde::{Deserialize, Serialize};

use crate::choices::{CrossingWeight, Freedom, Method, PoseMode, Pull, Start, TargetMode};

/// How a tree is laid flat.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Where target angles come from. Default `intrinsic`: the exact angles can always be drawn, so nothing is
    /// lost before the layout begins. `projected` is the paper's.
    pub targets: TargetMode,
    /// The method whose layout is used. `pso` gives way to any other layout that ran, is free of crossings and
    /// has a lower energy (by more than rounding); the constructive methods give way only if they have crossings. Default `pso`.
    pub method: Method,
    /// The methods that are run and compared, each one row of `compare.tsv`. `radial` and `cone` always run, here
    /// or not, for they cost next to nothing and one of them is the way out where `method` crosses; so does
    /// `method` itself. Default all.
    pub methods: Vec<Method>,
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
    /// Default 0.01, small enough to decide only between layouts of like angles; the paper has none (0).
    pub w_placement: f64,
    /// Price of one crossing: `"auto"` or a number > 0. Default `"auto"`, section 3.2.2 of the paper: 1.5 times
    /// the largest possible loss, so that one crossing costs more than any layout without. The 0.2 of section 5
    /// can leave crossings to the swarm; such a result is never used.
    pub w_crossing: CrossingWeight,
    /// Which ratios a particle chooses on its own. Default `n`; the paper's is `s`. More freedom finds layouts
    /// of lower energy, and takes longer to find them.
    pub freedom: Freedom,
    /// Particles of the swarm, 3 to 1,000,000. Default 512, a second or two for a bronchial tree; the paper has
    /// 40,960. More search wider.
    pub particles: u32,
    /// Iterations of the swarm, 0 to 1,000,000. Default 60; the paper has 100. More search deeper.
    pub iterations: u32,
    /// ω_g, the pull to the best of all particles, in [0, 2]. Default 0.9 inside the subtree chosen by `pull`;
    /// the paper has 0.05. Larger gathers the swarm sooner.
    pub omega_g: f64,
    /// ω_p, the pull to a particle's own best place, in [0, 2]. Default 0.9; the paper has 0.05. Larger searches
    /// nearer to what was found.
    pub omega_p: f64,
    /// ω_inert, the share of velocity and random velocity, in [0, 2]. Default and paper 0.0375. Larger steps
    /// wider.
    pub omega_inertia: f64,
    /// ω_0, ours: the pull to the targets themselves (all ratios zero) inside a random subtree, in [0, 1].
    /// Default 0.5; the paper has none (0). Larger untangles faster and fails more often.
    pub omega_target: f64,
    /// How a particle is drawn to the best places. Default `subtree`; the paper's is `uniform`.
    pub pull: Pull,
    /// Where the particles start. Default `relaxed`; the paper's is `paper`.
    pub start: Start,
    /// Memory that the swarm may take, in MiB, at least 1. Default 2048. The paper's swarm takes 24 bytes times
    /// particles times ratios.
    pub memory_mib: u64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            targets: TargetMode::Intrinsic,
            method: Method::Pso,
            methods: vec![Method::Projection, Method::Radial, Method::Cone, Method::Pso],
            pose: PoseMode::Auto,
            w_length: 2.0,
            w_angle: 2.0,
            w_placement: 0.01,
            w_crossing: CrossingWeight::Auto,
            freedom: Freedom::N,
            particles: 512,
            iterations: 60,
            omega_g: 0.9,
            omega_p: 0.9,
            omega_inertia: 0.0375,
            omega_target: 0.5,
            pull: Pull::Subtree,
            start: Start::Relaxed,
            memory_mib: 2048,
        }
    }
}

impl Params {
    /// The published values: sections 3.2.2 and 5 of [Hu2022]. The price of a crossing is that of section 3.2.2,
    /// because the 0.2 of section 5 can leave crossings.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            targets: TargetMode::Projected,
            w_placement: 0.0,
            freedom: Freedom::S,
            particles: 40_960,
            iterations: 100,
            omega_g: 0.05,
            omega_p: 0.05,
            omega_inertia: 0.0375,
            omega_target: 0.0,
            pull: Pull::Uniform,
            start: Start::Paper,
            ..Self::default()
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let weights =
            [("w_length", self.w_length), ("w_angle", self.w_angle), ("w_placement", self.w_placement)];
        for (key, weight) in weights {
            let is_legal = (0.0..=1e6).contains(&weight);
            ParamError::check(key, is_legal, format!("must be from 0 to 1e6, is {weight}"))?;
        }
        if let CrossingWeight::Fixed(weight) = self.w_crossing {
            let is_legal = weight > 0.0 && weight <= 1e12;
            ParamError::check(
                "w_crossing",
                is_legal,
                format!("must be \"auto\" or in (0, 1e12], is {weight}"),
            )?;
        }
        let omegas = [
            ("omega_g", self.omega_g, 2.0),
            ("omega_p", self.omega_p, 2.0),
            ("omega_inertia", self.omega_inertia, 2.0),
            ("omega_target", self.omega_target, 1.0),
        ];
        for (key, omega, largest) in omegas {
            let is_legal = (0.0..=largest).contains(&omega);
            ParamError::check(key, is_legal, format!("must be from 0 to {largest}, is {omega}"))?;
        }
        let Self { particles, iterations, memory_mib, .. } = *self;
        let is_legal = (3..=1_000_000).contains(&particles);
        ParamError::check("particles", is_legal, format!("must be from 3 to 1000000, is {particles}"))?;
        let is_legal = iterations <= 1_000_000;
        ParamError::check("iterations", is_legal, format!("must be at most 1000000, is {iterations}"))?;
        ParamError::check("memory_mib", memory_mib >= 1, "must be at least 1, is 0")
    }
}
