//! All methods of a run side by side: `compare.tsv` for people, `compare.json` for figures and checks.
//!
//! **Guarantees** every row is scored against one frozen set of targets, whose digest stands in the file; every layout
//! is there with its coordinates as written, so that each number of the table can be made again from the file, the
//! tree and its views.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::file;
use super::losses::{Better, Losses};
use super::{MethodRow, TargetKind, TracePoint};
use crate::table::{Column, Digits, Table};
use crate::tree::Tree;
use crate::versioned::{self, FileError};

const FORMAT: &str = "espalier-compare";
/// 2: the convergence curve of every method.
const VERSION: u32 = 2;

/// The layouts of all methods of a run, scored alike.
///
/// **Guarantees** one position per node of its tree in each layout, finite and rounded to its `quantum_mm`, exactly as
/// they are written; `chosen` is the index of a layout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// The digest of the tree: [`Tree::digest`].
    pub tree: String,
    /// The digest of the frozen targets: [`Targets::digest`](super::Targets::digest).
    pub targets: String,
    /// The seed of the run.
    pub seed: u64,
    /// Which layout became the embedding.
    pub chosen: usize,
    /// One entry per method.
    pub layouts: Vec<ComparedLayout>,
}

/// One method's layout and its row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComparedLayout {
    /// Its row in `compare.tsv`.
    pub row: MethodRow,
    /// The step to which coordinates are rounded, a power of ten, in mm.
    pub quantum_mm: f64,
    /// Its convergence curve, best so far; empty for a method that does not search.
    pub trace: Vec<TracePoint>,
    /// Where each node lies, plane mm: x to the right, y up.
    pub positions_mm: Vec<DVec2>,
}

/// A cell of `compare.tsv`.
#[derive(Clone, Copy, Debug)]
pub enum CompareCell {
    /// A word.
    Text(fn(&MethodRow) -> String),
    /// A number.
    Number(Digits, fn(&MethodRow) -> f64),
    /// A loss.
    Loss(Digits, fn(&Losses) -> f64),
}

/// A column of `compare.tsv`.
#[derive(Clone, Copy, Debug)]
pub struct CompareColumn {
    /// Name, unit and meaning.
    pub column: Column,
    /// Which way is better.
    pub better: Better,
    /// Its cell in a row.
    pub cell: CompareCell,
}

impl CompareColumn {
    /// The value in a row; `None` for a word.
    #[must_use]
    pub fn value(&self, row: &MethodRow) -> Option<f64> {
        match self.cell {
            CompareCell::Text(_) => None,
            CompareCell::Number(_, of) => Some(of(row)),
            CompareCell::Loss(_, of) => Some(of(&row.losses)),
        }
    }

    /// The text in a row.
    #[must_use]
    pub fn text(&self, row: &MethodRow) -> String {
        match self.cell {
            CompareCell::Text(of) => of(row),
            CompareCell::Number(digits, of) => digits.text(of(row)),
            CompareCell::Loss(digits, of) => digits.text(of(&row.losses)),
        }
    }
}

const NAMES: [CompareColumn; 4] = [
    CompareColumn {
        column: Column::new("method", "n/a", "the method, with its size where that matters"),
        better: Better::Neither,
        cell: CompareCell::Text(|row| row.method.clone()),
    },
    CompareColumn {
        column: Column::new(
            "crossings",
            "pairs",
            "pairs of edges with a point in common they should not have; exact",
        ),
        better: Better::Less,
        cell: CompareCell::Number(Digits::Decimals(0), |row| row.crossings as f64),
    },
    CompareColumn {
        column: Column::new(
            "overlaps",
            "pairs",
            "pairs of edges that overlap at their radii outside of their fork",
        ),
        better: Better::Less,
        cell: CompareCell::Number(Digits::Decimals(0), |row| row.overlaps as f64),
    },
    CompareColumn {
        column: Column::new(
            "energy",
            "1",
            "the one energy by which all methods are judged; the sum of its parts",
        ),
        better: Better::Less,
        cell: CompareCell::Number(Digits::Decimals(6), |row| row.energy.total()),
    },
];

