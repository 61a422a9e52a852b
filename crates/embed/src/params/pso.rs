//! The parameters of the swarm: `[embed.pso]` in the config.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::choices::{Freedom, Pull, Start};

/// More nodes than any tree has.
const ANY_SIZE: u32 = 1_000_000_000;
/// The least particles to which a large tree brings the swarm.
const LEAST_PARTICLES: u32 = 16;

/// The paper's particle swarm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PsoParams {
    /// Which ratios a particle chooses on its own. Default `n`; the paper's is `s`. More freedom finds layouts
    /// of lower energy, and takes longer to find them.
    pub freedom: Freedom,
    /// Particles of the swarm, 3 to 1,000,000. Default 512, a second or two for a bronchial tree; the paper has
    /// 40,960. More search wider.
    pub particles: u32,
    /// Iterations of the swarm, 0 to 1,000,000. Default 60; the paper has 100. More search deeper.
    pub iterations: u32,
    /// Up to this many nodes the swarm has its full size, 1 to 1,000,000,000; on larger trees it has fewer particles,
    /// as many as make particles × nodes the same. Default 300, so that it takes no longer than on a tree of 300
    /// nodes; the row states how many there were. The paper has one size for all.
    pub full_size_nodes: u32,
    /// Above this many nodes the swarm runs only if it is the `method`, 1 to 1,000,000,000. Default 5000; the paper's
    /// largest tree has fewer.
    pub max_nodes: u32,
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

impl Default for PsoParams {
    fn default() -> Self {
        Self {
            freedom: Freedom::N,
            particles: 512,
            iterations: 60,
            full_size_nodes: 300,
            max_nodes: 5000,
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

impl PsoParams {
    /// The published values: section 5 of [Hu2022].
    #[must_use]
    pub fn paper() -> Self {
        Self {
            freedom: Freedom::S,
            particles: 40_960,
            iterations: 100,
            full_size_nodes: ANY_SIZE,
            max_nodes: ANY_SIZE,
            omega_g: 0.05,
            omega_p: 0.05,
            omega_inertia: 0.0375,
            omega_target: 0.0,
            pull: Pull::Uniform,
            start: Start::Paper,
            ..Self::default()
        }
    }

    /// The particles on a tree of so many nodes.
    #[must_use]
    pub fn particles_for(&self, n_nodes: usize) -> u32 {
        let work = u64::from(self.particles) * u64::from(self.full_size_nodes);
        let most = (work / (n_nodes.max(1) as u64)).max(u64::from(LEAST_PARTICLES));
        u32::try_from(most).unwrap_or(u32::MAX).min(self.particles)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let omegas = [
            ("pso.omega_g", self.omega_g, 2.0),
            ("pso.omega_p", self.omega_p, 2.0),
            ("pso.omega_inertia", self.omega_inertia, 2.0),
            ("pso.omega_target", self.omega_target, 1.0),
        ];
        for (key, omega, largest) in omegas {
            let is_legal = (0.0..=largest).contains(&omega);
            ParamError::check(key, is_legal, format!("must be from 0 to {largest}, is {omega}"))?;
        }
        let Self { particles, iterations, memory_mib, .. } = *self;
        let is_legal = (3..=1_000_000).contains(&particles);
        ParamError::check("pso.particles", is_legal, format!("must be from 3 to 1000000, is {particles}"))?;
        let is_legal = iterations <= 1_000_000;
        ParamError::check("pso.iterations", is_legal, format!("must be at most 1000000, is {iterations}"))?;
        for (key, n_nodes) in
            [("pso.full_size_nodes", self.full_size_nodes), ("pso.max_nodes", self.max_nodes)]
        {
            let is_legal = (1..=ANY_SIZE).contains(&n_nodes);
            ParamError::check(key, is_legal, format!("must be from 1 to {ANY_SIZE}, is {n_nodes}"))?;
        }
        ParamError::check("pso.memory_mib", memory_mib >= 1, "must be at least 1, is 0")
    }
}
