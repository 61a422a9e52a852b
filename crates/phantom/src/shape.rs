//! A ground truth under construction: nodes in any order, and the edges that close rings.

use espalier_geom::angle;
use espalier_model::Node;
use glam::DVec3;

use crate::params::MAX_NODES;
use crate::{Error, Params};

/// The step to which positions and radii of bodies are rounded, in mm.
pub(crate) const QUANTUM_MM: f64 = 1e-4;

/// Nodes with parents before children, and the edges that a tree cannot hold.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    pub(crate) nodes: Vec<Node>,
    /// Pairs of nodes that the body joins although the tree does not.
    pub(crate) closing: Vec<(usize, usize)>,
}

impl Shape {
    /// Adds a node and returns its index.
    pub(crate) fn push(&mut self, parent: Option<usize>, position_mm: DVec3, radius_mm: f64) -> usize {
        self.nodes.push(Node { position_mm, radius_mm, parent, kind: 0 });
        self.nodes.len() - 1
    }

    /// Adds a chain from `start` along `curve(s)`, s in mm from 0 (at `start`) to `length_mm`, and returns its
    /// last node. Each node's radius is `radius(s)`.
    pub(crate) fn trace(
        &mut self,
        start: usize,
        (length_mm, step_mm): (f64, f64),
        curve: impl Fn(f64) -> DVec3,
        radius: impl Fn(f64) -> f64,
    ) -> Result<usize, Error> {
        let n_steps = (length_mm / step_mm).ceil().max(1.0);
        self.check_room(n_steps)?;
        let mut last = start;
        for step in 1..=n_steps as usize {
            let s = length_mm * step as f64 / n_steps;
            last = self.push(Some(last), curve(s), radius(s));
        }
        Ok(last)
    }

    /// Refuses to grow beyond [`MAX_NODES`].
    fn check_room(&self, n_more: f64) -> Result<(), Error> {
        let n_nodes = self.nodes.len() as f64 + n_more;
        if n_nodes > MAX_NODES as f64 {
            return Err(Error::TooManyNodes { n_nodes: n_nodes as usize, limit: MAX_NODES });
        }
        Ok(())
    }

    /// Scales positions and radii about the world's origin.
    pub(crate) fn scale(&mut self, factor: f64) {
        for node in &mut self.nodes {
            node.position_mm *= factor;
            node.radius_mm *= factor;
        }
    }

    /// Rounds positions and radii to multiples of `quantum_mm`; radii stay above zero.
    pub(crate) fn round(&mut self, quantum_mm: f64) {
        let per_mm = (1.0 / quantum_mm).round();
        let rounded = |value: f64| (value * per_mm).round() / per_mm;
        for node in &mut self.nodes {
            node.position_mm = DVec3::new(
                rounded(node.position_mm.x),
                rounded(node.position_mm.y),
                rounded(node.position_mm.z),
            );
            node.radius_mm = rounded(node.radius_mm).max(1.0 / per_mm);
        }
    }
}

/// The frame of a closed form: `axis` along the parameters' direction, `side` and `depth` perpendicular to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) axis: DVec3,
    pub(crate) side: DVec3,
    pub(crate) depth: DVec3,
}

impl Frame {
    pub(crate) fn of(params: &Params) -> Self {
        let axis = DVec3::from_array(params.direction).normalize();
        // The hint makes `side` the patient's right as far as the axis lets it.
        let (back, right) = espalier_geom::space::plane_axes(axis, DVec3::X);
        let roll = espalier_geom::math::unit_vector(angle::wrap(params.roll_deg.to_radians()));
        let side = right * roll.x - back * roll.y;
        Self { axis, side, depth: axis.cross(side) }
    }

    /// The unit vector that leaves the axis by `angle_rad` towards `side`.
    pub(crate) fn turned(&self, angle_rad: f64) -> DVec3 {
        let heading = espalier_geom::math::unit_vector(angle_rad);
        self.axis * heading.x + self.side * heading.y
    }
}
