//! MetaImage: header and data.
//!
//! **Input** a `.mha` file, or the `.mhd` header of a data file. **Output** [`Stored`].
//! **Steps** 1. lines `Key = Value` up to `ElementDataFile`, each key that is used checked; 2. the place in the world;
//! 3. the data, in this file or in another; 4. the declared size, compared with what the file can hold.
//! **Source** the MetaIO documentation of ITK, and what ITK does where it is silent: the world is LPS, the rows of
//! `TransformMatrix` are the directions of the axes, `MET_LONG` has 4 bytes.
//! **Differs from the source** data over several files is refused; `AnatomicalOrientation` places nothing, but where
//! it contradicts the matrix a warning says so.

use std::collections::BTreeMap;
use std::path::Path;

use espalier_model::{RAS_FROM_LPS, Report};
use glam::{DAffine3, DMat3, DVec3};

use crate::ascii::AsciiStream;
use crate::gzip;
use crate::recognise::Format;
use crate::scalar::Scalar;
use crate::source::{Packing, Source};
use crate::stored::{self, FileStream, Stored, VoxelStream};
use crate::text::{self, Lines};
use crate::{ReadError, ReadOptions, detached};

/// The key whose line ends the header.
const LAST_KEY: &str = "ElementDataFile";
/// What it says where the data follows the header.
const LOCAL: &str = "LOCAL";
/// The most axes that MetaIO reads.
const MAX_AXES: usize = 10;

/// Opens a MetaImage file, whose stream stands at its beginning.
pub(crate) fn open(
    mut source: Source,
    path: &Path,
    options: &ReadOptions,
    report: &mut Report,
) -> Result<Stored, ReadError> {
    let keys = Keys::read(&mut source)?;
    let sizes = sizes(&keys)?;
    let scalar = scalar(&keys)?;
    let (shape, n_volumes) = extents(&sizes);
    let index = stored::volume_index(n_volumes, options)?;
    let (slope, intercept) = scaling(&keys, report)?;
    let world_from_voxel = world_from_voxel(&keys, sizes.len(), options, report)?;
    let layout = Layout::of(&keys, &sizes, scalar, n_volumes)?;
    let data = data(source, path, &keys, &layout)?;
    let files = data.files(path);
    let stream = layout.stream(data, index)?;
    let form = "TransformMatrix and ElementSpacing";
    let is_big_endian = layout.is_binary && is_big_endian(&keys)?;
    Ok(Stored {
        format: Format::MetaImage,
        shape,
        world_from_voxel,
        form,
        scalar,
        is_big_endian,
        slope,
        intercept,
        files,
        stream,
    })
}

/// The header's values by key.
struct Keys(BTreeMap<String, String>);

impl Keys {
    fn read(source: &mut Source) -> Result<Self, ReadError> {
        let mut lines = Lines::of(source);
        let mut keys = BTreeMap::new();
        while let Some(line) = lines.next()? {
            if line.trim().is_empty() {
                continue;
            }
            let Some((key, value)) = line.split_once('=') else {
                let found = line.chars().take(40).collect();
                return Err(ReadError::Field { field: "line", found, expected: "Key = Value" });
            };
            let key = key.trim().to_owned();
            let is_last = key == LAST_KEY;
            keys.insert(key, value.trim().to_owned());
            if is_last {
                return Ok(Self(keys));
            }
        }
        Err(Self(keys).fault(LAST_KEY, "LOCAL or the name of a file"))
    }

