//! The file of an embedding, `embedding.json`: every number with the digits that read back to the same bits.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::nodes::decimals;
use super::{EditRecord, Embedding, TargetKind, Targets, Termination};
use crate::edits::Edit;
use crate::tree::Tree;
use crate::versioned::{self, FileError};

const FORMAT: &str = "espalier-embedding";
/// 2: more losses, manual edits, widths. 3: phases of the convergence curve.
const VERSION: u32 = 3;

impl Embedding {
    /// The text of `embedding.json`.
    #[must_use]
    pub fn to_json(&self) -> String {
        versioned::to_json(FORMAT, VERSION, self)
    }

    /// The embedding of `tree` in a text of `embedding.json`.
    ///
    /// # Errors
    /// [`FileError`] if the text is not such a file, was made for another tree, or breaks a guarantee. The
    /// certificate is not made again here: `espalier_embed::certify` does that.
    pub fn from_json(text: &str, tree: &Tree) -> Result<Self, FileError> {
        let embedding: Self = versioned::from_json(FORMAT, VERSION, text)?;
        versioned::check_tree(FORMAT, &embedding.tree, tree)?;
        check(&embedding, tree.n_nodes()).map_err(|what| FileError::Invalid { format: FORMAT, what })?;
        Ok(embedding)
    }
}

/// Checks the guarantees of an embedding with so many nodes; says which one fails and where.
fn check(embedding: &Embedding, n_nodes: usize) -> Result<(), String> {
    let Targets { angle_rad, length_mm, heading_rad, confidence, .. } = &embedding.targets;
    let angles: Vec<f64> = angle_rad.iter().map(|angle| if angle.is_nan() { 0.0 } else { *angle }).collect();
    for (name, values) in [
        ("targets.angle_rad", &angles),
        ("targets.length_mm", length_mm),
        ("targets.heading_rad", heading_rad),
        ("targets.confidence", confidence),
        ("length_ratio", &embedding.length_ratio),
        ("angle_ratio", &embedding.angle_ratio),
    ] {
        check_column(name, values, n_nodes)?;
    }
    if let Some(node) = angle_rad.iter().skip(1).position(|angle| angle.is_nan()) {
        return Err(format!("targets.angle_rad has no angle for node {}", node + 1));
    }
    check_positions(&embedding.positions_mm, embedding.quantum_mm, n_nodes)?;
    let is_there = |record: &EditRecord| record.edit.branch.max(record.edit.node) < n_nodes.saturating_sub(1);
    if let Some(idx) = embedding.edits.iter().position(|record| !is_there(record)) {
        return Err(format!("edits[{idx}] names a branch or a node that the tree does not have"));
    }
    let is_edge = |edge: usize| (1..n_nodes).contains(&edge);
    match embedding.certificate.pairs.iter().find(|&&(a, b)| !is_edge(a) || !is_edge(b)) {
        Some(pair) => Err(format!("certificate.pairs names edges {pair:?} of a tree of {n_nodes} nodes")),
        None if embedding.certificate.pairs.len() > embedding.certificate.crossings => {
            Err(format!("certificate.pairs are more than the {} crossings", embedding.certificate.crossings))
        }
        None => Ok(()),
    }
}

/// Checks that there is one position per node, finite and rounded.
pub(super) fn check_positions(positions: &[DVec2], quantum_mm: f64, n_nodes: usize) -> Result<(), String> {
    let flat: Vec<f64> = positions.iter().flat_map(DVec2::to_array).collect();
    check_column("positions_mm", &flat, 2 * n_nodes)?;
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

/// An edit and what came of it, side by side.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EditRecordFile {
    branch: usize,
    node: usize,
    angle_asked_deg: f64,
    angle_reached_deg: f64,
    crossings_introduced: usize,
    crossings_removed: usize,
    energy_before: f64,
    energy_after: f64,
}

impl From<EditRecord> for EditRecordFile {
    fn from(record: EditRecord) -> Self {
        let Edit { branch, node, angle_deg } = record.edit;
        Self {
            branch,
            node,
            angle_asked_deg: angle_deg,
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

/// Numbers of which some are not known: `null` in the file.
pub(super) mod none_for_nan {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(in crate::embedding) fn serialize<S: Serializer>(values: &[f64], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(values.iter().map(|&value| (!value.is_nan()).then_some(value)))
    }

    pub(in crate::embedding) fn deserialize<'de, D: Deserializer<'de>>(
        from: D,
    ) -> Result<Vec<f64>, D::Error> {
        let values = Vec::<Option<f64>>::deserialize(from)?;
        Ok(values.into_iter().map(|value| value.unwrap_or(f64::NAN)).collect())
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::diagnose::Diagnose;
    use crate::tree::Node;
    use crate::{Certificate, Energy, Losses, MethodRow, Phase, Pose, TracePoint, WidthMode, Widths};

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
