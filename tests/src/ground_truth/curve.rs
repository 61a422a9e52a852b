//! The centreline of a tree as edges, and as steps of equal length.

use espalier_geom::space::nearest_parameter;
use espalier_model::Tree;
use glam::DVec3;

/// The true centreline.
pub(crate) struct Axis {
    /// (start, end, radius at the start, radius at the end).
    edges: Vec<(DVec3, DVec3, f64, f64)>,
    /// Centre and radius of each fork.
    forks: Vec<(DVec3, f64)>,
}

impl Axis {
    pub(crate) fn of(tree: &Tree) -> Self {
        let nodes = tree.nodes();
        let edge = |(a, b): (usize, usize)| {
            (nodes[a].position_mm, nodes[b].position_mm, nodes[a].radius_mm, nodes[b].radius_mm)
        };
        let is_fork = |node: &usize| tree.children(*node).len() > 1;
        let forks =
            (0..tree.n_nodes()).filter(is_fork).map(|node| (nodes[node].position_mm, nodes[node].radius_mm));
        Self { edges: tree.edges().map(edge).collect(), forks: forks.collect() }
    }

    /// The distance to the nearest point of the axis, and the radius there.
    pub(crate) fn nearest(&self, point: DVec3) -> (f64, f64) {
        self.edges.iter().fold((f64::INFINITY, 0.0), |best, &(a, b, radius_a, radius_b)| {
            let share = nearest_parameter(point, a, b);
            let distance = point.distance(a.lerp(b, share));
            if distance < best.0 { (distance, radius_a + share * (radius_b - radius_a)) } else { best }
        })
    }

    /// Whether a point lies in the sphere of a fork.
    pub(crate) fn is_in_fork(&self, point: DVec3) -> bool {
        self.forks.iter().any(|&(center, radius)| point.distance(center) < radius)
    }
}

/// Places and radii along all edges, `step_mm` apart or a little less.
pub(crate) fn steps(tree: &Tree, step_mm: f64) -> impl Iterator<Item = (DVec3, f64)> {
    tree.edges().flat_map(move |(a, b)| {
        let (a, b) = (tree.nodes()[a], tree.nodes()[b]);
        let n_steps = (a.position_mm.distance(b.position_mm) / step_mm).ceil().max(1.0) as usize;
        (0..n_steps).map(move |i| {
            let share = (i as f64 + 0.5) / n_steps as f64;
            (a.position_mm.lerp(b.position_mm, share), a.radius_mm + share * (b.radius_mm - a.radius_mm))
        })
    })
}
