//! Our solver: from a crossing-free start to the least energy.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `mirrors/` | before any method: the side of each turn, at exact lengths and bends |
//! | 2 | `untangling` | a second start beside the cone: the targets, bent no more than it takes |
//! | 3 | `descent` | ratios towards 0, a few at a time, through other branches if need be |
//! | 4 | `barrier/` | all ratios at once, under a barrier that keeps branches apart |
//! | | `shape`, `work` | a layout by its ratios; the budget |
//! | | `linkage`, `joint`, `deviation` | a layout as a linkage: what a change of some ratios moves, gains and hits |
//! | | `placement` | the placement term while subtrees turn |
//! | | `hierarchy`, `oriented_box`, `similarity` | who may be near whom: boxes over subtrees that move as a whole |
//! | | `repair` | manual edits: a layout of which a part is pinned, freed of crossings |
//!
//! **Input** the problem, and crossing-free headings. **Output** a layout without crossings, why the search ended,
//! and the curve of its energy.
//! **Steps** Where the targets themselves do not cross there is nothing to do (unless w_g asks for headings rather than
//! for exact angles); where they cross everywhere, the cone is brought down a little. Else both starts, each on a thread of
//! its own. The cone: descend; then barrier and descent in turn until a round gains less than 3 %. The targets: the
//! barrier until a round gains less than 3 %, then one descent. The better one wins. Why the two differ: where there is
//! more to do than work to do it with, early descents save the barrier the most of it (a neuron of 9532 nodes ends at
//! the energy 11 with them, at 39 without; one of 49,695 at 53 and 387); where there is not, they bring the layout near
//! others that it cannot leave (from the targets, neurons of 4696 and 4332 nodes and an airway of 4099 end at 23.2, 22.3
//! and 24.5 with them, at 18.0, 20.6 and 18.5 without).
//! Why nothing is simplified first and refined later: the hierarchies move whole subtrees at the cost of what is near
//! them, so that 1000 nodes take 3.2 s in a neuron of 10,000 nodes, 4.8 s in one of 30,000 and 4.1 s in one of 60,000
//! (`scripts/bench-embed --scale`); and the bends inside a branch, which simplifying drops, are what is to be kept.
//! A thread, a tree of next to nothing but chain, is only brought down from the cone: all parts together lower the
//! energy of 100,000 turns in one segment by half a percent, in 40 s.
//! **Guarantees** every shape that is kept is free of crossings, and the energy of each start never rises; the same
//! result for any number of threads, since the starts know nothing of each other.
//! **Source** ours; the energy is Eq. 4 of [Hu2022].
//! **Cost** `WORK_PER_EDGE` units for an edge and start at most, `MOST_WORK` in all, times the effort.

pub(crate) mod barrier;
#[cfg(test)]
mod checks;
mod descent;
mod deviation;
mod hierarchy;
mod joint;
mod linkage;
pub(crate) mod mirrors;
mod oriented_box;
mod placement;
mod repair;
mod shape;
mod similarity;
mod untangling;
mod work;

use espalier_model::{Phase, Termination, TracePoint};

use crate::energy;
use crate::layout::{Aim, Layout};
use crate::params::{Params, SolverParams};
use crate::problem::Problem;
use crate::prospect::Prospect;
use crate::separation::Separation;
pub(crate) use repair::repair;
pub(crate) use shape::Shape;
pub(crate) use work::Work;

/// Units of work that a start may take, for each edge (but see `Problem::n_joints`), and in all: 6 billion take two to
/// three minutes, which is what a neuron of 50,000 nodes needs (see `mirrors`).
const WORK_PER_EDGE: u64 = 150_000;
const MOST_WORK: u64 = 6_000_000_000;
/// The units that a crowded tree may take, which nothing brings near its targets: a quarter of a second.
const CROWDED_WORK: f64 = 1e7;
/// What untangling may take of the work; a hemibrain neuron of 4332 nodes with two crossings left needs more than a
/// quarter of it.
const UNTANGLING_SHARE: f64 = 0.6;
/// What a descent may take of the work: where much has to be moved the barrier is faster.
const DESCENT_SHARE: f64 = 0.05;
/// A round that gains less than this share of the energy is the last.
const LEAST_GAIN: f64 = 0.03;

