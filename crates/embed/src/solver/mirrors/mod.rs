//! Mirror search: the side of each turn, so that as little as possible crosses at exact lengths and exact bends.
//!
//! | file | what |
//! |---|---|
//! | `setting` | what stays the same: bends, angles in space, headings, the rule of faults |
//! | `isometry`, `hierarchy`, `conflicts` | parts of the tree that move as a whole, and who meets whom |
//! | `state` | the layout, what a move would change, and taking it |
//! | `moves` | which turns change sides together |
//! | `anneal` | the walk |
//!
//! **Input** the problem with the targets of its local planes. **Output** targets with sides that were chosen, and
//! what is left when they are drawn as they are.
//! **Notation** M segments, N nodes, X crossings at ratio 0.
//! **Cost of a layout** X + .05 M (1 − |Σ p e^{i(h − H)}|) + Σ errors of angles between siblings + a price for edges
//! that are too near, for what enters the space behind the root, and for zigzags: changes of sides inside a segment
//! against the targets given, each as dear as the smaller of its two bends.
//! **Steps** A. mirror local planes; B. mirror parts of them, up to five times with a falling price of zigzags;
//! D. polish: the headings count twice. A and B end where nothing crosses. Two walks with different random numbers
//! run side by side and are compared after each phase.
//! **Guarantees** sizes of bends stay, up to the distance that siblings keep. Without a crossing at the start
//! nothing changes. Never more crossings than at the start.
//! **Source** ours; a local plane and its mirror image are equally good views, and [Hu2022] leaves the choice open.
//! **Cost** see `hierarchy`; evaluations are counted, and limited by M.

mod anneal;
#[cfg(test)]
mod checks;
mod conflicts;
mod hierarchy;
mod isometry;
mod moves;
mod rectangle;
mod setting;
mod state;

use std::f64::consts::PI;

use espalier_geom::angle::wrap;
use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Branch, Report, Targets};
use rayon::prelude::*;

use crate::choices::{KeepOut, Method};
use crate::params::{Params, SolverParams};
use crate::problem::Problem;
use crate::siblings;
use anneal::{Phase, Walker};
use moves::Boldness;
use setting::Setting;
pub(crate) use state::Terms;
use state::{Prices, State};

/// Evaluations per segment of the phases.
const PLANES_PER_SEGMENT: u64 = 300;
const TURNS_PER_SEGMENT: u64 = 1200;
const POLISH_PER_SEGMENT: u64 = 600;
/// The prices of zigzags in the repeats of phase B, and of the polish.
const ZIGZAG_PRICES: [f64; 5] = [0.2, 0.15, 0.1, 0.07, 0.05];
const POLISH_ZIGZAG_PRICE: f64 = 0.4;
/// The price of the placement, times M.
const PLACEMENT_PRICE: f64 = 0.05;
/// The price of a pair of edges that are too near.
const NEAR_PRICE: f64 = 0.25;
/// Walks side by side.
const N_WALKS: u32 = 2;

/// Targets with chosen sides.
pub(crate) struct Mirrored {
    pub(crate) targets: Targets,
    /// Of the layout of these targets at ratio 0.
    pub(crate) terms: Terms,
    /// The same at the start.
    pub(crate) terms_at_start: Terms,
    /// Changes of sides inside segments that the given targets did not have.
    pub(crate) n_zigzags: usize,
    pub(crate) evaluations: u64,
    /// Pairs of circles looked at: the work.
    pub(crate) visits: u64,
}

/// The problem with chosen sides, if that is asked for and changes anything, and what was done.
pub(crate) fn mirrored<'t>(
    problem: &Problem<'t>,
    params: &Params,
    seed: u64,
) -> (Option<Problem<'t>>, Report) {
    let mut report = Report::default();
    let wants_solver = params.method == Method::Solver || params.methods.contains(&Method::Solver);
    if !(wants_solver && params.solver.mirrors) {
        return (None, report);
    }
    let found = search(problem, &params.solver, seed);
    report.count_usize("mirror_crossings_before", found.terms_at_start.crossings);
    report.count_usize("mirror_crossings", found.terms.crossings);
    report.count_usize("mirror_near_before", found.terms_at_start.near);
    report.count_usize("mirror_near", found.terms.near);
    report.count_usize("mirror_zigzags", found.n_zigzags);
    report.count("mirror_zigzags_rad", found.terms.zigzags_rad);
    report.count("mirror_misplacement", found.terms.placement);
    report.count("mirror_evaluations", found.evaluations as f64);
    report.count("mirror_visits", found.visits as f64);
    let is_changed = found.targets.kind != problem.targets.kind;
    let branches = problem.branches.clone();
    (is_changed.then(|| Problem::new(problem.tree, branches, found.targets, params)), report)
}

