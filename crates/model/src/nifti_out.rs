//! NIfTI-1 out: `.nii.gz` bytes of masks, skeletons, scalar fields and volumes.
//!
//! **Input** a grid and its voxels, x fastest. **Output** the bytes of a `.nii.gz` file.
//! **Steps** 1. round the grid to the single precision that the format has; 2. fill the 348 bytes of the header,
//! no extension, voxels from byte 352; 3. compress header and voxels.
//! **Guarantees** the same input gives the same bytes on every machine: little-endian, gzip without time, name
//! or system, one fixed level. sform and qform are both set and say RAS+ mm; `descrip` names format and version.
//! **Source** the NIfTI-1 header `nifti1.h`: field offsets, and its section on quaternions for the qform.
//! **Cost** O(voxels) time; memory one plane of the volume and the compressed bytes.

use std::io::Write as _;

use flate2::write::GzEncoder;
use flate2::{Compression, GzBuilder};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use thiserror::Error;

use crate::diagnose::{Class, Diagnose};
use crate::{Grid, GridError, Mask, Skeleton, Volume, Voxels};

const HEADER_BYTES: usize = 352;
const F32_BYTES: usize = size_of::<f32>();
/// Extents are 16-bit signed integers.
const MAX_EXTENT: usize = i16::MAX as usize;
/// zlib's own default; the levels above cost time and win little on masks.
const LEVEL: u32 = 6;
/// `NIFTI_XFORM_SCANNER_ANAT`.
const XFORM_SCANNER: i16 = 1;
/// `NIFTI_UNITS_MM`.
const UNITS_MM: u8 = 2;

/// Why a volume cannot be written as NIfTI-1.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NiftiOutError {
    /// An extent that the header cannot hold.
    #[error("NIfTI-1 holds at most 32767 voxels along an axis, not {}x{}x{}", .shape[0], .shape[1], .shape[2])]
    Extent {
        /// Voxels along x, y, z.
        shape: [usize; 3],
    },
    /// The values are not as many as the grid's voxels.
    #[error("{n_values} values for a grid of {n_voxels} voxels")]
    Length {
        /// How many values there are.
        n_values: usize,
        /// How many voxels the grid has.
        n_voxels: usize,
    },
    /// The grid does not survive the rounding to single precision.
    #[error("in the single precision of NIfTI-1: {0}")]
    Grid(#[from] GridError),
    /// The compressor failed.
    #[error("compression failed: {0}")]
    Compress(#[from] std::io::Error),
}

impl Diagnose for NiftiOutError {
    fn code(&self) -> &'static str {
        match self {
            Self::Extent { .. } => "E-NIFTI-OUT-EXTENT",
            Self::Length { .. } => "E-NIFTI-OUT-LENGTH",
            Self::Grid(_) => "E-NIFTI-OUT-GRID",
            Self::Compress(_) => "E-NIFTI-OUT-COMPRESS",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Extent { .. } => Class::Limit,
            Self::Grid(_) => Class::Input,
            Self::Length { .. } | Self::Compress(_) => Class::Internal,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Extent { .. } => "crop the volume, or resample it to larger voxels".to_owned(),
            Self::Grid(_) => "move the volume nearer to the origin".to_owned(),
            Self::Length { .. } | Self::Compress(_) => String::new(),
        }
    }
}

/// The grid as a reader of the written file gets it: the affine rounded to single precision.
///
/// Work on this grid where a result must not depend on whether a volume came from memory or from its file.
///
/// # Errors
/// [`GridError`] if the rounded affine is no grid any more.
pub fn stored_grid(grid: &Grid) -> Result<Grid, GridError> {
    let round = |v: DVec3| v.as_vec3().as_dvec3();
    let affine = grid.world_from_voxel();
    let [x, y, z] = [affine.matrix3.x_axis, affine.matrix3.y_axis, affine.matrix3.z_axis].map(round);
    Grid::new(grid.shape(), DAffine3::from_cols(x, y, z, round(affine.translation)))
}

