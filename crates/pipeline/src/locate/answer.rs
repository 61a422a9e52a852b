//! What is said of a point: as a table, as lines for one point, as JSON.

use espalier_model::table::{Column, Table, fixed};
use glam::{DVec2, DVec3};
use serde_json::{Map, Value, json};

use super::points::Given;

/// Decimals of voxel and pixel coordinates.
const INDEX_DECIMALS: usize = 2;

/// The columns of the answer.
pub const LOCATE_COLUMNS: [Column; 26] = [
    Column::new("given", "n/a", "the point as it was given"),
    Column::new("given_space", "n/a", "its space: RAS+ mm, LPS+ mm, voxel, plane mm or pixel"),
    Column::new(
        "where",
        "n/a",
        "inside: within the radius of its branch; outside: beyond it, the nearest branch is named",
    ),
    Column::new(
        "in_mask",
        "n/a",
        "whether its voxel is of the mask: yes, no, or beyond for a point outside of the volume",
    ),
    Column::new("x_mm", "mm", "the point in the patient, RAS+: towards the right"),
    Column::new("y_mm", "mm", "the point in the patient: towards the front"),
    Column::new("z_mm", "mm", "the point in the patient: upwards"),
    Column::new("i", "voxel", "its voxel coordinates in mask.nii.gz, from 0, whole numbers at centres"),
    Column::new("j", "voxel", "the second of them"),
    Column::new("k", "voxel", "the third of them"),
    Column::new("u_mm", "mm", "the point on the map: to the right"),
    Column::new("v_mm", "mm", "the point on the map: up"),
    Column::new("pixel_x", "pixel", "the same in planar.png, from 0 at the left, whole numbers at centres"),
    Column::new("pixel_y", "pixel", "the same, from 0 at the top"),
    Column::new("branch", "n/a", "the branch that it belongs to, as in branches.tsv"),
    Column::new("generation", "n/a", "the number of forks between the root and the branch"),
    Column::new("label", "n/a", "the branch's label, if it has one"),
    Column::new("label_name", "n/a", "the name of the label"),
    Column::new("node", "n/a", "the lower node of the edge that it belongs to, as in nodes.tsv"),
    Column::new("radius_mm", "mm", "the radius of the organ there"),
    Column::new("from_root_mm", "mm", "path length from the root to the nearest place of the centreline"),
    Column::new("off_center_mm", "mm", "distance to that place"),
    Column::new("beyond_mm", "mm", "how far beyond the radius the point lies; 0 inside"),
    Column::new(
        "out_of_plane_mm",
        "mm",
        "how far it lies off the surface that the map shows, towards the viewer",
    ),
    Column::new("center_xyz_mm", "mm", "the nearest place of the centreline in the patient, RAS+"),
    Column::new("center_uv_mm", "mm", "the same on the map"),
];

/// Whether a point is in the mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InMask {
    /// Its voxel is foreground.
    Yes,
    /// Its voxel is background.
    No,
    /// It lies outside of the volume.
    Beyond,
    /// The run has no mask.
    Unknown,
}

impl InMask {
    fn name(self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::No => "no",
            Self::Beyond => "beyond",
            Self::Unknown => "n/a",
        }
    }
}

/// Points found on both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Located {
    /// In the order given.
    pub points: Vec<LocatedPoint>,
    /// How many decimals a length in mm has: those of the layout.
    pub decimals: usize,
}

/// A point in the patient and on the map.
#[derive(Clone, Debug, PartialEq)]
pub struct LocatedPoint {
    /// As it was given.
    pub given: Given,
    /// In the patient, RAS+ mm.
    pub patient_mm: DVec3,
    /// In voxels of the mask.
    pub voxel: Option<DVec3>,
    /// Whether the mask has it.
    pub in_mask: InMask,
    /// On the map, mm.
    pub plane_mm: DVec2,
    /// In `planar.png`.
    pub pixel: Option<DVec2>,
    /// Its branch; none in a tree of one node.
    pub branch: Option<usize>,
    /// The branch's generation.
    pub generation: Option<u32>,
    /// The branch's label and the name of that.
    pub label: Option<(String, String)>,
    /// The lower node of its edge.
    pub node: usize,
    /// The radius of the organ there.
    pub radius_mm: f64,
    /// Path length from the root.
    pub arc_mm: f64,
    /// Distance to the centreline.
    pub off_center_mm: f64,
    /// Distance to the surface that the map shows, towards the viewer.
    pub out_of_plane_mm: f64,
    /// The nearest place of the centreline, RAS+ mm.
    pub center_mm: DVec3,
    /// The same on the map.
    pub center_plane_mm: DVec2,
}

impl LocatedPoint {
    /// Whether it lies within the radius of its branch.
    #[must_use]
    pub fn is_inside(&self) -> bool {
        self.off_center_mm <= self.radius_mm
    }

    /// How far beyond the radius it lies, mm; 0 inside.
    #[must_use]
    pub fn beyond_mm(&self) -> f64 {
        (self.off_center_mm - self.radius_mm).max(0.0)
    }

