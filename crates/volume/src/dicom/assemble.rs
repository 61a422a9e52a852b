//! The slices of a stack as one volume.
//!
//! **Input** a [`Stack`]. **Output** [`Assembled`], on the slices' own even grid or resampled to one.
//! **Steps** 1. the type that holds every slice's numbers; where slices are scaled differently, the scaled values in
//! single precision; 2. the memory, against the limit; 3. all slices decoded, side by side; 4. padding, which means
//! "not measured", set to the smallest value that was; 5. resampled where the stack is irregular and the caller
//! wants it.
//! **Guarantees** the same numbers at any thread count; of several faulty slices the lowest is named.

use espalier_model::{RAS_FROM_LPS, Report, Voxels};
use glam::DAffine3;
use ndarray::Array3;
use rayon::prelude::*;

use super::error::DicomError;
use super::header::Slice;
use super::pixels;
use super::resample::{self, Plan};
use super::series::{Image, own_name};
use super::stack::Stack;
use crate::interpolate::Number;
use crate::{ReadError, ReadOptions};

/// What decoding one pixel takes beside the volume, at most: a decoder of JPEG 2000 keeps coefficients, blocks, and
/// samples in single precision.
const DECODER_BYTES_PER_PIXEL: u64 = 64;

/// The modalities whose slices hold what was measured; segmentations, and what programs derive, come as SEG, OT or none.
const SCANNERS: [&str; 10] = ["CT", "MR", "PT", "NM", "US", "XA", "RF", "CR", "DX", "MG"];

/// A volume.
pub(crate) struct Assembled {
    pub(crate) shape: [usize; 3],
    /// Maps voxel coordinates to RAS+ mm.
    pub(crate) world_from_voxel: DAffine3,
    pub(crate) voxels: Voxels,
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
}

/// A type of stored numbers.
pub(super) trait Stored: Number {
    fn of_stored(value: i32, slice: &Slice) -> Self;
}

macro_rules! stored_integer {
    ($type:ty) => {
        impl Stored for $type {
            fn of_stored(value: i32, _: &Slice) -> Self {
                value as Self
            }
        }
    };
}
stored_integer!(u8);
stored_integer!(i16);
stored_integer!(u16);

impl Stored for f32 {
    fn of_stored(value: i32, slice: &Slice) -> Self {
        (slice.slope * f64::from(value) + slice.intercept) as Self
    }
}

/// Decodes a stack.
pub(super) fn assemble(
    (stack, modality): (&Stack, &str),
    options: &ReadOptions,
    report: &mut Report,
) -> Result<Assembled, ReadError> {
    let first = &stack.images[0].slice;
    let slices = || stack.images.iter().map(|image| &image.slice);
    let is_uniform = slices().all(|slice| slice.slope == first.slope && slice.intercept == first.intercept);
    let fits = |low: i32, high: i32| {
        slices().all(|slice| {
            let bits = slice.stored.bits_stored;
            let range = if slice.stored.is_signed {
                (-(1 << (bits - 1)), (1 << (bits - 1)) - 1)
            } else {
                (0, (1 << bits) - 1)
            };
            low <= range.0 && range.1 <= high
        })
    };
    let (slope, intercept) = if is_uniform { (first.slope, first.intercept) } else { (1.0, 0.0) };
    let job = Job { stack, options, scaling: (slope, intercept), is_scan: SCANNERS.contains(&modality) };
    let (shape, lps_from_voxel, voxels) = if !is_uniform {
        report.count_usize("dicom_scalings", count_scalings(stack));
        let (shape, affine, array) = job.run(report)?;
        (shape, affine, Voxels::F32(array))
    } else if fits(0, 255) {
        let (shape, affine, array) = job.run(report)?;
        (shape, affine, Voxels::U8(array))
    } else if fits(i32::from(i16::MIN), i32::from(i16::MAX)) {
        let (shape, affine, array) = job.run(report)?;
        (shape, affine, Voxels::I16(array))
    } else if fits(0, i32::from(u16::MAX)) {
        let (shape, affine, array) = job.run(report)?;
        (shape, affine, Voxels::U16(array))
    } else {
        // Signed and unsigned slices in one series: scaled at once.
        let (shape, affine, array) = job.run(report)?;
        let voxels = Voxels::F32(array);
        let world_from_voxel = ras_from_lps() * affine;
        return Ok(Assembled { shape, world_from_voxel, voxels, slope: 1.0, intercept: 0.0 });
    };
    let world_from_voxel = ras_from_lps() * lps_from_voxel;
    Ok(Assembled { shape, world_from_voxel, voxels, slope, intercept })
}

fn ras_from_lps() -> DAffine3 {
    DAffine3::from_scale(RAS_FROM_LPS)
}

fn count_scalings(stack: &Stack) -> usize {
    let scaling = |image: &Image| [image.slice.slope, image.slice.intercept].map(f64::to_bits);
    let mut scalings: Vec<_> = stack.images.iter().map(scaling).collect();
    scalings.sort_unstable();
    scalings.dedup();
    scalings.len()
}

/// A stack to be decoded as one type.
struct Job<'a> {
    stack: &'a Stack,
    options: &'a ReadOptions,
    /// Slope and intercept of the numbers in the volume.
    scaling: (f64, f64),
    /// Whether a scanner has measured them.
    is_scan: bool,
}

