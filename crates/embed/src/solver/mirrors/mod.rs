//! Mirror search: the side of each turn, so that as little as possible crosses at exact lengths and exact bends.
//!
//! | file | what |
//! |---|---|
//! | `setting` | what stays the same: bends, angles in space, headings, the rule of faults |
//! | `isometry`, `rectangle`, `hierarchy`, `conflicts` | parts of the tree that move as a whole, and who meets whom |
//! | `step`, `state`, `change` | a change of sides; the layout; what the change would cost, and taking it |
//! | `moves` | which turns change sides together |
//! | `anneal` | the walk |
//! | `settle` | the last walk, for distances |
//!
//! **Input** the problem with the targets of its local planes. **Output** targets with sides that were chosen, and
//! what is left when they are drawn as they are.
//! **Notation** M segments, N nodes, X crossings at ratio 0.
//! **Cost of a layout** X + .05 M (1 − |Σ p e^{i(h − H)}|) + Σ errors of angles between siblings + a price for edges
//! that are too near, for what enters the space behind the root, and for zigzags: changes of sides inside a segment
//! against the targets given, each as dear as the smaller of its two bends.
//! **Steps** 1. Simulated annealing at full prices. 2. While something crosses, again from the best state, with all
//! prices but that of crossings lowered. 3. Polish: annealing from a low temperature, where headings count twice, with
//! the evaluations that are left. 4. Settling: distances between nodes as in space. Two walks with different random
//! numbers run side by side and are compared at the end of each round; the polish goes on from the better one.
//! **Guarantees** sizes of bends stay, up to the distance that siblings keep. Without a crossing at the start
//! nothing changes, but under `root_keep_out = "on"` where an edge is behind the root. Never more crossings than at the
//! start.
//! **Differs from the prototype** it mirrored whole local planes first, which finds nothing that single turns do not.
//! Why not a swarm over the mirror bits? Of seven neurons of 135 to 300 nodes whose planes cross, a binary swarm with one
//! bit per plane ended without a crossing on three, and with 1, 1, 2 and 4 on the others, after 123,000 evaluations;
//! these walks end without on all seven, after 71,000 to 122,000.
//! **Source** ours; a local plane and its mirror image are equally good views, and [Hu2022] leaves the choice open.
//! **Cost** see `hierarchy`; evaluations and the blocks that they look at are counted, and limited by N.

mod anneal;
mod change;
#[cfg(test)]
mod checks;
mod conflicts;
mod hierarchy;
mod isometry;
mod moves;
mod rectangle;
mod setting;
mod settle;
mod state;
mod step;

use std::f64::consts::PI;

use espalier_geom::angle::wrap;
use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Branch, Report, Targets};
use rayon::prelude::*;

use crate::choices::{KeepOut, Method};
use crate::params::{Params, SolverParams};
use crate::problem::Problem;
use crate::prospect::Prospect;
use crate::siblings;
use anneal::{Phase, Walker};
use setting::Setting;
use settle::Distances;
use state::State;
use step::Prices;
pub(crate) use step::Terms;

