//! The solid body about a ground truth: a union of round cones.
//!
//! A round cone is what a ball sweeps that moves from one node to the next while its radius goes linearly from
//! the one's to the other's.
//!
//! **Notation** a, b the cone's ends, L their distance, r_a, r_b their radii, k = (r_b − r_a)/L the slope; x, y
//! the coordinates of a point along and across the axis.
//! **Guarantees** `depth > 0` inside, `= 0` on the surface, `< 0` outside, where −depth is the Euclidean distance.
//! **Cost** O(1) for a cone.

use espalier_model::Node;
use glam::DVec3;

use crate::shape::Shape;

/// One round cone; a ball if its ends coincide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cone {
    start: DVec3,
    axis: DVec3,
    length: f64,
    radius: [f64; 2],
    /// k, and k/√(1 − k²): how far ahead of its foot a point meets the ball that comes nearest to it.
    slope: f64,
    lead: f64,
}

impl Cone {
    pub(crate) fn new((a, radius_a): (DVec3, f64), (b, radius_b): (DVec3, f64)) -> Self {
        let length = a.distance(b);
        let slope = if length > 0.0 { (radius_b - radius_a) / length } else { 0.0 };
        if slope.abs() >= 1.0 || length == 0.0 {
            // One end's ball holds the other's: the cone is the larger ball.
            let (start, radius) = if radius_a >= radius_b { (a, radius_a) } else { (b, radius_b) };
            return Self { start, axis: DVec3::Z, length: 0.0, radius: [radius; 2], slope: 0.0, lead: 0.0 };
        }
        let lead = slope / (1.0 - slope * slope).sqrt();
        Self { start: a, axis: (b - a) / length, length, radius: [radius_a, radius_b], slope, lead }
    }

    /// How deep `point` lies inside, in mm; minus the distance outside.
    pub(crate) fn depth_mm(&self, point: DVec3) -> f64 {
        // The ball centred at s along the axis has the depth r_a + k s − √((x − s)² + y²), which is largest at
        // s = x + y k/√(1 − k²).
        let offset = point - self.start;
        let x = offset.dot(self.axis);
        let y = (offset.length_squared() - x * x).max(0.0).sqrt();
        let s = (x + y * self.lead).clamp(0.0, self.length);
        self.radius[0] + self.slope * s - ((x - s) * (x - s) + y * y).sqrt()
    }

    /// The corners of the box about the cone.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        let end = self.start + self.length * self.axis;
        (
            (self.start - self.radius[0]).min(end - self.radius[1]),
            (self.start + self.radius[0]).max(end + self.radius[1]),
        )
    }
}

/// A union of round cones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Body {
    pub(crate) cones: Vec<Cone>,
}

impl Body {
    /// The body about nodes and the edges that close rings, each radius mapped by `radius`.
    pub(crate) fn about(shape: &Shape, radius: impl Fn(f64) -> f64) -> Self {
        let ball = |node: &Node| (node.position_mm, radius(node.radius_mm));
        let edges = shape.nodes.iter().enumerate().filter_map(|(node, data)| Some((data.parent?, node)));
        let mut cones: Vec<Cone> = edges
            .chain(shape.closing.iter().copied())
            .map(|(from, to)| Cone::new(ball(&shape.nodes[from]), ball(&shape.nodes[to])))
            .collect();
        if cones.is_empty() {
            cones.extend(shape.nodes.iter().map(|node| Cone::new(ball(node), ball(node))));
        }
        Self { cones }
    }

    /// How deep `point_mm` lies inside the body, in mm: the depth in its deepest cone. Outside, minus the distance
    /// to the body. Time grows with the number of cones: for tests and single points.
    #[must_use]
    pub fn depth_mm(&self, point_mm: DVec3) -> f64 {
        self.cones.iter().map(|cone| cone.depth_mm(point_mm)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The corners of the box about the body.
    pub(crate) fn bounds(&self) -> (DVec3, DVec3) {
        self.cones
            .iter()
            .map(Cone::bounds)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |all, one| (all.0.min(one.0), all.1.max(one.1)))
    }
}