impl Job<'_> {
    /// Shape, the affine to LPS+ mm, and the voxels.
    fn run<T: Stored>(&self, report: &mut Report) -> Result<([usize; 3], DAffine3, Array3<T>), ReadError> {
        let [nx, ny] = self.stack.images[0].slice.stored.size;
        let shape = [nx, ny, self.stack.images.len()];
        let plan = (!self.stack.irregularity.is_none()).then(|| Plan::of(self.stack));
        let n_bytes = |shape: [usize; 3]| {
            shape.iter().fold(size_of::<T>() as u64, |product, &extent| product.saturating_mul(extent as u64))
        };
        let n_new = plan.as_ref().map_or(0, |plan| n_bytes(plan.shape));
        let n_scratch = (nx as u64 * ny as u64).saturating_mul(DECODER_BYTES_PER_PIXEL);
        let needed = n_bytes(shape).saturating_add(n_new).saturating_add(n_scratch);
        let limit = self.options.max_bytes;
        if needed > limit {
            return Err(ReadError::TooLarge { needed, limit });
        }
        let n_at_once = ((limit - needed) / n_scratch + 1).min(shape[2] as u64) as usize;
        let mut voxels = allocate::<T>(shape)?;
        self.decode_into(&mut voxels, n_at_once)?;
        self.replace_padding(&mut voxels, report);
        let Some(plan) = plan else {
            let array = as_array(voxels, shape)?;
            return Ok((shape, self.even_affine(), array));
        };
        let mut new = allocate::<T>(plan.shape)?;
        let irregularity = &self.stack.irregularity;
        resample::resample((&voxels, self.scaling, self.is_scan), (&plan, irregularity), &mut new, report);
        let shape = plan.shape;
        Ok((shape, plan.lps_from_voxel, as_array(new, shape)?))
    }

    /// Decodes all slices, so many at a time that decoders keep to the limit.
    fn decode_into<T: Stored>(&self, voxels: &mut [T], n_at_once: usize) -> Result<(), DicomError> {
        let n_plane = self.stack.images[0].slice.stored.n_pixels();
        let together = n_at_once.max(1);
        for (images, planes) in self.stack.images.chunks(together).zip(voxels.chunks_mut(together * n_plane))
        {
            let decode = |(image, plane): (&Image, &mut [T])| {
                let Image { path, slice } = image;
                let values = pixels::decode(path, &slice.stored, self.options.max_bytes)
                    .map_err(|what| DicomError::Pixels { what, file: own_name(path) })?;
                for (voxel, value) in plane.iter_mut().zip(values) {
                    *voxel = T::of_stored(value, slice);
                }
                Ok(())
            };
            // Collected before the first error is taken, so that it is the lowest slice's at any thread count.
            let done: Vec<Result<(), DicomError>> =
                images.par_iter().zip(planes.par_chunks_mut(n_plane)).map(decode).collect();
            done.into_iter().collect::<Result<(), DicomError>>()?;
        }
        Ok(())
    }

    /// Sets padding to the smallest value that is none.
    fn replace_padding<T: Stored>(&self, voxels: &mut [T], report: &mut Report) {
        let n_plane = self.stack.images[0].slice.stored.n_pixels();
        let band = |slice: &Slice| {
            let (low, high) = slice.padding?;
            let ends = [low, high].map(|value| T::of_stored(value, slice));
            Some(if ends[0] <= ends[1] { ends } else { [ends[1], ends[0]] })
        };
        let bands: Vec<Option<[T; 2]>> = self.stack.images.iter().map(|image| band(&image.slice)).collect();
        if bands.iter().all(Option::is_none) {
            return;
        }
        let is_padding =
            |value: T, band: Option<[T; 2]>| band.is_some_and(|[low, high]| low <= value && value <= high);
        let mut smallest: Option<T> = None;
        let mut n_padding = 0;
        for (plane, &band) in voxels.chunks(n_plane).zip(&bands) {
            for &value in plane {
                if is_padding(value, band) {
                    n_padding += 1;
                } else if smallest.is_none_or(|known| value < known) {
                    smallest = Some(value);
                }
            }
        }
        report.count_usize("dicom_padding_voxels", n_padding);
        if let Some(smallest) = smallest.filter(|_| n_padding > 0) {
            for (plane, &band) in voxels.chunks_mut(n_plane).zip(&bands) {
                plane
                    .iter_mut()
                    .filter(|value| is_padding(**value, band))
                    .for_each(|value| *value = smallest);
            }
        }
    }

    /// The affine of an even stack.
    fn even_affine(&self) -> DAffine3 {
        let images = &self.stack.images;
        let (first, last) = (&images[0].slice, &images[images.len() - 1].slice);
        let step = (last.position - first.position) / (images.len() - 1) as f64;
        let [x, y] = [0, 1].map(|axis| first.axes[axis] * first.spacing[axis]);
        DAffine3::from_cols(x, y, step, first.position)
    }
}

fn allocate<T: Stored>(shape: [usize; 3]) -> Result<Vec<T>, ReadError> {
    let n_voxels = shape.iter().product::<usize>();
    let mut values = Vec::new();
    let needed = (n_voxels * size_of::<T>()) as u64;
    values.try_reserve_exact(n_voxels).map_err(|_| ReadError::NoMemory { needed })?;
    values.resize(n_voxels, T::default());
    Ok(values)
}

fn as_array<T>(values: Vec<T>, [nx, ny, nz]: [usize; 3]) -> Result<Array3<T>, ReadError> {
    let needed = (values.len() * size_of::<T>()) as u64;
    Array3::from_shape_vec((nz, ny, nx), values).map_err(|_| ReadError::NoMemory { needed })
}
