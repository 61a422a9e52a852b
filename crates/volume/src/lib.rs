//! CT volumes in, masks out.
//!
//! | step | file |
//! |---|---|
//! | bytes of a file, decompressed and bounded | `source` |
//! | what all formats come to: header read, voxels still in the file | `stored`, `scalar` |
//! | which format a file has | `recognise` |
//! | NIfTI-1 and -2: the header, checked; the affine ladder; pairs of files | `nifti/*` |
//! | NRRD and MetaImage: headers of text, data files, numbers written out | `nrrd/*`, `metaimage`, `text`, `ascii`, `detached` |
//! | DICOM: the slices of a folder | `dicom/*` |
//! | stored numbers of any type and byte order | `decode` |
//! | what stands between voxels; sheared axes to orthogonal ones | `interpolate`, `orthogonal` |
//! | **[`read`]**: file → [`Volume`](espalier_model::Volume) | `read` |
//! | the part of a volume in a box of the world, for who needs no more | `crop` |
//! | what a volume is: mask, labels, CT | `kind` |
//! | mask, label, threshold band | `select`, `choose` |
//! | labels by name | `labels`, `labels/classes` |
//! | region growing from a seed | `region_grow` |
//! | where a region leaks | `growth` |
//! | where the trachea is | `trachea` |
//! | a scan or a mask at another spacing | `resample` |
//! | gaps closed | `closing` |
//! | connected components by runs of voxels | `runs`, `components` |
//! | cavities filled | `cavities` |
//! | tunnels counted, and closed where they are faults | `euler`, `heal` |
//! | what lies between thick slices | `thick` |
//! | **[`segment`]**: `Volume` → [`Mask`](espalier_model::Mask) | `segment` |
//! | **[`read_mask`]**: file → `Mask`, without holding the volume where values alone decide | `read_mask`, `stream` |
//! | **[`survey()`]**: what a file is | `survey` |
//! | **[`open_pieces`]**: file → values, without holding the volume | `pieces` |
//!
//! **Spaces** World is RAS+ mm. A voxel is (x, y, z), x fastest: of a volume on the file's own axes, of a mask on those
//! of [`Orientation`].
//!
//! **Architecture Invariant:** this is the only stage that reads files, and it writes none. No byte of a file
//! makes it panic, recurse, or hold more than the limit that the caller states.

mod gzip;
mod recognise;
mod scalar;
mod source;
mod stored;

mod ascii;
mod detached;
mod text;

mod dicom;
mod metaimage;
mod nifti;
mod nrrd;

mod crop;
mod decode;
mod interpolate;
mod orthogonal;
mod read;

mod choose;
mod growth;
mod half_maximum;
mod kind;
mod labels;
mod level_flood;
mod margin;
mod region_grow;
mod resample;
mod runs;
mod select;
mod surroundings;
mod trachea;

mod cavities;
mod closing;
mod components;
mod euler;
#[cfg(test)]
mod flood;
mod heal;
mod segment;
mod thick;

mod pieces;
mod read_mask;
mod stream;

mod survey;

mod error;
mod options;
mod params;
mod read_error;
mod spacing;

pub use crop::{Cropped, read_box};
pub use dicom::{DicomError, Irregularity, Listed, Obstacle, is_dicom_folder};
pub use error::Error;
pub use growth::{GROWTH_COLUMNS, Growth, Knee, Level, Towards};
pub use half_maximum::HalfMaximum;
pub use kind::{Kind, check_regions, inspect_kind};
pub use labels::{Label, Labels};
pub use margin::Margin;
pub use options::{AssumedSpace, ReadOptions};
pub use params::{Components, Method, Orientation, Params, Preset};
pub use pieces::{Pieces, open_pieces};
pub use read::{Loaded, files, read};
pub use read_error::ReadError;
pub use read_mask::{read_mask, read_nonzero};
pub use segment::{Segmented, clean, in_order, segment};
pub use spacing::Spacing;
pub use survey::{MaskSurvey, Survey, survey};
pub use trachea::{SEED_COLUMNS, SeedCandidate, seeds_to_tsv};
