//! Two trees of one organ held against each other: what became of each branch, and one tree that holds both.
//!
//! **Guarantees** `nodes` has one entry per node of the shared tree; a row index in it is one of `rows`; a piece that
//! both trees have, or only the baseline, has the baseline's position. Points are RAS+ mm of the baseline.
//!
//! Written as tables (`juxtaposition.tsv`, `shared-nodes.tsv`) and as a summary (`juxtaposition.json`).

use glam::{DMat3, DVec2, DVec3};
use serde::Serialize;

use crate::table::{Column, Table, fixed, significant};
use crate::tree::Tree;
use crate::versioned;

const FORMAT: &str = "espalier-juxtaposition";
const VERSION: u32 = 1;

/// What became of a branch, or of a piece of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fate {
    /// Both trees have it.
    Matched,
    /// Only the baseline has it.
    Lost,
    /// Only the follow-up has it.
    New,
}

impl Fate {
    /// The name in tables and pictures.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Matched => "matched",
            Self::Lost => "lost",
            Self::New => "new",
        }
    }
}

/// How the follow-up was brought into the frame of the baseline: x ↦ scale · rotation · x + translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// A proper rotation.
    pub rotation: DMat3,
    /// In mm.
    pub translation_mm: DVec3,
    /// 1 for a rigid motion.
    pub scale: f64,
    /// How many matched places it was fitted to; 0 if it was taken as it is.
    pub n_points: usize,
    /// Mean distance of matched forks and tips after it, in mm; `NaN` without any.
    pub residual_mean_mm: f64,
    /// The largest of these distances, in mm.
    pub residual_max_mm: f64,
}

impl Alignment {
    /// Nothing moves.
    pub const IDENTITY: Self = Self {
        rotation: DMat3::IDENTITY,
        translation_mm: DVec3::ZERO,
        scale: 1.0,
        n_points: 0,
        residual_mean_mm: f64::NAN,
        residual_max_mm: f64::NAN,
    };

    /// A point of the follow-up in the frame of the baseline.
    #[must_use]
    pub fn apply(&self, point_mm: DVec3) -> DVec3 {
        self.scale * (self.rotation * point_mm) + self.translation_mm
    }

    /// A direction or a difference of points of the follow-up.
    #[must_use]
    pub fn turn(&self, difference_mm: DVec3) -> DVec3 {
        self.scale * (self.rotation * difference_mm)
    }

    /// By how much it turns, in degrees.
    #[must_use]
    pub fn angle_deg(&self) -> f64 {
        let trace = self.rotation.x_axis.x + self.rotation.y_axis.y + self.rotation.z_axis.z;
        espalier_geom::math::acos((0.5 * (trace - 1.0)).clamp(-1.0, 1.0)).to_degrees()
    }
}

/// A node of the shared tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedNode {
    /// The baseline's node; `None` where it has none at this place.
    pub baseline_node: Option<usize>,
    /// The follow-up's node; `None` where it has none at this place.
    pub followup_node: Option<usize>,
    /// Radius of the baseline's tube here, in mm; `None` where it has none.
    pub baseline_radius_mm: Option<f64>,
    /// Radius of the follow-up's tube here, in mm; `None` where it has none.
    pub followup_radius_mm: Option<f64>,
    /// What became of the edge to the parent.
    pub fate: Fate,
    /// The row of that edge; `None` at the root.
    pub row: Option<usize>,
}

/// A branch, or a chain of branches that is one branch in the other tree. `NaN` stands for what is not known.
#[derive(Clone, Debug, PartialEq)]
pub struct BranchChange {
    /// What became of it.
    pub fate: Fate,
    /// Its branches in the baseline, from the root outwards.
    pub baseline_branches: Vec<usize>,
    /// Its branches in the follow-up.
    pub followup_branches: Vec<usize>,
    /// Forks between the root and it, in the tree that has it; the baseline of both.
    pub generation: u32,
    /// Lengths in the two trees, in mm.
    pub length_mm: [f64; 2],
    /// The length over which both are compared, in mm of the baseline.
    pub compared_mm: f64,
    /// Mean radii over that length; of a lost or new branch over its own length.
    pub radius_mm: [f64; 2],
    /// The change of radius at the narrowest place against the baseline there, in percent.
    pub narrowest_percent: f64,
    /// Where that is: the distance from the start of the branch along the baseline, in mm.
    pub narrowest_at_mm: f64,
    /// The angle by which each turns off its parent, in degrees; 0 goes straight on.
    pub angle_deg: [f64; 2],
    /// The angle between the two, aligned, in degrees.
    pub heading_change_deg: f64,
    /// The distance between their ends, aligned, in mm.
    pub end_offset_mm: f64,
}

impl BranchChange {
    /// The follow-up's length over the baseline's, less 1, in percent.
    #[must_use]
    pub fn length_change_percent(&self) -> f64 {
        change_percent(self.length_mm)
    }

    /// The follow-up's mean radius over the baseline's, less 1, in percent.
    #[must_use]
    pub fn radius_change_percent(&self) -> f64 {
        change_percent(self.radius_mm)
    }
}

