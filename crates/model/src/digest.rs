//! What tells one tree, or one set of targets, from another.
//!
//! **Input** a tree. **Output** its digest: BLAKE3 of its canonical bytes, 64 hexadecimal digits.
//! **Canonical bytes** all little-endian: the number of nodes (u64); then for each node in preorder its parent
//! (u64, all ones for the root), its kind (i32), and the bits of x, y, z and radius in mm (f64, −0 as 0).
//! **Guarantees** trees that are equal by `==` have one digest; any other number in any node gives another one.
//! **Cost** O(N).

use crate::embedding::Targets;
use crate::tree::Tree;

/// The one NaN that stands for any.
const NAN_BITS: u64 = 0x7ff8_0000_0000_0000;

impl Targets {
    /// The digest of the targets: BLAKE3 over their kind's name, the number of nodes (u64), then the angles, lengths,
    /// headings and confidences of all nodes, bit for bit (f64, −0 as 0, any NaN as one; all little-endian).
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(self.kind.name().as_bytes());
        hasher.update(&(self.angle_rad.len() as u64).to_le_bytes());
        for column in [&self.angle_rad, &self.length_mm, &self.heading_rad, &self.confidence] {
            for &number in column {
                let bits = if number.is_nan() { NAN_BITS } else { (number + 0.0).to_bits() };
                hasher.update(&bits.to_le_bytes());
            }
        }
        hasher.finalize().to_hex().to_string()
    }
}

impl Tree {
    /// The digest of the tree: 64 hexadecimal digits of BLAKE3 over its nodes, bit for bit.
    ///
    /// Files that mean nothing without their tree carry it, so that they are refused for another one.
    ///
    /// ```
    /// use espalier_model::{Node, Tree};
    /// use glam::DVec3;
    /// let node = |z: f64, parent| Node { position_mm: DVec3::new(0.0, 0.0, z), radius_mm: 0.5, parent, kind: 3 };
    /// let tree = Tree::new(&[node(0.0, None), node(1.0, Some(0))])?;
    /// let other = Tree::new(&[node(0.0, None), node(1.0 + f64::EPSILON, Some(0))])?;
    /// assert_eq!(tree.digest().len(), 64);
    /// assert_ne!(tree.digest(), other.digest());
    /// # Ok::<(), espalier_model::TreeError>(())
    /// ```
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&(self.n_nodes() as u64).to_le_bytes());
        for node in self.nodes() {
            let parent = node.parent.map_or(u64::MAX, |parent| parent as u64);
            hasher.update(&parent.to_le_bytes());
            hasher.update(&node.kind.to_le_bytes());
            let [x, y, z] = node.position_mm.to_array();
            for number in [x, y, z, node.radius_mm] {
                // −0 and 0 are one coordinate and shall have one byte pattern.
                hasher.update(&(number + 0.0).to_bits().to_le_bytes());
            }
        }
        hasher.finalize().to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::tree::Node;

    fn fork() -> Vec<Node> {
        let node = |x: f64, y: f64, parent| Node {
            position_mm: DVec3::new(x, y, 0.0),
            radius_mm: 1.0,
            parent,
            kind: 3,
        };
        vec![node(0.0, 0.0, None), node(1.0, 0.0, Some(0)), node(2.0, 1.0, Some(1)), node(2.0, -1.0, Some(1))]
    }

    fn digest(nodes: &[Node]) -> String {
        Tree::new(nodes).expect("a tree").digest()
    }

    #[test]
    fn every_number_of_every_node_counts() {
        type Change = fn(&mut Node);
        let changes: [Change; 5] = [
            |node| node.position_mm.x = node.position_mm.x.next_up(),
            |node| node.position_mm.y = node.position_mm.y.next_up(),
            |node| node.position_mm.z = f64::MIN_POSITIVE,
            |node| node.radius_mm = node.radius_mm.next_up(),
            |node| node.kind += 1,
        ];
        let mut digests = vec![digest(&fork())];
        for place in 0..4 {
            for change in changes {
                let mut nodes = fork();
                change(&mut nodes[place]);
                digests.push(digest(&nodes));
            }
        }
        let mut moved = fork();
        moved[3].parent = Some(0);
        digests.push(digest(&moved));
        digests.push(digest(&fork()[..3]));
        let n_digests = digests.len();
        digests.sort();
        digests.dedup();
        assert_eq!(digests.len(), n_digests, "no two alike");
    }

    #[test]
    fn equal_trees_have_one_digest() {
        let mut nodes = fork();
        nodes[1].position_mm.y = -0.0;
        assert_eq!(digest(&nodes), digest(&fork()));
        // The bytes by hand: what stands in files today must be found again tomorrow.
        let mut bytes = Vec::new();
        bytes.extend(1_u64.to_le_bytes());
        bytes.extend([0xff; 8]);
        bytes.extend(3_i32.to_le_bytes());
        bytes.extend([0; 24]);
        bytes.extend([0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
        assert_eq!(digest(&fork()[..1]), blake3::hash(&bytes).to_hex().to_string());
    }
}
