//! Tab-separated tables: one header line, one line a row, `\n` line ends.

use std::fmt::{Display, Write as _};

/// What a column of a table holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name, with the unit at its end where it has a common one.
    pub name: &'static str,
    /// Its unit: `mm`, `deg`, `1` for a pure number, `n/a` for names and indices.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
}

impl Column {
    /// A column.
    #[must_use]
    pub const fn new(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        Self { name, unit, meaning }
    }
}

/// How a number is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// With so many decimals.
    Decimals(usize),
    /// With so many significant digits, without an exponent.
    Significant(usize),
}

impl Digits {
    /// The text of a number.
    #[must_use]
    pub fn text(self, value: f64) -> String {
        match self {
            Self::Decimals(decimals) => fixed(value, decimals),
            Self::Significant(digits) => significant(value, digits),
        }
    }
}

/// A data dictionary: the columns of tables, each table by its file's name.
#[must_use]
pub fn dictionary(tables: &[(&str, &[Column])]) -> String {
    let mut dictionary = Table::new(&["table", "column", "unit", "meaning"]);
    for (table, columns) in tables {
        for column in *columns {
            dictionary.row(&[table, &column.name, &column.unit, &column.meaning]);
        }
    }
    dictionary.into_string()
}

/// A tab-separated table under construction.
#[derive(Clone, Debug)]
pub struct Table {
    text: String,
    n_columns: usize,
}

impl Table {
    /// An empty table with these columns; a column with a unit has it in its name.
    #[must_use]
    pub fn new(columns: &[&str]) -> Self {
        Self { text: columns.join("\t") + "\n", n_columns: columns.len() }
    }

    /// An empty table with these columns.
    #[must_use]
    pub fn with(columns: &[Column]) -> Self {
        let names: Vec<&str> = columns.iter().map(|column| column.name).collect();
        Self::new(&names)
    }

    /// Adds a row. Tabs and line breaks inside a cell become spaces.
    ///
    /// # Panics
    /// In debug builds, if the row has not as many cells as the table has columns.
    pub fn row(&mut self, cells: &[&dyn Display]) {
        debug_assert_eq!(cells.len(), self.n_columns, "row length");
        for (cell_idx, cell) in cells.iter().enumerate() {
            if cell_idx > 0 {
                self.text.push('\t');
            }
            let start = self.text.len();
            // Writing to a string cannot fail.
            let _ = write!(self.text, "{cell}");
            if self.text[start..].contains(['\t', '\n', '\r']) {
                let clean = self.text[start..].replace(['\t', '\n', '\r'], " ");
                self.text.replace_range(start.., &clean);
            }
        }
        self.text.push('\n');
    }

    /// Adds a row of texts.
    ///
    /// # Panics
    /// As [`Table::row`].
    pub fn row_of(&mut self, cells: &[String]) {
        let cells: Vec<&dyn Display> = cells.iter().map(|cell| cell as &dyn Display).collect();
        self.row(&cells);
    }

    /// The finished table.
    #[must_use]
    pub fn into_string(self) -> String {
        self.text
    }
}

/// A number with a fixed number of decimals; never `-0`; `NaN` becomes `n/a`.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_nan() {
        return "n/a".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_owned(),
        _ => text,
    }
}

/// A number with `digits` significant digits and no exponent: the decimals follow from its size.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() || value == 0.0 {
        return fixed(value, 0);
    }
    let magnitude = espalier_geom::math::floor(espalier_geom::math::log10(value.abs())) as i64;
    let decimals = digits as i64 - 1 - magnitude;
    fixed(value, usize::try_from(decimals).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits() {
        for (value, expected) in
            [(0.0, "0"), (1234.567, "1235"), (0.001_234_56, "0.001235"), (-2.0, "-2.000"), (f64::NAN, "n/a")]
        {
            assert_eq!(significant(value, 4), expected);
        }
    }

    #[test]
    fn a_dictionary_names_table_and_unit() {
        let columns = [Column::new("u_mm", "mm", "to the right")];
        let text = dictionary(&[("nodes.tsv", &columns)]);
        assert_eq!(text, "table\tcolumn\tunit\tmeaning\nnodes.tsv\tu_mm\tmm\tto the right\n");
    }

    #[test]
    fn cells_cannot_break_the_table() {
        let mut table = Table::new(&["a", "b"]);
        table.row(&[&"x\ty\n", &fixed(-0.0001, 2)]);
        assert_eq!(table.into_string(), "a\tb\nx y \t0.00\n");
    }
}
