//! What a stage costs, before it is done: seconds of one core, and memory.
//!
//! **Input** the sizes that a stage depends on, as far as they are known. **Output** [`Cost`].
//! **Steps** each cost is a sum of sizes, each times a constant of the table below.
//! **Guarantees** no result depends on it, but that a stage is refused which would take more memory than allowed.
//! **Source** the constants: chosen on eleven runs by `scripts/estimates`, which prints what was measured beside what this
//! says. Of a whole run both lay within a factor of 2, seconds from 0.5 to 2.0 and memory from 0.7 to 1.3, before tree,
//! report, radius and skeleton were corrected by what it printed; a layout that is proven
//! optimal early takes a third of what is said. Seconds depend on the machine, memory does not.

use espalier_geom::math;
use espalier_model::{Mask, Tree};
use espalier_render::Params as RenderParams;

use crate::folder::RunFolder;
use crate::provenance;
use crate::stage::Stage;

/// What the costs of stages depend on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sizes {
    /// Voxels of the grid.
    pub voxels: u64,
    /// Bytes that a voxel takes where a stage holds the scan whole; 0 for one that it only streams.
    pub held_bytes: u64,
    /// Voxels of the organ.
    pub foreground: u64,
    /// Voxels of the box around the organ.
    pub boxed: u64,
    /// Voxels of the part of the scan in which walls are looked for; 0 where radii keep to the mask.
    pub sampled: u64,
    /// Voxels of the skeleton.
    pub skeleton: u64,
    /// Nodes of the tree.
    pub nodes: u64,
    /// Pixels of the map.
    pub pixels: u64,
    /// Those of a map of the width that the figure of the organ in space has; 0 where there is none.
    pub figure_pixels: u64,
}

/// What a stage costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Seconds of one core.
    pub cpu_seconds: f64,
    /// The most memory that it holds at a time, in bytes, with the program itself.
    pub bytes: u64,
}

/// The program itself, and the buffers of its threads.
const PROGRAM_BYTES: f64 = 16e6;
/// Skeleton voxels per foreground voxel, where thinning has not told.
const SKELETON_PER_FOREGROUND: f64 = 0.022;
/// Nodes per skeleton voxel, where no tree has told.
const NODES_PER_SKELETON: f64 = 0.4;
/// The height of a map over its width, where the layout has not told: the middle of what a page may have.
const ASPECT: f64 = 1.2;

/// Seconds, or bytes, for one of each size.
#[derive(Clone, Copy, Default)]
struct PerSize {
    fixed: f64,
    voxel: f64,
    /// A byte of a scan that is held whole.
    held: f64,
    /// A voxel of a region that grows.
    grown: f64,
    foreground: f64,
    boxed: f64,
    /// A voxel of [`Sizes::sampled`].
    sampled: f64,
    /// A voxel of an organ whose walls are looked for.
    walled: f64,
    node: f64,
    /// A unit of nodes to the power of [`SEARCH_POWER`].
    searched: f64,
    pixel: f64,
    /// A pixel of [`Sizes::figure_pixels`].
    organ_pixel: f64,
}

/// How the search for a layout grows with the nodes.
const SEARCH_POWER: f64 = 1.15;
/// Of a layout, bytes for each pair of nodes, up to where pairs are no longer held.
const BYTES_PER_PAIR: f64 = 28.0;
const MOST_PAIR_BYTES: f64 = 80e6;

impl PerSize {
    const NONE: Self = Self {
        fixed: 0.0,
        voxel: 0.0,
        held: 0.0,
        grown: 0.0,
        foreground: 0.0,
        boxed: 0.0,
        sampled: 0.0,
        walled: 0.0,
        node: 0.0,
        searched: 0.0,
        pixel: 0.0,
        organ_pixel: 0.0,
    };