    /// The value of the first of some synonyms.
    fn text(&self, synonyms: &[&'static str]) -> Option<&str> {
        synonyms.iter().find_map(|key| self.0.get(*key)).map(String::as_str)
    }

    fn fault(&self, key: &'static str, expected: &'static str) -> ReadError {
        let found = self.text(&[key]).map_or("missing".to_owned(), |text| text.chars().take(80).collect());
        ReadError::Field { field: key, found, expected }
    }

    /// So many finite numbers, or none where no such key is there.
    fn numbers(&self, synonyms: &[&'static str], n_numbers: usize) -> Result<Option<Vec<f64>>, ReadError> {
        let Some(text) = self.text(synonyms) else { return Ok(None) };
        let numbers = text::numbers(text).filter(|numbers: &Vec<f64>| numbers.len() == n_numbers);
        let finite = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
        let field = synonyms.iter().find(|key| self.0.contains_key(**key)).copied().unwrap_or_default();
        let expected = "as many finite numbers as the volume's axes need";
        finite.map(Some).ok_or_else(|| self.fault(field, expected))
    }

    fn is_true(&self, synonyms: &[&'static str], default: bool) -> Result<bool, ReadError> {
        match self.text(synonyms).map(str::to_ascii_lowercase).as_deref() {
            None => Ok(default),
            Some("true" | "t" | "1") => Ok(true),
            Some("false" | "f" | "0") => Ok(false),
            Some(_) => Err(self.fault(synonyms[0], "True or False")),
        }
    }
}

/// The extent of each axis.
fn sizes(keys: &Keys) -> Result<Vec<u64>, ReadError> {
    let n_axes: Option<usize> = keys.text(&["NDims"]).and_then(|text| text.parse().ok());
    let n_axes = n_axes.filter(|n_axes| (2..=MAX_AXES).contains(n_axes));
    let n_axes = n_axes.ok_or_else(|| keys.fault("NDims", "a whole number from 2 to 10"))?;
    let sizes: Option<Vec<u64>> = keys.text(&["DimSize"]).and_then(text::numbers);
    sizes
        .filter(|sizes| sizes.len() == n_axes && !sizes.contains(&0))
        .ok_or_else(|| keys.fault("DimSize", "one whole number from 1 for each axis"))
}

/// Voxels along x, y, z, and the number of volumes over all further axes.
fn extents(sizes: &[u64]) -> ([usize; 3], u64) {
    let extent = |axis: usize| sizes.get(axis).map_or(1, |&size| usize::try_from(size).unwrap_or(usize::MAX));
    let n_volumes = sizes.iter().skip(3).fold(1, |product: u64, &size| product.saturating_mul(size));
    ([extent(0), extent(1), extent(2)], n_volumes)
}

fn scalar(keys: &Keys) -> Result<Scalar, ReadError> {
    let expected = "a type of numbers, such as MET_SHORT";
    let name = keys.text(&["ElementType"]).ok_or_else(|| keys.fault("ElementType", expected))?;
    let n_channels = keys.text(&["ElementNumberOfChannels"]).unwrap_or("1");
    if name.ends_with("_ARRAY") || n_channels != "1" {
        let stated = format!("ElementType {name}, ElementNumberOfChannels {n_channels}");
        return Err(ReadError::NotScalar { what: "colours or vectors", stated });
    }
    match name {
        "MET_CHAR" | "MET_ASCII_CHAR" => Ok(Scalar::I8),
        "MET_UCHAR" => Ok(Scalar::U8),
        "MET_SHORT" => Ok(Scalar::I16),
        "MET_USHORT" => Ok(Scalar::U16),
        "MET_INT" | "MET_LONG" => Ok(Scalar::I32),
        "MET_UINT" | "MET_ULONG" => Ok(Scalar::U32),
        "MET_LONG_LONG" => Ok(Scalar::I64),
        "MET_ULONG_LONG" => Ok(Scalar::U64),
        "MET_FLOAT" => Ok(Scalar::F32),
        "MET_DOUBLE" => Ok(Scalar::F64),
        _ => Err(keys.fault("ElementType", expected)),
    }
}

fn is_big_endian(keys: &Keys) -> Result<bool, ReadError> {
    keys.is_true(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"], false)
}

/// Slope and intercept; 1 and 0 where the file has none.
fn scaling(keys: &Keys, report: &mut Report) -> Result<(f64, f64), ReadError> {
    let number = |key: &'static str, default| {
        Ok::<f64, ReadError>(keys.numbers(&[key], 1)?.map_or(default, |numbers| numbers[0]))
    };
    let slope = number("ElementToIntensityFunctionSlope", 1.0)?;
    let intercept = number("ElementToIntensityFunctionOffset", 0.0)?;
    if slope == 0.0 {
        report.warn("W-META-SLOPE", "ElementToIntensityFunctionSlope is 0: the numbers are taken unscaled");
        return Ok((1.0, 0.0));
    }
    if (slope, intercept) != (1.0, 0.0) {
        report.warn(
            "W-META-SLOPE",
            format!(
                "values are scaled by {slope} and {intercept} as the header says; ITK takes them unscaled"
            ),
        );
    }
    Ok((slope, intercept))
}

/// RAS+ mm from voxels.
fn world_from_voxel(
    keys: &Keys,
    n_axes: usize,
    options: &ReadOptions,
    report: &mut Report,
) -> Result<DAffine3, ReadError> {
    let spacing = keys.numbers(&["ElementSpacing", "ElementSize"], n_axes)?;
    let origin = keys.numbers(&["Offset", "Position", "Origin"], n_axes)?;
    let matrix = keys.numbers(&["TransformMatrix", "Rotation", "Orientation"], n_axes * n_axes)?;
    let in_space = n_axes.min(3);
    let vector = |values: &Option<Vec<f64>>, default: f64| {
        let mut vector = [default; 3];
        if let Some(values) = values {
            vector[..in_space].copy_from_slice(&values[..in_space]);
        }
        DVec3::from_array(vector)
    };
    let mut rows = DMat3::IDENTITY.to_cols_array_2d();
    if let Some(matrix) = &matrix {
        for axis in 0..in_space {
            rows[axis][..in_space].copy_from_slice(&matrix[axis * n_axes..axis * n_axes + in_space]);
        }
    }
    // A row of the matrix is the direction of an axis: a column of what maps voxels.
    let lps_from_voxel = DMat3::from_cols_array_2d(&rows) * DMat3::from_diagonal(vector(&spacing, 1.0));
    let unit_mm = match (options.unit_mm, keys.text(&["DistanceUnits"])) {
        (Some(unit_mm), _) => unit_mm,
        (None, Some(name)) => text::unit_mm(name).unwrap_or(1.0),
        (None, None) => 1.0,
    };
    if options.unit_mm.is_none() && unit_mm != 1.0 {
        report.warn("W-META-UNITS", "lengths are in DistanceUnits as the header says; ITK takes them for mm");
    }
    let ras_mm = RAS_FROM_LPS * unit_mm;
    let ras_from_voxel = DMat3::from_diagonal(ras_mm) * lps_from_voxel;
    warn_if_orientation_disagrees(keys, ras_from_voxel, report);
    Ok(DAffine3::from_mat3_translation(ras_from_voxel, ras_mm * vector(&origin, 0.0)))
}

/// `AnatomicalOrientation` names the sides that the axes come from; some programs write it without a matrix.
fn warn_if_orientation_disagrees(keys: &Keys, ras_from_voxel: DMat3, report: &mut Report) {
    let Some(stated) = keys.text(&["AnatomicalOrientation"]) else { return };
    let axes = ras_from_voxel.to_cols_array_2d();
    let disagrees = stated.chars().zip(axes).any(|(letter, axis)| {
        let largest = (0..3).max_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs())).unwrap_or(0);
        let comes_from = [['R', 'L'], ['A', 'P'], ['S', 'I']][largest][usize::from(axis[largest] > 0.0)];
        matches!(letter, 'R' | 'L' | 'A' | 'P' | 'S' | 'I') && letter != comes_from
    });
    if disagrees {
        report.warn(
            "W-META-ORIENTATION",
            format!("AnatomicalOrientation {stated:.20} is not what TransformMatrix says, which is used"),
        );
    }
}

/// How the data is written.
struct Layout {
    scalar: Scalar,
    is_binary: bool,
    is_compressed: bool,
    /// Bytes before the data of a file of its own; -1: what its length leaves.
    header_size: i64,
    volume_bytes: u64,
    data_bytes: u64,
    n_volumes: u64,
}

impl Layout {
    fn of(keys: &Keys, sizes: &[u64], scalar: Scalar, n_volumes: u64) -> Result<Self, ReadError> {
        let product = |sizes: &[u64]| {
            sizes.iter().fold(scalar.file_bytes(), |product, &size| product.saturating_mul(size))
        };
        let expected = "a whole number from -1";
        let header_size = keys.text(&["HeaderSize"]).map_or(Some(0), |text| text.parse().ok());
        Ok(Self {
            scalar,
            is_binary: keys.is_true(&["BinaryData"], true)?,
            is_compressed: keys.is_true(&["CompressedData"], false)?,
            header_size: header_size
                .filter(|&size| size >= -1)
                .ok_or_else(|| keys.fault("HeaderSize", expected))?,
            volume_bytes: product(&sizes[..sizes.len().min(3)]),
            data_bytes: product(sizes),
            n_volumes,
        })
    }

