//! Tables of labels: values with names, and colours.
//!
//! | what | for |
//! |---|---|
//! | [`slicer_colors`] | `branches.ctbl`, a colour table of 3D Slicer |
//! | [`snap_labels`] | `branches.label.txt`, a label description of ITK-SNAP |
//! | [`parse_names`] | names of a label map's values, from these and other tables |
//!
//! **Guarantees** colours are whole-number arithmetic on the branch's index, so a branch has the same colour everywhere.

mod names;

use std::fmt::Write as _;

pub use names::parse_names;

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

#[cfg(test)]
mod tests {
    use super::*;

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
