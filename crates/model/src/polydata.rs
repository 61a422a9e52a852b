//! Polylines with radii from VTK files: centrelines of VMTK and 3D Slicer, and our own `tree.vtp`.
//!
//! | step | file |
//! |---|---|
//! | XML (`.vtp`): ascii, base 64, appended; zlib | `xml`, `encoded` |
//! | legacy (`.vtk`): ascii, binary | `legacy` |
//! | arrays → points, radii, lines | here |
//!
//! **Input** bytes, and how the file's numbers become mm. **Output** [`Polylines`].
//! **Steps** 1. the format by its first bytes; 2. its arrays; 3. radii by their array's name; 4. the space that the file
//! states, or else the one that the caller names; 5. RAS+ mm.
//! **Guarantees** those of [`Polylines`]; all that is made of a file, its text included, is within the memory that the
//! caller allows, checked before it is made; no recursion; no byte makes it panic.
//! **Source** "VTK File Formats", docs.vtk.org; VMTK's documentation for the names of its arrays.

mod encoded;
mod error;
mod legacy;
mod xml;

use std::cell::Cell;

use glam::DVec3;

pub use error::PolydataError;

use crate::swc::SwcScale;
use crate::{MAX_MM, RAS_FROM_LPS, Report};

/// The names of radius arrays, best first: VMTK's, ours, and what others write.
const RADIUS_NAMES: [&str; 4] = ["MaximumInscribedSphereRadius", "radius_mm", "Radius", "radius"];

/// What a number takes while a file is read, at most: in its own array, in that of all pieces, and in a point, a radius or
/// a line.
const BYTES_OF_NUMBER: u64 = 32;
/// What a line takes beside its points, in numbers.
const NUMBERS_OF_LINE: usize = 3;

/// Lines through points that have radii.
///
/// **Guarantees** at least one line of at least two points; each line's points are there; numbers are finite; radii are
/// at least 0, and as many as points.
#[derive(Clone, Debug, PartialEq)]
pub struct Polylines {
    /// RAS+ mm.
    pub points_mm: Vec<DVec3>,
    /// Of each point, in mm; 0 where the file has none.
    pub radii_mm: Vec<f64>,
    /// The lines, in the file's order.
    pub lines: Vec<Polyline>,
}

/// A line through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyline {
    /// Indices of its points.
    pub points: Vec<usize>,
    /// VMTK's `CenterlineIds` and `TractIds`: which centreline this is a piece of, and which piece.
    pub tract: Option<(i64, i64)>,
}

/// The axes of the space that points are given in: for each of x, y, z 1 where it points along R, A or S.
pub type RasSigns = DVec3;

/// Whether bytes begin like a VTK file.
#[must_use]
pub fn is_polydata(bytes: &[u8]) -> bool {
    let start = bytes[..bytes.len().min(1024)].trim_ascii_start();
    start.starts_with(b"# vtk DataFile")
        || start.starts_with(b"<VTKFile")
        || (start.starts_with(b"<?xml") && start.windows(8).any(|word| word == b"<VTKFile"))
}

/// How many more numbers may be made of a file.
#[derive(Debug)]
pub(crate) struct Budget {
    n_left: Cell<usize>,
    limit: u64,
}

impl Budget {
    /// What the memory of `max_bytes` leaves beside a file's bytes and their text.
    fn of(max_bytes: u64, n_file: usize) -> Self {
        let left = max_bytes.saturating_sub(2 * n_file as u64);
        Self { n_left: Cell::new((left / BYTES_OF_NUMBER) as usize), limit: max_bytes }
    }

    /// Takes so many numbers off what is left.
    fn spend(&self, n_numbers: usize) -> Result<(), PolydataError> {
        let n_left = self.n_left.get().checked_sub(n_numbers);
        self.n_left.set(n_left.ok_or(PolydataError::TooLarge { limit: self.limit })?);
        Ok(())
    }
}

/// What both formats come to.
#[derive(Debug, Default)]
pub(crate) struct Dataset {
    /// Three numbers for each point.
    pub(crate) points: Vec<f64>,
    /// Points of each line.
    pub(crate) lines: Vec<Vec<usize>>,
    /// How many cells there are before the lines in the arrays of cells.
    pub(crate) n_cells_before: usize,
    /// How many cells there are that are no lines.
    pub(crate) n_other_cells: usize,
    /// Numbers for each point, one each, by name.
    pub(crate) point_arrays: Vec<(String, Vec<f64>)>,
    /// Numbers for each cell.
    pub(crate) cell_arrays: Vec<(String, Vec<f64>)>,
    /// `RAS` or `LPS`, if the file says so.
    pub(crate) space: Option<String>,
    /// What of the file was not read.
    pub(crate) unread: Option<String>,
}

