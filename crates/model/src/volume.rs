//! A scalar volume: CT, label map or mask as it stands in a file.

use glam::DVec3;
use ndarray::Array3;

use crate::Grid;

/// The stored numbers of a volume, shape (nz, ny, nx), x fastest.
#[derive(Clone, Debug, PartialEq)]
pub enum Voxels {
    /// 8 bits, unsigned.
    U8(Array3<u8>),
    /// 16 bits, signed: the usual CT.
    I16(Array3<i16>),
    /// 16 bits, unsigned.
    U16(Array3<u16>),
    /// 32 bits, signed.
    I32(Array3<i32>),
    /// 32 bits, unsigned: label maps.
    U32(Array3<u32>),
    /// Single precision.
    F32(Array3<f32>),
    /// Double precision; also 64-bit integers, exact up to 2⁵³.
    F64(Array3<f64>),
}

/// Runs `$body` with `$array` bound to the typed array, whatever its type.
macro_rules! with_array {
    ($voxels:expr, $array:ident => $body:expr) => {
        match $voxels {
            Voxels::U8($array) => $body,
            Voxels::I16($array) => $body,
            Voxels::U16($array) => $body,
            Voxels::I32($array) => $body,
            Voxels::U32($array) => $body,
            Voxels::F32($array) => $body,
            Voxels::F64($array) => $body,
        }
    };
}

/// A scalar volume on a grid. A voxel's value is `slope · stored + intercept`.
///
/// **Guarantees** the array has the grid's shape, in standard layout; slope and intercept are finite, the slope
/// not zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    grid: Grid,
    voxels: Voxels,
    slope: f64,
    intercept: f64,
}

#[allow(clippy::unnecessary_cast, reason = "one arm of `with_array` is f64 already")]
impl Volume {
    /// A volume of stored numbers and their scaling (HU for CT: usually 1 and 0).
    ///
    /// # Panics
    /// If the array has not the grid's shape or the scaling is not legal: a mistake of the caller's code, since
    /// readers check both at the door.
    #[must_use]
    pub fn new(grid: Grid, voxels: Voxels, slope: f64, intercept: f64) -> Self {
        let [nx, ny, nz] = grid.shape();
        let is_standard = with_array!(&voxels, a => a.dim() == (nz, ny, nx) && a.is_standard_layout());
        assert!(is_standard, "volume array does not match its grid");
        assert!(slope.is_finite() && slope != 0.0 && intercept.is_finite(), "scaling {slope}, {intercept}");
        Self { grid, voxels, slope, intercept }
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The stored numbers.
    #[must_use]
    pub fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// The bytes of its numbers.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        with_array!(&self.voxels, array => size_of_val(array.as_slice().unwrap_or_default()) as u64)
    }

    /// Slope and intercept of the scaling.
    #[must_use]
    pub fn scaling(&self) -> (f64, f64) {
        (self.slope, self.intercept)
    }

    /// The scaled value at a flat index (x fastest).
    #[must_use]
    pub fn value(&self, index: usize) -> f64 {
        let stored = with_array!(&self.voxels, a => a.as_slice().map_or(f64::NAN, |s| s[index] as f64));
        self.slope * stored + self.intercept
    }

    /// The scaled value at a point in voxels, linear between the eight centres around it. Half a voxel beyond the outermost
    /// centres the outermost value stands, farther out there is none; nor is there where a centre that counts has no number.
    #[must_use]
    pub fn between(&self, voxel: DVec3) -> Option<f64> {
        self.grid.voxel_at(voxel)?;
        let shape = self.grid.shape();
        let (mut low, mut share) = ([0_usize; 3], [0.0; 3]);
        for axis in 0..3 {
            let place = voxel[axis].clamp(0.0, (shape[axis] - 1) as f64);
            low[axis] = (place as usize).min(shape[axis].saturating_sub(2));
            share[axis] = place - low[axis] as f64;
        }
        let mut sum = 0.0;
        for corner in 0..8 {
            let side = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 =
                (0..3).map(|axis| if side[axis] == 1 { share[axis] } else { 1.0 - share[axis] }).product();
            if weight > 0.0 {
                sum += weight * self.value(self.grid.index([0, 1, 2].map(|axis| low[axis] + side[axis])));
            }
        }
        sum.is_finite().then_some(sum)
    }

    /// Calls `visit` with each scaled value in storage order (x fastest, z slowest).
    pub fn for_each_value(&self, mut visit: impl FnMut(f64)) {
        with_array!(&self.voxels, a => a.iter().for_each(|&v| visit(self.slope * v as f64 + self.intercept)));
    }

    /// Calls `visit` with each piece of the scaled values in storage order: the flat index of its first voxel, and some
    /// values that follow each other.
    pub fn for_each_piece(&self, mut visit: impl FnMut(usize, &[f64])) {
        /// Values of a piece.
        const N_AT_A_TIME: usize = 8192;
        let mut piece = Vec::with_capacity(N_AT_A_TIME.min(self.grid.n_voxels()));
        let mut start = 0;
        self.for_each_value(|value| {
            piece.push(value);
            if piece.len() == N_AT_A_TIME {
                visit(start, &piece);
                start += piece.len();
                piece.clear();
            }
        });
        if !piece.is_empty() {
            visit(start, &piece);
        }
    }

    /// The scaled values as a flat vector in storage order (x fastest), mapped by `map`.
    #[must_use]
    pub fn map_values<T>(&self, mut map: impl FnMut(f64) -> T) -> Vec<T> {
        let mut out = Vec::with_capacity(self.grid.n_voxels());
        self.for_each_value(|value| out.push(map(value)));
        out
    }
}
