//! The table of a cohort: which scans there are, and how each is to be read.
//!
//! **Input** the text of a table with tabs between cells, a heading, and a row a scan. **Output** [`Row`]s, in their order.
//! **Steps** 1. The heading: every column is one of [`COLUMNS`], a key of the config with a dot in it, or a note. 2. The
//! rows: as many cells as the heading has; ids that can be names of folders, no two alike even where case does not count.
//! **Guarantees** all that is wrong is told at once, each with its line.

use std::collections::BTreeMap;

use crate::config::Override;

/// The columns that are known by a name of their own, and the key of the config that each stands for.
pub(super) const COLUMNS: [(&str, Option<&str>); 10] = [
    ("id", None),
    ("path", Some("input.path")),
    ("config", None),
    ("preset", Some("volume.preset")),
    ("label", Some("volume.label")),
    ("labels", Some("input.labels")),
    ("image", Some("render.volume.image")),
    ("series", Some("input.series")),
    ("volume_index", Some("input.volume_index")),
    ("seed", Some("seed")),
];
/// Columns whose values are text, whatever they look like.
const TEXT_COLUMNS: [&str; 5] = ["path", "preset", "label", "labels", "image"];
/// What the name of a column begins with that is the user's own.
const NOTE: &str = "note";
/// The longest id: it is the name of a folder.
const LONGEST_ID: usize = 100;
/// The most scans of a table: as many as a page shows.
const MOST_ROWS: usize = 10_000;
/// The most edits between a misspelt column and the one that is meant.
const MAX_EDIT_DISTANCE: usize = 3;

/// A scan as the table has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Row {
    /// Its line in the table, from 1.
    pub(super) line: usize,
    pub(super) id: String,
    /// The config that it is run with, as written.
    pub(super) config: Option<String>,
    /// Its settings, in the order of the columns; `input.path` among them.
    pub(super) settings: Vec<Override>,
}

/// The rows of a table, or all that is wrong with it.
pub(super) fn rows(text: &str) -> Result<Vec<Row>, Vec<String>> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().enumerate().map(|(idx, line)| (idx + 1, line));
    let mut lines = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let Some((number, heading)) = lines.next() else { return Err(vec!["it is empty".to_owned()]) };
    let columns: Vec<&str> = heading.split('\t').map(str::trim).collect();
    let mut problems = problems_of_heading(&columns, number);
    if !problems.is_empty() {
        return Err(problems);
    }
    let mut rows = Vec::new();
    let mut known: BTreeMap<String, usize> = BTreeMap::new();
    for (line, text) in lines {
        match row(&columns, line, text) {
            Ok(row) => {
                if let Some(first) = known.insert(row.id.to_ascii_lowercase(), line) {
                    problems.push(format!("line {line}: id {} is that of line {first} already", row.id));
                }
                rows.push(row);
            }
            Err(problem) => problems.push(format!("line {line}: {problem}")),
        }
    }
    if rows.is_empty() && problems.is_empty() {
        problems.push("it has a heading, but no row".to_owned());
    }
    if rows.len() > MOST_ROWS {
        problems.push(format!("it has {} rows, allowed are {MOST_ROWS}", rows.len()));
    }
    if problems.is_empty() { Ok(rows) } else { Err(problems) }
}

fn problems_of_heading(columns: &[&str], line: usize) -> Vec<String> {
    let at = |what: String| format!("line {line}: {what}");
    if let [only] = columns
        && only.contains([',', ';'])
    {
        return vec![at("the cells of a row are parted by tabs, not by commas or semicolons".to_owned())];
    }
    let mut problems: Vec<String> = columns.iter().filter_map(|column| unknown(column)).map(at).collect();
    for (idx, column) in columns.iter().enumerate() {
        if columns[..idx].contains(column) {
            problems.push(at(format!("column {column} is there twice")));
        }
    }
    if !columns.contains(&"id") {
        problems.push(at("there is no column id".to_owned()));
    }
    if !columns.contains(&"path") && !columns.contains(&"config") {
        problems.push(at("there is neither a column path nor a column config".to_owned()));
    }
    problems
}

/// What is wrong with the name of a column.
fn unknown(column: &str) -> Option<String> {
    let is_known = COLUMNS.iter().any(|(name, _)| *name == column);
    if is_known || column.contains('.') || is_note(column) {
        return None;
    }
    if column.is_empty() {
        return Some("a column without a name".to_owned());
    }
    let distance = |name: &str| strsim::damerau_levenshtein(column, name);
    let nearest = COLUMNS.iter().map(|(name, _)| (distance(name), *name)).min();
    let meant = nearest.filter(|(distance, _)| *distance <= MAX_EDIT_DISTANCE);
    let meant = meant.map(|(_, name)| format!("; did you mean {name}?")).unwrap_or_default();
    Some(format!("unknown column {column}{meant}"))
}

fn is_note(column: &str) -> bool {
    column.starts_with(NOTE)
}

