//! The paper's particle swarm.
//!
//! **Input** the problem, crossing-free starts, params, seed. **Output** the best particle's layout, its trace.
//! **Notation** as in the paper: P_i ratios of particle i, P_ig the best it ever had, P_g the best of all, U_i its
//! velocity, E_p the energy, c the iteration, γ uniform in (−1, 1) per ratio.
//! **Steps** Algorithm 1 and Eq. 5 of [Hu2022]:
//! P ← P + ω_g (P_g − P) + ω_p (P_ig − P) + ω_inert (U + γ).
//! **Guarantees** the same numbers for any number of threads: every random number is keyed by (seed, particle,
//! iteration). An evaluation stops once it cannot beat the particle's own best, which changes no result.
//! **Differs from the source** P_g is the best ever, as the text says (the listing takes the best of the moment);
//! ratios are clamped to their ranges. `pull = "subtree"`, ours: per iteration each particle draws one subtree for
//! ω_g — that subtree, or all but that — and one subtree, segment or piece of a segment for a pull ω_0 to the
//! targets and for γ, so that what one part of the tree has found can be tried alone: a crossing elsewhere no
//! longer spoils it.
//! **Cost** particles · iterations evaluations at most, 24 bytes per particle and ratio.

use std::ops::Range;

use espalier_geom::random::{Purpose, Stream};
use espalier_model::TracePoint;
use glam::DVec2;
use rayon::prelude::*;

use crate::Progress;
use crate::batch::{BatchEnergy, CpuEnergy, DofMap, Score, Scratch};
use crate::error::Error;
use crate::layout::Layout;
use crate::layout::start::{self, Incumbents, segments_below};
use crate::params::{Freedom, Params, Pull};
use crate::place;
use crate::problem::Problem;

