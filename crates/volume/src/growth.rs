//! The volume of a growing region as a function of the threshold, and the threshold before it leaks.
//!
//! **Input** a volume, a seed, whether the region grows towards brighter or darker values, and how far at most.
//! **Output** [`Growth`]: the curve, and its knee.
//! **Notation** level k, the threshold k steps from the seed's value; V(k) the voxels of the region at level k.
//! **Steps** 1. flood from the seed in the order of the level that each voxel needs, with a queue for each level:
//! the region at every threshold comes out of one pass, since it is all that was reached before a higher level had
//! to be entered; 2. after each level compare V(k) with V(k − 5). The curve is calm where it grows by at most a
//! tenth. A region that doubles before it is calm again has leaked; the last calm level before is the stable one.
//! 3. Go on until the leak is plain to see, and stop.
//! **Why after calm?** At first the region is a patch of noise about the seed that grows to the whole lumen; that
//! is no leak. The lumen's volume then hardly changes until a wall gives way.
//! **Guarantees** V(k) is the size of the 6-connected component of the band at that threshold. No recursion.
//! **Source** the explosion control of [Mori1996], with the knee found on the whole curve rather than step by step.
//! **Cost** O(voxels reached + levels) time, a bit a voxel and the region's border in memory.

use espalier_model::Volume;
use espalier_model::table::{Column, Table, fixed};

use crate::half_maximum::HalfMaximum;
use crate::level_flood::{Flood, Scale};
use crate::margin::Margin;
use crate::runs::Connectivity;

/// Over how many levels growth is measured. On the real CTs at hand a wall gives way within one.
const WINDOW: usize = 5;
/// The most growth over the window that is calm. Lumens of the CTs at hand, with noise of 0 to 80 HU, grow by 1 to
/// 8 % over 5 HU before the leak.
const CALM: f64 = 1.10;
/// The least growth since the last calm level that is a leak. Lungs are many times larger than what leads to them:
/// the leaks at hand go on to 10 to 30 times before the curve is calm again. A bronchus that is reached late, behind
/// a speck of noise or mucus, adds less than what was there.
const LEAK: f64 = 2.0;
/// A region of fewer voxels is never taken for a lumen: a patch of noise can be calm by chance.
pub(crate) const MIN_VOXELS: usize = 1000;
/// After a leak the flood goes on for so many levels, or until the region is so many times the stable one.
const AFTERMATH_LEVELS: usize = 25;
const AFTERMATH_GROWTH: usize = 6;

/// Towards which values a region grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Towards {
    /// From dark to bright: the upper threshold rises. Airways.
    Bright,
    /// From bright to dark: the lower threshold falls. Vessels with contrast.
    Dark,
}

/// One level of the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// The threshold, in the volume's scaled units.
    pub threshold: f64,
    /// The region's size there.
    pub n_voxels: usize,
}

/// The end of the curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knee {
    /// It leaks: the last calm level, and the one after it.
    Leak {
        /// The last level before the leak.
        stable: usize,
    },
    /// It does not leak up to the last level.
    None,
    /// It grows and grows, and is never calm.
    NeverCalm,
}

/// The volume of a region as a function of the threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct Growth {
    /// From the seed's own value on; at least one.
    pub levels: Vec<Level>,
    /// Where it leaks.
    pub knee: Knee,
    /// The volume of a voxel in ml.
    pub voxel_ml: f64,
    /// Where a lumen's edge is, if that was looked for and found.
    pub half_maximum: Option<HalfMaximum>,
    /// Where it keeps clear of a leak, if that was looked for and found.
    pub margin: Option<Margin>,
    pub(crate) scale: Scale,
}

/// The columns of `growth.tsv`.
pub const GROWTH_COLUMNS: [Column; 4] = [
    Column::new("threshold", "scaled value, HU for CT", "the end of the band that moves"),
    Column::new("voxels", "voxels", "the size of the region about the seed at that threshold"),
    Column::new("volume_ml", "ml", "its volume"),
    Column::new(
        "state",
        "n/a",
        "taken: what the region was grown to, if not the stable one; edges: the same over edges and corners; stable: \
         the last threshold before the leak; leak: from it on the region leaks",
    ),
];

