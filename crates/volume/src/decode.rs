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

/// Numbers that are read at a time.
const N_AT_A_TIME: usize = 8192;
/// Whole numbers are exact in a double up to here.
const MAX_EXACT: u64 = 1 << 53;

/// Reads all voxels.
pub(crate) fn read_voxels(stored: &mut Stored, report: &mut Report) -> Result<Voxels, ReadError> {
    macro_rules! read_as {
        ($file_type:ty, $convert:expr) => {{
            let decode =
                if stored.is_big_endian { <$file_type>::from_be_bytes } else { <$file_type>::from_le_bytes };
            let convert = $convert;
            read_array(stored, |bytes| convert(decode(bytes)))
        }};
    }
    let n_inexact = Cell::new(0_usize);
    let voxels = match stored.scalar {
        Scalar::U8 => Voxels::U8(read_as!(u8, |v| v)?),
        Scalar::I8 => Voxels::I16(read_as!(i8, i16::from)?),
        Scalar::I16 => Voxels::I16(read_as!(i16, |v| v)?),
        Scalar::U16 => Voxels::U16(read_as!(u16, |v| v)?),
        Scalar::I32 => Voxels::I32(read_as!(i32, |v| v)?),
        Scalar::U32 => Voxels::U32(read_as!(u32, |v| v)?),
        Scalar::F32 => Voxels::F32(read_as!(f32, |v| v)?),
        Scalar::F64 => Voxels::F64(read_as!(f64, |v| v)?),
        Scalar::I64 => Voxels::F64(read_as!(i64, |v: i64| {
            n_inexact.update(|n| n + usize::from(v.unsigned_abs() > MAX_EXACT));
            v as f64
        })?),
        Scalar::U64 => Voxels::F64(read_as!(u64, |v: u64| {
            n_inexact.update(|n| n + usize::from(v > MAX_EXACT));
            v as f64
        })?),
    };
    let n_inexact = n_inexact.get();
    if n_inexact > 0 {
        report.warn("W-VOLUME-INEXACT", format!("{n_inexact} numbers beyond 2^53 were rounded"));
    }
    Ok(voxels)
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
