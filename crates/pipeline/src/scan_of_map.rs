//! The scan that a map shows: whether there is one, and as much of it as the map needs.
//!
//! **Input** the config; later the tree. **Output** the part of the scan around the tree.
//! **Guarantees** a run that will have no scan to show ends before its first stage. Memory is the box of the tree with
//! what is shown around it, 4 bytes a voxel.

use espalier_model::diagnose::{Class, Diagnose};
use espalier_model::{Report, Tree, Volume};
use espalier_render::{Params, Style};
use espalier_volume::Kind;
use glam::DVec3;
use thiserror::Error;

use crate::config::{Config, Source};
use crate::error::Error;
use crate::side_file::SideFile;
use crate::steps::Step;

/// Why there is no scan to show.
#[derive(Debug, Error)]
pub(crate) enum NoScan {
    /// The run begins with something else.
    #[error("render.style = \"volume\" shows a scan along the branches, but the input is {what}")]
    Input {
        /// What it is.
        what: &'static str,
    },
    /// The file has two values, or one.
    #[error("it has no values to show along the branches: it is {what}")]
    Flat {
        /// What it is.
        what: &'static str,
    },
    /// Nothing of the tree lies in the file.
    #[error("nothing of it lies within the tree's box: {tree} (RAS+ mm)")]
    Elsewhere {
        /// The box of the tree.
        tree: String,
    },
}

impl Diagnose for NoScan {
    fn code(&self) -> &'static str {
        match self {
            Self::Input { .. } | Self::Flat { .. } => "E-RENDER-NO-SCAN",
            Self::Elsewhere { .. } => "E-RENDER-ELSEWHERE",
        }
    }

    fn class(&self) -> Class {
        if matches!(self, Self::Input { .. }) { Class::Usage } else { Class::Input }
    }

    fn hint(&self) -> String {
        "name the scan that it was made from, in the same space: --image FILE (render.volume.image), or choose another \
         render.style"
            .to_owned()
    }
}

/// Whether the map of a config shows the run's own input.
pub(crate) fn is_of_input(config: &Config) -> bool {
    config.render.style == Style::Volume && SideFile::Image.path_in(config).is_none()
}

/// Refuses a config whose map would have no scan to show.
pub(crate) fn check(config: &Config, source: &Source) -> Result<(), NoScan> {
    if !is_of_input(config) {
        return Ok(());
    }
    match source {
        Source::PhantomScan(_) => Ok(()),
        Source::Volume(_) if config.volume.is_of_scan() => Ok(()),
        Source::Volume(_) => Err(NoScan::Input { what: "a mask or a label map" }),
        Source::Tree(_) | Source::PhantomTree(_) => Err(NoScan::Input { what: "a traced tree" }),
    }
}

/// The part of the scan that the map of a tree shows, with what its reader had to say.
pub(crate) fn of_tree(step: &mut Step<'_>, tree: &Tree, params: &Params) -> Result<(Volume, Report), Error> {
    let corners_mm = box_of(tree, |radius_mm| params.volume.farthest_mm(radius_mm));
    let (cropped, path) =
        step.take(|artifacts, lookup| artifacts.scan_in_box(lookup, (SideFile::Image, corners_mm, 1)))?;
    let refused = |problem: NoScan| Error::file(&path, problem);
    let what = match cropped.kind {
        Kind::Mask { .. } => Some("a mask"),
        Kind::Constant { .. } => Some("one value everywhere"),
        Kind::Labels { .. } | Kind::Ct { .. } => None,
    };
    match (cropped.volume, what) {
        (None, _) => Err(refused(NoScan::Elsewhere { tree: in_words(box_of(tree, |_| 0.0)) })),
        (Some(_), Some(what)) => Err(refused(NoScan::Flat { what })),
        (Some(volume), None) => Ok((volume, cropped.report)),
    }
}

/// The corners of the box that holds a ball around each node.
fn box_of(tree: &Tree, ball_mm: impl Fn(f64) -> f64) -> [DVec3; 2] {
    tree.nodes().iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], node| {
        let ball_mm = ball_mm(node.radius_mm);
        [low.min(node.position_mm - ball_mm), high.max(node.position_mm + ball_mm)]
    })
}

fn in_words([low, high]: [DVec3; 2]) -> String {
    let part = |(name, axis): (&str, usize)| format!("{name} {:.0} to {:.0}", low[axis], high[axis]);
    [("x", 0), ("y", 1), ("z", 2)].map(part).join(", ")
}
