//! Tab-separated tables: one header line, one line a row, `\n` line ends.

use std::fmt::{Display, Write as _};

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_cannot_break_the_table() {
        let mut table = Table::new(&["a", "b"]);
        table.row(&[&"x\ty\n", &fixed(-0.0001, 2)]);
        assert_eq!(table.into_string(), "a\tb\nx y \t0.00\n");
    }
}
