//! The best direction of a part: a Fibonacci spiral, then a pattern search.
//!
//! **Input** an [`Objective`]. **Output** [`Best`]: the direction that minimises it, and the work done.
//! **Notation** n = `directions`; h the step of the pattern, radians.
//! **Steps** 1. Evaluate the seeds; unless one of them loses nothing, evaluate n directions of a Fibonacci spiral
//! over the half sphere. 2. Take the best, the next best at least one spiral spacing away from it, and so on,
//! `refine_starts` in all. 3. From each: try ±h along two axes of the tangent plane, the way of the last move first;
//! go to the first that is better, or else halve h; until h < `refine_step_rad`.
//! Where the objective asks for cells, the seeds see all edges, the rest of the search those gathered by direction;
//! then a paraboloid through six directions around the answer, seen by all edges, gives the last step.
//! **Guarantees** never worse than any seed, and without cells than any spiral direction; deterministic; ties go to the
//! lower index.
//! **Source** the argmin of [Hu2022] section 3.1.2; the spiral and the pattern search are textbook methods.
//! **Cost** 3 evaluations for a straight or planar part, else n + about 200 · `refine_starts`; with cells 11 of them by
//! all edges.

use std::f64::consts::{FRAC_PI_4, PI, TAU};

use espalier_geom::{math, space};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::objective::{LOSSLESS, Objective};
use crate::params::{Params, Search};
use crate::swarm;

/// The places of the stencil, in steps to the right and up.
const STENCIL: [[f64; 2]; 6] = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0], [1.0, 1.0]];
/// Moves of one pattern search: a bound for valleys that wind around the sphere, far above the usual 20.
const MAX_MOVES: u32 = 500;

/// The best direction found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Best {
    /// Unit vector towards the camera, its sign arbitrary.
    pub(crate) direction: DVec3,
    /// The objective there.
    pub(crate) value: f64,
    /// Evaluations of the objective spent.
    pub(crate) n_evaluations: u64,
}

/// The best direction, by the search that the parameters name.
pub(crate) fn best_direction(objective: &Objective, params: &Params, seed: u64) -> Best {
    match (params.search, objective.cells) {
        (Search::Fibonacci, None) => fibonacci(objective, params),
        (Search::Fibonacci, Some(n)) => gathered(objective, params, n),
        (Search::Pso, _) => swarm::fly(objective, params, seed),
    }
}

/// The search among gathered edges; its answer, one step from there and the seeds are then judged by all edges.
fn gathered(objective: &Objective, params: &Params, n_cells: usize) -> Best {
    let seeds = objective.seeds();
    let candidates = evaluated(objective, &seeds);
    if let Some(&best) = candidates.first().filter(|best| best.value <= LOSSLESS) {
        return Best { n_evaluations: candidates.len() as u64, ..best };
    }
    let few = objective.edges.gathered(n_cells);
    let rough = fibonacci(&Objective { edges: &few, cells: None, ..*objective }, params);
    let around = stencil(rough.direction, objective.reference.up, FRAC_PI_4 / n_cells as f64);
    let values = objective.at_each(&around);
    let exact: Vec<DVec3> = std::iter::once(around[0]).chain(lowest_point(&around, &values)).collect();
    let candidates = candidates.into_iter().chain(evaluated(objective, &exact));
    let best = candidates.reduce(|a, b| if b.value < a.value { b } else { a }).unwrap_or(rough);
    Best { n_evaluations: rough.n_evaluations + (seeds.len() + around.len() + exact.len()) as u64, ..best }
}

/// A direction, one to its right, left, top and bottom, and one between right and top, at `step_rad`.
fn stencil(center: DVec3, up_hint: DVec3, step_rad: f64) -> [DVec3; 6] {
    let (right, up) = space::plane_axes(center, up_hint);
    STENCIL.map(|[x, y]| (center + step_rad * (x * right + y * up)).normalize())
}

