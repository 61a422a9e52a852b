//! Why a mask has no curve skeleton.

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;

/// Why a mask has no curve skeleton.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The mask has no foreground voxel.
    #[error("the mask is empty: it has 0 foreground voxels, so there is nothing to thin")]
    EmptyMask,
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::EmptyMask => "E-SKELETON-EMPTY-MASK",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::EmptyMask => Class::Input,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::EmptyMask => "check the label or threshold that made the mask".to_owned(),
        }
    }
}
