//! What a DICOM file is: a slice that can be stacked, something else, or damaged.
//!
//! **Input** a path. **Output** [`Object`].
//! **Steps** 1. the first bytes of the file, and more of them as long as the pixels are not reached; 2. its elements;
//! 3. each field that a slice needs, checked.
//! **Guarantees** at most the limit is read into memory, by all threads together but for small files; what is kept is geometry and how intensities are stored,
//! and the identifiers by which files are told to belong together, which are only ever compared.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use flate2::read::DeflateDecoder;
use glam::DVec3;

use super::element::{self as tag, Elements, Fault, PixelPlace, read_elements, read_meta};
use super::error::Obstacle;
use super::syntax::Syntax;

/// The first bytes that are read of a file; most headers are shorter.
const FIRST_BYTES: u64 = 64 << 10;
/// By how much more is read each time.
const GROWTH: u64 = 8;
/// Orthonormal axes may be off by this: directions are written with few decimals.
const MAX_AXIS_ERROR: f64 = 1e-3;

/// No scanner is as large: 1 km.
const MAX_POSITION_MM: f64 = 1e6;

/// A file of DICOM that is an image.
#[derive(Clone, Debug)]
pub(super) struct Object {
    pub(super) path: PathBuf,
    /// Which series it belongs to; empty where it does not say.
    pub(super) series_uid: String,
    pub(super) series_number: Option<i64>,
    pub(super) modality: String,
    /// Pixels along x and y.
    pub(super) size: [usize; 2],
    /// What a slice needs, or why it is none.
    pub(super) slice: Result<Slice, Obstacle>,
}

/// One image of one slice through the body.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Slice {
    /// The centre of its first pixel, LPS+ mm.
    pub(super) position: DVec3,
    /// Unit vectors along which x (columns) and y (rows) count up, LPS+.
    pub(super) axes: [DVec3; 2],
    /// The distances between pixels along x and y, in mm.
    pub(super) spacing: [f64; 2],
    pub(super) stored: StoredPixels,
    pub(super) slope: f64,
    pub(super) intercept: f64,
    /// The stored values, from one to the other, that mean "not measured".
    pub(super) padding: Option<(i32, i32)>,
    /// Acquisition, echo and time, by which images of one place are told apart.
    pub(super) phases: [Option<String>; 3],
    pub(super) is_localizer: bool,
    /// Whether large values are dark.
    pub(super) is_inverted: bool,
    pub(super) is_lossy: bool,
}

/// How the pixels lie in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct StoredPixels {
    pub(super) syntax: Syntax,
    /// In the file; in the inflated data set where that is deflated.
    pub(super) place: PixelPlace,
    pub(super) size: [usize; 2],
    /// 8 or 16.
    pub(super) bits_allocated: u32,
    /// From 1 to `bits_allocated`.
    pub(super) bits_stored: u32,
    /// The lowest bit of a value in its cell.
    pub(super) low_bit: u32,
    pub(super) is_signed: bool,
}

impl StoredPixels {
    pub(super) fn n_pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The bytes of an image that is not compressed.
    pub(super) fn n_bytes(&self) -> usize {
        self.n_pixels() * (self.bits_allocated / 8) as usize
    }
}

/// What a file turned out to be.
pub(super) enum Found {
    /// Not DICOM at all.
    Other,
    /// DICOM without pixels: a report, a plan, a directory.
    NoImage,
    Image(Box<Object>),
}

