//! What the caller may choose: how a file is read.

use espalier_model::RAS_FROM_LPS;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How a file is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// The most bytes that the voxels may take in memory; a file that declares more is refused before anything
    /// is allocated. Default: 4 GiB, room for 1290³ voxels of 16 bits.
    pub max_bytes: u64,
    /// Which volume of a 4D file, from 0. Default: none, so that a 4D file is refused by name.
    pub volume_index: Option<usize>,
    /// What to take the voxel axes for when the file does not say. Default: none, so that it is refused.
    pub assume_space: Option<AssumedSpace>,
    /// Mm for one unit of the file's coordinates, whatever its header says; above 0. Default: the header's.
    pub unit_mm: Option<f64>,
    /// Refuse sheared voxel axes instead of resampling the volume to orthogonal ones. Default: no.
    pub strict: bool,
    /// Which DICOM series of a folder, from 1 as the message lists them. Default: none, so that a folder of several is
    /// refused with the list.
    pub series: Option<usize>,
    /// Resample DICOM slices of a tilted gantry, with gaps or at uneven distances to an even orthogonal grid. Default:
    /// no, so that they are refused with the reason.
    pub resample: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            max_bytes: 4 << 30,
            volume_index: None,
            assume_space: None,
            unit_mm: None,
            strict: false,
            series: None,
            resample: false,
        }
    }
}

/// The space of a file that does not name it: where its axes x, y and z point in the body. Without directions of
/// their own the voxel axes are these, and voxel (0, 0, 0) is the origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AssumedSpace {
    /// Right, anterior, superior: what the NIfTI-1 standard says ("method 1").
    Ras,
    /// Left, anterior, superior: what ANALYZE files were mostly meant as, and how several programs read them.
    Las,
    /// Left, posterior, superior: the axes of DICOM, ITK and most NRRD files.
    Lps,
}

impl AssumedSpace {
    /// For each axis 1 where it points along R, A or S, -1 where it points against it.
    #[must_use]
    pub fn ras_signs(self) -> DVec3 {
        match self {
            Self::Ras => DVec3::new(1.0, 1.0, 1.0),
            Self::Las => DVec3::new(-1.0, 1.0, 1.0),
            Self::Lps => RAS_FROM_LPS,
        }
    }
}
