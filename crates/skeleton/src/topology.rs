//! Components and Euler number, before and after.
//!
//! **Input** a lattice without marks. **Output** counts. **Notation** χ = components − tunnels + cavities.
//! **Steps** 1. Flood each component over its 26 neighbours. 2. Build the object up voxel by voxel in raster
//! order; each voxel changes χ by what its earlier neighbours say.
//! **Cost** O(foreground).

use espalier_model::Report;

use crate::euler::euler_change;
use crate::lattice::Lattice;
use crate::simple::{CENTER, is_endpoint};

/// The bits of a neighbourhood that come before its centre in raster order.
const EARLIER: u32 = CENTER - 1;

/// What is counted of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Topology {
    /// 26-connected components.
    pub(crate) n_components: usize,
    /// χ of the 26-connected foreground.
    pub(crate) euler_number: i32,
    /// Voxels with exactly one neighbour.
    pub(crate) n_endpoints: usize,
}

/// Counts a lattice; its marks are used and taken away again.
pub(crate) fn measure(lattice: &mut Lattice) -> Topology {
    let foreground = lattice.foreground();
    let mut topology = Topology { n_components: 0, euler_number: 0, n_endpoints: 0 };
    let mut eight_euler = 0;
    for &cell in &foreground {
        let neighborhood = lattice.neighborhood(cell);
        eight_euler += i64::from(euler_change(neighborhood & EARLIER));
        topology.n_endpoints += usize::from(is_endpoint(neighborhood));
    }
    topology.euler_number = (eight_euler / 8) as i32;

    let mut stack = Vec::new();
    for &seed in &foreground {
        if lattice.is_marked(seed) {
            continue;
        }
        topology.n_components += 1;
        lattice.mark(seed);
        stack.push(seed);
        while let Some(cell) = stack.pop() {
            for neighbor in lattice.neighbors(cell) {
                if !lattice.is_marked(neighbor) {
                    lattice.mark(neighbor);
                    stack.push(neighbor);
                }
            }
        }
    }
    for &cell in &foreground {
        lattice.unmark(cell);
    }
    topology
}

/// Writes both into the report, with a warning where they differ.
pub(crate) fn compare(mask: &Topology, skeleton: &Topology, report: &mut Report) {
    report.count_usize("mask_components", mask.n_components);
    report.count_usize("skeleton_components", skeleton.n_components);
    report.count("mask_euler_number", mask.euler_number);
    report.count("skeleton_euler_number", skeleton.euler_number);
    if (mask.n_components, mask.euler_number) != (skeleton.n_components, skeleton.euler_number) {
        report.warn(
            "W-SKELETON-TOPOLOGY",
            format!(
                "thinning changed the topology: components {} to {}, Euler number {} to {}; thinning = \"safe\" \
                 keeps both",
                mask.n_components, skeleton.n_components, mask.euler_number, skeleton.euler_number
            ),
        );
    }
}
