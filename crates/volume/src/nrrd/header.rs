//! The fields of a NRRD header.
//!
//! **Input** a stream that stands at the file's beginning. **Output** [`Header`]; the stream stands behind the header.
//! **Steps** 1. lines up to the first empty one, or in a detached header to the end; 2. `field: value`, spaces and
//! case in field names aside; comments and `key:=value` pairs are passed over; 3. each field that is used, checked.
//! **Source** "Definition of NRRD File Format", teem.sourceforge.net/nrrd/format.html.
//! **Differs from the source** a space with a time axis is refused, data over several files and the hex encoding too.

use std::collections::BTreeMap;

use glam::DVec3;

use crate::scalar::Scalar;
use crate::source::{Packing, Source};
use crate::text::{self, Lines};
use crate::{AssumedSpace, ReadError};

/// The most axes that the format allows.
const MAX_AXES: usize = 16;

/// How the numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Raw,
    Ascii,
    Packed(Packing),
}

/// What `space` says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Space {
    /// Where the axes of the space point in the body.
    Body(AssumedSpace),
    /// A space without a body, or none.
    Unknown,
}

/// What a header says, each field checked by itself.
#[derive(Debug)]
pub(crate) struct Header {
    pub(crate) sizes: Vec<u64>,
    pub(crate) scalar: Scalar,
    pub(crate) encoding: Encoding,
    pub(crate) is_big_endian: bool,
    /// One entry an axis, lower case; empty where the header has none.
    pub(crate) kinds: Vec<String>,
    pub(crate) space: Space,
    /// One entry an axis, none for an axis that is not in space.
    pub(crate) directions: Option<Vec<Option<DVec3>>>,
    /// One entry an axis; NaN where there is none.
    pub(crate) spacings: Option<Vec<f64>>,
    pub(crate) origin: Option<DVec3>,
    /// The unit of the space's axes, or else of the file's; none if it is not stated.
    pub(crate) unit: Option<String>,
    pub(crate) line_skip: u64,
    /// -1: as many as there are before the data, which ends with the file.
    pub(crate) byte_skip: i64,
    pub(crate) data_file: Option<String>,
}

/// Reads a header.
pub(crate) fn parse(source: &mut Source) -> Result<Header, ReadError> {
    let fields = Fields::read(source)?;
    let dimension = fields.number("dimension", "a whole number from 1 to 16")?;
    let expected = "a whole number from 1 to 16";
    if !(1..=MAX_AXES as i64).contains(&dimension) {
        return Err(fields.fault("dimension", expected));
    }
    let n_axes = dimension as usize;
    let scalar = scalar(&fields)?;
    let encoding = encoding(&fields)?;
    Ok(Header {
        sizes: sizes(&fields, n_axes)?,
        scalar,
        encoding,
        is_big_endian: is_big_endian(&fields, scalar, encoding)?,
        kinds: kinds(&fields, n_axes)?,
        space: space(&fields)?,
        directions: directions(&fields, n_axes)?,
        spacings: spacings(&fields, n_axes)?,
        origin: origin(&fields)?,
        unit: unit(&fields)?,
        line_skip: skip(&fields, "line skip", 0)? as u64,
        byte_skip: skip(&fields, "byte skip", -1)?,
        data_file: data_file(&fields)?,
    })
}

/// The fields of a header as text, by name without spaces, lower case.
struct Fields(BTreeMap<String, String>);

impl Fields {
    fn read(source: &mut Source) -> Result<Self, ReadError> {
        let mut lines = Lines::of(source);
        let version = lines.next()?.unwrap_or_default();
        if !matches!(version.trim_end(), "NRRD0001" | "NRRD0002" | "NRRD0003" | "NRRD0004" | "NRRD0005") {
            let found = version.chars().take(20).collect();
            return Err(ReadError::Field { field: "magic", found, expected: "NRRD0001 to NRRD0005" });
        }
        let mut fields = BTreeMap::new();
        while let Some(line) = lines.next()? {
            if line.is_empty() {
                break;
            }
            let Some((name, value)) = line.split_once(':') else { continue };
            if line.starts_with('#') || value.starts_with('=') {
                continue;
            }
            let name: String = name.chars().filter(|c| !c.is_whitespace()).collect();
            let name = name.to_ascii_lowercase();
            if let Some(first) = fields.insert(name, value.trim().to_owned()) {
                let found = format!("{first:?} and, on another line, {:?}", value.trim());
                return Err(ReadError::Field { field: "line", found, expected: "each field once" });
            }
        }
        Ok(Self(fields))
    }

