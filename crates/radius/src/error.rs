//! Why radii cannot be measured.

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;

/// Why radii cannot be measured.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Mask and skeleton lie on different grids.
    #[error(
        "mask and skeleton lie on different grids: {}x{}x{} and {}x{}x{} voxels, or another place in space",
        .mask[0], .mask[1], .mask[2], .skeleton[0], .skeleton[1], .skeleton[2]
    )]
    GridMismatch {
        /// The mask's extents.
        mask: [usize; 3],
        /// The skeleton's extents.
        skeleton: [usize; 3],
    },
    /// The skeleton has no voxel.
    #[error("the skeleton is empty: it has 0 voxels, so there is nothing to measure")]
    EmptySkeleton,
    /// A skeleton voxel is background in the mask.
    #[error("skeleton voxel ({}, {}, {}) is background in the mask", .voxel[0], .voxel[1], .voxel[2])]
    OutsideMask {
        /// The first such voxel (x, y, z).
        voxel: [u32; 3],
    },
    /// Voxels so much longer than wide that no sphere can be measured.
    #[error("voxels are {ratio:.0} times as long as wide ({} x {} x {} mm): that is no scan's", .spacing_mm[0], .spacing_mm[1], .spacing_mm[2])]
    Uneven {
        /// The longest side over the shortest.
        ratio: f64,
        /// The spacing.
        spacing_mm: [f64; 3],
    },
    /// The distances of all voxels need more memory than allowed.
    #[error("the distances of all voxels need {needed} bytes of memory, allowed are {limit}")]
    FieldTooLarge {
        /// How many bytes are needed.
        needed: u64,
        /// How many are allowed.
        limit: u64,
    },
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::GridMismatch { .. } => "E-RADIUS-GRID",
            Self::EmptySkeleton => "E-RADIUS-EMPTY",
            Self::Uneven { .. } => "E-RADIUS-UNEVEN",
            Self::OutsideMask { .. } => "E-RADIUS-OUTSIDE-MASK",
            Self::FieldTooLarge { .. } => "E-RADIUS-FIELD-TOO-LARGE",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::FieldTooLarge { .. } => Class::Limit,
            Self::GridMismatch { .. }
            | Self::EmptySkeleton
            | Self::OutsideMask { .. }
            | Self::Uneven { .. } => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::GridMismatch { .. } | Self::OutsideMask { .. } => {
                "give the mask that the skeleton was thinned from".to_owned()
            }
            Self::FieldTooLarge { .. } => "raise --max-memory, or leave radius.field off".to_owned(),
            Self::Uneven { .. } => {
                "check the spacing in the header, or take other voxels with volume.resample_mm".to_owned()
            }
            Self::EmptySkeleton => "thin with thinning = \"safe\", which lets nothing vanish".to_owned(),
        }
    }
}
