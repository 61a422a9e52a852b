//! The colours of two trees on one map.
//!
//! **Input** what is known of the shared tree's nodes. **Output** palette values by node for either panel, and the scale.
//! **Steps** the baseline is grey; what it has alone has the colour of loss. In the follow-up what both have is coloured by
//! its change, on a diverging scale whose middle is no change; what is new has a colour of its own.

use espalier_model::{Fate, Juxtaposition, SharedNode, change_percent};

use super::ChangeOf;
use crate::coloring::{Coloring, Scale, Tick, value_at_share};
use crate::palette::{Palette, Rgb};
use crate::unit;

/// Ends of the scale, in percent; the first that holds what is to be seen.
const ENDS_PERCENT: [f64; 5] = [10.0, 20.0, 30.0, 40.0, 60.0];

/// Colours by node: a palette value at both ends of its edge, for either panel.
pub(super) struct Colors {
    /// The diverging scale alone, with its ticks, for the key.
    pub key: Coloring,
    /// The scale and the colours of loss, gain and neither.
    pub palette: Palette,
    pub ends: [Vec<[f32; 2]>; 2],
    pub lost: Rgb,
    pub new: Rgb,
    pub neither: Rgb,
}

impl Colors {
    pub(super) fn new(found: &Juxtaposition, change: ChangeOf) -> Self {
        let scale = Palette::changes();
        let [lost, new, neither] = Palette::fates();
        let (palette, factor, [of_lost, of_new, of_neither]) = scale.with([lost, new, neither]);
        let changes: Vec<[f64; 2]> =
            (0..found.nodes.len()).map(|node| changes_at(found, change, node)).collect();
        let end = end_percent(found, change, &changes);
        let value = |percent: f64| {
            let share = (0.5 + 0.5 * percent / end).clamp(0.0, 1.0) as f32;
            if percent.is_finite() { share * factor } else { of_neither }
        };
        let baseline = |node: &SharedNode| match node.fate {
            Fate::Matched => [of_neither; 2],
            Fate::Lost => [of_lost; 2],
            Fate::New => [of_new; 2],
        };
        let followup = |(node, changes): (&SharedNode, &[f64; 2])| match node.fate {
            Fate::Matched => changes.map(value),
            _ => baseline(node),
        };
        let ends = [
            found.nodes.iter().map(baseline).collect(),
            found.nodes.iter().zip(&changes).map(followup).collect(),
        ];
        let caption = match change {
            ChangeOf::Radius => "radius change (%)",
            ChangeOf::Length => "length change (%)",
        };
        let most = changes.iter().flatten().copied().filter(|change| change.is_finite());
        let (least, most) = most.fold((0.0, 0.0), |(low, high): (f64, f64), c| (low.min(c), high.max(c)));
        let ticks = ticks(end, [least < -1.001 * end, most > 1.001 * end]);
        let scale_of = Scale { caption: caption.to_owned(), ticks };
        let key = Coloring { palette: scale, ends: Vec::new(), scale: Some(scale_of) };
        Self { key, palette, ends, lost, new, neither }
    }
}

/// The change at the upper and at the lower end of a node's edge, in percent; `NaN` where it is not known.
fn changes_at(found: &Juxtaposition, change: ChangeOf, node: usize) -> [f64; 2] {
    let Some(row) = found.nodes[node].row else { return [f64::NAN; 2] };
    if change == ChangeOf::Length {
        return [found.rows[row].length_change_percent(); 2];
    }
    let at = |node: usize| {
        let SharedNode { baseline_radius_mm, followup_radius_mm, .. } = found.nodes[node];
        change_percent([baseline_radius_mm.unwrap_or(f64::NAN), followup_radius_mm.unwrap_or(f64::NAN)])
    };
    // At a fork the incoming tube is drawn, so its change is shown there.
    let above = found.shared.parent(node).map(at).filter(|change| change.is_finite());
    [above.unwrap_or(at(node)), at(node)]
}

/// The end of a scale that tells nearly all changes apart, and the narrowest place of each branch.
fn end_percent(found: &Juxtaposition, change: ChangeOf, changes: &[[f64; 2]]) -> f64 {
    let known = |node: &usize| found.nodes[*node].fate == Fate::Matched && changes[*node][1].is_finite();
    let spread = (1..found.nodes.len())
        .filter(known)
        .map(|node| (changes[node][1].abs(), found.shared.edge_length_mm(node)));
    let at_share = value_at_share(spread.collect());
    let narrowest = found.of_fate(Fate::Matched).map(|row| row.narrowest_percent.abs());
    let narrowest = narrowest.filter(|percent| percent.is_finite() && change == ChangeOf::Radius);
    let wanted = narrowest.fold(at_share.unwrap_or(0.0), f64::max);
    let [.., last] = ENDS_PERCENT;
    ENDS_PERCENT.into_iter().find(|&end| end >= wanted).unwrap_or(last)
}

/// Five ticks: no change in the middle, signs on the others; `is_clipped` at either end.
fn ticks(end: f64, is_clipped: [bool; 2]) -> Vec<Tick> {
    [-1.0, -0.5, 0.0, 0.5, 1.0]
        .into_iter()
        .map(|share: f64| {
            let number = unit::text((share * end).abs(), 3);
            let beyond = match share {
                -1.0 if is_clipped[0] => "≤ ",
                1.0 if is_clipped[1] => "≥ ",
                _ => "",
            };
            let sign = if share < 0.0 {
                "−"
            } else if share > 0.0 {
                "+"
            } else {
                ""
            };
            Tick {
                position: 0.5 + 0.5 * share,
                text: format!("{beyond}{sign}{number}"),
                is_mean: share == 0.0,
            }
        })
        .collect()
}
