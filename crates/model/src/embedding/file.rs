//! The files of an embedding: `embedding.json` and `nodes.tsv`.
//!
//! JSON holds every number with the digits that read back to the same bits. The tables are for people and
//! spreadsheets: coordinates with the decimals of the embedding's quantum, everything else as its column says.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::losses::LossesFile;
use super::{
    Certificate, EditRecord, Embedding, Energy, MethodRow, Phase, Pose, TargetKind, Targets, Termination,
    TracePoint, WidthMode, Widths,
};
use crate::edits::Edit;
use crate::table::{Column, Table, fixed};
use crate::tree::Tree;
use crate::versioned::{self, FileError};

const FORMAT: &str = "espalier-embedding";
/// 2: more losses, manual edits, widths. 3: phases of the convergence curve.
const VERSION: u32 = 3;

/// The columns of `nodes.tsv`.
pub const NODE_COLUMNS: [Column; 13] = [
    Column::new("node", "n/a", "index of the node in preorder; 0 is the root"),
    Column::new("parent", "n/a", "index of its parent; n/a for the root"),
    Column::new("x_mm", "mm", "position in space, RAS+: towards the right"),
    Column::new("y_mm", "mm", "position in space: towards the front"),
    Column::new("z_mm", "mm", "position in space: upwards"),
    Column::new("radius_mm", "mm", "radius of the tube at the node"),
    Column::new("u_mm", "mm", "position in the picture's plane: to the right"),
    Column::new("v_mm", "mm", "position in the picture's plane: up"),
    Column::new("branch", "n/a", "index of its branch; n/a for the root"),
    Column::new("generation", "1", "forks between the root and its branch"),
    Column::new(
        "target_angle_deg",
        "deg",
        "target angle, counter-clockwise from its grandparent's side; 180 = straight",
    ),
    Column::new("length_ratio", "1", "drawn length over target length, minus 1"),
    Column::new("angle_ratio", "1", "r_a of equation 3: 0 = as the target, 1 = straight"),
];

impl TargetKind {
    /// The name used in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Intrinsic => "intrinsic",
            Self::Projected => "projected",
            Self::IntrinsicMirrored => "intrinsic-mirrored",
            Self::ProjectedMirrored => "projected-mirrored",
        }
    }
}

impl Termination {
    /// The name used in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Constructed => "constructed",
            Self::Optimal => "optimal",
            Self::Converged => "converged",
            Self::BudgetSpent => "budget-spent",
        }
    }
}

impl Embedding {
    /// The text of `embedding.json`.
    #[must_use]
    pub fn to_json(&self) -> String {
        versioned::to_json(FORMAT, VERSION, EmbeddingFile::from(self))
    }

    /// The embedding of `tree` in a text of `embedding.json`.
    ///
    /// # Errors
    /// [`FileError`] if the text is not such a file, was made for another tree, or breaks a guarantee. The
    /// certificate is not made again here: `espalier_embed::certify` does that.
    pub fn from_json(text: &str, tree: &Tree) -> Result<Self, FileError> {
        let file: EmbeddingFile = versioned::from_json(FORMAT, VERSION, text)?;
        versioned::check_tree(FORMAT, &file.tree, tree)?;
        check(&file, tree.n_nodes()).map_err(|what| FileError::Invalid { format: FORMAT, what })?;
        Ok(file.into())
    }

    /// How many decimals a coordinate has.
    #[must_use]
    pub fn decimals(&self) -> usize {
        decimals(self.quantum_mm)
    }

