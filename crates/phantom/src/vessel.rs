//! A contrast-filled vein of the liver that follows Murray's law.
//!
//! **Input** [`Params`] (`generations`, `min_radius_mm`, `clearance_mm`), a seed, the attempt. **Output** [`Shape`].
//! **Spaces** RAS mm, the middle of the liver at the origin.
//! **Guarantees** r³ of a parent is the sum of its children's r³ [Murray1926].

use espalier_geom::random::{Purpose, Stream};
use glam::DVec3;

use crate::Params;
use crate::clearance::Occupied;
use crate::growth::{Bud, Growth, Path, Rules, scatter};
use crate::lungs::ellipsoid_depth;
use crate::shape::Shape;

/// Where the trunk enters, below the liver.
const TRUNK_START: DVec3 = DVec3::new(-34.0, -16.0, -70.0);
/// The trunk's direction and length in mm.
const TRUNK_DIRECTION: DVec3 = DVec3::new(0.55, 0.12, 0.82);
const TRUNK_MM: f64 = 46.0;
/// Radius of the trunk in mm.
const TRUNK_RADIUS_MM: f64 = 6.5;
/// Semi-axes of the larger right and the smaller left lobe in mm, and their centres.
const LOBES: [(DVec3, DVec3); 2] = [
    (DVec3::new(22.0, 0.0, 0.0), DVec3::new(66.0, 58.0, 58.0)),
    (DVec3::new(-48.0, 14.0, 12.0), DVec3::new(52.0, 40.0, 34.0)),
];

/// About how deep `p` (at size 1) lies in the liver.
pub(crate) fn liver_depth(p: DVec3) -> f64 {
    LOBES
        .iter()
        .map(|&(center, semi_axes)| ellipsoid_depth(p, center, semi_axes))
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Grows the vein of a seed's attempt, at size 1.
pub(crate) fn shape(params: &Params, seed: u64, attempt: u32) -> Shape {
    let mut stream = Stream::new(seed, Purpose::PhantomShape, 0, 2 * attempt);
    let bounds = (DVec3::new(-102.0, -60.0, -60.0), DVec3::new(90.0, 60.0, 60.0));
    let cloud = scatter(bounds, 20 << params.generations.clamp(7, 13), liver_depth, &mut stream);

    let mut shape = Shape::default();
    let root = shape.push(None, TRUNK_START, TRUNK_RADIUS_MM);
    let mut growth = Growth {
        shape: &mut shape,
        occupied: Occupied::default(),
        stream: Stream::new(seed, Purpose::PhantomShape, 0, 2 * attempt + 1),
    };
    let direction = TRUNK_DIRECTION.normalize();
    let path = Path { hub: (TRUNK_START, TRUNK_RADIUS_MM), arrival: direction, direction };
    let balls = path.bent(TRUNK_MM, TRUNK_RADIUS_MM, &mut growth.stream);
    let (branch, node) = growth.add_branch(root, balls);
    let trunk = Bud { branch, node, direction, normal: DVec3::Y, generation: 0, cloud };
    let rules = Rules {
        depth: &liver_depth,
        generations: params.generations,
        min_radius_mm: params.min_radius_mm,
        clearance_mm: params.clearance_mm,
    };
    growth.grow(vec![trunk], &rules);
    shape
}
