//! Colours of a label map's values, from the tables that have some.
//!
//! | written by | lines |
//! |---|---|
//! | ITK-SNAP | `value R G B A VIS MSH "name"` |
//! | 3D Slicer `.ctbl`, FreeSurfer | `value name R G B A` |
//! | 3D Slicer `.csv` | columns `Color_R`, `Color_G`, `Color_B`, or `R`, `G`, `B` |
//! | BIDS `dseg.tsv` | a column `color` with `#rrggbb` |
//!
//! **Input** the text. **Output** a colour for each value that has one, sRGB.
//! **Guarantees** what is no colour is none: whether the table can be read at all, [`super::parse_names`] says. Parts that
//! are written from 0 to 1 are none.

use std::collections::BTreeMap;

use super::names::{VALUE_COLUMNS, cells};

/// What the columns of red, green and blue are called, in lower case.
const PART_COLUMNS: [[&str; 2]; 3] = [["color_r", "r"], ["color_g", "g"], ["color_b", "b"]];
const COLOR_COLUMNS: [&str; 2] = ["color", "colour"];

/// The colours of a label map's values, as far as the table has any.
#[must_use]
pub fn parse_colors(text: &str) -> BTreeMap<i64, [u8; 3]> {
    let text = text.trim_start_matches('\u{FEFF}');
    let mut lines = text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#')).peekable();
    let columns = lines.peek().and_then(|first| Columns::of(first));
    let entry = |line: &str| match &columns {
        Some(columns) => columns.entry(line),
        None => of_line(line),
    };
    lines.filter_map(entry).collect()
}

/// `value R G B A VIS MSH "name"` or `value name R G B A`.
fn of_line(line: &str) -> Option<(i64, [u8; 3])> {
    let is_snap = line.contains('"');
    let before = line.split('"').next().unwrap_or_default();
    let words: Vec<&str> = before.split([' ', '\t', ',', ':']).filter(|word| !word.is_empty()).collect();
    let first = match (is_snap, words.len()) {
        (true, 7) => 1,
        (false, 6) => 2,
        _ => return None,
    };
    Some((words[0].parse().ok()?, parts([words[first], words[first + 1], words[first + 2]])?))
}

fn parts(words: [&str; 3]) -> Option<[u8; 3]> {
    let [red, green, blue] = words.map(|word| word.parse::<u8>().ok());
    Some([red?, green?, blue?])
}

/// The red, green and blue of `#rrggbb`.
#[must_use]
pub fn rgb_from_hex(word: &str) -> Option<[u8; 3]> {
    let digits = word.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.is_ascii())?;
    let part = |i: usize| u8::from_str_radix(&digits[2 * i..2 * i + 2], 16).ok();
    Some([part(0)?, part(1)?, part(2)?])
}

/// Where a table has values and colours.
struct Columns {
    separator: char,
    value: usize,
    color: Option<usize>,
    parts: Option<[usize; 3]>,
}

impl Columns {
    fn of(line: &str) -> Option<Self> {
        let separator = if line.contains('\t') { '\t' } else { ',' };
        let heads: Vec<String> = cells(line, separator).map(str::to_ascii_lowercase).collect();
        let place =
            |known: &[&str]| known.iter().find_map(|wanted| heads.iter().position(|head| head == wanted));
        let [red, green, blue] = PART_COLUMNS.map(|known| place(&known));
        let parts = red.zip(green).zip(blue).map(|((red, green), blue)| [red, green, blue]);
        Some(Self { separator, value: place(&VALUE_COLUMNS)?, color: place(&COLOR_COLUMNS), parts })
    }

    fn entry(&self, line: &str) -> Option<(i64, [u8; 3])> {
        let cells: Vec<&str> = cells(line, self.separator).collect();
        let cell = |column: usize| cells.get(column).copied().unwrap_or_default();
        let color = self.color.and_then(|column| rgb_from_hex(cell(column)));
        let color = color.or_else(|| self.parts.and_then(|columns| parts(columns.map(cell))))?;
        Some((cell(self.value).parse().ok()?, color))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::label_table::{slicer_colors, snap_labels};

    #[test]
    fn colours_of_four_formats() {
        for text in [
            "# a comment\n1 left_upper 255 0 16 255\n2 lower 1 2 3 255\n3 no colour\n",
            "1 255 0 16 1 1 1 \"left upper\"\n2 1 2 3 1 1 1 \"lower\"\n3 \"none\"\n",
            "index\tname\tcolor\n1\tleft\t#ff0010\n2\tright\t#010203\n3\tnone\tred\n",
            "\u{FEFF}LabelValue,Name,Color_R,Color_G,Color_B\r\n1,left,255,0,16\r\n2,right,1,2,3\r\n3,none,0.5,1,1\r\n",
        ] {
            assert_eq!(parse_colors(text), BTreeMap::from([(1, [255, 0, 16]), (2, [1, 2, 3])]), "{text}");
        }
        for none in [
            "",
            "1 left\n",
            "{\"1\": \"left\"}",
            "1 a 300 0 0 255\n",
            "index\tname\n1\ta\n",
            "index\tcolor\n1\t#äöü\n",
        ] {
            assert!(parse_colors(none).is_empty(), "{none}");
        }
    }

    #[test]
    fn our_own_tables_read_back() {
        let colors = [[1, 2, 3], [255, 128, 0]];
        for text in [slicer_colors(&colors), snap_labels(&colors)] {
            let read = parse_colors(&text);
            assert_eq!((read.get(&1), read.get(&2)), (Some(&colors[0]), Some(&colors[1])), "{text}");
        }
    }
}