/// Looks at one file. What takes more than a few bytes waits at the gate for its turn, so that files looked at side by
/// side do not take the limit each.
pub(super) fn inspect(path: &Path, max_bytes: u64, gate: &Mutex<()>) -> std::io::Result<Found> {
    let mut turn = None;
    let mut file = File::open(path)?;
    let n_file = file.metadata()?.len();
    let mut bytes = Vec::new();
    loop {
        let n_wanted = (bytes.len() as u64 * GROWTH).max(FIRST_BYTES).min(n_file);
        if !bytes.is_empty() {
            turn.get_or_insert_with(|| gate.lock().unwrap_or_else(PoisonError::into_inner));
        }
        (&mut file).take(n_wanted - bytes.len() as u64).read_to_end(&mut bytes)?;
        if !tag::looks_like_dicom(&bytes) {
            return Ok(Found::Other);
        }
        let is_whole = bytes.len() as u64 >= n_file || (bytes.len() as u64) < n_wanted;
        if is_whole && read_meta(&bytes).syntax.is_some_and(|uid| Syntax::of_uid(&uid) == Syntax::Deflated) {
            turn.get_or_insert_with(|| gate.lock().unwrap_or_else(PoisonError::into_inner));
        }
        let data_set = read_data_set(&bytes, max_bytes, is_whole);
        let is_short = data_set.elements.fault == Some(Fault::Short);
        if is_whole || !is_short || n_wanted.saturating_mul(GROWTH) > max_bytes {
            return Ok(found(path, &data_set, n_file));
        }
    }
}

/// Whether a file is DICOM, by its first bytes.
pub(super) fn is_dicom(path: &Path) -> std::io::Result<bool> {
    let mut start = Vec::new();
    File::open(path)?.take(132).read_to_end(&mut start)?;
    Ok(tag::looks_like_dicom(&start))
}

/// The elements of a data set, and how its pixels are written.
struct DataSet {
    elements: Elements,
    syntax: Syntax,
    /// The length of the inflated data set, where it is deflated.
    n_inflated: Option<u64>,
}

fn read_data_set(bytes: &[u8], max_bytes: u64, is_whole: bool) -> DataSet {
    let meta = read_meta(bytes);
    let syntax = meta.syntax.as_deref().map_or(Syntax::Native { is_big_endian: false }, Syntax::of_uid);
    if syntax == Syntax::Deflated {
        // Half a stream says nothing of the rest, so the file is read whole first.
        let inflated = if is_whole { inflate(&bytes[meta.end..], max_bytes) } else { Vec::new() };
        let mut elements = read_elements(&inflated, 0, false);
        if !is_whole {
            elements.fault = Some(Fault::Short);
        }
        return DataSet { elements, syntax, n_inflated: Some(inflated.len() as u64) };
    }
    let is_big_endian = syntax == Syntax::Native { is_big_endian: true };
    let elements = read_elements(bytes, meta.end, is_big_endian);
    // Without a meta group the elements tell the byte order.
    let syntax = match syntax {
        Syntax::Native { .. } => Syntax::Native { is_big_endian: elements.encoding.is_big_endian },
        other => other,
    };
    DataSet { elements, syntax, n_inflated: None }
}

/// A deflated data set, as far as it goes and the limit allows.
fn inflate(deflated: &[u8], max_bytes: u64) -> Vec<u8> {
    let mut inflated = Vec::new();
    // What came out before damage stands; the walk over it says where it ends.
    let _ = DeflateDecoder::new(deflated).take(max_bytes).read_to_end(&mut inflated);
    inflated
}

fn found(path: &Path, data_set: &DataSet, n_file: u64) -> Found {
    let elements = &data_set.elements;
    let is_image = elements.pixels.is_some() || elements.has_float_pixels;
    let has_size = elements.short(tag::ROWS).is_some();
    if elements.fault.is_none() && !(is_image && has_size) {
        return Found::NoImage;
    }
    let slice = match elements.fault {
        Some(Fault::Short) => Err(Obstacle::Damaged { what: "it is cut short in its header" }),
        Some(Fault::Malformed(what)) => Err(Obstacle::Damaged { what }),
        None => slice_of(data_set, n_file),
    };
    let is_letter = |c: &char| c.is_ascii_uppercase() || c.is_ascii_digit();
    Found::Image(Box::new(Object {
        path: path.to_owned(),
        series_uid: elements.text(tag::SERIES_UID).unwrap_or_default(),
        series_number: elements.text(tag::SERIES_NUMBER).and_then(|text| text.parse().ok()),
        modality: elements
            .text(tag::MODALITY)
            .unwrap_or_default()
            .chars()
            .filter(is_letter)
            .take(16)
            .collect(),
        size: [tag::COLUMNS, tag::ROWS].map(|field| usize::from(elements.short(field).unwrap_or(0))),
        slice,
    }))
}

