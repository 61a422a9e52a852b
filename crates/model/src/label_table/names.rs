//! Names of a label map's values, from the tables that other programs write.
//!
//! | written by | lines |
//! |---|---|
//! | ITK-SNAP | `value R G B A VIS MSH "name"` |
//! | 3D Slicer `.ctbl`, FreeSurfer | `value name R G B A` |
//! | 3D Slicer `.csv`, BIDS `dseg.tsv` | a line of column names, among them `LabelValue` or `index` and `name` |
//! | TotalSegmentator, nnU-Net | JSON `{"1": "spleen"}` or `{"spleen": 1}`, alone or under `labels` |
//! | people | `value name` |
//!
//! **Input** the text. **Output** a name for each value.
//! **Steps** the format by the first letter and the first line; then entry by entry.
//! **Guarantees** of two names of a value the later holds; an error has the line or the entry. No recursion but the
//! JSON parser's own, which is bounded.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::FileError;

const FORMAT: &str = "label names";
/// What the column of values is called, in lower case.
pub(super) const VALUE_COLUMNS: [&str; 4] = ["index", "labelvalue", "value", "label"];
/// What the column of names is called, in lower case.
const NAME_COLUMNS: [&str; 3] = ["name", "label_name", "structure"];

/// The names of a label map's values.
///
/// A line is `value name`, `value name R G B A` as in 3D Slicer, or `value R G B A VIS MSH "name"` as in ITK-SNAP; between
/// value and name stand spaces, tabs, a comma or a colon; `#` begins a comment. A first line with the names of columns
/// makes a table of tabs or commas, as in BIDS; a text that begins with `{` is JSON.
///
/// # Errors
/// [`FileError::Invalid`] with the line or entry that has no whole number or no name, [`FileError::Malformed`] for what
/// is no JSON.
pub fn parse_names(text: &str) -> Result<BTreeMap<i64, String>, FileError> {
    let text = text.trim_start_matches('\u{FEFF}');
    if text.trim_start().starts_with('{') {
        return parse_json(text);
    }
    let is_entry = |line: &str| !line.trim().is_empty() && !line.starts_with('#');
    let first = text.lines().find(|line| is_entry(line)).unwrap_or_default();
    let columns = Columns::of(first);
    let mut names = BTreeMap::new();
    let mut is_head = columns.is_some();
    for (line_idx, line) in text.lines().enumerate().filter(|(_, line)| is_entry(line)) {
        if std::mem::take(&mut is_head) {
            continue;
        }
        let entry = match &columns {
            Some(columns) => columns.entry(line),
            None => parse_line(line.trim()),
        };
        let (value, name) = entry
            .ok_or_else(|| invalid(format!("line {} is no value and name: {line:.60}", line_idx + 1)))?;
        names.insert(value, name);
    }
    Ok(names)
}

fn invalid(what: String) -> FileError {
    FileError::Invalid { format: FORMAT, what }
}

fn parse_line(line: &str) -> Option<(i64, String)> {
    let is_gap = |letter: char| letter.is_whitespace() || letter == ',' || letter == ':';
    let (value, rest) = line.split_once(is_gap)?;
    let (value, rest) = (value.parse().ok()?, rest.trim_matches(is_gap));
    if let Some((_, quoted)) = rest.split_once('"') {
        return Some((value, quoted.split('"').next().unwrap_or_default().to_owned()));
    }
    let words: Vec<&str> = rest.split_whitespace().collect();
    let is_slicer = words.len() == 5 && words[1..].iter().all(|word| word.parse::<f64>().is_ok());
    let name = if is_slicer { words[0].to_owned() } else { words.join(" ") };
    (!name.is_empty()).then_some((value, name))
}

/// Where a table has values and names.
struct Columns {
    separator: char,
    value: usize,
    name: usize,
}

impl Columns {
    /// Of a line that holds the names of columns; none for any other.
    fn of(line: &str) -> Option<Self> {
        let separator = if line.contains('\t') { '\t' } else { ',' };
        let heads: Vec<String> = cells(line, separator).map(str::to_ascii_lowercase).collect();
        let place =
            |known: &[&str]| known.iter().find_map(|wanted| heads.iter().position(|head| head == wanted));
        Some(Self { separator, value: place(&VALUE_COLUMNS)?, name: place(&NAME_COLUMNS)? })
    }

