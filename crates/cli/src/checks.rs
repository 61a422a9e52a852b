//! The checks of a run folder as a table for people.

use espalier_pipeline::{Outcome, Verification};

/// The widest that a column is made for the sake of its longest cell.
const WIDEST: usize = 44;

/// One line a check, under one that names the columns, and one that counts; `is_shown` by whether a check fails.
pub(crate) fn table(verification: &Verification, is_shown: impl Fn(bool) -> bool) -> Vec<String> {
    let heads = ["", "file", "claim", "stated", "found", "tolerance"].map(str::to_owned);
    let rows =
        verification.checks.iter().filter(|(_, check)| is_shown(check.fails())).map(|(file, check)| {
            let tolerance = check.tolerance.map_or_else(String::new, |tolerance| format!("{tolerance:.0e}"));
            let shown = |text: String| {
                let is_digest = text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
                if is_digest { text[..12].to_owned() + "…" } else { text }
            };
            let (stated, found) = (shown(check.stated.to_string()), shown(check.found.to_string()));
            [check.outcome.name().to_owned(), file.clone(), check.name.clone(), stated, found, tolerance]
        });
    let rows: Vec<[String; 6]> = std::iter::once(heads).chain(rows).collect();
    let width = |column: usize| {
        let widths = rows.iter().map(|row| row[column].chars().count());
        widths.max().unwrap_or(0).min(WIDEST)
    };
    let widths: [usize; 6] = std::array::from_fn(width);
    let line = |row: &[String; 6]| {
        let cells: Vec<String> =
            row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        cells.join("  ").trim_end().to_owned()
    };
    let mut lines: Vec<String> = if rows.len() > 1 { rows.iter().map(line).collect() } else { Vec::new() };
    let [holds, fails, untested] =
        [Outcome::Holds, Outcome::Fails, Outcome::Untested].map(|outcome| verification.n_of(outcome));
    lines.push(format!("{holds} claims hold, {fails} fail, {untested} untested"));
    lines
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use espalier_pipeline::Check;

    use super::*;

    #[test]
    fn only_digests_are_cut_short() {
        let digest = "0123456789abcdef".repeat(4);
        // As many bytes as a digest, but the twelfth ends inside a letter.
        let foreign = "a".to_owned() + &"é".repeat(31) + "b";
        let checks = vec![("tree.swc".to_owned(), Check::same("tree", digest.as_str(), foreign.as_str()))];
        let verification = Verification { folder: PathBuf::new(), checks, digest };
        let lines = table(&verification, |_| true);
        assert!(lines[1].contains("0123456789ab…") && lines[1].contains(&foreign), "{lines:?}");
        assert_eq!(lines[2], "0 claims hold, 1 fail, 0 untested");
        assert_eq!(table(&verification, |fails| !fails), lines[2..]);
    }
}
