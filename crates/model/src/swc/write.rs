//! Writes a [`Tree`] as SWC, and reads it back.
//!
//! **Format** `espalier-swc` version 1: comment lines `# key value` (`format`, `space`, `unit`, then the
//! caller's), then the nodes with ids 1..n in preorder, positions in RAS+ mm and radii in mm.
//!
//! **Precision** 12 significant digits, not a number of decimals, because a lung is 300 mm wide and a neurite
//! of electron microscopy 0.00005 mm: 1e-9 mm at lung size, far less for a neuron. Should two joined nodes be
//! nearer than that, the whole file is written with 17 digits, so that no edge collapses.
//!
//! **Guarantees** reading a written file and writing it again gives the same bytes.

use std::fmt::Write as _;

use super::{SwcError, SwcScale, parse};
use crate::{Node, Tree};

const FORMAT: &str = "espalier-swc";
const VERSION: &str = "1";
const DIGITS: usize = 12;
/// Enough for every `f64` to come back as it was.
const EXACT_DIGITS: usize = 17;

/// The SWC text of a tree in mm, with `header` pairs as further comment lines.
///
/// ```
/// use espalier_model::{Node, Tree, swc};
/// use glam::DVec3;
/// let node = |z: f64, parent| Node { position_mm: DVec3::new(0.0, 0.0, z), radius_mm: 0.5, parent, kind: 3 };
/// let tree = Tree::new(&[node(0.0, None), node(1.0 / 3.0, Some(0))]).unwrap();
/// let text = swc::write(&tree, &[("digest", "abc")]);
/// assert!(text.ends_with("1 3 0 0 0 0.5 -1\n2 3 0 0 0.333333333333 0.5 1\n"));
/// assert_eq!(swc::write(&swc::read_tree(&text).unwrap(), &[("digest", "abc")]), text);
/// assert!(swc::read_tree("1 1 0 0 0 1 -1\n").is_err()); // no header: its unit is unknown
/// ```
#[must_use]
pub fn write(tree: &Tree, header: &[(&str, &str)]) -> String {
    let mut text = format!("# format {FORMAT} {VERSION}\n# space RAS\n# unit mm\n");
    for (key, value) in header {
        let pair = format!("{key} {value}").replace(['\n', '\r', '\0'], " ");
        text += &format!("# {pair}\n");
    }
    text += "# id type x y z radius parent\n";

    let collapses = |(node, parent): (usize, usize)| {
        let rounded = |node| tree.position_mm(node).to_array().map(|value| significant(value, DIGITS));
        rounded(node) == rounded(parent)
    };
    let n_digits = if tree.edges().any(collapses) { EXACT_DIGITS } else { DIGITS };
    for (node_idx, node) in tree.nodes().iter().enumerate() {
        let [x, y, z] = node.position_mm.to_array().map(|value| significant(value, n_digits));
        let radius = significant(node.radius_mm, n_digits);
        let parent = node.parent.map_or("-1".to_owned(), |parent| (parent + 1).to_string());
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} {} {x} {y} {z} {radius} {parent}", node_idx + 1, node.kind);
    }
    text
}

/// The tree of a file that [`write()`] made.
///
/// # Errors
/// [`SwcError::Header`] if the header is not ours, and as [`parse`] and [`Tree::new`].
pub fn read_tree(text: &str) -> Result<Tree, SwcError> {
    expect_header(text, "format", "espalier-swc 1")?;
    expect_header(text, "space", "RAS")?;
    expect_header(text, "unit", "mm")?;
    let (traced, _) = parse(text.as_bytes(), &SwcScale::millimetres())?;
    let nodes: Vec<Node> = traced
        .nodes
        .iter()
        .map(|n| Node { position_mm: n.position_mm, radius_mm: n.radius_mm, parent: n.parent, kind: n.kind })
        .collect();
    Ok(Tree::new(&nodes)?)
}

/// Whether a text says that it is a file of [`write()`], hence in mm.
#[must_use]
pub fn is_own(text: &[u8]) -> bool {
    text.starts_with(format!("# format {FORMAT} ").as_bytes())
}

/// The value of the first header line `# key value`.
#[must_use]
pub fn header_value<'t>(text: &'t str, key: &str) -> Option<&'t str> {
    let value_of = |line: &'t str| line.strip_prefix("# ")?.strip_prefix(key)?.strip_prefix(' ');
    text.lines().take_while(|line| line.starts_with('#')).find_map(value_of).map(str::trim_end)
}

/// The first header line with `key` must say `expected`.
fn expect_header(text: &str, key: &'static str, expected: &'static str) -> Result<(), SwcError> {
    let found = header_value(text, key).unwrap_or_default();
    if found == expected { Ok(()) } else { Err(SwcError::Header { key, found: found.to_owned(), expected }) }
}

/// A finite number with so many significant digits, without trailing zeros; never `-0`.
fn significant(value: f64, n_digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let scientific = format!("{value:.*e}", n_digits - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    // Plain notation where it is short; a mantissa and exponent outside.
    if (-9..n_digits as i32).contains(&exponent) {
        let n_decimals = (n_digits as i32 - 1 - exponent).max(0) as usize;
        trim_zeros(&format!("{value:.n_decimals$}")).to_owned()
    } else {
        format!("{}e{exponent}", trim_zeros(mantissa))
    }
}

fn trim_zeros(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn significant_digits() {
        let cases = [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0 / 3.0, "0.333333333333"),
            (-300.0, "-300"),
            (299.999_999_999_999_9, "300"),
            (123_456.789_012_345_6, "123456.789012"),
            (1e9, "1000000000"),
            (1.5e-9, "0.0000000015"),
            (1.5e-12, "1.5e-12"),
        ];
        for (value, expected) in cases {
            assert_eq!(significant(value, DIGITS), expected);
        }
    }

    fn chain(z: &[f64]) -> Tree {
        let node = |(idx, &z): (usize, &f64)| Node {
            position_mm: DVec3::new(-0.1, 100.0 / 7.0, z),
            radius_mm: 1.0 / 7.0,
            parent: idx.checked_sub(1),
            kind: -1,
        };
        Tree::new(&z.iter().enumerate().map(node).collect::<Vec<_>>()).expect("a tree")
    }

    #[test]
    fn written_read_written_is_the_same() {
        for tree in [chain(&[0.0]), chain(&[1.0 / 3.0, 2.0 / 3.0, 1e-7]), chain(&[1.0, 1.0 + 1e-15])] {
            let text = write(&tree, &[("seed", "7"), ("unit", "furlong\n9 9 9 9 9 9 9")]);
            let again = read_tree(&text).expect("our own file");
            assert_eq!(write(&again, &[("seed", "7"), ("unit", "furlong\n9 9 9 9 9 9 9")]), text);
            for (a, b) in tree.nodes().iter().zip(again.nodes()) {
                assert!(a.position_mm.distance(b.position_mm) < 1e-9);
            }
        }
    }

    #[test]
    fn refuses_what_is_not_ours() {
        let text = write(&chain(&[0.0, 1.0]), &[]);
        for (from, to) in [("swc 1", "swc 2"), ("unit mm", "unit um"), ("RAS", "LPS"), ("# unit mm\n", "")] {
            let error = read_tree(&text.replace(from, to)).expect_err("not ours");
            assert!(matches!(error, SwcError::Header { .. }), "{error}");
        }
    }
}
