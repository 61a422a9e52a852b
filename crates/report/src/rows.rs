//! A table as it was written, read again: the page shows what the files say.

/// A table of text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rows {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Rows {
    /// The table in a text with tabs between cells; rows that are shorter than the heading are filled up.
    #[must_use]
    pub fn parse(tsv: &str) -> Self {
        let cells = |line: &str| line.split('\t').map(str::to_owned).collect::<Vec<_>>();
        let mut lines = tsv.lines();
        let columns = lines.next().map(cells).unwrap_or_default();
        let rows = lines.map(|line| {
            let mut row = cells(line);
            row.resize(columns.len(), String::new());
            row
        });
        Self { rows: rows.collect(), columns }
    }

    /// How many rows it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether it has no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The rows.
    #[must_use]
    pub fn rows(&self) -> &[Vec<String>] {
        &self.rows
    }

    /// The place of a column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }

    /// A cell; empty where there is none, or where it says so.
    #[must_use]
    pub fn text(&self, row: usize, column: &str) -> &str {
        let cell = self.column(column).and_then(|column| self.rows.get(row)?.get(column));
        cell.map(String::as_str).filter(|cell| *cell != "n/a").unwrap_or_default()
    }

    /// A number; `NaN` where there is none.
    #[must_use]
    pub fn number(&self, row: usize, column: &str) -> f64 {
        self.text(row, column).parse().unwrap_or(f64::NAN)
    }

    /// The numbers of a column, `NaN` where there is none.
    #[must_use]
    pub fn numbers(&self, column: &str) -> Vec<f64> {
        (0..self.len()).map(|row| self.number(row, column)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_by_name() {
        let rows = Rows::parse("a\tb_mm\n1\tn/a\n2\n3\t-0.5\n");
        assert_eq!(rows.len(), 3);
        assert_eq!(rows.text(0, "a"), "1");
        assert!(rows.number(0, "b_mm").is_nan() && rows.number(1, "b_mm").is_nan());
        assert_eq!(rows.number(2, "b_mm").to_bits(), (-0.5_f64).to_bits());
        assert_eq!(rows.text(9, "a"), "");
        assert_eq!(rows.text(0, "c"), "");
        assert!(Rows::parse("").is_empty());
    }
}
