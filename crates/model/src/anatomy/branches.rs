//! The measures of one branch, and `branches.tsv`.

use glam::DVec3;

use super::{number, or_none};
use crate::table::{Column, Table};

/// The region of a label map that a branch belongs to.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The value in the label map.
    pub label: i64,
    /// Its name; the value's digits where nobody has named it.
    pub name: String,
    /// Its colour, sRGB; none where nobody has given it one.
    pub color: Option<[u8; 3]>,
    /// How much of the branch's length lies in it, 0 to 1; 0 where it is only the nearest.
    pub share: f64,
}

/// What is measured on one branch.
///
/// Lengths in mm, points RAS+ mm, angles in degrees; `NaN` where a measure does not exist, such as the angle of a
/// branch without parent.
#[derive(Clone, Debug, PartialEq)]
pub struct BranchMeasures {
    /// Its index in [`Tree::branches`](crate::Tree::branches).
    pub branch: usize,
    /// The branch that it hangs from.
    pub parent: Option<usize>,
    /// The branches that hang from it.
    pub children: Vec<usize>,
    /// Forks between the root and the branch.
    pub generation: u32,
    /// Strahler order: 1 at tips.
    pub strahler: u32,
    /// Tips of its subtree, its own included.
    pub n_tips: usize,
    /// The fork or root that it starts from.
    pub start_node: usize,
    /// The fork or tip where it ends.
    pub end_node: usize,
    /// Where it starts.
    pub start_mm: DVec3,
    /// Where it ends.
    pub end_mm: DVec3,
    /// Path length from the root to its start.
    pub start_from_root_mm: f64,
    /// Length along the branch.
    pub length_mm: f64,
    /// Straight distance from start to end.
    pub chord_mm: f64,
    /// Mean radius over its length.
    pub radius_mean_mm: f64,
    /// Smallest radius.
    pub radius_min_mm: f64,
    /// Largest radius.
    pub radius_max_mm: f64,
    /// Loss of radius per length; negative where it widens.
    pub taper: f64,
    /// Volume of its truncated cones, in mm³.
    pub volume_mm3: f64,
    /// Lateral surface of its truncated cones, in mm².
    pub surface_mm2: f64,
    /// By how much it turns away from its parent; 0 is straight on.
    pub branching_angle_deg: f64,
    /// The angle to the nearest of its siblings.
    pub sibling_angle_deg: f64,
    /// Its mean radius as a share of its parent's.
    pub radius_to_parent: f64,
    /// The region of the label map that it belongs to, if there is one.
    pub region: Option<Region>,
    /// How many voxels of the mask are its own, where there is a mask.
    pub n_voxels: Option<usize>,
    /// The volume of these voxels, in mm³; `NaN` where there is no mask.
    pub mask_volume_mm3: f64,
}

impl BranchMeasures {
    /// Length over chord: 1 is straight. `NaN` for a branch that ends where it starts.
    #[must_use]
    pub fn tortuosity(&self) -> f64 {
        if self.chord_mm > 0.0 { self.length_mm / self.chord_mm } else { f64::NAN }
    }
}

/// A measure of a branch by its kind.
#[derive(Clone, Debug, PartialEq)]
pub enum MeasureValue {
    /// An index or a count; none where there is none.
    Whole(Option<usize>),
    /// A number; `NaN` where there is none.
    Number(f64),
    /// A word; empty where there is none.
    Text(String),
}

impl MeasureValue {
    /// Its cell in a table.
    #[must_use]
    pub fn cell(&self) -> String {
        match self {
            Self::Whole(whole) => or_none(*whole),
            Self::Number(value) => number(*value),
            Self::Text(text) if text.is_empty() => "n/a".to_owned(),
            Self::Text(text) => text.clone(),
        }
    }
}

/// A measure of a branch: its column, and how to get it.
#[derive(Clone, Copy, Debug)]
pub struct Measure {
    /// Name, unit and meaning.
    pub column: Column,
    /// Its value for a branch; always of the same kind.
    pub of: fn(&BranchMeasures) -> MeasureValue,
}

/// All measures of a branch, in the order of the columns of `branches.tsv`.
#[must_use]
pub fn branch_measures() -> &'static [Measure] {
    &MEASURES
}

const fn measure(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    of: fn(&BranchMeasures) -> MeasureValue,
) -> Measure {
    Measure { column: Column::new(name, unit, meaning), of }
}

fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

use MeasureValue::{Number, Text, Whole};