/// A mask as 8-bit voxels, 0 and 1.
///
/// # Errors
/// [`NiftiOutError`] if the grid does not fit the format.
pub fn mask(mask: &Mask) -> Result<Vec<u8>, NiftiOutError> {
    let mut file = File::new(mask.grid(), Scalar::U8, (1.0, 0.0), "espalier mask 1")?;
    let [nx, ny, nz] = mask.grid().shape();
    let mut plane = vec![0_u8; nx * ny];
    for z in 0..nz {
        plane.fill(0);
        for y in 0..ny {
            mask.bits().runs(z * ny + y).for_each(|run| plane[y * nx..][run].fill(1));
        }
        file.gz.write_all(&plane)?;
    }
    file.finish()
}

/// A skeleton as 8-bit voxels, 0 and 1.
///
/// # Errors
/// [`NiftiOutError`] if the grid does not fit the format.
pub fn skeleton(skeleton: &Skeleton) -> Result<Vec<u8>, NiftiOutError> {
    let [nx, ny, nz] = skeleton.grid().shape();
    let mut file = File::new(skeleton.grid(), Scalar::U8, (1.0, 0.0), "espalier skeleton 1")?;
    let mut plane = vec![0_u8; nx * ny];
    // The voxels are sorted by z, so each plane is a run of them.
    let mut rest = skeleton.voxels();
    for z in 0..nz {
        let (here, above) = rest.split_at(rest.partition_point(|voxel| voxel[2] as usize <= z));
        here.iter().for_each(|&[x, y, _]| plane[y as usize * nx + x as usize] = 1);
        file.gz.write_all(&plane)?;
        here.iter().for_each(|&[x, y, _]| plane[y as usize * nx + x as usize] = 0);
        rest = above;
    }
    file.finish()
}

/// A number for each foreground voxel of a mask, in storage order, as the narrowest of 8, 16 and 32 unsigned bits that
/// holds them all; background is 0.
///
/// # Errors
/// [`NiftiOutError`] if the grid does not fit the format or the numbers do not fit the mask.
pub fn labels(mask: &Mask, values: &[u32]) -> Result<Vec<u8>, NiftiOutError> {
    match values.iter().max().copied().unwrap_or(0) {
        0..=0xFF => labels_as(mask, values, Scalar::U8, |value| [value as u8]),
        0x100..=0xFFFF => labels_as(mask, values, Scalar::U16, |value| (value as u16).to_le_bytes()),
        _ => labels_as(mask, values, Scalar::U32, u32::to_le_bytes),
    }
}

fn labels_as<const N: usize>(
    mask: &Mask,
    values: &[u32],
    scalar: Scalar,
    bytes_of: impl Fn(u32) -> [u8; N],
) -> Result<Vec<u8>, NiftiOutError> {
    let n_foreground = mask.n_foreground();
    if values.len() != n_foreground {
        return Err(NiftiOutError::Length { n_values: values.len(), n_voxels: n_foreground });
    }
    let mut file = File::new(mask.grid(), scalar, (1.0, 0.0), "espalier labels 1")?;
    let [nx, ny, nz] = mask.grid().shape();
    let mut plane = vec![0_u8; nx * ny * N];
    let mut rest = values;
    for z in 0..nz {
        plane.fill(0);
        for y in 0..ny {
            for run in mask.bits().runs(z * ny + y) {
                let (own, later) = rest.split_at(run.len());
                rest = later;
                let bytes = &mut plane[(y * nx + run.start) * N..(y * nx + run.end) * N];
                bytes
                    .chunks_exact_mut(N)
                    .zip(own)
                    .for_each(|(cell, &value)| cell.copy_from_slice(&bytes_of(value)));
            }
        }
        file.gz.write_all(&plane)?;
    }
    file.finish()
}

