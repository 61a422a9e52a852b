//! Several runs side by side: rows per run and method, as `compare.tsv` and `compare.json` of a comparison.
//!
//! The layouts stay in the runs; here are the rows with all digits, and what tells which of them compare: rows of one
//! tree and one set of targets.

use serde::{Deserialize, Serialize};

use super::MethodRow;
use super::comparison::compare_columns;
use crate::table::{Column, Table};
use crate::versioned::{self, FileError};

const FORMAT: &str = "espalier-compare-runs";
const VERSION: u32 = 1;

/// The column before those of a run's own `compare.tsv`.
pub const RUN_COLUMN: Column = Column::new("run", "n/a", "the run");

/// The rows of several runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComparedRuns {
    /// One entry per run.
    pub runs: Vec<ComparedRun>,
}

/// The rows of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComparedRun {
    /// What the run is called.
    pub name: String,
    /// The digest of its tree.
    pub tree: String,
    /// The digest of its targets.
    pub targets: String,
    /// Its seed.
    pub seed: u64,
    /// Which row's layout became the embedding.
    pub chosen: usize,
    /// One row per method.
    pub rows: Vec<MethodRow>,
}

impl ComparedRuns {
    /// The table `compare.tsv` of a comparison of runs.
    #[must_use]
    pub fn to_tsv(&self) -> String {
        let columns = compare_columns();
        let names: Vec<Column> =
            std::iter::once(RUN_COLUMN).chain(columns.iter().map(|column| column.column)).collect();
        let mut table = Table::with(&names);
        for run in &self.runs {
            for row in &run.rows {
                let cells = columns.iter().map(|column| column.text(row));
                table.row_of(&std::iter::once(run.name.clone()).chain(cells).collect::<Vec<_>>());
            }
        }
        table.into_string()
    }

    /// The text of `compare.json` of a comparison of runs.
    #[must_use]
    pub fn to_json(&self) -> String {
        versioned::to_json(FORMAT, VERSION, self)
    }

    /// The rows in a text of such a file.
    ///
    /// # Errors
    /// [`FileError`] if the text is not such a file.
    pub fn from_json(text: &str) -> Result<Self, FileError> {
        let runs: Self = versioned::from_json(FORMAT, VERSION, text)?;
        match runs.runs.iter().find(|run| run.chosen >= run.rows.len()) {
            Some(run) => {
                let what =
                    format!("{}: chosen is {}, there are {} rows", run.name, run.chosen, run.rows.len());
                Err(FileError::Invalid { format: FORMAT, what })
            }
            None => Ok(runs),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Energy, Losses, TargetKind};

    #[test]
    fn rows_come_back_with_all_digits() {
        let row = MethodRow {
            method: "radial".to_owned(),
            crossings: 0,
            overlaps: 2,
            energy: Energy { length: 0.1 + 0.2, ..Energy::default() },
            losses: Losses { stress: 1.0 / 3.0, ..Losses::default() },
            evaluations: 3,
            targets: TargetKind::Projected,
        };
        let run = |name: &str, chosen| ComparedRun {
            name: name.to_owned(),
            tree: "t".to_owned(),
            targets: "u".to_owned(),
            seed: u64::MAX,
            chosen,
            rows: vec![row.clone(), row.clone()],
        };
        let runs = ComparedRuns { runs: vec![run("a", 0), run("b", 1)] };
        assert_eq!(ComparedRuns::from_json(&runs.to_json()).expect("our own file"), runs);
        let tsv = runs.to_tsv();
        assert!(tsv.starts_with("run\tmethod\tcrossings\t") && tsv.contains("\nb\tradial\t0\t2\t0.300000\t"));
        assert_eq!(tsv.lines().count(), 5);
        let broken = ComparedRuns { runs: vec![run("c", 2)] };
        let error = ComparedRuns::from_json(&broken.to_json()).expect_err("refused");
        assert!(error.to_string().contains("c: chosen is 2, there are 2 rows"), "{error}");
    }
}