/// The evaluations of one walk are this much at most, times N (but no more than `Problem::n_joints`) to the power
/// below: 70,000 for 235 nodes, 200,000 for 1000, where one takes 1 and 4 µs.
const EVALUATIONS: f64 = 1800.0;
const EVALUATIONS_POWER: f64 = 0.68;
/// From this size on walks are as much longer as the tree is larger, up to a limit. A neuron of 50,000 nodes gets four
/// times the evaluations by this. With as many, asked for by an effort of 4, it ended at 1.8° after 279 s, and at 27°
/// with a quarter of them and of the solver's work; `marino` ends at 14°.
const LARGE: f64 = 10_000.0;
const MOST_LONGER: f64 = 4.0;
/// The prices of everything but crossings in the rounds, as shares of the full ones. At full prices a vessel of 1076
/// nodes keeps 5 crossings and an airway of 2284 nodes 16; at a third the vessel ends at 0, at a tenth the airway
/// keeps 5 in the same time. But headings and forks come out best at full prices, so these stand first.
const ROUNDS: [f64; 4] = [1.0, 0.3, 0.1, 0.05];
/// Temperatures: the first round forgets where it began, the others keep most of what was found.
const HOTTEST: f64 = 1.0;
const HOTTEST_AGAIN: f64 = 0.5;
const COLDEST: f64 = 0.02;
/// The share of the evaluations that each round has.
const ROUND_SHARE: f64 = 0.2;
/// The polish: temperatures, and the share of the evaluations that it has at most; it has what the rounds leave.
const POLISH_TEMPERATURES: (f64, f64) = (0.2, 0.01);
const POLISH_SHARE: f64 = 0.5;
/// The settling: temperatures, and its evaluations as a share of those of the search.
const SETTLING_TEMPERATURES: (f64, f64) = (0.3, 0.01);
const SETTLING_SHARE: f64 = 0.15;
/// A walk that is sent ahead: its evaluations as a share of those of the search (but none the longer for being large),
/// and its prices.
const SCOUT_SHARE: f64 = 0.01;
const SCOUT_PRICES: f64 = 0.3;
/// Full prices, against 1 for a crossing; that of the placement is times M, that of zigzags is per rad.
const PLACEMENT_PRICE: f64 = 0.05;
const SIBLINGS_PRICE: f64 = 1.0;
const ZIGZAG_PRICE: f64 = 0.3;
/// The price of a pair of edges that are too near, in all rounds.
const NEAR_PRICE: f64 = 0.25;
/// The same in the polish, where nothing crosses that they could stand in the way of.
const POLISH_NEAR_PRICE: f64 = 1.0;
/// The price of an edge that enters the space behind the root.
const KEEP_OUT_PRICE: f64 = 1.0;
/// Walks side by side.
const N_WALKS: usize = 2;

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
    /// Pairs of blocks looked at: the work.
    pub(crate) visits: u64,
}

/// What came of the search.
#[derive(Default)]
pub(crate) struct Chosen<'t> {
    /// The problem with chosen sides, if that is asked for and changes anything.
    pub(crate) problem: Option<Problem<'t>>,
    pub(crate) evaluations: u64,
    pub(crate) report: Report,
}

/// The problem with chosen sides, and what was done.
pub(crate) fn mirrored<'t>(problem: &Problem<'t>, params: &Params, seed: u64) -> Chosen<'t> {
    let mut report = Report::default();
    let wants_solver = params.method == Method::Solver || params.methods.contains(&Method::Solver);
    if !(wants_solver && params.solver.mirrors) || problem.is_thread() {
        return Chosen::default();
    }
    match Prospect::of(problem) {
        Prospect::Free if params.solver.root_keep_out != KeepOut::On => {
            report.count_usize("mirror_crossings_before", 0);
            return Chosen { report, ..Chosen::default() };
        }
        Prospect::Crowded => {
            let message = "exact angles cross each other all over: the sides of turns are not searched, and the \
                           solver does little";
            report.warn("W-EMBED-CROWDED", message);
            return Chosen { report, ..Chosen::default() };
        }
        _ => {}
    }
    let found = search(problem, &params.solver, seed);
    report.count_usize("mirror_crossings_before", found.terms_at_start.crossings);
    report.count_usize("mirror_crossings", found.terms.crossings);
    report.count_usize("mirror_near_before", found.terms_at_start.near);
    report.count_usize("mirror_near", found.terms.near);
    report.count_usize("mirror_behind_root_before", found.terms_at_start.kept_out);
    report.count_usize("mirror_behind_root", found.terms.kept_out);
    report.count_usize("mirror_zigzags", found.n_zigzags);
    report.count("mirror_zigzags_rad", found.terms.zigzags_rad);
    report.count("mirror_misplacement", found.terms.placement);
    report.count("mirror_evaluations", found.evaluations as f64);
    report.count("mirror_visits", found.visits as f64);
    let is_changed = found.targets.kind != problem.targets.kind;
    let branches = problem.branches.clone();
    Chosen {
        problem: is_changed.then(|| Problem::new(problem.tree, branches, found.targets, params)),
        evaluations: found.evaluations,
        report,
    }
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

    let full = prices(problem, 1.0);
    let judge = Prices { near: POLISH_NEAR_PRICE, placement: 2.0 * full.placement, ..full };
    let mut walkers = vec![Walker::new(state, judge); N_WALKS];
    let n_evaluations = params.effort * most_evaluations(problem.n_joints() as f64);
    let mut share_left = 1.0;
    for (round, share) in (0..).zip(ROUNDS) {
        let phase = Phase {
            hottest: if round == 0 { HOTTEST } else { HOTTEST_AGAIN },
            coldest: COLDEST,
            prices: prices(problem, share),
            n_evaluations: n_evaluations * ROUND_SHARE,
        };
        run_side_by_side(&mut walkers, &phase, (seed, round));
        share_left -= ROUND_SHARE;
        if walkers.iter().any(Walker::is_solved) {
            break;
        }
    }
    take_best(&mut walkers);
    let polish = Phase {
        hottest: POLISH_TEMPERATURES.0,
        coldest: POLISH_TEMPERATURES.1,
        prices: judge,
        n_evaluations: n_evaluations * share_left.min(POLISH_SHARE),
    };
    run_side_by_side(&mut walkers, &polish, (seed, ROUNDS.len() as u32));
    let settling = Phase {
        hottest: SETTLING_TEMPERATURES.0,
        coldest: SETTLING_TEMPERATURES.1,
        prices: Prices { near: POLISH_NEAR_PRICE, ..full },
        n_evaluations: n_evaluations * SETTLING_SHARE,
    };
    settle_side_by_side(&mut walkers, &settling, seed);
    finish(problem, walkers, terms_at_start)
}

