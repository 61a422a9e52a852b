//! The threshold half-way between a lumen's value and that of what surrounds it.
//!
//! **Input** a volume, a seed, how the region about it grows. **Output** [`HalfMaximum`].
//! **Notation** R(t) the region at threshold t; its core, the voxels with all six neighbours in R; its body, the core
//! with the core's neighbours, which leaves out specks of noise; its shell, the voxels 3 to 5 steps from the body.
//! i(t) the median of the core, o(t) the median of the shell.
//! **Steps** 1. from the seed's value on, find the first level at which R stands alone: so few of the shell's voxels
//! lie in the band that they cannot hang together. A patch of noise inside a lumen fails this, and so does a region
//! that has leaked. 2. t ← (i(t) + o(t)) / 2, until t stays; where it goes to and fro, the value nearest to the lumen's.
//! It never goes beyond the last level before a leak.
//! **Why half-way?** A voxel across the edge of a tube is half lumen there; and under noise as many voxels of the tube
//! are lost as others are won. Before a leak into tissue there is no calm: it begins with specks at every wall.
//! **Guarantees** the result depends neither on the axis order nor on the number of threads.
//! **Source** thresholds half-way between two means, iterated [Ridler1978].
//! **Differs from the source** the two are a region and what is about it, not all of a picture; and medians.
//! **Cost** O(region + words of a mask) for each of a few thresholds; memory of six masks.

use espalier_model::Volume;

use crate::growth::{Growth, MIN_VOXELS};
use crate::level_flood::region_at;
use crate::runs::Connectivity;
use crate::surroundings::{Counts, core_and_shell};

/// Of the shell's voxels at most this share may lie in the band. From a share of 0.31 on, voxels at random places hang
/// together over faces [Grassberger1992]: then region and shell are one tissue.
const MAX_SHARE: f64 = 0.2;
/// From one level that is tried as a start to the next.
const STRIDE: usize = 5;
/// The most rounds; the phantoms need 3 or 4.
const MAX_ROUNDS: usize = 16;

/// A threshold half-way between two values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfMaximum {
    /// Half-way, in the volume's scaled units.
    pub threshold: f64,
    /// The level of the curve to grow to: that of the threshold, or the last before the leak if it leaks earlier.
    /// None if the seed's own value is beyond the threshold.
    pub level: Option<usize>,
    /// The median of the values inside the region.
    pub inside: f64,
    /// The median of those a few voxels outside of it.
    pub outside: f64,
}

/// The half maximum of the region about `seed`, if the region stands out from what surrounds it at any level before
/// the leak.
pub(crate) fn find(volume: &Volume, seed: [usize; 3], growth: &Growth) -> Option<HalfMaximum> {
    let last = growth.last_before_leak()?;
    let sides_at = |level: usize| Sides::of(volume, seed, growth, level);
    let first = growth.levels.partition_point(|level| level.n_voxels < MIN_VOXELS);
    let mut starts = (first..=last).step_by(STRIDE).map(|level| (level, sides_at(level)));
    let (start, mut sides) = starts.find(|(_, sides)| sides.stand_apart())?;
    let mut tried = vec![start];
    for _ in 0..MAX_ROUNDS {
        let next = sides.half_way().clamp(0, last as i64) as usize;
        if let Some(before) = tried.iter().position(|&level| level == next) {
            let nearest = tried[before..].iter().copied().min().unwrap_or(next);
            if nearest != tried[tried.len() - 1] {
                sides = sides_at(nearest);
            }
            break;
        }
        sides = sides_at(next);
        tried.push(next);
    }
    let half_way = sides.half_way();
    let level = usize::try_from(half_way).ok().map(|level| level.min(last));
    let [threshold, inside, outside] = [half_way, sides.inside, sides.outside].map(|at| growth.value(at));
    Some(HalfMaximum { threshold, level, inside, outside })
}

/// Medians inside and outside of a region, as levels.
struct Sides {
    inside: i64,
    outside: i64,
    /// The share of the voxels outside that lie in the band.
    share: f64,
}

impl Sides {
    fn of(volume: &Volume, seed: [usize; 3], growth: &Growth, level: usize) -> Self {
        let region = region_at((volume, seed), growth.scale, level, Connectivity::Faces);
        let (core, shell) = core_and_shell(region);
        let inside = Counts::of(volume, growth, &core);
        let outside = Counts::of(volume, growth, &shell);
        let share = outside.up_to(level as i64) as f64 / outside.n().max(1) as f64;
        Self { inside: inside.median(), outside: outside.median(), share }
    }

    fn stand_apart(&self) -> bool {
        self.share <= MAX_SHARE && self.inside < self.outside
    }

    fn half_way(&self) -> i64 {
        (self.inside + self.outside).div_euclid(2)
    }
}
