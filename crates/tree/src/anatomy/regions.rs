//! The region of a label map that a branch lies in: a lobe, a segment of the liver.
//!
//! **Input** a label map on any grid, names of its values; the line of a branch. **Output** the label along most of the
//! line, and its share; where the whole line lies outside of all labels, the nearest within reach.
//! **Steps** 1. Sample the line at half the map's smallest spacing, in RAS+ mm. 2. Count samples by label; 0 is no label.
//! 3. If there is none, look at all voxels around each sample as far as the reach.
//! **Guarantees** grids may differ in place, spacing and orientation; ties go to the smaller label.
//! **Cost** O(samples); with step 3, O(samples · voxels within reach).

use std::collections::BTreeMap;

use espalier_geom::math;
use espalier_model::{Region, Volume};
use glam::DVec3;

use super::line::Line;

/// Samples of a line, in smallest spacings of the map.
const STEP: f64 = 0.5;
/// Samples at most of one line: finer than a map of any scan asks for.
const MAX_SAMPLES: f64 = 1e5;
/// Samples at most around which step 3 looks: where the nearest label lies changes slowly along a branch.
const MAX_SEARCHES: usize = 64;

/// A label map with names.
#[derive(Clone, Debug)]
pub struct LabelMap {
    /// The map; voxels hold whole numbers, 0 is no label.
    pub volume: Volume,
    /// Names of labels.
    pub names: BTreeMap<i64, String>,
    /// Colours of labels, sRGB.
    pub colors: BTreeMap<i64, [u8; 3]>,
    /// How far from a branch the nearest label may be, in mm.
    pub reach_mm: f64,
}

impl LabelMap {
    /// The region of a branch; none if no label is within reach.
    pub(super) fn region_of(&self, line: &Line) -> Option<Region> {
        let step_mm = STEP * self.volume.grid().spacing_mm().min_element();
        let n_samples = math::ceil(line.length_mm() / step_mm).clamp(1.0, MAX_SAMPLES);
        let samples: Vec<DVec3> = (0..n_samples as usize)
            .map(|sample| line.point_mm(line.length_mm() * (sample as f64 + 0.5) / n_samples))
            .collect();
        let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
        for label in samples.iter().filter_map(|&sample| self.label_at(sample)) {
            *counts.entry(label).or_default() += 1;
        }
        // `max_by_key` takes the last of equals: go backwards.
        if let Some((&label, &count)) = counts.iter().rev().max_by_key(|(_, count)| **count) {
            return Some(self.region(label, count as f64 / n_samples));
        }
        self.nearest_to(&samples).map(|label| self.region(label, 0.0))
    }

    fn region(&self, label: i64, share: f64) -> Region {
        let name = self.names.get(&label).cloned().unwrap_or_else(|| label.to_string());
        Region { label, name, color: self.colors.get(&label).copied(), share }
    }

    fn label_at(&self, point_mm: DVec3) -> Option<i64> {
        let grid = self.volume.grid();
        let voxel = grid.voxel_at(grid.voxel_from_world().transform_point3(point_mm))?;
        self.label_of(voxel)
    }

    /// The label of a voxel; none for 0 and for what is no whole number of any use.
    fn label_of(&self, voxel: [usize; 3]) -> Option<i64> {
        let value = self.volume.value(self.volume.grid().index(voxel));
        (value.is_finite() && value.abs() < 1e15)
            .then(|| (value + 0.5).floor() as i64)
            .filter(|&label| label != 0)
    }

    /// The label whose voxels come nearest to the samples, within reach.
    fn nearest_to(&self, samples: &[DVec3]) -> Option<i64> {
        let stride = samples.len().div_ceil(MAX_SEARCHES);
        let nearest = samples.iter().step_by(stride).filter_map(|&sample| self.nearest_at(sample));
        nearest.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, label)| label)
    }

    fn nearest_at(&self, point_mm: DVec3) -> Option<(f64, i64)> {
        let grid = self.volume.grid();
        let center = grid.voxel_from_world().transform_point3(point_mm);
        let reach = DVec3::splat(self.reach_mm) / grid.spacing_mm();
        let shape = DVec3::from_array(grid.shape().map(|extent| extent as f64 - 1.0));
        let low = (center - reach).ceil().max(DVec3::ZERO);
        let high = (center + reach).floor().min(shape);
        if low.cmpgt(high).any() {
            return None;
        }
        let range = |axis: usize| low[axis] as usize..=high[axis] as usize;
        let mut nearest: Option<(f64, i64)> = None;
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let Some(label) = self.label_of([x, y, z]) else { continue };
                    let voxel = DVec3::new(x as f64, y as f64, z as f64);
                    let distance = grid.world_from_voxel().transform_point3(voxel).distance(point_mm);
                    let is_nearer = nearest.is_none_or(|(best, known)| (distance, label) < (best, known));
                    if distance <= self.reach_mm && is_nearer {
                        nearest = Some((distance, label));
                    }
                }
            }
        }
        nearest
    }
}