fn slice_of(data_set: &DataSet, n_file: u64) -> Result<Slice, Obstacle> {
    let elements = &data_set.elements;
    let stored = stored_pixels(data_set, n_file)?;
    let image_type = elements.text(tag::IMAGE_TYPE).unwrap_or_default();
    let has_type = |name: &str| image_type.split('\\').any(|part| part.trim() == name);
    if has_type("MOSAIC") {
        return Err(Obstacle::Mosaic);
    }
    let [x1, x2, x3, y1, y2, y3] = exactly(elements, tag::ORIENTATION, "ImageOrientationPatient")?;
    let axes = unit_axes(DVec3::new(x1, x2, x3), DVec3::new(y1, y2, y3))?;
    let position = DVec3::from_array(exactly(elements, tag::POSITION, "ImagePositionPatient")?);
    if position.abs().max_element() > MAX_POSITION_MM {
        return Err(Obstacle::Field { field: "ImagePositionPatient", found: position.to_string() });
    }
    // Rows stand first: the distance between them is that along y.
    let [along_y, along_x] = exactly(elements, tag::PIXEL_SPACING, "PixelSpacing")?;
    if !(along_x.min(along_y) > 0.0 && along_x.max(along_y) < MAX_POSITION_MM) {
        return Err(Obstacle::Field { field: "PixelSpacing", found: format!("{along_y}\\{along_x}") });
    }
    // A slice without scaling is its own values; one whose scaling cannot be read would be wrong in silence.
    let scale = |field, name| match elements.text(field) {
        None => Ok(None),
        Some(_) => exactly::<1>(elements, field, name).map(|[value]| Some(value)),
    };
    let is_dicom_slope = |slope: &f64| *slope != 0.0;
    Ok(Slice {
        position,
        axes,
        spacing: [along_x, along_y],
        stored,
        slope: scale(tag::SLOPE, "RescaleSlope")?.filter(is_dicom_slope).unwrap_or(1.0),
        intercept: scale(tag::INTERCEPT, "RescaleIntercept")?.unwrap_or(0.0),
        padding: padding(elements, stored.is_signed),
        phases: [tag::TEMPORAL, tag::ACQUISITION, tag::ECHO].map(|field| elements.text(field)),
        is_localizer: has_type("LOCALIZER"),
        is_inverted: elements.text(tag::PHOTOMETRIC).as_deref() == Some("MONOCHROME1"),
        is_lossy: data_set.syntax.is_lossy(elements.text(tag::LOSSY).as_deref()),
    })
}

fn exactly<const N: usize>(
    elements: &Elements,
    field: tag::Tag,
    name: &'static str,
) -> Result<[f64; N], Obstacle> {
    let missing = || match elements.text(field) {
        None => Obstacle::NoField { field: name },
        Some(text) => Obstacle::Field { field: name, found: text.chars().take(80).collect() },
    };
    elements.exactly(field).ok_or_else(missing)
}

/// The axes at length 1; refused where they are not perpendicular or far from that length.
fn unit_axes(x: DVec3, y: DVec3) -> Result<[DVec3; 2], Obstacle> {
    let is_unit = |axis: DVec3| (axis.length() - 1.0).abs() < 10.0 * MAX_AXIS_ERROR;
    if is_unit(x) && is_unit(y) && x.normalize().dot(y.normalize()).abs() < MAX_AXIS_ERROR {
        return Ok([x.normalize(), y.normalize()]);
    }
    let found = format!("{}\\{}\\{}\\{}\\{}\\{}", x.x, x.y, x.z, y.x, y.y, y.z);
    Err(Obstacle::Field { field: "ImageOrientationPatient", found })
}

