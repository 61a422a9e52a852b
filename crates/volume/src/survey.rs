//! What a file is, for somebody who has not decided yet what to do with it.
//!
//! **Input** a path to a volume file or a DICOM folder. **Output** [`Survey`].
//! **Steps** 1. the header; 2. one pass over the values, which tells a mask from labels and scans and keeps one bit a
//! voxel; 3. of a mask its components and its Euler number.
//! **Guarantees** as [`read`]; straight from the file, memory is one bit a voxel.
//! **Cost** one pass over the file; a second for a mask that does not begin with its background.

use std::path::Path;

use espalier_model::{Bits, Grid, Report, Volume, Voxels};

use crate::euler::euler_number;
use crate::kind::Census;
use crate::read::{check_limit, count_grid, orthogonal_grid};
use crate::runs::{Connectivity, Runs};
use crate::scalar::Scalar;
use crate::stored::Stored;
use crate::{Error, Kind, ReadOptions, dicom, read, stream};

/// What a volume file is.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// `NIfTI`, `NRRD`, `MetaImage` or `DICOM`.
    pub format: &'static str,
    /// What of the header places the volume.
    pub placed_by: &'static str,
    /// How many files it is made of.
    pub n_files: usize,
    /// The type of the stored numbers, such as `int16`.
    pub scalar: &'static str,
    /// A value is slope · stored + intercept.
    pub scaling: (f64, f64),
    /// The voxels in the world; where the file's axes are sheared, those that it is resampled to.
    pub grid: Grid,
    /// What it is by its values.
    pub kind: Kind,
    /// The smallest and the largest finite value; infinite where there is none.
    pub range: (f64, f64),
    /// Whether there are values that are not finite.
    pub has_not_finite: bool,
    /// Of a mask what its voxels are.
    pub mask: Option<MaskSurvey>,
    /// Counts and warnings of the reader.
    pub report: Report,
}

/// What the voxels of a mask are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaskSurvey {
    /// Voxels of the foreground.
    pub n_foreground: usize,
    /// Its 26-connected components.
    pub n_components: usize,
    /// Voxels of the largest of them.
    pub n_largest: usize,
    /// Components − tunnels + cavities.
    pub euler_number: i64,
    /// Voxels along x, y, z of the box around the foreground.
    pub extent: [usize; 3],
    /// Whether foreground touches the border of the volume.
    pub touches_border: bool,
}

/// Tells what a volume file is.
///
/// # Errors
/// As [`read`].
pub fn survey(path: &Path, options: &ReadOptions) -> Result<Survey, Error> {
    let named = |problem| Error::Read { problem, path: path.to_owned() };
    if dicom::is_dicom(path).map_err(named)? {
        let n_files = dicom::files(path, options).map_err(named)?.len();
        let header = Header { format: "DICOM", placed_by: "position and orientation of the slices", n_files };
        return survey_whole(path, options, header);
    }
    let mut report = Report::default();
    let mut stored = Stored::open(path, options, &mut report).map_err(named)?;
    let header = Header { format: stored.format.name(), placed_by: stored.form, n_files: stored.files.len() };
    let Some(grid) = orthogonal_grid(&stored, options).map_err(named)? else {
        // Sheared: a run has it resampled to orthogonal axes.
        return survey_whole(path, options, header);
    };
    let (scalar, scaling) = (name_of(stored.scalar), (stored.slope, stored.intercept));
    check_limit(stored.bits_bytes(), options).map_err(named)?;
    let inspected = stream::inspect(&mut stored, &mut report).map_err(named)?;
    let kind = inspected.census.kind();
    let mask = match kind {
        Kind::Mask { background, .. } if inspected.is_exact && inspected.first == background => {
            Some(inspected.bits)
        }
        Kind::Mask { foreground, .. } => {
            let mut again = Stored::open(path, options, &mut Report::default()).map_err(named)?;
            let is_wanted = |value: f64| value == foreground;
            Some(stream::choose(&mut again, is_wanted, &mut Report::default()).map_err(named)?)
        }
        _ => None,
    };
    count_grid(&grid, &mut report);
    let Census { min, max, has_other, .. } = inspected.census;
    let mask = mask.map(|bits| survey_mask(&bits));
    Ok(header.survey((grid, kind), (scalar, scaling), ((min, max), has_other), mask, report))
}

/// What the header tells.
struct Header {
    format: &'static str,
    placed_by: &'static str,
    n_files: usize,
}