/// Where the paraboloid through the six values is lowest, no farther than the stencil; `None` if it has no bottom.
fn lowest_point(around: &[DVec3; 6], values: &[f64]) -> Option<DVec3> {
    let &[center, right, left, up, down, diagonal] = values else { return None };
    // In steps of the stencil: f = center + g · x + ½ xᵀ H x.
    let gradient = DVec2::new(0.5 * (right - left), 0.5 * (up - down));
    let (xx, yy) = (right + left - 2.0 * center, up + down - 2.0 * center);
    let xy = diagonal - center - gradient.x - gradient.y - 0.5 * (xx + yy);
    let determinant = xx * yy - xy * xy;
    if !(xx > 0.0 && determinant > 0.0) {
        return None;
    }
    let x = -DVec2::new(yy * gradient.x - xy * gradient.y, xx * gradient.y - xy * gradient.x) / determinant;
    let x = x.clamp_length_max(1.0);
    Some((around[0] + x.x * (around[1] - around[0]) + x.y * (around[3] - around[0])).normalize())
}

fn fibonacci(objective: &Objective, params: &Params) -> Best {
    // The seeds, one of which is the answer for straight and planar parts.
    let seeds = objective.seeds();
    let mut candidates = evaluated(objective, &seeds);
    if let Some(&best) = candidates.first().filter(|best| best.value <= LOSSLESS) {
        return Best { n_evaluations: candidates.len() as u64, ..best };
    }

    // The spiral.
    let spiral: Vec<DVec3> = space::half_sphere(params.directions as usize).collect();
    candidates.extend(evaluated(objective, &spiral));
    candidates.sort_by(|a, b| a.value.total_cmp(&b.value));
    // The refinement of the best ones that lie apart.
    let spacing_rad = (TAU / f64::from(params.directions)).sqrt();
    let mut starts: Vec<Best> = Vec::new();
    for candidate in &candidates {
        let lies_apart = |start: &Best| between_axes(start.direction, candidate.direction) >= spacing_rad;
        if starts.len() < params.refine_starts as usize && starts.iter().all(lies_apart) {
            starts.push(*candidate);
        }
    }
    let steps_rad = (0.5 * spacing_rad, params.refine_step_rad);
    let refined: Vec<Best> = starts.par_iter().map(|&start| refine(objective, start, steps_rad)).collect();
    let n_refining: u64 = refined.iter().map(|best| best.n_evaluations).sum();
    let best = refined.into_iter().fold(candidates[0], |a, b| if b.value < a.value { b } else { a });
    Best { n_evaluations: candidates.len() as u64 + n_refining, ..best }
}

/// The directions with their values, best first, the order among equals kept.
fn evaluated(objective: &Objective, directions: &[DVec3]) -> Vec<Best> {
    let values = objective.at_each(directions);
    let with_value = |(&direction, value)| Best { direction, value, n_evaluations: 0 };
    let mut list: Vec<Best> = directions.iter().zip(values).map(with_value).collect();
    list.sort_by(|a, b| a.value.total_cmp(&b.value));
    list
}

/// A pattern search on the tangent plane, with steps from the first to the second of `steps_rad`.
fn refine(objective: &Objective, start: Best, steps_rad: (f64, f64)) -> Best {
    let mut best = start;
    let (mut step_rad, last_step_rad) = steps_rad;
    let (mut way, mut n_moves) = (0, 0);
    while step_rad >= last_step_rad && n_moves < MAX_MOVES {
        let (right, up) = space::plane_axes(best.direction, objective.reference.up);
        let (sin, cos) = math::sin_cos(step_rad);
        // The way of the last move first, then to its sides, then back.
        let better = [0, 1, 3, 2].into_iter().find_map(|turn| {
            let axis = [right, up, -right, -up][(way + turn) % 4];
            let direction = (best.direction * cos + axis * sin).normalize();
            best.n_evaluations += 1;
            let value = objective.at(direction);
            (value < best.value).then_some((way + turn, direction, value))
        });
        if let Some((taken, direction, value)) = better {
            best = Best { direction, value, ..best };
            (way, n_moves) = (taken % 4, n_moves + 1);
        } else {
            step_rad *= 0.5;
        }
    }
    best
}

/// The angle between two lines through the origin, in [0, π/2].
fn between_axes(a: DVec3, b: DVec3) -> f64 {
    let angle = espalier_geom::angle::between(a, b);
    angle.min(PI - angle)
}
