//! Tables of labels: values with names, and colours.
//!
//! | what | for |
//! |---|---|
//! | [`slicer_colors`] | `branches.ctbl`, a colour table of 3D Slicer |
//! | [`snap_labels`] | `branches.label.txt`, a label description of ITK-SNAP |
//! | [`parse_names`] | names of a label map's values, in either format or as plain lines |
//!
//! **Guarantees** colours are whole-number arithmetic on the branch's index, so a branch has the same colour everywhere.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::FileError;

/// A turn of the colour wheel in whole steps.
const TURN: u32 = 6 * 256;
/// Steps from one branch to the next: the golden section of a turn, so that numbers that are near have other colours.
const STEP: u32 = 949;
/// The darkest that a channel gets: labels are looked at on black.
const FLOOR: u32 = 64;

/// The colour table of branches 0 to `n_branches` − 1, which have the values 1 to `n_branches`.
#[must_use]
pub fn slicer_colors(n_branches: usize) -> String {
    let mut text = String::from(
        "# espalier-colors 1: value name R G B A; the value is the branch plus 1\n0 background 0 0 0 0\n",
    );
    for branch in 0..n_branches {
        let [red, green, blue] = color(branch);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} branch_{branch} {red} {green} {blue} 255", branch + 1);
    }
    text
}

/// The label description of the same branches.
#[must_use]
pub fn snap_labels(n_branches: usize) -> String {
    let mut text = String::from("# espalier-labels 1: IDX R G B A VIS MSH LABEL; IDX is the branch plus 1\n");
    text += "0 0 0 0 0 0 0 \"Clear Label\"\n";
    for branch in 0..n_branches {
        let [red, green, blue] = color(branch);
        let _ = writeln!(text, "{} {red} {green} {blue} 1 1 1 \"branch {branch}\"", branch + 1);
    }
    text
}

/// A bright colour.
fn color(branch: usize) -> [u32; 3] {
    let hue = (branch as u64 * u64::from(STEP) % u64::from(TURN)) as u32;
    let (sector, rest) = (hue / 256, hue % 256);
    let scaled = |value: u32| FLOOR + value * (255 - FLOOR) / 255;
    let (low, high, up, down) = (scaled(0), scaled(255), scaled(rest), scaled(255 - rest));
    match sector {
        0 => [high, up, low],
        1 => [down, high, low],
        2 => [low, high, up],
        3 => [low, down, high],
        4 => [up, low, high],
        _ => [high, low, down],
    }
}

/// The names of a label map's values.
///
/// A line is `value name`, `value name R G B A` as in 3D Slicer, or `value R G B A VIS MSH "name"` as in ITK-SNAP; between
/// value and name stand spaces, tabs, a comma or a colon; `#` begins a comment. Of two names the later holds.
///
/// # Errors
/// [`FileError::Invalid`] with the line that does not begin with a whole number or has no name.
pub fn parse_names(text: &str) -> Result<BTreeMap<i64, String>, FileError> {
    let mut names = BTreeMap::new();
    for (line_idx, line) in text.trim_start_matches('\u{FEFF}').lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (value, name) = parse_name(line).ok_or_else(|| FileError::Invalid {
            format: "label names",
            what: format!("line {} is no value and name: {line:.60}", line_idx + 1),
        })?;
        names.insert(value, name);
    }
    Ok(names)
}

fn parse_name(line: &str) -> Option<(i64, String)> {
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

#[cfg(test)]
mod tests {
    use super::*;

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
    fn our_own_tables_read_back() {
        let names = parse_names(&slicer_colors(3)).expect("a colour table");
        assert_eq!(names.get(&3).map(String::as_str), Some("branch_2"));
        assert_eq!(
            parse_names(&snap_labels(2)).expect("labels").get(&2).map(String::as_str),
            Some("branch 1")
        );
    }

    #[test]
    fn near_numbers_have_other_colours() {
        let distance = |a: usize, b: usize| {
            let pairs = color(a).into_iter().zip(color(b));
            pairs.map(|(a, b)| a.abs_diff(b)).sum::<u32>()
        };
        for branch in 0..1000 {
            assert!((1..4).all(|next| distance(branch, branch + next) > 60), "{branch}");
            assert!(color(branch).iter().all(|&channel| (FLOOR..=255).contains(&channel)));
        }
    }
}