/// Reads the bytes of a VTK file of lines. `scale` is mm for a step in the file's coordinates, as they stand there;
/// `assumed` is the space of a file that does not name it; `max_bytes` is the memory that may be taken.
///
/// # Errors
/// [`PolydataError`] with the place.
pub fn parse(
    bytes: &[u8],
    scale: &SwcScale,
    assumed: Option<RasSigns>,
    max_bytes: u64,
) -> Result<(Polylines, Report), PolydataError> {
    let start = bytes.trim_ascii_start();
    let budget = Budget::of(max_bytes, bytes.len());
    let dataset = if start.starts_with(b"# vtk DataFile") {
        legacy::parse(start, &budget)?
    } else {
        xml::parse(bytes, &budget)?
    };
    let mut report = Report::default();
    if let Some(place) = &dataset.unread {
        report.warn("W-POLYDATA-UNREAD", format!("what follows {place} is not read"));
    }
    let signs = match dataset.space.as_deref() {
        Some("RAS") => DVec3::ONE,
        Some("LPS") => RAS_FROM_LPS,
        _ => assumed.ok_or(PolydataError::NoSpace)?,
    };
    let points_mm = points(&dataset, scale.position_mm * signs)?;
    let radii_mm = radii(&dataset, points_mm.len(), scale.radius_mm, &mut report)?;
    let lines = lines(&dataset, points_mm.len())?;
    report.count_usize("points", points_mm.len());
    report.count_usize("lines", lines.len());
    Ok((Polylines { points_mm, radii_mm, lines }, report))
}

fn points(dataset: &Dataset, scale: DVec3) -> Result<Vec<DVec3>, PolydataError> {
    let point = |(index, numbers): (usize, &[f64; 3])| {
        let position = DVec3::from_array(*numbers) * scale;
        let is_legal = position.is_finite() && position.abs().max_element() <= MAX_MM;
        // Adding zero turns a negative zero into a plain one.
        if is_legal { Ok(position + DVec3::ZERO) } else { Err(PolydataError::Point { index }) }
    };
    dataset.points.as_chunks::<3>().0.iter().enumerate().map(point).collect()
}

fn radii(
    dataset: &Dataset,
    n_points: usize,
    scale_mm: f64,
    report: &mut Report,
) -> Result<Vec<f64>, PolydataError> {
    let named = |name: &&str| dataset.point_arrays.iter().find(|(known, _)| known == name);
    let Some((name, numbers)) = RADIUS_NAMES.iter().find_map(named) else {
        report.warn("W-POLYDATA-NO-RADIUS", "the points have no radius: there is no array of that name");
        return Ok(vec![0.0; n_points]);
    };
    if numbers.len() != n_points {
        let (name, found) = (name.clone(), numbers.len());
        return Err(PolydataError::Count { what: name, found, expected: n_points });
    }
    let radius = |(index, &number): (usize, &f64)| {
        let radius_mm = number * scale_mm;
        if radius_mm.is_finite() && radius_mm <= MAX_MM {
            Ok(radius_mm.max(0.0))
        } else {
            Err(PolydataError::Point { index })
        }
    };
    numbers.iter().enumerate().map(radius).collect()
}

fn lines(dataset: &Dataset, n_points: usize) -> Result<Vec<Polyline>, PolydataError> {
    let ids = |name: &str| dataset.cell_arrays.iter().find(|(known, _)| known == name).map(|(_, ids)| ids);
    let (centrelines, tracts) = (ids("CenterlineIds"), ids("TractIds"));
    let mut lines = Vec::with_capacity(dataset.lines.len());
    for (index, points) in dataset.lines.iter().enumerate() {
        if let Some(&point) = points.iter().find(|&&point| point >= n_points) {
            return Err(PolydataError::MissingPoint { line: index, point, n_points });
        }
        let cell = dataset.n_cells_before + index;
        let id = |ids: Option<&Vec<f64>>| ids.and_then(|ids| ids.get(cell)).map(|&id| id as i64);
        let tract = id(centrelines).zip(id(tracts));
        if points.len() >= 2 {
            lines.push(Polyline { points: points.clone(), tract });
        }
    }
    if lines.is_empty() {
        return Err(PolydataError::NoLines { n_other_cells: dataset.n_other_cells });
    }
    Ok(lines)
}
