//! Cavities filled.
//!
//! **Input** one `bool` a voxel. **Output** the same, with every closed-in piece of background set.
//! **Steps** 1. label the background by faces, the counterpart of a 26-connected foreground; 2. components that
//! touch the border of the volume are outside; 3. fill the others.
//! **Guarantees** the background is one piece with the outside; the foreground's components and tunnels stay.
//! **Cost** O(voxels) time, O(runs) memory.

use espalier_model::Report;

use crate::runs::{Connectivity, Run, label};

/// Fills the cavities.
pub(crate) fn fill(voxels: &mut [bool], shape: [usize; 3], report: &mut Report) {
    let [nx, ny, nz] = shape;
    let labelled = label(voxels, shape, false, Connectivity::Faces);
    let is_at_border = |run: &Run| {
        let (y, z) = (run.row % ny, run.row / ny);
        run.start == 0 || run.end == nx || y == 0 || y + 1 == ny || z == 0 || z + 1 == nz
    };
    let mut is_outside = vec![false; labelled.n_components];
    for (run, &component) in labelled.runs.iter().zip(&labelled.component) {
        is_outside[component] |= is_at_border(run);
    }
    let mut n_filled = 0;
    for (run, &component) in labelled.runs.iter().zip(&labelled.component) {
        if !is_outside[component] {
            voxels[run.row * nx + run.start..run.row * nx + run.end].fill(true);
            n_filled += run.len();
        }
    }
    report.count_usize("cavities_filled", is_outside.iter().filter(|&&outside| !outside).count());
    report.count_usize("cavities_filled_voxels", n_filled);
}
