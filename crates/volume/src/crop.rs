//! File → the part of a volume that lies in a box of the world.
//!
//! **Input** a path, as [`read`] takes it, and a box in RAS+ mm. **Output** [`Cropped`]: its voxels in single precision,
//! and what kind of volume the whole is.
//! **Steps** 1. the box in voxels, and so many more on each side as are wanted, at least one for what interpolates between them; 2. the voxels straight from
//! the file, of which only those are kept; 3. DICOM slices, and volumes whose axes must be made orthogonal, are read
//! whole first.
//! **Guarantees** straight from the file, memory is the box, else the volume and the box; checked before either is
//! allocated.
//! **Cost** one pass over the file.

use std::path::Path;

use espalier_model::{Grid, Report, Volume, Voxels};
use glam::{DAffine3, DVec3};
use ndarray::Array3;

use crate::decode::number;
use crate::dicom;
use crate::kind::Census;
use crate::read::{check_limit, count_grid, orthogonal_grid};
use crate::scalar::Scalar;
use crate::stored::Stored;
use crate::{Error, Kind, ReadError, ReadOptions, read};

/// A part of a volume.
#[derive(Clone, Debug)]
pub struct Cropped {
    /// Its voxels, scaled; none where the box lies outside of the volume.
    pub volume: Option<Volume>,
    /// What the part is, by its values.
    pub kind: Kind,
    /// The shape and the spacing of the whole, and warnings.
    pub report: Report,
}

/// Reads what lies between two corners of the world, and `n_around` of the file's voxels on each side, at least one.
///
/// # Errors
/// As [`read`].
pub fn read_box(
    path: &Path,
    options: &ReadOptions,
    (corners_mm, n_around): ([DVec3; 2], u32),
) -> Result<Cropped, Error> {
    let named = |problem| Error::Read { problem, path: path.to_owned() };
    if !dicom::is_dicom(path).map_err(named)? {
        let mut report = Report::default();
        let mut stored = Stored::open(path, options, &mut report).map_err(named)?;
        if let Some(grid) = orthogonal_grid(&stored, options).map_err(named)? {
            count_grid(&grid, &mut report);
            let part = Part::of(&grid, (corners_mm, n_around));
            let kept = match &part {
                Some(part) => part.read(&mut stored, (options, &mut report)).map_err(named)?,
                None => Vec::new(),
            };
            return Ok(Cropped::of(part, &grid, (kept, report)));
        }
    }
    let whole = read(path, options)?;
    let grid = whole.volume.grid();
    let part = Part::of(grid, (corners_mm, n_around));
    let mut kept = match &part {
        Some(part) => part.room(whole.volume.n_bytes(), options).map_err(named)?,
        None => Vec::new(),
    };
    let mut index = 0;
    whole.volume.for_each_value(|value| {
        if part.as_ref().is_some_and(|part| part.holds(grid.voxel(index))) {
            kept.push(value as f32);
        }
        index += 1;
    });
    Ok(Cropped::of(part, grid, (kept, whole.report)))
}

impl Cropped {
    fn of(part: Option<Part>, whole: &Grid, (kept, report): (Vec<f32>, Report)) -> Self {
        let mut census = Census::default();
        kept.iter().for_each(|&value| census.see(f64::from(value)));
        Self { volume: part.and_then(|part| part.volume(whole, kept)), kind: census.kind(), report }
    }
}

/// Calls `visit` with (y, z) and the bytes of each row.
fn for_each_row(stored: &mut Stored, mut visit: impl FnMut([usize; 2], &[u8])) -> Result<(), ReadError> {
    let [nx, ny, nz] = stored.shape;
    let row_bytes = nx.saturating_mul(stored.scalar.file_bytes() as usize);
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(row_bytes).map_err(|_| ReadError::NoMemory { needed: row_bytes as u64 })?;
    bytes.resize(row_bytes, 0);
    for z in 0..nz {
        for y in 0..ny {
            stored.stream.take(&mut bytes)?;
            visit([y, z], &bytes);
        }
    }
    Ok(())
}

/// A range of voxels: the first along each axis, and how many.
struct Part {
    first: [usize; 3],
    shape: [usize; 3],
}

impl Part {
    /// The voxels around a box; none where it lies outside.
    fn of(grid: &Grid, ([a, b], n_around): ([DVec3; 2], u32)) -> Option<Self> {
        let voxel_from_world = grid.voxel_from_world();
        let corner = |i: usize| {
            let side = |axis: usize| if i >> axis & 1 == 0 { a[axis] } else { b[axis] };
            voxel_from_world.transform_point3(DVec3::new(side(0), side(1), side(2)))
        };
        let (low, high) = (0..8)
            .map(corner)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
        let around = f64::from(n_around.max(1));
        let (low, high) = (low.floor() - around, high.ceil() + around);
        let (mut first, mut shape) = ([0; 3], [0; 3]);
        for axis in 0..3 {
            let last = grid.shape()[axis] - 1;
            if high[axis].is_nan() || high[axis] < 0.0 || low[axis] > last as f64 {
                return None;
            }
            // Casts saturate at 0.
            first[axis] = low[axis] as usize;
            shape[axis] = (high[axis] as usize).min(last) - first[axis] + 1;
        }
        Some(Self { first, shape })
    }