/// Runs the swarm; the radial layout and the cone, as headings, are among its particles.
pub(crate) fn layout(
    problem: &Problem,
    (radial, cone): (&[f64], &[f64]),
    (params, seed): (&Params, u64),
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Layout, Error> {
    let dofs = DofMap::new(problem, params.freedom);
    let name = name(params);
    if dofs.dims() == 0 {
        return Ok(Layout::constructed(&name, vec![DVec2::ZERO; problem.n_nodes()]));
    }
    check_memory(params, dofs.dims())?;
    let energy = CpuEnergy { problem, dofs: &dofs };
    let exact_lengths = vec![0.0; problem.n_nodes()];
    let as_particle = |heading_rad: &[f64]| {
        dofs.particle(problem, &exact_lengths, &place::angle_ratios(problem, heading_rad))
    };
    let incumbents = Incumbents { radial: as_particle(radial), cone: as_particle(cone) };

    // P_g ← P_0: where it has no crossing the loop has nothing to do.
    let targets = vec![0.0; dofs.dims()];
    if let Some(score) = energy.evaluate_one(&targets, f64::INFINITY, &mut Scratch::default())
        && score.crossings == 0
    {
        let Score { energy: least, crossings } = score;
        let point = TracePoint { iteration: 0, evaluations: 1, energy: least, crossings };
        report(&point, params, progress);
        let positions = energy.positions(&targets);
        return Ok(Layout { name, positions, evaluations: 1, trace: vec![point] });
    }
    let mut swarm = Swarm::new(start::start(&energy, &incumbents, params, seed), dofs.dims());

    // Algorithm 1: E_p of every particle, P_ig and P_g; then Eq. 5; until no loss is left or c reaches its limit.
    swarm.evaluate(&energy);
    swarm.record(0, params, progress);
    for iteration in 1..=params.iterations {
        if swarm.has_no_loss(&dofs) {
            break;
        }
        swarm.step(problem, &dofs, params, (seed, iteration));
        swarm.evaluate(&energy);
        swarm.record(iteration, params, progress);
    }
    Ok(Layout {
        name,
        positions: energy.positions(&swarm.global_best),
        evaluations: swarm.evaluations,
        trace: swarm.trace,
    })
}

fn name(params: &Params) -> String {
    let freedom = match params.freedom {
        Freedom::S => "s",
        Freedom::B => "b",
        Freedom::N => "n",
    };
    format!("pso {}x{} {freedom}", params.particles, params.iterations)
}

fn check_memory(params: &Params, dims: usize) -> Result<(), Error> {
    let needed_mib = u64::from(params.particles) * dims as u64 * 24 / (1 << 20);
    if needed_mib > params.memory_mib {
        let (particles, limit_mib) = (params.particles, params.memory_mib);
        return Err(Error::Memory { particles, dims, needed_mib, limit_mib });
    }
    Ok(())
}

struct Swarm {
    dims: usize,
    /// P_i, shape (n, dims).
    ratios: Vec<f64>,
    /// U_i, shape (n, dims).
    velocities: Vec<f64>,
    /// P_ig, shape (n, dims).
    bests: Vec<f64>,
    /// E_p of P_ig.
    best_energies: Vec<f64>,
    scores: Vec<Option<Score>>,
    /// P_g and its score.
    global_best: Vec<f64>,
    global_score: Score,
    evaluations: u64,
    trace: Vec<TracePoint>,
}

impl Swarm {
    fn new(start: start::Swarm, dims: usize) -> Self {
        let n_particles = start.ratios.len() / dims;
        Self {
            dims,
            bests: start.ratios.clone(),
            ratios: start.ratios,
            velocities: start.velocities,
            best_energies: vec![f64::INFINITY; n_particles],
            scores: vec![None; n_particles],
            global_best: vec![0.0; dims],
            global_score: Score { energy: f64::INFINITY, crossings: 0 },
            // One more for the look at the targets themselves.
            evaluations: start.evaluations + 1,
            trace: Vec::new(),
        }
    }

    /// Scores every particle and keeps its best, and the best of all.
    fn evaluate(&mut self, energy: &dyn BatchEnergy) {
        energy.evaluate(&self.ratios, &self.best_energies, &mut self.scores);
        self.evaluations += self.scores.len() as u64;
        for (particle, score) in self.scores.iter().enumerate() {
            // A score is only given where it beats the particle's own best.
            let Some(score) = *score else { continue };
            let place = particle * self.dims..(particle + 1) * self.dims;
            self.bests[place.clone()].copy_from_slice(&self.ratios[place.clone()]);
            self.best_energies[particle] = score.energy;
            if score.energy < self.global_score.energy {
                self.global_score = score;
                self.global_best.copy_from_slice(&self.ratios[place]);
            }
        }
    }

    /// Whether P_g meets every target without a crossing.
    fn has_no_loss(&self, dofs: &DofMap) -> bool {
        let loss: f64 = dofs.cost.iter().zip(&self.global_best).map(|(cost, r)| cost * (r * r)).sum();
        self.global_score.crossings == 0 && loss == 0.0
    }

    /// Eq. 5 for every particle.
    fn step(&mut self, problem: &Problem, dofs: &DofMap, params: &Params, (seed, iteration): (u64, u32)) {
        let global_best = &self.global_best;
        let particles = self.ratios.par_chunks_mut(self.dims).zip(self.velocities.par_chunks_mut(self.dims));
        particles.zip(self.bests.par_chunks(self.dims)).enumerate().for_each(|(particle, ((p, u), own))| {
            let mut stream = Stream::new(seed, Purpose::SwarmStep, particle as u32, iteration);
            match params.pull {
                Pull::Uniform => step_uniform(p, u, (own, global_best), (params, dofs), &mut stream),
                Pull::Subtree => {
                    step_subtree(problem, p, u, (own, global_best), (params, dofs), &mut stream);
                }
            }
        });
    }

    fn record(&mut self, iteration: u32, params: &Params, progress: &(dyn Fn(Progress) + Sync)) {
        let Score { energy, crossings } = self.global_score;
        let point = TracePoint { iteration, evaluations: self.evaluations, energy, crossings };
        report(&point, params, progress);
        self.trace.push(point);
    }
}

fn report(point: &TracePoint, params: &Params, progress: &(dyn Fn(Progress) + Sync)) {
    progress(Progress {
        done: u64::from(point.iteration),
        total: u64::from(params.iterations),
        evaluations: point.evaluations,
        energy: point.energy,
        crossings: point.crossings,
    });
}

/// Eq. 5 as printed.
fn step_uniform(
    p: &mut [f64],
    u: &mut [f64],
    (own, global): (&[f64], &[f64]),
    (params, dofs): (&Params, &DofMap),
    stream: &mut Stream,
) {
    for dim in 0..p.len() {
        let gamma = stream.uniform(-1.0, 1.0);
        let pull = params.omega_g * (global[dim] - p[dim]) + params.omega_p * (own[dim] - p[dim]);
        let (low, high) = dofs.range(dim);
        let next = (p[dim] + pull + params.omega_inertia * (u[dim] + gamma)).clamp(low, high);
        u[dim] = next - p[dim];
        p[dim] = next;
    }
}

/// Eq. 5 with its pulls confined to subtrees, and the pull to the targets.
fn step_subtree(
    problem: &Problem,
    p: &mut [f64],
    u: &mut [f64],
    (own, global): (&[f64], &[f64]),
    (params, dofs): (&Params, &DofMap),
    stream: &mut Stream,
) {
    let old: Vec<f64> = p.to_vec();
    for dim in 0..p.len() {
        p[dim] += params.omega_p * (own[dim] - p[dim]);
    }
    // Take the best of all in one subtree, or everywhere else.
    let taken = draw_subtree(problem, stream);
    let is_inside = stream.unit() < 0.5;
    for segment in 0..dofs.n_lengths {
        if taken.contains(&segment) == is_inside {
            for dim in std::iter::once(segment).chain(angles_of(problem, dofs, segment..segment + 1)) {
                p[dim] += params.omega_g * (global[dim] - p[dim]);
            }
        }
    }
    // In another, or in a piece of a segment, go towards the targets, with a random step beside.
    let share = params.omega_target * 2.0 * stream.unit();
    let width = params.omega_inertia * stream.unit() * stream.unit();
    for dim in draw_move(problem, dofs, stream).into_iter().flatten() {
        let (low, high) = dofs.range(dim);
        let gamma = stream.uniform(-1.0, 1.0);
        p[dim] = (p[dim] * (1.0 - share) + width * (u[dim] + gamma)).clamp(low, high);
    }
    for dim in 0..p.len() {
        u[dim] = p[dim] - old[dim];
    }
}

/// One random subtree, as a range of segments; often small, sometimes a single segment.
fn draw_subtree(problem: &Problem, stream: &mut Stream) -> Range<usize> {
    let top = stream.below(problem.branches.list().len() as u32) as usize;
    if stream.unit() < 0.75 { top..top + 1 } else { segments_below(problem, top) }
}

/// The ratios of a subtree, of a segment, or of a piece of a segment: lengths, then angles.
fn draw_move(problem: &Problem, dofs: &DofMap, stream: &mut Stream) -> [Range<usize>; 2] {
    let segments = draw_subtree(problem, stream);
    let angles = angles_of(problem, dofs, segments.clone());
    let is_piece = segments.len() == 1 && angles.len() > 1 && stream.unit() < 0.7;
    if !is_piece {
        return [segments, angles];
    }
    let mut ends = [0, 0].map(|_: u32| angles.start + stream.below(angles.len() as u32) as usize);
    ends.sort_unstable();
    [0..0, ends[0]..ends[1] + 1]
}

/// The angle ratios of a range of segments.
fn angles_of(problem: &Problem, dofs: &DofMap, segments: Range<usize>) -> Range<usize> {
    let list = problem.branches.list();
    let first = dofs.angle[list[segments.start].nodes.start] as usize;
    first..dofs.angle[list[segments.end - 1].end()] as usize + 1
}