/// Lays the problem's tree flat; `cone` are the headings of the cone start.
pub(crate) fn layout(problem: &Problem, cone: &[f64], params: &Params) -> Layout {
    let separation = Separation::new(problem, params.solver.clearance);
    let targets = Shape::targets(problem);
    let prospect = Prospect::of(problem);
    if prospect == Prospect::Free && !problem.trades_placement {
        let mut run = Run::new(problem, &params.solver, targets);
        run.record(Phase::Start);
        return run.end();
    }
    let cone = Shape::from_headings(problem, cone);
    if prospect == Prospect::Crowded {
        let mut run = Run::new(problem, &params.solver, cone);
        run.work.limit = run.work.limit.min((params.solver.effort * CROWDED_WORK) as u64);
        run.record(Phase::Start);
        run.descend(&separation, 1.0);
        return run.end();
    }
    let from_cone = || {
        let mut run = Run::new(problem, &params.solver, cone.clone());
        run.record(Phase::Start);
        run.improve(&separation, Descents::BetweenBarriers);
        run
    };
    let from_targets = || {
        let mut run = Run::new(problem, &params.solver, cone.clone());
        run.untangle(&separation);
        run.record(Phase::Untangling);
        run.improve(&separation, Descents::Last);
        run
    };
    let best = if prospect == Prospect::Free || (params.solver.untangling && !problem.is_thread()) {
        let (from_cone, from_targets) = rayon::join(from_cone, from_targets);
        if from_targets.is_better(&from_cone) { from_targets } else { from_cone }
    } else {
        from_cone()
    };
    best.end()
}

/// When a start descends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Descents {
    /// Before the first barrier and after each.
    BetweenBarriers,
    /// Once, after the last barrier.
    Last,
}

/// One start on its way.
struct Run<'a> {
    problem: &'a Problem<'a>,
    params: &'a SolverParams,
    shape: Shape,
    work: Work,
    trace: Vec<TracePoint>,
}

impl<'a> Run<'a> {
    fn new(problem: &'a Problem<'a>, params: &'a SolverParams, shape: Shape) -> Self {
        let limit = params.effort * (WORK_PER_EDGE * problem.n_joints() as u64).min(MOST_WORK) as f64;
        Self { problem, params, shape, work: Work::up_to(limit as u64), trace: Vec::new() }
    }

    /// Bends the targets as little as it takes.
    fn untangle(&mut self, separation: &Separation) {
        let mut slice = self.work.slice(UNTANGLING_SHARE);
        self.shape = untangling::untangle(self.problem, separation, &self.shape, &mut slice);
        self.work.add(slice);
    }

    /// Barrier and descent, as long as it pays. What has no loss is left as it is.
    fn improve(&mut self, separation: &Separation, descents: Descents) {
        if self.is_final() {
            return;
        }
        if descents == Descents::BetweenBarriers {
            self.descend(separation, DESCENT_SHARE);
        }
        let mut is_first = true;
        while self.params.barrier && !self.problem.is_thread() && !self.work.is_spent() {
            let before = self.energy();
            self.keep_if_better(Phase::Barrier, |run| {
                barrier::relax(run.problem, separation, &mut run.shape, (is_first, &mut run.work));
            });
            is_first = false;
            if descents == Descents::BetweenBarriers {
                self.descend(separation, DESCENT_SHARE);
            }
            if before - self.energy() < LEAST_GAIN * before {
                break;
            }
        }
        if descents == Descents::Last {
            self.descend(separation, DESCENT_SHARE);
        }
    }

    /// Descends with a share of the work.
    fn descend(&mut self, separation: &Separation, share: f64) {
        if self.params.descent {
            self.keep_if_better(Phase::Descent, |run| {
                let mut slice = run.work.slice(share);
                descent::descend(run.problem, separation, &mut run.shape, &mut slice);
                run.work.add(slice);
            });
        }
    }

    fn keep_if_better(&mut self, phase: Phase, step: impl FnOnce(&mut Self)) {
        let (kept, before) = (self.shape.clone(), self.energy());
        step(self);
        if self.energy() >= before {
            self.shape = kept;
        }
        self.record(phase);
    }

    /// Whether nothing that costs is lost, so that nothing can be better but the placement.
    fn is_lossless(&self) -> bool {
        self.shape.loss(self.problem) == 0.0
    }

    /// Whether that is all that is asked for.
    fn is_final(&self) -> bool {
        self.is_lossless() && !self.problem.trades_placement
    }

    /// Final, or else of less energy.
    fn is_better(&self, other: &Self) -> bool {
        let key = |run: &Self| (!run.is_final(), run.energy());
        key(self) <= key(other)
    }

    fn energy(&self) -> f64 {
        energy::score(self.problem, &self.shape.positions(self.problem), 0.0, 0).energy.total()
    }

    fn record(&mut self, phase: Phase) {
        self.trace.push(TracePoint {
            phase,
            iteration: self.trace.len() as u32,
            evaluations: self.work.done,
            energy: self.energy(),
            crossings: 0,
        });
    }

    /// The layout that was found.
    fn end(self) -> Layout {
        let termination = if self.is_lossless() {
            Termination::Optimal
        } else if self.work.is_spent() {
            Termination::BudgetSpent
        } else {
            Termination::Converged
        };
        Layout {
            name: "solver".to_owned(),
            positions: self.shape.positions(self.problem),
            evaluations: self.work.done,
            trace: self.trace,
            termination,
            aim: Aim::Frozen,
        }
    }
}
