//! The descent: L-BFGS with bounds, whose trial steps may not end in a crossing.
//!
//! **Input** ratios x without crossings, the field. **Output** ratios without crossings, of no higher energy.
//! **Steps** 1. Ratios at a bound that push outwards, and pinned ones, are held. 2. Direction by the last ten
//! steps and the diagonal of the curvature. 3. Try the step, cut at the bounds. Where edges meet, only the ratios
//! on the tree paths between them move less. 4. If the total falls too little, all move less. 5. Of all that was
//! accepted, the one with the least energy is kept, or the last one.
//! **Guarantees** the kept ratios have no edges that meet. Under `LeastEnergy` their energy is at most that of the
//! start.
//! **Cost** iterations · (evaluations per step, mostly 1–2) · O(N + pairs).

use super::super::work::Work;
use super::field::{Field, Value};
use super::memory::{Memory, dot};
use super::pairs::Spacing;
use crate::ratio;

/// Armijo's share of the expected decrease.
const LEAST_DECREASE: f64 = 1e-4;
/// How often one step is tried.
const MOST_TRIALS: usize = 16;
/// From this trial on everything moves less where edges meet, not only what is on their paths.
const PATHS_ONLY: usize = 10;
/// What is left of a ratio's step when edges met that it moves against each other; from the third trial on its
/// square. The next step begins whole: where ratios had to recover over several steps, five trees ended at 2 to 9
/// times the energy.
const SHRINK: f64 = 0.5;
/// No ratio moves by more than this in one step.
const LONGEST_STEP: f64 = 0.3;
/// The diagonal is made anew after so many steps.
const DIAGONAL_EVERY: usize = 5;
/// It ends when ten steps together lower the total by less than this share.
const LEAST_GAIN: f64 = 1e-4;

/// What was done.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Outcome {
    /// E at the start.
    pub(crate) loss_before: f64,
    /// E of what is returned.
    pub(crate) loss_after: f64,
    /// Steps taken.
    pub(crate) iterations: usize,
    /// Evaluations of the energy.
    pub(crate) evaluations: u64,
    /// Pairs of edges in the last list.
    pub(crate) pairs: usize,
}

/// What a descent returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// Of all steps that with the least energy, the barrier left out.
    LeastEnergy,
    /// The last step: the least energy with the barrier.
    Last,
}

/// How ratios are held.
pub(super) struct Limits {
    /// Least and largest value of each ratio.
    pub(super) range: Vec<(f64, f64)>,
    /// Whether it may move at all.
    pub(super) is_free: Vec<bool>,
}

impl Limits {
    /// Of all ratios of a problem.
    pub(super) fn new<S: Spacing>(field: &Field<S>) -> Self {
        let (n_lengths, n_nodes) = (field.n_lengths(), field.problem.n_nodes());
        let mut range = vec![ratio::LENGTH_RANGE; n_lengths];
        // Children of the root have no edge onto which they could be folded.
        let (low, high) = ratio::ANGLE_RANGE;
        let parent = &field.problem.parent;
        range.extend((0..n_nodes).map(|node| (if parent[node] == 0 { -1.0 } else { low }, high)));
        let is_free = field.problem.free_length.iter().chain(&field.problem.free_angle).copied().collect();
        Self { range, is_free }
    }
}

struct State {
    x: Vec<f64>,
    value: Value,
    gradient: Vec<f64>,
    direction: Vec<f64>,
    diagonal: Vec<f64>,
    is_moving: Vec<bool>,
    memory: Memory,
}

