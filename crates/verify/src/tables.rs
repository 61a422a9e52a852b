//! Whether the tables for people say what the JSON says.
//!
//! **Input** the text of a table, what its cells should say. **Output** a check.
//! **Guarantees** columns are found by name; a number must be right to half a unit of its last digit.

use espalier_model::{Embedding, MethodRow, Tree, compare_columns};

use crate::check::Check;

/// A table by column names and rows.
struct Cells<'a> {
    names: Vec<&'a str>,
    rows: Vec<Vec<&'a str>>,
}

impl<'a> Cells<'a> {
    fn new(text: &'a str) -> Self {
        let mut lines = text.lines().map(|line| line.split('\t').collect::<Vec<_>>());
        Self { names: lines.next().unwrap_or_default(), rows: lines.collect() }
    }

    /// The first fault: a row too short or too many, or a cell that does not say what it should.
    fn fault(&self, n_rows: usize, expected: impl Fn(usize, &str) -> Option<Cell>) -> Option<String> {
        if self.rows.len() != n_rows {
            return Some(format!("{} rows", self.rows.len()));
        }
        for (row_idx, row) in self.rows.iter().enumerate() {
            if row.len() != self.names.len() {
                return Some(format!("row {row_idx} has {} cells", row.len()));
            }
            for (name, cell) in self.names.iter().zip(row) {
                let expected = expected(row_idx, name);
                if let Some(expected) = expected.filter(|expected| !expected.is(cell)) {
                    return Some(format!("row {row_idx}, {name}: {cell}, which is {expected:?}"));
                }
            }
        }
        None
    }

    /// The first of some columns that is not there.
    fn missing(&self, required: &[&str]) -> Option<String> {
        required.iter().find(|name| !self.names.contains(name)).map(|name| format!("no column {name}"))
    }
}

/// What a cell should say.
#[derive(Debug)]
enum Cell {
    Number(f64),
    Word(String),
}

impl Cell {
    fn is(&self, cell: &str) -> bool {
        match self {
            Self::Word(word) => word == cell,
            Self::Number(number) => cell.parse::<f64>().is_ok_and(|stated| {
                let half_unit = 0.5 * last_digit(cell);
                (stated - number).abs() <= half_unit * (1.0 + 1e-6) + 1e-12 * number.abs()
            }),
        }
    }

    fn or_none(number: Option<usize>) -> Self {
        number.map_or_else(|| Self::Word("n/a".to_owned()), |number| Self::Number(number as f64))
    }
}

/// What one in the last digit of a number's text is worth.
fn last_digit(text: &str) -> f64 {
    let (digits, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let n_decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let exponent = exponent.parse::<i32>().unwrap_or(0) - n_decimals as i32;
    format!("1e{exponent}").parse().unwrap_or(0.0)
}

/// Checks the first line of a table against what a data dictionary lists for it, in that order.
///
/// `dictionary` is the text of `dictionary.tsv`; `names` are those under which it may list the table.
#[must_use]
pub fn check_header(dictionary: &str, names: &[&str], table: &str) -> Check {
    // A table that is read again begins with a line that names its format.
    let first = table.lines().find(|line| !line.starts_with('#')).unwrap_or_default();
    let header: Vec<&str> = first.split('\t').collect();
    let listed: Vec<&str> = dictionary
        .lines()
        .skip(1)
        .filter_map(|line| {
            let mut cells = line.split('\t');
            names.contains(&cells.next()?).then(|| cells.next()).flatten()
        })
        .collect();
    let stated = format!("{} columns", header.len());
    if listed.is_empty() {
        return Check::untested("columns", stated, "the dictionary does not list this table");
    }
    let stray = header.iter().zip(&listed).find(|(own, listed)| own != listed);
    let fault = match stray {
        Some((own, listed)) => Some(format!("{own}, which dictionary.tsv calls {listed}")),
        None if header.len() != listed.len() => Some(format!("dictionary.tsv lists {}", listed.len())),
        None => None,
    };
    Check::unless("columns", stated, fault)
}

/// Checks `nodes.tsv`.
#[must_use]
pub fn check_nodes_table(text: &str, tree: &Tree, embedding: &Embedding) -> Check {
    const REQUIRED: [&str; 10] =
        ["node", "parent", "x_mm", "y_mm", "z_mm", "radius_mm", "u_mm", "v_mm", "branch", "generation"];
    let branches = tree.branches();
    let expected = |node: usize, name: &str| {
        let data = &tree.nodes()[node];
        let branch = branches.of_node(node);
        Some(match name {
            "node" => Cell::Number(node as f64),
            "parent" => Cell::or_none(data.parent),
            "x_mm" => Cell::Number(data.position_mm.x),
            "y_mm" => Cell::Number(data.position_mm.y),
            "z_mm" => Cell::Number(data.position_mm.z),
            "radius_mm" => Cell::Number(data.radius_mm),
            "u_mm" => Cell::Number(embedding.positions_mm[node].x),
            "v_mm" => Cell::Number(embedding.positions_mm[node].y),
            "branch" => Cell::or_none(branch),
            "generation" => Cell::or_none(branch.map(|branch| branches.list()[branch].generation as usize)),
            "target_angle_deg" if node > 0 => Cell::Number(embedding.targets.angle_rad[node].to_degrees()),
            "length_ratio" => Cell::Number(embedding.length_ratio[node]),
            "angle_ratio" => Cell::Number(embedding.angle_ratio[node]),
            _ => return None,
        })
    };
    let cells = Cells::new(text);
    let fault = cells.missing(&REQUIRED).or_else(|| cells.fault(tree.n_nodes(), expected));
    Check::unless("nodes", format!("{} rows", tree.n_nodes()), fault)
}

/// Checks `compare.tsv`.
#[must_use]
pub fn check_compare_table(text: &str, rows: &[MethodRow]) -> Check {
    const REQUIRED: [&str; 5] = ["method", "crossings", "overlaps", "energy", "targets"];
    let columns = compare_columns();
    let expected = |row: usize, name: &str| {
        let row = &rows[row];
        Some(match name {
            "method" => Cell::Word(row.method.clone()),
            "crossings" => Cell::Number(row.crossings as f64),
            "overlaps" => Cell::Number(row.overlaps as f64),
            "energy" => Cell::Number(row.energy.total()),
            "evaluations" => Cell::Number(row.evaluations as f64),
            "targets" => Cell::Word(row.targets.name().to_owned()),
            _ => Cell::Word(columns.iter().find(|column| column.column.name == name)?.text(row)),
        })
    };
    let cells = Cells::new(text);
    let fault = cells.missing(&REQUIRED).or_else(|| cells.fault(rows.len(), expected));
    Check::unless("methods", format!("{} rows", rows.len()), fault)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_unit_of_the_last_digit() {
        for (text, number, expected) in [
            ("0.333", 1.0 / 3.0, true),
            ("0.334", 1.0 / 3.0, false),
            ("-0.50", -0.503, true),
            ("1.25e-7", 1.254e-7, true),
            ("1.25e-7", 1.26e-7, false),
            ("7", 7.0, true),
            ("seven", 7.0, false),
        ] {
            assert_eq!(Cell::Number(number).is(text), expected, "{text} {number}");
        }
    }
}
