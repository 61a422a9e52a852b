//! File → [`Volume`].
//!
//! **Input** a path to a volume file, or to a folder of DICOM slices. **Output** [`Loaded`].
//! **Steps** 1. open the file and check its header; 2. compare the declared size with what the caller allows;
//! 3. place the voxels in the world; 4. read them, and read on to the end so that the checksum is verified;
//! 5. resample where the axes are sheared.
//! **Guarantees** sizes are checked before anything is allocated; memory is the voxels and two small buffers
//! (twice the voxels where they are resampled); no byte makes it panic. The affine is rounded to single
//! precision, so that a file that we write of this grid places its voxels exactly where this volume has them.
//! **Cost** O(bytes) time.

use std::path::{Path, PathBuf};

use espalier_model::nifti_out::stored_grid;
use espalier_model::{Grid, GridError, Report, Volume};

use crate::dicom::{self, Assembled};
use crate::stored::Stored;
use crate::{Error, ReadError, ReadOptions, decode, orthogonal};

/// What the decompressor and the buffers take beside the voxels.
const BUFFER_BYTES: u64 = 256 << 10;

/// A volume as it stands in a file, and what was seen on the way.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The volume.
    pub volume: Volume,
    /// Counts `shape_x/y/z`, `spacing_x/y/z_mm`, `voxels`, and warnings.
    pub report: Report,
}

/// The files that [`read`] takes a volume from: the file itself; header and data where they are two files; those of a
/// DICOM series by position.
///
/// # Errors
/// As [`read`], as far as headers tell.
pub fn files(path: &Path, options: &ReadOptions) -> Result<Vec<PathBuf>, Error> {
    let listed = |path: &Path| match dicom::is_dicom(path)? {
        true => dicom::files(path, options),
        false => Ok(Stored::open(path, options, &mut Report::default())?.files),
    };
    listed(path).map_err(|problem| Error::Read { problem, path: path.to_owned() })
}

/// Reads the volume in a file, or that of a DICOM series: a folder, or one file of it.
///
/// # Errors
/// [`Error::Read`] with the path: missing or unreadable files, malformed, truncated or damaged ones, more voxels
/// than `options.max_bytes` holds, 4D files without `options.volume_index`, colours and complex numbers, and
/// files that do not say where they lie without `options.assume_space`.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Loaded, Error> {
    read_any(path, options).map_err(|problem| Error::Read { problem, path: path.to_owned() })
}

fn read_any(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    let mut report = Report::default();
    if dicom::is_dicom(path)? {
        return read_dicom(path, options, report);
    }
    let mut stored = Stored::open(path, options, &mut report)?;
    check_limit(stored.memory_bytes().saturating_add(BUFFER_BYTES), options)?;

    // Place the voxels in the world, which may fail, before reading them, which takes time.
    let grid = orthogonal_grid(&stored, options)?;

    // Read them, and bring sheared axes to orthogonal ones.
    let voxels = decode::read_voxels(&mut stored, &mut report)?;
    stored.stream.finish(&mut report)?;
    let (grid, voxels) = match grid {
        Some(grid) => (grid, voxels),
        None => orthogonal::resample(&voxels, &stored, options.max_bytes, &mut report)?,
    };
    count_grid(&grid, &mut report);
    let volume = Volume::new(grid, voxels, stored.slope, stored.intercept);
    Ok(Loaded { volume, report })
}

fn read_dicom(path: &Path, options: &ReadOptions, mut report: Report) -> Result<Loaded, ReadError> {
    let Assembled { shape, world_from_voxel, voxels, slope, intercept } =
        dicom::read(path, options, &mut report)?;
    let grid = Grid::new(shape, world_from_voxel).and_then(|grid| stored_grid(&grid));
    let form = "position and orientation of the slices";
    let grid = grid.map_err(|problem| ReadError::Grid { form, problem })?;
    count_grid(&grid, &mut report);
    let volume = Volume::new(grid, voxels, slope, intercept);
    Ok(Loaded { volume, report })
}

pub(crate) fn check_limit(needed: u64, options: &ReadOptions) -> Result<(), ReadError> {
    if needed > options.max_bytes {
        return Err(ReadError::TooLarge { needed, limit: options.max_bytes });
    }
    Ok(())
}

/// The grid of a volume; none where its axes are sheared and may be made orthogonal.
pub(crate) fn orthogonal_grid(stored: &Stored, options: &ReadOptions) -> Result<Option<Grid>, ReadError> {
    match Grid::new(stored.shape, stored.world_from_voxel).and_then(|grid| stored_grid(&grid)) {
        Ok(grid) => Ok(Some(grid)),
        Err(GridError::Sheared { .. }) if !options.strict => Ok(None),
        Err(problem) => Err(ReadError::Grid { form: stored.form, problem }),
    }
}

pub(crate) fn count_grid(grid: &Grid, report: &mut Report) {
    let ([nx, ny, nz], spacing) = (grid.shape(), grid.spacing_mm());
    report.count_usize("shape_x", nx);
    report.count_usize("shape_y", ny);
    report.count_usize("shape_z", nz);
    report.count("spacing_x_mm", spacing.x);
    report.count("spacing_y_mm", spacing.y);
    report.count("spacing_z_mm", spacing.z);
    report.count_usize("voxels", grid.n_voxels());
}
