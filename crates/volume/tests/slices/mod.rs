//! DICOM slices made for tests: a small scan with a patient's name, dates and identifiers in every file.
#![allow(dead_code, clippy::expect_used, reason = "each test file uses its part")]

use std::path::{Path, PathBuf};

/// What must never reach an output.
pub(crate) const SECRETS: [&str; 7] =
    ["DOE^JANE", "PID-4711", "19511224", "ST-ELSEWHERE", "1.2.826.0.1.9999", "DR^STRANGE", "SECRETSERIES"];

/// One slice, and how it is written.
#[derive(Clone)]
pub(crate) struct Slice {
    pub(crate) position: [f64; 3],
    pub(crate) orientation: [f64; 6],
    pub(crate) pixel_spacing: [f64; 2],
    pub(crate) size: [u16; 2],
    pub(crate) series: u32,
    pub(crate) modality: &'static str,
    pub(crate) slope: f64,
    pub(crate) intercept: f64,
    pub(crate) values: Vec<i16>,
    /// Further elements, in the order of their tags among the rest.
    pub(crate) more: Vec<(u32, &'static str, Vec<u8>)>,
}

impl Slice {
    /// A slice at a height, with values that tell column, row and height.
    pub(crate) fn at(z: f64) -> Self {
        let size = [6, 5];
        let value = |i: usize| (i % 6) as i16 + 10 * (i / 6) as i16 + 100 * z.round() as i16;
        Self {
            position: [-20.0, -30.0, z],
            orientation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            pixel_spacing: [0.5, 0.75],
            size,
            series: 3,
            modality: "CT",
            slope: 1.0,
            intercept: -1000.0,
            values: (0..30).map(value).collect(),
            more: Vec::new(),
        }
    }

    /// With a further element, which takes the place of one of the same tag.
    pub(crate) fn with(mut self, tag: u32, representation: &'static str, value: &[u8]) -> Self {
        self.more.push((tag, representation, value.to_vec()));
        self
    }

    /// The file.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        [preamble(b"1.2.840.10008.1.2.1"), self.data_set()].concat()
    }

    /// The file with a deflated data set.
    pub(crate) fn deflated(&self) -> Vec<u8> {
        let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
        std::io::Write::write_all(&mut deflated, &self.data_set()).expect("to memory");
        [preamble(b"1.2.840.10008.1.2.1.99"), deflated.finish().expect("to memory")].concat()
    }

    fn data_set(&self) -> Vec<u8> {
        let decimals = |values: &[f64]| {
            values.iter().map(|value| format!("{value}")).collect::<Vec<_>>().join("\\").into_bytes()
        };
        let short = |value: u16| value.to_le_bytes().to_vec();
        let uid = format!("1.2.826.0.1.9999.{}", self.series);
        let mut elements: Vec<(u32, &str, Vec<u8>)> = vec![
            (0x0008_0008, "CS", b"ORIGINAL\\PRIMARY\\AXIAL".to_vec()),
            (0x0008_0016, "UI", b"1.2.840.10008.5.1.4.1.1.2".to_vec()),
            (0x0008_0018, "UI", format!("{uid}.{}", (self.position[2] * 100.0) as i64).into_bytes()),
            (0x0008_0020, "DA", b"19511224".to_vec()),
            (0x0008_0060, "CS", self.modality.as_bytes().to_vec()),
            (0x0008_0080, "LO", b"ST-ELSEWHERE".to_vec()),
            (0x0008_0090, "PN", b"DR^STRANGE".to_vec()),
            (0x0008_103E, "LO", b"SECRETSERIES".to_vec()),
            (0x0010_0010, "PN", b"DOE^JANE".to_vec()),
            (0x0010_0020, "LO", b"PID-4711".to_vec()),
            (0x0010_0030, "DA", b"19511224".to_vec()),
            (0x0018_0050, "DS", b"99".to_vec()),
            (0x0020_000E, "UI", uid.into_bytes()),
            (0x0020_0011, "IS", self.series.to_string().into_bytes()),
            (0x0020_0032, "DS", decimals(&self.position)),
            (0x0020_0037, "DS", decimals(&self.orientation)),
            (0x0028_0002, "US", short(1)),
            (0x0028_0004, "CS", b"MONOCHROME2".to_vec()),
            (0x0028_0010, "US", short(self.size[1])),
            (0x0028_0011, "US", short(self.size[0])),
            (0x0028_0030, "DS", decimals(&self.pixel_spacing)),
            (0x0028_0100, "US", short(16)),
            (0x0028_0101, "US", short(16)),
            (0x0028_0102, "US", short(15)),
            (0x0028_0103, "US", short(1)),
            (0x0028_1052, "DS", decimals(&[self.intercept])),
            (0x0028_1053, "DS", decimals(&[self.slope])),
            (0x7FE0_0010, "OW", self.values.iter().flat_map(|value| value.to_le_bytes()).collect()),
        ];
        elements.extend(self.more.iter().cloned());
        // Of several with one tag, the last.
        elements.reverse();
        elements.sort_by_key(|element| element.0);
        elements.dedup_by_key(|element| element.0);
        elements
            .into_iter()
            .flat_map(|(tag, representation, value)| element(tag, representation, value))
            .collect()
    }
}

/// What stands before the data set.
fn preamble(syntax: &[u8]) -> Vec<u8> {
    [vec![0; 128], b"DICM".to_vec(), element(0x0002_0010, "UI", syntax.to_vec())].concat()
}

/// An element with an explicit representation.
pub(crate) fn element(tag: u32, representation: &str, mut value: Vec<u8>) -> Vec<u8> {
    if value.len() % 2 == 1 {
        value.push(if representation == "UI" { 0 } else { b' ' });
    }
    let mut bytes = ((tag >> 16) as u16).to_le_bytes().to_vec();
    bytes.extend((tag as u16).to_le_bytes());
    bytes.extend(representation.as_bytes());
    if matches!(representation, "OW" | "OB" | "SQ" | "UN" | "UC" | "UR" | "UT") {
        bytes.extend([0, 0]);
        bytes.extend((value.len() as u32).to_le_bytes());
    } else {
        bytes.extend((value.len() as u16).to_le_bytes());
    }
    bytes.extend(value);
    bytes
}

/// A folder of slices, named by `name` of their index.
pub(crate) fn write(folder: &Path, slices: &[Slice], name: impl Fn(usize) -> String) -> Vec<PathBuf> {
    let write = |(index, slice): (usize, &Slice)| {
        let path = folder.join(name(index));
        std::fs::write(&path, slice.bytes()).expect("writable");
        path
    };
    slices.iter().enumerate().map(write).collect()
}

/// Slices at these heights.
pub(crate) fn stack(heights: &[f64]) -> Vec<Slice> {
    heights.iter().map(|&z| Slice::at(z)).collect()
}
