//! Why a DICOM series cannot be read.

use std::fmt;

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;
use thiserror::Error;

/// Why a file is no slice.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Obstacle {
    /// A header that ends or goes wrong before the pixels.
    #[error("the file is damaged: {what}")]
    Damaged {
        /// In which way.
        what: &'static str,
    },
    /// Fewer pixels than declared.
    #[error("the file is cut short: {expected} bytes of pixels expected, {found} found")]
    Truncated {
        /// How many bytes the header declares.
        expected: u64,
        /// How many there are.
        found: u64,
    },
    /// A field without which a slice has no place or no meaning.
    #[error("the field {field} is missing")]
    NoField {
        /// Its name in the standard.
        field: &'static str,
    },
    /// A field with a value that cannot be.
    #[error("the field {field} is {found}")]
    Field {
        /// Its name in the standard.
        field: &'static str,
        /// What stands there.
        found: String,
    },
    /// Colours.
    #[error("the image is in colour ({photometric})")]
    Color {
        /// The photometric interpretation.
        photometric: String,
    },
    /// Many frames in one file.
    #[error("the file holds {} frames (an enhanced or multi-frame image)", .n_frames.map_or("an unknown number of".to_owned(), |n| n.to_string()))]
    MultiFrame {
        /// How many, where the header says.
        n_frames: Option<u32>,
    },
    /// Many slices side by side in one image.
    #[error("the image is a mosaic of many slices")]
    Mosaic,
    /// Floating-point pixels.
    #[error("the pixels are floating-point numbers")]
    FloatPixels,
    /// A number of bits that is not read.
    #[error(
        "the pixels have values of BitsStored {stored} up to HighBit {high_bit} in cells of BitsAllocated \
         {allocated}; espalier reads cells of 8 or 16 bits"
    )]
    Bits {
        /// The bits of a cell.
        allocated: u32,
        /// The bits of a value.
        stored: u32,
        /// Its highest bit.
        high_bit: u32,
    },
    /// A compression that is not read.
    #[error("the transfer syntax is {name}")]
    Syntax {
        /// What it is.
        name: &'static str,
    },
}

impl Obstacle {
    fn code(&self) -> &'static str {
        match self {
            Self::Damaged { .. } => "E-DICOM-DAMAGED",
            Self::Truncated { .. } => "E-DICOM-TRUNCATED",
            Self::NoField { .. } | Self::Field { .. } => "E-DICOM-FIELD",
            Self::Color { .. } => "E-DICOM-COLOR",
            Self::MultiFrame { .. } | Self::Mosaic => "E-DICOM-MULTIFRAME",
            Self::FloatPixels | Self::Bits { .. } => "E-DICOM-BITS",
            Self::Syntax { .. } => "E-DICOM-SYNTAX",
        }
    }

    fn hint(&self) -> &'static str {
        match self {
            Self::Damaged { .. } | Self::Truncated { .. } => {
                "the copy or export was not completed: fetch the file again, or take it out of the folder"
            }
            Self::NoField { .. } | Self::Field { .. } => {
                "this is not a slice of a scan (a photograph, a screenshot, a projection), or its export lost the geometry: \
                 export the original series again"
            }
            Self::Color { .. } => "choose the original series, not a coloured rendering of it",
            Self::MultiFrame { .. } | Self::Mosaic => {
                "convert it to one file a slice or to NIfTI first, for example with dcm2niix"
            }
            Self::FloatPixels | Self::Bits { .. } => "convert it to NIfTI first, for example with dcm2niix",
            Self::Syntax { .. } => {
                "export it uncompressed, or convert it, for example with `gdcmconv --raw` or dcm2niix"
            }
        }
    }
}

/// One of several series that could be meant, without anything of the patient.
#[derive(Clone, Debug, PartialEq)]
pub struct Listed {
    /// What `--series` takes.
    pub index: usize,
    /// The number that the scanner gave it.
    pub number: Option<i64>,
    /// The kind of scanner, such as CT.
    pub modality: String,
    /// How many images there are.
    pub n_images: usize,
    /// Pixels along x and y.
    pub size: [usize; 2],
    /// The distances of pixels and slices in mm; NaN where they are not known.
    pub spacing_mm: [f64; 3],
    /// What else there is to say.
    pub remark: String,
}

impl fmt::Display for Listed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = self.number.map_or("without a number".to_owned(), |number| format!("number {number}"));
        let modality = if self.modality.is_empty() { "unknown kind" } else { &self.modality };
        let [nx, ny] = self.size;
        write!(f, "--series {}: {number}, {modality}, {} images of {nx}x{ny}", self.index, self.n_images)?;
        let [x, y, z] = self.spacing_mm;
        if z.is_finite() {
            write!(f, ", {x:.3} x {y:.3} x {z:.3} mm")?;
        }
        if self.remark.is_empty() { Ok(()) } else { write!(f, " ({})", self.remark) }
    }
}

/// What keeps slices from being a volume as they are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Irregularity {
    /// How far the gantry is tilted: degrees between the slices' normal and the line through their first pixels, and
    /// how far each slice is aside of the one before, in mm.
    pub tilt: Option<(f64, f64)>,
    /// How far a slice is aside of where the others would have it, in mm.
    pub aside_mm: Option<f64>,
    /// The smallest, the usual and the largest distance between slices, in mm, and how far a slice is from an even
    /// place.
    pub uneven: Option<[f64; 4]>,
    /// How many slices are missing, after which one from 1, and its position along the normal in mm.
    pub missing: Vec<(usize, usize, f64)>,
}

