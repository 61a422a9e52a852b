//! Connected components by runs of voxels.
//!
//! **Input** one `bool` a voxel, x fastest; which of the two values; how voxels connect. **Output** the runs of
//! that value along x, each with the number of its component.
//! **Notation** R runs.
//! **Steps** 1. cut each row into runs; 2. join each run with those that it touches in the rows before it;
//! 3. number the components in the order of their first voxel.
//! **Guarantees** the numbering depends on the voxels only.
//! **Cost** O(voxels + R · α(R)) time, O(R + rows) memory: a label for every voxel would take four times the mask.

use espalier_geom::union_find::UnionFind;

/// How voxels connect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Connectivity {
    /// By faces: 6 neighbours.
    Faces,
    /// By faces, edges and corners: 26 neighbours.
    All,
}

/// Voxels `start..end` of one row; row `z · ny + y`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub(crate) row: usize,
    pub(crate) start: usize,
    pub(crate) end: usize,
}

impl Run {
    pub(crate) fn len(&self) -> usize {
        self.end - self.start
    }
}

/// Runs and their components.
pub(crate) struct Labelled {
    /// In storage order.
    pub(crate) runs: Vec<Run>,
    /// The component of each run, numbered by first voxel.
    pub(crate) component: Vec<usize>,
    pub(crate) n_components: usize,
}

pub(crate) fn label(
    voxels: &[bool],
    [nx, ny, nz]: [usize; 3],
    value: bool,
    connectivity: Connectivity,
) -> Labelled {
    let (runs, row_starts) = cut_rows(voxels, nx, value);
    let mut joined = UnionFind::new(runs.len());
    for z in 0..nz {
        for y in 0..ny {
            let row = z * ny + y;
            let here = row_starts[row]..row_starts[row + 1];
            if here.is_empty() {
                continue;
            }
            for other in rows_before([y, z], ny, connectivity).into_iter().flatten() {
                let before = row_starts[other]..row_starts[other + 1];
                join_touching(&runs, here.clone(), before, connectivity, &mut joined);
            }
        }
    }
    let (component, n_components) = joined.into_numbers();
    Labelled { runs, component, n_components }
}

/// The runs of `value`, and where each row's begin.
fn cut_rows(voxels: &[bool], nx: usize, value: bool) -> (Vec<Run>, Vec<usize>) {
    let mut runs = Vec::new();
    let mut row_starts = vec![0];
    for (row, line) in voxels.chunks_exact(nx).enumerate() {
        let mut end = 0;
        while let Some(start) = line[end..].iter().position(|&v| v == value).map(|gap| end + gap) {
            end = line[start..].iter().position(|&v| v != value).map_or(nx, |length| start + length);
            runs.push(Run { row, start, end });
        }
        row_starts.push(runs.len());
    }
    (runs, row_starts)
}

/// The rows before row (y, z) in storage order that its voxels can touch.
fn rows_before([y, z]: [usize; 2], ny: usize, connectivity: Connectivity) -> [Option<usize>; 4] {
    let row = z * ny + y;
    let by_corner = connectivity == Connectivity::All;
    [
        (y > 0).then(|| row - 1),
        (z > 0 && y > 0 && by_corner).then(|| row - ny - 1),
        (z > 0).then(|| row - ny),
        (z > 0 && y + 1 < ny && by_corner).then(|| row - ny + 1),
    ]
}

/// Joins the runs of two rows that touch, walking along both.
fn join_touching(
    runs: &[Run],
    here: std::ops::Range<usize>,
    before: std::ops::Range<usize>,
    connectivity: Connectivity,
    joined: &mut UnionFind,
) {
    let reach = usize::from(connectivity == Connectivity::All);
    let (mut a, mut b) = (here.start, before.start);
    while a < here.end && b < before.end {
        if runs[a].start < runs[b].end + reach && runs[b].start < runs[a].end + reach {
            joined.join(a, b);
        }
        // The run that ends first cannot touch anything further along.
        if runs[a].end < runs[b].end { a += 1 } else { b += 1 }
    }
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    /// The plain form: flood fill voxel by voxel, in storage order.
    fn flood(
        voxels: &[bool],
        [nx, ny, nz]: [usize; 3],
        value: bool,
        connectivity: Connectivity,
    ) -> Vec<usize> {
        let mut component = vec![usize::MAX; voxels.len()];
        let mut n_components = 0;
        for start in 0..voxels.len() {
            if voxels[start] != value || component[start] != usize::MAX {
                continue;
            }
            component[start] = n_components;
            let mut stack = vec![start];
            while let Some(index) = stack.pop() {
                let [x, y, z] = [index % nx, index / nx % ny, index / (nx * ny)].map(|v| v as i64);
                for step in 0..27_i64 {
                    let d = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
                    let n_axes = d.iter().filter(|&&v| v != 0).count();
                    if connectivity == Connectivity::Faces && n_axes != 1 {
                        continue;
                    }
                    let [x, y, z] = [x + d[0], y + d[1], z + d[2]];
                    let is_inside = (0..nx as i64).contains(&x)
                        && (0..ny as i64).contains(&y)
                        && (0..nz as i64).contains(&z);
                    if is_inside {
                        let other = (z as usize * ny + y as usize) * nx + x as usize;
                        if voxels[other] == value && component[other] == usize::MAX {
                            component[other] = n_components;
                            stack.push(other);
                        }
                    }
                }
            }
            n_components += 1;
        }
        component
    }

    #[test]
    fn equals_flood_fill_on_random_volumes() {
        let mut stream = Stream::new(5, Purpose::Test, 0, 0);
        for case in 0..300_u32 {
            let shape = [1 + stream.below(9), 1 + stream.below(7), 1 + stream.below(6)].map(|v| v as usize);
            let density = stream.uniform(0.05, 0.95);
            let voxels: Vec<bool> = (0..shape.iter().product()).map(|_| stream.unit() < density).collect();
            for connectivity in [Connectivity::Faces, Connectivity::All] {
                for value in [true, false] {
                    let labelled = label(&voxels, shape, value, connectivity);
                    let mut found = vec![usize::MAX; voxels.len()];
                    for (run, &component) in labelled.runs.iter().zip(&labelled.component) {
                        found[run.row * shape[0] + run.start..run.row * shape[0] + run.end].fill(component);
                    }
                    let expected = flood(&voxels, shape, value, connectivity);
                    assert_eq!(found, expected, "case {case} {shape:?} {connectivity:?} {value}");
                }
            }
        }
    }
}
