//! Simulated annealing over sides.
//!
//! **Input** a state, the plan of a phase. **Output** the best state seen.
//! **Steps** the threshold of the Metropolis rule is drawn before a move is evaluated, so that the evaluation can stop
//! as soon as the move is too dear. The temperature falls geometrically with the work done.
//! **Guarantees** never worse than the start; the same for the same stream.
//! **Source** [Kirkpatrick1983] for the method.

use espalier_geom::math;
use espalier_geom::random::Stream;

use super::moves::Mover;
use super::state::{Saved, State};
use super::step::{Prices, Step, Terms};

/// The temperature is set anew after this many evaluations.
const STRIDE: u64 = 64;
/// An evaluation may look at this many pairs of blocks on average; then the phase runs through faster. More take longer
/// where crossings stay: the walks of an airway of 4099 nodes 7 s of CPU at 300, 12 s at 600. What they lead to differs
/// by chance: at 300, 400, 450, 500 and 600 that airway ends at the energy 20, 21, 20, 21, 22 and a neuron of 4465 nodes
/// at 27, 22, 34, 30, 21.
const VISITS_PER_EVALUATION: f64 = 400.0;

/// What a phase does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Phase {
    pub(super) hottest: f64,
    pub(super) coldest: f64,
    pub(super) prices: Prices,
    pub(super) n_evaluations: f64,
}

/// A walk over sides.
#[derive(Clone)]
pub(super) struct Walker<'s> {
    pub(super) state: State<'s>,
    pub(super) mover: Mover,
    judge: Prices,
    pub(super) best: Saved,
    pub(super) best_terms: Terms,
    pub(super) n_evaluations: u64,
}

impl<'s> Walker<'s> {
    /// At the given state; `judge` are the prices by which states without a crossing more or less are compared.
    pub(super) fn new(state: State<'s>, judge: Prices) -> Self {
        let (best, best_terms) = (state.save(), state.terms());
        Self { state, mover: Mover::default(), judge, best, best_terms, n_evaluations: 0 }
    }

    /// The order of states: crossings, then cost.
    pub(super) fn is_better(&self, terms: &Terms, than: &Terms) -> bool {
        let by_cost = || self.judge.cost(terms) < self.judge.cost(than);
        terms.crossings < than.crossings || terms.crossings == than.crossings && by_cost()
    }

    /// Whether nothing crosses in the best state.
    pub(super) fn is_solved(&self) -> bool {
        self.best_terms.crossings + self.best_terms.kept_out == 0
    }

    /// The turns of the best state, and the number of its zigzags.
    pub(super) fn best_turns(&mut self) -> (Vec<f64>, usize) {
        self.state.restore(&self.best);
        self.best_terms = self.state.terms();
        (self.state.turns(), self.state.n_zigzags())
    }

    /// Walks on from the best state.
    pub(super) fn anneal(&mut self, phase: &Phase, mut stream: Stream) {
        self.state.restore(&self.best);
        let (mut step, mut best_is_here) = (Step::default(), false);
        let begun = (self.n_evaluations, self.n_visits());
        while let Some(temperature) = self.temperature(phase, begun) {
            for _ in 0..STRIDE {
                self.try_step((&mut step, &mut best_is_here), (&phase.prices, temperature), &mut stream);
            }
        }
        if best_is_here {
            self.best = self.state.save();
        }
    }

    /// The temperature of a phase that began at given counts of evaluations and visits; none when it is over.
    pub(super) fn temperature(&self, phase: &Phase, (n_before, n_visits_before): (u64, u64)) -> Option<f64> {
        let share_evaluated = (self.n_evaluations - n_before) as f64 / phase.n_evaluations;
        let n_visits = (self.n_visits() - n_visits_before) as f64;
        let share = share_evaluated.max(n_visits / (phase.n_evaluations * VISITS_PER_EVALUATION));
        (share < 1.0).then(|| phase.hottest * math::pow(phase.coldest / phase.hottest, share))
    }

    /// One evaluation. The best state is saved only when it is left, for better ones follow each other.
    fn try_step(
        &mut self,
        (step, best_is_here): (&mut Step, &mut bool),
        (prices, temperature): (&Prices, f64),
        stream: &mut Stream,
    ) {
        self.n_evaluations += 1;
        if !self.mover.propose(&self.state, stream, step) {
            return;
        }
        let limit = -temperature * math::ln(1.0 - stream.unit());
        if self.state.evaluate(step, prices, limit).is_none() {
            return;
        }
        if *best_is_here {
            self.best = self.state.save();
        }
        self.state.take(step);
        let terms = self.state.terms();
        *best_is_here = self.is_better(&terms, &self.best_terms);
        if *best_is_here {
            self.best_terms = terms;
        }
    }

    /// Pairs of blocks looked at.
    pub(super) fn n_visits(&self) -> u64 {
        self.state.walk.n_visits
    }
}
