//! Lengths and angles that give way to widths: no overlaps at the least energy, as far as that is found.
//!
//! **Input** a layout by its ratios, without crossings. **Output** one with fewer overlaps, at best none, or nothing.
//! **Steps** 1. Which pairs must part is decided by the layout at the start of a round. 2. Each such pair has a
//! barrier that begins at its distance or, if that is more, at the sum of its radii, and ends beyond: no pair gets
//! worse, all are pushed at once; so each pair has its own radius scale, which goes up from round to round. 3. Where
//! nothing overlaps any more, the energy is lowered under barriers that begin at full width. 4. Every layout is
//! counted by the definition before it counts.
//! **Guarantees** no crossings; never more overlaps than at the start.
//! **Source** ours. **Cost** rounds · iterations · O(N + pairs).

use glam::DVec2;

use super::overlap::Tubes;
use crate::params::SolverParams;
use crate::problem::Problem;
use crate::separation::{Separation, segment};
use crate::solver::barrier::{Bounds, Keep, Settings, Spacing, minimise_under};
use crate::solver::{Shape, Work};
use crate::{certify, widths};

/// The most rounds, and steps in each.
const ROUNDS: usize = 24;
const ITERATIONS: usize = 40;
/// It gives up after so many rounds without fewer overlaps.
const PATIENCE: usize = 6;
/// μ while tubes part, and then while the energy falls.
const PARTING: f64 = 0.1;
const SETTLING: [f64; 3] = [1e-2, 1e-3, 1e-4];
/// The barrier ends this many median edge lengths beyond the sum of the radii.
const REACH: f64 = 0.5;
/// A pair that is too near may come nearer by this share of its distance before it is pushed back.
const SLACK: f64 = 0.05;
/// Beyond the sum of the radii, so that touching tubes are apart after rounding too.
const APART: f64 = 1.0 + 1e-6;
/// Units of work that it may take, for each edge: as much as a start of the solver.
const WORK_PER_EDGE: u64 = 150_000;

/// A layout with fewer overlaps than this one, if there is one to be found.
pub(super) fn avoid(problem: &Problem, params: &SolverParams, start: &Shape) -> Option<Shape> {
    let separation = &Separation::new(problem, params.clearance);
    let mut work = Work::up_to((params.effort * (WORK_PER_EDGE * problem.n_nodes() as u64) as f64) as u64);
    let overlaps_of = |shape: &Shape| widths::measure(problem, &shape.positions(problem)).overlaps;
    let at_start = overlaps_of(start);
    let (mut best, mut fewest) = (start.clone(), at_start);
    let (mut shape, mut n_vain) = (start.clone(), 0);
    for _ in 0..ROUNDS {
        if fewest == 0 || n_vain == PATIENCE || work.is_spent() {
            break;
        }
        part(problem, separation, &mut shape, (PARTING, Keep::Last), &mut work);
        let overlaps = overlaps_of(&shape);
        n_vain = if overlaps < fewest { 0 } else { n_vain + 1 };
        if overlaps < fewest {
            (best, fewest) = (shape.clone(), overlaps);
        }
    }
    for strength in SETTLING {
        let mut settled = best.clone();
        part(problem, separation, &mut settled, (strength, Keep::LeastEnergy), &mut work);
        if overlaps_of(&settled) <= fewest {
            best = settled;
        }
    }
    let holds = certify::certify(problem.tree, &best.positions(problem)).holds();
    (holds && overlaps_of(&best) < at_start).then_some(best)
}

/// One descent under barriers about the tubes.
fn part(
    problem: &Problem,
    separation: &Separation,
    shape: &mut Shape,
    (strength, keep): (f64, Keep),
    work: &mut Work,
) {
    let positions = shape.positions(problem);
    let spacing = TubeSpacing {
        problem,
        separation,
        tubes: Tubes::new(problem, &positions),
        positions: &positions,
        reach_mm: (REACH * problem.scale_mm).max(1.5 * separation.clearance_mm),
    };
    let settings = Settings { reach_mm: spacing.reach_mm, strength, iterations: ITERATIONS };
    minimise_under(problem, separation, shape, (spacing, &settings, keep), work);
}

/// The rule of tubes that must part, and of centrelines for the others.
struct TubeSpacing<'a> {
    problem: &'a Problem<'a>,
    separation: &'a Separation,
    /// The layout at the start of the round.
    tubes: Tubes<'a>,
    positions: &'a [DVec2],
    reach_mm: f64,
}

impl Spacing for TubeSpacing<'_> {
    fn thickness_mm(&self, edge: usize) -> f64 {
        self.tubes.radius_mm(edge)
    }

    fn reach_mm(&self) -> f64 {
        self.reach_mm
    }

    fn floor_reach_mm(&self) -> f64 {
        let widest_mm = (1..self.problem.n_nodes()).map(|e| self.tubes.radius_mm(e)).fold(0.0, f64::max);
        let beyond_mm = 2.0 * (APART - 1.0) * widest_mm;
        self.separation.clearance_mm.max(self.separation.tolerance_mm()).max(beyond_mm)
    }

    fn halve_reach(&mut self) -> bool {
        false
    }

    fn bounds(&self, a: usize, b: usize) -> Option<Bounds> {
        let gap_mm = self.separation.paths.gap_mm(a, b);
        if gap_mm <= 0.0 {
            return None;
        }
        let places = [a, b].map(|edge| segment(self.problem, self.positions, edge));
        let distance_mm = espalier_geom::plane::segment_distance(&places[0], &places[1]);
        let (asked_mm, end_mm) = if self.tubes.must_part(a, b) {
            let full_mm = APART * (self.tubes.radius_mm(a) + self.tubes.radius_mm(b));
            (full_mm, full_mm + 0.9 * self.reach_mm)
        } else {
            let required_mm = self.separation.required_mm(a, b);
            (required_mm, self.reach_mm.min(0.5 * gap_mm).max(1.5 * required_mm))
        };
        let least_mm = self.separation.tolerance_mm().min(0.5 * distance_mm);
        let floor_mm = asked_mm.min((1.0 - SLACK) * distance_mm).max(least_mm);
        Some(Bounds { floor_mm, width_mm: end_mm - floor_mm })
    }
}