/// The change from the first number to the second in percent of the first; `NaN` where that is not over 0.
#[must_use]
pub fn change_percent([before, after]: [f64; 2]) -> f64 {
    if before > 0.0 { 100.0 * (after / before - 1.0) } else { f64::NAN }
}

/// Two trees held against each other.
#[derive(Clone, Debug, PartialEq)]
pub struct Juxtaposition {
    /// The digests of baseline and follow-up: [`Tree::digest`].
    pub trees: [String; 2],
    /// How the follow-up was brought to the baseline.
    pub alignment: Alignment,
    /// The tree that holds both: the baseline, and what only the follow-up has; its radii are the larger of the two.
    pub shared: Tree,
    /// By node of the shared tree.
    pub nodes: Vec<SharedNode>,
    /// Matched, lost and new branches: those that the baseline has in its preorder, then the new ones in the
    /// follow-up's.
    pub rows: Vec<BranchChange>,
}

/// The columns of `juxtaposition.tsv`.
pub const CHANGE_COLUMNS: [Column; 20] = [
    Column::new("row", "n/a", "number of the row, from 0; shared-nodes.tsv refers to it"),
    Column::new("fate", "n/a", "matched, lost (in the baseline only) or new (in the follow-up only)"),
    Column::new(
        "baseline_branches",
        "n/a",
        "branches of the baseline as in its branches.tsv; several where a side branch of one tree divides it",
    ),
    Column::new("followup_branches", "n/a", "the same of the follow-up"),
    Column::new(
        "generation",
        "1",
        "forks between the root and the branch, in the baseline where it is there",
    ),
    Column::new("baseline_length_mm", "mm", "length in the baseline"),
    Column::new("followup_length_mm", "mm", "length in the follow-up"),
    Column::new("length_change_percent", "percent", "change of length, of the baseline's"),
    Column::new("compared_mm", "mm", "length of the baseline over which radii are compared"),
    Column::new("baseline_radius_mm", "mm", "mean radius over that length; of a lost branch over its own"),
    Column::new("followup_radius_mm", "mm", "the same of the follow-up; of a new branch over its own"),
    Column::new("radius_change_percent", "percent", "change of mean radius, of the baseline's"),
    Column::new(
        "narrowest_percent",
        "percent",
        "change of radius where the follow-up is narrowest against the baseline, over a stretch as long as the \
         baseline is wide there",
    ),
    Column::new("narrowest_at_mm", "mm", "where that is: from the start of the branch along the baseline"),
    Column::new("baseline_angle_deg", "deg", "turn off the parent branch in the baseline; 0 is straight on"),
    Column::new("followup_angle_deg", "deg", "the same in the follow-up"),
    Column::new("angle_change_deg", "deg", "the difference of the two"),
    Column::new("heading_change_deg", "deg", "angle between the chords of the two, aligned"),
    Column::new("end_offset_mm", "mm", "distance between the ends of the two, aligned"),
    Column::new("shared_nodes", "1", "nodes of the shared tree that belong to the row"),
];

/// The columns of `shared-nodes.tsv`.
pub const SHARED_NODE_COLUMNS: [Column; 14] = [
    Column::new("node", "n/a", "index of the node in the shared tree's preorder; 0 is the root"),
    Column::new("parent", "n/a", "index of its parent; n/a for the root"),
    Column::new("x_mm", "mm", "position in the baseline's space, RAS+: towards the right"),
    Column::new("y_mm", "mm", "position in space: towards the front"),
    Column::new("z_mm", "mm", "position in space: upwards"),
    Column::new("u_mm", "mm", "position in the picture's plane: to the right"),
    Column::new("v_mm", "mm", "position in the picture's plane: up"),
    Column::new("fate", "n/a", "what became of the edge to the parent; n/a for the root"),
    Column::new("row", "n/a", "the row of juxtaposition.tsv; n/a for the root"),
    Column::new("baseline_node", "n/a", "the baseline's node as in its nodes.tsv; n/a where it has none"),
    Column::new("followup_node", "n/a", "the follow-up's node; n/a where it has none at this very place"),
    Column::new("baseline_radius_mm", "mm", "radius of the baseline's tube; n/a where it has none"),
    Column::new("followup_radius_mm", "mm", "radius of the follow-up's tube; n/a where it has none"),
    Column::new("radius_change_percent", "percent", "change of radius, of the baseline's"),
];

impl Juxtaposition {
    /// The rows of a fate.
    pub fn of_fate(&self, fate: Fate) -> impl Iterator<Item = &BranchChange> {
        self.rows.iter().filter(move |row| row.fate == fate)
    }

    /// The length of the branches of a fate in the tree that has them, in mm; of matched ones the baseline's.
    #[must_use]
    pub fn length_mm(&self, fate: Fate) -> f64 {
        // The sum of nothing is −0.
        self.of_fate(fate).map(|row| row.length_mm[usize::from(fate == Fate::New)]).sum::<f64>() + 0.0
    }

