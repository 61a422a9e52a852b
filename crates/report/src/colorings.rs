//! Colours that the page adds to those that it is handed: the angle lost in space, and labels.
//!
//! **Input** the facts. **Output** all colourings of the map, in the order of its menu.
//! **Source** [OkabeIto] for labels, lightest and darkest left out.

use std::collections::BTreeMap;

use crate::facts::{Coloring, Facts};
use crate::length::{number, steps};
use crate::losses;

/// The key of the colouring whose colours those of the angle in space are.
const LOSSES: &str = "angle-loss";
/// Okabe and Ito's colours; labels beyond take them again.
const NAMES: [[u8; 3]; 7] = [
    [0xe6, 0x9f, 0x00],
    [0x56, 0xb4, 0xe9],
    [0x00, 0x9e, 0x73],
    [0xf0, 0xe4, 0x42],
    [0x00, 0x72, 0xb2],
    [0xd5, 0x5e, 0x00],
    [0xcc, 0x79, 0xa7],
];
/// What has no label.
const GREY: [u8; 3] = [0x9a, 0xa0, 0xa8];
/// Labels with a colour in the legend of their own; those of fewer branches are grey.
const MAX_LABELS: usize = 21;

/// All colourings: those handed in, the angle lost in space, and labels where there are any.
pub(crate) fn all(facts: &Facts<'_>) -> Vec<Coloring> {
    let mut colorings = facts.colorings.clone();
    colorings.extend(in_space(facts));
    colorings.extend(labels(facts));
    colorings
}

fn in_space(facts: &Facts<'_>) -> Option<Coloring> {
    let like = facts.colorings.iter().find(|coloring| coloring.key == LOSSES)?;
    let errors = losses::angle3d_deg(facts.tree, &facts.embedding.positions_mm);
    // At least a degree, so that rounding does not fill the scale.
    let most = errors.iter().copied().fold(1.0, f64::max);
    let n_colors = like.light.len();
    let bin = |error: &f64| ((error / most * n_colors as f64) as usize).min(n_colors.saturating_sub(1)) as u8;
    Some(Coloring {
        key: "space",
        name: "lost 3D orientation".to_owned(),
        caption: "angle in the map against the angle in space (°)".to_owned(),
        bins: errors.iter().map(bin).collect(),
        ticks: steps(0.0, most, 5).into_iter().map(|tick| (tick / most, number(tick, 3))).collect(),
        ..like.clone()
    })
}

fn labels(facts: &Facts<'_>) -> Option<Coloring> {
    let rows = facts.branches.as_ref()?;
    let mut n_branches: BTreeMap<&str, usize> = BTreeMap::new();
    for row in 0..rows.len() {
        let name = rows.text(row, "label_name");
        if !name.is_empty() {
            *n_branches.entry(name).or_default() += 1;
        }
    }
    let mut names: Vec<(&str, usize)> = n_branches.into_iter().collect();
    if names.is_empty() {
        return None;
    }
    names.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(b.0)));
    names.truncate(MAX_LABELS);
    let place = |name: &str| names.iter().position(|(known, _)| *known == name).map_or(0, |index| index + 1);
    let branches = facts.tree.branches();
    let bin =
        |node: usize| branches.of_node(node).map_or(0, |branch| place(rows.text(branch, "label_name")) as u8);
    let colors: Vec<[u8; 3]> =
        std::iter::once(GREY).chain(NAMES.iter().copied().cycle().take(names.len())).collect();
    let width = colors.len() as f64;
    let ticks = std::iter::once("other").chain(names.iter().map(|(name, _)| *name));
    Some(Coloring {
        key: "label",
        name: "label".to_owned(),
        caption: String::new(),
        bins: (0..facts.tree.n_nodes()).map(bin).collect(),
        ticks: ticks.enumerate().map(|(i, name)| ((i as f64 + 0.5) / width, name.to_owned())).collect(),
        light: colors.clone(),
        dark: colors,
    })
}