fn stored_pixels(data_set: &DataSet, n_file: u64) -> Result<StoredPixels, Obstacle> {
    let elements = &data_set.elements;
    let Some(place) = elements.pixels else { return Err(Obstacle::FloatPixels) };
    let number = |field, name| elements.short(field).ok_or(Obstacle::NoField { field: name });
    let [columns, rows] = [number(tag::COLUMNS, "Columns")?, number(tag::ROWS, "Rows")?];
    if rows.min(columns) == 0 {
        return Err(Obstacle::Field { field: "Rows or Columns", found: "0".to_owned() });
    }
    let samples = elements.short(tag::SAMPLES).unwrap_or(1);
    let photometric = elements.text(tag::PHOTOMETRIC).unwrap_or_else(|| "MONOCHROME2".to_owned());
    if samples != 1 || !photometric.starts_with("MONOCHROME") {
        return Err(Obstacle::Color { photometric: photometric.chars().take(16).collect() });
    }
    let frames = elements.text(tag::FRAMES).map_or(Some(1), |text| text.parse::<u32>().ok());
    if frames != Some(1) {
        return Err(Obstacle::MultiFrame { n_frames: frames });
    }
    if let Syntax::Unknown { name } = data_set.syntax {
        return Err(Obstacle::Syntax { name });
    }
    let bits_allocated = u32::from(number(tag::BITS_ALLOCATED, "BitsAllocated")?);
    let bits_stored = elements.short(tag::BITS_STORED).map_or(bits_allocated, u32::from);
    let high_bit = elements.short(tag::HIGH_BIT).map_or(bits_stored.saturating_sub(1), u32::from);
    let is_legal = matches!(bits_allocated, 8 | 16)
        && (1..=bits_allocated).contains(&bits_stored)
        && (bits_stored - 1..bits_allocated).contains(&high_bit);
    if !is_legal {
        return Err(Obstacle::Bits { allocated: bits_allocated, stored: bits_stored, high_bit });
    }
    let is_signed = elements.short(tag::SIGNED).unwrap_or(0) == 1;
    let (syntax, low_bit) = (data_set.syntax, high_bit + 1 - bits_stored);
    let size = [usize::from(columns), usize::from(rows)];
    let stored = StoredPixels { syntax, place, size, bits_allocated, bits_stored, low_bit, is_signed };
    check_length(&stored, data_set.n_inflated.unwrap_or(n_file))?;
    Ok(stored)
}

/// Compares what the header declares with what the file can hold.
fn check_length(stored: &StoredPixels, n_file: u64) -> Result<(), Obstacle> {
    let n_there = n_file.saturating_sub(stored.place.offset as u64);
    match (stored.place.length, stored.syntax.is_native()) {
        (Some(length), true) => {
            let (expected, found) = (stored.n_bytes() as u64, n_there.min(u64::from(length)));
            if found < expected { Err(Obstacle::Truncated { expected, found }) } else { Ok(()) }
        }
        (None, false) => Ok(()),
        (Some(_), false) => Err(Obstacle::Damaged { what: "its pixels are compressed but not in fragments" }),
        (None, true) => Err(Obstacle::Damaged { what: "its pixels are in fragments but not compressed" }),
    }
}

/// The padding values, as the pixels are signed.
fn padding(elements: &Elements, is_signed: bool) -> Option<(i32, i32)> {
    let value = |bits: u16| if is_signed { i32::from(bits.cast_signed()) } else { i32::from(bits) };
    let first = value(elements.short(tag::PADDING)?);
    let last = elements.short(tag::PADDING_LIMIT).map_or(first, value);
    Some((first.min(last), first.max(last)))
}

/// How the pixels of a file lie in it, whether or not it is a slice.
#[cfg(test)]
pub(super) fn stored_in(path: &Path) -> Result<StoredPixels, Obstacle> {
    let bytes = std::fs::read(path).unwrap_or_default();
    stored_pixels(&read_data_set(&bytes, 1 << 30, true), bytes.len() as u64)
}
