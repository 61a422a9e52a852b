//! The airways of a human: trachea and lobar bronchi by anatomy, the rest grown into the lungs.
//!
//! **Input** [`Params`] (`generations`, `min_radius_mm`, `clearance_mm`), a seed, the attempt. **Output** [`Shape`].
//! **Spaces** RAS mm, the carina at the origin, the trachea upwards; the right lung at +x.
//! **Steps** 1. scatter points over both lungs, sort them by lobe; 2. lay the [`TEMPLATE`], each branch as thick as
//! its share of the points asks by Murray's law; 3. grow each lobe.
//! **Source** diameters and lengths of the first generations: [Weibel1963], [Horsfield1971], rounded; the right main
//! bronchus is shorter, wider and steeper than the left.

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use glam::DVec3;

use crate::Params;
use crate::clearance::Occupied;
use crate::growth::{Bud, Growth, Path, Rules, scatter};
use crate::lungs::{self, Lobe, Side};
use crate::shape::Shape;

/// Length of the trachea between the centre of its upper end and the carina, in mm.
const TRACHEA_MM: f64 = 102.0;
/// Radius of the trachea in mm.
const TRACHEA_RADIUS_MM: f64 = 9.0;
/// The trachea leans back as it descends.
const TRACHEA_TOP: DVec3 = DVec3::new(0.0, 0.17, 0.985);

/// A branch that anatomy fixes.
struct Named {
    /// Its parent: 0 is the trachea, n the template's branch n − 1.
    parent: usize,
    direction: DVec3,
    length_mm: f64,
    generation: u32,
    /// The lobes that it serves; a single one if it is the lobe's own bronchus, where the growth takes over.
    lobes: &'static [Lobe],
}

const RIGHT: [Lobe; 3] = [Lobe::RightUpper, Lobe::RightMiddle, Lobe::RightLower];
const LEFT: [Lobe; 3] = [Lobe::LeftUpper, Lobe::Lingula, Lobe::LeftLower];

const fn named(
    parent: usize,
    (length_mm, generation): (f64, u32),
    direction: [f64; 3],
    lobes: &'static [Lobe],
) -> Named {
    Named { parent, direction: DVec3::from_array(direction), length_mm, generation, lobes }
}

/// Main and lobar bronchi by generation, so that a shallow tree is a prefix.
const TEMPLATE: [Named; 10] = [
    // Right and left main bronchus.
    named(0, (25.0, 1), [0.52, -0.06, -0.85], &RIGHT),
    named(0, (47.0, 1), [-0.75, -0.10, -0.65], &LEFT),
    // Right upper lobe, intermediate bronchus; left upper lobe with the lingula, left lower lobe.
    named(1, (20.0, 2), [0.93, 0.05, 0.20], &[Lobe::RightUpper]),
    named(1, (27.0, 2), [0.24, -0.10, -0.96], &[Lobe::RightMiddle, Lobe::RightLower]),
    named(2, (17.0, 2), [-0.84, 0.46, 0.22], &[Lobe::LeftUpper, Lobe::Lingula]),
    named(2, (17.0, 2), [-0.26, -0.38, -0.89], &[Lobe::LeftLower]),
    // Right middle and lower lobe; the upper division of the left upper lobe, and the lingula.
    named(4, (20.0, 3), [0.52, 0.72, -0.45], &[Lobe::RightMiddle]),
    named(4, (15.0, 3), [0.30, -0.40, -0.87], &[Lobe::RightLower]),
    named(5, (18.0, 3), [-0.42, 0.12, 0.90], &[Lobe::LeftUpper]),
    named(5, (20.0, 3), [-0.55, 0.68, -0.48], &[Lobe::Lingula]),
];

/// Grows the airways of a seed's attempt, at size 1.
pub(crate) fn shape(params: &Params, seed: u64, attempt: u32) -> Shape {
    let clouds = clouds(params, seed, attempt);
    let mut shape = Shape::default();
    let mut growth = Growth {
        shape: &mut shape,
        occupied: Occupied::default(),
        stream: Stream::new(seed, Purpose::PhantomShape, 0, 2 * attempt + 1),
    };
    let buds = lay_template(&mut growth, &clouds, params.generations);
    let depth = |p: DVec3| lungs::depth_mm(Side::Right, p).max(lungs::depth_mm(Side::Left, p));
    let rules = Rules {
        depth: &depth,
        generations: params.generations,
        min_radius_mm: params.min_radius_mm,
        clearance_mm: params.clearance_mm,
    };
    growth.grow(buds, &rules);
    shape
}

