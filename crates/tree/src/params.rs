//! Settings of the tree stage.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What to do with a skeleton in several pieces. Short gaps are mostly stretches that the segmentation lost, and a
/// reader expects the vessel to go on; distant pieces are other vessels or noise, and an edge to them would be a vessel
/// that is not there. But a tree of its own, such as the vessels of the other lung, belongs in the picture, edge or no.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Components {
    /// Keep the longest, join to it what lies within `bridge_mm`, and over any gap what is a tree of its own, drop the
    /// others; each bridge and each drop is in the ledger, and a warning tells of the long bridges.
    #[default]
    Join,
    /// Keep the longest, drop the others; each drop is in the ledger.
    Largest,
    /// Join all to the longest, over gaps of any width: a forest in one picture, each bridge in the ledger.
    All,
    /// Refuse the skeleton.
    Refuse,
}

/// What to do with loops.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Loops {
    /// Open each at its thinnest place; each cut is in the ledger.
    #[default]
    Cut,
    /// Refuse the skeleton.
    Refuse,
}

/// Where the tree is rooted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Root {
    /// At the tip of the largest calibre.
    #[default]
    ThickestTip,
    /// At the superior end of the trachea: of the tips with at least half the largest calibre the most superior one.
    Superior,
}

/// Where the free ends of the tree are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Tips {
    /// At the centre of the sphere that touches the end of the mask: drawn with its radius, as round cones are,
    /// the tree fills the mask and goes no further. Where the scan cuts a vessel off, at the border.
    #[default]
    Sphere,
    /// At the end of the mask, at most a radius beyond the last sphere.
    Surface,
    /// Where thinning ended.
    Keep,
}

/// How densely nodes stand on a branch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Resample {
    /// `shape` for masks, `none` for traced trees, whose nodes are the annotator's.
    #[default]
    Auto,
    /// Where the shape changes: Douglas–Peucker with `tolerance`.
    Shape,
    /// Every `step_mm`.
    Step,
    /// As they come.
    None,
}

/// What to do with several roots of a traced structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Roots {
    /// Keep the tree of the greatest length, drop the others; each drop is in the ledger.
    #[default]
    Largest,
    /// Join each further root to the nearest node of the tree of the greatest length by a straight edge.
    Join,
    /// Refuse the structure.
    Refuse,
}

/// What to do with nodes of a traced structure that have radius 0, which means "not measured".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MissingRadii {
    /// The mean of the nearest measured radii above and below; 0 where there is none at all.
    #[default]
    Neighbours,
    /// Leave them 0.
    Keep,
}

