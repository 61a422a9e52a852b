//! The frame of each node: how the plane lies in the patient there.
//!
//! **Input** a tree and its layout. **Output** for each node a rotation that takes the plane's axes (right, up, to the
//! viewer) into the patient.
//! **Notation** t and T the direction of the centreline in the plane and in space, n = t turned left, B the patient's
//! direction that is towards the viewer, N = B × T.
//! **Steps** 1. At a fork the frame is the rotation that takes the drawn directions of its branches nearest to their
//! directions in space (least squares: A = Σ T tᵀ, its polar factor A (AᵀA)^(−½)). Where the layout keeps the angles,
//! that is the fork's own plane, seen from the side from which its branches turn as they are drawn; no view has to
//! be asked, so the frame is right also where the layout took another side than the local plane of `views`.
//! 2. Along a branch B is carried by the smallest rotation that takes one edge's direction to the next
//! (rotation-minimising frame), so that the surface that the map shows does not twist of itself.
//! 3. What B is off at the fork at the end is spread along the branch by its length. A branch that ends in a tip has
//! no such end; one that begins at the root without a fork takes the whole from its end.
//! 4. A fork whose branches leave no angle to tell a plane by goes on with the frame of its parent branch.
//! **Guarantees** no frame depends on the order of siblings; square roots, one arctangent and one sine a branch or node.
//! **Source** the smallest rotation from one direction to the next: the limit of rotation-minimising frames as in Wang,
//! Jüttler, Zheng, Liu (2008), whose double reflection is for curves, not polylines.
//! **Cost** O(nodes).

use espalier_geom::{math, space};
use espalier_model::Tree;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// Where the sine of the directions' spread is less than about this squared, as at a fork of 7°, they tell no plane.
const LEAST_SPREAD: f64 = 1e-4;

/// The frames, by node.
pub(super) fn frames(tree: &Tree, positions_mm: &[DVec2], to_viewer: DVec3) -> Vec<DQuat> {
    let layout = Layout { tree, positions_mm };
    let branches = tree.branches();
    let branches = branches.list();
    let mut frames = vec![DQuat::IDENTITY; tree.n_nodes()];

    // 1. Forks, from their own branches.
    let mut is_known = vec![false; tree.n_nodes()];
    for fork in (0..tree.n_nodes()).filter(|&node| tree.children(node).len() > 1) {
        if let Some(frame) = layout.fork(fork) {
            (frames[fork], is_known[fork]) = (frame, true);
        }
    }
    // 2. to 4. Branches, each from its hub, which is known when it is reached.
    for branch in branches {
        let chain: Vec<usize> = branch.polyline().collect();
        let carried = layout.carry(&chain, frames[branch.hub].mul_vec3(DVec3::Z));
        let wanted = is_known[branch.end()].then(|| frames[branch.end()].mul_vec3(DVec3::Z));
        let twist = wanted.map_or(0.0, |wanted| carried.twist_to(wanted));
        let is_free = !is_known[branch.hub];
        let carried = if is_free && wanted.is_none() { layout.carry(&chain, to_viewer) } else { carried };
        for (i, &node) in chain.iter().enumerate() {
            let is_own = i > 0 || is_free;
            if is_own && !is_known[node] {
                let share = if is_free { 1.0 } else { carried.shares[i] };
                frames[node] = carried.frame(i, twist * share);
                is_known[node] = true;
            }
        }
    }
    frames
}

/// The frame between two: the normalised mean of their quaternions.
pub(super) fn between(from: DQuat, to: DQuat, share: f64) -> DQuat {
    // A rotation has two quaternions; the nearer one of the second's is meant.
    let to = if from.dot(to) < 0.0 { -to } else { to };
    (from * (1.0 - share) + to * share).normalize()
}

/// The tree in space and in the plane.
struct Layout<'a> {
    tree: &'a Tree,
    positions_mm: &'a [DVec2],
}

/// A branch with a direction carried along it.
struct Carried {
    /// By node of its chain: the direction in the plane and in space, and B.
    directions: Vec<(DVec2, DVec3)>,
    normals: Vec<DVec3>,
    /// B at the end as the last edge has it, and that edge's direction.
    end: (DVec3, DVec3),
    /// By node: the share of the branch's length before it.
    shares: Vec<f64>,
}