impl Irregularity {
    /// Whether there is none.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    fn code(&self) -> &'static str {
        match self {
            Self { tilt: Some(_), .. } => "E-DICOM-TILT",
            Self { missing, .. } if !missing.is_empty() => "E-DICOM-GAP",
            _ => "E-DICOM-SPACING",
        }
    }
}

impl fmt::Display for Irregularity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        if let Some((degrees, aside_mm)) = self.tilt {
            parts.push(format!(
                "the gantry is tilted by {degrees:.1} degrees, so that each slice lies {aside_mm:.3} mm aside of the one before"
            ));
        }
        if let Some(aside_mm) = self.aside_mm {
            parts.push(format!("a slice lies {aside_mm:.3} mm aside of the line of the others"));
        }
        for (n_missing, after, position) in self.missing.iter().take(3) {
            let what =
                if *n_missing == 1 { "one slice is".to_owned() } else { format!("{n_missing} slices are") };
            parts.push(format!("{what} missing after slice {after} at {position:.2} mm along the normal"));
        }
        if self.missing.len() > 3 {
            parts.push(format!("there are {} more gaps", self.missing.len() - 3));
        }
        if let Some([smallest, usual, largest, off]) = self.uneven {
            parts.push(format!(
                "the distances between slices go from {smallest:.3} to {largest:.3} mm (mostly {usual:.3} mm), up to {off:.3} mm off an even spacing"
            ));
        }
        f.write_str(&parts.join("; "))
    }
}

/// Why a DICOM series cannot be read.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum DicomError {
    /// No image in the folder.
    #[error(
        "there is no DICOM image in the folder: {n_files} files, {n_objects} of them DICOM without pixels"
    )]
    NoImages {
        /// How many files there are.
        n_files: usize,
        /// How many are DICOM.
        n_objects: usize,
    },
    /// A file without an image.
    #[error("this is DICOM without an image: a report, a plan, or a directory of files")]
    NoImage,
    /// A folder of more files than a study has.
    #[error("there are more than {limit} files in the folder")]
    TooManyFiles {
        /// How many are looked at.
        limit: usize,
    },
    /// Several series, or none that is whole.
    #[error("the folder holds {} DICOM series, and which one is meant is not said", .series.len())]
    Ambiguous {
        /// The series.
        series: Vec<Listed>,
    },
    /// No such series.
    #[error("series {index} was asked for, there are {}, counted from 1", .series.len())]
    NoSuchSeries {
        /// The one asked for.
        index: usize,
        /// The series.
        series: Vec<Listed>,
    },
    /// The file, or what was chosen, is no slice.
    #[error("{obstacle}{}", .file.as_ref().map_or(String::new(), |file| format!(" (in {file})")))]
    Unfit {
        /// Why not.
        obstacle: Obstacle,
        /// The file's own name, where a folder was given.
        file: Option<String>,
    },
    /// One slice has no thickness that could be relied on.
    #[error("there is a single slice, which is no volume")]
    SingleSlice,
    /// Several images of one place that differ.
    #[error("{n} places have several images that differ, the first at {position:.2} mm along the normal")]
    Duplicates {
        /// How many places.
        n: usize,
        /// The first of them.
        position: f64,
    },
    /// Slices that are no even stack.
    #[error("the slices are no even stack: {0}")]
    Irregular(Box<Irregularity>),
    /// Pixels that cannot be decoded.
    #[error("the pixels cannot be decoded: {what} (in {file})")]
    Pixels {
        /// What the decoder says.
        what: String,
        /// The file's own name.
        file: String,
    },
}

impl Diagnose for DicomError {
    fn code(&self) -> &'static str {
        match self {
            Self::NoImages { .. } | Self::NoImage => "E-DICOM-NONE",
            Self::TooManyFiles { .. } => "E-DICOM-FILES",
            Self::Ambiguous { .. } | Self::NoSuchSeries { .. } => "E-DICOM-SERIES",
            Self::Unfit { obstacle, .. } => obstacle.code(),
            Self::SingleSlice => "E-DICOM-SINGLE",
            Self::Duplicates { .. } => "E-DICOM-DUPLICATE",
            Self::Irregular(irregularity) => irregularity.code(),
            Self::Pixels { .. } => "E-DICOM-PIXELS",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::TooManyFiles { .. } => Class::Limit,
            Self::Ambiguous { .. } | Self::NoSuchSeries { .. } => Class::Usage,
            _ => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::NoImages { .. } | Self::NoImage => {
                "give the folder with the series, or one file of it".to_owned()
            }
            Self::TooManyFiles { .. } => "give the folder of the one series".to_owned(),
            Self::Ambiguous { series } | Self::NoSuchSeries { series, .. } => choices(series),
            Self::Unfit { obstacle, .. } => obstacle.hint().to_owned(),
            Self::SingleSlice => "give the folder with all slices of the series".to_owned(),
            Self::Duplicates { .. } => {
                "the folder holds two reconstructions or times of one scan: keep the files of one of them"
                    .to_owned()
            }
            Self::Irregular(_) => {
                "resample the slices to an even orthogonal grid with `--resample`, or `resample = true` \
                                   under [input]; or give all slices of the series"
                    .to_owned()
            }
            Self::Pixels { .. } => "the copy or export was not completed: fetch the file again".to_owned(),
        }
    }
}

/// The most series that are shown.
const MAX_LISTED: usize = 40;

fn choices(series: &[Listed]) -> String {
    let mut text = "choose one of these, or write `series = N` under [input]".to_owned();
    for listed in series.iter().take(MAX_LISTED) {
        text.push_str(&format!("\n    {listed}"));
    }
    if series.len() > MAX_LISTED {
        text.push_str(&format!("\n    and {} more", series.len() - MAX_LISTED));
    }
    text
}
