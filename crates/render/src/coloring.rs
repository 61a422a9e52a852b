//! What each place of the tree is coloured by, and the scale that explains it.
//!
//! **Input** a tree with its embedding. **Output** a palette value in [0, 1] at both ends of each edge, and ticks.
//! **Notation** r̄ the mean radius over the tree's length, R the half range in octaves.
//! **Steps** *radius*: ½ + log₂(r / r̄) / 2R, so that the mean lies in the middle and "twice as thick" is as far
//! from it as "half as thick"; R is the 98th percentile over the length, at least ¼ and at most 2 octaves.
//! *Counts and losses*: value over the largest value.
//! **Source** section 4.1 of [Hu2022] (radius against the mean radius of the whole).
//! **Differs from the source** a logarithmic scale, because calibres of trees fall by a factor at each fork, and
//! by default the local radius, so that a narrowing inside a branch is seen; `branch-radius` is the paper's.

use espalier_geom::{angle, math};
use espalier_model::{Branch, Branches, Embedding, Tree};

use crate::branch_names;
use crate::orientation::Orientation;
use crate::palette::Palette;
use crate::params::{ColorBy, Params};
use crate::parts;
use crate::unit::{self, LengthUnit};

/// The share of the length whose radii the scale must tell apart.
const SHARE_IN_SCALE: f64 = 0.98;
/// Bounds of the half range in octaves: below, noise would look like structure; above, forks would look alike.
const HALF_RANGE: [f64; 2] = [0.25, 2.0];
/// More generations than this run into each other and are drawn as a continuous bar.
const MAX_STEPS: usize = 10;
/// Letters of a label's name at most.
const MAX_NAME: usize = 28;
/// Ticks closer than this to a more important one are left out, as a share of the bar.
const TICK_GAP: f64 = 0.09;

/// A mark on the colour bar.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    /// Where, from 0 (bottom) to 1 (top).
    pub position: f64,
    /// Its number, with a word where it is not a plain tick.
    pub text: String,
    /// Whether it marks the mean.
    pub is_mean: bool,
}

/// The scale of the colours.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scale {
    /// What is coloured, with its unit.
    pub caption: String,
    /// The marks, from the bottom up; of names in the order in which they are read.
    pub ticks: Vec<Tick>,
}

/// The colours of a tree.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coloring {
    /// The palette.
    pub palette: Palette,
    /// By node: its value in [0, 1] at the upper and at the lower end of the edge to its parent; at the root both
    /// are the root's.
    pub ends: Vec<[f32; 2]>,
    /// The scale; `None` where colours only tell branches apart, or where no radius is known.
    pub scale: Option<Scale>,
}

/// Colours the tree as `params.color_by` says.
pub(crate) fn color(
    (tree, branches): (&Tree, &Branches),
    embedding: &Embedding,
    orientation: &Orientation,
    params: &Params,
) -> Coloring {
    match params.color_by {
        ColorBy::Part => parts::color(tree, branches, params.theme),
        ColorBy::Label => by_label(tree, branches, params),
        ColorBy::OrientationLoss => {
            by_loss("lost orientation (°)", (tree, params), |node| orientation.loss_deg[node])
        }
        ColorBy::Radius => by_radius(tree, &local_radii(tree), params),
        ColorBy::BranchRadius => by_radius(tree, &branch_radii(tree, branches), params),
        ColorBy::Generation => by_generation(tree, branches, params),
        ColorBy::Branch => by_branch(tree, branches),
        ColorBy::AngleLoss => {
            by_loss("angle loss (°)", (tree, params), |node| angle_loss_deg(tree, embedding, node))
        }
        ColorBy::LengthLoss => {
            by_loss("length loss (%)", (tree, params), |node| 100.0 * length_loss(tree, embedding, node))
        }
    }
}

/// |θ − θ_e| of a node in degrees, 0 to 180; 0 at the root and its children, which have no angle.
pub(crate) fn angle_loss_deg(tree: &Tree, embedding: &Embedding, node: usize) -> f64 {
    let Some((parent, grandparent)) = tree.parent(node).and_then(|p| Some((p, tree.parent(p)?))) else {
        return 0.0;
    };
    let at = |node: usize| embedding.positions_mm[node];
    let drawn = angle::ccw(at(grandparent) - at(parent), at(node) - at(parent));
    // A reflection of the whole turns every angle round.
    let drawn = if embedding.pose.is_reflected { std::f64::consts::TAU - drawn } else { drawn };
    angle::wrap(drawn - embedding.targets.angle_rad[node]).abs().to_degrees()
}

