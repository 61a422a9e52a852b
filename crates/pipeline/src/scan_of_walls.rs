//! The scan in which radii look for walls: whether there is one, and as much of it as the mask needs.
//!
//! **Input** the config; later the mask. **Output** the part of the scan around the mask.
//! **Guarantees** a run that asks for a scan and will have none, by what its config says, ends before its first stage; one that
//! does not ask for it keeps to the mask. Memory is the box of the organ with what a search for its wall reads around it, 4 bytes a voxel.

use espalier_model::diagnose::{Class, Diagnose};
use espalier_model::{Mask, Report, Volume};
use espalier_radius::Wall;
use espalier_volume::Kind;
use glam::DVec3;
use thiserror::Error;

use crate::config::{Config, Source};
use crate::error::Error;
use crate::side_file::SideFile;
use crate::steps::Step;

/// How far around the mask the scan is read, in its own voxels: the mask's are shorter where slices are thick.
const MARGIN_VOXELS: u32 = 7;

/// Why there is no scan with walls.
#[derive(Debug, Error)]
pub(crate) enum NoScan {
    /// The run begins with something else.
    #[error("radius.wall = \"scan\" looks for walls in a scan, but the input is a mask or a label map")]
    Input,
    /// The file is no scan.
    #[error("it has no walls to look for: it is {what}")]
    Flat {
        /// What it is.
        what: &'static str,
    },
    /// Nothing of the mask lies in the file.
    #[error("nothing of the mask lies in it")]
    Elsewhere,
}

impl Diagnose for NoScan {
    fn code(&self) -> &'static str {
        match self {
            Self::Input | Self::Flat { .. } => "E-RADIUS-NO-SCAN",
            Self::Elsewhere => "E-RADIUS-ELSEWHERE",
        }
    }

    fn class(&self) -> Class {
        if matches!(self, Self::Input) { Class::Usage } else { Class::Input }
    }

    fn hint(&self) -> String {
        "name the scan that the mask was made from, in the same space: radius.image; or keep to the mask: radius.wall = \
         \"mask\""
            .to_owned()
    }
}

/// Whether the radii of a config are looked for in the run's own input.
pub(crate) fn is_of_input(config: &Config, source: &Source) -> bool {
    let is_scan = match source {
        Source::PhantomScan(_) => true,
        Source::Volume(_) => config.volume.is_of_scan(),
        Source::Tree(_) | Source::PhantomTree(_) => false,
    };
    is_scan && config.radius.wall != Wall::Mask && SideFile::WallImage.path_in(config).is_none()
}

/// Refuses a config that asks for a scan where there is none.
pub(crate) fn check(config: &Config, source: &Source) -> Result<(), NoScan> {
    let has_scan = SideFile::WallImage.path_in(config).is_some() || is_of_input(config, source);
    if has_scan || config.radius.wall != Wall::Scan {
        return Ok(());
    }
    Err(NoScan::Input)
}

/// Whether radii are looked for in any scan.
fn is_wanted(config: &Config, source: &Source) -> bool {
    let is_named = SideFile::WallImage.path_in(config).is_some();
    config.radius.wall != Wall::Mask && (is_named || is_of_input(config, source))
}

/// About how many voxels of the scan will be read for a mask: those of a scan with the mask's grid; 0 where none is wanted.
pub(crate) fn n_voxels(config: &Config, source: &Source, mask: &Mask) -> u64 {
    let extent = |(first, last): ([usize; 3], [usize; 3])| -> f64 {
        (0..3).map(|axis| (last[axis] - first[axis] + 1) as f64 + f64::from(2 * MARGIN_VOXELS)).product()
    };
    let n_boxed = mask.bounding_box().map_or(0.0, extent).min(mask.grid().n_voxels() as f64);
    if is_wanted(config, source) { n_boxed as u64 } else { 0 }
}

/// The part of the scan around a mask, with what its reader had to say; none where the radii keep to the mask.
pub(crate) fn around(step: &mut Step<'_>, mask: &Mask) -> Result<Option<(Volume, Report)>, Error> {
    let is_named = SideFile::WallImage.path_in(step.config).is_some();
    let wanted = is_wanted(step.config, step.source);
    let Some(corners_mm) = box_of(mask).filter(|_| wanted) else { return Ok(None) };
    let side = SideFile::WallImage;
    let (cropped, path) =
        step.take(|artifacts, lookup| artifacts.scan_in_box(lookup, (side, corners_mm, MARGIN_VOXELS)))?;
    let what = match cropped.kind {
        Kind::Mask { .. } => Some("a mask"),
        Kind::Constant { .. } => Some("one value everywhere"),
        // Few whole values are a scan's too, if somebody says that it is one.
        Kind::Labels { .. } | Kind::Ct { .. } => None,
    };
    match (cropped.volume, what) {
        (Some(volume), None) => Ok(Some((volume, cropped.report))),
        // A preset leaves it open what the input is.
        (_, Some(_)) if !is_named && step.config.radius.wall == Wall::Auto => Ok(None),
        (None, _) => Err(Error::file(&path, NoScan::Elsewhere)),
        (Some(_), Some(what)) => Err(Error::file(&path, NoScan::Flat { what })),
    }
}

/// The corners of the box around a mask, RAS+ mm; none around an empty one.
fn box_of(mask: &Mask) -> Option<[DVec3; 2]> {
    let (first, last) = mask.bounding_box()?;
    let to_world = mask.grid().world_from_voxel();
    let corner = |i: usize| {
        let along = |axis: usize| match i >> axis & 1 {
            0 => first[axis] as f64,
            _ => last[axis] as f64,
        };
        to_world.transform_point3(DVec3::new(along(0), along(1), along(2)))
    };
    let corners = || (0..8).map(corner);
    Some([corners().fold(DVec3::INFINITY, DVec3::min), corners().fold(DVec3::NEG_INFINITY, DVec3::max)])
}
