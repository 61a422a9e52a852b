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

use espalier_model::table::{Column, Table, fixed};
use espalier_model::{Bits, Volume, Voxels};

use crate::half_maximum::HalfMaximum;

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
/// Where all values are whole, so many of them make a curve of whole steps.
const WHOLE_WAY: f64 = 25.0;
/// The most levels, so that thresholds in any unit cost little.
const MAX_LEVELS: f64 = 4096.0;

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
    scale: Scale,
}

/// The columns of `growth.tsv`.
pub const GROWTH_COLUMNS: [Column; 4] = [
    Column::new("threshold", "scaled value, HU for CT", "the end of the band that moves"),
    Column::new("voxels", "voxels", "the size of the region about the seed at that threshold"),
    Column::new("volume_ml", "ml", "its volume"),
    Column::new(
        "state",
        "n/a",
        "half: half-way from the values inside to those outside, to which vessels grow; stable: the last threshold \
         before the leak; leak: from it on the region leaks",
    ),
];

impl Growth {
    /// The threshold to grow to: half-way from inside to outside if that was looked for and found, else the stable
    /// one, or the last if nothing leaks.
    #[must_use]
    pub fn threshold(&self) -> Option<f64> {
        if let Some(level) = self.half_level() {
            return Some(level.threshold);
        }
        match self.knee {
            Knee::Leak { stable } => self.levels.get(stable).map(|level| level.threshold),
            Knee::None => self.levels.last().map(|level| level.threshold),
            Knee::NeverCalm => None,
        }
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
        self.levels.get(self.half_maximum?.level?).copied()
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
        for (level_idx, level) in self.levels.iter().enumerate() {
            let half = self.half_maximum.and_then(|half| half.level);
            let state = match level_idx {
                idx if half == Some(idx) && idx != stable => "half",
                idx if idx == stable => "stable",
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
    let scale = Scale::new(volume, seed, towards, limit);
    let mut flood = Flood::new(volume, scale, seed);
    let mut growth = Growth {
        levels: Vec::new(),
        knee: Knee::NeverCalm,
        voxel_ml: volume.grid().voxel_volume_mm3() / 1000.0,
        half_maximum: None,
        scale,
    };
    let mut last_calm = None;
    for level in 0..flood.queues.len() {
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

/// The voxels of the region at one level.
pub(crate) fn region_at(volume: &Volume, seed: [usize; 3], growth: &Growth, level: usize) -> Bits {
    let scale = growth.scale;
    let only = Scale { origin: scale.origin + level as f64 * scale.step, n_levels: 1, ..scale };
    let mut flood = Flood::new(volume, only, seed);
    flood.drain(0);
    flood.is_seen
}

/// Whether every value is a whole number, so that no threshold between two of them makes a difference.
fn has_whole_values(volume: &Volume) -> bool {
    let (slope, intercept) = volume.scaling();
    let is_stored_whole = !matches!(volume.voxels(), Voxels::F32(_) | Voxels::F64(_));
    is_stored_whole && slope.fract() == 0.0 && intercept.fract() == 0.0
}

/// Levels of thresholds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scale {
    /// +1 where the threshold rises, −1 where it falls.
    sign: f64,
    /// The threshold of level 0, times `sign`.
    origin: f64,
    step: f64,
    n_levels: usize,
}

impl Scale {
    fn new(volume: &Volume, seed: [usize; 3], towards: Towards, limit: f64) -> Self {
        let sign = match towards {
            Towards::Bright => 1.0,
            Towards::Dark => -1.0,
        };
        let start = sign * volume.value(volume.grid().index(seed));
        // An open end is the end of the values that there are.
        let mut end = f64::NEG_INFINITY;
        volume.for_each_value(|value| {
            let value = sign * value;
            end = if value.is_finite() && value > end { value } else { end };
        });
        let end = end.min(sign * limit).max(start);
        // Whole HU for a CT; a thousandth of the way for values on another scale.
        let way = end - start;
        let is_whole = way >= if has_whole_values(volume) { WHOLE_WAY } else { 100.0 };
        let step = if is_whole { 1.0_f64.max((way / MAX_LEVELS).ceil()) } else { way / 1000.0 };
        let step = if step > 0.0 { step } else { 1.0 };
        let origin = if step >= 1.0 { (start / step).ceil() * step } else { start };
        let n_levels = (((end - origin) / step).floor().max(0.0) as usize).min(2 * MAX_LEVELS as usize) + 1;
        Self { sign, origin, step, n_levels }
    }

    fn threshold(&self, level: f64) -> f64 {
        // Adding 0 makes −0 a plain 0.
        self.sign * (self.origin + level * self.step) + 0.0
    }

    /// The level at which a voxel of this value enters the band.
    fn level(&self, value: f64) -> Option<usize> {
        let above = self.above(value);
        // False for NaN.
        (above < self.n_levels as f64).then_some(above.max(0.0) as usize)
    }

    /// The same, negative for values before the seed's, and as large as it takes.
    fn above(&self, value: f64) -> f64 {
        ((self.sign * value - self.origin) / self.step).ceil()
    }
}

/// A flood that enters higher levels only when it must.
struct Flood<'a> {
    volume: &'a Volume,
    scale: Scale,
    is_seen: Bits,
    /// Voxels about to be entered, by the level that they need.
    queues: Vec<Vec<usize>>,
    n_reached: usize,
}

impl<'a> Flood<'a> {
    fn new(volume: &'a Volume, scale: Scale, seed: [usize; 3]) -> Self {
        let mut queues = vec![Vec::new(); scale.n_levels];
        queues[0].push(volume.grid().index(seed));
        let mut is_seen = Bits::new(volume.grid().shape());
        is_seen.set(seed);
        Self { volume, scale, is_seen, queues, n_reached: 0 }
    }

    /// Enters all voxels that can be reached at this level.
    fn drain(&mut self, level: usize) {
        let grid = self.volume.grid();
        let shape = grid.shape();
        let mut queue = std::mem::take(&mut self.queues[level]);
        while let Some(index) = queue.pop() {
            self.n_reached += 1;
            let voxel = grid.voxel(index);
            for axis in 0..3 {
                for step in [-1, 1] {
                    let mut other = voxel;
                    other[axis] = voxel[axis].wrapping_add_signed(step);
                    if other[axis] >= shape[axis] || self.is_seen.get(other) {
                        continue;
                    }
                    let other_index = grid.index(other);
                    let Some(needed) = self.scale.level(self.volume.value(other_index)) else { continue };
                    self.is_seen.set(other);
                    if needed <= level { &mut queue } else { &mut self.queues[needed] }.push(other_index);
                }
            }
        }
    }
}
