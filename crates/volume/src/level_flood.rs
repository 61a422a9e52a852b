//! A flood that enters higher levels of values only when it must.
//!
//! **Input** a volume, a seed, [`Scale`], over what voxels connect. **Output** the number of voxels reached at each level,
//! or the region at one.
//! **Notation** level k, the threshold k steps from the seed's value.
//! **Steps** a queue for each level: what needs a higher one than the present waits there.
//! **Guarantees** the region at a level is the component of the band that holds the seed. No recursion.
//! **Cost** O(voxels reached + levels) time, a bit a voxel and the region's border in memory.

use espalier_model::{Bits, Volume, Voxels};

use crate::growth::Towards;
use crate::runs::Connectivity;

/// Where all values are whole, so many of them make a curve of whole steps.
const WHOLE_WAY: f64 = 25.0;
/// The most levels, so that thresholds in any unit cost little.
const MAX_LEVELS: f64 = 4096.0;

/// The voxels of the region at one level.
pub(crate) fn region_at(
    (volume, seed): (&Volume, [usize; 3]),
    scale: Scale,
    level: usize,
    connectivity: Connectivity,
) -> Bits {
    let only = Scale { origin: scale.origin + level as f64 * scale.step, n_levels: 1, ..scale };
    let mut flood = Flood::new(volume, only, seed, connectivity);
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
pub(crate) struct Scale {
    /// +1 where the threshold rises, −1 where it falls.
    sign: f64,
    /// The threshold of level 0, times `sign`.
    origin: f64,
    step: f64,
    pub(crate) n_levels: usize,
}

impl Scale {
    pub(crate) fn new(volume: &Volume, seed: [usize; 3], towards: Towards, limit: f64) -> Self {
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

    pub(crate) fn threshold(&self, level: f64) -> f64 {
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
    pub(crate) fn above(&self, value: f64) -> f64 {
        ((self.sign * value - self.origin) / self.step).ceil()
    }
}

/// A flood that enters higher levels only when it must.
pub(crate) struct Flood<'a> {
    volume: &'a Volume,
    scale: Scale,
    is_seen: Bits,
    /// Voxels about to be entered, by the level that they need.
    queues: Vec<Vec<usize>>,
    /// To the neighbours.
    steps: Vec<[isize; 3]>,
    pub(crate) n_reached: usize,
}

impl<'a> Flood<'a> {
    pub(crate) fn new(
        volume: &'a Volume,
        scale: Scale,
        seed: [usize; 3],
        connectivity: Connectivity,
    ) -> Self {
        let mut queues = vec![Vec::new(); scale.n_levels];
        queues[0].push(volume.grid().index(seed));
        let mut is_seen = Bits::new(volume.grid().shape());
        is_seen.set(seed);
        let all = (0..27_isize).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1]);
        let is_about = |step: &[isize; 3]| {
            let n = step.iter().filter(|&&v| v != 0).count();
            n == 1 || n > 1 && connectivity == Connectivity::All
        };
        Self { volume, scale, is_seen, queues, steps: all.filter(is_about).collect(), n_reached: 0 }
    }

    /// Enters all voxels that can be reached at this level.
    pub(crate) fn drain(&mut self, level: usize) {
        let grid = self.volume.grid();
        let shape = grid.shape();
        let mut queue = std::mem::take(&mut self.queues[level]);
        while let Some(index) = queue.pop() {
            self.n_reached += 1;
            let voxel = grid.voxel(index);
            for step in &self.steps {
                let other: [usize; 3] =
                    std::array::from_fn(|axis| voxel[axis].wrapping_add_signed(step[axis]));
                if (0..3).any(|axis| other[axis] >= shape[axis]) || self.is_seen.get(other) {
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