/// A single-precision value for each voxel of a skeleton, such as radii in mm; 0 elsewhere.
///
/// # Errors
/// [`NiftiOutError`] if the grid does not fit the format or the values do not fit the skeleton.
pub fn skeleton_scalars(skeleton: &Skeleton, values: &[f32]) -> Result<Vec<u8>, NiftiOutError> {
    let n_voxels = skeleton.voxels().len();
    if values.len() != n_voxels {
        return Err(NiftiOutError::Length { n_values: values.len(), n_voxels });
    }
    let [nx, ny, nz] = skeleton.grid().shape();
    let mut file = File::new(skeleton.grid(), Scalar::F32, (1.0, 0.0), "espalier scalars 1")?;
    let mut plane = vec![0_u8; nx * ny * F32_BYTES];
    let mut rest = skeleton.voxels().iter().zip(values).peekable();
    for z in 0..nz {
        plane.fill(0);
        // The voxels are sorted by z.
        while let Some((&[x, y, _], value)) = rest.next_if(|(voxel, _)| voxel[2] as usize == z) {
            let place = (y as usize * nx + x as usize) * F32_BYTES;
            plane[place..place + F32_BYTES].copy_from_slice(&value.to_le_bytes());
        }
        file.gz.write_all(&plane)?;
    }
    file.finish()
}

/// A single-precision value for each foreground voxel of a mask, such as its distance in mm; 0 elsewhere.
///
/// # Errors
/// [`NiftiOutError`] if the grid does not fit the format.
pub fn mask_scalars(mask: &Mask, value_at: impl Fn([usize; 3]) -> f32) -> Result<Vec<u8>, NiftiOutError> {
    let mut file = File::new(mask.grid(), Scalar::F32, (1.0, 0.0), "espalier scalars 1")?;
    let [nx, ny, nz] = mask.grid().shape();
    let mut plane = vec![0_u8; nx * ny * F32_BYTES];
    for z in 0..nz {
        plane.fill(0);
        for (y, x) in (0..ny).flat_map(|y| mask.bits().runs(z * ny + y).flatten().map(move |x| (y, x))) {
            let place = (y * nx + x) * F32_BYTES;
            plane[place..place + F32_BYTES].copy_from_slice(&value_at([x, y, z]).to_le_bytes());
        }
        file.gz.write_all(&plane)?;
    }
    file.finish()
}

/// A volume with its stored numbers and its scaling (rounded to single precision, as the format has it).
///
/// # Errors
/// [`NiftiOutError`] if the grid does not fit the format.
pub fn volume(volume: &Volume) -> Result<Vec<u8>, NiftiOutError> {
    let start = |scalar| File::new(volume.grid(), scalar, volume.scaling(), "espalier volume 1");
    macro_rules! write_as {
        ($scalar:expr, $array:expr) => {{
            let mut file = start($scalar)?;
            file.planes($array.as_slice().unwrap_or_default(), |value| value.to_le_bytes())?;
            file.finish()
        }};
    }
    match volume.voxels() {
        Voxels::U8(array) => write_as!(Scalar::U8, array),
        Voxels::I16(array) => write_as!(Scalar::I16, array),
        Voxels::U16(array) => write_as!(Scalar::U16, array),
        Voxels::I32(array) => write_as!(Scalar::I32, array),
        Voxels::U32(array) => write_as!(Scalar::U32, array),
        Voxels::F32(array) => write_as!(Scalar::F32, array),
        Voxels::F64(array) => write_as!(Scalar::F64, array),
    }
}

/// The scalar types that are written, as (NIfTI datatype, bits).
#[derive(Clone, Copy)]
enum Scalar {
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn code_and_bits(self) -> (i16, i16) {
        match self {
            Self::U8 => (2, 8),
            Self::I16 => (4, 16),
            Self::U16 => (512, 16),
            Self::I32 => (8, 32),
            Self::U32 => (768, 32),
            Self::F32 => (16, 32),
            Self::F64 => (64, 64),
        }
    }
}

/// A `.nii.gz` file under construction: the header is in, the voxels follow.
struct File {
    gz: GzEncoder<Vec<u8>>,
    shape: [usize; 3],
}

impl File {
    fn new(
        grid: &Grid,
        scalar: Scalar,
        scaling: (f64, f64),
        description: &str,
    ) -> Result<Self, NiftiOutError> {
        let header = header(grid, scalar, scaling, description)?;
        let unknown_system = 255;
        let mut gz = GzBuilder::new()
            .mtime(0)
            .operating_system(unknown_system)
            .write(Vec::new(), Compression::new(LEVEL));
        gz.write_all(&header)?;
        Ok(Self { gz, shape: grid.shape() })
    }