    fn of(&self, sizes: &Sizes) -> f64 {
        let [voxels, foreground, nodes, pixels] =
            [sizes.voxels, sizes.foreground, sizes.nodes, sizes.pixels].map(|size| size as f64);
        let grown = if sizes.held_bytes > 0 { foreground } else { 0.0 };
        let walled = if sizes.sampled > 0 { foreground } else { 0.0 };
        let organ_pixels = if foreground > 0.0 { sizes.figure_pixels as f64 } else { 0.0 };
        self.fixed
            + self.voxel * voxels
            + self.held * voxels * sizes.held_bytes as f64
            + self.grown * grown
            + self.foreground * foreground
            + self.boxed * sizes.boxed as f64
            + self.sampled * sizes.sampled as f64
            + self.walled * walled
            + self.node * nodes
            + self.searched * math::pow(nodes, SEARCH_POWER)
            + self.pixel * pixels
            + self.organ_pixel * organ_pixels
    }
}

/// The constants of a stage: seconds of one core, then bytes.
fn constants(stage: Stage) -> [PerSize; 2] {
    let none = PerSize::NONE;
    match stage {
        Stage::Phantom => [PerSize { voxel: 6e-7, ..none }, PerSize { voxel: 12.0, ..none }],
        Stage::Volume => [
            PerSize { fixed: 0.012, voxel: 1.3e-9, held: 0.9e-7, grown: 2.8e-6, foreground: 1e-7, ..none },
            PerSize { voxel: 0.3, held: 6.0, foreground: 4.0, ..none },
        ],
        Stage::Skeleton => [
            PerSize { fixed: 0.01, voxel: 7e-10, foreground: 7e-7, ..none },
            PerSize { voxel: 0.3, boxed: 1.0, foreground: 12.0, ..none },
        ],
        Stage::Radius => [
            PerSize { fixed: 0.01, voxel: 9e-10, foreground: 3e-7, sampled: 3e-8, walled: 3e-6, ..none },
            PerSize { voxel: 0.3, boxed: 1.0, sampled: 4.0, foreground: 12.0, ..none },
        ],
        Stage::Tree => [
            PerSize { fixed: 0.01, voxel: 5e-10, foreground: 1.5e-7, node: 6e-6, ..none },
            PerSize { voxel: 0.3, foreground: 25.0, node: 300.0, ..none },
        ],
        Stage::Views => [PerSize { fixed: 0.01, node: 3.5e-5, ..none }, PerSize { node: 300.0, ..none }],
        Stage::Embed => [PerSize { fixed: 0.01, searched: 8e-4, ..none }, PerSize { node: 2000.0, ..none }],
        Stage::Render => [
            PerSize { fixed: 0.05, node: 1e-4, pixel: 1.3e-7, organ_pixel: 4.5e-7, ..none },
            // Estimate to measured peak, of three organs at 1600 and 4096 pixels, with and without the figure: 0.8
            // to 1.1, and up to 1.7 for one that leaves most of its page empty.
            PerSize { fixed: 20e6, foreground: 60.0, node: 1000.0, pixel: 11.0, organ_pixel: 14.0, ..none },
        ],
        Stage::Report => [
            PerSize { fixed: 0.03, voxel: 3e-10, node: 1e-5, ..none },
            PerSize { voxel: 0.15, node: 1200.0, ..none },
        ],
    }
}

impl Sizes {
    /// Those of a mask.
    pub(crate) fn of_mask(mask: &Mask) -> Self {
        let extent =
            mask.bounding_box().map_or([0; 3], |(first, last)| [0, 1, 2].map(|a| last[a] + 1 - first[a]));
        Self {
            voxels: mask.grid().n_voxels() as u64,
            foreground: mask.n_foreground() as u64,
            boxed: extent.iter().map(|&extent| extent as u64).product(),
            ..Self::default()
        }
    }

