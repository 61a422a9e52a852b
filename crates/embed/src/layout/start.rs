//! Where the particles of a swarm start.
//!
//! **Input** the problem and its crossing-free layouts as particles. **Output** ratios and velocities of n
//! particles, shape (n, dims).
//! **Steps** `paper`: P_0 = 0, P_1 = radial, the rest and all velocities uniform over the ranges.
//! `relaxed`: P_0 = 0, P_1 = radial, P_2 = cone. The next few *relax* the cone: they visit the segments again and
//! again, in an order of their own, and bring each segment's angle ratios as near to zero as is free of crossings.
//! The rest are copies of these with a few subtrees sent part of the way back to the cone.
//! Why not the paper's start? On a tree of a few hundred segments every random particle crosses itself hundreds
//! of times: on a vessel phantom of 1076 nodes 512 particles in 60 iterations came from 425 (the radial particle)
//! to 265 with freedom `n`, and nowhere with `s`; relaxing alone ends at 74.7.
//! **Guarantees** numbers depend on (seed, particle) only.
//! **Cost** relaxing takes half as many evaluations as the iterations, at most.

use espalier_geom::random::{Purpose, Stream};
use rayon::prelude::*;

use crate::batch::{CpuEnergy, DofMap, Scratch};
use crate::choices::Start;
use crate::params::PsoParams;
use crate::problem::Problem;

/// Relaxing may take the swarm's evaluations divided by this.
const RELAXING_SHARE: u64 = 2;
/// What counts as enough evaluations for one relaxing particle, in segments.
const SWEEPS: u64 = 12;
/// What is tried for the ratios of a segment, as shares of what they are.
const SHARES: [f64; 4] = [0.0, 0.3, 0.6, 0.85];

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
pub(crate) fn start(energy: &CpuEnergy, incumbents: &Incumbents, params: &PsoParams, seed: u64) -> Swarm {
    match params.start {
        Start::Paper => paper(energy.dofs, incumbents, params, seed),
        Start::Relaxed => relaxed(energy, incumbents, params, seed),
    }
}