impl Growth {
    /// The threshold to grow to: half-way from inside to outside, or clear of a leak, if that was looked for and
    /// found, else the stable one, or the last if nothing leaks.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        let level = self.half_level().or_else(|| self.level_at(self.margin?.faces));
        level.or_else(|| self.level_at(self.last_before_leak()?)).map(|level| level.threshold)
    }

    /// The level before the leak and the first one in it.
    #[must_use]
    pub fn leak(&self) -> Option<(Level, Level)> {
        match self.knee {
            Knee::Leak { stable } => Some((*self.levels.get(stable)?, *self.levels.get(stable + 1)?)),
            Knee::None | Knee::NeverCalm => None,
        }
    }

    /// The level half-way from inside to outside, or the last before a leak that comes earlier.
    #[must_use]
    pub fn half_level(&self) -> Option<Level> {
        self.level_at(self.half_maximum?.level?)
    }

    fn level_at(&self, level: usize) -> Option<Level> {
        self.levels.get(level).copied()
    }

    /// The last level before a leak, or of all; none if it is never calm.
    pub(crate) fn last_before_leak(&self) -> Option<usize> {
        match self.knee {
            Knee::Leak { stable } => Some(stable),
            Knee::None => self.levels.len().checked_sub(1),
            Knee::NeverCalm => None,
        }
    }

    /// Whether the region is too small for a leak to be told from noise.
    #[must_use]
    pub fn is_small(&self) -> bool {
        self.levels.last().is_none_or(|level| level.n_voxels < MIN_VOXELS)
    }

    /// The volume of a level in ml.
    #[must_use]
    pub fn ml(&self, level: Level) -> f64 {
        level.n_voxels as f64 * self.voxel_ml
    }

    /// The level that a value needs, also beyond the curve's ends; not of NaN.
    pub(crate) fn level_of(&self, value: f64) -> Option<i64> {
        let above = self.scale.above(value);
        (!above.is_nan()).then_some(above as i64)
    }

    /// The value at a level, also beyond the curve's ends.
    pub(crate) fn value(&self, level: i64) -> f64 {
        self.scale.threshold(level as f64)
    }

    /// The table `growth.tsv`.
    #[must_use]
    pub fn to_tsv(&self) -> String {
        let mut table = Table::with(&GROWTH_COLUMNS);
        let stable = match self.knee {
            Knee::Leak { stable } => stable,
            Knee::None | Knee::NeverCalm => usize::MAX,
        };
        let taken = self.half_maximum.map_or(self.margin.map(|margin| margin.faces), |half| half.level);
        for (level_idx, level) in self.levels.iter().enumerate() {
            let state = match level_idx {
                idx if idx == stable => "stable",
                idx if taken == Some(idx) => "taken",
                idx if self.margin.is_some_and(|margin| margin.edges == Some(idx)) => "edges",
                idx if idx > stable => "leak",
                _ => "",
            };
            let volume = fixed(self.ml(*level), 4);
            table.row(&[&fixed(level.threshold, 3), &level.n_voxels, &volume, &state]);
        }
        table.into_string()
    }
}

/// Grows a region from `seed` up to `limit`.
pub(crate) fn measure(volume: &Volume, seed: [usize; 3], towards: Towards, limit: f64) -> Growth {
    measure_over((volume, seed), Scale::new(volume, seed, towards, limit), Connectivity::Faces)
}

/// The same over faces, or over edges and corners too.
pub(crate) fn measure_over(
    (volume, seed): (&Volume, [usize; 3]),
    scale: Scale,
    connectivity: Connectivity,
) -> Growth {
    let mut flood = Flood::new(volume, scale, seed, connectivity);
    let mut growth = Growth {
        levels: Vec::new(),
        knee: Knee::NeverCalm,
        voxel_ml: volume.grid().voxel_volume_mm3() / 1000.0,
        half_maximum: None,
        margin: None,
        scale,
    };
    let mut last_calm = None;
    for level in 0..scale.n_levels {
        flood.drain(level);
        growth.levels.push(Level { threshold: scale.threshold(level as f64), n_voxels: flood.n_reached });
        if let Knee::Leak { stable } = growth.knee {
            let is_plain = flood.n_reached > AFTERMATH_GROWTH * growth.levels[stable].n_voxels;
            if is_plain || level > stable + AFTERMATH_LEVELS {
                break;
            }
        } else if is_calm(&growth.levels) {
            last_calm = Some(level);
        } else if let Some(stable) = last_calm {
            let is_leak = flood.n_reached as f64 >= LEAK * growth.levels[stable].n_voxels as f64;
            growth.knee = if is_leak { Knee::Leak { stable } } else { growth.knee };
        }
    }
    if growth.knee == Knee::NeverCalm && (growth.is_small() || last_calm.is_some()) {
        growth.knee = Knee::None;
    }
    growth
}

/// Whether the curve hardly grows at its end.
fn is_calm(levels: &[Level]) -> bool {
    let Some(before) = levels.len().checked_sub(1 + WINDOW).map(|level| levels[level].n_voxels) else {
        return false;
    };
    let now = levels.last().map_or(0, |level| level.n_voxels);
    before >= MIN_VOXELS && now as f64 <= CALM * before as f64
}