    /// Those that the stages of a folder have met, as their reports say; none where no stage has met any.
    pub(crate) fn of_reports(folder: &RunFolder) -> Option<Self> {
        let count =
            |stage: Stage, name: &str| provenance::counts(folder, stage).get(name).map_or(0, |n| *n as u64);
        let sizes = Self {
            voxels: count(Stage::Volume, "voxels"),
            foreground: count(Stage::Skeleton, "foreground_voxels"),
            sampled: count(Stage::Radius, "scan_voxels"),
            skeleton: count(Stage::Skeleton, "skeleton_voxels"),
            nodes: count(Stage::Tree, "nodes"),
            ..Self::default()
        };
        (sizes.foreground > 0 || sizes.nodes > 0).then_some(sizes)
    }

    /// With those of a tree.
    pub(crate) fn and_tree(self, tree: &Tree) -> Self {
        Self { nodes: tree.n_nodes() as u64, ..self }
    }

    /// With those of the pictures.
    pub(crate) fn and_pictures(self, params: &RenderParams) -> Self {
        let aspect = params.aspect.unwrap_or(ASPECT);
        let pixels = |width_px: u32, aspect: f64| (f64::from(width_px) * f64::from(width_px) * aspect) as u64;
        let figure_px = if params.space { params.width_px.min(espalier_render::MOST_SPACE_WIDTH) } else { 0 };
        // The figure's height follows from the organ alone.
        Self { pixels: pixels(params.width_px, aspect), figure_pixels: pixels(figure_px, ASPECT), ..self }
    }

    /// With what follows from the others as a rule, where it is not known.
    #[must_use]
    pub fn completed(self) -> Self {
        let or = |known: u64, likely: f64| if known > 0 { known } else { likely as u64 };
        let skeleton = or(self.skeleton, SKELETON_PER_FOREGROUND * self.foreground as f64);
        let nodes = or(self.nodes, NODES_PER_SKELETON * skeleton as f64);
        Self { skeleton, nodes, boxed: self.boxed.max(self.foreground), ..self }
    }
}

/// What a stage costs at these sizes.
#[must_use]
pub fn cost(stage: Stage, sizes: &Sizes) -> Cost {
    let [seconds, bytes] = constants(stage);
    let nodes = sizes.nodes as f64;
    let pairs =
        if stage == Stage::Embed { (BYTES_PER_PAIR * nodes * nodes).min(MOST_PAIR_BYTES) } else { 0.0 };
    Cost { cpu_seconds: seconds.of(sizes), bytes: (PROGRAM_BYTES + pairs + bytes.of(sizes)) as u64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_of_anything_costs_more() {
        let small = Sizes {
            voxels: 1000,
            held_bytes: 0,
            foreground: 100,
            boxed: 200,
            sampled: 0,
            skeleton: 10,
            nodes: 5,
            pixels: 50,
            figure_pixels: 50,
        };
        let larger = [
            Sizes { voxels: 2000, ..small },
            Sizes { foreground: 200, ..small },
            Sizes { sampled: 200, ..small },
            Sizes { nodes: 50, ..small },
            Sizes { pixels: 500, ..small },
            Sizes { figure_pixels: 500, ..small },
        ];
        for stage in Stage::ALL {
            let least = cost(stage, &small);
            assert!(least.cpu_seconds > 0.0 && least.bytes > 0, "{stage}");
            for sizes in larger {
                let more = cost(stage, &sizes);
                assert!(
                    more.cpu_seconds >= least.cpu_seconds && more.bytes >= least.bytes,
                    "{stage} at {sizes:?}"
                );
            }
        }
    }

    #[test]
    fn what_is_known_is_not_guessed() {
        let known = Sizes { foreground: 1000, skeleton: 7, nodes: 3, boxed: 4000, ..Sizes::default() };
        assert_eq!(known.completed(), known);
        let guessed = Sizes { foreground: 100_000, ..Sizes::default() }.completed();
        assert!(guessed.skeleton > 0 && guessed.nodes > 0 && guessed.nodes < guessed.skeleton);
    }
}