fn paper(dofs: &DofMap, incumbents: &Incumbents, params: &PsoParams, seed: u64) -> Swarm {
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

fn relaxed(energy: &CpuEnergy, incumbents: &Incumbents, params: &PsoParams, seed: u64) -> Swarm {
    let dims = energy.dofs.dims();
    let stream = |particle: usize| Stream::new(seed, Purpose::SwarmStart, particle as u32, 0);
    let mut ratios = vec![0.0; params.particles as usize * dims];
    ratios[dims..2 * dims].copy_from_slice(&incumbents.radial);
    ratios[2 * dims..3 * dims].copy_from_slice(&incumbents.cone);

    let (n_relaxed, budget) = relaxing_work(energy.problem, params);
    let (relaxed, others) = ratios[3 * dims..].split_at_mut(n_relaxed * dims);
    let evaluations: Vec<u64> = relaxed
        .par_chunks_mut(dims)
        .enumerate()
        .map(|(rank, ratios)| {
            ratios.copy_from_slice(&incumbents.cone);
            relax(energy, ratios, budget, &mut stream(3 + rank))
        })
        .collect();
    others.par_chunks_mut(dims).enumerate().for_each(|(rank, ratios)| {
        let like = rank % n_relaxed * dims..(rank % n_relaxed + 1) * dims;
        ratios.copy_from_slice(&relaxed[like]);
        blend(energy.problem, energy.dofs, &incumbents.cone, ratios, &mut stream(3 + n_relaxed + rank));
    });
    Swarm { velocities: vec![0.0; ratios.len()], ratios, evaluations: evaluations.iter().sum() }
}

/// A swarm around particles that were found, the first of which is the best: they, and copies of the best with a few
/// subtrees sent part of the way to another.
pub(crate) fn around(energy: &CpuEnergy, found: &[Vec<f64>], params: &PsoParams, seed: u64) -> Swarm {
    let dims = energy.dofs.dims();
    let mut ratios: Vec<f64> = found.concat();
    ratios.resize(params.particles as usize * dims, 0.0);
    let others = &mut ratios[found.len() * dims..];
    others.par_chunks_mut(dims).enumerate().for_each(|(rank, ratios)| {
        let mut stream = Stream::new(seed, Purpose::SwarmStart, (found.len() + rank) as u32, 1);
        ratios.copy_from_slice(&found[0]);
        let other = stream.below(found.len() as u32) as usize;
        blend(energy.problem, energy.dofs, &found[other], ratios, &mut stream);
    });
    Swarm { velocities: vec![0.0; ratios.len()], ratios, evaluations: 0 }
}

/// How many particles relax, and how many evaluations each may take.
fn relaxing_work(problem: &Problem, params: &PsoParams) -> (usize, u64) {
    let total = u64::from(params.particles) * u64::from(params.iterations) / RELAXING_SHARE;
    let enough = SWEEPS * problem.branches.list().len() as u64;
    let n_relaxed = (total / enough.max(1)).clamp(2, 16).min(u64::from(params.particles) - 3);
    (n_relaxed as usize, total / n_relaxed.max(1))
}

/// Puts the ratios of one segment after the other nearer to zero, as far as that is free of crossings.
fn relax(energy: &CpuEnergy, ratios: &mut [f64], budget: u64, stream: &mut Stream) -> u64 {
    let (problem, dofs) = (energy.problem, energy.dofs);
    let mut order: Vec<usize> = (0..problem.branches.list().len()).collect();
    let mut scratch = Scratch::default();
    let (mut evaluations, mut is_moving) = (0, true);
    let mut kept: Vec<f64> = Vec::new();
    while is_moving {
        is_moving = false;
        shuffle(&mut order, stream);
        for &segment in &order {
            let dims = segment_angles(problem, dofs, segment);
            kept.clear();
            kept.extend_from_slice(&ratios[dims.clone()]);
            if kept.iter().all(|&ratio| ratio == 0.0) {
                continue;
            }
            for share in SHARES {
                if evaluations == budget {
                    return evaluations;
                }
                for (ratio, old) in ratios[dims.clone()].iter_mut().zip(&kept) {
                    *ratio = share * old;
                }
                evaluations += 1;
                if energy.is_planar(ratios, &mut scratch) {
                    is_moving = true;
                    break;
                }
                ratios[dims.clone()].copy_from_slice(&kept);
            }
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

/// Sends a few random subtrees part of the way to another particle, the cone for example.
fn blend(problem: &Problem, dofs: &DofMap, other: &[f64], ratios: &mut [f64], stream: &mut Stream) {
    let n_segments = problem.branches.list().len() as u32;
    for _ in 0..1 + stream.below(3) {
        let share = stream.unit();
        for segment in segments_below(problem, stream.below(n_segments) as usize) {
            for dim in segment_angles(problem, dofs, segment) {
                ratios[dim] += share * (other[dim] - ratios[dim]);
            }
        }
    }
}

/// The segments of the subtree that starts with a segment, itself among them.
pub(crate) fn segments_below(problem: &Problem, segment: usize) -> std::ops::Range<usize> {
    let first = problem.branches.list()[segment].nodes.start;
    let last = problem.tree.subtree(first).end - 1;
    segment..problem.branch[last] as usize + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::{random_tree, views_along};
    use crate::layout::{cone, radial};
    use crate::params::Params;
    use crate::{place, targets};

    /// Section 3.2.2 of [Hu2022]: P_0 = 0, P_1 = the ratios of the radial layout, the rest uniform in the ranges.
    #[test]
    fn the_papers_start_is_as_printed() {
        let tree = random_tree(0, 60, 1.0, false, 9);
        let (mut params, branches) = (Params::paper(), tree.branches());
        params.pso.particles = 500;
        let views = views_along(&tree, glam::DVec3::Z);
        let targets = targets::targets(&tree, &branches, &views, params.targets).expect("targets");
        let problem = Problem::new(&tree, branches, targets, &params);
        let dofs = DofMap::new(&problem, params.pso.freedom);
        let exact = vec![0.0; problem.n_nodes()];
        let particle = |heading_rad: &[f64]| {
            dofs.particle(&problem, &exact, &place::angle_ratios(&problem, heading_rad))
        };
        let incumbents = Incumbents {
            radial: particle(&radial::headings(&problem)),
            cone: particle(&cone::headings(&problem)),
        };
        let energy = CpuEnergy { problem: &problem, dofs: &dofs };
        let swarm = start(&energy, &incumbents, &params.pso, 3);
        let dims = dofs.dims();
        assert_eq!(swarm.ratios[..dims], vec![0.0; dims]);
        assert_eq!(swarm.ratios[dims..2 * dims], incumbents.radial);
        assert_eq!((swarm.ratios.len(), swarm.evaluations), (500 * dims, 0));
        for dim in 0..dims {
            let (low, high) = dofs.range(dim);
            let rest = || (2..500).map(|particle| swarm.ratios[particle * dims + dim]);
            let (least, most) = (rest().fold(f64::INFINITY, f64::min), rest().fold(-1.0, f64::max));
            assert!(low <= least && least < low + 0.1 && high - 0.1 < most && most <= high, "ratio {dim}");
            let mean = rest().sum::<f64>() / 498.0;
            assert!((mean - 0.5 * (low + high)).abs() < 0.12, "ratio {dim}: {mean}");
        }
        assert!(swarm.velocities.iter().all(|u| (-1.0..=1.0).contains(u)));
    }
}