impl Layout<'_> {
    /// The frame of a fork; none where its branches are too much in line.
    fn fork(&self, fork: usize) -> Option<DQuat> {
        let reach_mm = self.tree.nodes()[fork].radius_mm;
        let mut chords: Vec<(DVec2, DVec3)> = Vec::new();
        // Backwards to the parent: both ends of both directions turn over, so their product stays.
        chords.extend(self.chord(fork, reach_mm, |node| self.tree.parent(node)));
        for &child in self.tree.children(fork) {
            let only_child = |node: usize| match (node == fork, self.tree.children(node)) {
                (true, _) => Some(child),
                (false, &[only]) => Some(only),
                (false, _) => None,
            };
            chords.extend(self.chord(fork, reach_mm, only_child));
        }
        polar(&chords)
    }

    /// The directions from a node to the first one on the way that is `reach_mm` away, or else the last before the way
    /// forks.
    fn chord(
        &self,
        from: usize,
        reach_mm: f64,
        next: impl Fn(usize) -> Option<usize>,
    ) -> Option<(DVec2, DVec3)> {
        let start = (self.positions_mm[from], self.tree.position_mm(from));
        let mut node = next(from)?;
        while start.1.distance(self.tree.position_mm(node)) < reach_mm
            && self.tree.children(node).len() == 1
            && let Some(further) = next(node)
        {
            node = further;
        }
        let flat = (self.positions_mm[node] - start.0).try_normalize()?;
        Some((flat, (self.tree.position_mm(node) - start.1).try_normalize()?))
    }

    /// Carries B along a chain of nodes.
    fn carry(&self, chain: &[usize], start: DVec3) -> Carried {
        let edge = |i: usize| {
            let flat = self.positions_mm[chain[i + 1]] - self.positions_mm[chain[i]];
            let full = self.tree.position_mm(chain[i + 1]) - self.tree.position_mm(chain[i]);
            (flat.normalize_or(DVec2::X), full.normalize_or(DVec3::Z))
        };
        let last = chain.len() - 1;
        let mut normal = across(start, edge(0).1);
        let (mut directions, mut normals) = (vec![edge(0)], vec![normal]);
        let (mut length, mut shares) = (0.0, vec![0.0]);
        for (i, &node) in chain.iter().enumerate().skip(1) {
            length += self.tree.edge_length_mm(node);
            shares.push(length);
            let before = edge(i - 1);
            let after = if i < last { edge(i) } else { before };
            let middle =
                ((before.0 + after.0).normalize_or(after.0), (before.1 + after.1).normalize_or(after.1));
            directions.push(middle);
            normals.push(turned(normal, before.1, middle.1));
            if i < last {
                normal = turned(normal, before.1, after.1);
            }
        }
        shares.iter_mut().for_each(|share| *share /= length.max(f64::MIN_POSITIVE));
        Carried { directions, normals, end: (normal, edge(last - 1).1), shares }
    }
}

impl Carried {
    /// The angle about the last edge that brings the carried B to the wanted one.
    fn twist_to(&self, wanted: DVec3) -> f64 {
        let (normal, along) = self.end;
        let wanted = across(wanted, along);
        math::atan2(along.dot(normal.cross(wanted)), normal.dot(wanted))
    }

    /// The frame at a node of the chain, its B turned about the branch.
    fn frame(&self, i: usize, twist: f64) -> DQuat {
        let (flat, along) = self.directions[i];
        let normal = across(self.normals[i], along);
        let (sin, cos) = math::sin_cos(twist);
        let normal = normal * cos + along.cross(normal) * sin;
        let left = normal.cross(along);
        // t ↦ T and n ↦ N: the axes of the plane by components.
        let (right, up) = (along * flat.x - left * flat.y, along * flat.y + left * flat.x);
        rotation(right, up)
    }
}

/// The rotation that takes the plane's axes nearest to where the directions lie in space.
fn polar(chords: &[(DVec2, DVec3)]) -> Option<DQuat> {
    let sum = |part: fn(&DVec2) -> f64| chords.iter().map(|(flat, full)| *full * part(flat)).sum::<DVec3>();
    let (a, b) = (sum(|flat| flat.x), sum(|flat| flat.y));
    // AᵀA and its square root: (G + √det G · 1) / √(tr G + 2 √det G).
    let (p, q, r) = (a.length_squared(), a.dot(b), b.length_squared());
    let (det, trace) = (p * r - q * q, p + r);
    if det.is_nan() || det <= LEAST_SPREAD * trace * trace {
        return None;
    }
    let root = det.sqrt();
    let (p, r) = (p + root, r + root);
    // The inverse up to a factor; lengths are set below.
    let (right, up) = (a * r - b * q, b * p - a * q);
    Some(rotation(right, up))
}

/// The rotation that takes x to `right` and y as near to `up` as it can.
fn rotation(right: DVec3, up: DVec3) -> DQuat {
    let right = right.normalize_or(DVec3::X);
    let up = across(up, right);
    DQuat::from_mat3(&DMat3::from_cols(right, up, right.cross(up)))
}

/// The part of a direction that is across a unit vector, as a unit vector; some other one where there is none.
fn across(direction: DVec3, along: DVec3) -> DVec3 {
    space::plane_axes(along, direction).1
}

/// A direction across `from`, turned by the smallest rotation that takes `from` to `to`, both unit vectors.
fn turned(direction: DVec3, from: DVec3, to: DVec3) -> DVec3 {
    let cos = from.dot(to);
    // On a fold back there is no smallest rotation.
    let turned =
        if cos > -0.999 { direction - (from + to) * (direction.dot(to) / (1.0 + cos)) } else { direction };
    across(turned, to)
}
