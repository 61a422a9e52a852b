//! A scan between its voxels, and over a slab.
//!
//! **Input** a scan, a point of the patient (RAS+ mm), the direction across the slab. **Output** the value there; none
//! outside of the scan, or where it has no number.
//! **Steps** linear interpolation of the eight voxels around the point; over a slab at steps of at most half the least
//! spacing, on either side equally many.
//! **Guarantees** at a voxel's centre its own value; half a voxel beyond the outermost centres counts as inside; a
//! neighbour without weight counts for nothing, not even a NaN. A slab shows nothing where its middle has no value.

use espalier_model::Volume;
use glam::{DAffine3, DVec3};

use super::params::{Slab, VolumeParams};

/// The most samples on either side of a slab.
const MAX_ASIDE: f64 = 200.0;

/// A scan to be sampled.
pub(super) struct Sampler<'a> {
    scan: &'a Volume,
    voxel_from_world: DAffine3,
    /// Places across the slab but the middle, mm.
    offsets_mm: Vec<f64>,
    slab: Slab,
}

impl<'a> Sampler<'a> {
    pub(super) fn new(scan: &'a Volume, params: &VolumeParams) -> Self {
        let half_mm = 0.5 * params.slab_mm;
        let step_mm = 0.5 * scan.grid().spacing_mm().min_element();
        let n_aside = (half_mm / step_mm).ceil().min(MAX_ASIDE) as i32;
        let offset = |i: i32| f64::from(i) * half_mm / f64::from(n_aside.max(1));
        Self {
            scan,
            voxel_from_world: scan.grid().voxel_from_world(),
            offsets_mm: (-n_aside..=n_aside).filter(|&i| i != 0).map(offset).collect(),
            slab: params.slab,
        }
    }

    /// The value of the slab through a point across `normal`.
    pub(super) fn slab(&self, point_mm: DVec3, normal: DVec3) -> Option<f64> {
        let middle = self.at(point_mm)?;
        let others = self.offsets_mm.iter().filter_map(|&offset| self.at(point_mm + normal * offset));
        Some(match self.slab {
            Slab::Mean => {
                let (sum, n) = others.fold((middle, 1.0), |(sum, n), value| (sum + value, n + 1.0));
                sum / n
            }
            Slab::Mip => others.fold(middle, f64::max),
            Slab::Minip => others.fold(middle, f64::min),
        })
    }

    /// The value at a point.
    pub(super) fn at(&self, point_mm: DVec3) -> Option<f64> {
        self.scan.between(self.voxel_from_world.transform_point3(point_mm))
    }
}

#[cfg(test)]
mod tests {
    use espalier_model::{Grid, Voxels};
    use ndarray::Array3;

    use super::*;

    /// x + 10 y + 100 z on an oblique grid, with one voxel that has no number.
    fn oblique() -> Volume {
        let (s, c) = (0.6, 0.8);
        let affine = DAffine3::from_cols(
            DVec3::new(c, s, 0.0) * 0.5,
            DVec3::new(0.0, 0.0, -2.0),
            DVec3::new(-s, c, 0.0) * 1.5,
            DVec3::new(7.0, -3.0, 40.0),
        );
        let grid = Grid::new([6, 5, 4], affine).expect("a grid");
        let mut values = Array3::from_shape_fn((4, 5, 6), |(z, y, x)| (x + 10 * y + 100 * z) as f32);
        values[[3, 4, 5]] = f32::NAN;
        Volume::new(grid, Voxels::F32(values), 1.0, -50.0)
    }

    #[test]
    fn between_voxels_a_scan_is_linear_in_any_direction() {
        let scan = oblique();
        let sampler = Sampler::new(&scan, &VolumeParams::default());
        let world =
            |x: f64, y: f64, z: f64| scan.grid().world_from_voxel().transform_point3(DVec3::new(x, y, z));
        for (x, y, z) in
            [(0.0, 0.0, 0.0), (2.5, 1.25, 0.75), (4.9, 3.9, 1.5), (5.0, 0.0, 3.0), (1.0, 4.0, 2.0)]
        {
            let value = sampler.at(world(x, y, z)).expect("inside");
            assert!((value - (x + 10.0 * y + 100.0 * z - 50.0)).abs() < 1e-9, "{x} {y} {z}: {value}");
        }
        // Within half a voxel of the outermost centres the value stands, beyond there is none.
        assert!(sampler.at(world(-0.49, 0.0, 0.0)).is_some_and(|value| (value + 50.0).abs() < 1e-9));
        for (x, y, z) in [(-0.51, 0.0, 0.0), (0.0, 4.6, 0.0), (0.0, 0.0, 3.51), (f64::NAN, 0.0, 0.0)] {
            assert_eq!(sampler.at(world(x, y, z)), None);
        }
        // What has no number is no number, and no zero.
        assert_eq!(sampler.at(world(5.0, 4.0, 3.0)), None);
        assert_eq!(sampler.at(world(4.5, 4.0, 3.0)), None);
        assert!(sampler.at(world(4.0, 4.0, 3.0)).is_some());
    }

    #[test]
    fn a_slab_gathers_on_both_sides() {
        let grid = Grid::axis_aligned([3, 3, 21], DVec3::ONE, DVec3::ZERO).expect("a grid");
        let values = Array3::from_shape_fn((21, 3, 3), |(z, ..)| if z == 7 { 90_i16 } else { z as i16 });
        let scan = Volume::new(grid, Voxels::I16(values), 1.0, 0.0);
        let at = |slab_mm: f64, slab: Slab| {
            let params = VolumeParams { slab_mm, slab, ..VolumeParams::default() };
            Sampler::new(&scan, &params).slab(DVec3::new(1.0, 1.0, 10.0), DVec3::Z)
        };
        assert_eq!(at(0.0, Slab::Mip), Some(10.0));
        assert_eq!(at(4.0, Slab::Mip), Some(12.0));
        assert_eq!(at(4.0, Slab::Minip), Some(8.0));
        assert_eq!(at(4.0, Slab::Mean), Some(10.0));
        assert_eq!(at(6.0, Slab::Mip), Some(90.0));
        // Beyond the scan it goes on without.
        assert_eq!(at(60.0, Slab::Minip), Some(0.0));
        let params = VolumeParams { slab_mm: 50.0, ..VolumeParams::default() };
        assert_eq!(Sampler::new(&scan, &params).slab(DVec3::new(1.0, 1.0, -5.0), DVec3::Z), None);
    }

    #[test]
    fn a_single_voxel_is_a_scan() {
        let grid = Grid::axis_aligned([1, 1, 1], DVec3::ONE, DVec3::ZERO).expect("a grid");
        let scan = Volume::new(grid, Voxels::U8(Array3::from_elem((1, 1, 1), 9)), 1.0, 0.0);
        assert_eq!(Sampler::new(&scan, &VolumeParams::default()).at(DVec3::new(0.3, -0.2, 0.49)), Some(9.0));
    }
}
