//! What can go wrong when a picture is drawn.

use espalier_model::diagnose::{Class, Diagnose, ParamError};
use thiserror::Error;

/// Why there is no picture.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter outside its range.
    #[error(transparent)]
    Param(#[from] ParamError),
    /// The embedding was made for another tree.
    #[error("the embedding has {n_entries} {what} for a tree of {n_nodes} nodes")]
    Mismatch {
        /// Which of its vectors.
        what: &'static str,
        /// How long that vector is.
        n_entries: usize,
        /// How many nodes the tree has.
        n_nodes: usize,
    },
    /// A coordinate that is not finite, or so large that no picture can hold it.
    #[error("node {node} has the {what} {value}, which no picture can hold")]
    Number {
        /// The node.
        node: usize,
        /// What the number is.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// The global view is not a view.
    #[error(
        "the global view looks along {towards_camera} with {up} up, which are not perpendicular unit vectors"
    )]
    View {
        /// Its direction.
        towards_camera: glam::DVec3,
        /// Its up.
        up: glam::DVec3,
    },
    /// A picture of a scan without one.
    #[error("style = \"volume\" shows a scan along the branches, and there is none")]
    NoScan,
    /// A scan of something else, or in another space.
    #[error(
        "only {percent:.0} % of the tree's nodes lie in the scan; it holds {scan}, the tree lies in {tree} (RAS+ mm)"
    )]
    Elsewhere {
        /// How many nodes lie in it.
        percent: f64,
        /// The box of the scan, as far as it was read.
        scan: String,
        /// The box of the tree.
        tree: String,
    },
    /// A picture that is too large.
    #[error("a picture of {width} × {height} pixels is over the limit of {limit} pixels")]
    TooLarge {
        /// Its width.
        width: u32,
        /// Its height.
        height: u32,
        /// How many pixels are allowed.
        limit: u64,
    },
    /// The font that draws the text cannot be read.
    #[error("the built-in font cannot be read")]
    Font(#[from] ab_glyph::InvalidFont),
    /// The font cannot go into the PDF.
    #[error("the built-in font cannot be put into the PDF")]
    Pdf(#[from] subsetter::Error),
    /// The EXR encoder refused.
    #[error("the EXR cannot be encoded")]
    Exr(#[from] exr::error::Error),
}

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Param(error) => error.code(),
            Self::Mismatch { .. } => "E-RENDER-MISMATCH",
            Self::Number { .. } => "E-RENDER-NUMBER",
            Self::View { .. } => "E-RENDER-VIEW",
            Self::NoScan => "E-RENDER-NO-SCAN",
            Self::Elsewhere { .. } => "E-RENDER-ELSEWHERE",
            Self::TooLarge { .. } => "E-RENDER-SIZE",
            Self::Font(_) => "E-RENDER-FONT",
            Self::Pdf(_) => "E-RENDER-PDF",
            Self::Exr(_) => "E-RENDER-EXR",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Param(error) => error.class(),
            Self::NoScan => Class::Usage,
            Self::Mismatch { .. } | Self::Number { .. } | Self::View { .. } | Self::Elsewhere { .. } => {
                Class::Input
            }
            Self::TooLarge { .. } => Class::Limit,
            Self::Font(_) | Self::Pdf(_) | Self::Exr(_) => Class::Internal,
        }
    }

    fn hint(&self) -> String {
        match self {
            Self::Mismatch { .. } => "embed the same tree again and draw that".to_owned(),
            Self::Number { .. } => "check the unit and scale of the input".to_owned(),
            Self::View { .. } => "make views.json again with the views stage".to_owned(),
            Self::NoScan => {
                "name the scan with --image FILE (render.volume.image), or choose another style".to_owned()
            }
            Self::Elsewhere { .. } => {
                "name the scan that the tree was made from with --image FILE; both must be in the same space"
                    .to_owned()
            }
            Self::TooLarge { .. } => "choose a smaller width_px".to_owned(),
            _ => String::new(),
        }
    }
}
