//! Where the particles of a swarm start.
//!
//! **Input** the problem and its crossing-free layouts as particles. **Output** ratios and velocities of n
//! particles, shape (n, dims).
//! **Steps** `paper`: P_0 = 0, P_1 = radial, the rest and all velocities uniform over the ranges.
//! `relaxed`: P_0 = 0, P_1 = radial, P_2 = cone. The next few *relax* the cone: they visit the segments in an
//! order of their own and put each segment's ratios to zero, or half way, where no crossing appears. The rest
//! blend the cone towards zero by a factor of their own, with other factors in random subtrees.
//! Why not the paper's start? On a tree of a few hundred segments every random particle crosses itself hundreds of
//! times, and a small swarm never gets out of that.
//! **Guarantees** numbers depend on (seed, particle) only. **Cost** relaxing takes at most a quarter of the swarm's
//! evaluations.

use espalier_geom::random::{Purpose, Stream};
use rayon::prelude::*;

use crate::batch::{CpuEnergy, DofMap, Scratch};
use crate::params::{Params, Start};
use crate::problem::Problem;

/// Feasible starts as particles.
pub(crate) struct Incumbents {
    pub(crate) radial: Vec<f64>,
    pub(crate) cone: Vec<f64>,
}

/// A swarm before its first iteration.
pub(crate) struct Swarm {
    /// Ratios, shape (n, dims).
    pub(crate) ratios: Vec<f64>,
    /// Velocities, shape (n, dims).
    pub(crate) velocities: Vec<f64>,
    /// Evaluations spent on the start.
    pub(crate) evaluations: u64,
}

/// The swarm's start.
pub(crate) fn start(energy: &CpuEnergy, incumbents: &Incumbents, params: &Params, seed: u64) -> Swarm {
    match params.start {
        Start::Paper => paper(energy.dofs, incumbents, params, seed),
        Start::Relaxed => relaxed(energy, incumbents, params, seed),
    }
}

fn paper(dofs: &DofMap, incumbents: &Incumbents, params: &Params, seed: u64) -> Swarm {
    let dims = dofs.dims();
    let mut ratios = vec![0.0; params.particles as usize * dims];
    let mut velocities = vec![0.0; ratios.len()];
    ratios.par_chunks_mut(dims).zip(velocities.par_chunks_mut(dims)).enumerate().for_each(
        |(particle, (ratios, velocities))| {
            let mut stream = Stream::new(seed, Purpose::SwarmStart, particle as u32, 0);
            for (dim, (ratio, velocity)) in ratios.iter_mut().zip(velocities).enumerate() {
                let (low, high) = dofs.range(dim);
                *ratio = stream.uniform(low, high);
                *velocity = stream.uniform(-1.0, 1.0);
            }
        },
    );
    ratios[..dims].fill(0.0);
    ratios[dims..2 * dims].copy_from_slice(&incumbents.radial);
    Swarm { ratios, velocities, evaluations: 0 }
}

fn relaxed(energy: &CpuEnergy, incumbents: &Incumbents, params: &Params, seed: u64) -> Swarm {
    let (problem, dofs) = (energy.problem, energy.dofs);
    let dims = dofs.dims();
    let n_relaxed = n_relaxed(problem, params);
    let mut ratios = vec![0.0; params.particles as usize * dims];
    let evaluations: Vec<u64> = ratios
        .par_chunks_mut(dims)
        .enumerate()
        .map(|(particle, ratios)| {
            let mut stream = Stream::new(seed, Purpose::SwarmStart, particle as u32, 0);
            match particle {
                0 => return 0,
                1 => ratios.copy_from_slice(&incumbents.radial),
                2 => ratios.copy_from_slice(&incumbents.cone),
                _ if particle < 3 + n_relaxed => {
                    ratios.copy_from_slice(&incumbents.cone);
                    return relax(energy, ratios, particle - 3, &mut stream);
                }
                _ => blend(problem, dofs, &incumbents.cone, ratios, &mut stream),
            }
            0
        })
        .collect();
    Swarm { velocities: vec![0.0; ratios.len()], ratios, evaluations: evaluations.iter().sum() }
}

/// How many particles can relax within a quarter of the swarm's evaluations.
fn n_relaxed(problem: &Problem, params: &Params) -> usize {
    let budget = u64::from(params.particles) * u64::from(params.iterations) / 4;
    let each = 2 * problem.branches.list().len() as u64;
    (budget / each.max(1)).min(u64::from(params.particles) - 3) as usize
}

/// Puts the ratios of one segment after the other to zero, or half way, where that is free of crossings.
fn relax(energy: &CpuEnergy, ratios: &mut [f64], rank: usize, stream: &mut Stream) -> u64 {
    let (problem, dofs) = (energy.problem, energy.dofs);
    let mut order: Vec<usize> = (0..problem.branches.list().len()).collect();
    match rank {
        0 => order.reverse(),
        1 => {}
        _ => shuffle(&mut order, stream),
    }
    let mut scratch = Scratch::default();
    let mut evaluations = 0;
    let mut kept: Vec<f64> = Vec::new();
    for segment in order {
        let dims = segment_angles(problem, dofs, segment);
        kept.clear();
        kept.extend_from_slice(&ratios[dims.clone()]);
        if kept.iter().all(|&ratio| ratio == 0.0) {
            continue;
        }
        for share in [0.0, 0.5] {
            for (ratio, old) in ratios[dims.clone()].iter_mut().zip(&kept) {
                *ratio = share * old;
            }
            evaluations += 1;
            // Below the price of one crossing there is none.
            if energy.evaluate_one(ratios, problem.crossing_weight, &mut scratch).is_some() {
                break;
            }
            ratios[dims.clone()].copy_from_slice(&kept);
        }
    }
    evaluations
}

fn shuffle(order: &mut [usize], stream: &mut Stream) {
    for idx in (1..order.len()).rev() {
        order.swap(idx, stream.below(idx as u32 + 1) as usize);
    }
}

/// The angle ratios of one segment, as a range of a particle.
fn segment_angles(problem: &Problem, dofs: &DofMap, segment: usize) -> std::ops::Range<usize> {
    let nodes = &problem.branches.list()[segment].nodes;
    dofs.angle[nodes.start] as usize..dofs.angle[nodes.end - 1] as usize + 1
}

/// The cone times a factor, with other factors in random subtrees.
fn blend(problem: &Problem, dofs: &DofMap, cone: &[f64], ratios: &mut [f64], stream: &mut Stream) {
    let n_segments = problem.branches.list().len();
    let mut factor = vec![stream.unit(); n_segments];
    for _ in 0..1 + stream.below(2 + n_segments as u32 / 8) {
        let top = stream.below(n_segments as u32) as usize;
        let value = stream.unit();
        factor[segments_below(problem, top)].fill(value);
    }
    ratios.copy_from_slice(cone);
    for (segment, factor) in factor.into_iter().enumerate() {
        for ratio in &mut ratios[segment_angles(problem, dofs, segment)] {
            *ratio *= factor;
        }
    }
}

/// The segments of the subtree that starts with a segment, itself among them.
pub(crate) fn segments_below(problem: &Problem, segment: usize) -> std::ops::Range<usize> {
    let first = problem.branches.list()[segment].nodes.start;
    let last = problem.tree.subtree(first).end - 1;
    segment..problem.branch[last] as usize + 1
}
