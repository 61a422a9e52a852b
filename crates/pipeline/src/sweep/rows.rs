//! The rows of a sweep: `sweep.tsv`, its data dictionary, the table for a terminal.

use espalier_model::compare_columns;
use espalier_model::table::Table;

use super::{Axis, Combination};
use crate::compare::terminal;

const NUMBER: (&str, &str) = ("combination", "number of the combination and of its folder in runs/");
const ERROR: (&str, &str) = ("error", "why there is no embedding; empty where there is one");
/// What stands where a combination has no embedding.
const NONE: &str = "n/a";

/// The table `sweep.tsv`: one row per combination.
pub(super) fn tsv(axes: &[Axis], done: &[Combination]) -> String {
    let columns = compare_columns();
    let mut names = vec![NUMBER.0];
    names.extend(axes.iter().map(|axis| axis.key.as_str()));
    names.extend(columns.iter().map(|column| column.column.name));
    names.push(ERROR.0);
    let mut table = Table::new(&names);
    for (idx, combination) in done.iter().enumerate() {
        let mut cells = vec![format!("{:03}", idx + 1)];
        cells.extend(combination.values.iter().cloned());
        match &combination.outcome {
            Ok(row) => {
                cells.extend(columns.iter().map(|column| column.text(row)));
                cells.push(String::new());
            }
            Err(reason) => {
                cells.extend(columns.iter().map(|_| NONE.to_owned()));
                cells.push(reason.clone());
            }
        }
        table.row_of(&cells);
    }
    table.into_string()
}

/// The text of `dictionary.tsv` beside a sweep.
pub(super) fn dictionary(axes: &[Axis]) -> String {
    let mut table = Table::new(&["table", "column", "unit", "meaning"]);
    let mut add =
        |column: &str, unit: &str, meaning: &str| table.row(&[&"sweep.tsv", &column, &unit, &meaning]);
    add(NUMBER.0, "n/a", NUMBER.1);
    for axis in axes {
        add(&axis.key, "n/a", "the value of this key of the config");
    }
    for column in compare_columns() {
        add(column.column.name, column.column.unit, column.column.meaning);
    }
    add(ERROR.0, "n/a", ERROR.1);
    table.into_string()
}

/// The table for a terminal; errors stand where the numbers would.
pub(super) fn terminal(axes: &[Axis], done: &[Combination]) -> String {
    let mut heads: Vec<String> = axes.iter().map(|axis| axis.key.clone()).collect();
    heads.push("method".to_owned());
    heads.extend(terminal::number_heads());
    let mut lines = vec![heads];
    let mut errors = String::new();
    for combination in done {
        let mut cells = combination.values.clone();
        match &combination.outcome {
            Ok(row) => {
                cells.push(row.method.clone());
                cells.extend(terminal::numbers(row));
            }
            Err(reason) => {
                cells.push("none".to_owned());
                errors = format!("{errors}{}: {reason}\n", settings(axes, combination));
            }
        }
        lines.push(cells);
    }
    terminal::aligned(&lines, axes.len() + 1) + &errors
}

/// The settings of a combination and what they came to, as a phrase.
pub(super) fn phrase(axes: &[Axis], combination: &Combination) -> String {
    let outcome = match &combination.outcome {
        Ok(row) => format!(
            "crossings {}  energy {:.4}  angle error {:.2}°",
            row.crossings,
            row.energy.total(),
            row.losses.angle3d_error_mean_deg
        ),
        Err(reason) => reason.clone(),
    };
    format!("{}  {outcome}", settings(axes, combination))
}

fn settings(axes: &[Axis], combination: &Combination) -> String {
    let pairs = axes.iter().zip(&combination.values).map(|(axis, value)| format!("{}={value}", axis.key));
    pairs.collect::<Vec<_>>().join(" ")
}
