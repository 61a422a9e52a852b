//! The fields of a NIfTI header that are used, of either version.
//!
//! **Input** the header's bytes. **Output** [`Fields`].
//! **Steps** 1. version and byte order by the first field, the header's own length; 2. one file or a pair by the
//! magic; 3. the fields, in the widest type that one of the versions has.
//! **Source** `nifti1.h` and `nifti2.h`.
//! **Differs from the source** the bytes of NIfTI-1 are taken apart by the crate `nifti`, those of NIfTI-2, which it
//! does not know, here.

use espalier_model::bytes::from_lowest;
use nifti::NiftiHeader;

use crate::ReadError;
use crate::source::Source;

/// The length of a NIfTI-1 header, and what its first field says.
const N_BYTES_1: usize = 348;
/// The same of NIfTI-2.
const N_BYTES_2: usize = 540;

/// The fields that are used, as they stand in the header.
#[derive(Clone, Debug)]
pub(crate) struct Fields {
    /// 1 or 2.
    pub(crate) version: u8,
    pub(crate) is_big_endian: bool,
    /// Whether the voxels are in another file.
    pub(crate) is_pair: bool,
    /// The length of the header.
    pub(crate) n_header_bytes: u64,
    pub(crate) dim: [i64; 8],
    pub(crate) datatype: i16,
    pub(crate) bitpix: i16,
    pub(crate) vox_offset: f64,
    pub(crate) scl_slope: f64,
    pub(crate) scl_inter: f64,
    pub(crate) xyzt_units: i32,
    pub(crate) pixdim: [f64; 8],
    pub(crate) qform_code: i32,
    pub(crate) sform_code: i32,
    /// b, c and d.
    pub(crate) quatern: [f64; 3],
    pub(crate) qoffset: [f64; 3],
    /// The rows of the sform.
    pub(crate) srow: [[f64; 4]; 3],
    /// The relative precision of the numbers that place the volume.
    pub(crate) precision: f64,
}

/// Reads a header, as far as the version says; the stream stands behind it.
pub(crate) fn read(source: &mut Source) -> Result<Fields, ReadError> {
    source.expect(N_BYTES_1 as u64)?;
    let Some(&size) = source.peek(4)?.first_chunk() else {
        let n_found = source.peek(4)?.len() as u64;
        return Err(source.truncated(n_found));
    };
    match (u32::from_le_bytes(size), u32::from_be_bytes(size)) {
        (348, _) => version_1(source, false),
        (_, 348) => version_1(source, true),
        (540, _) => version_2(source, false),
        (_, 540) => version_2(source, true),
        _ => Err(not_nifti("a file whose first field is not the length of a NIfTI header")),
    }
}

fn version_1(source: &mut Source, is_big_endian: bool) -> Result<Fields, ReadError> {
    let mut bytes = [0_u8; N_BYTES_1];
    source.take(&mut bytes)?;
    let is_pair = match &bytes[344..348] {
        b"n+1\0" => false,
        b"ni1\0" => true,
        b"\0\0\0\0" => {
            return Err(ReadError::Format {
                what: "an ANALYZE header, which does not say left from right",
                way_out: "convert it to .nii.gz with a program that knows where it comes from".to_owned(),
            });
        }
        _ => return Err(not_nifti("a file whose magic is neither n+1 nor ni1")),
    };
    let header = NiftiHeader::from_reader(&bytes[..])
        .map_err(|_| not_nifti("a NIfTI header that cannot be taken apart"))?;
    // The struct's reader guesses the byte order from dim[0], so a bad dim[0] shows in sizeof_hdr.
    if header.sizeof_hdr != N_BYTES_1 as i32 {
        let found = i16::from_le_bytes(from_lowest([bytes[40], bytes[41]], is_big_endian));
        return Err(ReadError::Field { field: "dim[0]", found: found.to_string(), expected: "1 to 7" });
    }
    let row = |srow: [f32; 4]| srow.map(f64::from);
    Ok(Fields {
        version: 1,
        is_big_endian,
        is_pair,
        n_header_bytes: N_BYTES_1 as u64,
        // The struct's extents are unsigned, those of the standard signed.
        dim: header.dim.map(|extent| i64::from(extent as i16)),
        datatype: header.datatype,
        bitpix: header.bitpix,
        vox_offset: header.vox_offset.into(),
        scl_slope: header.scl_slope.into(),
        scl_inter: header.scl_inter.into(),
        xyzt_units: header.xyzt_units.into(),
        pixdim: header.pixdim.map(f64::from),
        qform_code: header.qform_code.into(),
        sform_code: header.sform_code.into(),
        quatern: [header.quatern_b, header.quatern_c, header.quatern_d].map(f64::from),
        qoffset: [header.quatern_x, header.quatern_y, header.quatern_z].map(f64::from),
        srow: [row(header.srow_x), row(header.srow_y), row(header.srow_z)],
        precision: f32::EPSILON.into(),
    })
}

fn version_2(source: &mut Source, is_big_endian: bool) -> Result<Fields, ReadError> {
    let mut bytes = [0_u8; N_BYTES_2];
    source.expect(N_BYTES_2 as u64)?;
    source.take(&mut bytes)?;
    let is_pair = match &bytes[4..12] {
        b"n+2\0\r\n\x1A\n" => false,
        b"ni2\0\r\n\x1A\n" => true,
        _ => return Err(not_nifti("a file whose magic is neither n+2 nor ni2")),
    };
    let fields = Reader { bytes: &bytes, is_big_endian };
    Ok(Fields {
        version: 2,
        is_big_endian,
        is_pair,
        n_header_bytes: N_BYTES_2 as u64,
        dim: std::array::from_fn(|i| fields.i64(16 + 8 * i)),
        datatype: fields.i16(12),
        bitpix: fields.i16(14),
        // Beyond 2⁵³ no file reaches.
        vox_offset: fields.i64(168) as f64,
        scl_slope: fields.f64(176),
        scl_inter: fields.f64(184),
        xyzt_units: fields.i32(500),
        pixdim: std::array::from_fn(|i| fields.f64(104 + 8 * i)),
        qform_code: fields.i32(344),
        sform_code: fields.i32(348),
        quatern: std::array::from_fn(|i| fields.f64(352 + 8 * i)),
        qoffset: std::array::from_fn(|i| fields.f64(376 + 8 * i)),
        srow: std::array::from_fn(|row| std::array::from_fn(|i| fields.f64(400 + 32 * row + 8 * i))),
        precision: f64::EPSILON,
    })
}

/// The numbers of a header at byte offsets.
struct Reader<'a> {
    bytes: &'a [u8; N_BYTES_2],
    is_big_endian: bool,
}

impl Reader<'_> {
    fn little<const N: usize>(&self, offset: usize) -> [u8; N] {
        let mut number = [0_u8; N];
        number.copy_from_slice(&self.bytes[offset..offset + N]);
        from_lowest(number, self.is_big_endian)
    }

    fn i16(&self, offset: usize) -> i16 {
        i16::from_le_bytes(self.little(offset))
    }

    fn i32(&self, offset: usize) -> i32 {
        i32::from_le_bytes(self.little(offset))
    }

    fn i64(&self, offset: usize) -> i64 {
        i64::from_le_bytes(self.little(offset))
    }

    fn f64(&self, offset: usize) -> f64 {
        f64::from_le_bytes(self.little(offset))
    }
}

fn not_nifti(what: &'static str) -> ReadError {
    let way_out = "write the file again with the program that made it".to_owned();
    ReadError::Format { what, way_out }
}
