//! By how much branches turn at forks.
//!
//! **Input** tree, branches, their lines. **Output** two angles for each branch, in degrees.
//! **Steps** 1. The direction of a branch at a fork of radius r is its chord from r to 3 r along the branch: inside of
//! the fork's sphere the axis only leads from the parent's axis to the branch's own, and further out a bend of the
//! branch is not the fork's. A stretch shorter than r, because the branch is, gives way to the whole branch's chord; at
//! a fork without radius the first edge tells. 2. The parent's direction is measured likewise, towards its end.
//! **Source** the distances are ours; that angles are to be taken from outside of the fork is usual, see [Tawhai2004].
//! **Cost** O(points + Σ k²) over the forks of k branches.

use espalier_geom::math;
use espalier_model::{Branches, Tree};
use glam::DVec3;

use super::line::Line;

/// The length of the chord that tells a direction, in radii of the fork.
const STRETCH: f64 = 2.0;
/// Forks of more branches than this are no forks of vessels; the angle to the nearest sibling is not looked for.
const MAX_SIBLINGS: usize = 64;

/// The angles of one branch; `NaN` where there is no parent, no sibling or no direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Angles {
    pub(super) to_parent_deg: f64,
    pub(super) to_sibling_deg: f64,
}

pub(super) fn of(tree: &Tree, branches: &Branches, lines: &[Line]) -> Vec<Angles> {
    let outward: Vec<DVec3> = lines.iter().map(direction_at_start).collect();
    let list = branches.list();
    list.iter()
        .enumerate()
        .map(|(branch_idx, branch)| {
            let own = outward[branch_idx];
            let to_parent_deg =
                branch.parent.map_or(f64::NAN, |parent| between_deg(direction_at_end(&lines[parent]), own));
            let siblings = tree.children(branch.hub);
            let is_crowd = siblings.len() > MAX_SIBLINGS;
            let others = siblings.iter().filter(|_| !is_crowd).filter_map(|&node| branches.of_node(node));
            let to_sibling_deg = others
                .filter(|&other| other != branch_idx)
                .map(|other| between_deg(own, outward[other]))
                .fold(f64::NAN, f64::min);
            Angles { to_parent_deg, to_sibling_deg }
        })
        .collect()
}

/// Where a branch heads when it has left its fork; 0 if it has no direction.
fn direction_at_start(line: &Line) -> DVec3 {
    let [fork_mm, end_fork_mm] = line.forks_mm;
    chord(line, [0.0, line.length_mm()], (fork_mm, end_fork_mm), line.arcs_mm[1])
}

/// Where a branch heads before it comes to the fork at its end.
fn direction_at_end(line: &Line) -> DVec3 {
    let [start_fork_mm, fork_mm] = line.forks_mm;
    let (length_mm, last) = (line.length_mm(), line.arcs_mm.len() - 1);
    -chord(line, [length_mm, 0.0], (fork_mm, start_fork_mm), length_mm - line.arcs_mm[last - 1])
}

/// The direction of the stretch that begins one fork's radius from `here`, seen from there.
fn chord(
    line: &Line,
    [here, there]: [f64; 2],
    (fork_mm, far_fork_mm): (f64, f64),
    first_edge_mm: f64,
) -> DVec3 {
    let length_mm = (there - here).abs();
    let near = fork_mm;
    let far =
        if fork_mm > 0.0 { (near + STRETCH * fork_mm).min(length_mm - far_fork_mm) } else { first_edge_mm };
    let (near, far) = if far - near < fork_mm { (0.0, length_mm) } else { (near, far) };
    let at = |distance: f64| line.point_mm(if there > here { here + distance } else { here - distance });
    (at(far) - at(near)).normalize_or_zero()
}

fn between_deg(a: DVec3, b: DVec3) -> f64 {
    if a == DVec3::ZERO || b == DVec3::ZERO {
        return f64::NAN;
    }
    math::atan2(a.cross(b).length(), a.dot(b)).to_degrees()
}
