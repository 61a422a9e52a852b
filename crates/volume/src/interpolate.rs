//! What stands between voxels: the one policy of everything that resamples.
//!
//! | the volume holds | between its voxels |
//! |---|---|
//! | two values: a mask | the nearer of the two to the linear interpolation; of equal ones the larger |
//! | several whole numbers from 0 on, as [`Kind::Labels`] says, of which nothing tells that they are intensities: a label map | the nearest voxel's |
//! | anything else: a scan | linear interpolation, rounded where the numbers are whole |
//!
//! **What tells intensities?** A scanner's modality in a DICOM series; that the numbers are to be rescaled, which no label is;
//! that the caller chooses voxels by a band. Values alone do not: of 8 bits a scan has no more than a label map may have.
//! **Why by the values and not by their type?** A CT is whole numbers too; the nearest voxel would move its walls by up
//! to half a voxel, and between two labels linear interpolation would find a third.
//! **Input** stored numbers and their scaling, and where each new voxel lies among the old ones. **Output** the numbers
//! there; outside the old volume its smallest value, which is air in a CT and background in a mask.
//! **Guarantees** no value comes out that a mask or a label map had not; at the centre of an old voxel its own value
//! stands; a neighbour without weight counts for nothing, not even a NaN. The result does not depend on the number of
//! threads.
//! **Cost** O(new voxels), in parallel over planes.

use glam::{DAffine3, DVec3};
use ndarray::Array3;
use rayon::prelude::*;

use crate::Kind;
use crate::kind::Census;

/// How far rounding may put a share below a half.
pub(crate) const ROUNDING: f64 = 1e-9;

/// A type of stored numbers.
pub(crate) trait Number: Copy + Default + PartialOrd + Send + Sync {
    fn to_f64(self) -> f64;
    /// The nearest number of the type; of equal ones the larger.
    fn of_f64(value: f64) -> Self;
}

macro_rules! whole_number {
    ($($type:ty),*) => {$(
        impl Number for $type {
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            fn of_f64(value: f64) -> Self {
                (value + 0.5).floor() as Self
            }
        }
    )*};
}
whole_number!(u8, i16, u16, i32, u32);

impl Number for f32 {
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    fn of_f64(value: f64) -> Self {
        value as Self
    }
}

impl Number for f64 {
    fn to_f64(self) -> f64 {
        self
    }
    fn of_f64(value: f64) -> Self {
        value
    }
}

/// What stands between voxels, in stored numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Policy {
    /// One of two values.
    Mask { low: f64, high: f64 },
    /// The nearest voxel's.
    Labels,
    /// Linear interpolation.
    Scan,
}

/// The policy for a volume, and what stands outside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Between<T> {
    pub(crate) policy: Policy,
    pub(crate) fill: T,
}

impl<T: Number> Between<T> {
    /// By the volume's values, `slope · stored + intercept`, and by whether it is known to hold intensities.
    pub(crate) fn of(values: &[T], (slope, intercept): (f64, f64), is_scan: bool) -> Self {
        let (mut scaled, mut stored) = (Census::default(), Census::default());
        for &value in values {
            scaled.see(slope * value.to_f64() + intercept);
            stored.see(value.to_f64());
        }
        let policy = match scaled.kind() {
            Kind::Mask { .. } => Policy::Mask { low: stored.min, high: stored.max },
            _ if is_scan || (slope, intercept) != (1.0, 0.0) => Policy::Scan,
            Kind::Labels { .. } | Kind::Constant { .. } => Policy::Labels,
            Kind::Ct { .. } => Policy::Scan,
        };
        let least = if slope < 0.0 { stored.max } else { stored.min };
        Self { policy, fill: if least.is_finite() { T::of_f64(least) } else { T::default() } }
    }

    /// The number for a value that was interpolated.
    pub(crate) fn settle(&self, value: f64) -> T {
        match self.policy {
            Policy::Mask { low, high } if value.is_finite() => {
                let is_high = value - low >= (0.5 - ROUNDING) * (high - low);
                T::of_f64(if is_high { high } else { low })
            }
            _ => T::of_f64(value),
        }
    }

    /// The policy in words, for a message.
    pub(crate) fn words(&self) -> &'static str {
        match self.policy {
            Policy::Mask { .. } => "linear interpolation cut at a half, since they are a mask",
            Policy::Labels => "the nearest voxel, since they are labels",
            Policy::Scan => "linear interpolation",
        }
    }
}

/// Where each new voxel finds its value.
pub(crate) struct Lookup {
    pub(crate) old_shape: [usize; 3],
    pub(crate) new_shape: [usize; 3],
    pub(crate) old_from_new: DAffine3,
    /// Whether the volume is known to hold intensities.
    pub(crate) is_scan: bool,
}

impl Lookup {
    /// The volume at the new voxels, and how that was done.
    pub(crate) fn resample<T: Number>(
        &self,
        old: &Array3<T>,
        scaling: (f64, f64),
    ) -> (Array3<T>, &'static str) {
        // A volume's array is in standard layout, so there is a slice.
        let between = Between::of(old.as_slice().unwrap_or_default(), scaling, self.is_scan);
        let new = self.map(|point| {
            let Some([x, y, z]) = self.inside((point + 0.5).floor()) else { return between.fill };
            match between.policy {
                Policy::Labels => old[[z, y, x]],
                Policy::Mask { .. } | Policy::Scan => between.settle(self.trilinear(old, point)),
            }
        });
        (new, between.words())
    }

