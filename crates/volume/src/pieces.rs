//! The values of a volume file, piece by piece.
//!
//! **Input** a path. **Output** [`Pieces`]: the grid at once, the values when they are asked for.
//! **Steps** 1. open the file and check its header; 2. some numbers at a time, scaled; 3. the rest of the file, so that
//! its checksum is verified.
//! **Guarantees** the values are those of [`read`], in storage order, x fastest. Memory is a buffer; but DICOM slices,
//! and sheared axes, which must be made orthogonal, take the whole volume, under the same limit as there.
//! **Cost** one pass over the file.

use std::path::{Path, PathBuf};

use espalier_model::{Grid, Report, Volume};

use crate::decode::number;
use crate::read::orthogonal_grid;
use crate::scalar::Scalar;
use crate::stored::Stored;
use crate::{Error, ReadError, ReadOptions, dicom, read};

/// Values that are read at a time.
const N_AT_A_TIME: usize = 8192;

/// A volume whose values are still in its file.
pub struct Pieces {
    grid: Grid,
    values: Values,
    path: PathBuf,
}

enum Values {
    InFile(Stored),
    InMemory(Volume),
}

/// Opens a volume for its values.
///
/// # Errors
/// As [`read`].
pub fn open_pieces(path: &Path, options: &ReadOptions) -> Result<Pieces, Error> {
    let named = |problem| Error::Read { problem, path: path.to_owned() };
    if !dicom::is_dicom(path).map_err(named)? {
        let stored = Stored::open(path, options, &mut Report::default()).map_err(named)?;
        if let Some(grid) = orthogonal_grid(&stored, options).map_err(named)? {
            return Ok(Pieces { grid, values: Values::InFile(stored), path: path.to_owned() });
        }
    }
    let volume = read(path, options)?.volume;
    Ok(Pieces { grid: volume.grid().clone(), values: Values::InMemory(volume), path: path.to_owned() })
}

impl Pieces {
    /// Where the voxels lie.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Calls `visit` with each piece: the flat index of its first voxel (x fastest), and its scaled values.
    ///
    /// # Errors
    /// [`Error::Read`] for a file that ends early or is damaged.
    pub fn for_each(self, mut visit: impl FnMut(usize, &[f64])) -> Result<(), Error> {
        match self.values {
            Values::InFile(mut stored) => read_pieces(&mut stored, &mut visit)
                .map_err(|problem| Error::Read { problem, path: self.path.clone() }),
            Values::InMemory(volume) => {
                volume.for_each_piece(visit);
                Ok(())
            }
        }
    }
}

#[allow(clippy::unnecessary_cast, reason = "one type is f64 already")]
fn read_pieces(stored: &mut Stored, visit: &mut impl FnMut(usize, &[f64])) -> Result<(), ReadError> {
    macro_rules! read_as {
        ($file_type:ty) => {{
            let from_bytes = number!(stored, $file_type);
            read_numbers(stored, |bytes| from_bytes(bytes) as f64, visit)?
        }};
    }
    match stored.scalar {
        Scalar::U8 => read_as!(u8),
        Scalar::I8 => read_as!(i8),
        Scalar::I16 => read_as!(i16),
        Scalar::U16 => read_as!(u16),
        Scalar::I32 => read_as!(i32),
        Scalar::U32 => read_as!(u32),
        Scalar::F32 => read_as!(f32),
        Scalar::F64 => read_as!(f64),
        Scalar::I64 => read_as!(i64),
        Scalar::U64 => read_as!(u64),
    }
    stored.stream.finish(&mut Report::default())
}

/// Reads the numbers of `N` bytes and hands on their scaled values.
fn read_numbers<const N: usize>(
    stored: &mut Stored,
    decode: impl Fn([u8; N]) -> f64,
    visit: &mut impl FnMut(usize, &[f64]),
) -> Result<(), ReadError> {
    let [nx, ny, nz] = stored.shape;
    let (n_voxels, slope, intercept) = (nx * ny * nz, stored.slope, stored.intercept);
    let mut bytes = vec![0_u8; N * N_AT_A_TIME.min(n_voxels)];
    let mut values = Vec::with_capacity(N_AT_A_TIME.min(n_voxels));
    for start in (0..n_voxels).step_by(N_AT_A_TIME) {
        let bytes = &mut bytes[..N * N_AT_A_TIME.min(n_voxels - start)];
        stored.stream.take(bytes)?;
        values.clear();
        values.extend(bytes.as_chunks::<N>().0.iter().map(|&chunk| slope * decode(chunk) + intercept));
        visit(start, &values);
    }
    Ok(())
}
