//! NIfTI-1: header, place in the world, voxels.
//!
//! **Input** a path to a `.nii` or `.nii.gz` file. **Output** [`Stored`].
//! **Steps** 1. open, and decompress by content; 2. check the header; 3. compare the declared size with what the
//! file can hold; 4. place the volume in the world; 5. pass over what stands before the voxels.

mod affine;
mod header;

use std::path::Path;

use espalier_model::Report;
use header::{Header, N_HEADER_BYTES};

use crate::source::Source;
use crate::stored::{Stored, VoxelStream};
use crate::{ReadError, ReadOptions};

/// Some programs pad their files; nothing that is meant has as many bytes after the voxels.
const MAX_TRAILING_BYTES: u64 = 1 << 20;

/// Opens a NIfTI-1 file.
pub(crate) fn open(path: &Path, options: &ReadOptions, report: &mut Report) -> Result<Stored, ReadError> {
    let mut source = Source::open(path)?;
    let mut bytes = [0_u8; N_HEADER_BYTES];
    source.expect(N_HEADER_BYTES as u64)?;
    source.take(&mut bytes)?;
    let header = header::parse(&bytes, report).map_err(|error| source.damage().unwrap_or(error))?;
    let index = volume_index(header.n_volumes, options)?;
    let end = u128::from(header.volume_bytes()) * u128::from(header.n_volumes) + u128::from(header.offset);
    source.expect(u64::try_from(end).unwrap_or(u64::MAX))?;

    let unit_mm = options.unit_mm.unwrap_or_else(|| header_unit_mm(&header, report));
    let (world_from_voxel, form) =
        affine::world_from_voxel(&header.fields, header.shape, unit_mm, options.assume_space, report)?;

    let has_hidden_extension = skip_extensions(&mut source, &header)?;
    source.skip(index * header.volume_bytes())?;
    let n_after = (header.n_volumes - 1 - index) * header.volume_bytes();
    let stream = NiftiStream { source, n_after, offset: header.offset, has_hidden_extension };
    Ok(Stored {
        shape: header.shape,
        world_from_voxel,
        form,
        scalar: header.scalar,
        is_big_endian: header.is_big_endian,
        slope: header.slope,
        intercept: header.intercept,
        stream: Box::new(stream),
    })
}

/// Which volume of a series is read.
fn volume_index(n_volumes: u64, options: &ReadOptions) -> Result<u64, ReadError> {
    match options.volume_index {
        None if n_volumes == 1 => Ok(0),
        None => Err(ReadError::FourDimensional { n_volumes }),
        Some(index) if (index as u64) < n_volumes => Ok(index as u64),
        Some(index) => Err(ReadError::VolumeIndex { index, n_volumes }),
    }
}

/// Mm for one unit of the header's lengths: the three low bits of `xyzt_units`.
fn header_unit_mm(header: &Header, report: &mut Report) -> f64 {
    match header.fields.xyzt_units & 7 {
        1 => 1e3,
        2 => 1.0,
        3 => 1e-3,
        other => {
            let what = if other == 0 { "does not state" } else { "states an unknown" };
            report.warn("W-VOLUME-NO-UNITS", format!("the header {what} unit of length: taken as mm"));
            1.0
        }
    }
}

/// Passes over what stands between header and voxels; nothing in it is needed. Tells whether an extension is
/// announced although the voxels are said to follow at once.
fn skip_extensions(source: &mut Source, header: &Header) -> Result<bool, ReadError> {
    let mut flag = [0_u8; 4];
    source.take(&mut flag)?;
    let n_header_bytes = (N_HEADER_BYTES + flag.len()) as u64;
    source.skip(header.offset - n_header_bytes)?;
    Ok(flag[0] != 0 && header.offset == n_header_bytes)
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
        let n_trailing = self.source.drain(MAX_TRAILING_BYTES)?;
        if self.has_hidden_extension && n_trailing > 0 {
            // The voxels have been read from the middle of the extension.
            let (field, expected) = ("vox_offset", "room for the extension that the header announces");
            return Err(ReadError::Field { field, found: self.offset.to_string(), expected });
        }
        if n_trailing > 0 {
            report
                .warn("W-VOLUME-TRAILING", format!("{n_trailing} bytes follow the voxels and are not read"));
        }
        Ok(())
    }
}