    /// The table `nodes.tsv`: each node in space and in the plane.
    #[must_use]
    pub fn nodes_tsv(&self, tree: &Tree) -> String {
        let branches = tree.branches();
        let decimals = self.decimals();
        let mut table = Table::with(&NODE_COLUMNS);
        for (node, (data, flat)) in tree.nodes().iter().zip(&self.positions_mm).enumerate() {
            let branch = branches.of_node(node);
            let or_none = |value: Option<String>| value.unwrap_or_else(|| "n/a".to_owned());
            table.row(&[
                &node,
                &or_none(data.parent.map(|parent| parent.to_string())),
                &fixed(data.position_mm.x, decimals),
                &fixed(data.position_mm.y, decimals),
                &fixed(data.position_mm.z, decimals),
                &fixed(data.radius_mm, decimals),
                &fixed(flat.x, decimals),
                &fixed(flat.y, decimals),
                &or_none(branch.map(|branch| branch.to_string())),
                &or_none(branch.map(|branch| branches.list()[branch].generation.to_string())),
                &fixed(self.targets.angle_rad[node].to_degrees(), 6),
                &fixed(self.length_ratio[node], 9),
                &fixed(self.angle_ratio[node], 9),
            ]);
        }
        table.into_string()
    }
}

/// Decimals of a quantum: a power of ten, or 0 where it is 1 mm or more.
fn decimals(quantum_mm: f64) -> usize {
    let exponent = espalier_geom::math::floor(0.5 - espalier_geom::math::log10(quantum_mm));
    exponent.max(0.0) as usize
}

