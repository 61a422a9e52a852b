//! NRRD: header, axes, data.
//!
//! **Input** a `.nrrd` file, or the `.nhdr` header of a data file. **Output** [`Stored`].
//! **Steps** 1. read the header; 2. tell the three axes in space from the others, which make a series of volumes;
//! 3. place the volume in the world; 4. find the data, in this file or in another, and pass over what stands before;
//! 5. compare the declared size with what the file can hold.

mod axes;
mod header;

use std::path::Path;

use axes::Axes;
use espalier_model::Report;
use header::{Encoding, Header};

use crate::ascii::AsciiStream;
use crate::read::check_limit;
use crate::recognise::Format;
use crate::source::Source;
use crate::stored::{self, FileStream, Interleaved, Stored, VoxelStream};
use crate::text::Lines;
use crate::{ReadError, ReadOptions, detached};

/// Opens a NRRD file, whose stream stands at its beginning.
pub(crate) fn open(
    mut source: Source,
    path: &Path,
    options: &ReadOptions,
    report: &mut Report,
) -> Result<Stored, ReadError> {
    let header = header::parse(&mut source)?;
    drop(source);
    let axes = axes::in_space(&header)?;
    let index = stored::volume_index(axes.n_inner.saturating_mul(axes.n_outer), options)?;
    let data = open_data(path, &header, &axes, options)?;
    let (world_from_voxel, form) = axes::world_from_voxel(&header, &axes, options, report)?;
    Ok(Stored {
        format: Format::Nrrd,
        shape: axes.shape,
        world_from_voxel,
        form,
        scalar: header.scalar,
        is_big_endian: header.is_big_endian,
        slope: 1.0,
        intercept: 0.0,
        files: data.files(path),
        stream: stream(data, &header, &axes, index)?,
    })
}

/// The stream of the data of all volumes, at its first byte, large enough as far as can be told.
fn open_data(path: &Path, header: &Header, axes: &Axes, options: &ReadOptions) -> Result<Source, ReadError> {
    let mut source = at_data(path, header)?;
    if header.encoding == Encoding::Ascii {
        return Ok(source);
    }
    let n_before = match u64::try_from(header.byte_skip) {
        Ok(n_bytes) => n_bytes,
        Err(_) => {
            // What stands before the data is what its length leaves of the stream. To know that length a compressed one
            // is read through, but only if the data can be in it and one volume of it may be held.
            source.expect(source.position().saturating_add(axes.data_bytes))?;
            check_limit(axes.volume_bytes, options)?;
            let n_all = if source.is_compressed() {
                at_data(path, header)?.drain(axes.data_bytes.saturating_add(stored::MAX_TRAILING_BYTES))?
            } else {
                source.max_bytes() - source.position()
            };
            n_all.saturating_sub(axes.data_bytes)
        }
    };
    source.expect(source.position().saturating_add(n_before).saturating_add(axes.data_bytes))?;
    source.skip(n_before)?;
    Ok(source)
}

/// The stream that the header says the data is in, behind the lines that are to be skipped.
fn at_data(path: &Path, header: &Header) -> Result<Source, ReadError> {
    let mut source = match &header.data_file {
        None => {
            let mut source = Source::open(path)?;
            header::parse(&mut source)?;
            source
        }
        Some(written) => Source::open_detached_plain(&detached::data_file(path, written)?)?,
    };
    let mut lines = Lines::of(&mut source);
    for _ in 0..header.line_skip {
        if lines.next()?.is_none() {
            break;
        }
    }
    match header.encoding {
        Encoding::Packed(packing) => Ok(source.unpack(packing)),
        Encoding::Raw | Encoding::Ascii => Ok(source),
    }
}

/// The voxels of one volume of the series.
fn stream(
    mut source: Source,
    header: &Header,
    axes: &Axes,
    index: u64,
) -> Result<Box<dyn VoxelStream>, ReadError> {
    let (inner, outer) = (index % axes.n_inner, index / axes.n_inner);
    // Declared sizes may be absurd in a text; what is not there is missed when it is passed over.
    let block_bytes = axes.volume_bytes.saturating_mul(axes.n_inner);
    let n_before = outer.saturating_mul(block_bytes);
    let n_after = (axes.n_outer - 1 - outer).saturating_mul(block_bytes);
    let number_bytes = header.scalar.file_bytes();
    let all: Box<dyn VoxelStream> = if header.encoding == Encoding::Ascii {
        let mut numbers = AsciiStream::new(source, header.scalar, axes.data_bytes / number_bytes)?;
        numbers.skip(n_before / number_bytes)?;
        Box::new(numbers)
    } else {
        source.skip(n_before)?;
        // Compressed data has the size that is declared, or the header is another file's.
        let max_trailing = if source.is_compressed() { 0 } else { stored::MAX_TRAILING_BYTES };
        Box::new(FileStream { source, n_after, max_trailing })
    };
    Ok(if axes.n_inner == 1 {
        all
    } else {
        Box::new(Interleaved::new(all, number_bytes, axes.n_inner, inner))
    })
}
