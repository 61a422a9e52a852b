//! Tables of labels: values with names, and colours.
//!
//! | what | for |
//! |---|---|
//! | [`slicer_colors`] | `branches.ctbl`, a colour table of 3D Slicer |
//! | [`snap_labels`] | `branches.label.txt`, a label description of ITK-SNAP |
//! | [`parse_names`], [`parse_colors`] | names and colours of a label map's values, from these and other tables |

mod colors;
mod names;

use std::fmt::Write as _;

pub use colors::{parse_colors, rgb_from_hex};
pub use names::parse_names;

/// The colour table of branches with these colours, sRGB; branch 0 has the value 1.
#[must_use]
pub fn slicer_colors(colors: &[[u8; 3]]) -> String {
    let mut text = String::from(
        "# espalier-colors 1: value name R G B A; the value is the branch plus 1\n0 background 0 0 0 0\n",
    );
    for (branch, [red, green, blue]) in colors.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} branch_{branch} {red} {green} {blue} 255", branch + 1);
    }
    text
}

/// The label description of the same branches.
#[must_use]
pub fn snap_labels(colors: &[[u8; 3]]) -> String {
    let mut text = String::from("# espalier-labels 1: IDX R G B A VIS MSH LABEL; IDX is the branch plus 1\n");
    text += "0 0 0 0 0 0 0 \"Clear Label\"\n";
    for (branch, [red, green, blue]) in colors.iter().enumerate() {
        let _ = writeln!(text, "{} {red} {green} {blue} 1 1 1 \"branch {branch}\"", branch + 1);
    }
    text
}
