//! The map as a map: which point of the patient a point of the plane stands for, and back.
//!
//! **Input** a tree and where its nodes lie in the plane. **Output** [`PlanarMap`]: points of the plane (mm, x right,
//! y up) to points of the patient (RAS+ mm) and back. The EXR's positions, the volume on the map and
//! `espalier locate` all ask here.
//! **Notation** C₂ and C₃ the centreline in the plane and in space, s the share of an edge, F the frame: a rotation
//! that takes the plane's axes (right, up, to the viewer) into the patient.
//! **Steps** A point p of the plane belongs to an edge. Its foot is the nearest point C₂(s) of that edge. It stands for
//! C₃(s) + F(s) (p − C₂(s)): what lies across the drawn branch lies across it in the patient too, at the same distance.
//! Frames of nodes come from `frames`; between them F is the normalised mean of their quaternions, so that the map goes
//! on without a jump from edge to edge of a branch.
//! **Which edge** inside of tubes the one whose surface is highest there, as drawn; outside the one whose outline is
//! nearest: [`reach`]. A point on a centreline belongs to it also where another tube covers it.
//! **Guarantees** points on the centreline are exact, both ways; lengths across are true; the result is a function of
//! tree and layout alone.
//! **Cost** O(1) a point whose edge is known, O(edges) to find it.

mod frames;

use espalier_geom::{plane, space};
use espalier_model::{Embedding, Tree, ViewHierarchy};
use glam::{DQuat, DVec2, DVec3};

/// What counts as on the centreline where no layout says to what its numbers are rounded, mm.
const ON_CENTER_MM: f64 = 1e-6;

/// The map of an embedded tree.
#[derive(Clone, Debug)]
pub struct PlanarMap<'a> {
    tree: &'a Tree,
    positions_mm: &'a [DVec2],
    frames: Vec<DQuat>,
    /// Points as near to a centreline belong to it, whatever tube else they lie in.
    on_center_mm: f64,
}

/// A place on the centreline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The lower node of the edge; 0 only in a tree of one node.
    pub node: usize,
    /// The share of the edge: 0 at the parent, 1 at the node.
    pub share: f64,
}

/// A place on the centreline with what lies beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// The nearest place on the edge.
    pub place: Place,
    /// The point in the patient, RAS+ mm.
    pub patient_mm: DVec3,
    /// The point in the plane, mm.
    pub plane_mm: DVec2,
    /// How far the point in the patient lies off the surface that the map shows, towards the viewer, in mm.
    pub out_of_plane_mm: f64,
}

impl<'a> PlanarMap<'a> {
    /// The map of a tree whose nodes lie at `positions_mm`, one for each. `to_viewer` is the direction in the patient
    /// that a straight tree, which has no plane of its own, shows the viewer; its length does not count.
    ///
    /// # Panics
    /// If there are not as many positions as nodes: a mistake of the caller's code.
    #[must_use]
    pub fn new(tree: &'a Tree, positions_mm: &'a [DVec2], to_viewer: DVec3) -> Self {
        assert_eq!(positions_mm.len(), tree.n_nodes(), "one position for each node");
        let frames = frames::frames(tree, positions_mm, to_viewer);
        Self { tree, positions_mm, frames, on_center_mm: ON_CENTER_MM }
    }

    /// The map of an embedded tree; a straight tree shows the side that the global view sees.
    #[must_use]
    pub fn of(tree: &'a Tree, embedding: &'a Embedding, views: &ViewHierarchy) -> Self {
        let to_viewer = views.global.towards_camera;
        let is_reflected = embedding.pose.is_reflected;
        let to_viewer = if is_reflected { -to_viewer } else { to_viewer };
        Self { on_center_mm: embedding.quantum_mm, ..Self::new(tree, &embedding.positions_mm, to_viewer) }
    }

    /// What a point of the plane stands for, as a point that belongs to the edge above `node`.
    #[must_use]
    pub fn from_plane(&self, node: usize, plane_mm: DVec2) -> Beside {
        let place = self.foot_in_plane(node, plane_mm);
        let aside = plane_mm - self.plane_at(place);
        let patient_mm = self.patient_at(place) + self.frame_at(place) * aside.extend(0.0);
        Beside { place, patient_mm, plane_mm, out_of_plane_mm: 0.0 }
    }