/// Settings of the tree stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// What to do with a skeleton in several pieces. Default `join`. It matters only if `volume.components` left several.
    pub components: Components,
    /// With `components = "join"`: the widest gap that is bridged, from surface to surface, in mm; 0 to 1000. Default 3,
    /// about the width of the lung's subsegmental vessels; a gap wider than the island is long is never bridged, but for
    /// one of at least a tenth of the longest's length, which is joined over any. Larger joins more, and more that does
    /// not belong together.
    pub bridge_mm: f64,
    /// What to do with loops. Default `cut`: real masks are never trees.
    pub loops: Loops,
    /// Where the tree is rooted. Default `thickest-tip`; `superior` for airways.
    pub root: Root,
    /// A point in RAS+ mm; if given, the tip nearest to it is the root, whatever `root` says. Default none.
    pub root_mm: Option<[f64; 3]>,
    /// A terminal branch shorter than this multiple of the radius at its fork is a spur. Dimensionless, 0 to 10;
    /// 0, with `prune_min_mm` 0, prunes none, not even branches in the lumen of others. Default 1.5: on phantoms it
    /// kept 98–100 % of the tips at 98–100 % precision, where one length in mm for the whole tree destroys half of a
    /// small one. Larger prunes more.
    pub prune_factor: f64,
    /// A terminal branch shorter than this is a spur, whatever its fork's radius. In mm, at least 0. Default 0.
    /// Larger prunes more.
    pub prune_min_mm: f64,
    /// Standard deviation of the Gaussian that smooths branches, in voxels along the branch (its largest
    /// projected spacing). 0 to 4, 0 smooths nothing. Default 1, enough to take the voxel staircase away;
    /// of a branch thicker than four voxels a quarter of its radius times this, as its axis wanders more. Larger cuts corners.
    pub smooth_voxels: f64,
    /// Where the free ends are; either way they are led along their tangent, since thinning ends them anywhere
    /// between the last sphere and the surface. Default `sphere`: the length of a tube with round ends is that of its
    /// axis. `surface` makes each end longer by its radius.
    pub tips: Tips,
    /// How densely nodes stand on a branch. Default `auto`.
    pub resample: Resample,
    /// With `resample = "shape"`: how far the tree may leave the smoothed centreline, and its radius the
    /// smoothed radius, as a share of the local radius. Above 0, at most 1. Default 0.05: chords cut a bend short by a
    /// third of a percent at most. Larger gives fewer nodes.
    pub tolerance: f64,
    /// With `resample = "step"`: the distance between nodes, in mm, above 0. Default 2. Larger gives fewer nodes.
    pub step_mm: f64,
    /// What to do with several roots of a traced structure. Default `largest`.
    pub roots: Roots,
    /// What to do with nodes of a traced structure that have radius 0. Default `neighbours`.
    pub missing_radii: MissingRadii,
    /// A label map, such as lobes: the label along most of each branch goes to `branches.tsv`. A volume on any grid in
    /// the tree's space; whole numbers, 0 is no label. The path is relative to the config. Default none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<String>,
    /// Names of the labels: a line for each with value and name, or a colour table of 3D Slicer or ITK-SNAP. The path
    /// is relative to the config. Default none: labels go by their values.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub label_names: Option<String>,
    /// How far the nearest label may be from a branch that lies in none, in mm. 0 to 20. Default 5: a main bronchus runs
    /// outside of all lobes, but near to one. Larger gives labels to more branches.
    pub label_reach_mm: f64,
    /// The least narrowing that `stenoses.tsv` lists, in percent of the reference diameter. 1 to 99. Default 25, where
    /// CAD-RADS lets mild stenoses begin [Cury2016]. Larger lists fewer.
    pub stenosis_percent: f64,
    /// Whether `branches.nii.gz` is written, the mask by branch. Default true; it costs the compression of a volume of
    /// the mask's size.
    pub branch_volume: bool,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            components: Components::default(),
            bridge_mm: 3.0,
            loops: Loops::default(),
            root: Root::default(),
            root_mm: None,
            prune_factor: 1.5,
            prune_min_mm: 0.0,
            smooth_voxels: 1.0,
            tips: Tips::default(),
            resample: Resample::default(),
            tolerance: 0.05,
            step_mm: 2.0,
            roots: Roots::default(),
            missing_radii: MissingRadii::default(),
            labels: None,
            label_names: None,
            label_reach_mm: 5.0,
            stenosis_percent: 25.0,
            branch_volume: true,
        }
    }
}

impl Params {
    /// Checks all ranges.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let in_range = |key, value: f64, low: f64, high: f64| {
            ParamError::check(
                key,
                (low..=high).contains(&value),
                format!("must be between {low} and {high}, is {value}"),
            )
        };
        in_range("bridge_mm", self.bridge_mm, 0.0, 1000.0)?;
        in_range("prune_factor", self.prune_factor, 0.0, 10.0)?;
        in_range("prune_min_mm", self.prune_min_mm, 0.0, 1e6)?;
        in_range("smooth_voxels", self.smooth_voxels, 0.0, 4.0)?;
        in_range("tolerance", self.tolerance, 1e-6, 1.0)?;
        in_range("step_mm", self.step_mm, 1e-9, 1e9)?;
        in_range("label_reach_mm", self.label_reach_mm, 0.0, 20.0)?;
        in_range("stenosis_percent", self.stenosis_percent, 1.0, 99.0)?;
        let has_map = self.labels.is_some() || self.label_names.is_none();
        ParamError::check("label_names", has_map, "names labels, but `labels` names no label map")?;
        let is_point = self.root_mm.is_none_or(|point| point.iter().all(|c| c.is_finite()));
        ParamError::check("root_mm", is_point, format!("must be three finite numbers, is {:?}", self.root_mm))
    }
}