/// |l − l_e| / l of the edge from a node to its parent; 0 at the root.
pub(crate) fn length_loss(tree: &Tree, embedding: &Embedding, node: usize) -> f64 {
    let target = embedding.targets.length_mm[node];
    tree.parent(node).filter(|_| target > 0.0).map_or(0.0, |parent| {
        let drawn = embedding.positions_mm[node].distance(embedding.positions_mm[parent]);
        // A drawn length is rounded to the quantum; below that there is no loss to speak of.
        let lost = (drawn - target).abs();
        if lost <= 2.0 * embedding.quantum_mm { 0.0 } else { lost / target }
    })
}

/// By node: the radii at the upper and at the lower end of its edge.
fn local_radii(tree: &Tree) -> Vec<[f64; 2]> {
    let radius = |node: usize| tree.nodes()[node].radius_mm;
    (0..tree.n_nodes()).map(|node| [radius(tree.parent(node).unwrap_or(node)), radius(node)]).collect()
}

/// By node: the mean radius of its branch, at both ends.
fn branch_radii(tree: &Tree, branches: &Branches) -> Vec<[f64; 2]> {
    let mut radii = local_radii(tree);
    for branch in branches.list() {
        let mean = mean_radius_mm(tree, branch);
        radii[branch.nodes.clone()].fill([mean; 2]);
    }
    radii
}

/// The mean radius of a branch over its length, mm.
pub(crate) fn mean_radius_mm(tree: &Tree, branch: &Branch) -> f64 {
    let radius = |node: usize| tree.nodes()[node].radius_mm;
    let (mut weighted, mut length) = (0.0, 0.0);
    for node in branch.nodes.clone() {
        let edge = tree.edge_length_mm(node);
        weighted += edge * 0.5 * (radius(node) + radius(tree.parent(node).unwrap_or(node)));
        length += edge;
    }
    weighted / length
}

fn by_radius(tree: &Tree, radii_mm: &[[f64; 2]], params: &Params) -> Coloring {
    let palette = Palette::diverging();
    let mean_mm = tree.mean_radius_mm();
    if mean_mm <= 0.0 {
        return Coloring { palette, ends: vec![[0.5; 2]; radii_mm.len()], scale: None };
    }
    let octaves = |radius_mm: f64| math::log2(radius_mm / mean_mm);
    let half_range = half_range(tree, radii_mm, octaves);
    let value = |radius_mm: f64| (0.5 + octaves(radius_mm) / (2.0 * half_range)).clamp(0.0, 1.0) as f32;
    let ends = radii_mm.iter().map(|ends| ends.map(value)).collect();

    let unit = LengthUnit::choose(params.unit, mean_mm);
    let factor = math::pow(2.0, half_range);
    let shown = tree.edges().flat_map(|(node, _)| radii_mm[node]);
    let (least, most) = shown.fold((mean_mm, mean_mm), |(least, most), r| (least.min(r), most.max(r)));
    let ticks = radius_ticks(
        [mean_mm / factor, mean_mm, mean_mm * factor].map(|radius_mm| radius_mm / unit.mm),
        [least < 0.999 * mean_mm / factor, most > 1.001 * mean_mm * factor],
    );
    Coloring { palette, ends, scale: Some(Scale { caption: format!("radius ({})", unit.sign), ticks }) }
}

/// The octaves on either side of the mean that hold [`SHARE_IN_SCALE`] of the length.
fn half_range(tree: &Tree, radii_mm: &[[f64; 2]], octaves: impl Fn(f64) -> f64) -> f64 {
    let spread = tree
        .edges()
        .flat_map(|(node, _)| radii_mm[node].map(|r| (octaves(r).abs(), 0.5 * tree.edge_length_mm(node))));
    value_at_share(spread.collect()).unwrap_or(HALF_RANGE[0]).clamp(HALF_RANGE[0], HALF_RANGE[1])
}

