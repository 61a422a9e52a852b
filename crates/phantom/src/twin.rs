//! The diseased twin of a tree: the same organ at another time, with changes that are known.
//!
//! **Input** a tree, what shall have happened to it, a seed. **Output** the changed tree, RAS+ mm.
//! **Steps** 1. Radii of narrowed branches. 2. Subtrees taken away. 3. Branches grown. 4. Every point moved a little.
//! 5. The whole turned and moved, as a patient lies differently in another scan.
//! **Guarantees** without any change the tree is the same, node for node. A fork that loses its branches but one stays as
//! a node of the branch that goes on.
//! **Cost** O(nodes).

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Node, Tree};
use glam::{DMat3, DVec3};

use crate::error::Error;

/// What has happened to a tree. Branches are numbered as in the tree before.
#[derive(Clone, Debug, PartialEq)]
pub struct Disease {
    /// Branches that are gone, with all that hangs from them.
    pub lost: Vec<usize>,
    /// Branches narrowed between a quarter and three quarters of their length: to this share of their radius.
    pub narrowed: Vec<(usize, f64)>,
    /// Branches that have grown.
    pub grown: Vec<Growth>,
    /// By how much each coordinate may be off, in mm.
    pub jitter_mm: f64,
    /// A rotation, then a translation in mm.
    pub moved: (DMat3, DVec3),
}

/// A branch that has grown, straight, half as wide as the one it leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// The branch that it leaves.
    pub branch: usize,
    /// Where, as a share of that branch's length.
    pub share: f64,
    /// Its direction; any length but zero.
    pub direction: DVec3,
    /// How long it is, in mm.
    pub length_mm: f64,
}

impl Default for Disease {
    fn default() -> Self {
        Self {
            lost: Vec::new(),
            narrowed: Vec::new(),
            grown: Vec::new(),
            jitter_mm: 0.0,
            moved: (DMat3::IDENTITY, DVec3::ZERO),
        }
    }
}

/// Makes the twin.
///
/// # Errors
/// [`Error::Tree`] where the changes leave no tree, such as points jittered onto each other.
pub fn twin(tree: &Tree, disease: &Disease, seed: u64) -> Result<Tree, Error> {
    let mut nodes: Vec<Node> = tree.nodes().to_vec();
    narrow(tree, &disease.narrowed, &mut nodes);
    let mut is_there = vec![true; nodes.len()];
    let branches = tree.branches();
    for branch in disease.lost.iter().filter_map(|&lost| branches.list().get(lost)) {
        is_there[tree.subtree(branch.nodes.start)].fill(false);
    }
    for growth in &disease.grown {
        grow(tree, growth, (&mut nodes, &mut is_there));
    }
    let mut stream = Stream::new(seed, Purpose::PhantomShape, u32::MAX, 0);
    let (rotation, translation_mm) = disease.moved;
    let mut place = vec![None; nodes.len()];
    let mut kept = Vec::new();
    for (idx, node) in nodes.iter().enumerate().filter(|&(idx, _)| is_there[idx]) {
        place[idx] = Some(kept.len());
        let mut off = || stream.uniform(-disease.jitter_mm, disease.jitter_mm);
        let position_mm = rotation * (node.position_mm + DVec3::new(off(), off(), off())) + translation_mm;
        kept.push(Node { position_mm, parent: node.parent.and_then(|parent| place[parent]), ..*node });
    }
    Ok(Tree::new(&kept)?)
}

/// Nodes in the middle half of a branch; the ends keep their radii.
fn narrow(tree: &Tree, narrowed: &[(usize, f64)], nodes: &mut [Node]) {
    let branches = tree.branches();
    for &(number, share) in narrowed {
        let Some(branch) = branches.list().get(number) else { continue };
        let length_mm = branches.length_mm(tree, number);
        let mut arc_mm = 0.0;
        for node in branch.nodes.clone() {
            arc_mm += tree.edge_length_mm(node);
            if (0.25..=0.75).contains(&(arc_mm / length_mm)) {
                nodes[node].radius_mm *= share;
            }
        }
    }
}

/// A new branch from the node nearest to its place.
fn grow(tree: &Tree, growth: &Growth, (nodes, is_there): (&mut Vec<Node>, &mut Vec<bool>)) {
    /// Nodes of the new branch.
    const N_NODES: usize = 6;
    let branches = tree.branches();
    let Some(branch) = branches.list().get(growth.branch) else { return };
    let wanted_mm = growth.share * branches.length_mm(tree, growth.branch);
    let (mut arc_mm, mut nearest) = (0.0, (f64::INFINITY, branch.end()));
    for node in branch.nodes.clone() {
        arc_mm += tree.edge_length_mm(node);
        let off = f64::abs(arc_mm - wanted_mm);
        if off < nearest.0 {
            nearest = (off, node);
        }
    }
    let mut above = nearest.1;
    let hub = nodes[above];
    for step in 1..=N_NODES {
        let way = growth.length_mm * step as f64 / N_NODES as f64;
        let position_mm = hub.position_mm + way * growth.direction.normalize_or(DVec3::X);
        nodes.push(Node { position_mm, radius_mm: 0.5 * hub.radius_mm, parent: Some(above), kind: hub.kind });
        is_there.push(true);
        above = nodes.len() - 1;
    }
}