    fn entry(&self, line: &str) -> Option<(i64, String)> {
        let cells: Vec<&str> = cells(line, self.separator).collect();
        let (value, name) = (cells.get(self.value)?.parse().ok()?, (*cells.get(self.name)?).to_owned());
        (!name.is_empty()).then_some((value, name))
    }
}

pub(super) fn cells(line: &str, separator: char) -> impl Iterator<Item = &str> {
    line.split(separator).map(|cell| cell.trim().trim_matches('"'))
}

fn parse_json(text: &str) -> Result<BTreeMap<i64, String>, FileError> {
    let root: Value =
        serde_json::from_str(text).map_err(|source| FileError::Malformed { format: FORMAT, source })?;
    let labels = root.get("labels").unwrap_or(&root);
    let entries = labels.as_object().into_iter().flatten();
    let entry = |(key, value): (&String, &Value)| {
        let pair = match value {
            Value::String(name) => Some((key.parse().ok(), name.clone())),
            Value::Number(number) => Some((number.as_i64(), key.clone())),
            _ => None,
        };
        let pair = pair.and_then(|(value, name)| Some((value?, name))).filter(|(_, name)| !name.is_empty());
        let shown = || key.chars().take(60).collect::<String>();
        pair.ok_or_else(|| invalid(format!("the entry {:?} is no whole number and name", shown())))
    };
    entries.map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::label_table::{slicer_colors, snap_labels};

    #[test]
    fn names_of_three_formats() {
        let text = "\u{FEFF}# lobes\n1 left upper lobe\n2,lower\n3: middle\n4 right_upper 10 20 30 255\n5 1 2 3 1 1 1 \"right \
                    lower\"\n\n-6\tnegative\r\n";
        let names = parse_names(text).expect("names");
        let expected = ["negative", "left upper lobe", "lower", "middle", "right_upper", "right lower"];
        assert_eq!(names.keys().copied().collect::<Vec<_>>(), [-6, 1, 2, 3, 4, 5]);
        assert_eq!(names.values().map(String::as_str).collect::<Vec<_>>(), expected);
        for bad in ["lobe 1\n", "1\n", "1 \n", "1.5 x\n", "1 ,\n"] {
            assert!(parse_names(bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn tables_and_json() {
        let lungs = BTreeMap::from([(10, "left lung".to_owned()), (11, "right lung".to_owned())]);
        for text in [
            "index\tname\tabbreviation\tcolor\n10\tleft lung\tLL\t#ff0000\n11\tright lung\tRL\t#00ff00\n",
            "LabelValue,Name,Color_R,Color_G\r\n10,left lung,1,2\r\n11,\"right lung\",3,4\r\n",
            "{\"10\": \"left lung\", \"11\": \"right lung\"}",
            " {\"labels\": {\"left lung\": 10, \"right lung\": 11}, \"channel_names\": {\"0\": \"CT\"}}",
        ] {
            assert_eq!(parse_names(text).expect(text), lungs);
        }
        for (text, fragment) in [
            ("index\tname\n10\tleft\n\nx\tright\n", "line 4"),
            ("index\tname\n10\n", "line 2"),
            ("{\"labels\": {\"lungs\": [1, 2]}}", "\"lungs\""),
            ("{\"left\": 1.5}", "\"left\""),
            ("{\"left\": 1", "line 1"),
        ] {
            let error = parse_names(text).expect_err(text).to_string();
            assert!(error.contains(fragment), "{error}");
        }
        let deep = "{\"a\":".repeat(100_000);
        assert!(parse_names(&deep).is_err());
    }

    #[test]
    fn our_own_tables_read_back() {
        let names = parse_names(&slicer_colors(&[[9, 8, 7]; 3])).expect("a colour table");
        assert_eq!(names.get(&3).map(String::as_str), Some("branch_2"));
        assert_eq!(
            parse_names(&snap_labels(&[[9, 8, 7]; 2])).expect("labels").get(&2).map(String::as_str),
            Some("branch 1")
        );
    }
}