/// The share of the crossings that a short walk leaves; there must be some.
pub(crate) fn share_left(problem: &Problem, params: &SolverParams, seed: u64) -> f64 {
    let setting = Setting::new(problem, params.clearance, false);
    let prices = prices(problem, SCOUT_PRICES);
    let mut walker = Walker::new(State::new(&setting), prices);
    let n_before = walker.best_terms.crossings;
    let phase = Phase {
        hottest: HOTTEST_AGAIN,
        coldest: COLDEST,
        prices,
        n_evaluations: SCOUT_SHARE * EVALUATIONS * math::pow(problem.n_joints() as f64, EVALUATIONS_POWER),
    };
    walker.anneal(&phase, Stream::new(seed, Purpose::MirrorSearch, 0, ROUNDS.len() as u32 + 2));
    walker.best_terms.crossings as f64 / n_before.max(1) as f64
}

/// The evaluations of one walk for a tree of that size.
fn most_evaluations(n_joints: f64) -> f64 {
    EVALUATIONS * math::pow(n_joints, EVALUATIONS_POWER) * (n_joints / LARGE).clamp(1.0, MOST_LONGER)
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

/// The full prices, those of everything but faults times `share`; what the user adds to that of a zigzag stays.
fn prices(problem: &Problem, share: f64) -> Prices {
    Prices {
        near: NEAR_PRICE,
        kept_out: KEEP_OUT_PRICE,
        placement: share * PLACEMENT_PRICE * problem.branches.list().len() as f64,
        siblings: share * SIBLINGS_PRICE,
        zigzags: share * ZIGZAG_PRICE + problem.w_side,
    }
}

fn run_side_by_side(walkers: &mut [Walker], phase: &Phase, (seed, round): (u64, u32)) {
    walkers.par_iter_mut().enumerate().for_each(|(walk, walker)| {
        walker.anneal(phase, Stream::new(seed, Purpose::MirrorSearch, walk as u32, round));
    });
}

/// The last walk of each; the one of the least cost comes first.
fn settle_side_by_side(walkers: &mut [Walker], phase: &Phase, seed: u64) {
    let distances = Distances::new(walkers[0].state.setting);
    let settled = |(walk, walker): (usize, &mut Walker)| {
        let stream = Stream::new(seed, Purpose::MirrorSearch, walk as u32, ROUNDS.len() as u32 + 1);
        walker.settle(&distances, phase, stream)
    };
    let costs: Vec<f64> = walkers.par_iter_mut().enumerate().map(settled).collect();
    let order = |&a: &usize, &b: &usize| {
        let n_crossings = |walk: usize| walkers[walk].best_terms.crossings;
        n_crossings(a).cmp(&n_crossings(b)).then(costs[a].total_cmp(&costs[b]))
    };
    let best = (0..walkers.len()).min_by(order).unwrap_or(0);
    walkers.swap(0, best);
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
