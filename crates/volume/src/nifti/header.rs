//! A NIfTI header, checked.
//!
//! **Input** [`Fields`]. **Output** [`Header`]: extents, type of the numbers, where they begin, their scaling.
//! **Guarantees** extents are from 1, to 32767 in NIfTI-1; the bytes of all volumes are counted without overflow;
//! slope and intercept are finite, the slope not 0. Nothing is computed with a number before it is checked.
//! **Source** `nifti1.h` and `nifti2.h`.

use espalier_model::Report;

use super::fields::Fields;
use crate::ReadError;
use crate::scalar::Scalar;

/// Whole numbers are exact in the single precision of NIfTI-1's `vox_offset` up to here; no header is as long.
const MAX_OFFSET: f64 = 16_777_216.0;

/// What a header says, checked.
pub(crate) struct Header {
    pub(crate) shape: [usize; 3],
    pub(crate) n_volumes: u64,
    pub(crate) scalar: Scalar,
    /// Where the voxels begin in their file.
    pub(crate) offset: u64,
    /// Bytes of one volume in the file.
    pub(crate) volume_bytes: u64,
    /// Bytes of the file that holds the voxels: what stands before them, and all volumes.
    pub(crate) file_bytes: u64,
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
}

/// Checks a header.
pub(crate) fn check(fields: &Fields, report: &mut Report) -> Result<Header, ReadError> {
    let (extents, n_volumes) = extents(fields)?;
    let scalar = scalar(fields.datatype)?;
    if i64::from(fields.bitpix) != 8 * scalar.file_bytes() as i64 {
        let (bitpix, bits) = (fields.bitpix, 8 * scalar.file_bytes());
        report.warn(
            "W-NIFTI-BITPIX",
            format!(
                "bitpix is {bitpix}, but datatype {} has {bits} bits: datatype is taken",
                fields.datatype
            ),
        );
    }
    let offset = offset(fields, report)?;
    // What does not fit 64 bits fits no file.
    let volume_bytes =
        extents.iter().fold(scalar.file_bytes(), |product, &extent| product.saturating_mul(extent));
    let file_bytes = volume_bytes.saturating_mul(n_volumes).saturating_add(offset);
    let (slope, intercept) = scaling(fields, report);
    let shape = extents.map(|extent| usize::try_from(extent).unwrap_or(usize::MAX));
    Ok(Header { shape, n_volumes, scalar, offset, volume_bytes, file_bytes, slope, intercept })
}

/// The type of the numbers by `datatype`.
fn scalar(code: i16) -> Result<Scalar, ReadError> {
    let what = match code {
        2 => return Ok(Scalar::U8),
        4 => return Ok(Scalar::I16),
        8 => return Ok(Scalar::I32),
        16 => return Ok(Scalar::F32),
        64 => return Ok(Scalar::F64),
        256 => return Ok(Scalar::I8),
        512 => return Ok(Scalar::U16),
        768 => return Ok(Scalar::U32),
        1024 => return Ok(Scalar::I64),
        1280 => return Ok(Scalar::U64),
        1 => "single bits",
        32 | 1792 | 2048 => "complex numbers",
        128 => "RGB colours",
        2304 => "RGBA colours",
        1536 => "128-bit floats",
        _ => "of a type that the standard does not know",
    };
    Err(ReadError::NotScalar { what, stated: format!("datatype {code}") })
}

/// Voxels along x, y, z, and the number of volumes over all further dimensions.
fn extents(fields: &Fields) -> Result<([u64; 3], u64), ReadError> {
    const NAMES: [&str; 8] = ["dim[0]", "dim[1]", "dim[2]", "dim[3]", "dim[4]", "dim[5]", "dim[6]", "dim[7]"];
    let dim = &fields.dim;
    if !(1..=7).contains(&dim[0]) {
        return Err(ReadError::Field { field: NAMES[0], found: dim[0].to_string(), expected: "1 to 7" });
    }
    let expected = if fields.version == 1 { "1 to 32767" } else { "a number from 1" };
    // Extents beyond dim[0] have no meaning, whatever stands there.
    let mut extents = [1_u64; 7];
    for axis in 1..=dim[0] as usize {
        let found = dim[axis];
        let legal = u64::try_from(found).ok().filter(|&extent| extent > 0);
        let fault = || ReadError::Field { field: NAMES[axis], found: found.to_string(), expected };
        extents[axis - 1] = legal.ok_or_else(fault)?;
    }
    let [x, y, z, further @ ..] = extents;
    Ok(([x, y, z], further.iter().fold(1, |product: u64, &extent| product.saturating_mul(extent))))
}

/// Where the voxels begin: behind header and flags in a single file, anywhere in a file of their own.
fn offset(fields: &Fields, report: &mut Report) -> Result<u64, ReadError> {
    let (found, minimum) = (fields.vox_offset, if fields.is_pair { 0 } else { fields.n_header_bytes + 4 });
    if found == 0.0 && !fields.is_pair {
        report.warn("W-NIFTI-OFFSET", format!("vox_offset is 0: taken as {minimum}"));
        return Ok(minimum);
    }
    if found >= minimum as f64 && found <= MAX_OFFSET && found.trunc() == found {
        return Ok(found as u64);
    }
    let expected = match (fields.is_pair, fields.version) {
        (true, _) => "a whole number from 0 to 16777216",
        (false, 1) => "a whole number from 352 to 16777216",
        (false, _) => "a whole number from 544 to 16777216",
    };
    Err(ReadError::Field { field: "vox_offset", found: found.to_string(), expected })
}

/// Slope and intercept; 1 and 0 where the file has none that can be used.
fn scaling(fields: &Fields, report: &mut Report) -> (f64, f64) {
    let (slope, intercept) = (fields.scl_slope, fields.scl_inter);
    if slope == 0.0 && intercept == 0.0 {
        // The standard's way to say that the numbers are not scaled.
        return (1.0, 0.0);
    }
    if slope != 0.0 && slope.is_finite() && intercept.is_finite() {
        return (slope, intercept);
    }
    report.warn(
        "W-NIFTI-SLOPE",
        format!("scl_slope {slope} and scl_inter {intercept} cannot be used: the numbers are taken unscaled"),
    );
    (1.0, 0.0)
}
