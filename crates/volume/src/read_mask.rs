//! File → [`Mask`].
//!
//! **Input** a path to a volume file, and [`Params`]. **Output** [`Segmented`], whose report begins with the reader's.
//! **Steps** 1. where the choice depends on each value alone, the bits of the voxels straight from the file, and what
//! kind of volume it is; 2. else, for DICOM slices, or where sheared axes must be made orthogonal, the whole volume;
//! 3. what [`segment`](crate::segment) does then.
//! **Guarantees** the same result as [`read`] and [`segment`](crate::segment); straight from the file, memory is the bits.
//! **Cost** one pass over the file; a second one for a mask of which some values are not finite, and for a volume of
//! more than two values that is to be taken for a mask but does not begin with 0.

use std::path::Path;

use espalier_model::{Bits, Mask, Report};

use crate::dicom;
use crate::read::{check_limit, count_grid, orthogonal_grid};
use crate::segment::{segment_selection, segment_within};
use crate::select::{MASK, Selection, Wish, background, is_in_mask, needs_preset, wish};
use crate::stored::Stored;
use crate::stream::{self, Inspected};
use crate::{Error, Kind, Method, Params, ReadError, ReadOptions, Segmented, read};

/// Reads the volume in a file and makes a mask of it.
///
/// # Errors
/// As [`read`] and [`segment`](crate::segment).
pub fn read_mask(path: &Path, options: &ReadOptions, params: &Params) -> Result<Segmented, Error> {
    params.validate()?;
    let file = File { path, options };
    if file.named(dicom::is_dicom(path))? {
        return file.segment_whole(params);
    }
    let mut report = Report::default();
    let mut stored = file.open(&mut report)?;
    let grid = file.named(orthogonal_grid(&stored, options))?;
    let selection = match grid {
        Some(_) => file.select(&mut stored, params, &mut report)?,
        None => None,
    };
    let (Some(selection), Some(grid)) = (selection, grid) else {
        return file.segment_whole(params);
    };
    count_grid(&grid, &mut report);
    let segmented = segment_selection(selection, &grid, (params, options.max_bytes), || {
        let mut stored = file.open(&mut Report::default())?;
        let census = file.named(stream::inspect(&mut stored, &mut Report::default()))?.census;
        Ok((census.min, census.max))
    })?;
    Ok(after(report, segmented))
}

/// Reads which voxels of a file are not 0: a mask as it was handed on, of which nothing is chosen or cleaned.
///
/// # Errors
/// As [`read`].
pub fn read_nonzero(path: &Path, options: &ReadOptions) -> Result<Mask, Error> {
    let file = File { path, options };
    let whole = || {
        let volume = read(path, options)?.volume;
        Ok(Mask::from_voxels(volume.grid().clone(), &volume.map_values(|value| value != 0.0)))
    };
    if file.named(dicom::is_dicom(path))? {
        return whole();
    }
    let mut report = Report::default();
    let mut stored = file.open(&mut report)?;
    let Some(grid) = file.named(orthogonal_grid(&stored, options))? else { return whole() };
    file.named(check_limit(stored.bits_bytes(), options))?;
    let bits = file.named(stream::choose(&mut stored, |value| value != 0.0, &mut report))?;
    Ok(Mask::new(grid, bits))
}

/// The segmented with the reader's report before its own.
fn after(mut report: Report, segmented: Segmented) -> Segmented {
    report.extend(segmented.report);
    Segmented { report, ..segmented }
}

/// A volume file, to be read once or twice.
struct File<'a> {
    path: &'a Path,
    options: &'a ReadOptions,
}

impl File<'_> {
    fn open(&self, report: &mut Report) -> Result<Stored, Error> {
        self.named(Stored::open(self.path, self.options, report))
    }

    fn segment_whole(&self, params: &Params) -> Result<Segmented, Error> {
        let loaded = read(self.path, self.options)?;
        let segmented = segment_within(&loaded.volume, params, self.options.max_bytes)?;
        Ok(after(loaded.report, segmented))
    }

    fn named<T>(&self, result: Result<T, ReadError>) -> Result<T, Error> {
        result.map_err(|problem| Error::Read { problem, path: self.path.to_owned() })
    }

    /// The chosen voxels; none if the whole volume is needed to choose them.
    fn select(
        &self,
        stored: &mut Stored,
        params: &Params,
        report: &mut Report,
    ) -> Result<Option<Selection>, Error> {
        match wish(params) {
            Wish::Names(_) | Wish::Region => Ok(None),
            // A scan is resampled before voxels are chosen.
            Wish::Values { .. } if params.method == Method::Threshold && params.resample_mm.is_some() => {
                Ok(None)
            }
            Wish::Values { is_wanted, what } => {
                self.named(check_limit(stored.bits_bytes(), self.options))?;
                let bits = self.named(stream::choose(stored, is_wanted, report))?;
                let is_of_scan = params.method == Method::Threshold;
                Ok(Some(Selection { is_of_scan, ..Selection::of(bits, what) }))
            }
            Wish::Kind => {
                self.named(check_limit(stored.bits_bytes(), self.options))?;
                let bits = self.mask_bits(stored, params, report)?;
                Ok(bits.map(|bits| Selection::of(bits, MASK)))
            }
        }
    }

    /// The voxels that are not background, in a volume that says itself which those are; none for a scan with a
    /// preset.
    fn mask_bits(
        &self,
        stored: &mut Stored,
        params: &Params,
        report: &mut Report,
    ) -> Result<Option<Bits>, Error> {
        let Inspected { census, mut bits, first, is_exact } = self.named(stream::inspect(stored, report))?;
        let kind = census.kind();
        if params.preset.is_some() && needs_preset(&kind, params.method) {
            return Ok(None);
        }
        let has_two_values = matches!(kind, Kind::Mask { .. });
        let background = background(kind, params.method)?;
        if is_exact && first == background {
            return Ok(Some(bits));
        }
        if is_exact && has_two_values {
            invert(&mut bits);
            return Ok(Some(bits));
        }
        let mut again = self.open(&mut Report::default())?;
        self.named(stream::choose(&mut again, is_in_mask(background), &mut Report::default())).map(Some)
    }
}

/// Turns ones to zeros and zeros to ones.
fn invert(bits: &mut Bits) {
    let n_beyond = bits.words_per_row() * 64 - bits.shape()[0];
    for row in 0..bits.n_rows() {
        let words = bits.row_mut(row);
        words.iter_mut().for_each(|word| *word = !*word);
        if let Some(last) = words.last_mut() {
            *last &= u64::MAX >> n_beyond;
        }
    }
}
