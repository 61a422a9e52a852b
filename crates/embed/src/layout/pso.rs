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
//! ratios are clamped to their ranges; `pull = "subtree"`, ours, is explained in `step`.
//! **Cost** particles · iterations evaluations at most, 24 bytes per particle and ratio.

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Phase, Termination, TracePoint};
use glam::DVec2;
use rayon::prelude::*;

use crate::Progress;
use crate::batch::{BatchEnergy, CpuEnergy, DofMap, Score, Scratch};
use crate::choices::{Freedom, Pull};
use crate::crossing;
use crate::energy;
use crate::error::Error;
use crate::layout::Layout;
use crate::layout::start::{self, Incumbents};
use crate::layout::step::Rule;
use crate::params::PsoParams;
use crate::place;
use crate::problem::Problem;
use crate::solver::Shape;

/// Whether the targets themselves have crossings, so that a swarm has something to do.
pub(crate) fn targets_cross(problem: &Problem) -> bool {
    !crossing::is_planar(problem, &Shape::targets(problem).positions(problem))
}

/// Runs the swarm; the radial layout and the cone, as headings, are among its particles.
pub(crate) fn layout(
    problem: &Problem,
    (radial, cone): (&[f64], &[f64]),
    (params, seed): (&PsoParams, u64),
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Layout, Error> {
    // Larger trees have fewer particles.
    let params = &PsoParams { particles: params.particles_for(problem.n_nodes()), ..params.clone() };
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

    // P_g ← P_0: where the targets have no crossing the loop has nothing to do.
    let targets = vec![0.0; dofs.dims()];
    if !problem.trades_placement && energy.is_planar(&targets, &mut Scratch::default()) {
        return Ok(targets_met(&energy, &name, &targets, params, progress));
    }
    let start = start::start(&energy, &incumbents, params, seed);
    Ok(search(&energy, start, (params, seed), progress).into_layout(&energy, &name))
}

/// A swarm around layouts that were found: each is a particle, the first the best; freedom `n`, the step of `subtree`.
/// `None` where there is nothing to gain.
pub(crate) fn polish(
    problem: &Problem,
    found: &[&Layout],
    (params, seed): (&PsoParams, u64),
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Option<Layout>, Error> {
    let params = &PsoParams {
        freedom: Freedom::N,
        pull: Pull::Subtree,
        particles: params.particles_for(problem.n_nodes()),
        ..params.clone()
    };
    let dofs = DofMap::new(problem, params.freedom);
    if dofs.dims() == 0 || !(targets_cross(problem) || problem.trades_placement) {
        return Ok(None);
    }
    check_memory(params, dofs.dims())?;
    let energy = CpuEnergy { problem, dofs: &dofs };
    let incumbents: Vec<Vec<f64>> = found
        .iter()
        .take(params.particles as usize / 2)
        .map(|layout| {
            let scored = energy::score(problem, &layout.positions, 0.0, 0);
            let heading_rad = place::headings(problem, &layout.positions);
            dofs.particle(problem, &scored.length_ratio, &place::angle_ratios(problem, &heading_rad))
        })
        .collect();
    let start = start::around(&energy, &incumbents, params, seed);
    let name = format!("solver + swarm {}x{}", params.particles, params.iterations);
    Ok(Some(search(&energy, start, (params, seed), progress).into_layout(&energy, &name)))
}

/// Algorithm 1: E_p of every particle, P_ig and P_g; then Eq. 5; until no loss is left or c reaches its limit.
fn search(
    energy: &CpuEnergy,
    start: start::Swarm,
    (params, seed): (&PsoParams, u64),
    progress: &(dyn Fn(Progress) + Sync),
) -> Swarm {
    let dofs = energy.dofs;
    let mut swarm = Swarm::new(start, dofs.dims());
    let rule = Rule { problem: energy.problem, dofs, params };
    swarm.evaluate(energy);
    swarm.record(0, params, progress);
    for iteration in 1..=params.iterations {
        if swarm.has_no_loss(dofs) && !energy.problem.trades_placement {
            break;
        }
        swarm.step(&rule, (seed, iteration));
        swarm.evaluate(energy);
        swarm.record(iteration, params, progress);
    }
    swarm
}

/// The layout without any loss.
fn targets_met(
    energy: &CpuEnergy,
    name: &str,
    targets: &[f64],
    params: &PsoParams,
    progress: &(dyn Fn(Progress) + Sync),
) -> Layout {
    let score = energy.evaluate_one(targets, f64::INFINITY, &mut Scratch::default());
    let point = TracePoint {
        phase: Phase::Start,
        iteration: 0,
        evaluations: 1,
        energy: score.map_or(0.0, |score| score.energy),
        crossings: 0,
    };
    report(&point, params, progress);
    let found = Layout::constructed(name, energy.positions(targets));
    Layout { evaluations: 1, trace: vec![point], termination: Termination::Optimal, ..found }
}

fn name(params: &PsoParams) -> String {
    format!("pso {}x{} {}", params.particles, params.iterations, params.freedom.name())
}

fn check_memory(params: &PsoParams, dims: usize) -> Result<(), Error> {
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

    fn into_layout(self, energy: &CpuEnergy, name: &str) -> Layout {
        let has_no_loss = self.has_no_loss(energy.dofs);
        Layout {
            evaluations: self.evaluations,
            trace: self.trace,
            termination: if has_no_loss { Termination::Optimal } else { Termination::BudgetSpent },
            ..Layout::constructed(name, energy.positions(&self.global_best))
        }
    }

    /// Whether P_g meets every target without a crossing.
    fn has_no_loss(&self, dofs: &DofMap) -> bool {
        let loss: f64 = dofs.cost.iter().zip(&self.global_best).map(|(cost, r)| cost * (r * r)).sum();
        self.global_score.crossings == 0 && loss == 0.0
    }

    /// Eq. 5 for every particle.
    fn step(&mut self, rule: &Rule, (seed, iteration): (u64, u32)) {
        let dims = self.dims;
        let global = &self.global_best;
        let moving = self.ratios.par_chunks_mut(dims).zip(self.velocities.par_chunks_mut(dims));
        moving.zip(self.bests.par_chunks(dims)).enumerate().for_each_init(
            Vec::new,
            |old, (particle, ((p, u), own))| {
                let mut stream = Stream::new(seed, Purpose::SwarmStep, particle as u32, iteration);
                old.clear();
                old.extend_from_slice(p);
                rule.step(p, u, (own, global), &mut stream);
                for dim in 0..p.len() {
                    u[dim] = p[dim] - old[dim];
                }
            },
        );
    }

    fn record(&mut self, iteration: u32, params: &PsoParams, progress: &(dyn Fn(Progress) + Sync)) {
        let Score { energy, crossings } = self.global_score;
        let phase = if iteration == 0 { Phase::Start } else { Phase::Swarm };
        let point = TracePoint { phase, iteration, evaluations: self.evaluations, energy, crossings };
        report(&point, params, progress);
        self.trace.push(point);
    }
}

fn report(point: &TracePoint, params: &PsoParams, progress: &(dyn Fn(Progress) + Sync)) {
    progress(Progress {
        done: u64::from(point.iteration),
        total: u64::from(params.iterations),
        evaluations: point.evaluations,
        energy: point.energy,
        crossings: point.crossings,
    });
}
