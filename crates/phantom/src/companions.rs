//! The pulmonary arteries: each runs beside its bronchus and goes on where the airways end.
//!
//! **Input** the airways' [`Shape`] at size 1 · size, a seed. **Output** a [`Body`]: what makes a lung look like one,
//! with bright round dots beside dark ones. They are painted under the airways and change no truth.
//! **Cost** O(nodes).

use std::f64::consts::TAU;

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use espalier_geom::space::plane_axes;
use glam::DVec3;

use crate::Params;
use crate::body::{Body, Cone};
use crate::shape::Shape;
use crate::tissue::wall_mm;

/// Bronchi up to this radius have an artery beside them, in mm at size 1.
const MAX_RADIUS_MM: f64 = 5.6;
/// How often an artery forks on beyond the last bronchus.
const N_TWIG_LEVELS: u32 = 4;

/// Draws the arteries beside the airways of `shape`.
pub(crate) fn arteries(shape: &Shape, params: &Params, seed: u64) -> Body {
    let mut cones = Vec::new();
    let mut n_children = vec![0; shape.nodes.len()];
    for node in &shape.nodes {
        node.parent.into_iter().for_each(|parent| n_children[parent] += 1);
    }
    let mut stream = Stream::new(seed, Purpose::PhantomNoise, 0, 3);
    for (node_idx, node) in shape.nodes.iter().enumerate() {
        let Some(parent) = node.parent.filter(|_| node.radius_mm < MAX_RADIUS_MM * params.size) else {
            continue;
        };
        let along = (node.position_mm - shape.nodes[parent].position_mm).normalize();
        let beside = |at: DVec3| beside(at, along, node.radius_mm, params.size);
        cones.push(Cone::new(beside(shape.nodes[parent].position_mm), beside(node.position_mm)));
        if n_children[node_idx] == 0 {
            twigs(&mut cones, beside(node.position_mm), along, &mut stream);
        }
    }
    Body { cones }
}

/// Where the artery runs beside a bronchus at `at`, and how thick it is.
fn beside(at: DVec3, along: DVec3, radius_mm: f64, size: f64) -> (DVec3, f64) {
    let artery = 0.9 * radius_mm;
    let (_, side) = plane_axes(along, DVec3::new(0.3, 0.8, 0.5));
    (at + side * (radius_mm + wall_mm(radius_mm, size) + artery), artery)
}

/// A few generations of thinning twigs.
fn twigs(cones: &mut Vec<Cone>, start: (DVec3, f64), along: DVec3, stream: &mut Stream) {
    let mut ends = vec![(start, along)];
    for _ in 0..N_TWIG_LEVELS {
        let mut next = Vec::with_capacity(2 * ends.len());
        for ((at, radius), direction) in ends {
            let (right, up) = plane_axes(direction, DVec3::Y);
            let turn = TAU * stream.unit();
            for side in [-1.0, 1.0] {
                let around = math::unit_vector(turn) * side * stream.uniform(0.3, 0.9);
                let out = (direction + around.x * right + around.y * up).normalize_or(direction);
                let end = (at + out * radius * stream.uniform(6.0, 10.0), 0.76 * radius);
                cones.push(Cone::new((at, 0.85 * radius), end));
                next.push((end, out));
            }
        }
        ends = next;
    }
}