    /// Appends all voxels, converting one plane at a time.
    fn planes<T, const N: usize>(
        &mut self,
        values: &[T],
        bytes_of: impl Fn(&T) -> [u8; N],
    ) -> Result<(), NiftiOutError> {
        let [nx, ny, nz] = self.shape;
        if values.len() != nx * ny * nz {
            return Err(NiftiOutError::Length { n_values: values.len(), n_voxels: nx * ny * nz });
        }
        let mut bytes = Vec::with_capacity(nx * ny * N);
        for plane in values.chunks(nx * ny) {
            bytes.clear();
            plane.iter().for_each(|value| bytes.extend_from_slice(&bytes_of(value)));
            self.gz.write_all(&bytes)?;
        }
        Ok(())
    }

    fn finish(self) -> Result<Vec<u8>, NiftiOutError> {
        Ok(self.gz.finish()?)
    }
}

/// The header and the four bytes that say "no extension".
fn header(
    grid: &Grid,
    scalar: Scalar,
    (slope, intercept): (f64, f64),
    description: &str,
) -> Result<[u8; HEADER_BYTES], NiftiOutError> {
    let shape = grid.shape();
    if shape.iter().any(|&extent| extent > MAX_EXTENT) {
        return Err(NiftiOutError::Extent { shape });
    }
    let grid = stored_grid(grid)?;
    let mut header = [0_u8; HEADER_BYTES];
    let mut put = |offset: usize, bytes: &[u8]| header[offset..offset + bytes.len()].copy_from_slice(bytes);

    put(0, &348_i32.to_le_bytes()); // sizeof_hdr
    put(38, b"r"); // regular
    let dim = [3, shape[0] as i16, shape[1] as i16, shape[2] as i16, 1, 1, 1, 1];
    dim.iter().enumerate().for_each(|(i, extent)| put(40 + 2 * i, &extent.to_le_bytes()));
    let (datatype, bitpix) = scalar.code_and_bits();
    put(70, &datatype.to_le_bytes());
    put(72, &bitpix.to_le_bytes());
    let (qfac, [b, c, d]) = quaternion(&grid);
    let spacing = grid.spacing_mm();
    let pixdim = [qfac, spacing.x, spacing.y, spacing.z, 1.0, 1.0, 1.0, 1.0];
    pixdim.iter().enumerate().for_each(|(i, &value)| put(76 + 4 * i, &(value as f32).to_le_bytes()));
    put(108, &(HEADER_BYTES as f32).to_le_bytes()); // vox_offset
    put(112, &(slope as f32).to_le_bytes());
    put(116, &(intercept as f32).to_le_bytes());
    put(123, &[UNITS_MM]);
    put(148, &description.as_bytes()[..description.len().min(79)]);

    put(252, &XFORM_SCANNER.to_le_bytes()); // qform_code
    put(254, &XFORM_SCANNER.to_le_bytes()); // sform_code
    let affine = grid.world_from_voxel();
    let origin = affine.translation;
    let qform = [b, c, d, origin.x, origin.y, origin.z];
    qform.iter().enumerate().for_each(|(i, &value)| put(256 + 4 * i, &(value as f32).to_le_bytes()));
    for row in 0..3 {
        let [x, y, z] = affine.matrix3.row(row).to_array();
        let srow = [x, y, z, origin[row]];
        let offset = 280 + 16 * row;
        srow.iter().enumerate().for_each(|(i, &value)| put(offset + 4 * i, &(value as f32).to_le_bytes()));
    }
    put(344, b"n+1\0"); // magic: header and voxels in one file
    Ok(header)
}

/// `qfac` (−1 for a left-handed grid) and the quaternion parts b, c, d of the grid's rotation.
fn quaternion(grid: &Grid) -> (f64, [f64; 3]) {
    let axes = grid.world_from_voxel().matrix3;
    let qfac = if axes.determinant() < 0.0 { -1.0 } else { 1.0 };
    // A quaternion is a rotation, so the last bit of shear that a grid may have has to go.
    let x = axes.x_axis.normalize();
    let y = (axes.y_axis - x * axes.y_axis.dot(x)).normalize();
    let q = DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)));
    // Only b, c, d are stored, so the real part must be the positive root.
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    (qfac, [q.x, q.y, q.z].map(|part| sign * part + 0.0))
}
