//! A volume whose header is read and whose voxels are still in the file: what all formats come to.
//!
//! **Input** a path. **Output** [`Stored`].
//! **Steps** 1. the format, by the file's content; 2. its header, checked; 3. the stream of its voxels, opened but
//! not read.
//! **Guarantees** every number in a [`Stored`] is checked, so that what comes after knows nothing of formats; nothing
//! as large as a volume is allocated, and the file is known to be able to hold what the header declares.
//!
//! A format is a function that makes a [`Stored`] of a file whose first bytes say that it has this format, and a
//! [`VoxelStream`].

use std::path::{Path, PathBuf};

use espalier_model::Report;
use glam::DAffine3;

use crate::recognise::{Format, N_LOOKED_AT, recognise};
use crate::scalar::Scalar;
use crate::source::Source;
use crate::{ReadError, ReadOptions, metaimage, nifti, nrrd};

/// Some programs pad their files; nothing that is meant has as many bytes after the voxels.
pub(crate) const MAX_TRAILING_BYTES: u64 = 1 << 20;

/// Bytes of interleaved volumes that are read at a time.
const PIECE_BYTES: usize = 1 << 16;

/// A volume whose header is read and whose voxels are still in the file.
pub(crate) struct Stored {
    /// The format of its header.
    pub(crate) format: Format,
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
    /// The files that it is made of, the header first.
    pub(crate) files: Vec<PathBuf>,
    /// The voxels' bytes, x fastest, z slowest.
    pub(crate) stream: Box<dyn VoxelStream>,
}

/// The bytes of one volume's voxels, in order.
pub(crate) trait VoxelStream: Send {
    /// Fills the buffer with the next bytes, those of whole numbers. Never asked for more than the volume has in all.
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

/// Voxels that stand in a file one after another.
pub(crate) struct FileStream {
    pub(crate) source: Source,
    /// Bytes of further volumes behind the one that is read.
    pub(crate) n_after: u64,
    /// How many bytes of no use may follow them.
    pub(crate) max_trailing: u64,
}

impl VoxelStream for FileStream {
    fn take(&mut self, buffer: &mut [u8]) -> Result<(), ReadError> {
        self.source.take(buffer)
    }

    fn finish(&mut self, report: &mut Report) -> Result<(), ReadError> {
        self.source.skip(self.n_after)?;
        finish(&mut self.source, self.max_trailing, report).map(|_| ())
    }
}

/// One of several volumes whose voxels take turns.
pub(crate) struct Interleaved {
    all: Box<dyn VoxelStream>,
    /// Bytes of one number.
    number_bytes: usize,
    /// How many volumes there are, and which one is read.
    n_volumes: usize,
    index: usize,
    /// The numbers of one voxel, or the voxels of a piece.
    piece: Vec<u8>,
}

impl Interleaved {
    pub(crate) fn new(all: Box<dyn VoxelStream>, number_bytes: u64, n_volumes: u64, index: u64) -> Self {
        // The caller knows that all volumes fit the file, so that the counts fit memory.
        let (number_bytes, n_volumes) = (number_bytes as usize, n_volumes as usize);
        Self { all, number_bytes, n_volumes, index: index as usize, piece: Vec::new() }
    }
}

impl VoxelStream for Interleaved {
    /// `buffer` must hold whole numbers.
    fn take(&mut self, buffer: &mut [u8]) -> Result<(), ReadError> {
        let stride = self.number_bytes * self.n_volumes;
        let start = self.index * self.number_bytes;
        let n_at_a_time = (PIECE_BYTES / stride).max(1);
        for numbers in buffer.chunks_mut(n_at_a_time * self.number_bytes) {
            self.piece.resize(numbers.len() / self.number_bytes * stride, 0);
            self.all.take(&mut self.piece)?;
            for (number, voxel) in
                numbers.chunks_exact_mut(self.number_bytes).zip(self.piece.chunks_exact(stride))
            {
                number.copy_from_slice(&voxel[start..start + self.number_bytes]);
            }
        }
        Ok(())
    }

    fn finish(&mut self, report: &mut Report) -> Result<(), ReadError> {
        self.all.finish(report)
    }
}

impl Stored {
    /// Opens a volume of any format.
    pub(crate) fn open(path: &Path, options: &ReadOptions, report: &mut Report) -> Result<Self, ReadError> {
        let mut source = Source::open(path)?;
        match recognise(source.peek(N_LOOKED_AT)?, path).map_err(|error| source.damage().unwrap_or(error))? {
            Format::Nifti => nifti::open(source, path, options, report),
            Format::NiftiImage => {
                let header = nifti::header_of(path)?;
                nifti::open(Source::open_detached(&header)?, &header, options, report)
            }
            Format::Nrrd => nrrd::open(source, path, options, report),
            Format::MetaImage => metaimage::open(source, path, options, report),
        }
    }

    pub(crate) fn n_voxels(&self) -> u64 {
        self.shape.iter().map(|&extent| extent as u64).product()
    }

    /// The bytes that one bit a voxel takes.
    pub(crate) fn bits_bytes(&self) -> u64 {
        let [nx, ny, nz] = self.shape.map(|extent| extent as u64);
        nx.div_ceil(64).saturating_mul(8).saturating_mul(ny).saturating_mul(nz)
    }

    /// The bytes that the voxels take in memory.
    pub(crate) fn memory_bytes(&self) -> u64 {
        self.n_voxels().saturating_mul(self.scalar.memory_bytes())
    }
}

/// Which volume of a series is read.
pub(crate) fn volume_index(n_volumes: u64, options: &ReadOptions) -> Result<u64, ReadError> {
    match options.volume_index {
        None if n_volumes == 1 => Ok(0),
        None => Err(ReadError::FourDimensional { n_volumes }),
        Some(index) if (index as u64) < n_volumes => Ok(index as u64),
        Some(index) => Err(ReadError::VolumeIndex { index, n_volumes }),
    }
}

/// Reads what is left of a file, so that its checksum is verified, and tells how many bytes that was.
pub(crate) fn finish(source: &mut Source, max_trailing: u64, report: &mut Report) -> Result<u64, ReadError> {
    // Several headers may share a data file, and plain data has no checksum.
    let n_trailing = if source.is_detached() && !source.is_compressed() {
        source.max_bytes() - source.position()
    } else {
        source.drain(max_trailing)?
    };
    if n_trailing > 0 {
        report.warn("W-VOLUME-TRAILING", format!("{n_trailing} bytes follow the voxels and are not read"));
    }
    Ok(n_trailing)
}
