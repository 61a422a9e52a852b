//! Components and Euler number, before and after.
//!
//! **Input** a padded box of bits. **Output** counts. **Notation** χ = components − tunnels + cavities.
//! **Steps** 1. Join the runs of neighbouring rows that touch, by union and find: what is left apart are the
//! components. 2. χ as bits tell it ([`Bits::euler_number`]).
//! **Cost** O(words of the box + runs).

use std::ops::Range;

use espalier_geom::union_find::UnionFind;
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
    Topology { n_components: n_components(bits), euler_number: bits.euler_number() }
}

/// The number of 26-connected components.
fn n_components(bits: &Bits) -> usize {
    let ny = bits.shape()[1];
    let mut sets = UnionFind::new(0);
    let mut n_components = 0;
    let [mut before, mut here] = [Slab::default(), Slab::default()];
    for z in 0..bits.shape()[2] {
        std::mem::swap(&mut before, &mut here);
        here.read(bits, z, before.base + before.runs.len());
        sets.add(here.runs.len());
        n_components += here.runs.len();
        // A row with foreground lies within the padding, so y − 1 and y + 1 are rows.
        for y in (1..ny).filter(|&y| !here.row(y).is_empty()) {
            n_components -= join_touching(&mut sets, (&here, y - 1), (&here, y));
            for neighbor in y - 1..=y + 1 {
                n_components -= join_touching(&mut sets, (&before, neighbor), (&here, y));
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
fn join_touching(sets: &mut UnionFind, (there, ty): (&Slab, usize), (here, hy): (&Slab, usize)) -> usize {
    let (mut a, mut b) = (there.row(ty), here.row(hy));
    let mut n_joined = 0;
    while !a.is_empty() && !b.is_empty() {
        let (there_run, here_run) = (&there.runs[a.start], &here.runs[b.start]);
        // An end is the voxel after the last: runs that meet at a corner touch.
        if there_run.start <= here_run.end && here_run.start <= there_run.end {
            n_joined += usize::from(sets.join(there.base + a.start, here.base + b.start));
        }
        if there_run.end < here_run.end { a.start += 1 } else { b.start += 1 }
    }
    n_joined
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
