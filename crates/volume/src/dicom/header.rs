//! What a DICOM file is: a slice that can be stacked, something else, or damaged.
//!
//! **Input** a path. **Output** [`Object`].
//! **Steps** 1. the first bytes of the file, and more of them as long as the pixels are not reached; 2. its elements;
//! 3. each field that a slice needs, checked.
//! **Guarantees** no more than [`MAX_HEADER_BYTES`] of a file are held, and by all threads together but for small files;
//! a deflated data set is inflated no further than its pixels. What is kept is geometry and how intensities are stored,
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
pub(super) const FIRST_BYTES: u64 = 64 << 10;
/// By how much more is read each time.
const GROWTH: u64 = 8;
/// Pixels that begin later are those of no scanner; the longest headers, with icons and private tables, have a tenth.
const MAX_HEADER_BYTES: u64 = 16 << 20;
/// No byte of a deflated data set stands for more than this many: RFC 1951 has matches of at most 258 bytes in at least
/// 2 bits.
const MAX_DEFLATE_RATIO: u64 = 1032;
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
    let n_file = std::fs::metadata(path)?.len();
    let data_set = DataSet::open(path, max_bytes, gate)?;
    Ok(data_set.map_or(Found::Other, |data_set| found(path, &data_set, n_file)))
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

impl DataSet {
    /// The data set of a file; none if that is no DICOM.
    fn open(path: &Path, max_bytes: u64, gate: &Mutex<()>) -> std::io::Result<Option<Self>> {
        let mut file = File::open(path)?;
        let mut start = Vec::new();
        (&mut file).take(FIRST_BYTES).read_to_end(&mut start)?;
        if !tag::looks_like_dicom(&start) {
            return Ok(None);
        }
        let meta = read_meta(&start);
        let syntax = meta.syntax.as_deref().map_or(Syntax::Native { is_big_endian: false }, Syntax::of_uid);
        let is_big_endian = syntax == Syntax::Native { is_big_endian: true };
        let most = MAX_HEADER_BYTES.min(max_bytes);
        if syntax == Syntax::Deflated {
            let _turn = gate.lock().unwrap_or_else(PoisonError::into_inner);
            let packed = Forgiving(DeflateDecoder::new(start[meta.end..].chain(file)));
            let mut inflated = Growing { bytes: Vec::new(), rest: packed, is_whole: false, most, gate: None };
            inflated.read_on(FIRST_BYTES)?;
            let elements = inflated.elements(0, false)?;
            let n_file = std::fs::metadata(path)?.len();
            let n_inflated = Some(inflated.n_there(&elements, (n_file, max_bytes))?);
            return Ok(Some(Self { elements, syntax, n_inflated }));
        }
        let is_whole = (start.len() as u64) < FIRST_BYTES;
        let mut stored = Growing { bytes: start, rest: file, is_whole, most, gate: Some(gate) };
        let elements = stored.elements(meta.end, is_big_endian)?;
        // Without a meta group the elements tell the byte order.
        let syntax = match syntax {
            Syntax::Native { .. } => Syntax::Native { is_big_endian: elements.encoding.is_big_endian },
            other => other,
        };
        Ok(Some(Self { elements, syntax, n_inflated: None }))
    }
}

/// The first bytes of something, of which more are read as they are needed.
struct Growing<'a, R> {
    bytes: Vec<u8>,
    rest: R,
    /// Whether there are no more.
    is_whole: bool,
    /// How many may be held.
    most: u64,
    /// Where to wait for more; none where the wait is over.
    gate: Option<&'a Mutex<()>>,
}

impl<R: Read> Growing<'_, R> {
    /// The elements from `start` on.
    fn elements(&mut self, start: usize, is_big_endian: bool) -> std::io::Result<Elements> {
        let mut turn = None;
        loop {
            let mut elements = read_elements(&self.bytes, start, is_big_endian);
            // The bytes at hand may end where an element does.
            let is_open = matches!(elements.fault, None | Some(Fault::Short))
                && elements.pixels.is_none()
                && !elements.has_float_pixels;
            if self.is_whole || !is_open {
                return Ok(elements);
            }
            let n_held = self.bytes.len() as u64;
            if n_held >= self.most {
                elements.fault = Some(Fault::Malformed("its header is longer than any"));
                return Ok(elements);
            }
            if turn.is_none() {
                turn = self.gate.map(|gate| gate.lock().unwrap_or_else(PoisonError::into_inner));
            }
            self.read_on(n_held * (GROWTH - 1))?;
        }
    }

    /// Reads so many more, as far as they may be held.
    fn read_on(&mut self, n_bytes: u64) -> std::io::Result<()> {
        let n_wanted = n_bytes.min(self.most.saturating_sub(self.bytes.len() as u64));
        self.bytes.reserve_exact(n_wanted as usize);
        let n_read = (&mut self.rest).take(n_wanted).read_to_end(&mut self.bytes)?;
        self.is_whole = (n_read as u64) < n_wanted;
        Ok(())
    }

    /// How many bytes there are in all, as far as the pixels need them. Where they cannot be there, or are more than may
    /// be held, which is said later, nothing more is inflated.
    fn n_there(&mut self, elements: &Elements, (n_file, max_bytes): (u64, u64)) -> std::io::Result<u64> {
        let n_held = self.bytes.len() as u64;
        let extent = |field| u64::from(elements.short(field).unwrap_or(0));
        let n_pixels = extent(tag::ROWS) * extent(tag::COLUMNS);
        let n_bytes = n_pixels * u64::from(elements.short(tag::BITS_ALLOCATED).unwrap_or(0)).div_ceil(8);
        let needed = elements.pixels.map_or(0, |place| place.offset as u64).saturating_add(n_bytes);
        match needed {
            _ if needed <= n_held || needed / MAX_DEFLATE_RATIO > n_file => Ok(n_held),
            _ if needed > max_bytes => Ok(needed),
            _ => {
                Ok(n_held + std::io::copy(&mut (&mut self.rest).take(needed - n_held), &mut std::io::sink())?)
            }
        }
    }
}

/// A stream whose damage is its end: what came before stands, and the walk over it says where it ends.
struct Forgiving<R>(R);

impl<R: Read> Read for Forgiving<R> {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        Ok(self.0.read(buffer).unwrap_or(0))
    }
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
    let n_file = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    let data_set = DataSet::open(path, 1 << 30, &Mutex::new(())).ok().flatten();
    stored_pixels(&data_set.ok_or(Obstacle::Damaged { what: "it cannot be read" })?, n_file)
}
