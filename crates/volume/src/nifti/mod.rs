//! NIfTI-1 and NIfTI-2: header, place in the world, voxels.
//!
//! **Input** a `.nii` file, or the `.hdr` or `.img` of a pair; each may be compressed. **Output** [`Stored`].
//! **Steps** 1. read the header and check it; 2. open the file that holds the voxels, which for a pair is another;
//! 3. compare the declared size with what it can hold; 4. place the volume in the world; 5. pass over what stands
//! before the voxels.

mod affine;
mod fields;
mod header;
mod pair;

use std::path::Path;

use espalier_model::Report;
use fields::Fields;
use header::Header;
pub(crate) use pair::header_of;

use crate::recognise::Format;
use crate::source::Source;
use crate::stored::{self, Stored, VoxelStream};
use crate::{ReadError, ReadOptions};

/// Opens a NIfTI file, whose stream stands at its beginning.
pub(crate) fn open(
    mut source: Source,
    path: &Path,
    options: &ReadOptions,
    report: &mut Report,
) -> Result<Stored, ReadError> {
    let parsed = parse(&mut source, report).map_err(|error| source.damage().unwrap_or(error))?;
    let (fields, header) = parsed;
    let index = stored::volume_index(header.n_volumes, options)?;
    if fields.is_pair {
        source.drain(stored::MAX_TRAILING_BYTES)?;
        source = pair::open_image(path)?;
    }
    source.expect(header.file_bytes)?;

    let unit_mm = options.unit_mm.unwrap_or_else(|| header_unit_mm(&fields, report));
    let (world_from_voxel, form) =
        affine::world_from_voxel(&fields, header.shape, unit_mm, options.assume_space, report)?;

    let has_hidden_extension = skip_to_voxels(&mut source, &fields, &header)?;
    source.skip(index * header.volume_bytes)?;
    let n_after = (header.n_volumes - 1 - index) * header.volume_bytes;
    Ok(Stored {
        format: Format::Nifti,
        shape: header.shape,
        world_from_voxel,
        form,
        scalar: header.scalar,
        is_big_endian: fields.is_big_endian,
        slope: header.slope,
        intercept: header.intercept,
        files: if fields.is_pair { source.files(path) } else { vec![path.to_owned()] },
        stream: Box::new(NiftiStream { source, n_after, offset: header.offset, has_hidden_extension }),
    })
}

fn parse(source: &mut Source, report: &mut Report) -> Result<(Fields, Header), ReadError> {
    let fields = fields::read(source)?;
    let header = header::check(&fields, report)?;
    Ok((fields, header))
}

/// Mm for one unit of the header's lengths: the three low bits of `xyzt_units`.
fn header_unit_mm(fields: &Fields, report: &mut Report) -> f64 {
    match fields.xyzt_units & 7 {
        1 => 1e3,
        2 => 1.0,
        3 => 1e-3,
        other => {
            let what = if other == 0 { "states no" } else { "states an unknown" };
            report.warn("W-VOLUME-NO-UNITS", format!("the header {what} unit of length: taken as mm"));
            1.0
        }
    }
}

/// Passes over what stands between header and voxels; nothing in it is needed. Tells whether an extension is
/// announced although the voxels are said to follow at once.
fn skip_to_voxels(source: &mut Source, fields: &Fields, header: &Header) -> Result<bool, ReadError> {
    if fields.is_pair {
        source.skip(header.offset)?;
        return Ok(false);
    }
    let mut flag = [0_u8; 4];
    source.take(&mut flag)?;
    source.skip(header.offset - source.position())?;
    Ok(flag[0] != 0 && header.offset == fields.n_header_bytes + flag.len() as u64)
}

/// The voxels of one volume of a NIfTI file.
struct NiftiStream {
    source: Source,
    /// Bytes of the volumes behind the one that is read.
    n_after: u64,
    offset: u64,
    has_hidden_extension: bool,
}

impl VoxelStream for NiftiStream {
    fn take(&mut self, buffer: &mut [u8]) -> Result<(), ReadError> {
        self.source.take(buffer)
    }

    fn finish(&mut self, report: &mut Report) -> Result<(), ReadError> {
        self.source.skip(self.n_after)?;
        let n_trailing = stored::finish(&mut self.source, stored::MAX_TRAILING_BYTES, report)?;
        if self.has_hidden_extension && n_trailing > 0 {
            // The voxels have been read from the middle of the extension.
            let (field, expected) = ("vox_offset", "room for the extension that the header announces");
            return Err(ReadError::Field { field, found: self.offset.to_string(), expected });
        }
        Ok(())
    }
}