    /// The text of a field, by its name in the format's words.
    fn text(&self, field: &str) -> Option<&str> {
        let name: String = field.chars().filter(|&c| c != ' ').collect();
        self.0.get(&name).map(String::as_str)
    }

    fn required(&self, field: &'static str, expected: &'static str) -> Result<&str, ReadError> {
        self.text(field).ok_or_else(|| self.fault(field, expected))
    }

    fn number(&self, field: &'static str, expected: &'static str) -> Result<i64, ReadError> {
        self.required(field, expected)?.parse().map_err(|_| self.fault(field, expected))
    }

    fn fault(&self, field: &'static str, expected: &'static str) -> ReadError {
        let found = self.text(field).map_or("missing".to_owned(), |text| text.chars().take(80).collect());
        ReadError::Field { field, found, expected }
    }
}

fn sizes(fields: &Fields, n_axes: usize) -> Result<Vec<u64>, ReadError> {
    let expected = "one whole number from 1 for each axis";
    let sizes: Option<Vec<u64>> = text::numbers(fields.required("sizes", expected)?);
    sizes
        .filter(|sizes| sizes.len() == n_axes && !sizes.contains(&0))
        .ok_or_else(|| fields.fault("sizes", expected))
}

fn scalar(fields: &Fields) -> Result<Scalar, ReadError> {
    let text = fields.required("type", "a type of numbers, such as short")?;
    let words: Vec<&str> = text.split_whitespace().collect();
    Ok(match words.join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => Scalar::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Scalar::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Scalar::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Scalar::U16,
        "int" | "signed int" | "int32" | "int32_t" => Scalar::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Scalar::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Scalar::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Scalar::U64,
        "float" => Scalar::F32,
        "double" => Scalar::F64,
        "block" => {
            return Err(ReadError::NotScalar { what: "blocks of bytes", stated: "type block".to_owned() });
        }
        _ => return Err(fields.fault("type", "a type of numbers, such as short")),
    })
}

fn encoding(fields: &Fields) -> Result<Encoding, ReadError> {
    let expected = "raw, ascii, gzip or bzip2";
    match fields.required("encoding", expected)?.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "ascii" | "txt" | "text" => Ok(Encoding::Ascii),
        "gz" | "gzip" => Ok(Encoding::Packed(Packing::Gzip)),
        "bz2" | "bzip2" => Ok(Encoding::Packed(Packing::Bzip2)),
        _ => Err(fields.fault("encoding", expected)),
    }
}

fn is_big_endian(fields: &Fields, scalar: Scalar, encoding: Encoding) -> Result<bool, ReadError> {
    match fields.text("endian").map(str::to_ascii_lowercase).as_deref() {
        // Numbers written out come as little-endian bytes.
        _ if encoding == Encoding::Ascii => Ok(false),
        Some("little") => Ok(false),
        Some("big") => Ok(true),
        None if scalar.file_bytes() == 1 => Ok(false),
        _ => Err(fields.fault("endian", "little or big")),
    }
}

fn kinds(fields: &Fields, n_axes: usize) -> Result<Vec<String>, ReadError> {
    let Some(text) = fields.text("kinds") else { return Ok(Vec::new()) };
    let kinds: Vec<String> = text.split_whitespace().map(str::to_ascii_lowercase).collect();
    if kinds.len() == n_axes { Ok(kinds) } else { Err(fields.fault("kinds", "one word for each axis")) }
}

