//! Parameters of the radius measurement.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of the radius measurement: `[radius]` in the config.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Where the distance is read. Default `ridge`.
    pub rule: Rule,
    /// How many times a centre may climb by three quarters of a voxel towards the ridge after the first, where the
    /// section is not round, 0–10. Default 3: thinning leaves
    /// the skeleton at most two or three voxels off the axis. Larger values only help masks with very uneven
    /// walls.
    pub climb_steps: u32,
    /// Added to each radius, in voxels of the smallest spacing, −1 to 1. Default 0: a voxel belongs to the mask if
    /// its centre does, so the nearest background centre lies where the boundary is. −0.5 suits masks that hold
    /// every voxel they touch, 0.5 masks that hold only voxels inside as a whole.
    pub offset_voxels: f64,
    /// Whether radii reach to where the scan shows the wall, which is not where a threshold has ended the mask: a mask of
    /// airways grown to −900 HU ends up to a voxel before the wall. Default `auto`.
    pub wall: Wall,
    /// The scan in which the wall is looked for, in the mask's space. Default: the run's own input. A mask or a label map as
    /// input has no walls of its own; name the scan that it was made from.
    pub image: Option<String>,
    /// Whether `distance.nii.gz` is written beside the radii: for every voxel of the mask the exact distance to the
    /// nearest background centre, in mm, single precision. Default false: it takes eight bytes of memory for each voxel
    /// of the organ's box, and nothing later reads it.
    pub field: bool,
}

/// Where the distance to the background is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// On the axis: where the cross-section is round, its centroid and the radius of the circle of its area;
    /// elsewhere the ridge of the distance between voxels, across the branch.
    #[default]
    Ridge,
    /// The largest distance among the 27 voxels about the skeleton voxel.
    NeighborhoodMax,
    /// At the skeleton voxel itself, as most programs do; too small, since skeletons run off the axis.
    Voxel,
}

/// Where a branch ends sideways.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Wall {
    /// `scan` where a scan is at hand: one that is named, or the input, where its intensities have chosen the mask; else
    /// `mask`.
    #[default]
    Auto,
    /// At the mask's surface.
    Mask,
    /// Where a blurred tube fitted to the scan's values has its wall.
    Scan,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            rule: Rule::Ridge,
            climb_steps: 3,
            offset_voxels: 0.0,
            wall: Wall::Auto,
            image: None,
            field: false,
        }
    }
}

impl Params {
    /// Checks the ranges.
    ///
    /// # Errors
    /// At the first value outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        ParamError::check(
            "climb_steps",
            self.climb_steps <= 10,
            format!("must be 0 to 10, is {}", self.climb_steps),
        )?;
        let is_used = self.wall != Wall::Mask || self.image.as_ref().is_none_or(String::is_empty);
        ParamError::check("image", is_used, "has no use with radius.wall = \"mask\"")?;
        ParamError::check(
            "offset_voxels",
            (-1.0..=1.0).contains(&self.offset_voxels),
            format!("must be -1 to 1, is {}", self.offset_voxels),
        )
    }
}