impl Header {
    fn survey(
        self,
        (grid, kind): (Grid, Kind),
        (scalar, scaling): (&'static str, (f64, f64)),
        (range, has_not_finite): ((f64, f64), bool),
        mask: Option<MaskSurvey>,
        report: Report,
    ) -> Survey {
        let Self { format, placed_by, n_files } = self;
        Survey {
            format,
            placed_by,
            n_files,
            scalar,
            scaling,
            grid,
            kind,
            range,
            has_not_finite,
            mask,
            report,
        }
    }
}

/// The same by way of the whole volume.
fn survey_whole(path: &Path, options: &ReadOptions, header: Header) -> Result<Survey, Error> {
    let loaded = read(path, options)?;
    let volume = &loaded.volume;
    let mut census = Census::default();
    volume.for_each_value(|value| census.see(value));
    let kind = census.kind();
    let mask = if let Kind::Mask { foreground, .. } = kind {
        Some(survey_mask(&bits_of(volume, foreground)))
    } else {
        None
    };
    let scalar = (name_of_voxels(volume.voxels()), volume.scaling());
    let values = ((census.min, census.max), census.has_other);
    Ok(header.survey((volume.grid().clone(), kind), scalar, values, mask, loaded.report))
}

fn bits_of(volume: &Volume, foreground: f64) -> Bits {
    let (grid, mut index) = (volume.grid(), 0);
    let mut bits = Bits::new(grid.shape());
    volume.for_each_value(|value| {
        if value == foreground {
            bits.set(grid.voxel(index));
        }
        index += 1;
    });
    bits
}

fn survey_mask(bits: &Bits) -> MaskSurvey {
    let runs = Runs::cut(bits);
    let components = runs.components(Connectivity::All);
    let mut sizes = vec![0; components.n_components];
    for (run, component) in runs.all().iter().zip(&components.of_run) {
        sizes[*component] += run.len();
    }
    let (shape, bounds) = (bits.shape(), bits.bounding_box());
    let extent = bounds.map_or([0; 3], |(first, last)| [0, 1, 2].map(|axis| last[axis] + 1 - first[axis]));
    let touches = |(first, last): ([usize; 3], [usize; 3])| {
        (0..3).any(|axis| first[axis] == 0 || last[axis] + 1 == shape[axis])
    };
    MaskSurvey {
        n_foreground: bits.count(),
        n_components: components.n_components,
        n_largest: sizes.into_iter().max().unwrap_or(0),
        euler_number: euler_number(bits),
        extent,
        touches_border: bounds.is_some_and(touches),
    }
}

fn name_of(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::U8 => "uint8",
        Scalar::I8 => "int8",
        Scalar::I16 => "int16",
        Scalar::U16 => "uint16",
        Scalar::I32 => "int32",
        Scalar::U32 => "uint32",
        Scalar::I64 => "int64",
        Scalar::U64 => "uint64",
        Scalar::F32 => "float32",
        Scalar::F64 => "float64",
    }
}

/// The type of numbers that are in memory.
fn name_of_voxels(voxels: &Voxels) -> &'static str {
    match voxels {
        Voxels::U8(_) => "uint8",
        Voxels::I16(_) => "int16",
        Voxels::U16(_) => "uint16",
        Voxels::I32(_) => "int32",
        Voxels::U32(_) => "uint32",
        Voxels::F32(_) => "float32",
        Voxels::F64(_) => "float64",
    }
}

#[cfg(test)]
#[allow(clippy::expect_used, reason = "a test says what it expects")]
mod tests {
    use std::fs;

    use super::*;

    /// What a MetaImage of 5 x 5 x 1 bytes is.
    fn surveyed(voxels: &[u8; 25]) -> Survey {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("image.mha");
        let header = "ObjectType = Image\nNDims = 3\nDimSize = 5 5 1\nElementSpacing = 1 2 3\n\
                      ElementType = MET_UCHAR\nElementDataFile = LOCAL\n";
        fs::write(&path, [header.as_bytes(), voxels].concat()).expect("write");
        survey(&path, &ReadOptions::default()).expect("a survey")
    }

    #[test]
    fn a_ring_and_a_dot() {
        #[rustfmt::skip]
        let voxels = [
            0, 1, 1, 1, 0,
            0, 1, 0, 1, 0,
            0, 1, 1, 1, 0,
            0, 0, 0, 0, 0,
            0, 0, 1, 0, 0,
        ];
        let expected = MaskSurvey {
            n_foreground: 9,
            n_components: 2,
            n_largest: 8,
            euler_number: 1,
            extent: [3, 5, 1],
            touches_border: true,
        };
        let found = surveyed(&voxels);
        assert_eq!((found.format, found.scalar, found.n_files), ("MetaImage", "uint8", 1));
        assert_eq!(found.mask, Some(expected));
        // The first voxel is foreground, and the background is not.
        let swapped = surveyed(&voxels.map(|voxel| if voxel == 0 { 7 } else { 9 }));
        assert_eq!((swapped.mask, swapped.range), (Some(expected), (7.0, 9.0)));
        let mut corner = voxels;
        corner[0] = 1;
        let first_in = surveyed(&corner).mask.expect("a mask");
        assert_eq!((first_in.n_foreground, first_in.n_components), (10, 2));
    }

    #[test]
    fn what_is_no_mask() {
        let mut voxels = [0; 25];
        (voxels[3], voxels[9]) = (1, 2);
        assert_eq!(surveyed(&voxels).kind, Kind::Labels { values: vec![0.0, 1.0, 2.0] });
        assert_eq!(surveyed(&[3; 25]).kind, Kind::Constant { value: 3.0 });
        assert_eq!(surveyed(&voxels).mask, None);
    }
}