fn row(columns: &[&str], line: usize, text: &str) -> Result<Row, String> {
    let cells: Vec<&str> = text.split('\t').map(str::trim).collect();
    if cells.len() != columns.len() {
        return Err(format!("{} cells, the heading has {}", cells.len(), columns.len()));
    }
    let cell = |name: &str| {
        let at = columns.iter().position(|column| *column == name)?;
        Some(cells[at]).filter(|cell| is_given(cell))
    };
    let id = cell("id").ok_or("there is no id")?;
    check_id(id)?;
    if cell("path").is_none() && cell("config").is_none() {
        return Err(format!("{id}: neither path nor config is given"));
    }
    if let Some(path) = cell("path").filter(|path| path.to_ascii_lowercase().ends_with(".toml")) {
        return Err(format!("{id}: path {path} is a config; put it under config"));
    }
    let given = columns.iter().zip(&cells).filter(|(column, cell)| is_given(cell) && !is_note(column));
    let settings = given.filter_map(|(column, cell)| setting(column, cell)).collect();
    Ok(Row { line, id: id.to_owned(), config: cell("config").map(str::to_owned), settings })
}

/// An empty cell, and `n/a` as BIDS has it, say nothing.
fn is_given(cell: &str) -> bool {
    !cell.is_empty() && !cell.eq_ignore_ascii_case("n/a")
}

/// Ids are names of folders on every system, and words of a shell.
fn check_id(id: &str) -> Result<(), String> {
    let is_letter = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    let begins_well = id.starts_with(|c: char| c.is_ascii_alphanumeric());
    if begins_well && id.chars().all(is_letter) && !id.ends_with('.') && id.len() <= LONGEST_ID {
        return Ok(());
    }
    Err(format!(
        "id {id}: must be letters, digits, '-', '_' or '.', begin with a letter or digit, not end with '.', and have at \
         most {LONGEST_ID} of them"
    ))
}

/// The setting that a cell stands for, if it is one.
fn setting(column: &str, cell: &str) -> Option<Override> {
    let known = COLUMNS.iter().find(|(name, _)| *name == column);
    let key = known.map_or(Some(column), |(_, key)| *key)?;
    let value = if TEXT_COLUMNS.contains(&column) { quoted(cell) } else { cell.to_owned() };
    Some(Override { key: key.to_owned(), value })
}

/// A text as TOML has it.
pub(super) fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn refused(text: &str, expected: &[&str]) {
        let problems = rows(text).expect_err("refused");
        assert_eq!(problems.len(), expected.len(), "{problems:?}");
        for (problem, part) in problems.iter().zip(expected) {
            assert!(problem.contains(part), "no {part:?} in {problem}");
        }
    }

    #[test]
    fn a_row_is_an_id_a_config_and_settings() {
        let text = "\u{feff}# made by hand\r\nid\tpath\tpreset\tlabel\tconfig\tnote\tembed.w_angle\tseries\r\n\r\n\
                    a-1\tx/a 1.nii.gz\tairway\tn/a\t\tleft to right\t3\t2\r\nb\tb.nii\t\t3, 4\tb.toml\t\t\t\r\n";
        let rows = rows(text).expect("rows");
        let set = |key: &str, value: &str| Override { key: key.to_owned(), value: value.to_owned() };
        assert_eq!(rows[0].id, "a-1");
        assert_eq!(rows[0].line, 4);
        let expected = [
            set("input.path", "\"x/a 1.nii.gz\""),
            set("volume.preset", "\"airway\""),
            set("embed.w_angle", "3"),
            set("input.series", "2"),
        ];
        assert_eq!(rows[0].settings, expected);
        assert_eq!(rows[1].config.as_deref(), Some("b.toml"));
        assert_eq!(rows[1].settings[1], set("volume.label", "\"3, 4\""));
    }

    #[test]
    fn what_is_wrong_is_told_at_once() {
        refused("", &["it is empty"]);
        refused("# only a comment\n", &["it is empty"]);
        refused("id\tpath\n", &["no row"]);
        refused("id,path\na,b\n", &["parted by tabs"]);
        refused(
            "id\tpth\tpath\tpath\tage\t\na\tb\n",
            &["pth; did you mean path?", "unknown column age", "without a name", "path is there twice"],
        );
        refused("path\nb.nii\n", &["no column id"]);
        refused("id\tlabel\na\t3\n", &["neither a column path nor a column config"]);
        refused(
            "id\tpath\tconfig\na\tb\nb\t\tn/a\nA/1\tx\t\nc\tc.toml\t\n\td\t\nd\td.nii\t\nD\te.nii\t\n",
            &[
                "line 2: 2 cells, the heading has 3",
                "line 3: b: neither path nor config",
                "line 4: id A/1",
                "line 5: c: path c.toml is a config",
                "line 6: there is no id",
                "line 8: id D is that of line 7",
            ],
        );
        for id in [".hidden", "-x", "a b", "a.", "..", "ä", &"x".repeat(101)] {
            refused(&format!("id\tpath\n{id}\tx\n"), &["must be letters"]);
        }
    }
}
