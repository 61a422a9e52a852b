//! Which format a file has.
//!
//! **Input** the first bytes of a file, decompressed where it is compressed, and its name. **Output** [`Format`], or
//! what the file looks like instead.
//! **Steps** 1. what the bytes say; 2. only where they say nothing, the name: an `.img` file belongs to a `.hdr`.

use std::path::Path;

use crate::ReadError;

/// How many bytes are looked at.
pub(crate) const N_LOOKED_AT: usize = 512;

/// What is read, for messages.
pub(crate) const READABLE: &str = "NIfTI-1 and NIfTI-2 (.nii, .nii.gz, .hdr with .img), NRRD (.nrrd, .nhdr), \
                                   MetaImage (.mha, .mhd), folders of DICOM slices";

/// A format of volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// NIfTI-1 or NIfTI-2, alone or the header of a pair.
    Nifti,
    /// The data file of a pair, which has no header.
    NiftiImage,
    Nrrd,
    MetaImage,
}

impl Format {
    /// What its users call it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Nifti | Self::NiftiImage => "NIfTI",
            Self::Nrrd => "NRRD",
            Self::MetaImage => "MetaImage",
        }
    }
}

/// The first key of a MetaImage header, whichever it is.
const META_KEYS: [&str; 9] = [
    "ObjectType",
    "ObjectSubType",
    "NDims",
    "Comment",
    "TransformType",
    "Name",
    "ID",
    "BinaryData",
    "DimSize",
];

/// How files begin that are no volumes which are read here, what they are, and what to do.
const OTHERS: [(&[u8], &str, &str); 12] = [
    (b"PK\x03\x04", "a zip archive", "unpack it, and give the volume that is in it"),
    (b"BZh", "bzip2-compressed as a whole", "decompress it with bunzip2 first"),
    (b"\xFD7zXZ", "xz-compressed", "decompress it with unxz first"),
    (b"\x28\xB5\x2F\xFD", "zstd-compressed", "decompress it with unzstd first"),
    (b"\x89PNG", "a PNG picture", "give the volume itself, not a slice of it"),
    (b"\xFF\xD8\xFF", "a JPEG picture", "give the volume itself, not a slice of it"),
    (b"II*\0", "a TIFF picture", "convert the stack to .nrrd or .nii.gz, with its spacing"),
    (b"MM\0*", "a TIFF picture", "convert the stack to .nrrd or .nii.gz, with its spacing"),
    (b"\x89HDF", "an HDF5 file", "convert the volume in it to .nrrd or .nii.gz"),
    (
        b"# vtk DataFile",
        "a VTK file",
        "convert a volume to .nrrd or .nii.gz; a tree is read with input.kind = \"tree\"",
    ),
    (
        b"<VTKFile",
        "a VTK file",
        "convert a volume to .nrrd or .nii.gz; a tree is read with input.kind = \"tree\"",
    ),
    (
        b"<?xml",
        "an XML file",
        "convert a volume to .nrrd or .nii.gz; a tree is read with input.kind = \"tree\"",
    ),
];

/// The format of a file that begins with `start`.
pub(crate) fn recognise(start: &[u8], path: &Path) -> Result<Format, ReadError> {
    if let Some(format) = by_content(start) {
        return Ok(format);
    }
    if let Some((_, what, way_out)) = OTHERS.iter().find(|(magic, ..)| start.starts_with(magic)) {
        return Err(ReadError::Format { what, way_out: (*way_out).to_owned() });
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if name.ends_with(".img") || name.ends_with(".img.gz") {
        return Ok(Format::NiftiImage);
    }
    Err(ReadError::Format { what: "of no known format", way_out: format!("what can be read: {READABLE}") })
}

fn by_content(start: &[u8]) -> Option<Format> {
    let number = |bytes: [u8; 4]| [u32::from_le_bytes(bytes), u32::from_be_bytes(bytes)];
    let header_sizes = start.first_chunk().map_or([0; 2], |bytes| number(*bytes));
    if header_sizes.iter().any(|&size| size == 348 || size == 540) {
        return Some(Format::Nifti);
    }
    if start.starts_with(b"NRRD") {
        return Some(Format::Nrrd);
    }
    let first_line = start.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let key = String::from_utf8_lossy(first_line);
    let key = key.split_once('=').map(|(key, _)| key.trim());
    key.is_some_and(|key| META_KEYS.contains(&key)).then_some(Format::MetaImage)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(start: &[u8], name: &str) -> Result<Format, &'static str> {
        recognise(start, Path::new(name)).map_err(|error| match error {
            ReadError::Format { what, .. } => what,
            _ => "another error",
        })
    }

    #[test]
    fn content_goes_before_the_name() {
        assert_eq!(check(&348_u32.to_le_bytes(), "x.nrrd"), Ok(Format::Nifti));
        assert_eq!(check(&540_u32.to_be_bytes(), "x"), Ok(Format::Nifti));
        assert_eq!(check(b"NRRD0005\n", "x.nii"), Ok(Format::Nrrd));
        assert_eq!(check(b"ObjectType = Image\r\nNDims = 3\r\n", "x.nii"), Ok(Format::MetaImage));
        assert_eq!(check(b"NDims=3\n", "x"), Ok(Format::MetaImage));
        assert_eq!(check(b"\0\0\0\0", "x.IMG.gz"), Ok(Format::NiftiImage));
        assert_eq!(check(b"PK\x03\x04...", "x.img"), Err("a zip archive"));
        assert_eq!(check(b"Name: x", "x"), Err("of no known format"));
        assert_eq!(check(b"", "x"), Err("of no known format"));
    }
}
