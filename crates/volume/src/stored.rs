//! A volume whose header is read and whose voxels are still in the file: what all formats come to.
//!
//! **Input** a path. **Output** [`Stored`].
//! **Steps** 1. the format, by the file's content; 2. its header, checked; 3. the stream of its voxels, opened but
//! not read.
//! **Guarantees** every number in a [`Stored`] is checked, so that what comes after knows nothing of formats; nothing
//! as large as a volume is allocated, and the file is known to be able to hold what the header declares.
//!
//! A format is a function `open(path, options, report) -> Result<Stored, ReadError>` and a [`VoxelStream`].

use std::path::Path;

use espalier_model::Report;
use glam::DAffine3;

use crate::scalar::Scalar;
use crate::{ReadError, ReadOptions, nifti};

/// A volume whose header is read and whose voxels are still in the file.
pub(crate) struct Stored {
    /// Voxels along x, y, z; each at least 1, their product fits an `isize`.
    pub(crate) shape: [usize; 3],
    /// Maps voxel coordinates to RAS+ mm: finite, but the axes may be sheared or singular.
    pub(crate) world_from_voxel: DAffine3,
    /// Which fields of the header place the volume, for messages.
    pub(crate) form: &'static str,
    /// The type of the numbers in the stream.
    pub(crate) scalar: Scalar,
    /// The byte order of the numbers in the stream.
    pub(crate) is_big_endian: bool,
    /// A voxel's value is `slope · stored + intercept`; finite, not 0.
    pub(crate) slope: f64,
    /// See `slope`.
    pub(crate) intercept: f64,
    /// The voxels' bytes, x fastest, z slowest.
    pub(crate) stream: Box<dyn VoxelStream>,
}

/// The bytes of one volume's voxels, in order.
pub(crate) trait VoxelStream: Send {
    /// Fills the buffer with the next bytes. Never asked for more than the volume has in all.
    ///
    /// # Errors
    /// If the file ends before, or is damaged.
    fn take(&mut self, buffer: &mut [u8]) -> Result<(), ReadError>;

    /// After the last voxel: reads on to the end of the file, so that its checksum is verified.
    ///
    /// # Errors
    /// If the rest is damaged, or more than any program leaves behind the voxels.
    fn finish(&mut self, report: &mut Report) -> Result<(), ReadError>;
}

impl Stored {
    /// Opens a volume of any format.
    pub(crate) fn open(path: &Path, options: &ReadOptions, report: &mut Report) -> Result<Self, ReadError> {
        nifti::open(path, options, report)
    }

    pub(crate) fn n_voxels(&self) -> u64 {
        self.shape.iter().map(|&extent| extent as u64).product()
    }

    /// The bytes that the voxels take in memory.
    pub(crate) fn memory_bytes(&self) -> u64 {
        self.n_voxels().saturating_mul(self.scalar.memory_bytes())
    }
}
