//! Components and Euler number, before and after.
//!
//! **Input** a padded box of bits. **Output** counts. **Notation** χ = components − tunnels + cavities.
//! **Steps** 1. Join the runs of neighbouring rows that touch, by union and find: what is left apart are the
//! components. 2. χ = vertices − edges + faces − voxels of the union of closed voxel cubes, 64 positions at a time: an
//! edge is there if one of its four voxels is, and so on.
//! **Cost** O(words of the box + runs).

use std::ops::Range;

use espalier_model::{Bits, Report};

/// What is counted of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Topology {
    /// 26-connected components.
    pub(crate) n_components: usize,
    /// χ of the 26-connected foreground.
    pub(crate) euler_number: i64,
}

/// Counts a box whose outermost layer is background.
pub(crate) fn measure(bits: &Bits) -> Topology {
    Topology { n_components: n_components(bits), euler_number: euler_number(bits) }
}

/// The number of 26-connected components.
fn n_components(bits: &Bits) -> usize {
    let ny = bits.shape()[1];
    let mut parents: Vec<usize> = Vec::new();
    let mut n_components = 0;
    let [mut before, mut here] = [Slab::default(), Slab::default()];
    for z in 0..bits.shape()[2] {
        std::mem::swap(&mut before, &mut here);
        here.read(bits, z, parents.len());
        parents.extend(here.base..here.base + here.runs.len());
        n_components += here.runs.len();
        // A row with foreground lies within the padding, so y − 1 and y + 1 are rows.
        for y in (1..ny).filter(|&y| !here.row(y).is_empty()) {
            n_components -= join_touching(&mut parents, (&here, y - 1), (&here, y));
            for neighbor in y - 1..=y + 1 {
                n_components -= join_touching(&mut parents, (&before, neighbor), (&here, y));
            }
        }
    }
    n_components
}

/// The runs of one slab.
#[derive(Default)]
struct Slab {
    runs: Vec<Range<usize>>,
    /// The first run of each row, and of the row after the last.
    firsts: Vec<usize>,
    /// The number of runs in all slabs before.
    base: usize,
}

impl Slab {
    fn read(&mut self, bits: &Bits, z: usize, base: usize) {
        let ny = bits.shape()[1];
        self.runs.clear();
        self.firsts.clear();
        self.base = base;
        for row in z * ny..(z + 1) * ny {
            self.firsts.push(self.runs.len());
            self.runs.extend(bits.runs(row));
        }
        self.firsts.push(self.runs.len());
    }

    /// The runs of a row; none before the first slab was read.
    fn row(&self, y: usize) -> Range<usize> {
        if self.firsts.is_empty() { 0..0 } else { self.firsts[y]..self.firsts[y + 1] }
    }
}

/// Joins the runs of two rows that touch; returns how many unions that took.
fn join_touching(parents: &mut [usize], (there, ty): (&Slab, usize), (here, hy): (&Slab, usize)) -> usize {
    let (mut a, mut b) = (there.row(ty), here.row(hy));
    let mut n_joined = 0;
    while !a.is_empty() && !b.is_empty() {
        let (there_run, here_run) = (&there.runs[a.start], &here.runs[b.start]);
        // An end is the voxel after the last: runs that meet at a corner touch.
        if there_run.start <= here_run.end && here_run.start <= there_run.end {
            let (root, other) = (find(parents, there.base + a.start), find(parents, here.base + b.start));
            n_joined += usize::from(root != other);
            parents[root.max(other)] = root.min(other);
        }
        if there_run.end < here_run.end { a.start += 1 } else { b.start += 1 }
    }
    n_joined
}

/// The first run of a run's set. Each run on the way is handed on to its grandparent.
fn find(parents: &mut [usize], mut run: usize) -> usize {
    while parents[run] != run {
        parents[run] = parents[parents[run]];
        run = parents[run];
    }
    run
}

/// χ of the union of closed voxel cubes.
fn euler_number(bits: &Bits) -> i64 {
    let [row_words, ny] = [bits.words_per_row(), bits.shape()[1]];
    let words = bits.words();
    let [row, slab] = [row_words, row_words * ny];
    let mut euler_number = 0;
    for start in (slab + row..words.len()).step_by(row) {
        // The last words of the four voxels about an edge along x: (y, z), (y − 1, z), (y, z − 1), (y − 1, z − 1).
        let mut last = [0; 4];
        for word in start..start + row {
            let four = [words[word], words[word - row], words[word - slab], words[word - slab - row]];
            if four != [0; 4] || last != [0; 4] {
                euler_number += euler_of_word(four, last);
            }
            last = four;
        }
    }
    euler_number
}

/// What the cells with their highest voxel in one of 64 places add to χ.
fn euler_of_word(four: [u64; 4], last: [u64; 4]) -> i64 {
    let count = |bits: u64| i64::from(bits.count_ones());
    // A voxel or its neighbour at x − 1.
    let pair = |bits: u64, last: u64| bits | bits << 1 | last >> 63;
    let [voxels, y, z, yz] = four;
    let faces = count(voxels | y) + count(voxels | z) + count(pair(voxels, last[0]));
    let along_x = voxels | y | z | yz;
    let edges = count(along_x)
        + count(pair(voxels | z, last[0] | last[2]))
        + count(pair(voxels | y, last[0] | last[1]));
    let vertices = count(pair(along_x, last[0] | last[1] | last[2] | last[3]));
    vertices - edges + faces - count(voxels)
}

/// Writes both into the report, with a warning where they differ.
pub(crate) fn compare(mask: &Topology, skeleton: &Topology, report: &mut Report) {
    report.count_usize("mask_components", mask.n_components);
    report.count_usize("skeleton_components", skeleton.n_components);
    report.count("mask_euler_number", mask.euler_number as f64);
    report.count("skeleton_euler_number", skeleton.euler_number as f64);
    if mask != skeleton {
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
