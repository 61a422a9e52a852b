//! The values along rays across a branch.
//!
//! **Input** a scan with a mask, a place on the axis. **Output** [`Section`]: for each ray where it leaves the mask, and the
//! scan's values from the axis on to [`OUTWARDS`] voxels beyond.
//! **Steps** 1. [`N_FINE`] rays in each of [`N_PLANES`] planes across the axis, a voxel apart: the mean of the planes. 2. Of
//! every other ray the mean with the two beside it: nine lines, which leave a third of the noise.
//! **Guarantees** a ray that runs on in the mask for [`LIMIT_RADII`] radii, along another branch, is none.

use std::f64::consts::TAU;

use espalier_geom::math::unit_vector;
use espalier_geom::space::plane_axes;
use glam::DVec3;

use super::{Place, Scan};

/// Rays in a plane.
const N_FINE: usize = 24;
/// Of so many one is kept, with those beside it.
const STRIDE: usize = 2;
const N_PLANES: i32 = 3;
/// Samples in the smallest spacing.
const PER_VOXEL: f64 = 4.0;
/// How far values are read beyond the mask's surface, in voxels.
const OUTWARDS: f64 = 4.0;
/// A branch is not wider than so many of its radii.
const LIMIT_RADII: f64 = 2.5;
/// The share of the radius within which the lumen is read.
const CORE: f64 = 0.3;

/// A cross-section of a branch as the scan has it.
pub(super) struct Section {
    /// The mean about the axis.
    pub(super) lumen: f64,
    /// Some of which are none.
    pub(super) rays: Vec<Option<Ray>>,
    /// How far samples are apart.
    pub(super) step_mm: f64,
}

/// A ray from the axis outwards.
pub(super) struct Ray {
    /// Where it leaves the mask.
    pub(super) surface_mm: f64,
    /// How long a voxel is that way.
    pub(super) voxel_mm: f64,
    /// The values, the first on the axis.
    pub(super) values: Vec<f64>,
}

impl Section {
    /// The mean distance of the mask's surface from the axis, in mm.
    pub(super) fn girth_mm(&self) -> f64 {
        let (n, sum) =
            self.rays.iter().flatten().fold((0.0, 0.0), |(n, sum), ray| (n + 1.0, sum + ray.surface_mm));
        sum / f64::max(n, 1.0)
    }
}

impl Scan<'_> {
    /// The section at a place; none where the scan or the mask has nothing to show there.
    pub(super) fn section(&self, place: Place) -> Option<Section> {
        let step_mm = self.spacing.min_element() / PER_VOXEL;
        let (right, up) = plane_axes(place.tangent, DVec3::Z);
        let fine: Vec<Option<Ray>> = (0..N_FINE)
            .map(|i| {
                let turn = unit_vector(TAU * i as f64 / N_FINE as f64);
                self.ray(place, right * turn.x + up * turn.y, step_mm)
            })
            .collect();
        let core = |ray: &Ray| {
            ray.values.iter().take((CORE * ray.surface_mm / step_mm) as usize + 1).copied().collect()
        };
        let core: Vec<f64> = fine.iter().flatten().flat_map(|ray| -> Vec<f64> { core(ray) }).collect();
        let rays = (0..N_FINE).step_by(STRIDE).map(|i| with_sides(&fine, i)).collect();
        (!core.is_empty()).then(|| Section {
            lumen: core.iter().sum::<f64>() / core.len() as f64,
            rays,
            step_mm,
        })
    }

    /// The mean of the lines along `way` in each plane.
    fn ray(&self, place: Place, way: DVec3, step_mm: f64) -> Option<Ray> {
        let voxel_mm = (way * self.spacing).length();
        let along_mm = place.tangent.abs().dot(self.spacing);
        let n_most = ((LIMIT_RADII * place.radius_mm + voxel_mm) / step_mm) as usize;
        let starts: Vec<DVec3> = (0..N_PLANES)
            .map(|plane| place.center + place.tangent * along_mm * f64::from(plane - N_PLANES / 2))
            .collect();
        let point = |start: &DVec3, i: usize| *start + way * (i as f64 * step_mm);
        let mut surface_mm = 0.0;
        for start in &starts {
            let is_outside =
                |&i: &usize| !self.background.is_foreground(self.background.voxel_at(point(start, i)));
            let first = (0..=n_most).find(is_outside)?;
            surface_mm += (first as f64 - 0.5).max(0.0) * step_mm / f64::from(N_PLANES);
        }
        let n_samples = ((surface_mm + OUTWARDS * voxel_mm) / step_mm) as usize + 1;
        let mean = |i: usize| -> Option<f64> {
            let sum = starts.iter().try_fold(0.0, |sum, start| Some(sum + self.value(point(start, i))?));
            sum.map(|sum| sum / f64::from(N_PLANES))
        };
        let values: Vec<f64> = (0..n_samples).map_while(mean).collect();
        (!values.is_empty()).then_some(Ray { surface_mm, voxel_mm, values })
    }
}

/// A ray with the means of itself and the two beside it, as far as there are such.
fn with_sides(fine: &[Option<Ray>], i: usize) -> Option<Ray> {
    let Ray { voxel_mm, values, .. } = fine[i].as_ref()?;
    let three = [i, (i + 1) % N_FINE, (i + N_FINE - 1) % N_FINE];
    let three: Vec<&Ray> = three.into_iter().filter_map(|i| fine[i].as_ref()).collect();
    let mean = |of: &dyn Fn(&Ray) -> Option<f64>| {
        let known = three.iter().filter_map(|ray| of(ray));
        let (n, sum) = known.fold((0.0, 0.0), |(n, sum), value| (n + 1.0, sum + value));
        sum / n
    };
    Some(Ray {
        surface_mm: mean(&|ray| Some(ray.surface_mm)),
        voxel_mm: *voxel_mm,
        values: (0..values.len()).map(|n| mean(&|ray| ray.values.get(n).copied())).collect(),
    })
}
