//! DICOM: a folder of slices as one volume.
//!
//! | step | file |
//! |---|---|
//! | the elements of a file that are needed, and where its pixels begin | `element` |
//! | what a file is: a slice, something else, damaged | `header`, `syntax` |
//! | the series of a folder, and the one that is meant | `series` |
//! | slices in order: duplicates, gaps, uneven distances, tilt | `stack` |
//! | the numbers of one slice | `pixels`, `rle`, `codec` |
//! | one volume, its padding, its scaling | `assemble` |
//! | an irregular stack on an even grid | `resample` |
//!
//! **Input** a folder, or one file of a series. **Output** [`Assembled`].
//! **Guarantees** nothing of a header but geometry and intensities leaves this module, except for errors, which show a
//! series' number, kind and size and a file's own name; sizes are checked against file and limit before anything is
//! allocated or decoded.

mod assemble;
mod codec;
mod element;
mod error;
mod header;
mod pixels;
mod resample;
mod rle;
mod series;
mod stack;
mod syntax;

use std::path::{Path, PathBuf};

use espalier_model::Report;

pub(crate) use assemble::Assembled;
pub use error::{DicomError, Irregularity, Listed, Obstacle};

use crate::{ReadError, ReadOptions};
use series::Chosen;
use stack::Stack;

/// Whether a path is to be read as DICOM: a folder, or a file with DICOM's content.
pub(crate) fn is_dicom(path: &Path) -> Result<bool, ReadError> {
    let metadata = std::fs::metadata(path)?;
    Ok(metadata.is_dir() || (metadata.is_file() && header::is_dicom(path)?))
}

/// Whether a path is a folder with a file of DICOM in it, or in a folder below.
#[must_use]
pub fn is_dicom_folder(path: &Path) -> bool {
    let files = if path.is_dir() { series::list_files(path, true) } else { Ok(Vec::new()) };
    files.is_ok_and(|files| files.iter().any(|file| header::is_dicom(file).unwrap_or(false)))
}

/// Reads the series that `path` means.
pub(crate) fn read(path: &Path, options: &ReadOptions, report: &mut Report) -> Result<Assembled, ReadError> {
    let (stack, modality) = stack(path, options, report)?;
    warn_of_intensities(&stack, &modality, report);
    assemble::assemble((&stack, &modality), options, report)
}

/// The files of the series that `path` means, by position.
pub(crate) fn files(path: &Path, options: &ReadOptions) -> Result<Vec<PathBuf>, ReadError> {
    let (stack, _) = stack(path, options, &mut Report::default())?;
    Ok(stack.images.into_iter().map(|image| image.path).collect())
}

/// The slices in order, fit to be read.
fn stack(path: &Path, options: &ReadOptions, report: &mut Report) -> Result<(Stack, String), ReadError> {
    let Chosen { images, modality } = series::choose(path, options, report)?;
    let stack = stack::order(images, options.max_bytes)?;
    if stack.n_duplicates > 0 {
        let message = format!("{} images are copies of others and were left out", stack.n_duplicates);
        report.warn("W-DICOM-DUPLICATE", message);
    }
    if !stack.irregularity.is_none() && !options.resample {
        return Err(DicomError::Irregular(Box::new(stack.irregularity)).into());
    }
    Ok((stack, modality))
}

fn warn_of_intensities(stack: &Stack, modality: &str, report: &mut Report) {
    let n_slices = stack.images.len();
    let count = |is: fn(&header::Slice) -> bool| stack.images.iter().filter(|image| is(&image.slice)).count();
    let n_lossy = count(|slice| slice.is_lossy);
    if n_lossy > 0 {
        let message =
            format!("{n_lossy} of {n_slices} slices were compressed with losses: values are not exact");
        report.warn("W-DICOM-LOSSY", message);
    }
    if count(|slice| slice.is_inverted) > 0 {
        report.warn("W-DICOM-INVERTED", "large values are dark in this series; they were read as they are");
    }
    let n_unscaled = count(|slice| slice.slope == 1.0 && slice.intercept == 0.0);
    let is_unsigned = stack.images.iter().all(|image| !image.slice.stored.is_signed);
    if modality == "CT" && n_unscaled == n_slices && is_unsigned {
        report
            .warn("W-DICOM-NOT-HU", "the series states no scaling to HU, and its numbers cannot be below 0");
    }
}