    fn n_voxels(&self) -> usize {
        self.shape.iter().product()
    }

    /// Room for its values, beside what is held already.
    fn room(&self, n_held: u64, options: &ReadOptions) -> Result<Vec<f32>, ReadError> {
        let needed = (self.n_voxels() as u64).saturating_mul(size_of::<f32>() as u64);
        check_limit(needed.saturating_add(n_held), options)?;
        let mut kept = Vec::new();
        kept.try_reserve_exact(self.n_voxels()).map_err(|_| ReadError::NoMemory { needed })?;
        Ok(kept)
    }

    /// Its values, from a stream that stands at the first voxel of the whole.
    fn read(
        &self,
        stored: &mut Stored,
        (options, report): (&ReadOptions, &mut Report),
    ) -> Result<Vec<f32>, ReadError> {
        let mut kept = self.room(0, options)?;
        let (slope, intercept) = (stored.slope, stored.intercept);
        macro_rules! rows {
            ($file_type:ty) => {{
                let decode = number!(stored, $file_type);
                for_each_row(stored, |[y, z], bytes| {
                    if !self.holds([self.first[0], y, z]) {
                        return;
                    }
                    let numbers = bytes.as_chunks::<{ size_of::<$file_type>() }>().0;
                    let row = &numbers[self.first[0]..self.first[0] + self.shape[0]];
                    kept.extend(row.iter().map(|&number| (slope * decode(number) as f64 + intercept) as f32));
                })?;
            }};
        }
        #[allow(clippy::unnecessary_cast, reason = "one arm is f64 already")]
        match stored.scalar {
            Scalar::U8 => rows!(u8),
            Scalar::I8 => rows!(i8),
            Scalar::I16 => rows!(i16),
            Scalar::U16 => rows!(u16),
            Scalar::I32 => rows!(i32),
            Scalar::U32 => rows!(u32),
            Scalar::F32 => rows!(f32),
            Scalar::F64 => rows!(f64),
            Scalar::I64 => rows!(i64),
            Scalar::U64 => rows!(u64),
        }
        stored.stream.finish(report)?;
        Ok(kept)
    }

    fn holds(&self, voxel: [usize; 3]) -> bool {
        (0..3).all(|axis| (self.first[axis]..self.first[axis] + self.shape[axis]).contains(&voxel[axis]))
    }

    fn volume(&self, whole: &Grid, values: Vec<f32>) -> Option<Volume> {
        let first = DVec3::from_array(self.first.map(|index| index as f64));
        let affine = whole.world_from_voxel();
        let moved = DAffine3 { translation: affine.transform_point3(first), ..affine };
        let grid = Grid::new(self.shape, moved).ok()?;
        let [nx, ny, nz] = self.shape;
        let array = Array3::from_shape_vec((nz, ny, nx), values).ok()?;
        Some(Volume::new(grid, Voxels::F32(array), 1.0, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_holds_what_the_whole_has_there() {
        let grid = Grid::axis_aligned([12, 10, 9], DVec3::new(-1.0, 2.0, 1.5), DVec3::new(5.0, -3.0, 2.0))
            .expect("grid");
        let value = |voxel: [usize; 3]| (voxel[0] + 20 * voxel[1] + 400 * voxel[2]) as f32 + 0.5;
        let values: Vec<f32> = (0..grid.n_voxels()).map(|index| value(grid.voxel(index))).collect();
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("scan.nii.gz");
        let array = Array3::from_shape_vec((9, 10, 12), values).expect("an array");
        let whole = Volume::new(grid.clone(), Voxels::F32(array), 1.0, 0.0);
        std::fs::write(&path, espalier_model::nifti_out::volume(&whole).expect("bytes")).expect("write");
        let corners = [DVec3::new(-1.2, 2.0, 5.1), DVec3::new(1.9, 6.5, 7.9)];
        let cropped = read_box(&path, &ReadOptions::default(), (corners, 1)).expect("a part");
        assert!(matches!(cropped.kind, Kind::Ct { .. }));
        let part = cropped.volume.expect("voxels");
        // x runs to the left: 1.9 and -1.2 are 3.1 and 6.2; y is 2.5 to 4.75, z 2.07 to 3.93; one more on each side.
        assert_eq!(part.grid().shape(), [7, 6, 5]);
        for index in 0..part.grid().n_voxels() {
            let at = part
                .grid()
                .world_from_voxel()
                .transform_point3(DVec3::from_array(part.grid().voxel(index).map(|i| i as f64)));
            let voxel = grid.voxel_at(grid.voxel_from_world().transform_point3(at)).expect("inside");
            assert_eq!(part.value(index), f64::from(value(voxel)), "{at}");
        }
        let beyond = [DVec3::splat(100.0), DVec3::splat(120.0)];
        assert!(read_box(&path, &ReadOptions::default(), (beyond, 1)).expect("none").volume.is_none());
        let tight = ReadOptions { max_bytes: 100, ..ReadOptions::default() };
        assert!(matches!(
            read_box(&path, &tight, (corners, 1)),
            Err(Error::Read { problem: ReadError::TooLarge { .. }, .. })
        ));
    }
}