const PROVENANCE: [CompareColumn; 2] = [
    CompareColumn {
        column: Column::new(
            "evaluations",
            "1",
            "how often the method evaluated an energy; of the solver with the moves that its search for sides weighed",
        ),
        better: Better::Neither,
        cell: CompareCell::Number(Digits::Decimals(0), |row| row.evaluations as f64),
    },
    CompareColumn {
        column: Column::new("targets", "n/a", "the targets that the row was scored against"),
        better: Better::Neither,
        cell: CompareCell::Text(|row| TargetKind::name(row.targets).to_owned()),
    },
];

const ENERGY_PARTS: [CompareColumn; 4] = [
    CompareColumn {
        column: Column::new("energy_length", "1", "the part of the energy that changed lengths cost"),
        better: Better::Less,
        cell: CompareCell::Number(Digits::Decimals(6), |row| row.energy.length),
    },
    CompareColumn {
        column: Column::new("energy_angle", "1", "the part that changed angles cost"),
        better: Better::Less,
        cell: CompareCell::Number(Digits::Decimals(6), |row| row.energy.angle),
    },
    CompareColumn {
        column: Column::new(
            "energy_placement",
            "1",
            "the part that headings other than in the global view cost",
        ),
        better: Better::Less,
        cell: CompareCell::Number(Digits::Decimals(6), |row| row.energy.placement),
    },
    CompareColumn {
        column: Column::new("energy_crossing", "1", "the part that crossings cost"),
        better: Better::Less,
        cell: CompareCell::Number(Digits::Decimals(6), |row| row.energy.crossing),
    },
];

/// How many losses stand before `evaluations`: those columns keep their places, new ones follow at the end.
const N_FIRST_LOSSES: usize = 10;

/// The columns of `compare.tsv`, in their order.
#[must_use]
pub fn compare_columns() -> Vec<CompareColumn> {
    let loss = |loss: &super::LossColumn| CompareColumn {
        column: loss.column,
        better: loss.better,
        cell: CompareCell::Loss(loss.digits, loss.of),
    };
    let (first, further) = Losses::COLUMNS.split_at(N_FIRST_LOSSES);
    NAMES
        .into_iter()
        .chain(first.iter().map(loss))
        .chain(PROVENANCE)
        .chain(further.iter().map(loss))
        .chain(ENERGY_PARTS)
        .collect()
}

impl MethodRow {
    /// The table `compare.tsv`: one row per method.
    #[must_use]
    pub fn to_tsv(rows: &[Self]) -> String {
        let columns = compare_columns();
        let names: Vec<Column> = columns.iter().map(|column| column.column).collect();
        let mut table = Table::with(&names);
        for row in rows {
            let cells: Vec<String> = columns.iter().map(|column| column.text(row)).collect();
            table.row_of(&cells);
        }
        table.into_string()
    }
}

impl Comparison {
    /// The text of `compare.json`.
    #[must_use]
    pub fn to_json(&self) -> String {
        versioned::to_json(FORMAT, VERSION, self)
    }

    /// The comparison of layouts of `tree` in a text of `compare.json`.
    ///
    /// # Errors
    /// [`FileError`] if the text is not such a file, was made for another tree, or breaks a guarantee.
    pub fn from_json(text: &str, tree: &Tree) -> Result<Self, FileError> {
        let comparison: Self = versioned::from_json(FORMAT, VERSION, text)?;
        versioned::check_tree(FORMAT, &comparison.tree, tree)?;
        check(&comparison, tree.n_nodes()).map_err(|what| FileError::Invalid { format: FORMAT, what })?;
        Ok(comparison)
    }
}