/// Lowers the energy with its barrier from `x`, where no edges meet, and leaves there what had the least energy.
pub(super) fn descend<S: Spacing>(
    field: &mut Field<S>,
    x: &mut [f64],
    (limits, iterations, keep): (&Limits, usize, Keep),
    work: &mut Work,
) -> Outcome {
    let mut value = field.value(x, work);
    let loss = if value.total.is_finite() { value.loss } else { field.loss(x) };
    let mut outcome = Outcome { loss_before: loss, loss_after: loss, evaluations: 1, ..Outcome::default() };
    if !value.total.is_finite() {
        return outcome;
    }
    let dims = x.len();
    let mut state = State {
        x: x.to_vec(),
        value,
        gradient: vec![0.0; dims],
        direction: vec![0.0; dims],
        diagonal: vec![1.0; dims],
        is_moving: limits.is_free.clone(),
        memory: Memory::default(),
    };
    let (mut trial, mut share) = (x.to_vec(), vec![1.0; dims]);
    let (mut last_gradient, mut on_path) = (vec![0.0; dims], vec![0; field.problem.n_nodes()]);
    field.gradient(&state.x, &mut state.gradient);
    let mut landmark = value.total;
    while outcome.iterations < iterations && !work.is_spent() {
        if outcome.iterations.is_multiple_of(DIAGONAL_EVERY) {
            field.curvature(&state.x, &mut state.diagonal);
            raise_floor(&mut state.diagonal, &limits.is_free);
        }
        hold_at_bounds(&mut state, limits);
        if !find_direction(&mut state) {
            break;
        }
        let buffers = (&mut trial[..], &mut share[..], &mut on_path[..]);
        match try_step(field, &state, limits, buffers, work) {
            Some(accepted) => value = accepted,
            None if state.memory.is_empty() => break,
            None => {
                state.memory.clear();
                // The field has seen other places since.
                field.value(&state.x, work);
                field.gradient(&state.x, &mut state.gradient);
                continue;
            }
        }
        std::mem::swap(&mut last_gradient, &mut state.gradient);
        field.gradient(&trial, &mut state.gradient);
        state.memory.keep((&state.x, &trial), (&last_gradient, &state.gradient));
        state.x.copy_from_slice(&trial);
        state.value = value;
        outcome.iterations += 1;
        if keep == Keep::Last || value.loss < outcome.loss_after {
            outcome.loss_after = value.loss;
            x.copy_from_slice(&state.x);
        }
        if outcome.iterations.is_multiple_of(10) {
            if landmark - value.total < LEAST_GAIN * landmark {
                break;
            }
            landmark = value.total;
        }
    }
    outcome.evaluations = field.n_evaluations;
    outcome.pairs = field.n_pairs();
    outcome
}

/// Ratios that cost nothing and touch nothing have no curvature; they get a hundredth of the mean.
fn raise_floor(diagonal: &mut [f64], is_free: &[bool]) {
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for (&h, _) in diagonal.iter().zip(is_free).filter(|(_, is_free)| **is_free) {
        sum += h;
        count += 1.0;
    }
    let floor = (0.01 * sum / count.max(1.0)).max(f64::MIN_POSITIVE);
    diagonal.iter_mut().for_each(|h| *h = h.max(floor));
}

fn hold_at_bounds(state: &mut State, limits: &Limits) {
    for (dim, &(low, high)) in limits.range.iter().enumerate() {
        let (x, slope) = (state.x[dim], state.gradient[dim]);
        let is_held = (x <= low && slope > 0.0) || (x >= high && slope < 0.0);
        state.is_moving[dim] = limits.is_free[dim] && !is_held;
    }
}

/// A direction along which the total falls; false if there is none.
fn find_direction(state: &mut State) -> bool {
    loop {
        let State { gradient, diagonal, is_moving, direction, memory, .. } = state;
        memory.direction((gradient, diagonal), is_moving, direction);
        if dot(direction, gradient) < 0.0 {
            return true;
        }
        if memory.is_empty() {
            return false;
        }
        memory.clear();
    }
}

/// A step to `trial` that ends without crossings and lower; none if there is none along this direction.
fn try_step<S: Spacing>(
    field: &mut Field<S>,
    state: &State,
    limits: &Limits,
    (trial, share, on_path): (&mut [f64], &mut [f64], &mut [i32]),
    work: &mut Work,
) -> Option<Value> {
    let n_lengths = field.n_lengths();
    share.fill(1.0);
    let mut whole = 1.0;
    for attempt in 0..MOST_TRIALS {
        let mut expected = 0.0;
        for (dim, &(low, high)) in limits.range.iter().enumerate() {
            let step = (state.direction[dim] * share[dim] * whole).clamp(-LONGEST_STEP, LONGEST_STEP);
            trial[dim] = (state.x[dim] + step).clamp(low, high);
            expected += state.gradient[dim] * (trial[dim] - state.x[dim]);
        }
        if expected >= 0.0 {
            return None;
        }
        let value = field.value(trial, work);
        if field.met.is_empty() {
            if value.total <= state.value.total + LEAST_DECREASE * expected {
                return Some(value);
            }
            whole *= 0.4;
        } else if attempt >= PATHS_ONLY {
            whole *= 0.2;
        } else {
            let shrink = if attempt < 2 { SHRINK } else { SHRINK * SHRINK };
            field.mark_paths(on_path);
            for node in (1..on_path.len()).filter(|&node| on_path[node] > 0) {
                share[n_lengths + node] *= shrink;
            }
            shrink_lengths(field, on_path, (share, shrink));
        }
    }
    None
}

/// Segments with a node on a path move less, each once.
fn shrink_lengths<S: Spacing>(field: &Field<S>, on_path: &[i32], (share, shrink): (&mut [f64], f64)) {
    for (segment, branch) in field.problem.branches.list().iter().enumerate() {
        if on_path[branch.nodes.clone()].iter().any(|&count| count > 0) {
            share[segment] *= shrink;
        }
    }
}