/// Lays the trachea and the template, and returns the lobes' own bronchi, each with its lobe's points.
fn lay_template(growth: &mut Growth<'_>, clouds: &[(Lobe, Vec<DVec3>)], generations: u32) -> Vec<Bud> {
    let n_served = |lobes: &[Lobe]| -> usize {
        clouds.iter().filter(|(lobe, _)| lobes.contains(lobe)).map(|(_, cloud)| cloud.len()).sum()
    };
    let n_points = n_served(&RIGHT) + n_served(&LEFT);
    let mut laid = vec![trachea(growth)];
    for named in TEMPLATE.iter().take_while(|named| named.generation <= generations) {
        let radius_mm = TRACHEA_RADIUS_MM * math::cbrt(n_served(named.lobes) as f64 / n_points as f64);
        let mut bud = lay(growth, &laid[named.parent], named, radius_mm);
        if let [only] = named.lobes {
            bud.cloud = clouds.iter().filter(|(lobe, _)| lobe == only).flat_map(|(_, c)| c.clone()).collect();
        }
        laid.push(bud);
    }
    laid.retain(|bud| !bud.cloud.is_empty());
    laid
}

/// The points that the airways are to serve, by lobe, in the order of the lobes.
fn clouds(params: &Params, seed: u64, attempt: u32) -> Vec<(Lobe, Vec<DVec3>)> {
    let mut clouds: Vec<(Lobe, Vec<DVec3>)> =
        RIGHT.iter().chain(&LEFT).map(|&lobe| (lobe, Vec::new())).collect();
    // About forty points for each of the finest branches.
    let n_points = 20 << params.generations.clamp(7, 13);
    for (side_idx, side) in [Side::Right, Side::Left].into_iter().enumerate() {
        let mut stream = Stream::new(seed, Purpose::PhantomShape, side_idx as u32, 2 * attempt);
        // Equal numbers for equal volumes: scatter over the same box size, keep what falls inside.
        let share = if side == Side::Right { n_points } else { n_points * 9 / 10 };
        for p in scatter(side.bounds(), share, |p| lungs::depth_mm(side, p), &mut stream) {
            let lobe = lungs::lobe(side, p);
            clouds.iter_mut().filter(|(of, _)| *of == lobe).for_each(|(_, cloud)| cloud.push(p));
        }
    }
    clouds
}

/// The trachea, straight, from its upper end to the carina.
fn trachea(growth: &mut Growth<'_>) -> Bud {
    let top = TRACHEA_MM * TRACHEA_TOP.normalize();
    let root = growth.shape.push(None, top, TRACHEA_RADIUS_MM);
    let n_steps = 16;
    let balls = (0..=n_steps)
        .map(|step| (top.lerp(DVec3::ZERO, f64::from(step) / f64::from(n_steps)), TRACHEA_RADIUS_MM))
        .collect();
    let (branch, node) = growth.add_branch(root, balls);
    Bud { branch, node, direction: -top.normalize(), normal: DVec3::Y, generation: 0, cloud: Vec::new() }
}

/// Lays a branch of the template.
fn lay(growth: &mut Growth<'_>, parent: &Bud, named: &Named, radius_mm: f64) -> Bud {
    let hub = growth.shape.nodes[parent.node];
    let direction = named.direction.normalize();
    let path = Path { hub: (hub.position_mm, hub.radius_mm), arrival: parent.direction, direction };
    let length_mm = named.length_mm * growth.stream.uniform(0.94, 1.06);
    let balls = path.bent(length_mm, radius_mm, &mut growth.stream);
    let arrival = balls[balls.len() - 1].0 - balls[balls.len() - 2].0;
    let (branch, node) = growth.add_branch(parent.node, balls);
    Bud {
        branch,
        node,
        direction: arrival.normalize_or(direction),
        normal: parent.direction.cross(direction).normalize_or(DVec3::Y),
        generation: named.generation,
        cloud: Vec::new(),
    }
}