fn space(fields: &Fields) -> Result<Space, ReadError> {
    let expected = "a space of three dimensions, such as left-posterior-superior";
    let Some(text) = fields.text("space") else {
        // A space that only has dimensions.
        return match fields.text("space dimension") {
            None | Some("3") => Ok(Space::Unknown),
            Some(_) => Err(fields.fault("space dimension", "3")),
        };
    };
    match text.to_ascii_lowercase().as_str() {
        "right-anterior-superior" | "ras" => Ok(Space::Body(AssumedSpace::Ras)),
        "left-anterior-superior" | "las" => Ok(Space::Body(AssumedSpace::Las)),
        "left-posterior-superior" | "lps" => Ok(Space::Body(AssumedSpace::Lps)),
        "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => Ok(Space::Unknown),
        _ => Err(fields.fault("space", expected)),
    }
}

fn directions(fields: &Fields, n_axes: usize) -> Result<Option<Vec<Option<DVec3>>>, ReadError> {
    let expected = "for each axis none or a vector of three numbers, such as (0.5,0,0)";
    let Some(text) = fields.text("space directions") else { return Ok(None) };
    let directions = vectors(text).filter(|directions| directions.len() == n_axes);
    directions.map(Some).ok_or_else(|| fields.fault("space directions", expected))
}

/// Vectors of three numbers in brackets, or `none`, parted by spaces.
fn vectors(text: &str) -> Option<Vec<Option<DVec3>>> {
    let (mut rest, mut vectors) = (text.trim(), Vec::new());
    while !rest.is_empty() && vectors.len() <= MAX_AXES {
        let (vector, after) = match rest.strip_prefix('(') {
            Some(open) => {
                let (inside, after) = open.split_once(')')?;
                let numbers: Option<Vec<f64>> =
                    inside.split(',').map(|word| word.trim().parse().ok()).collect();
                let [x, y, z] = numbers?.try_into().ok()?;
                (Some(DVec3::new(x, y, z)), after)
            }
            None => (None, rest.strip_prefix("none")?),
        };
        vectors.push(vector);
        rest = after.trim_start();
    }
    Some(vectors)
}

fn spacings(fields: &Fields, n_axes: usize) -> Result<Option<Vec<f64>>, ReadError> {
    let Some(text) = fields.text("spacings") else { return Ok(None) };
    let spacings = text::numbers(text).filter(|spacings: &Vec<f64>| spacings.len() == n_axes);
    spacings.map(Some).ok_or_else(|| fields.fault("spacings", "one number for each axis"))
}

fn origin(fields: &Fields) -> Result<Option<DVec3>, ReadError> {
    let Some(text) = fields.text("space origin") else { return Ok(None) };
    match vectors(text).as_deref() {
        Some([Some(origin)]) => Ok(Some(*origin)),
        _ => Err(fields.fault("space origin", "a vector of three numbers, such as (0,0,0)")),
    }
}

/// The unit of length, which must be the same for all axes that have one.
fn unit(fields: &Fields) -> Result<Option<String>, ReadError> {
    let field = if fields.text("space units").is_some() { "space units" } else { "units" };
    let Some(text) = fields.text(field) else { return Ok(None) };
    // Names stand in quotes; what is between them is space.
    let quoted = text.split('"').skip(1).step_by(2);
    let mut lengths: Vec<&str> = quoted.filter(|name| text::unit_mm(name).is_some()).collect();
    lengths.dedup();
    match lengths[..] {
        [] => Ok(None),
        [unit] => Ok(Some(unit.to_owned())),
        _ => Err(fields.fault(field, "one unit of length for all axes")),
    }
}

fn skip(fields: &Fields, field: &'static str, minimum: i64) -> Result<i64, ReadError> {
    let expected = if minimum < 0 { "a whole number from -1" } else { "a whole number from 0" };
    match fields.text(field) {
        None => Ok(0),
        Some(_) => {
            let number = fields.number(field, expected)?;
            if number >= minimum { Ok(number) } else { Err(fields.fault(field, expected)) }
        }
    }
}

/// The one file that holds the data.
fn data_file(fields: &Fields) -> Result<Option<String>, ReadError> {
    let Some(text) = fields.text("data file") else { return Ok(None) };
    let words: Vec<&str> = text.split_whitespace().collect();
    let is_list = words.first().is_some_and(|word| *word == "LIST");
    let is_pattern = words.len() >= 4 && words[0].contains('%');
    if is_list || is_pattern {
        return Err(ReadError::SeveralFiles { written: text.chars().take(80).collect() });
    }
    Ok(Some(text.to_owned()))
}
