//! All ratios at once: the energy under a barrier that keeps edges apart.
//!
//! | file | what |
//! |---|---|
//! | `contact` | the distance of two edges, and b(u) |
//! | `pairs` | which edges may be near each other |
//! | `field` | E + μ Σ b, its gradient and curvature |
//! | `memory` | directions from the last steps |
//! | `descend` | the descent |
//!
//! **Input** a layout without crossings. **Output** one without crossings, whose energy is no higher.
//! **Notation** d the distance of two edges, gap the path between them along the tree, d̂ the reach, μ the strength.
//! **Definition** minimise E + μ Σ b((d − c) / (d_ef − c)), b(u) = −(u − 1)² ln u for u < 1, over the pairs of edges
//! without a common node; d_ef = min(d̂, gap / 2), and c is the clearance that `separation` asks for, 0 for pairs
//! that were nearer at the start. Edges may pass through each other in a step: only where it ends counts.
//! **Source** ours; E is Eq. 4 of [Hu2022] with the placement term.
//! **Cost** O(N + pairs) for an evaluation.

#[cfg(test)]
mod checks;
mod contact;
mod descend;
mod field;
mod memory;
mod pairs;

use glam::DVec2;

use super::shape::Shape;
use super::work::Work;
use crate::problem::Problem;
use crate::separation::Separation;
use descend::{Limits, descend};
use field::Field;
use pairs::{Pair, PairList};

pub(crate) use descend::{Keep, Outcome};
pub(crate) use pairs::{Bounds, Spacing};

/// One run of the descent.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// d̂, in mm.
    pub(crate) reach_mm: f64,
    /// μ.
    pub(crate) strength: f64,
    /// The most steps.
    pub(crate) iterations: usize,
}

/// The runs that follow each other: d̂ in median edge lengths, and μ.
const CONTINUATION: [(f64, f64); 6] =
    [(3.0, 1e-2), (3.0, 1e-3), (1.0, 1e-2), (1.0, 1e-3), (0.3, 1e-2), (0.3, 1e-3)];
/// How many of them only the first relaxing of a layout needs.
const FIRST_ONLY: usize = 3;
/// The most steps of each.
const ITERATIONS: usize = 60;

/// Lowers the energy of a layout, first with a wide barrier, then with narrower ones; a layout that has been through
/// this before needs the wide ones no more.
pub(crate) fn relax(
    problem: &Problem,
    separation: &Separation,
    shape: &mut Shape,
    (is_first, work): (bool, &mut Work),
) -> Outcome {
    let mut whole = Outcome::default();
    let runs = if is_first { &CONTINUATION[..] } else { &CONTINUATION[FIRST_ONLY..] };
    for (idx, &(reach, strength)) in runs.iter().enumerate() {
        let settings = Settings { reach_mm: reach * problem.scale_mm, strength, iterations: ITERATIONS };
        let part = minimise(problem, separation, shape, (&settings, work));
        if idx == 0 {
            whole.loss_before = part.loss_before;
        }
        whole.loss_after = part.loss_after;
        whole.iterations += part.iterations;
        whole.evaluations += part.evaluations;
        whole.pairs = part.pairs;
    }
    whole
}

/// Lowers the energy of a layout under one barrier. A layout in which edges meet stays as it is.
pub(crate) fn minimise(
    problem: &Problem,
    separation: &Separation,
    shape: &mut Shape,
    (settings, work): (&Settings, &mut Work),
) -> Outcome {
    let near = too_near(problem, separation, &shape.positions(problem), work);
    let spacing = Clearance { separation, reach_mm: settings.reach_mm, near };
    minimise_under(problem, separation, shape, (spacing, settings, Keep::LeastEnergy), work)
}

/// The same under any rule of what pairs of edges have to keep.
pub(crate) fn minimise_under<S: Spacing>(
    problem: &Problem,
    separation: &Separation,
    shape: &mut Shape,
    (spacing, settings, keep): (S, &Settings, Keep),
    work: &mut Work,
) -> Outcome {
    let mut x: Vec<f64> = shape.length_ratio.iter().chain(&shape.angle_ratio).copied().collect();
    let mut field = Field::new(problem, &separation.paths, spacing, settings.strength);
    let limits = Limits::new(&field);
    let outcome = descend(&mut field, &mut x, (&limits, settings.iterations, keep), work);
    let n_lengths = shape.length_ratio.len();
    shape.length_ratio.copy_from_slice(&x[..n_lengths]);
    shape.angle_ratio.copy_from_slice(&x[n_lengths..]);
    outcome
}

/// The pairs that are nearer than the clearance.
fn too_near(
    problem: &Problem,
    separation: &Separation,
    positions: &[DVec2],
    work: &mut Work,
) -> Vec<(u32, u32)> {
    let mut spacing = Clearance { separation, reach_mm: 0.0, near: Vec::new() };
    let mut list = PairList::new(problem);
    list.rebuild(problem, &mut spacing, positions, work);
    let is_near =
        |pair: &&Pair| separation.too_near(problem, positions, pair.first as usize, pair.second as usize);
    let mut near: Vec<_> = list.pairs.iter().filter(is_near).map(|pair| (pair.first, pair.second)).collect();
    near.sort_unstable();
    near
}

/// The rule of a layout of centrelines.
struct Clearance<'a> {
    separation: &'a Separation,
    reach_mm: f64,
    /// Pairs that are nearer than the clearance at the start, in order.
    near: Vec<(u32, u32)>,
}

/// The barrier ends at least at this multiple of the clearance.
const WIDEST_FLOOR: f64 = 1.5;

impl Spacing for Clearance<'_> {
    fn thickness_mm(&self, _edge: usize) -> f64 {
        0.0
    }

    fn reach_mm(&self) -> f64 {
        self.reach_mm.max(WIDEST_FLOOR * self.floor_reach_mm())
    }

    fn floor_reach_mm(&self) -> f64 {
        self.separation.clearance_mm.max(self.separation.tolerance_mm())
    }

    fn halve_reach(&mut self) -> bool {
        self.reach_mm *= 0.5;
        self.reach_mm >= WIDEST_FLOOR * self.floor_reach_mm()
    }

    fn bounds(&self, a: usize, b: usize) -> Option<Bounds> {
        let gap_mm = self.separation.paths.gap_mm(a, b);
        if gap_mm <= 0.0 {
            return None;
        }
        let required_mm = self.separation.required_mm(a, b);
        let end_mm = self.reach_mm.min(0.5 * gap_mm).max(WIDEST_FLOOR * required_mm);
        let is_near = self.near.binary_search(&(a as u32, b as u32)).is_ok();
        let floor_mm = if is_near { self.separation.tolerance_mm().min(0.5 * end_mm) } else { required_mm };
        Some(Bounds { floor_mm, width_mm: end_mm - floor_mm })
    }
}