/// The value that [`SHARE_IN_SCALE`] of the length does not exceed, from values with their lengths.
pub(crate) fn value_at_share(mut spread: Vec<(f64, f64)>) -> Option<f64> {
    spread.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = spread.iter().map(|&(_, length)| length).sum();
    let mut passed = 0.0;
    let at_share = spread.iter().find(|&&(_, length)| {
        passed += length;
        passed >= SHARE_IN_SCALE * total
    });
    at_share.map(|&(value, _)| value)
}

/// Ticks of a logarithmic bar from `low` over `mean` in the middle to `high`; `is_clipped` at either end.
fn radius_ticks([low, mean, high]: [f64; 3], is_clipped: [bool; 2]) -> Vec<Tick> {
    let place = |value: f64| 0.5 + 0.5 * math::ln(value / mean) / math::ln(high / mean);
    let mut ticks =
        vec![Tick { position: 0.5, text: format!("{} mean", unit::text(mean, 3)), is_mean: true }];
    for (is_clipped, position, sign, value) in
        [(is_clipped[0], 0.0, "≤", low), (is_clipped[1], 1.0, "≥", high)]
    {
        if is_clipped {
            ticks.push(Tick { position, text: format!("{sign} {}", unit::text(value, 2)), is_mean: false });
        }
    }
    let mut round = unit::ladder(low, high);
    if round.len() < 3 {
        round = unit::multiples(low, high, 5);
    }
    for value in round {
        add_tick(&mut ticks, place(value), unit::text(value, 3));
    }
    ticks.sort_by(|a, b| a.position.total_cmp(&b.position));
    ticks
}

/// Adds a tick unless another one stands in its way.
fn add_tick(ticks: &mut Vec<Tick>, position: f64, text: String) {
    if ticks.iter().all(|tick| (tick.position - position).abs() >= TICK_GAP) {
        ticks.push(Tick { position, text, is_mean: false });
    }
}

fn by_generation(tree: &Tree, branches: &Branches, params: &Params) -> Coloring {
    let generation = |node| branches.of_node(node).map_or(0, |branch| branches.list()[branch].generation);
    let last = (0..tree.n_nodes()).map(generation).max().unwrap_or(0);
    let n_steps = last as usize + 1;
    let is_stepped = n_steps <= MAX_STEPS;
    let ordered = Palette::ordered(params.theme);
    let palette = if is_stepped { ordered.in_steps(n_steps) } else { ordered };
    let place = |generation: usize| {
        if is_stepped { palette.value_of(generation) } else { generation as f32 / last as f32 }
    };
    let shown: Vec<f64> = if is_stepped {
        (0..=last).map(f64::from).collect()
    } else {
        unit::multiples(0.0, f64::from(last), 6).into_iter().filter(|tick| tick.fract() == 0.0).collect()
    };
    let ticks = shown.into_iter().map(|tick| (f64::from(place(tick as usize)), tick)).collect();
    let ends = (0..tree.n_nodes()).map(|node| [place(generation(node) as usize); 2]).collect();
    Coloring { palette, ends, scale: Some(linear_scale("generation", ticks)) }
}

/// One colour a branch, see [`crate::branch_names`].
fn by_branch(tree: &Tree, branches: &Branches) -> Coloring {
    let palette = Palette::names();
    let names = branch_names::names(branches, palette.len());
    let root_name = names.first().copied().unwrap_or(0);
    let ends = (0..tree.n_nodes())
        .map(|node| [palette.value_of(branches.of_node(node).map_or(root_name, |branch| names[branch])); 2])
        .collect();
    Coloring { palette, ends, scale: None }
}