    /// The voxels of one volume; `source` stands before the first one's.
    fn stream(&self, mut source: Source, index: u64) -> Result<Box<dyn VoxelStream>, ReadError> {
        if self.is_binary {
            source.skip(index * self.volume_bytes)?;
            let n_after = (self.n_volumes - 1 - index) * self.volume_bytes;
            let max_trailing = if self.is_compressed { 0 } else { stored::MAX_TRAILING_BYTES };
            return Ok(Box::new(FileStream { source, n_after, max_trailing }));
        }
        let number_bytes = self.scalar.file_bytes();
        let mut numbers = AsciiStream::new(source, self.scalar, self.data_bytes / number_bytes)?;
        numbers.skip(index * self.volume_bytes / number_bytes)?;
        Ok(Box::new(numbers))
    }
}

/// The stream of the data, which the file is large enough to hold, as far as can be told.
fn data(header: Source, path: &Path, keys: &Keys, layout: &Layout) -> Result<Source, ReadError> {
    let written = keys.text(&[LAST_KEY]).unwrap_or_default();
    let is_here = written.eq_ignore_ascii_case(LOCAL);
    if written.starts_with("LIST") || written.contains('%') {
        return Err(ReadError::SeveralFiles { written: written.chars().take(80).collect() });
    }
    let mut source =
        if is_here { header } else { Source::open_detached_plain(&detached::data_file(path, written)?)? };
    if layout.is_compressed {
        // MetaIO writes zlib streams and reads gzip too.
        let packing = if source.peek(2)? == gzip::MAGIC { Packing::Gzip } else { Packing::Zlib };
        source = source.unpack(packing);
    }
    if !layout.is_binary {
        return Ok(source);
    }
    let n_before = match u64::try_from(layout.header_size) {
        _ if is_here || layout.is_compressed => 0,
        Ok(n_bytes) => n_bytes,
        Err(_) => source.max_bytes().saturating_sub(layout.data_bytes),
    };
    source.expect(source.position().saturating_add(n_before).saturating_add(layout.data_bytes))?;
    source.skip(n_before)?;
    Ok(source)
}
