//! The data dictionary of a run folder: every table, every column, its unit and its meaning.
//!
//! Each table declares its columns once, where it is made; this is where they are put together.

use espalier_model::anatomy::{GENERATION_COLUMNS, PROFILE_COLUMNS, STENOSIS_COLUMNS, branch_measures};
use espalier_model::table::{Column, dictionary};
use espalier_model::{LEDGER_COLUMNS, NODE_COLUMNS, RUN_COLUMN, SPHERE_COLUMNS, compare_columns};

use crate::provenance::{INPUT_COLUMNS, TIMING_COLUMNS};
use crate::steps::CONVERGENCE_COLUMNS;

/// The text of `dictionary.tsv`.
pub(crate) fn text() -> String {
    let compare: Vec<Column> = compare_columns().iter().map(|column| column.column).collect();
    let branches: Vec<Column> = branch_measures().iter().map(|measure| measure.column).collect();
    dictionary(&[
        ("compare.tsv", &compare),
        ("nodes.tsv", &NODE_COLUMNS),
        ("branches.tsv", &branches),
        ("generations.tsv", &GENERATION_COLUMNS),
        ("profiles.tsv", &PROFILE_COLUMNS),
        ("stenoses.tsv", &STENOSIS_COLUMNS),
        ("topology.tsv", &LEDGER_COLUMNS),
        ("spheres.tsv", &SPHERE_COLUMNS),
        ("dropped.tsv", &LEDGER_COLUMNS),
        ("growth.tsv", &espalier_volume::GROWTH_COLUMNS),
        ("seeds.tsv", &espalier_volume::SEED_COLUMNS),
        ("convergence.tsv", &CONVERGENCE_COLUMNS),
        ("provenance/inputs.tsv", &INPUT_COLUMNS),
        ("provenance/timings.tsv", &TIMING_COLUMNS),
    ])
}

/// The text of `dictionary.tsv` beside a comparison of runs.
pub(crate) fn of_runs() -> String {
    let columns = compare_columns();
    let columns: Vec<Column> =
        std::iter::once(RUN_COLUMN).chain(columns.iter().map(|column| column.column)).collect();
    dictionary(&[("compare.tsv", &columns)])
}