/// The labels that the caller knows, the first on top of the scale and what has none at its foot; else one colour for
/// each kind that the nodes have.
fn by_label(tree: &Tree, branches: &Branches, params: &Params) -> Coloring {
    let Some(labels) =
        params.labels.as_ref().filter(|labels| labels.of_branch.len() == branches.list().len())
    else {
        return by_kind(tree);
    };
    let n_names = labels.entries.len();
    let colors = labels.entries.iter().map(|entry| entry.color).rev();
    let palette = Palette::labels(colors, params.theme);
    // The first entry is the last of the palette, whose first is grey.
    let value_of =
        |label: Option<usize>| palette.value_of(label.map_or(0, |label| n_names - label.min(n_names)));
    let label_of = |node: usize| branches.of_node(node).or((!labels.of_branch.is_empty()).then_some(0));
    let label_of = |node: usize| label_of(node).and_then(|branch| labels.of_branch[branch]);
    let ends: Vec<[f32; 2]> = (0..tree.n_nodes()).map(|node| [value_of(label_of(node)); 2]).collect();
    let tick = |label: Option<usize>, text: &str| Tick {
        position: f64::from(value_of(label)),
        text: text.to_owned(),
        is_mean: false,
    };
    let mut ticks: Vec<Tick> =
        labels.entries.iter().enumerate().map(|(i, entry)| tick(Some(i), &shortened(&entry.name))).collect();
    ticks.push(tick(None, "no label"));
    Coloring { palette, ends, scale: Some(Scale { caption: "label".to_owned(), ticks }) }
}

/// A name that leaves room for the tree.
fn shortened(name: &str) -> String {
    if name.chars().count() <= MAX_NAME {
        return name.to_owned();
    }
    name.chars().take(MAX_NAME - 1).chain(['…']).collect()
}

/// One colour for each label that the nodes have, in ascending order.
fn by_kind(tree: &Tree) -> Coloring {
    let kinds: std::collections::BTreeSet<i32> =
        tree.edges().map(|(node, _)| tree.nodes()[node].kind).collect();
    let kinds: Vec<i32> = kinds.into_iter().collect();
    let palette = Palette::names().first(kinds.len());
    let value_of = |kind: i32| palette.value_of(kinds.binary_search(&kind).unwrap_or(0));
    let ends = tree.nodes().iter().map(|node| [value_of(node.kind); 2]).collect();
    let tick = |&kind: &i32| Tick { position: f64::from(value_of(kind)), text: label(kind), is_mean: false };
    let scale = Scale { caption: "label".to_owned(), ticks: kinds.iter().map(tick).collect() };
    Coloring { palette, ends, scale: Some(scale) }
}

/// The structures of the SWC format by their numbers.
fn label(kind: i32) -> String {
    match kind {
        0 => "no label".to_owned(),
        1 => "soma".to_owned(),
        2 => "axon".to_owned(),
        3 => "basal dendrite".to_owned(),
        4 => "apical dendrite".to_owned(),
        other => format!("label {other}"),
    }
}

fn by_loss(caption: &str, (tree, params): (&Tree, &Params), loss_of: impl Fn(usize) -> f64) -> Coloring {
    let losses: Vec<f64> = (0..tree.n_nodes()).map(loss_of).collect();
    // At least 1 (degree, percent), so that rounding does not fill the scale.
    let most = losses.iter().copied().filter(|loss| loss.is_finite()).fold(1.0, f64::max);
    let ticks = unit::multiples(0.0, most, 5).into_iter().map(|tick| (tick / most, tick)).collect();
    let ends = losses.iter().map(|loss| [(loss / most) as f32; 2]).collect();
    Coloring { palette: Palette::losses(params.theme), ends, scale: Some(linear_scale(caption, ticks)) }
}

fn linear_scale(caption: &str, ticks: Vec<(f64, f64)>) -> Scale {
    let ticks = ticks
        .into_iter()
        .map(|(position, value)| Tick { position, text: unit::text(value, 3), is_mean: false })
        .collect();
    Scale { caption: caption.to_owned(), ticks }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_stands_in_the_middle_among_round_numbers() {
        let ticks = radius_ticks([0.5, 2.0, 8.0], [true, false]);
        let shown: Vec<_> = ticks.iter().map(|tick| tick.text.as_str()).collect();
        assert_eq!(shown, ["≤ 0.5", "1", "2 mean", "5"]);
        for (tick, position) in ticks.iter().zip([0.0, 0.25, 0.5, 0.5 + 0.25 * math::log2(2.5)]) {
            assert!((tick.position - position).abs() < 1e-9, "{tick:?}");
        }
        // Too narrow for the ladder: even steps instead.
        let narrow = radius_ticks([1.6, 2.0, 2.5], [false, false]);
        assert!(
            narrow.len() >= 4 && narrow.iter().all(|tick| (0.0..=1.0).contains(&tick.position)),
            "{narrow:?}"
        );
    }
}
