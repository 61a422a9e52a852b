//! Where a region of airways ends, clear of its leak, and what it gains over edges and corners.
//!
//! **Input** a volume, a seed, the growth curve of the region over faces. **Output** [`Margin`], two levels.
//! **Notation** the shell, the voxels 3 to 5 steps from the region at the last level before the leak, of these only such
//! as are air enough for the limit of the growth: lung, not wall or heart; p(k), the share of them in the band of level k.
//! **Steps** 1. the clear level is the last one before the leak with p ≤ 0.07: before a leak fills the lung it begins in
//! small pieces at the walls. 2. From there on the region may widen, up to the last level at which hardly any of its
//! voxels are more than two steps from the region at the clear level. 3. Over edges and corners too the region
//! grows to the last level with p ≤ 0.006, if that is before a leak of the curve so grown.
//! **Why over edges?** A bronchus that is a voxel or two wide runs on over edges and corners: voxels of its own air touch no
//! other face. Noise hangs together in this way as well, from a share of 0.0976 on, where over faces it takes 0.3116
//! [Grassberger1992]; so this is for values that the lung hardly has.
//! **Guarantees** of the voxels before the leak at least nine tenths stay, and at most a tenth is won; else nothing is
//! won. The result depends neither on the axis order nor on the number of threads.
//! **Source** [Mori1996] stop before the leak; the margin and the second connectivity are ours.
//! **Cost** that of the growth curve, again; O(words) for a dozen steps over a mask.

use espalier_model::{Bits, Volume};

use crate::growth::{Growth, MIN_VOXELS, measure_over};
use crate::level_flood::region_at;
use crate::runs::Connectivity;
use crate::surroundings::{Counts, nearby, shell_about};

/// The most of the shell that may lie in the band of a region grown over faces, and over edges and corners. Of phantom CTs
/// with slices of 2.5 mm a share of 0.09 lets 2 to 4 % of the tree's length stray, 0.05 about 1 %; on the real CT at hand
/// 0.09 still has the beginning of the leak, and 0.05 loses a bronchus. Over edges 0.0125 lets 0.9 % stray at 1 mm,
/// and 0.003 finds 5 to 6 of 100 tips less at 1.5 mm.
const FACES_SHARE: f64 = 0.07;
const EDGES_SHARE: f64 = 0.006;
/// From the clear level on, at most this share of the region's voxels may be more than two steps from where it was: pieces
/// of a leak have dozens of voxels, and where there are none the threshold before the leak has the widest branches.
const MOST_FAR: f64 = 3e-4;
/// The least share of the voxels before the leak that stays, and the most voxels with those won to those without: lungs with
/// emphysema are as dark as bronchi.
const LEAST_KEPT: f64 = 0.9;
const MOST_WON: f64 = 1.1;

/// Levels of a growth curve that keep clear of a leak.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Margin {
    /// The level to grow to over faces.
    pub faces: usize,
    /// The level over edges and corners, if these win anything.
    pub edges: Option<usize>,
    /// The number of voxels that they win.
    pub n_won: usize,
}

/// The margin of the region about `seed`, and its voxels; none where no lung surrounds it.
pub(crate) fn find(volume: &Volume, seed: [usize; 3], growth: &Growth, limit: f64) -> Option<(Margin, Bits)> {
    let growing = Growing { volume, seed, growth };
    let last = growth.last_before_leak()?;
    let lung = growing.lung_about(last, limit)?;
    let faces = growing.clear_of_leak(&lung, last);
    let bits = growing.region(faces, Connectivity::Faces);
    let n_before = bits.count();
    let (edges, bits) = match growing.over_edges(&lung, last, &bits) {
        Some((edges, all)) => (Some(edges), all),
        None => (None, bits),
    };
    Some((Margin { faces, edges, n_won: bits.count() - n_before }, bits))
}

/// A region at any level.
struct Growing<'a> {
    volume: &'a Volume,
    seed: [usize; 3],
    growth: &'a Growth,
}

/// The lung about a region, by the level that its voxels need.
struct Lung {
    counts: Counts,
    n: u64,
}

impl Growing<'_> {
    fn region(&self, level: usize, connectivity: Connectivity) -> Bits {
        region_at((self.volume, self.seed), self.growth.scale, level, connectivity)
    }

    /// The lung about the region at a level; none if it has too few voxels to be one.
    fn lung_about(&self, level: usize, limit: f64) -> Option<Lung> {
        let shell = shell_about(self.region(level, Connectivity::Faces));
        let counts = Counts::of(self.volume, self.growth, &shell);
        let n = counts.up_to(self.growth.level_of(limit)?);
        (n >= MIN_VOXELS as u64).then_some(Lung { counts, n })
    }

    /// The level over faces.
    fn clear_of_leak(&self, lung: &Lung, last: usize) -> usize {
        let levels = &self.growth.levels;
        let least = LEAST_KEPT * levels[last].n_voxels as f64;
        let first = levels.partition_point(|level| (level.n_voxels as f64) < least);
        let clear = lung.last_within(FACES_SHARE, last).unwrap_or(0).max(first);
        let near = nearby(self.region(clear, Connectivity::Faces));
        let most = MOST_FAR * levels[clear].n_voxels as f64;
        let n_far = |level| n_outside(&self.region(level, Connectivity::Faces), &near);
        last_that(clear, last, |level| n_far(level) as f64 <= most)
    }

    /// The level over edges and corners, and the region with what it wins there; none if that is nothing, or too much.
    fn over_edges(&self, lung: &Lung, last: usize, bits: &Bits) -> Option<(usize, Bits)> {
        let within = lung.last_within(EDGES_SHARE, last)?;
        let curve = measure_over((self.volume, self.seed), self.growth.scale, Connectivity::All);
        let level = within.min(curve.last_before_leak()?);
        let mut all = self.region(level, Connectivity::All);
        all.words_mut().iter_mut().zip(bits.words()).for_each(|(all, bits)| *all |= bits);
        let (n_all, n_before) = (all.count(), bits.count());
        let is_gain = n_all > n_before && n_all as f64 <= MOST_WON * n_before as f64;
        is_gain.then_some((level, all))
    }
}

impl Lung {
    /// The last level, up to `last`, that at most such a share of the lung lies in the band of.
    fn last_within(&self, share: f64, last: usize) -> Option<usize> {
        let is_within = |&level: &usize| self.counts.up_to(level as i64) as f64 <= share * self.n as f64;
        (0..=last).rev().find(is_within)
    }
}

/// Of the levels from `low` to `high` the last that is as wanted, where all before it are, and `low` in any case.
fn last_that(low: usize, high: usize, is_wanted: impl Fn(usize) -> bool) -> usize {
    let (mut low, mut beyond) = (low, high + 1);
    while beyond - low > 1 {
        let middle = low + (beyond - low) / 2;
        if is_wanted(middle) { low = middle } else { beyond = middle }
    }
    low
}

/// The number of voxels of a region that are not in another.
fn n_outside(region: &Bits, other: &Bits) -> u64 {
    region
        .words()
        .iter()
        .zip(other.words())
        .map(|(region, other)| u64::from((region & !other).count_ones()))
        .sum()
}
