//! The 348 bytes of a NIfTI-1 header, checked.
//!
//! **Input** the bytes. **Output** [`Header`]: extents, type of the numbers, where they begin, their scaling.
//! **Steps** 1. recognise the format by its first and last field, and with it the byte order; 2. take the fields
//! apart (crate `nifti`, for the struct only); 3. check each field that is used.
//! **Guarantees** extents are 1 to 32767; the offset is at least 352; slope and intercept are finite, the slope
//! not 0. Nothing is computed with a number before it is checked.
//! **Source** `nifti1.h` of the NIfTI-1 standard.

use espalier_model::Report;
use nifti::NiftiHeader;

use crate::ReadError;
use crate::scalar::Scalar;

pub(crate) const N_HEADER_BYTES: usize = 348;
const MIN_OFFSET: u64 = 352;
/// Whole numbers are exact in the single precision of `vox_offset` up to here; no header is as long.
const MAX_OFFSET: f32 = 16_777_216.0;

/// What a header says, checked.
pub(crate) struct Header {
    pub(crate) shape: [usize; 3],
    pub(crate) n_volumes: u64,
    pub(crate) scalar: Scalar,
    pub(crate) is_big_endian: bool,
    /// Where the voxels begin.
    pub(crate) offset: u64,
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
    /// The fields that place the volume in the world, still unchecked.
    pub(crate) fields: NiftiHeader,
}

impl Header {
    pub(crate) fn n_voxels(&self) -> u64 {
        self.shape.iter().map(|&extent| extent as u64).product()
    }

    /// Bytes of one volume in the file.
    pub(crate) fn volume_bytes(&self) -> u64 {
        self.n_voxels() * self.scalar.file_bytes()
    }
}

/// Takes a header apart and checks it.
pub(crate) fn parse(bytes: &[u8; N_HEADER_BYTES], report: &mut Report) -> Result<Header, ReadError> {
    let is_big_endian = recognise(bytes)?;
    let fields = NiftiHeader::from_reader(&bytes[..]).map_err(|_| ReadError::Format {
        what: "its header cannot be taken apart",
        way_out: "write the file again with the program that made it",
    })?;
    // The struct's reader guesses the byte order from dim[0], so a bad dim[0] shows in sizeof_hdr.
    let n_dims = usize::from(fields.dim[0]);
    if fields.sizeof_hdr != N_HEADER_BYTES as i32 || !(1..=7).contains(&n_dims) {
        let raw = [bytes[40], bytes[41]];
        let found = if is_big_endian { i16::from_be_bytes(raw) } else { i16::from_le_bytes(raw) };
        let (field, expected) = ("dim[0]", "1 to 7");
        return Err(ReadError::Field { field, found: found.to_string(), expected });
    }
    let (shape, n_volumes) = extents(&fields.dim, n_dims)?;
    let scalar = scalar(fields.datatype)?;
    if u64::try_from(fields.bitpix) != Ok(8 * scalar.file_bytes()) {
        let (bitpix, bits) = (fields.bitpix, 8 * scalar.file_bytes());
        report.warn(
            "W-NIFTI-BITPIX",
            format!(
                "bitpix is {bitpix}, but datatype {} has {bits} bits: datatype is taken",
                fields.datatype
            ),
        );
    }
    let offset = offset(fields.vox_offset, report)?;
    let (slope, intercept) = scaling(&fields, report);
    Ok(Header { shape, n_volumes, scalar, is_big_endian, offset, slope, intercept, fields })
}

/// Whether the header is big-endian; an error with a name for what is no NIfTI-1 file.
fn recognise(bytes: &[u8; N_HEADER_BYTES]) -> Result<bool, ReadError> {
    let size = [bytes[0], bytes[1], bytes[2], bytes[3]];
    let sizes = (i32::from_le_bytes(size), i32::from_be_bytes(size));
    let is_big_endian = match sizes {
        (348, _) => false,
        (_, 348) => true,
        (540, _) | (_, 540) => {
            return Err(ReadError::Format {
                what: "it is NIfTI-2",
                way_out: "convert it to NIfTI-1, which holds volumes of up to 32767 voxels along an axis",
            });
        }
        _ => {
            return Err(ReadError::Format {
                what: "its first field is not 348",
                way_out: "give a .nii or .nii.gz file, or convert the volume to one",
            });
        }
    };
    match &bytes[344..348] {
        b"n+1\0" => Ok(is_big_endian),
        b"ni1\0" => Err(ReadError::Format {
            what: "it is a .hdr header whose voxels are in another file",
            way_out: "convert the pair of files to one .nii.gz file",
        }),
        b"\0\0\0\0" => Err(ReadError::Format {
            what: "it is an ANALYZE header, which does not say left from right",
            way_out: "convert it to .nii.gz with a program that knows where it comes from",
        }),
        _ => Err(ReadError::Format {
            what: "its last field, the magic, is not n+1",
            way_out: "give a .nii or .nii.gz file, or convert the volume to one",
        }),
    }
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
    Err(ReadError::NotScalar { what, code })
}

/// Voxels along x, y, z, and the number of volumes over all further dimensions.
fn extents(dim: &[u16; 8], n_dims: usize) -> Result<([usize; 3], u64), ReadError> {
    const NAMES: [&str; 8] = ["dim[0]", "dim[1]", "dim[2]", "dim[3]", "dim[4]", "dim[5]", "dim[6]", "dim[7]"];
    // Extents beyond dim[0] have no meaning, whatever stands there.
    let mut extents = [1_u64; 7];
    for axis in 0..n_dims {
        let signed = dim[axis + 1] as i16;
        if signed < 1 {
            let (field, expected) = (NAMES[axis + 1], "1 to 32767");
            return Err(ReadError::Field { field, found: signed.to_string(), expected });
        }
        extents[axis] = signed as u64;
    }
    let [x, y, z, further @ ..] = extents;
    let n_volumes = further.iter().product();
    Ok(([x as usize, y as usize, z as usize], n_volumes))
}

/// Where the voxels begin.
fn offset(vox_offset: f32, report: &mut Report) -> Result<u64, ReadError> {
    if vox_offset == 0.0 {
        report.warn("W-NIFTI-OFFSET", format!("vox_offset is 0: taken as {MIN_OFFSET}"));
        return Ok(MIN_OFFSET);
    }
    let is_legal =
        vox_offset >= MIN_OFFSET as f32 && vox_offset <= MAX_OFFSET && vox_offset.trunc() == vox_offset;
    if is_legal {
        return Ok(vox_offset as u64);
    }
    let (field, expected) = ("vox_offset", "a whole number from 352 to 16777216");
    Err(ReadError::Field { field, found: vox_offset.to_string(), expected })
}

/// Slope and intercept; 1 and 0 where the file has none that can be used.
fn scaling(fields: &NiftiHeader, report: &mut Report) -> (f64, f64) {
    let (slope, intercept) = (fields.scl_slope, fields.scl_inter);
    if slope == 0.0 && intercept == 0.0 {
        // The standard's way to say that the numbers are not scaled.
        return (1.0, 0.0);
    }
    if slope != 0.0 && slope.is_finite() && intercept.is_finite() {
        return (f64::from(slope), f64::from(intercept));
    }
    report.warn(
        "W-NIFTI-SLOPE",
        format!("scl_slope {slope} and scl_inter {intercept} cannot be used: the numbers are taken unscaled"),
    );
    (1.0, 0.0)
}