fn check(comparison: &Comparison, n_nodes: usize) -> Result<(), String> {
    if comparison.chosen >= comparison.layouts.len() {
        return Err(format!(
            "chosen is {}, there are {} layouts",
            comparison.chosen,
            comparison.layouts.len()
        ));
    }
    comparison.layouts.iter().try_for_each(|layout| {
        file::check_positions(&layout.positions_mm, layout.quantum_mm, n_nodes)
            .map_err(|what| format!("layout of {}: {what}", layout.row.method))
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::tree::Node;
    use crate::{Energy, Phase, Targets};

    fn sample() -> (Tree, Comparison) {
        let node = |x, parent| Node { position_mm: DVec3::new(x, 0.0, 0.0), radius_mm: 1.0, parent, kind: 0 };
        let tree = Tree::new(&[node(0.0, None), node(1.0 / 3.0, Some(0))]).expect("a tree");
        let row = |method: &str, stress: f64| MethodRow {
            method: method.to_owned(),
            crossings: 1,
            overlaps: 2,
            energy: Energy { length: 0.1 + 0.2, ..Energy::default() },
            losses: Losses { stress, ..Losses::default() },
            evaluations: 3,
            targets: TargetKind::Intrinsic,
        };
        let layout = |method: &str, x: f64| ComparedLayout {
            row: row(method, x / 7.0),
            quantum_mm: 1e-4,
            positions_mm: vec![DVec2::ZERO, DVec2::new(x, 0.0)],
            trace: vec![TracePoint {
                phase: Phase::Swarm,
                iteration: 1,
                evaluations: 7,
                energy: x,
                crossings: 2,
            }],
        };
        let layouts = vec![layout("radial", 0.333_3), layout("solver", 0.5)];
        let comparison =
            Comparison { tree: tree.digest(), targets: "t".to_owned(), seed: 7, chosen: 1, layouts };
        (tree, comparison)
    }

    #[test]
    fn reads_back_the_same() {
        let (tree, comparison) = sample();
        let back = Comparison::from_json(&comparison.to_json(), &tree).expect("our own file");
        assert_eq!(back, comparison);
    }

    #[test]
    fn refuses_what_breaks_a_guarantee() {
        let (tree, comparison) = sample();
        let refusal = |change: &dyn Fn(&mut Comparison)| {
            let mut broken = comparison.clone();
            change(&mut broken);
            Comparison::from_json(&broken.to_json(), &tree).expect_err("refused").to_string()
        };
        for (change, expected) in [
            (&(|c: &mut Comparison| c.chosen = 2) as &dyn Fn(&mut Comparison), "chosen is 2, there are 2"),
            (&|c| c.layouts[0].positions_mm[1].x = 0.333_33, "layout of radial: positions_mm of node 1"),
            (&|c| c.layouts[1].positions_mm.truncate(1), "layout of solver: positions_mm has 2 numbers"),
            (&|c| c.tree = "another".to_owned(), "another tree"),
        ] {
            let message = refusal(change);
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn fixed_columns_keep_their_places_and_every_column_is_explained() {
        let columns = compare_columns();
        let names: Vec<&str> = columns.iter().map(|column| column.column.name).collect();
        let fixed = "method crossings overlaps energy length_loss_mean length_loss_max angle_loss_mean \
                     angle_loss_max angle3d_loss_mean angle3d_loss_max angle3d_error_mean_deg \
                     angle3d_error_max_deg stress spearman evaluations targets";
        assert_eq!(names[..16].join(" "), fixed);
        let mut sorted = names.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), names.len(), "no name twice");
        assert!(columns.iter().all(|column| !column.column.meaning.is_empty()));
        let (_, comparison) = sample();
        let rows: Vec<MethodRow> = comparison.layouts.iter().map(|layout| layout.row.clone()).collect();
        let tsv = MethodRow::to_tsv(&rows);
        let lines: Vec<Vec<&str>> = tsv.lines().map(|line| line.split('\t').collect()).collect();
        assert_eq!(lines[0], names);
        assert!(lines.iter().all(|line| line.len() == names.len()));
        assert_eq!(lines[2][..4], ["solver", "1", "2", "0.300000"]);
    }

    #[test]
    fn a_digest_of_targets_sees_every_number() {
        let targets = Targets {
            kind: TargetKind::Intrinsic,
            angle_rad: vec![f64::NAN, 1.0],
            length_mm: vec![0.0, 2.0],
            heading_rad: vec![0.0, 3.0],
            confidence: vec![0.0, 0.5],
        };
        let mut digests = vec![targets.digest()];
        type Change = fn(&mut Targets);
        let changes: [Change; 5] = [
            |t| t.kind = TargetKind::Projected,
            |t| t.angle_rad[1] = t.angle_rad[1].next_up(),
            |t| t.length_mm[1] = t.length_mm[1].next_up(),
            |t| t.heading_rad[1] = 3.5,
            |t| t.confidence[1] = 1.0,
        ];
        for change in changes {
            let mut other = targets.clone();
            change(&mut other);
            digests.push(other.digest());
        }
        assert_eq!(targets.digest(), digests[0]);
        digests.sort();
        digests.dedup();
        assert_eq!(digests.len(), 6, "no two alike");
    }
}
