//! Two trees of one organ, branch against branch: healthy and diseased, baseline and follow-up.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `limbs`, `line` | both trees by their branches |
//! | 2 | `rounds` | ways to begin; matching and alignment in turn |
//! | | `matching`, `assign` | which branch is which |
//! | | `frame` | the motion that brings matched forks together |
//! | 3 | `strand` | a branch of both, place by place, and what changed |
//! | 4 | `shared` | one tree that holds both, and the rows of the table |
//!
//! Laying the shared tree flat once gives both trees one embedding: what both have lies in the same place, and neither
//! crosses, for each is a part of a layout without crossings.
//!
//! **Source** juxtaposition: section 4.1 and figure 8 of [Hu2022], which draws two states of a neurite along one
//! embedding; how branches are matched is ours, for the paper's two states share one skeleton.

mod assign;
mod error;
mod frame;
mod limbs;
mod line;
mod matching;
mod params;
mod rounds;
mod shared;
mod strand;

use espalier_model::{Fate, Juxtaposition, Report, Tree};

pub use error::Error;
use limbs::Limbs;
pub use params::{Align, Params};

/// The most pairs of branches: 200 MB, and seconds for each round.
const MOST_PAIRS: usize = 1 << 24;
/// The largest coordinate, in mm: squares of it, and sums of them, stay far inside the range of `f64`.
const MAX_COORDINATE_MM: f64 = 1e60;
/// Less of the baseline's length than this matched: the trees may not be of one organ.
const LEAST_MATCHED: f64 = 0.3;

/// Two trees held against each other, and what was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Juxtaposed {
    /// What became of each branch, and the tree that holds both.
    pub juxtaposition: Juxtaposition,
    /// Counts and warnings.
    pub report: Report,
}

/// Holds a follow-up against its baseline.
///
/// Both trees are RAS+ mm, each in a frame of its own. The result does not depend on the number of threads.
///
/// # Errors
/// A parameter out of range, more than 2²⁴ pairs of branches, or coordinates beyond 1e60 mm.
///
/// ```
/// use espalier_juxtapose::{Params, juxtapose};
/// use espalier_model::{Fate, Node, Tree};
/// use glam::DVec3;
///
/// let node = |x, z, radius_mm, parent| Node { position_mm: DVec3::new(x, 0.0, z), radius_mm, parent, kind: 0 };
/// let fork = |left: f64| {
///     Tree::new(&[
///         node(0.0, 9.0, 1.0, None),
///         node(0.0, 0.0, 1.0, Some(0)),
///         node(6.0, -8.0, left, Some(1)),
///         node(-4.0, -9.0, 0.8, Some(1)),
///     ])
/// };
/// let compared = juxtapose(&fork(0.8)?, &fork(0.4)?, &Params::default())?.juxtaposition;
/// assert_eq!(compared.of_fate(Fate::Matched).count(), 3);
/// assert!((compared.rows[1].radius_change_percent() + 50.0).abs() < 1e-9);
///
/// let heavy = Params { radius_weight: 9.0, ..Params::default() };
/// let error = juxtapose(&fork(0.8)?, &fork(0.4)?, &heavy).unwrap_err();
/// assert_eq!(error.to_string(), "radius_weight: must be 0 to 2, is 9");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn juxtapose(baseline: &Tree, followup: &Tree, params: &Params) -> Result<Juxtaposed, Error> {
    params.validate()?;
    let trees = [baseline, followup];
    check_coordinates(trees)?;
    let branches = trees.map(Tree::branches);
    let [n_baseline, n_followup] = [0, 1].map(|tree: usize| branches[tree].list().len());
    if n_baseline.saturating_mul(n_followup) > MOST_PAIRS {
        return Err(Error::TooManyPairs { n_baseline, n_followup, limit: MOST_PAIRS });
    }
    let limbs = [0, 1].map(|tree: usize| Limbs::of(trees[tree], &branches[tree]));
    let limbs = [&limbs[0], &limbs[1]];
    let (alignment, matching) = rounds::align_and_match(limbs, params);
    let pair = shared::Pair {
        trees,
        branches: [&branches[0], &branches[1]],
        limbs,
        alignment,
        chains: &matching.chains,
    };
    let juxtaposition = shared::share(&pair)?;
    let report = report(&juxtaposition, baseline);
    Ok(Juxtaposed { juxtaposition, report })
}

fn check_coordinates(trees: [&Tree; 2]) -> Result<(), Error> {
    let nodes = trees.into_iter().flat_map(Tree::nodes);
    let largest_mm =
        nodes.map(|node| node.position_mm.abs().max_element().max(node.radius_mm)).fold(0.0, f64::max);
    if largest_mm > MAX_COORDINATE_MM {
        return Err(Error::TooFar { largest_mm, limit_mm: MAX_COORDINATE_MM });
    }
    Ok(())
}

fn report(compared: &Juxtaposition, baseline: &Tree) -> Report {
    let mut report = Report::default();
    for (fate, branches, length) in [
        (Fate::Matched, "branches_matched", "length_matched_mm"),
        (Fate::Lost, "branches_lost", "length_lost_mm"),
        (Fate::New, "branches_new", "length_new_mm"),
    ] {
        report.count_usize(branches, compared.of_fate(fate).count());
        report.count(length, compared.length_mm(fate));
    }
    let alignment = &compared.alignment;
    report.count_usize("places_fitted", alignment.n_points);
    report.count("turned_deg", alignment.angle_deg());
    report.count("moved_mm", alignment.translation_mm.length());
    report.count("scale", alignment.scale);
    report.count("residual_mean_mm", alignment.residual_mean_mm);
    report.count("residual_max_mm", alignment.residual_max_mm);
    let share = compared.length_mm(Fate::Matched) / baseline.length_mm();
    if share < LEAST_MATCHED {
        let message = format!(
            "only {:.0} % of the baseline's length matches: are these two trees of one organ, from the same end?",
            100.0 * share
        );
        report.warn("W-JUXTAPOSE-LITTLE", message);
    }
    report
}
