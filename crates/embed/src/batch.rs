//! Scoring many particles at once: the interface of the swarm to whatever computes energies.
//!
//! **Input** ratios of n particles as one flat array, shape (n, dims), and for each an energy above which it is of
//! no interest. **Output** for each particle its energy and crossings, or that it is of no interest.
//! **Notation** a particle's ratios are M length ratios by segment, then its angle ratios by node (`n`), by segment
//! (`s`), or two by segment (`b`: first node, the rest).
//! **Steps** of one evaluation: 1. length and angle terms, straight from the ratios. 2. Equation 3, headings,
//! positions. 3. Placement term. 4. Crossings. After 1, 3 and within 4 it stops once the limit is passed.
//! **Guarantees** the same numbers for any number of threads, and for any limit that is not passed.
//! **Cost** O(N) for 1–3, and `crossing` for 4, which only promising particles reach.

use espalier_geom::angle::wrap;
use espalier_geom::math;
use glam::DVec2;
use rayon::prelude::*;

use crate::choices::Freedom;
use crate::crossing;
use crate::problem::Problem;
use crate::ratio;
use crate::trig;

/// The energy of one particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Score {
    /// The total energy, crossings included.
    pub(crate) energy: f64,
    /// How many crossings.
    pub(crate) crossings: usize,
}

/// Something that scores particles; a graphics card could be another.
pub(crate) trait BatchEnergy: Sync {
    /// The number of ratios of a particle.
    fn dims(&self) -> usize;
    /// Scores each particle of `ratios`, shape (n, dims); `None` where the energy is not below its limit.
    fn evaluate(&self, ratios: &[f64], limits: &[f64], scores: &mut [Option<Score>]);
}

/// Which ratio of a particle belongs to which node.
pub(crate) struct DofMap {
    /// The angle ratio of each node, as an index into a particle.
    pub(crate) angle: Vec<u32>,
    /// What a ratio's square costs, by ratio.
    pub(crate) cost: Vec<f64>,
    /// The number of length ratios, which come first.
    pub(crate) n_lengths: usize,
    freedom: Freedom,
}

impl DofMap {
    /// The ratios that a freedom gives to a problem.
    pub(crate) fn new(problem: &Problem, freedom: Freedom) -> Self {
        let n_lengths = problem.branches.list().len();
        let n_angles = match freedom {
            Freedom::S => n_lengths,
            Freedom::B => 2 * n_lengths,
            Freedom::N => problem.n_nodes() - 1,
        };
        let mut map = Self { angle: Vec::new(), cost: vec![0.0; n_lengths + n_angles], n_lengths, freedom };
        map.angle = (0..problem.n_nodes()).map(|node| map.angle_of(problem, node) as u32).collect();
        for node in 1..problem.n_nodes() {
            map.cost[problem.branch[node] as usize] += problem.length_cost[node];
            map.cost[map.angle[node] as usize] += problem.angle_cost[node];
        }
        map
    }

    /// The number of ratios.
    pub(crate) fn dims(&self) -> usize {
        self.cost.len()
    }

    /// The ratio's range.
    pub(crate) fn range(&self, dim: usize) -> (f64, f64) {
        if dim < self.n_lengths { ratio::LENGTH_RANGE } else { ratio::ANGLE_RANGE }
    }

    fn angle_of(&self, problem: &Problem, node: usize) -> usize {
        let segment = problem.branch[node] as usize;
        let within = match self.freedom {
            _ if node == 0 => 0,
            Freedom::S => segment,
            Freedom::B => 2 * segment + usize::from(problem.branches.list()[segment].nodes.start != node),
            Freedom::N => node - 1,
        };
        self.n_lengths + within
    }

    /// The particle nearest to given ratios per node: means over what shares a ratio, kept in range.
    pub(crate) fn particle(&self, problem: &Problem, length_ratio: &[f64], angle_ratio: &[f64]) -> Vec<f64> {
        let (mut sum, mut count) = (vec![0.0; self.dims()], vec![0.0_f64; self.dims()]);
        for node in 1..problem.n_nodes() {
            for (dim, ratio) in [
                (problem.branch[node] as usize, length_ratio[node]),
                (self.angle[node] as usize, angle_ratio[node]),
            ] {
                sum[dim] += ratio;
                count[dim] += 1.0;
            }
        }
        let mean = |dim: usize| {
            let (low, high) = self.range(dim);
            (sum[dim] / count[dim].max(1.0)).clamp(low, high)
        };
        (0..self.dims()).map(mean).collect()
    }
}