#[derive(Serialize, Deserialize)]
struct EmbeddingFile {
    tree: String,
    method: String,
    seed: u64,
    targets: TargetsFile,
    termination: TerminationFile,
    quantum_mm: f64,
    pose: PoseFile,
    certificate: CertificateFile,
    widths: WidthsFile,
    energy: EnergyFile,
    losses: LossesFile,
    methods: Vec<MethodRowFile>,
    edits: Vec<EditRecordFile>,
    trace: Vec<TracePointFile>,
    positions_mm: Vec<[f64; 2]>,
    length_ratio: Vec<f64>,
    angle_ratio: Vec<f64>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum TargetKindFile {
    Intrinsic,
    Projected,
    IntrinsicMirrored,
    ProjectedMirrored,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum TerminationFile {
    Constructed,
    Optimal,
    Converged,
    BudgetSpent,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TargetsFile {
    kind: TargetKindFile,
    /// `null` for the root, which has no angle.
    angle_rad: Vec<Option<f64>>,
    length_mm: Vec<f64>,
    heading_rad: Vec<f64>,
    confidence: Vec<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EnergyFile {
    length: f64,
    angle: f64,
    side: f64,
    placement: f64,
    crossing: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CertificateFile {
    crossings: usize,
    pairs: Vec<(usize, usize)>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum WidthModeFile {
    Report,
    Avoid,
    Stretch,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct WidthsFile {
    mode: WidthModeFile,
    overlaps: usize,
    is_complete: bool,
    radius_scale: f64,
    length_scale: f64,
    area_needed_mm2: f64,
    area_available_mm2: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PoseFile {
    rotation_rad: f64,
    is_reflected: bool,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum PhaseFile {
    Start,
    Untangling,
    Descent,
    Barrier,
    Swarm,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TracePointFile {
    phase: PhaseFile,
    iteration: u32,
    evaluations: u64,
    energy: f64,
    crossings: usize,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EditRecordFile {
    branch: usize,
    node: usize,
    angle_asked_deg: f64,
    angle_reached_deg: f64,
    crossings_introduced: usize,
    crossings_removed: usize,
    energy_before: f64,
    energy_after: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MethodRowFile {
    method: String,
    crossings: usize,
    overlaps: usize,
    energy: EnergyFile,
    losses: LossesFile,
    evaluations: u64,
    targets: TargetKindFile,
}

/// Checks the guarantees of an embedding with so many nodes; says which one fails and where.
fn check(file: &EmbeddingFile, n_nodes: usize) -> Result<(), String> {
    let TargetsFile { angle_rad, length_mm, heading_rad, confidence, .. } = &file.targets;
    let angles: Vec<f64> = angle_rad.iter().map(|angle| angle.unwrap_or(0.0)).collect();
    for (name, values) in [
        ("targets.angle_rad", &angles),
        ("targets.length_mm", length_mm),
        ("targets.heading_rad", heading_rad),
        ("targets.confidence", confidence),
        ("length_ratio", &file.length_ratio),
        ("angle_ratio", &file.angle_ratio),
    ] {
        check_column(name, values, n_nodes)?;
    }
    if let Some(node) = angle_rad.iter().skip(1).position(Option::is_none) {
        return Err(format!("targets.angle_rad has no angle for node {}", node + 1));
    }
    check_positions(&file.positions_mm, file.quantum_mm, n_nodes)?;
    let is_there = |edit: &EditRecordFile| edit.branch.max(edit.node) < n_nodes.saturating_sub(1);
    if let Some(idx) = file.edits.iter().position(|edit| !is_there(edit)) {
        return Err(format!("edits[{idx}] names a branch or a node that the tree does not have"));
    }
    let is_edge = |edge: usize| (1..n_nodes).contains(&edge);
    match file.certificate.pairs.iter().find(|&&(a, b)| !is_edge(a) || !is_edge(b)) {
        Some(pair) => Err(format!("certificate.pairs names edges {pair:?} of a tree of {n_nodes} nodes")),
        None if file.certificate.pairs.len() > file.certificate.crossings => {
            Err(format!("certificate.pairs are more than the {} crossings", file.certificate.crossings))
        }
        None => Ok(()),
    }
}

/// Checks that there is one position per node, finite and rounded.
pub(super) fn check_positions(positions: &[[f64; 2]], quantum_mm: f64, n_nodes: usize) -> Result<(), String> {
    let flat = positions.as_flattened();
    check_column("positions_mm", flat, 2 * n_nodes)?;
    let n_decimals = decimals(quantum_mm);
    if !(quantum_mm > 0.0 && format!("1e-{n_decimals}").parse() == Ok(quantum_mm)) {
        return Err(format!("quantum_mm is {quantum_mm}, which is no power of ten up to 1"));
    }
    let is_rounded = |&value: &f64| format!("{value:.n_decimals$}").parse() == Ok(value);
    match flat.iter().position(|value| !is_rounded(value)) {
        Some(place) => Err(format!("positions_mm of node {} are not rounded to {quantum_mm}", place / 2)),
        None => Ok(()),
    }
}

fn check_column(name: &str, values: &[f64], n_expected: usize) -> Result<(), String> {
    if values.len() != n_expected {
        return Err(format!("{name} has {} numbers, the tree needs {n_expected}", values.len()));
    }
    match values.iter().position(|value| !value.is_finite()) {
        Some(place) => Err(format!("{name} is not finite at {place}")),
        None => Ok(()),
    }
}

impl From<&Embedding> for EmbeddingFile {
    fn from(embedding: &Embedding) -> Self {
        Self {
            tree: embedding.tree.clone(),
            method: embedding.method.clone(),
            seed: embedding.seed,
            targets: (&embedding.targets).into(),
            termination: embedding.termination.into(),
            quantum_mm: embedding.quantum_mm,
            pose: PoseFile {
                rotation_rad: embedding.pose.rotation_rad,
                is_reflected: embedding.pose.is_reflected,
            },
            certificate: CertificateFile {
                crossings: embedding.certificate.crossings,
                pairs: embedding.certificate.pairs.clone(),
            },
            widths: embedding.widths.into(),
            energy: embedding.energy.into(),
            losses: embedding.losses.into(),
            methods: embedding.methods.iter().map(Into::into).collect(),
            edits: embedding.edits.iter().map(Into::into).collect(),
            trace: embedding.trace.iter().copied().map(Into::into).collect(),
            positions_mm: embedding.positions_mm.iter().map(DVec2::to_array).collect(),
            length_ratio: embedding.length_ratio.clone(),
            angle_ratio: embedding.angle_ratio.clone(),
        }
    }
}

impl From<EmbeddingFile> for Embedding {
    fn from(file: EmbeddingFile) -> Self {
        Self {
            tree: file.tree,
            method: file.method,
            seed: file.seed,
            positions_mm: file.positions_mm.into_iter().map(DVec2::from_array).collect(),
            quantum_mm: file.quantum_mm,
            targets: file.targets.into(),
            length_ratio: file.length_ratio,
            angle_ratio: file.angle_ratio,
            energy: file.energy.into(),
            losses: file.losses.into(),
            certificate: Certificate { crossings: file.certificate.crossings, pairs: file.certificate.pairs },
            widths: file.widths.into(),
            pose: Pose { rotation_rad: file.pose.rotation_rad, is_reflected: file.pose.is_reflected },
            termination: file.termination.into(),
            trace: file.trace.into_iter().map(Into::into).collect(),
            methods: file.methods.into_iter().map(Into::into).collect(),
            edits: file.edits.into_iter().map(Into::into).collect(),
        }
    }
}

impl From<Widths> for WidthsFile {
    fn from(widths: Widths) -> Self {
        Self {
            mode: widths.mode.into(),
            overlaps: widths.overlaps,
            is_complete: widths.is_complete,
            radius_scale: widths.radius_scale,
            length_scale: widths.length_scale,
            area_needed_mm2: widths.area_needed_mm2,
            area_available_mm2: widths.area_available_mm2,
        }
    }
}

impl From<WidthsFile> for Widths {
    fn from(file: WidthsFile) -> Self {
        Self {
            mode: file.mode.into(),
            overlaps: file.overlaps,
            is_complete: file.is_complete,
            radius_scale: file.radius_scale,
            length_scale: file.length_scale,
            area_needed_mm2: file.area_needed_mm2,
            area_available_mm2: file.area_available_mm2,
        }
    }
}

impl From<&Targets> for TargetsFile {
    fn from(targets: &Targets) -> Self {
        let known = |&angle: &f64| (!angle.is_nan()).then_some(angle);
        Self {
            kind: targets.kind.into(),
            angle_rad: targets.angle_rad.iter().map(known).collect(),
            length_mm: targets.length_mm.clone(),
            heading_rad: targets.heading_rad.clone(),
            confidence: targets.confidence.clone(),
        }
    }
}

impl From<TargetsFile> for Targets {
    fn from(file: TargetsFile) -> Self {
        Self {
            kind: file.kind.into(),
            angle_rad: file.angle_rad.into_iter().map(|angle| angle.unwrap_or(f64::NAN)).collect(),
            length_mm: file.length_mm,
            heading_rad: file.heading_rad,
            confidence: file.confidence,
        }
    }
}

impl MethodRowFile {
    pub(super) fn method(&self) -> &str {
        &self.method
    }
}

impl From<&MethodRow> for MethodRowFile {
    fn from(row: &MethodRow) -> Self {
        Self {
            method: row.method.clone(),
            crossings: row.crossings,
            overlaps: row.overlaps,
            energy: row.energy.into(),
            losses: row.losses.into(),
            evaluations: row.evaluations,
            targets: row.targets.into(),
        }
    }
}

impl From<MethodRowFile> for MethodRow {
    fn from(file: MethodRowFile) -> Self {
        Self {
            method: file.method,
            crossings: file.crossings,
            overlaps: file.overlaps,
            energy: file.energy.into(),
            losses: file.losses.into(),
            evaluations: file.evaluations,
            targets: file.targets.into(),
        }
    }
}

impl From<&EditRecord> for EditRecordFile {
    fn from(record: &EditRecord) -> Self {
        Self {
            branch: record.edit.branch,
            node: record.edit.node,
            angle_asked_deg: record.edit.angle_deg,
            angle_reached_deg: record.angle_reached_deg,
            crossings_introduced: record.crossings_introduced,
            crossings_removed: record.crossings_removed,
            energy_before: record.energy_before,
            energy_after: record.energy_after,
        }
    }
}

impl From<EditRecordFile> for EditRecord {
    fn from(file: EditRecordFile) -> Self {
        Self {
            edit: Edit { branch: file.branch, node: file.node, angle_deg: file.angle_asked_deg },
            angle_reached_deg: file.angle_reached_deg,
            crossings_introduced: file.crossings_introduced,
            crossings_removed: file.crossings_removed,
            energy_before: file.energy_before,
            energy_after: file.energy_after,
        }
    }
}

/// Conversions there and back between two structs with the same fields.
macro_rules! same_fields {
    ($memory:ident, $file:ident { $($field:ident),* $(,)? }) => {
        impl From<$memory> for $file {
            fn from(memory: $memory) -> Self {
                Self { $($field: memory.$field),* }
            }
        }

        impl From<$file> for $memory {
            fn from(file: $file) -> Self {
                Self { $($field: file.$field),* }
            }
        }
    };
}

/// Conversions there and back between two enums with the same variants.
macro_rules! same_variants {
    ($memory:ident, $file:ident { $($variant:ident),* $(,)? }) => {
        impl From<$memory> for $file {
            fn from(memory: $memory) -> Self {
                match memory { $($memory::$variant => Self::$variant),* }
            }
        }

        impl From<$file> for $memory {
            fn from(file: $file) -> Self {
                match file { $($file::$variant => Self::$variant),* }
            }
        }
    };
}

same_fields!(Energy, EnergyFile { length, angle, side, placement, crossing });

impl From<TracePoint> for TracePointFile {
    fn from(point: TracePoint) -> Self {
        let TracePoint { phase, iteration, evaluations, energy, crossings } = point;
        Self { phase: phase.into(), iteration, evaluations, energy, crossings }
    }
}

impl From<TracePointFile> for TracePoint {
    fn from(point: TracePointFile) -> Self {
        let TracePointFile { phase, iteration, evaluations, energy, crossings } = point;
        Self { phase: phase.into(), iteration, evaluations, energy, crossings }
    }
}

same_variants!(Phase, PhaseFile { Start, Untangling, Descent, Barrier, Swarm });
same_variants!(TargetKind, TargetKindFile { Intrinsic, Projected, IntrinsicMirrored, ProjectedMirrored });
same_variants!(WidthMode, WidthModeFile { Report, Avoid, Stretch });
same_variants!(Termination, TerminationFile { Constructed, Optimal, Converged, BudgetSpent });

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::Losses;
    use crate::diagnose::Diagnose;
    use crate::tree::Node;

    fn sample() -> (Tree, Embedding) {
        let node = |x, parent| Node { position_mm: DVec3::new(x, 0.0, 0.0), radius_mm: 1.0, parent, kind: 0 };
        let tree = Tree::new(&[node(0.0, None), node(1.0 / 3.0, Some(0))]).expect("a tree");
        let row = MethodRow {
            method: "radial".to_owned(),
            crossings: 0,
            overlaps: 2,
            energy: Energy { length: 0.1, angle: 0.2, ..Energy::default() },
            losses: Losses { spearman: 1.0, ..Losses::default() },
            evaluations: 3,
            targets: TargetKind::Projected,
        };
        let embedding = Embedding {
            tree: tree.digest(),
            method: "radial".to_owned(),
            seed: u64::MAX,
            positions_mm: vec![DVec2::ZERO, DVec2::new(0.333_3, -0.000_1)],
            quantum_mm: 1e-4,
            targets: Targets {
                kind: TargetKind::Projected,
                angle_rad: vec![f64::NAN, 0.1 + 0.2],
                length_mm: vec![0.0, 1.0 / 3.0],
                heading_rad: vec![0.0; 2],
                confidence: vec![0.0, 1.0],
            },
            length_ratio: vec![0.0; 2],
            angle_ratio: vec![0.0; 2],
            energy: row.energy,
            losses: row.losses,
            certificate: Certificate::default(),
            widths: Widths {
                mode: WidthMode::Stretch,
                overlaps: 2,
                is_complete: true,
                radius_scale: 1.0 / 3.0,
                length_scale: 1.5,
                area_needed_mm2: 0.1,
                area_available_mm2: 0.3,
            },
            pose: Pose { rotation_rad: 0.3, is_reflected: false },
            termination: Termination::BudgetSpent,
            trace: vec![TracePoint {
                phase: Phase::Descent,
                iteration: 0,
                evaluations: 1,
                energy: 0.3,
                crossings: 0,
            }],
            methods: vec![row],
            edits: vec![EditRecord {
                edit: Edit { branch: 0, node: 0, angle_deg: 1.0 / 3.0 },
                angle_reached_deg: 0.333,
                crossings_introduced: 2,
                crossings_removed: 2,
                energy_before: 0.1,
                energy_after: 0.3,
            }],
        };
        (tree, embedding)
    }

    #[test]
    fn reads_back_the_same_bits() {
        let (tree, embedding) = sample();
        let back = Embedding::from_json(&embedding.to_json(), &tree).expect("our own file");
        // NaN of the root's angle is not equal to itself; the text holds everything else.
        assert!(back.targets.angle_rad[0].is_nan());
        assert_eq!(back.targets.angle_rad[1].to_bits(), embedding.targets.angle_rad[1].to_bits());
        assert_eq!(back.to_json(), embedding.to_json());
        assert_eq!(back.methods, embedding.methods);
        assert_eq!(back.edits, embedding.edits);
        assert_eq!(back.widths, embedding.widths);
    }

    #[test]
    fn refuses_what_breaks_a_guarantee() {
        let (tree, embedding) = sample();
        let refusal = |change: &dyn Fn(&mut Embedding)| {
            let mut broken = embedding.clone();
            change(&mut broken);
            Embedding::from_json(&broken.to_json(), &tree).expect_err("refused").to_string()
        };
        for (change, expected) in [
            (&(|e: &mut Embedding| e.quantum_mm = 2e-4) as &dyn Fn(&mut Embedding), "no power of ten"),
            (&|e| e.positions_mm[1].x = 0.333_33, "node 1 are not rounded"),
            (&|e| e.length_ratio.truncate(1), "length_ratio has 1 numbers, the tree needs 2"),
            (&|e| e.targets.angle_rad[1] = f64::NAN, "no angle for node 1"),
            (&|e| e.certificate.pairs.push((1, 7)), "edges (1, 7) of a tree of 2 nodes"),
            (&|e| e.certificate.pairs.push((1, 1)), "more than the 0 crossings"),
        ] {
            let message = refusal(change);
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn another_tree_of_the_same_shape_is_refused() {
        let (tree, embedding) = sample();
        let mut nodes = tree.nodes().to_vec();
        nodes[1].radius_mm = 1.000_000_1;
        let other = Tree::new(&nodes).expect("a tree");
        let error = Embedding::from_json(&embedding.to_json(), &other).expect_err("refused");
        assert!(matches!(&error, FileError::OtherTree { found, .. } if *found == tree.digest()));
        assert!(error.to_string().contains("was made for another tree"), "{error}");
        assert!(error.hint().contains("for this tree"), "{}", error.hint());
        let anonymous = embedding.to_json().replacen("\"tree\":", "\"root\":", 1);
        assert!(matches!(Embedding::from_json(&anonymous, &tree), Err(FileError::Malformed { .. })));
    }

    #[test]
    fn tables_have_their_decimals() {
        let (tree, embedding) = sample();
        let nodes = embedding.nodes_tsv(&tree);
        assert!(nodes.contains("\n1\t0\t0.3333\t0.0000\t0.0000\t1.0000\t0.3333\t-0.0001\t0\t0\t"), "{nodes}");
        let compare = MethodRow::to_tsv(&embedding.methods);
        assert!(compare.contains("\nradial\t0\t2\t0.300000\t"), "{compare}");
    }
}
