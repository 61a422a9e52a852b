//! Parameters of the views.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the loss of a view is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// The Kullback–Leibler distance between the shares of length in the view and in space: Eq. 1 of [Hu2022].
    /// It does not see a foreshortening that is the same for all edges.
    Kl,
    /// Its unnormalised form, Σ share · (s ln s − s + 1), s = projected length / length: sees any foreshortening.
    #[default]
    Ukl,
}

/// How the best direction is searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Search {
    /// Directions on a Fibonacci spiral over the half sphere, the best refined by a pattern search.
    #[default]
    Fibonacci,
    /// A particle swarm on the sphere, the way of [Hu2022].
    Pso,
}

/// Which of its two sides each local plane shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mirror {
    /// The side that keeps the headings of the laid-out tree nearest to the global view's.
    #[default]
    ClosedLoop,
    /// The side that faces the camera of the global view.
    Global,
    /// The side that faces the same way as the plane above.
    Parent,
}

/// Parameters of the views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// The view metric. Default `"ukl"`: its planes shift less under noise (3.6° against 4.1° for 2 % of edge length
    /// on a neuron of 4332 nodes) and show the angles as well; `"kl"` is the paper's.
    pub metric: Metric,
    /// The search. Default `"fibonacci"`: the swarm's optimum with some 70 times fewer evaluations.
    pub search: Search,
    /// Directions on the half sphere that `"fibonacci"` tries first; 8 to 100 000. Default 100. More find a
    /// narrower optimum, at a cost in proportion.
    pub directions: u32,
    /// How many of the best directions are refined; 1 to 100. Default 2, which have to lie apart. More guard
    /// against a local optimum.
    pub refine_starts: u32,
    /// The step at which the refinement stops, radians; 1e-9 to 0.5. Default 1e-4, some 0.006°: the loss is flat
    /// to rounding below. Larger stops earlier.
    pub refine_step_rad: f64,
    /// The swarm of `"pso"`; 2 to 1 000 000 particles. Default 256 [Hu2022]. More search wider.
    pub particles: u32,
    /// The iterations of `"pso"`; 1 to 1 000 000. Default 100 [Hu2022]. More search longer.
    pub iterations: u32,
    /// ω_g of Eq. 5 of [Hu2022], the pull to the best particle; 0 to 2. Default 0.05. Larger contracts sooner.
    pub omega_global: f64,
    /// ω_p of Eq. 5 of [Hu2022], the pull to a particle's own best; 0 to 2. Default 0.05. Larger lingers.
    pub omega_personal: f64,
    /// ω_inert of Eq. 5 of [Hu2022], of velocity and of its noise; 0 to 2. Default 0.0375. Larger roams.
    pub omega_inertia: f64,
    /// To how many siblings before and after it, in a ring, imaginary edges join a node, and likewise to its
    /// parent's siblings; 1 to 1000. Default 8: all of them at forks of up to 17 children, and a bounded cost
    /// at forks of hundreds. Larger joins more at such forks.
    pub max_siblings: u32,
    /// Levels of subtree views below the whole tree; 0 to 1000. Default 8. Each level costs at most as much as
    /// the whole tree does, so a comb of N teeth costs 8 · N and not N².
    pub max_levels: u32,
    /// The rule for the mirrors of the local planes. Default `"closed-loop"`: keeps parts of the tree where the
    /// global view has them; [Hu2022] leaves it open.
    pub mirror: Mirror,
    /// β of [Hu2022] section 3.1.2: the camera's distance from the centre in expansion radii; 1 to 1000. Default
    /// 1.5. Only for looking in perspective, and recorded for that; the views are orthographic.
    pub beta: f64,
    /// The direction towards the camera of the global view, RAS+, any positive length; none by default, then it
    /// is searched.
    pub fixed_view: Option<[f64; 3]>,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            metric: Metric::Ukl,
            search: Search::Fibonacci,
            directions: 100,
            refine_starts: 2,
            refine_step_rad: 1e-4,
            particles: 256,
            iterations: 100,
            omega_global: 0.05,
            omega_personal: 0.05,
            omega_inertia: 0.0375,
            max_siblings: 8,
            max_levels: 8,
            mirror: Mirror::ClosedLoop,
            beta: 1.5,
            fixed_view: None,
        }
    }
}

impl Params {
    /// The published values: Eq. 1 searched by a swarm, all siblings joined. The mirror, of which the paper says
    /// nothing, faces the global view's camera.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            metric: Metric::Kl,
            search: Search::Pso,
            max_siblings: 1000,
            mirror: Mirror::Global,
            ..Self::default()
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`ParamError`] naming the first key outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        whole("directions", self.directions, 8, 100_000)?;
        whole("refine_starts", self.refine_starts, 1, 100)?;
        real("refine_step_rad", self.refine_step_rad, 1e-9, 0.5)?;
        whole("particles", self.particles, 2, 1_000_000)?;
        whole("iterations", self.iterations, 1, 1_000_000)?;
        real("omega_global", self.omega_global, 0.0, 2.0)?;
        real("omega_personal", self.omega_personal, 0.0, 2.0)?;
        real("omega_inertia", self.omega_inertia, 0.0, 2.0)?;
        whole("max_siblings", self.max_siblings, 1, 1000)?;
        whole("max_levels", self.max_levels, 0, 1000)?;
        real("beta", self.beta, 1.0, 1000.0)?;
        let is_direction = self.fixed_view.is_none_or(|view| {
            view.iter().all(|x| x.abs() <= f64::MAX) && view.iter().any(|&x| x.abs() >= f64::MIN_POSITIVE)
        });
        ParamError::check("fixed_view", is_direction, "must be three finite numbers, not all 0")
    }
}

fn whole(key: &'static str, value: u32, low: u32, high: u32) -> Result<(), ParamError> {
    let is_legal = (low..=high).contains(&value);
    ParamError::check(key, is_legal, format!("must be {low} to {high}, is {value}"))
}

fn real(key: &'static str, value: f64, low: f64, high: f64) -> Result<(), ParamError> {
    let is_legal = (low..=high).contains(&value);
    ParamError::check(key, is_legal, format!("must be {low} to {high}, is {value}"))
}