/// Energies on the processor, parallel over particles.
pub(crate) struct CpuEnergy<'a> {
    pub(crate) problem: &'a Problem<'a>,
    pub(crate) dofs: &'a DofMap,
}

/// What one evaluation needs; one per thread.
#[derive(Default)]
pub(crate) struct Scratch {
    heading: Vec<f64>,
    cos: Vec<f64>,
    sin: Vec<f64>,
    x: Vec<f64>,
    y: Vec<f64>,
    crossing: crossing::Scratch,
}

impl BatchEnergy for CpuEnergy<'_> {
    fn dims(&self) -> usize {
        self.dofs.dims()
    }

    fn evaluate(&self, ratios: &[f64], limits: &[f64], scores: &mut [Option<Score>]) {
        ratios.par_chunks(self.dims().max(1)).zip(limits).zip(scores).for_each_init(
            Scratch::default,
            |scratch, ((particle, &limit), score)| {
                *score = self.evaluate_one(particle, limit, scratch);
            },
        );
    }
}

impl CpuEnergy<'_> {
    /// Scores one particle; `None` if its energy is not below the limit.
    pub(crate) fn evaluate_one(&self, particle: &[f64], limit: f64, scratch: &mut Scratch) -> Option<Score> {
        let mut energy: f64 = self.dofs.cost.iter().zip(particle).map(|(cost, r)| cost * (r * r)).sum();
        if energy >= limit {
            return None;
        }
        self.place(particle, scratch);
        energy += self.placement(scratch);
        if energy >= limit {
            return None;
        }
        let weight = self.problem.crossing_weight;
        // The largest number of crossings with which the particle would still be of interest.
        let most = math::floor((limit - energy) / weight).min(1e15) as usize;
        let Scratch { x, y, crossing: boxes, .. } = scratch;
        let crossings = crossing::count(self.problem, x, y, most, boxes);
        energy += weight * crossings as f64;
        (energy < limit).then_some(Score { energy, crossings })
    }

    /// Whether a particle's layout has no crossing.
    pub(crate) fn is_planar(&self, particle: &[f64], scratch: &mut Scratch) -> bool {
        self.place(particle, scratch);
        let Scratch { x, y, crossing: boxes, .. } = scratch;
        crossing::count(self.problem, x, y, 0, boxes) == 0
    }

    /// The positions of a particle's layout.
    pub(crate) fn positions(&self, particle: &[f64]) -> Vec<DVec2> {
        let mut scratch = Scratch::default();
        self.place(particle, &mut scratch);
        scratch.x.iter().zip(&scratch.y).map(|(&x, &y)| DVec2::new(x, y)).collect()
    }

    fn place(&self, particle: &[f64], scratch: &mut Scratch) {
        let problem = self.problem;
        let n_nodes = problem.n_nodes();
        let Scratch { heading, cos, sin, x, y, .. } = scratch;
        for array in [&mut *heading, &mut *cos, &mut *sin, &mut *x, &mut *y] {
            array.resize(n_nodes, 0.0);
        }
        for node in 1..n_nodes {
            let ratio = particle[self.dofs.angle[node] as usize];
            let turn = problem.side[node] * ratio::embedded_bend(problem.bend[node], ratio);
            heading[node] = heading[problem.parent[node] as usize] + turn;
        }
        trig::sin_cos(&heading[1..], &mut sin[1..], &mut cos[1..]);
        for node in 1..n_nodes {
            let parent = problem.parent[node] as usize;
            let stretch = 1.0 + particle[problem.branch[node] as usize];
            let length = problem.targets.length_mm[node] * stretch;
            x[node] = x[parent] + length * cos[node];
            y[node] = y[parent] + length * sin[node];
        }
    }

    /// The placement term, as in `energy`, from sines and cosines at hand.
    fn placement(&self, Scratch { heading, cos, sin, .. }: &Scratch) -> f64 {
        let problem = self.problem;
        let (mut cos_sum, mut sin_sum) = (0.0, 0.0);
        for node in 1..heading.len() {
            let (to_cos, to_sin) = (problem.placement_cos[node], problem.placement_sin[node]);
            cos_sum += to_cos * cos[node] + to_sin * sin[node];
            sin_sum += to_sin * cos[node] - to_cos * sin[node];
        }
        if cos_sum == 0.0 && sin_sum == 0.0 {
            return 0.0;
        }
        let rotation = math::atan2(sin_sum, cos_sum);
        let off = |node: usize| wrap(heading[node] + rotation - problem.targets.heading_rad[node]);
        (1..heading.len()).map(|node| problem.placement_cost[node] * (off(node) * off(node))).sum()
    }
}