    /// The table `juxtaposition.tsv`.
    #[must_use]
    pub fn to_tsv(&self) -> String {
        let mut n_nodes = vec![0_usize; self.rows.len()];
        self.nodes.iter().filter_map(|node| node.row).for_each(|row| n_nodes[row] += 1);
        let mut table = Table::with(&CHANGE_COLUMNS);
        for (idx, row) in self.rows.iter().enumerate() {
            let digits = |value: f64| significant(value, 6);
            let percent = |value: f64| fixed(value, 2);
            table.row_of(&[
                idx.to_string(),
                row.fate.name().to_owned(),
                list(&row.baseline_branches),
                list(&row.followup_branches),
                row.generation.to_string(),
                digits(row.length_mm[0]),
                digits(row.length_mm[1]),
                percent(row.length_change_percent()),
                digits(row.compared_mm),
                digits(row.radius_mm[0]),
                digits(row.radius_mm[1]),
                percent(row.radius_change_percent()),
                percent(row.narrowest_percent),
                digits(row.narrowest_at_mm),
                fixed(row.angle_deg[0], 2),
                fixed(row.angle_deg[1], 2),
                fixed(row.angle_deg[1] - row.angle_deg[0], 2),
                fixed(row.heading_change_deg, 2),
                digits(row.end_offset_mm),
                n_nodes[idx].to_string(),
            ]);
        }
        table.into_string()
    }

    /// The table `shared-nodes.tsv`; `positions_mm` are the shared tree's places in the picture.
    ///
    /// # Panics
    /// If there is not one position per node.
    #[must_use]
    pub fn nodes_tsv(&self, positions_mm: &[DVec2]) -> String {
        assert_eq!(positions_mm.len(), self.nodes.len(), "one position per node");
        let index = |index: Option<usize>| index.map_or_else(|| "n/a".to_owned(), |index| index.to_string());
        let radius = |radius: Option<f64>| significant(radius.unwrap_or(f64::NAN), 6);
        let mut table = Table::with(&SHARED_NODE_COLUMNS);
        for (node_idx, (node, flat)) in self.nodes.iter().zip(positions_mm).enumerate() {
            let space = self.shared.position_mm(node_idx);
            let radii = [node.baseline_radius_mm, node.followup_radius_mm].map(|r| r.unwrap_or(f64::NAN));
            let fate = node.row.map_or("n/a", |_| node.fate.name());
            table.row_of(&[
                node_idx.to_string(),
                index(self.shared.parent(node_idx)),
                significant(space.x, 9),
                significant(space.y, 9),
                significant(space.z, 9),
                significant(flat.x, 9),
                significant(flat.y, 9),
                fate.to_owned(),
                index(node.row),
                index(node.baseline_node),
                index(node.followup_node),
                radius(node.baseline_radius_mm),
                radius(node.followup_radius_mm),
                fixed(change_percent(radii), 2),
            ]);
        }
        table.into_string()
    }

    /// The text of `juxtaposition.json`: the alignment and the sums.
    #[must_use]
    pub fn to_json(&self) -> String {
        let Alignment { rotation, translation_mm, scale, n_points, .. } = self.alignment;
        let known = |value: f64| value.is_finite().then_some(value);
        let counted =
            |fate| Counted { branches: self.of_fate(fate).count(), length_mm: self.length_mm(fate) };
        let file = SummaryFile {
            baseline: &self.trees[0],
            followup: &self.trees[1],
            shared: self.shared.digest(),
            baseline_from_followup: AlignmentFile {
                rotation_rows: rotation.transpose().to_cols_array_2d(),
                translation_mm: translation_mm.to_array(),
                scale,
                angle_deg: self.alignment.angle_deg(),
                fitted_to_points: n_points,
                residual_mean_mm: known(self.alignment.residual_mean_mm),
                residual_max_mm: known(self.alignment.residual_max_mm),
            },
            matched: counted(Fate::Matched),
            lost: counted(Fate::Lost),
            new: counted(Fate::New),
        };
        versioned::to_json(FORMAT, VERSION, file)
    }
}

/// Indices with commas between them; `n/a` if there are none.
fn list(indices: &[usize]) -> String {
    if indices.is_empty() {
        return "n/a".to_owned();
    }
    indices.iter().map(usize::to_string).collect::<Vec<_>>().join(",")
}

#[derive(Serialize)]
struct SummaryFile<'a> {
    baseline: &'a str,
    followup: &'a str,
    shared: String,
    baseline_from_followup: AlignmentFile,
    matched: Counted,
    lost: Counted,
    new: Counted,
}

#[derive(Serialize)]
struct AlignmentFile {
    rotation_rows: [[f64; 3]; 3],
    translation_mm: [f64; 3],
    scale: f64,
    angle_deg: f64,
    fitted_to_points: usize,
    residual_mean_mm: Option<f64>,
    residual_max_mm: Option<f64>,
}

#[derive(Serialize)]
struct Counted {
    branches: usize,
    length_mm: f64,
}
