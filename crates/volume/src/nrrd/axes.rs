//! The axes of a NRRD volume: which are in space, and where they lie in the world.
//!
//! **Input** [`Header`]. **Output** [`Axes`]; `world_from_voxel`, RAS+ mm.
//! **Steps** 1. an axis is in space if it has a direction, or else by its kind, or else if there are at most three;
//! 2. the others make a series of volumes, inner ones (faster than space, so that volumes are interleaved) and outer
//! ones; 3. directions and origin, turned from the file's space to RAS+.
//! **Guarantees** three axes in space, of one block; counts of bytes do not overflow: what is too much for 64 bits
//! stays too much.

use espalier_model::Report;
use glam::{DAffine3, DMat3, DVec3};

use super::header::{Header, Space};
use crate::{ReadError, ReadOptions, text};

/// What is made of a header without a place.
const READINGS: &str = "its space is not one of right-anterior-superior, left-anterior-superior and \
                        left-posterior-superior";

/// More interleaved volumes than any file has; one voxel of each is held at a time.
const MAX_INTERLEAVED: u64 = 1 << 16;

/// The axes of a volume.
pub(super) struct Axes {
    /// Voxels along the axes in space.
    pub(super) shape: [usize; 3],
    /// Interleaved volumes.
    pub(super) n_inner: u64,
    /// Volumes one after another.
    pub(super) n_outer: u64,
    /// Bytes of one volume.
    pub(super) volume_bytes: u64,
    /// Bytes of all volumes.
    pub(super) data_bytes: u64,
    /// Which of the header's axes are in space; fewer than three where the rest have one voxel.
    in_space: Vec<usize>,
}

/// Tells the axes in space from the others.
pub(super) fn in_space(header: &Header) -> Result<Axes, ReadError> {
    let in_space = space_axes(header)?;
    let (first, last) = (in_space[0], in_space[in_space.len() - 1]);
    if last - first + 1 != in_space.len() {
        let found = format!("{in_space:?}, counted from 0");
        return Err(ReadError::Field {
            field: "axes in space",
            found,
            expected: "axes that follow each other",
        });
    }
    check_kinds(header, &in_space)?;
    let product = |sizes: &[u64]| sizes.iter().fold(1, |product: u64, &size| product.saturating_mul(size));
    let mut shape = [1; 3];
    for (extent, &axis) in shape.iter_mut().zip(&in_space) {
        *extent = usize::try_from(header.sizes[axis]).unwrap_or(usize::MAX);
    }
    let volume_bytes = product(&header.sizes[first..=last]).saturating_mul(header.scalar.file_bytes());
    let (n_inner, n_outer) = (product(&header.sizes[..first]), product(&header.sizes[last + 1..]));
    if n_inner > MAX_INTERLEAVED {
        let found = n_inner.to_string();
        return Err(ReadError::Field {
            field: "axes before those in space",
            found,
            expected: "at most 65536 voxels",
        });
    }
    let data_bytes = volume_bytes.saturating_mul(n_inner).saturating_mul(n_outer);
    Ok(Axes { shape, n_inner, n_outer, volume_bytes, data_bytes, in_space })
}

fn space_axes(header: &Header) -> Result<Vec<usize>, ReadError> {
    let n_axes = header.sizes.len();
    let is_in_space = |axis: usize| match &header.directions {
        Some(directions) => directions[axis].is_some(),
        None if header.kinds.is_empty() => n_axes <= 3,
        None => matches!(header.kinds[axis].as_str(), "domain" | "space"),
    };
    let axes: Vec<usize> = (0..n_axes).filter(|&axis| is_in_space(axis)).collect();
    let is_legal = if header.directions.is_some() { axes.len() == 3 } else { (1..=3).contains(&axes.len()) };
    if is_legal {
        return Ok(axes);
    }
    let found = format!("{} of {n_axes} axes", axes.len());
    Err(ReadError::Field { field: "axes in space", found, expected: "3, by space directions or kinds" })
}

/// Refuses axes that make several numbers one value.
fn check_kinds(header: &Header, in_space: &[usize]) -> Result<(), ReadError> {
    for (axis, kind) in header.kinds.iter().enumerate() {
        let is_series = matches!(
            kind.as_str(),
            "domain" | "space" | "time" | "list" | "point" | "stub" | "scalar" | "none" | "???"
        );
        if is_series || in_space.contains(&axis) || header.sizes[axis] == 1 {
            continue;
        }
        let what = match kind.as_str() {
            "complex" => "complex numbers",
            "rgb-color" | "hsv-color" | "xyz-color" | "rgba-color" | "3-color" | "4-color" => "colours",
            _ => "vectors or tensors",
        };
        return Err(ReadError::NotScalar { what, stated: format!("kind {kind}") });
    }
    Ok(())
}

/// The affine, and the name of the fields that it comes from.
pub(super) fn world_from_voxel(
    header: &Header,
    axes: &Axes,
    options: &ReadOptions,
    report: &mut Report,
) -> Result<(DAffine3, &'static str), ReadError> {
    let unit_mm = options.unit_mm.or_else(|| header.unit.as_deref().and_then(text::unit_mm)).unwrap_or(1.0);
    let steps = steps(header, axes);
    let lengths = DVec3::from_array(steps.map(|step| step.length())) * unit_mm;
    let signs = match (header.space, options.assume_space) {
        (Space::Body(space), _) => space.ras_signs(),
        (Space::Unknown, Some(space)) => {
            report.warn("W-VOLUME-ASSUMED-SPACE", "the header names no space of the body: it is as assumed");
            space.ras_signs()
        }
        (Space::Unknown, None) => return Err(ReadError::NoSpace { spacing_mm: lengths, readings: READINGS }),
    };
    if header.origin.is_none() && options.assume_space.is_none() {
        report.warn("W-NRRD-NO-ORIGIN", "the header has no space origin: the first voxel is put at 0, 0, 0");
    }
    let ras_mm = DMat3::from_diagonal(signs * unit_mm);
    let affine = DAffine3::from_cols(steps[0], steps[1], steps[2], header.origin.unwrap_or_default());
    let form = if header.directions.is_some() { "space directions" } else { "spacings" };
    Ok((DAffine3::from_mat3(ras_mm) * affine, form))
}

/// The step to the next voxel along each axis, in the file's space and unit.
fn steps(header: &Header, axes: &Axes) -> [DVec3; 3] {
    let unit = [DVec3::X, DVec3::Y, DVec3::Z];
    std::array::from_fn(|i| {
        let Some(&axis) = axes.in_space.get(i) else { return unit[i] };
        let direction = header.directions.as_ref().and_then(|directions| directions[axis]);
        let spacing = header.spacings.as_ref().map_or(1.0, |spacings| spacings[axis]);
        direction.unwrap_or(unit[i] * spacing)
    })
}
