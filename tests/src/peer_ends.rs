//! The ends of another program's skeleton, each with what our tree has there.
//!
//! **Input** a mask, a skeleton of it that another program made, and our tree of the mask. **Output** [`PeerEnd`]s.
//! **Why reasons?** A skeleton of voxels ends at the wall, our branches at the centre of their last sphere; and who thins in
//! another order ends elsewhere in a broad end. What counts is whether a branch was found, and to its end.

use std::fmt::{self, Display};

use espalier_geom::space::nearest_parameter;
use espalier_model::{Mask, Tree};
use glam::DVec3;

use crate::ground_truth::free_ends;

/// An end is found if it lies no further away than this.
pub const FOUND_MM: f64 = 3.0;
/// Why the nearest tip is not at the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reason {
    /// It is.
    SameEnd,
    /// Ours passes by and has its tip further out on that branch, by so many mm of arc.
    RunsOn(f64),
    /// The last sphere of ours reaches to within [`FOUND_MM`]: so far, in mm, the peer's line goes on beyond its surface.
    EndOfSphere(f64),
    /// No further beyond the surface of ours than a voxel is long: the peer's spur in a bump of the wall.
    Bump(f64),
    /// So many mm beyond the surface of ours.
    Lost(f64),
}

/// One end of the peer's skeleton.
#[derive(Clone, Copy, Debug)]
pub struct PeerEnd {
    /// RAS+ mm.
    pub position_mm: DVec3,
    /// To the nearest free end of ours.
    pub to_tip_mm: f64,
    /// To the nearest place of ours.
    pub to_curve_mm: f64,
    /// What explains the distance.
    pub reason: Reason,
}

impl Display for PeerEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.position_mm.to_array();
        write!(f, "{x:8.1} {y:8.1} {z:8.1} {:8.2} {:10.2}  ", self.to_tip_mm, self.to_curve_mm)?;
        match self.reason {
            Reason::SameEnd => write!(f, "same end"),
            Reason::RunsOn(mm) => write!(f, "ours runs on {mm:.1} mm, inside of the mask"),
            Reason::EndOfSphere(mm) => {
                write!(
                    f,
                    "ours ends at the centre of its last sphere; the peer's {mm:.1} mm beyond its surface"
                )
            }
            Reason::Bump(mm) => {
                write!(f, "the peer's spur in a bump of the wall, {mm:.1} mm beyond our surface")
            }
            Reason::Lost(mm) => write!(f, "not in our tree: {mm:.1} mm beyond our surface"),
        }
    }
}

/// What our tree has at each end of a peer's skeleton.
#[must_use]
pub fn compare(peer: &Mask, tree: &Tree) -> Vec<PeerEnd> {
    let tips = free_ends(tree);
    let longest_mm = peer.grid().spacing_mm().max_element();
    ends_mm(peer).into_iter().map(|place| compare_end(place, tree, &tips, longest_mm)).collect()
}

/// The voxels with exactly one neighbour, RAS+ mm.
fn ends_mm(peer: &Mask) -> Vec<DVec3> {
    let has_one = |voxel: &[usize; 3]| {
        let steps = (0..27).filter(|&i| i != 13).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
        let near = steps.map(|step| [0, 1, 2].map(|axis| voxel[axis] as i64 + step[axis]));
        near.filter(|&voxel| peer.contains(voxel)).count() == 1
    };
    let world_from_voxel = peer.grid().world_from_voxel();
    let place = |voxel: [usize; 3]| DVec3::from_array(voxel.map(|c| c as f64));
    peer.voxels().filter(has_one).map(|voxel| world_from_voxel.transform_point3(place(voxel))).collect()
}

/// The distance to the nearest place of the tree, its edge and the share of the way along it, and the radius there.
fn nearest_place(place: DVec3, tree: &Tree) -> (f64, (usize, usize), f64, f64) {
    let on_edge = |(a, b): (usize, usize)| {
        let share = nearest_parameter(place, tree.position_mm(a), tree.position_mm(b));
        let [radius_a, radius_b] = [a, b].map(|node| tree.nodes()[node].radius_mm);
        let distance_mm = place.distance(tree.position_mm(a).lerp(tree.position_mm(b), share));
        (distance_mm, (a, b), share, radius_a + share * (radius_b - radius_a))
    };
    let nearest = tree.edges().map(on_edge).min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.unwrap_or((place.distance(tree.position_mm(0)), (0, 0), 0.0, tree.nodes()[0].radius_mm))
}

fn compare_end(place: DVec3, tree: &Tree, tips: &[usize], longest_mm: f64) -> PeerEnd {
    let nearest = tips.iter().map(|&tip| (place.distance(tree.position_mm(tip)), tip));
    let (to_tip_mm, tip) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0));
    let (to_curve_mm, edge, share, radius_mm) = nearest_place(place, tree);
    let beyond_tip_mm = (to_tip_mm - tree.nodes()[tip].radius_mm).max(0.0);
    let beyond_mm = to_curve_mm - radius_mm;
    let reason = if to_tip_mm <= FOUND_MM {
        Reason::SameEnd
    } else if let (true, Some(mm)) = (to_curve_mm <= FOUND_MM, left_mm(tree, edge, share)) {
        Reason::RunsOn(mm)
    } else if beyond_tip_mm <= FOUND_MM {
        Reason::EndOfSphere(beyond_tip_mm)
    } else if beyond_mm <= longest_mm {
        Reason::Bump(beyond_mm)
    } else {
        Reason::Lost(beyond_mm)
    };
    PeerEnd { position_mm: place, to_tip_mm, to_curve_mm, reason }
}

/// How far it is along a terminal branch to its tip; `None` on other branches.
fn left_mm(tree: &Tree, (a, b): (usize, usize), share: f64) -> Option<f64> {
    let mut node = if tree.parent(b) == Some(a) { b } else { a };
    let share = if node == b { share } else { 1.0 - share };
    let mut left_mm = (1.0 - share) * tree.edge_length_mm(node);
    while let &[next] = tree.children(node) {
        left_mm += tree.edge_length_mm(next);
        node = next;
    }
    tree.children(node).is_empty().then_some(left_mm)
}
