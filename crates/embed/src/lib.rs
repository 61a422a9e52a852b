//! Trees laid flat without crossings.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `targets`, `siblings` | target angles, lengths and headings from the tree and its views |
//! | 2 | `problem`, `weights`, `ratio`, `prospect` | the frozen problem; the user's weights; equation 3 between angles and ratios; whether a search is worth it |
//! | 3 | `layout/…`, `place` | the methods: `projection`, `radial`, `cone`, `marino`, `pso` (with `start`); positions from headings |
//! | 4 | `solver/…`, `separation`, `paths` | the default method: the search for sides, then ratios; how near edges may come |
//! | 5 | `batch`, `trig`, `crossing`, `runs` | the swarm's energy, many particles at once, and its strict crossing count |
//! | 6 | `pose` | one rigid motion of the whole, mirrored or not; rounding to what is written |
//! | 7 | `certify`, `widths/…`, `boxes` | the exact certificate; layouts at the widths of their tubes; boxes that meet |
//! | 8 | `energy`, `losses/…`, `distances`, `judged` | the one energy and all losses, for every method alike |
//! | 9 | `methods`, `select`, `summary`, `never_worse` | the methods' run; the best certified layout and the table of all; what is said of them; the last look |
//! | 10 | `replay`, `pins` | manual edits in it: branches turned and pinned, the rest laid around them |
//!
//! **Cost** Targets, radial, cone, pose and energy are linear in N. The certificate sorts and sweeps, N log N on
//! layouts that fill their box. Distances take a fixed 1.1 million pairs. The swarm takes particles · iterations
//! evaluations, of which most end at the first lines of `batch`; the crossing check is the rest. The solver counts its
//! work and ends within a multiple of N (see `solver`); it takes most of the time from about a thousand nodes on.
//!
//! **Source** [Hu2022] sections 3.2 and 5.1.

mod batch;
mod boxes;
mod certify;
#[cfg(test)]
mod checks;
mod choices;
#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod common;
mod crossing;
mod distances;
mod energy;
mod error;
mod judged;
mod layout;
mod losses;
mod methods;
mod never_worse;
mod params;
mod paths;
mod pins;
mod place;
mod pose;
mod problem;
mod prospect;
mod ratio;
mod replay;
mod runs;
mod select;
mod separation;
mod siblings;
mod solver;
mod summary;
mod targets;
mod trig;
mod weights;
mod widths;

use espalier_model::{Comparison, Edits, Embedding, Report, Tree, ViewHierarchy};

pub use certify::{certify, crossing_pairs};
pub use choices::{
    CrossingWeight, Freedom, KeepOut, MarinoView, Method, PoseMode, Pull, Start, SwarmUse, TargetMode,
    WidthsMode,
};
pub use error::Error;
pub use params::{MarinoParams, Params, PsoParams, SolverParams, WeightRule, WidthsParams};

/// How far the swarm is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Iterations done; 0 is the start.
    pub done: u64,
    /// Iterations there will be at most.
    pub total: u64,
    /// Evaluations so far.
    pub evaluations: u64,
    /// The best energy so far.
    pub energy: f64,
    /// The crossings of that best.
    pub crossings: usize,
}

/// What happens while a tree is laid flat. Methods run one after the other.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// A method begins.
    Started {
        /// The method.
        method: Method,
    },
    /// A method that searches goes on.
    Searching(Progress),
    /// A method has its layout.
    Finished {
        /// Its name as in `compare.tsv`, with its size where that matters.
        name: String,
    },
}

/// A tree laid flat, and what was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedded {
    /// The layout with its certificate.
    pub embedding: Embedding,
    /// The layouts of all methods, scored alike.
    pub comparison: Comparison,
    /// Counts and warnings.
    pub report: Report,
}

/// Lays a tree flat without crossings.
///
/// Runs the methods asked for, scores them by one energy against one set of targets, and returns the best
/// certified layout (see [`Params::method`]). `events` is called when a method begins and ends, and once per
/// iteration of the swarm. Parallel in the current thread pool; the result depends on `tree`, `views`, `params` and
/// `seed` only.
///
/// # Errors
/// A parameter out of range, views of another tree, a tree too small or too large for exact arithmetic, a swarm
/// beyond its memory, or [`Error::Uncertified`] where no layout is free of crossings after rounding.
///
/// ```
/// use espalier_embed::{Params, PsoParams, embed};
/// use espalier_model::{Node, Tree};
/// use espalier_views::find_views;
/// use glam::DVec3;
///
/// let node = |x, y, z, parent| Node { position_mm: DVec3::new(x, y, z), radius_mm: 1.0, parent, kind: 0 };
/// let fork = [
///     node(0.0, 0.0, 9.0, None),
///     node(0.0, 0.0, 5.0, Some(0)),
///     node(3.0, 1.0, 0.0, Some(1)),
///     node(-3.0, 1.0, 0.0, Some(1)),
/// ];
/// let tree = Tree::new(&fork)?;
/// let views = find_views(&tree, &espalier_views::Params::default(), 0)?.hierarchy;
/// let embedding = embed(&tree, &views, &Params::default(), 0, &|_| {})?.embedding;
/// assert!(embedding.certificate.holds());
/// assert!(embedding.losses.angle3d_error_max_deg < 1e-6);
///
/// let alone = Params { pso: PsoParams { particles: 1, ..PsoParams::default() }, ..Params::default() };
/// let error = embed(&tree, &views, &alone, 0, &|_| {}).unwrap_err();
/// assert_eq!(error.to_string(), "pso.particles: must be from 3 to 1000000, is 1");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn embed(
    tree: &Tree,
    views: &ViewHierarchy,
    params: &Params,
    seed: u64,
    events: &(dyn Fn(Event) + Sync),
) -> Result<Embedded, Error> {
    embed_edited((tree, views), &Edits::none(tree), params, seed, events)
}

/// As [`embed`], and makes manual edits in the layout that it gives: branches are turned by hand and pinned, crossings
/// that this brings about are removed, and all else is optimised around them. [`Embedding::edits`] lists what came of
/// each.
///
/// # Errors
/// As [`embed`]; edits of another tree; and [`Error::Edits`] where no layout without crossings was found that keeps
/// what they pin.
pub fn embed_edited(
    (tree, views): (&Tree, &ViewHierarchy),
    edits: &Edits,
    params: &Params,
    seed: u64,
    events: &(dyn Fn(Event) + Sync),
) -> Result<Embedded, Error> {
    params.validate()?;
    if edits.tree() != tree.digest() {
        return Err(Error::EditsOfOtherTree);
    }
    let length_mm = tree.length_mm();
    if tree.n_nodes() > 1 && !(1e-60..=1e60).contains(&length_mm) {
        return Err(Error::Scale { length_mm });
    }
    let branches = tree.branches();
    let weights_report = weights::check(tree, &branches, params)?;
    let targets = targets::targets(tree, &branches, views, params.targets)?;
    let mut problem = problem::Problem::new(tree, branches, targets, params);
    problem.is_crowded = prospect::is_crowded(&problem, params, seed);
    let sides = solver::mirrors::mirrored(&problem, params, seed);
    let problems = methods::Problems {
        frozen: sides.problem.as_ref().unwrap_or(&problem),
        unflipped: sides.problem.is_some().then_some(&problem),
        search_evaluations: sides.evaluations,
    };
    let layouts = methods::run(problems, views, params, seed, events)?;
    let mut embedded = select::select(problems, layouts, edits, (params, seed))?;
    embedded.report.extend(sides.report);
    embedded.report.extend(weights_report);
    Ok(embedded)
}
