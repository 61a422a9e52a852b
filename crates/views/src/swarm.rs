//! The best direction of a part by a particle swarm on the sphere: the way of the paper.
//!
//! **Input** an [`Objective`], a seed. **Output** [`Best`].
//! **Notation** P_i the direction of particle i, P_ig its own best, P_g the best of all, U_i its last step,
//! γ uniform in (−1, 1) per coordinate, c the iteration.
//! **Steps** 1. The seeds are the first particles, the rest is uniform on the sphere, with random U_i. 2. In each
//! iteration evaluate all, update P_ig and P_g, and move by Eq. 5:
//! P_i ← P_i + ω_g (P_g − P_i) + ω_p (P_ig − P_i) + ω_inert (U_i + γ), then back onto the sphere. Stop
//! when nothing is lost, or after the last iteration.
//! **Guarantees** never worse than any seed; the numbers of a particle depend on (seed, particle, iteration) only,
//! so the result does not depend on thread count.
//! **Source** [Hu2022] section 3.1 and Eq. 5, 256 particles and 100 iterations.
//! **Differs from the source** the loss does not tell v from −v, so a particle is drawn to the nearer of the two.
//! **Cost** at most `particles` × `iterations` evaluations.

use std::f64::consts::TAU;

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use glam::DVec3;

use crate::objective::{LOSSLESS, Objective};
use crate::params::Params;
use crate::search::Best;

struct Particle {
    position: DVec3,
    last_step: DVec3,
    best: DVec3,
    best_value: f64,
}

/// The best direction that the swarm comes upon.
pub(crate) fn fly(objective: &Objective, params: &Params, seed: u64) -> Best {
    let seeds = objective.seeds();
    let mut particles: Vec<Particle> =
        (0..params.particles).map(|i| Particle::start(seed, i, &seeds)).collect();
    let mut best = Best { direction: particles[0].position, value: f64::INFINITY, n_evaluations: 0 };
    for iteration in 1..=params.iterations {
        if best.value <= LOSSLESS {
            break;
        }
        // Evaluate all, and update the particles' own bests and the best of all.
        let positions: Vec<DVec3> = particles.iter().map(|particle| particle.position).collect();
        let values = objective.at_each(&positions);
        best.n_evaluations += values.len() as u64;
        for (particle, &value) in particles.iter_mut().zip(&values) {
            if value < particle.best_value {
                (particle.best, particle.best_value) = (particle.position, value);
            }
            if value < best.value {
                best = Best { direction: particle.position, value, ..best };
            }
        }
        // Move all.
        for (i, particle) in (0..).zip(&mut particles) {
            let noise = in_cube(&mut Stream::new(seed, Purpose::ViewSwarm, i, iteration));
            particle.fly(best.direction, noise, params);
        }
    }
    best
}

impl Particle {
    fn start(seed: u64, i: u32, seeds: &[DVec3]) -> Self {
        let mut stream = Stream::new(seed, Purpose::ViewSwarm, i, 0);
        let position = seeds.get(i as usize).copied().unwrap_or_else(|| on_sphere(&mut stream));
        Self { position, last_step: in_cube(&mut stream), best: position, best_value: f64::INFINITY }
    }

    /// Eq. 5 of [Hu2022], then back onto the sphere.
    fn fly(&mut self, global_best: DVec3, noise: DVec3, params: &Params) {
        let towards = |target: DVec3| {
            let nearer = if target.dot(self.position) < 0.0 { -target } else { target };
            nearer - self.position
        };
        let step = params.omega_global * towards(global_best)
            + params.omega_personal * towards(self.best)
            + params.omega_inertia * (self.last_step + noise);
        // A step that ends in the middle of the sphere has no direction: the particle stays.
        let position = (self.position + step).try_normalize().unwrap_or(self.position);
        self.last_step = position - self.position;
        self.position = position;
    }
}

fn in_cube(stream: &mut Stream) -> DVec3 {
    let [x, y, z] = [(); 3].map(|()| stream.uniform(-1.0, 1.0));
    DVec3::new(x, y, z)
}

fn on_sphere(stream: &mut Stream) -> DVec3 {
    let z = stream.uniform(-1.0, 1.0);
    let (sin, cos) = math::sin_cos(stream.uniform(0.0, TAU));
    let ring = (1.0 - z * z).sqrt();
    DVec3::new(ring * cos, ring * sin, z)
}
