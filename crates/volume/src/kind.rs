//! What a volume is: a mask, a label map, or a CT.
//!
//! **Input** a volume. **Output** [`Kind`], from its finite values alone.
//! **Steps** one pass that keeps the distinct values as long as they are few.
//! **Cost** O(voxels · log distinct values) time, constant memory.

use std::collections::BTreeSet;

use espalier_model::Volume;

use crate::Error;

/// More distinct values than this, and a volume of whole numbers is no label map.
const MAX_LABELS: usize = 512;
/// The largest number that is still taken for a label.
const MAX_LABEL: f64 = 65_535.0;
/// Of a map of regions: the finest atlases have some hundred, a scan has thousands of values.
const MAX_REGIONS: usize = 1024;

/// What a volume is by its values.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Two values: 0 and another one, or else the smaller and the larger.
    Mask {
        /// The value of the background.
        background: f64,
        /// The value of the organ.
        foreground: f64,
    },
    /// Several whole numbers from 0 to 65,535, at most 512 of them.
    Labels {
        /// The values, ascending.
        values: Vec<f64>,
    },
    /// Anything else: a scan.
    Ct {
        /// The smallest finite value.
        min: f64,
        /// The largest finite value.
        max: f64,
    },
    /// One value everywhere; NaN if there is no finite value at all.
    Constant {
        /// The value.
        value: f64,
    },
}

/// Tells what a volume is. Values that are not finite do not count.
///
/// ```
/// use espalier_model::{Grid, Volume, Voxels};
/// use espalier_volume::{Kind, inspect_kind};
/// let grid = Grid::axis_aligned([3, 1, 1], glam::DVec3::ONE, glam::DVec3::ZERO).unwrap();
/// let array = ndarray::arr3(&[[[0_i16, 255, 0]]]);
/// let volume = Volume::new(grid, Voxels::I16(array), 1.0, 0.0);
/// assert_eq!(inspect_kind(&volume), Kind::Mask { background: 0.0, foreground: 255.0 });
/// ```
#[must_use]
pub fn inspect_kind(volume: &Volume) -> Kind {
    let mut census = Census::default();
    volume.for_each_value(|value| census.see(value));
    census.kind()
}

/// Checks that a volume may be a map of regions: whole numbers of any size and sign, at most 1024 different ones. Wider
/// than [`Kind::Labels`], since here it is known what the volume is meant to be.
///
/// # Errors
/// [`Error::NotRegions`] for anything else, such as a scan.
pub fn check_regions(volume: &Volume) -> Result<(), Error> {
    let mut distinct: BTreeSet<i64> = BTreeSet::new();
    let (mut is_whole, mut last) = (true, f64::NAN);
    let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
    volume.for_each_value(|value| {
        if value == last || !value.is_finite() {
            return;
        }
        last = value;
        (min, max) = (min.min(value), max.max(value));
        is_whole &= value.trunc() == value;
        if distinct.len() <= MAX_REGIONS {
            distinct.insert(value as i64);
        }
    });
    let n_values = if is_whole { distinct.len() } else { 0 };
    let is_map = is_whole && n_values <= MAX_REGIONS;
    if is_map { Ok(()) } else { Err(Error::NotRegions { n_values, min, max }) }
}

/// The values of a volume as far as its kind depends on them.
#[derive(Clone, Debug)]
pub(crate) struct Census {
    /// The distinct finite values, ascending, as long as they are few.
    distinct: Vec<f64>,
    /// The smallest finite value.
    pub(crate) min: f64,
    /// The largest finite value.
    pub(crate) max: f64,
    /// Whether there are values that are not finite.
    pub(crate) has_other: bool,
    last: f64,
}

impl Default for Census {
    fn default() -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        Self { distinct: Vec::new(), min, max, has_other: false, last: f64::NAN }
    }
}

impl Census {
    /// Takes notice of a value.
    pub(crate) fn see(&mut self, value: f64) {
        // Most voxels are as their neighbour before.
        if value == self.last {
            return;
        }
        if !value.is_finite() {
            self.has_other = true;
            return;
        }
        self.last = value;
        (self.min, self.max) = (self.min.min(value), self.max.max(value));
        if self.distinct.len() <= MAX_LABELS
            && let Err(place) = self.distinct.binary_search_by(|known| known.total_cmp(&(value + 0.0)))
        {
            self.distinct.insert(place, value + 0.0);
        }
    }

    /// What a volume of these values is.
    pub(crate) fn kind(&self) -> Kind {
        let is_label = |&value: &f64| value.trunc() == value && (0.0..=MAX_LABEL).contains(&value);
        match self.distinct[..] {
            [] => Kind::Constant { value: f64::NAN },
            [value] => Kind::Constant { value },
            [low, high] if high == 0.0 => Kind::Mask { background: high, foreground: low },
            [low, high] => Kind::Mask { background: low, foreground: high },
            _ if self.distinct.len() <= MAX_LABELS && self.distinct.iter().all(is_label) => {
                Kind::Labels { values: self.distinct.clone() }
            }
            _ => Kind::Ct { min: self.min, max: self.max },
        }
    }
}