    /// Where a point of the patient lies on the map, as a point that belongs to the edge above `node`.
    #[must_use]
    pub fn from_patient(&self, node: usize, patient_mm: DVec3) -> Beside {
        let place = self.foot_in_patient(node, patient_mm);
        let aside = self.frame_at(place).inverse() * (patient_mm - self.patient_at(place));
        let plane_mm = self.plane_at(place) + aside.truncate();
        Beside { place, patient_mm, plane_mm, out_of_plane_mm: aside.z }
    }

    /// The edge, by its lower node, to which a point of the plane belongs.
    #[must_use]
    pub fn owner_in_plane(&self, plane_mm: DVec2) -> usize {
        self.owner_among(1..self.tree.n_nodes(), plane_mm).unwrap_or(0)
    }

    /// The same of these edges alone, by their lower nodes in preorder; none of none.
    #[must_use]
    pub fn owner_among(&self, edges: impl Iterator<Item = usize>, plane_mm: DVec2) -> Option<usize> {
        Self::owner(edges, |node| {
            let place = self.foot_in_plane(node, plane_mm);
            self.reach(plane_mm.distance(self.plane_at(place)), place)
        })
    }

    /// The edge, by its lower node, to which a point of the patient belongs.
    #[must_use]
    pub fn owner_in_patient(&self, patient_mm: DVec3) -> usize {
        let reach = |node: usize| {
            let place = self.foot_in_patient(node, patient_mm);
            self.reach(patient_mm.distance(self.patient_at(place)), place)
        };
        Self::owner(1..self.tree.n_nodes(), reach).unwrap_or(0)
    }

    /// The centreline in the plane, mm.
    #[must_use]
    pub fn plane_at(&self, place: Place) -> DVec2 {
        let (from, to) = self.ends(place.node);
        self.positions_mm[from].lerp(self.positions_mm[to], place.share)
    }

    /// The centreline in the patient, RAS+ mm.
    #[must_use]
    pub fn patient_at(&self, place: Place) -> DVec3 {
        let (from, to) = self.ends(place.node);
        self.tree.position_mm(from).lerp(self.tree.position_mm(to), place.share)
    }

    /// The frame: the plane's right, up and towards the viewer become directions in the patient.
    #[must_use]
    pub fn frame_at(&self, place: Place) -> DQuat {
        let (from, to) = self.ends(place.node);
        frames::between(self.frames[from], self.frames[to], place.share)
    }

    /// The direction in the plane of the edge above a node, a unit vector; to the right where the edge has no length.
    #[must_use]
    pub fn direction(&self, node: usize) -> DVec2 {
        let (from, to) = self.ends(node);
        (self.positions_mm[to] - self.positions_mm[from]).normalize_or(DVec2::X)
    }

    /// The radius of the organ, mm.
    #[must_use]
    pub fn radius_mm(&self, place: Place) -> f64 {
        let (from, to) = self.ends(place.node);
        let radius = |node: usize| self.tree.nodes()[node].radius_mm;
        radius(from) + place.share * (radius(to) - radius(from))
    }

    fn ends(&self, node: usize) -> (usize, usize) {
        (self.tree.parent(node).unwrap_or(node), node)
    }

    fn foot_in_plane(&self, node: usize, point_mm: DVec2) -> Place {
        let (from, to) = self.ends(node);
        let edge = plane::Segment { a: self.positions_mm[from], b: self.positions_mm[to] };
        Place { node, share: plane::nearest_parameter(point_mm, &edge) }
    }

    fn foot_in_patient(&self, node: usize, point_mm: DVec3) -> Place {
        let (from, to) = self.ends(node);
        let (a, b) = (self.tree.position_mm(from), self.tree.position_mm(to));
        Place { node, share: space::nearest_parameter(point_mm, a, b) }
    }

    fn reach(&self, distance: f64, place: Place) -> f64 {
        if distance <= self.on_center_mm { f64::NEG_INFINITY } else { reach(distance, self.radius_mm(place)) }
    }

    /// The edge with the least `reach`; of equal ones the first.
    fn owner(edges: impl Iterator<Item = usize>, reach: impl Fn(usize) -> f64) -> Option<usize> {
        edges
            .map(|node| (node, reach(node)))
            .reduce(|best, other| if other.1 < best.1 { other } else { best })
            .map(|(node, _)| node)
    }
}

/// How far a point is from belonging to a tube whose axis is `distance` away: outside the distance to its surface,
/// inside minus the square of the height of its surface. The least wins, so that inside of several tubes it is the one
/// that is seen.
#[must_use]
pub fn reach(distance: f64, radius: f64) -> f64 {
    if distance < radius { distance * distance - radius * radius } else { distance - radius }
}

#[cfg(test)]
mod tests;