    fn trilinear<T: Number>(&self, old: &Array3<T>, point: DVec3) -> f64 {
        let base = point.floor();
        let weight = point - base;
        let mut sum = 0.0;
        for corner in 0..8_u32 {
            let step = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
            let share = (DVec3::ONE - step - weight * (DVec3::ONE - 2.0 * step)).to_array();
            let product = share[0] * share[1] * share[2];
            if product > 0.0 {
                let [x, y, z] = self.clamped(base + step);
                sum += product * old[[z, y, x]].to_f64();
            }
        }
        sum
    }

    #[expect(clippy::expect_used, reason = "the number of values is the product of the extents")]
    fn map<T: Send + Clone>(&self, value: impl Fn(DVec3) -> T + Sync) -> Array3<T> {
        let [nx, ny, nz] = self.new_shape;
        let plane = |z: usize| {
            let value = &value;
            (0..ny).flat_map(move |y| {
                (0..nx).map(move |x| {
                    value(self.old_from_new.transform_point3(DVec3::new(x as f64, y as f64, z as f64)))
                })
            })
        };
        let values: Vec<T> = (0..nz).into_par_iter().flat_map_iter(plane).collect();
        Array3::from_shape_vec((nz, ny, nx), values).expect("one value for each voxel")
    }

    fn inside(&self, voxel: DVec3) -> Option<[usize; 3]> {
        let far = DVec3::from_array(self.old_shape.map(|extent| extent as f64 - 1.0));
        let is_inside = voxel.cmpge(DVec3::ZERO).all() && voxel.cmple(far).all();
        is_inside.then(|| voxel.to_array().map(|v| v as usize))
    }

    fn clamped(&self, voxel: DVec3) -> [usize; 3] {
        let far = DVec3::from_array(self.old_shape.map(|extent| extent as f64 - 1.0));
        voxel.clamp(DVec3::ZERO, far).to_array().map(|v| v as usize)
    }
}

/// A volume of any type at the new voxels, and how that was done.
macro_rules! resample_voxels {
    ($lookup:expr, $voxels:expr, $scaling:expr) => {{
        use espalier_model::Voxels;
        macro_rules! of_type {
            ($kind:ident, $array:expr) => {{
                let (new, how) = $lookup.resample($array, $scaling);
                (Voxels::$kind(new), how)
            }};
        }
        match $voxels {
            Voxels::U8(array) => of_type!(U8, array),
            Voxels::I16(array) => of_type!(I16, array),
            Voxels::U16(array) => of_type!(U16, array),
            Voxels::I32(array) => of_type!(I32, array),
            Voxels::U32(array) => of_type!(U32, array),
            Voxels::F32(array) => of_type!(F32, array),
            Voxels::F64(array) => of_type!(F64, array),
        }
    }};
}
pub(crate) use resample_voxels;

/// Bytes for a stored number in memory.
pub(crate) fn bytes_per_voxel(voxels: &espalier_model::Voxels) -> u64 {
    use espalier_model::Voxels;
    match voxels {
        Voxels::U8(_) => 1,
        Voxels::I16(_) | Voxels::U16(_) => 2,
        Voxels::I32(_) | Voxels::U32(_) | Voxels::F32(_) => 4,
        Voxels::F64(_) => 8,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_halves<T: Number>(values: &[T]) -> Vec<f64> {
        resampled(values, (1.0, 0.0), false)
    }

    fn resampled<T: Number>(values: &[T], scaling: (f64, f64), is_scan: bool) -> Vec<f64> {
        let old = Array3::from_shape_vec((1, 1, values.len()), values.to_vec()).expect("a row");
        let old_from_new = DAffine3::from_scale(DVec3::new(0.5, 1.0, 1.0));
        let new_shape = [2 * values.len() + 1, 1, 1];
        let lookup = Lookup { old_shape: [values.len(), 1, 1], new_shape, old_from_new, is_scan };
        lookup.resample(&old, scaling).0.iter().map(|value| value.to_f64()).collect()
    }

    #[test]
    fn few_whole_numbers_are_no_labels_where_they_are_known_to_be_intensities() {
        let values = [1_u8, 3, 9];
        let blended = [1.0, 2.0, 3.0, 6.0, 9.0, 1.0, 1.0];
        assert_eq!(resampled(&values, (1.0, 0.0), true), blended);
        assert_eq!(resampled(&values, (4.0, -1024.0), false), blended);
        assert_eq!(resampled(&values, (1.0, 0.0), false), [1.0, 3.0, 3.0, 9.0, 9.0, 1.0, 1.0]);
        // Of two values nothing stands between, whatever they are.
        assert_eq!(resampled(&[0_u8, 7], (1.0, 0.0), true), [0.0, 7.0, 7.0, 0.0, 0.0]);
    }

    #[test]
    fn between_voxels_stands_what_the_values_allow() {
        // Beyond half a voxel of the last one the smallest value stands.
        assert_eq!(at_halves(&[0_i16, 7, 0]), [0.0, 7.0, 7.0, 7.0, 0.0, 0.0, 0.0]);
        assert_eq!(at_halves(&[1_u8, 3, 9]), [1.0, 3.0, 3.0, 9.0, 9.0, 1.0, 1.0]);
        assert_eq!(at_halves(&[-1000_i16, 40, 45]), [-1000.0, -480.0, 40.0, 43.0, 45.0, -1000.0, -1000.0]);
        assert_eq!(at_halves(&[0.5_f32, 1.0, 2.0]), [0.5, 0.75, 1.0, 1.5, 2.0, 0.5, 0.5]);
        let with_nan = at_halves(&[f64::NAN, 1.5, 2.5, 4.5]);
        assert!(with_nan[0].is_nan() && with_nan[1].is_nan());
        assert_eq!(with_nan[2..], [1.5, 2.0, 2.5, 3.5, 4.5, 1.5, 1.5]);
    }
}
