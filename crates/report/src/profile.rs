//! The calibre on the way from the root to a tip.
//!
//! **Input** the tree. **Output** a plot of the radius along the longest way; data for the script that draws the way to
//! any other tip.
//! **Guarantees** on a tree of many nodes each branch has at most [`MAX_SAMPLES`] samples in the data.

use espalier_model::{Branch, Tree};
use maud::{Markup, html};

use crate::facts::Facts;
use crate::length::Unit;
use crate::page::{absent, data_block};
use crate::plots::{Axes, SIZE};

/// From so many nodes on, branches are sampled.
const MANY_NODES: usize = 12_000;
const MAX_SAMPLES: usize = 6;
/// More tips than these cannot be chosen from: the longest ways.
const MAX_TIPS: usize = 1500;

pub(crate) fn body(facts: &Facts<'_>) -> Markup {
    let tree = facts.tree;
    if tree.n_nodes() < 2 {
        return absent("The tree has a single node: there is no way to a tip.");
    }
    let unit = Unit::of(tree);
    let from_root = from_root_mm(tree);
    let mut tips: Vec<usize> = (1..tree.n_nodes()).filter(|&node| tree.children(node).is_empty()).collect();
    tips.sort_by(|&a, &b| from_root[b].total_cmp(&from_root[a]).then(a.cmp(&b)));
    let longest = tips.first().copied().unwrap_or(0);
    let branches = tree.branches();
    let n_tips = tips.len();
    tips.truncate(MAX_TIPS);
    let name = |tip: usize| {
        let branch = branches.of_node(tip).unwrap_or(0);
        format!("branch {branch}, {} from the root", unit.text(from_root[tip], 3))
    };
    html! {
        p.note {
            "The radius of the inscribed sphere from the root to "
            b #profile-tip { "the farthest tip (" (name(longest)) ")" } "."
            span.with-script { " Choose another tip here or on the map." }
        }
        p.with-script {
            label for="profile-select" { "Tip " }
            select #profile-select {
                @for &tip in &tips { option value=(branches.of_node(tip).unwrap_or(0)) { (name(tip)) } }
            }
            @if tips.len() < n_tips { " the " (tips.len()) " farthest of " (n_tips) }
        }
        (plot(tree, &from_root, longest, unit))
        (data_block("profile-data", &samples(tree, &from_root, (&tips, unit))))
    }
}

/// Path length from the root to each node.
fn from_root_mm(tree: &Tree) -> Vec<f64> {
    let mut from_root = vec![0.0; tree.n_nodes()];
    for (node, parent) in tree.edges() {
        from_root[node] = from_root[parent] + tree.edge_length_mm(node);
    }
    from_root
}

fn plot(tree: &Tree, from_root: &[f64], tip: usize, unit: Unit) -> Markup {
    let mut way: Vec<usize> = std::iter::successors(Some(tip), |&node| tree.parent(node)).collect();
    way.reverse();
    let radius = |node: usize| tree.nodes()[node].radius_mm / unit.mm;
    let most = way.iter().map(|&node| radius(node)).fold(0.0, f64::max);
    let axes = Axes::over([0.0, from_root[tip] / unit.mm], [0.0, 1.08 * most]);
    let points: Vec<String> =
        way.iter().map(|&node| axes.place([from_root[node] / unit.mm, radius(node)]).join(" ")).collect();
    html! {
        figure.plot.wide {
            svg #profile-svg viewBox={ "0 0 " (SIZE[0]) " " (SIZE[1]) } role="img" aria-label="radius against distance from the root" {
                (axes.drawn(&format!("radius ({})", unit.sign), &format!("from the root ({})", unit.sign)))
                g.forks {
                    @for &node in &way {
                        @if tree.children(node).len() > 1 && node != 0 {
                            @let [x, y] = axes.place([from_root[node] / unit.mm, radius(node)]);
                            circle cx=(x) cy=(y) r="3.4" { title { "fork" } }
                        }
                    }
                }
                path.way d={ "M" (points.join("L")) } {}
            }
            figcaption { "Rings mark forks." }
        }
    }
}

/// By branch on the way to one of the tips: its parent, and pairs of distance from the root and radius, both in
/// thousandths of the unit.
fn samples(tree: &Tree, from_root: &[f64], (tips, unit): (&[usize], Unit)) -> serde_json::Value {
    let is_sampled = tree.n_nodes() > MANY_NODES;
    let whole = |value: f64| (1000.0 * value / unit.mm + 0.5).floor() as i64;
    let of = |branch: &Branch| {
        let nodes: Vec<usize> = branch.polyline().collect();
        let step = if is_sampled { nodes.len().div_ceil(MAX_SAMPLES).max(1) } else { 1 };
        let last = nodes.len() - 1;
        let taken = (0..=last).filter(|i| i.is_multiple_of(step) || *i == last);
        let numbers: Vec<i64> = taken
            .flat_map(|i| [whole(from_root[nodes[i]]), whole(tree.nodes()[nodes[i]].radius_mm)])
            .collect();
        serde_json::json!([branch.parent, numbers])
    };
    let branches = tree.branches();
    let mut of_branch = serde_json::Map::new();
    for &tip in tips {
        let mut next = branches.of_node(tip);
        while let Some(index) = next.filter(|index| !of_branch.contains_key(&index.to_string())) {
            of_branch.insert(index.to_string(), of(&branches.list()[index]));
            next = branches.list()[index].parent;
        }
    }
    serde_json::json!({ "unit": unit.sign, "branches": of_branch })
}