/// Searches for the sides of all turns.
pub(crate) fn search(problem: &Problem, params: &SolverParams, seed: u64) -> Mirrored {
    let keeps_out = match params.root_keep_out {
        KeepOut::Auto => has_trunk(problem),
        KeepOut::On => true,
        KeepOut::Off => false,
    };
    let setting = Setting::new(problem, params.clearance, keeps_out);
    let state = State::new(&setting);
    let terms_at_start = state.terms();
    let n_segments = problem.branches.list().len() as f64;
    let judge = prices(n_segments, 2.0, POLISH_ZIGZAG_PRICE);
    let walker = Walker::new(state, judge);
    let is_wanted = params.root_keep_out == KeepOut::On && terms_at_start.kept_out > 0;
    if terms_at_start.crossings == 0 && !is_wanted {
        let targets = problem.targets.clone();
        return Mirrored {
            targets,
            terms: terms_at_start,
            terms_at_start,
            n_zigzags: 0,
            evaluations: 0,
            visits: 0,
        };
    }

    let mut walkers = vec![walker; N_WALKS as usize];
    let count = |per_segment: u64| (params.effort * n_segments * per_segment as f64) as u64;
    let mut round = 0;
    let mut run = |walkers: &mut Vec<Walker>, phase: &Phase| {
        run_side_by_side(walkers, phase, (seed, round));
        round += 1;
    };
    let planes = Phase {
        boldness: Boldness::Planes,
        hottest: 1.0,
        coldest: 0.05,
        prices: prices(n_segments, 1.0, 0.0),
        n_evaluations: count(PLANES_PER_SEGMENT),
        ends_at_zero: true,
    };
    run(&mut walkers, &planes);
    for zigzag_price in ZIGZAG_PRICES {
        if walkers.iter().any(Walker::is_solved) {
            break;
        }
        let turns = Phase {
            boldness: Boldness::Turns,
            hottest: 0.5,
            prices: prices(n_segments, 1.0, zigzag_price),
            n_evaluations: count(TURNS_PER_SEGMENT),
            ..planes
        };
        run(&mut walkers, &turns);
    }
    take_best(&mut walkers);
    let polish = Phase {
        boldness: Boldness::Turns,
        hottest: 0.06,
        coldest: 0.02,
        prices: judge,
        n_evaluations: count(POLISH_PER_SEGMENT),
        ends_at_zero: false,
    };
    run(&mut walkers, &polish);
    finish(problem, walkers, terms_at_start)
}

/// Whether one branch leaves the root and is thicker than any other: a trunk, as a trachea or an aorta is.
fn has_trunk(problem: &Problem) -> bool {
    let tree = problem.tree;
    let mean_radius_mm = |branch: &Branch| {
        let sum: f64 = branch.nodes.clone().map(|node| tree.nodes()[node].radius_mm).sum();
        sum / branch.nodes.len() as f64
    };
    match problem.branches.list() {
        [trunk, others @ ..] if tree.children(0).len() == 1 => {
            others.iter().all(|branch| mean_radius_mm(branch) < mean_radius_mm(trunk))
        }
        _ => false,
    }
}

fn prices(n_segments: f64, placement: f64, zigzags: f64) -> Prices {
    Prices {
        near: NEAR_PRICE,
        kept_out: 1.0,
        placement: placement * PLACEMENT_PRICE * n_segments,
        siblings: 1.0,
        zigzags,
    }
}

fn run_side_by_side(walkers: &mut [Walker], phase: &Phase, (seed, round): (u64, u32)) {
    walkers.par_iter_mut().enumerate().for_each(|(walk, walker)| {
        walker.anneal(phase, Stream::new(seed, Purpose::MirrorSearch, walk as u32, round));
    });
}

/// All walks go on from the best one.
fn take_best(walkers: &mut [Walker]) {
    let mut best = 0;
    for idx in 1..walkers.len() {
        if walkers[idx].is_better(&walkers[idx].best_terms, &walkers[best].best_terms) {
            best = idx;
        }
    }
    let (saved, terms) = (walkers[best].best.clone(), walkers[best].best_terms);
    for walker in walkers {
        (walker.best, walker.best_terms) = (saved.clone(), terms);
    }
}

fn finish(problem: &Problem, mut walkers: Vec<Walker>, terms_at_start: Terms) -> Mirrored {
    take_best(&mut walkers);
    let (turns, n_zigzags) = walkers[0].best_turns();
    let mut targets = problem.targets.clone();
    targets.kind = targets.kind.mirrored();
    for (angle, turn) in targets.angle_rad.iter_mut().zip(turns).skip(1) {
        *angle = (PI + wrap(turn)).clamp(siblings::MARGIN_RAD, 2.0 * PI - siblings::MARGIN_RAD);
    }
    let evaluations = walkers.iter().map(|walker| walker.n_evaluations).sum();
    let visits = walkers.iter().map(Walker::n_visits).sum();
    Mirrored { targets, terms: walkers[0].best_terms, terms_at_start, n_zigzags, evaluations, visits }
}
