//! Colours that the page adds to those that it is handed: the angle lost in space.
//!
//! **Input** the facts. **Output** all colourings of the map, in the order of its menu.

use crate::facts::{Coloring, Facts};
use crate::length::{number, steps};
use crate::losses;

/// The key of the colouring whose colours those of the angle in space are.
const LOSSES: &str = "angle-loss";

/// All colourings: those handed in, and after that of angles the angle lost in space.
pub(crate) fn all(facts: &Facts<'_>) -> Vec<Coloring> {
    let mut colorings = facts.colorings.clone();
    let after = colorings.iter().position(|coloring| coloring.key == LOSSES).map_or(0, |index| index + 1);
    colorings.splice(after..after, in_space(facts));
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
        name: "angle lost in space".to_owned(),
        caption: "angle in the map against the angle in space (°)".to_owned(),
        bins: errors.iter().map(bin).collect(),
        ticks: steps(0.0, most, 5).into_iter().map(|tick| (tick / most, number(tick, 3))).collect(),
        ..like.clone()
    })
}
