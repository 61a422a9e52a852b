//! The stored numbers of a volume, decoded.
//!
//! **Input** a [`Stored`] whose stream stands at the first voxel. **Output** [`Voxels`], shape (nz, ny, nx), x fastest.
//! **Steps** 1. reserve the memory, which the caller has checked against the limit; 2. read piece by piece,
//! bringing each number to the machine's byte order.
//! **Guarantees** signed bytes become 16-bit numbers, 64-bit integers become doubles; a warning says so where one
//! of them is beyond 2⁵³, so that a double cannot hold it exactly.

use std::cell::Cell;

use espalier_model::{Report, Voxels};
use ndarray::Array3;

use crate::ReadError;
use crate::scalar::Scalar;
use crate::stored::Stored;

/// What makes a number of a type out of the bytes of a stored one; not a choice of two functions, which would be called
/// for each number.
macro_rules! number {
    ($stored:expr, $file_type:ty) => {{
        let is_big_endian = $stored.is_big_endian;
        move |bytes: [u8; size_of::<$file_type>()]| {
            <$file_type>::from_le_bytes(espalier_model::bytes::from_lowest(bytes, is_big_endian))
        }
    }};
}
pub(crate) use number;

/// Numbers that are read at a time.
const N_AT_A_TIME: usize = 8192;
/// Whole numbers are exact in a double up to here.
const MAX_EXACT: u64 = 1 << 53;

/// Reads all voxels.
pub(crate) fn read_voxels(stored: &mut Stored, report: &mut Report) -> Result<Voxels, ReadError> {
    let n_inexact = Cell::new(0_usize);
    macro_rules! read_as {
        ($kind:ident, $file_type:ty, $convert:expr) => {{
            let convert = $convert;
            let from_bytes = number!(stored, $file_type);
            Voxels::$kind(read_array(stored, |bytes| convert(from_bytes(bytes)))?)
        }};
    }
    let voxels = match stored.scalar {
        Scalar::U8 => read_as!(U8, u8, |v| v),
        Scalar::I8 => read_as!(I16, i8, i16::from),
        Scalar::I16 => read_as!(I16, i16, |v| v),
        Scalar::U16 => read_as!(U16, u16, |v| v),
        Scalar::I32 => read_as!(I32, i32, |v| v),
        Scalar::U32 => read_as!(U32, u32, |v| v),
        Scalar::F32 => read_as!(F32, f32, |v| v),
        Scalar::F64 => read_as!(F64, f64, |v| v),
        Scalar::I64 => read_as!(F64, i64, |v: i64| whole(v.unsigned_abs(), v as f64, &n_inexact)),
        Scalar::U64 => read_as!(F64, u64, |v: u64| whole(v, v as f64, &n_inexact)),
    };
    warn_of_inexact(n_inexact.get(), report);
    Ok(voxels)
}

/// A whole number as a double; counts those that a double cannot hold.
pub(crate) fn whole(magnitude: u64, value: f64, n_inexact: &Cell<usize>) -> f64 {
    n_inexact.update(|n| n + usize::from(magnitude > MAX_EXACT));
    value
}

pub(crate) fn warn_of_inexact(n_inexact: usize, report: &mut Report) {
    if n_inexact > 0 {
        report.warn("W-VOLUME-INEXACT", format!("{n_inexact} numbers beyond 2^53 were rounded"));
    }
}

/// Reads as many numbers of `N` bytes as the volume has voxels.
fn read_array<T, const N: usize>(
    stored: &mut Stored,
    decode: impl Fn([u8; N]) -> T,
) -> Result<Array3<T>, ReadError> {
    let [nx, ny, nz] = stored.shape;
    let n_voxels = nx * ny * nz;
    let needed = stored.memory_bytes();
    let mut values = Vec::new();
    values.try_reserve_exact(n_voxels).map_err(|_| ReadError::NoMemory { needed })?;
    let mut bytes = vec![0_u8; N * N_AT_A_TIME.min(n_voxels)];
    while values.len() < n_voxels {
        let n_now = N_AT_A_TIME.min(n_voxels - values.len());
        stored.stream.take(&mut bytes[..N * n_now])?;
        values.extend(bytes[..N * n_now].as_chunks::<N>().0.iter().map(|&chunk| decode(chunk)));
    }
    Array3::from_shape_vec((nz, ny, nx), values).map_err(|_| ReadError::NoMemory { needed })
}
