//! The table of an embedding, `nodes.tsv`, for people and spreadsheets: coordinates with the decimals of the
//! embedding's quantum, everything else as its column says.

use super::Embedding;
use crate::table::{Column, Table, fixed};
use crate::tree::Tree;

/// The columns of `nodes.tsv`.
pub const NODE_COLUMNS: [Column; 13] = [
    Column::new("node", "n/a", "index of the node in preorder; 0 is the root"),
    Column::new("parent", "n/a", "index of its parent; n/a for the root"),
    Column::new("x_mm", "mm", "position in space, RAS+: towards the right"),
    Column::new("y_mm", "mm", "position in space: towards the front"),
    Column::new("z_mm", "mm", "position in space: upwards"),
    Column::new("radius_mm", "mm", "radius of the tube at the node"),
    Column::new("u_mm", "mm", "position in the picture's plane: to the right"),
    Column::new("v_mm", "mm", "position in the picture's plane: up"),
    Column::new("branch", "n/a", "index of its branch; n/a for the root"),
    Column::new("generation", "1", "forks between the root and its branch"),
    Column::new(
        "target_angle_deg",
        "deg",
        "target angle, counter-clockwise from its grandparent's side; 180 = straight",
    ),
    Column::new("length_ratio", "1", "drawn length over target length, minus 1"),
    Column::new("angle_ratio", "1", "r_a of equation 3: 0 = as the target, 1 = straight"),
];

impl Embedding {
    /// How many decimals a coordinate has.
    #[must_use]
    pub fn decimals(&self) -> usize {
        decimals(self.quantum_mm)
    }

    /// The table `nodes.tsv`: each node in space and in the plane.
    #[must_use]
    pub fn nodes_tsv(&self, tree: &Tree) -> String {
        let branches = tree.branches();
        let decimals = self.decimals();
        let mut table = Table::with(&NODE_COLUMNS);
        for (node, (data, flat)) in tree.nodes().iter().zip(&self.positions_mm).enumerate() {
            let branch = branches.of_node(node);
            let or_none = |value: Option<String>| value.unwrap_or_else(|| "n/a".to_owned());
            table.row(&[
                &node,
                &or_none(data.parent.map(|parent| parent.to_string())),
                &fixed(data.position_mm.x, decimals),
                &fixed(data.position_mm.y, decimals),
                &fixed(data.position_mm.z, decimals),
                &fixed(data.radius_mm, decimals),
                &fixed(flat.x, decimals),
                &fixed(flat.y, decimals),
                &or_none(branch.map(|branch| branch.to_string())),
                &or_none(branch.map(|branch| branches.list()[branch].generation.to_string())),
                &fixed(self.targets.angle_rad[node].to_degrees(), 6),
                &fixed(self.length_ratio[node], 9),
                &fixed(self.angle_ratio[node], 9),
            ]);
        }
        table.into_string()
    }
}

/// Decimals of a quantum: a power of ten, or 0 where it is 1 mm or more.
pub(super) fn decimals(quantum_mm: f64) -> usize {
    let exponent = espalier_geom::math::floor(0.5 - espalier_geom::math::log10(quantum_mm));
    exponent.max(0.0) as usize
}
