//! The tree as it stands before the picture: flat, or in space as the global view sees it.
//!
//! **Input** a tree with its embedding or its global view. **Output** a point (x to the right, y up, z towards the
//! viewer, mm) and a drawn radius for each node.

use std::f64::consts::TAU;

use espalier_geom::{angle, math};
use espalier_model::{Embedding, Tree, View};
use glam::{DVec2, DVec3};

use crate::Error;

/// The largest coordinate that leaves room for squares in `f32` pixels, in mm: a million kilometres.
const FARTHEST_MM: f64 = 1e12;

/// A tree in picture space.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scene {
    /// By node, mm.
    pub points_mm: Vec<DVec3>,
    /// The radius to draw by node, mm; at least 0.
    pub radii_mm: Vec<f64>,
    /// By how many degrees the whole was turned counter-clockwise, to fit a page.
    pub turn_deg: u32,
}

impl Scene {
    /// The embedded tree; z is 0 everywhere.
    pub(crate) fn planar(tree: &Tree, embedding: &Embedding, width_scale: f64) -> Result<Self, Error> {
        Self::flat(tree, &embedding.positions_mm, width_scale)
    }

    /// The tree with its nodes at these places; z is 0 everywhere.
    pub(crate) fn flat(tree: &Tree, positions_mm: &[DVec2], width_scale: f64) -> Result<Self, Error> {
        Self::new(tree, positions_mm.iter().map(|position| position.extend(0.0)).collect(), width_scale)
    }

    /// The tree in space, as an orthographic view sees it.
    pub(crate) fn seen(tree: &Tree, view: &View, width_scale: f64) -> Result<Self, Error> {
        let View { towards_camera, up, center_mm, .. } = *view;
        let right = up.cross(towards_camera);
        let is_frame = (towards_camera.length() - 1.0).abs() < 1e-6
            && (up.length() - 1.0).abs() < 1e-6
            && (right.length() - 1.0).abs() < 1e-6;
        if !is_frame || !center_mm.is_finite() {
            return Err(Error::View { towards_camera, up });
        }
        let points = tree.nodes().iter().map(|node| {
            let offset = node.position_mm - center_mm;
            DVec3::new(offset.dot(right), offset.dot(up), offset.dot(towards_camera))
        });
        Self::new(tree, points.collect(), width_scale)
    }

    fn new(tree: &Tree, points_mm: Vec<DVec3>, width_scale: f64) -> Result<Self, Error> {
        let radii_mm: Vec<f64> = tree.nodes().iter().map(|node| node.radius_mm * width_scale).collect();
        for (node, (point, &radius_mm)) in points_mm.iter().zip(&radii_mm).enumerate() {
            let far = point.abs().max_element();
            if !point.is_finite() || far > FARTHEST_MM {
                return Err(Error::Number { node, what: "picture coordinate", value: far });
            }
            if radius_mm > FARTHEST_MM {
                return Err(Error::Number { node, what: "drawn radius", value: radius_mm });
            }
        }
        Ok(Self { points_mm, radii_mm, turn_deg: 0 })
    }

    /// The same with as much around each tube as `reach_mm` says for its radius.
    pub(crate) fn reaching(&self, reach_mm: impl Fn(f64) -> f64) -> Self {
        Self {
            radii_mm: self.radii_mm.iter().map(|&radius| radius + reach_mm(radius)).collect(),
            ..self.clone()
        }
    }

    /// The same centrelines without any width.
    pub(crate) fn without_radii(self) -> Self {
        Self { radii_mm: vec![0.0; self.radii_mm.len()], ..self }
    }

    /// The same, turned counter-clockwise about the origin.
    pub(crate) fn turned(&self, turn_deg: u32) -> Self {
        let turn = math::unit_vector(f64::from(turn_deg).to_radians());
        let turned = |point: &DVec3| turn.rotate(point.truncate()).extend(point.z);
        Self {
            points_mm: self.points_mm.iter().map(turned).collect(),
            radii_mm: self.radii_mm.clone(),
            turn_deg: (self.turn_deg + turn_deg) % 360,
        }
    }

    /// The corners of the box that holds every drawn disc, mm.
    pub(crate) fn bounds_mm(&self) -> (DVec2, DVec2) {
        self.points_mm.iter().zip(&self.radii_mm).fold(
            (DVec2::INFINITY, DVec2::NEG_INFINITY),
            |(low, high), (point, &radius)| {
                (low.min(point.truncate() - radius), high.max(point.truncate() + radius))
            },
        )
    }

    /// The direction from the root in which there is most room between its branches, a unit vector; up if it has
    /// none. A branch heads for its first node that is at least `reach_mm` away: the first edge alone may wander.
    pub(crate) fn away_from_branches(&self, tree: &Tree, reach_mm: f64) -> DVec2 {
        let root = self.points_mm[0].truncate();
        let offset = |node: usize| self.points_mm[node].truncate() - root;
        let heading_of = |child: usize| {
            let mut node = child;
            while let &[only] = tree.children(node)
                && offset(node).length() < reach_mm
            {
                node = only;
            }
            angle::heading(offset(node))
        };
        let mut headings: Vec<f64> = tree.children(0).iter().map(|&child| heading_of(child)).collect();
        headings.sort_by(f64::total_cmp);
        let Some(&first) = headings.first() else { return DVec2::Y };
        let next = headings.iter().skip(1).copied().chain([first + TAU]);
        let (_, heading) = headings
            .iter()
            .zip(next)
            .map(|(&from, to)| (to - from, 0.5 * (from + to)))
            .reduce(|widest, other| if other.0 > widest.0 { other } else { widest })
            .unwrap_or((0.0, first));
        math::unit_vector(heading)
    }
}