#[rustfmt::skip]
const MEASURES: [Measure; 34] = [
    measure("branch", "n/a", "index of the branch, the same in every file; its voxels in branches.nii.gz have this value plus 1",
        |b| Whole(Some(b.branch))),
    measure("parent", "n/a", "the branch that it hangs from; n/a at the root", |b| Whole(b.parent)),
    measure("children", "n/a", "the branches that hang from it, with commas between", |b| {
        Text(b.children.iter().map(usize::to_string).collect::<Vec<_>>().join(","))
    }),
    measure("generation", "1", "forks between the root and the branch: 0 at the root", |b| Whole(Some(b.generation as usize))),
    measure("strahler", "1", "Strahler order: 1 at tips, one more where two branches of the same highest order meet",
        |b| Whole(Some(b.strahler as usize))),
    measure("tips", "1", "tips of its subtree; 1 for a branch that ends in a tip", |b| Whole(Some(b.n_tips))),
    measure("start_node", "n/a", "the fork or root that it starts from, as in nodes.tsv", |b| Whole(Some(b.start_node))),
    measure("end_node", "n/a", "the fork or tip where it ends", |b| Whole(Some(b.end_node))),
    measure("start_x_mm", "mm", "where it starts, RAS+: towards the right", |b| Number(b.start_mm.x)),
    measure("start_y_mm", "mm", "where it starts: towards the front", |b| Number(b.start_mm.y)),
    measure("start_z_mm", "mm", "where it starts: upwards", |b| Number(b.start_mm.z)),
    measure("end_x_mm", "mm", "where it ends: towards the right", |b| Number(b.end_mm.x)),
    measure("end_y_mm", "mm", "where it ends: towards the front", |b| Number(b.end_mm.y)),
    measure("end_z_mm", "mm", "where it ends: upwards", |b| Number(b.end_mm.z)),
    measure("start_from_root_mm", "mm", "path length from the root to its start", |b| Number(b.start_from_root_mm)),
    measure("length_mm", "mm", "length along the branch, from fork to fork or tip", |b| Number(b.length_mm)),
    measure("chord_mm", "mm", "straight distance from its start to its end", |b| Number(b.chord_mm)),
    measure("tortuosity", "1", "length over chord: 1 is straight", |b| Number(b.tortuosity())),
    measure("radius_mean_mm", "mm", "mean radius over its length; the fork that it starts from counts with its parent",
        |b| Number(b.radius_mean_mm)),
    measure("radius_min_mm", "mm", "smallest radius", |b| Number(b.radius_min_mm)),
    measure("radius_max_mm", "mm", "largest radius", |b| Number(b.radius_max_mm)),
    measure("taper_mm_per_mm", "mm/mm", "loss of radius per length, by least squares over its length; negative where it widens",
        |b| Number(b.taper)),
    measure("volume_mm3", "mm3", "volume of its truncated cones", |b| Number(b.volume_mm3)),
    measure("surface_mm2", "mm2", "lateral surface of its truncated cones", |b| Number(b.surface_mm2)),
    measure("branching_angle_deg", "deg", "angle to its parent's direction, 0 straight on; directions are chords over two radii of the fork, from one radius beyond it",
        |b| Number(b.branching_angle_deg)),
    measure("sibling_angle_deg", "deg", "angle to the nearest of the branches from the same fork", |b| Number(b.sibling_angle_deg)),
    measure("radius_to_parent", "1", "its mean radius over its parent's", |b| Number(b.radius_to_parent)),
    measure("label", "n/a", "value of the label map (tree.labels) along most of its length, or nearest to it",
        |b| Text(b.region.as_ref().map(|region| region.label.to_string()).unwrap_or_default())),
    measure("label_name", "n/a", "name of that label (tree.label_names)",
        |b| Text(b.region.as_ref().map(|region| region.name.clone()).unwrap_or_default())),
    measure("label_color", "n/a", "colour of that label (tree.label_names), #rrggbb",
        |b| Text(b.region.as_ref().and_then(|region| region.color).map(hex).unwrap_or_default())),
    measure("label_share", "1", "share of its length that lies in that label; 0 if the label is only the nearest",
        |b| Number(b.region.as_ref().map_or(f64::NAN, |region| region.share))),
    measure("mask_voxels", "voxel", "voxels of the mask that are its own in branches.nii.gz", |b| Whole(b.n_voxels)),
    measure("mask_volume_mm3", "mm3", "volume of these voxels", |b| Number(b.mask_volume_mm3)),
    measure("mask_radius_mm", "mm", "radius of the cylinder that has the length of the branch and the volume of its voxels",
        |b| Number(if b.length_mm > 0.0 { (b.mask_volume_mm3 / (std::f64::consts::PI * b.length_mm)).sqrt() } else { f64::NAN })),
];

pub(super) fn to_tsv(branches: &[BranchMeasures]) -> String {
    let names: Vec<&str> = MEASURES.iter().map(|measure| measure.column.name).collect();
    let mut table = Table::new(&names);
    for branch in branches {
        let cells: Vec<String> = MEASURES.iter().map(|measure| (measure.of)(branch).cell()).collect();
        table.row_of(&cells);
    }
    table.into_string()
}
