//! Topology of masks, counted the plain way.

#![allow(dead_code, reason = "each test file uses its own share")]

use espalier_model::Mask;

/// The Euler number of the foreground under 26-connectivity: vertices − edges + faces − cubes of the union of
/// the foreground voxels as closed cubes. Components − tunnels + cavities.
pub(crate) fn euler_number(mask: &Mask) -> i64 {
    let Some((low, high)) = mask.bounding_box() else { return 0 };
    let [nx, ny, nz] = [0, 1, 2].map(|axis| high[axis] - low[axis] + 3);
    // A copy with one voxel of background about it.
    let mut cells = vec![0_u8; nx * ny * nz];
    for z in low[2]..=high[2] {
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                let at = ((z - low[2] + 1) * ny + y - low[1] + 1) * nx + x - low[0] + 1;
                cells[at] = u8::from(mask.bits().get([x, y, z]));
            }
        }
    }
    // A k-dimensional face of the grid belongs to the union if any of the voxels about it does; those voxels
    // differ by every combination of the steps along the axes that the face is thin in.
    let steps = [1, nx, nx * ny];
    let mut euler = 0;
    for thin in 0..8_usize {
        let sign = if thin.count_ones() % 2 == 1 { 1 } else { -1 };
        let offsets: Vec<usize> = (0..8_usize)
            .filter(|subset| subset & !thin == 0)
            .map(|subset| (0..3).filter(|axis| subset >> axis & 1 == 1).map(|axis| steps[axis]).sum())
            .collect();
        let last = offsets.iter().max().copied().unwrap_or(0);
        let n =
            (0..cells.len() - last).filter(|at| offsets.iter().any(|offset| cells[at + offset] != 0)).count();
        euler += sign * n as i64;
    }
    euler
}

/// The number of 26-connected components of the foreground.
pub(crate) fn n_components(mask: &Mask) -> usize {
    let grid = mask.grid();
    let mut is_seen = vec![false; grid.n_voxels()];
    let mut n_components = 0;
    for start in 0..grid.n_voxels() {
        if is_seen[start] || !mask.bits().get(grid.voxel(start)) {
            continue;
        }
        n_components += 1;
        is_seen[start] = true;
        let mut stack = vec![start];
        while let Some(index) = stack.pop() {
            let [x, y, z] = grid.voxel(index).map(|c| c as i64);
            for i in 0..27 {
                let next = [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1];
                if mask.contains(next) {
                    let next = grid.index(next.map(|c| c as usize));
                    if !is_seen[next] {
                        is_seen[next] = true;
                        stack.push(next);
                    }
                }
            }
        }
    }
    n_components
}
