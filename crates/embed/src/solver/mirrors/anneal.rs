//! Simulated annealing over sides.
//!
//! **Input** a state, the plan of a phase. **Output** the best state seen.
//! **Steps** the threshold of the Metropolis rule is drawn before a move is evaluated, so that the evaluation can stop
//! as soon as the move is too dear. The temperature falls geometrically.
//! **Guarantees** never worse than the start; the same for the same stream.
//! **Source** [Kirkpatrick1983] for the method.

use espalier_geom::math;
use espalier_geom::random::Stream;

use super::moves::{Boldness, Mover};
use super::state::{Prices, Saved, State, Step, Terms};

/// What a phase does.
#[derive(Clone, Copy, Debug)]
pub(super) struct Phase {
    pub(super) boldness: Boldness,
    pub(super) hottest: f64,
    pub(super) coldest: f64,
    pub(super) prices: Prices,
    pub(super) n_evaluations: u64,
    /// Whether it ends as soon as nothing crosses.
    pub(super) ends_at_zero: bool,
}

/// A walk over sides.
#[derive(Clone)]
pub(super) struct Walker<'s> {
    state: State<'s>,
    mover: Mover,
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
        let mut step = Step::default();
        let mut best_is_here = false;
        let n_evaluations = phase.n_evaluations.max(1);
        let cooling = math::pow(phase.coldest / phase.hottest, 1.0 / n_evaluations as f64);
        let mut temperature = phase.hottest;
        for _ in 0..n_evaluations {
            if phase.ends_at_zero && self.is_solved() {
                break;
            }
            self.n_evaluations += 1;
            temperature *= cooling;
            if !self.mover.propose(&self.state, &mut stream, phase.boldness, &mut step) {
                continue;
            }
            let limit = -temperature * math::ln(1.0 - stream.unit());
            if self.state.evaluate(&step, &phase.prices, limit).is_none() {
                continue;
            }
            if best_is_here {
                self.best = self.state.save();
            }
            self.state.take(&step);
            let terms = self.state.terms();
            best_is_here = self.is_better(&terms, &self.best_terms);
            if best_is_here {
                self.best_terms = terms;
            }
        }
        if best_is_here {
            self.best = self.state.save();
        }
    }

    /// Pairs of blocks looked at.
    pub(super) fn n_visits(&self) -> u64 {
        self.state.walk.n_visits
    }
}