    /// The cells of [`LOCATE_COLUMNS`].
    fn cells(&self, decimals: usize) -> Vec<String> {
        let mm = |value: f64| fixed(value, decimals);
        let index = |value: Option<f64>| value.map_or_else(none, |value| fixed(value, INDEX_DECIMALS));
        let list = |values: &[f64]| values.iter().map(|&value| mm(value)).collect::<Vec<_>>().join(",");
        let [x, y, z] = self.patient_mm.to_array();
        let voxel = |axis: usize| index(self.voxel.map(|voxel| voxel[axis]));
        let pixel = |axis: usize| index(self.pixel.map(|pixel| pixel[axis]));
        let (label, label_name) = self.label.clone().unwrap_or_else(|| (none(), none()));
        vec![
            self.given.text.clone(),
            self.given.space.name().to_owned(),
            if self.is_inside() { "inside" } else { "outside" }.to_owned(),
            self.in_mask.name().to_owned(),
            mm(x),
            mm(y),
            mm(z),
            voxel(0),
            voxel(1),
            voxel(2),
            mm(self.plane_mm.x),
            mm(self.plane_mm.y),
            pixel(0),
            pixel(1),
            self.branch.map_or_else(none, |branch| branch.to_string()),
            self.generation.map_or_else(none, |generation| generation.to_string()),
            label,
            label_name,
            self.node.to_string(),
            mm(self.radius_mm),
            mm(self.arc_mm),
            mm(self.off_center_mm),
            mm(self.beyond_mm()),
            mm(self.out_of_plane_mm),
            list(&self.center_mm.to_array()),
            list(&self.center_plane_mm.to_array()),
        ]
    }
}

fn none() -> String {
    "n/a".to_owned()
}

impl Located {
    /// One row a point.
    #[must_use]
    pub fn to_tsv(&self) -> String {
        let mut table = Table::with(&LOCATE_COLUMNS);
        self.points.iter().for_each(|point| table.row_of(&point.cells(self.decimals)));
        table.into_string()
    }

    /// One line a quantity, with its meaning: for reading, of few points.
    #[must_use]
    pub fn to_text(&self) -> String {
        let of_point = |point: &LocatedPoint| {
            let cells = point.cells(self.decimals);
            let wide = cells.iter().map(|cell| cell.chars().count()).max().unwrap_or(0);
            let line = |(column, cell): (&Column, &String)| {
                format!("{:<16} {cell:<wide$}  {}\n", column.name, column.meaning)
            };
            LOCATE_COLUMNS.iter().zip(&cells).map(line).collect::<String>()
        };
        self.points.iter().map(of_point).collect::<Vec<_>>().join("\n")
    }

    /// Format `espalier-located` version 1: numbers as numbers, what there is not as null.
    #[must_use]
    pub fn to_json(&self) -> String {
        let number = |cell: &str| match cell {
            "n/a" => Value::Null,
            _ => cell.parse::<serde_json::Number>().map_or_else(|_| cell.into(), Value::Number),
        };
        let value = |column: &Column, cell: &str| match column.name {
            "given" | "given_space" | "where" | "in_mask" | "label" | "label_name" => match cell {
                "n/a" => Value::Null,
                _ => cell.into(),
            },
            "center_xyz_mm" | "center_uv_mm" => cell.split(',').map(number).collect(),
            _ => number(cell),
        };
        let record = |point: &LocatedPoint| {
            let cells = point.cells(self.decimals);
            let entries = LOCATE_COLUMNS.iter().zip(&cells);
            entries.map(|(column, cell)| (column.name.to_owned(), value(column, cell))).collect::<Map<_, _>>()
        };
        let points: Vec<Value> = self.points.iter().map(|point| record(point).into()).collect();
        let spaces = json!({
            "x_mm y_mm z_mm": "patient, RAS+ mm",
            "i j k": "voxels of stages/01-volume/mask.nii.gz from 0, x fastest",
            "u_mm v_mm": "map, mm to the right and up",
            "pixel_x pixel_y": "planar.png, from 0 at the upper left, whole numbers at centres",
        });
        let file = json!({ "format": "espalier-located", "version": 1, "spaces": spaces, "points": points });
        serde_json::to_string_pretty(&file).unwrap_or_default() + "\n"
    }
}

/// The label and its name by branch, from `branches.tsv`; none where the branch has none.
pub(super) fn labels(table: &str) -> Vec<Option<(String, String)>> {
    let mut lines = table.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split('\t').collect();
    let column = |name: &str| header.iter().position(|column| *column == name);
    let (Some(label), Some(name)) = (column("label"), column("label_name")) else { return Vec::new() };
    let of_line = |line: &str| {
        let cells: Vec<&str> = line.split('\t').collect();
        let cell = |index: usize| cells.get(index).copied().filter(|cell| !cell.is_empty() && *cell != "n/a");
        Some((cell(label)?.to_owned(), cell(name).unwrap_or("n/a").to_owned()))
    };
    lines.map(of_line).collect()
}
