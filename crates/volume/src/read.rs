//! File → [`Volume`].
//!
//! **Input** a path to a NIfTI-1 file, `.nii` or `.nii.gz`. **Output** [`Loaded`].
//! **Steps** 1. open, and decompress by content; 2. check the header; 3. compare the declared size with what the
//! file can hold and what the caller allows; 4. place the voxels in the world; 5. read them, and read on to the
//! end so that the checksum is verified; 6. resample where the axes are sheared.
//! **Guarantees** sizes are checked before anything is allocated; memory is the voxels and two small buffers
//! (twice the voxels where they are resampled); no byte makes it panic. The affine is rounded to single
//! precision, so that a file that we write of this grid places its voxels exactly where this volume has them.
//! **Cost** O(bytes) time.

use std::path::Path;

use espalier_model::nifti_out::stored_grid;
use espalier_model::{Grid, GridError, Report, Volume, Voxels};

use crate::nifti::{self, Header, N_HEADER_BYTES};
use crate::source::Source;
use crate::{Error, ReadError, ReadOptions, orthogonal};

/// Some programs pad their files; nothing that is meant has as many bytes after the voxels.
const MAX_TRAILING_BYTES: u64 = 1 << 20;

/// A volume as it stands in a file, and what was seen on the way.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The volume.
    pub volume: Volume,
    /// Counts `shape_x/y/z`, `spacing_x/y/z_mm`, `voxels`, and warnings.
    pub report: Report,
}

/// Reads the volume in a NIfTI-1 file.
///
/// # Errors
/// [`Error::Read`] with the path: missing or unreadable files, malformed, truncated or damaged ones, more voxels
/// than `options.max_bytes` holds, 4D files without `options.volume_index`, colours and complex numbers, and
/// files that do not say where they lie without `options.assume_space`.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded, Error> {
    read_nifti(path, options).map_err(|problem| Error::Read { problem, path: path.to_owned() })
}

fn read_nifti(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    let mut report = Report::default();
    let mut source = Source::open(path)?;

    // Check the header, and the declared size against the file and the limit.
    let mut bytes = [0_u8; N_HEADER_BYTES];
    source.expect(N_HEADER_BYTES as u64)?;
    source.take(&mut bytes)?;
    let header = nifti::parse(&bytes, &mut report).map_err(|error| source.damage().unwrap_or(error))?;
    let index = volume_index(&header, options)?;
    check_size(&header, options, &mut source)?;

    // Place the voxels in the world, which may fail, before reading them, which takes time.
    let unit_mm = options.unit_mm.unwrap_or_else(|| header_unit_mm(&header, &mut report));
    let (affine, form) =
        nifti::world_from_voxel(&header.fields, header.shape, unit_mm, options.assume_space, &mut report)?;
    let grid = match Grid::new(header.shape, affine).and_then(|grid| stored_grid(&grid)) {
        Ok(grid) => Some(grid),
        Err(GridError::Sheared { .. }) if !options.strict => None,
        Err(problem) => return Err(ReadError::Grid { form, problem }),
    };

    // Read them, and bring sheared axes to orthogonal ones.
    let voxels = read_to_end(&mut source, &header, index, &mut report)?;
    let (grid, voxels) = match grid {
        Some(grid) => (grid, voxels),
        None => orthogonal::resample(&voxels, header.shape, affine, options.max_bytes, &mut report)?,
    };
    count_grid(&grid, &mut report);
    let volume = Volume::new(grid, voxels, header.slope, header.intercept);
    Ok(Loaded { volume, report })
}

/// Compares the declared size with what the file can hold and with what the caller allows.
fn check_size(header: &Header, options: &ReadOptions, source: &mut Source) -> Result<(), ReadError> {
    let end = u128::from(header.volume_bytes()) * u128::from(header.n_volumes) + u128::from(header.offset);
    source.expect(u64::try_from(end).unwrap_or(u64::MAX))?;
    let needed = header.n_voxels() * header.scalar.memory_bytes();
    if needed > options.max_bytes {
        return Err(ReadError::TooLarge { needed, limit: options.max_bytes });
    }
    Ok(())
}

/// Reads one volume, and on to the end, so that the checksum is verified.
fn read_to_end(
    source: &mut Source,
    header: &Header,
    index: u64,
    report: &mut Report,
) -> Result<Voxels, ReadError> {
    let has_hidden_extension = skip_extensions(source, header)?;
    source.skip(index * header.volume_bytes())?;
    let voxels = nifti::read_voxels(source, header, report)?;
    source.skip((header.n_volumes - 1 - index) * header.volume_bytes())?;
    let n_trailing = source.drain(MAX_TRAILING_BYTES)?;
    if has_hidden_extension && n_trailing > 0 {
        // The voxels would have been read from the middle of the extension.
        let (field, expected) = ("vox_offset", "room for the extension that the header announces");
        return Err(ReadError::Field { field, found: header.offset.to_string(), expected });
    }
    if n_trailing > 0 {
        report.warn("W-NIFTI-TRAILING", format!("{n_trailing} bytes follow the voxels and are not read"));
    }
    Ok(voxels)
}

/// Which volume of the file is read.
fn volume_index(header: &Header, options: &ReadOptions) -> Result<u64, ReadError> {
    let n_volumes = header.n_volumes;
    match options.volume_index {
        None if n_volumes == 1 => Ok(0),
        None => Err(ReadError::FourDimensional { n_volumes }),
        Some(index) if (index as u64) < n_volumes => Ok(index as u64),
        Some(index) => Err(ReadError::VolumeIndex { index, n_volumes }),
    }
}

/// Mm for one unit of the header's lengths: the three low bits of `xyzt_units`.
fn header_unit_mm(header: &Header, report: &mut Report) -> f64 {
    match header.fields.xyzt_units & 7 {
        1 => 1e3,
        2 => 1.0,
        3 => 1e-3,
        other => {
            let what = if other == 0 { "does not state" } else { "states an unknown" };
            report.warn("W-NIFTI-NO-UNITS", format!("the header {what} unit of length: taken as mm"));
            1.0
        }
    }
}

/// Passes over what stands between header and voxels; nothing in it is needed. Tells whether an extension is
/// announced although the voxels are said to follow at once.
fn skip_extensions(source: &mut Source, header: &Header) -> Result<bool, ReadError> {
    let mut flag = [0_u8; 4];
    source.take(&mut flag)?;
    let n_header_bytes = (N_HEADER_BYTES + flag.len()) as u64;
    source.skip(header.offset - n_header_bytes)?;
    Ok(flag[0] != 0 && header.offset == n_header_bytes)
}

fn count_grid(grid: &Grid, report: &mut Report) {
    let ([nx, ny, nz], spacing) = (grid.shape(), grid.spacing_mm());
    report.count_usize("shape_x", nx);
    report.count_usize("shape_y", ny);
    report.count_usize("shape_z", nz);
    report.count("spacing_x_mm", spacing.x);
    report.count("spacing_y_mm", spacing.y);
    report.count("spacing_z_mm", spacing.z);
    report.count_usize("voxels", grid.n_voxels());
}
