//! The nodes at which most is lost, so that a reader looks there first.
//!
//! **Input** the embedding. **Output** the worst nodes by angle, by length and by angle in space, each with a number
//! that marks it on the map.

use espalier_model::Embedding;
use maud::{Markup, html};

use crate::facts::Facts;
use crate::length::number;
use crate::losses;
use crate::page::{Head, absent, table};
use crate::verdict::{degrees, percent};

/// How many of each kind.
const N_EACH: usize = 6;
/// What is less is not worth a look: degrees, and shares of a length.
const LEAST_DEG: f64 = 1.0;
const LEAST_SHARE: f64 = 0.005;

/// A node at which much is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Worst {
    /// Its number on the map, from 1.
    pub(crate) id: usize,
    pub(crate) node: usize,
    angle_deg: f64,
    length_share: f64,
    angle3d_deg: f64,
}

/// The worst nodes, by angle, by length, by angle in space; each once.
pub(crate) fn worst(facts: &Facts<'_>) -> Vec<Worst> {
    let (tree, embedding) = (facts.tree, facts.embedding);
    let angle_deg = losses::angle_deg(tree, embedding);
    let length_share = losses::length_share(tree, embedding);
    let angle3d_deg = losses::angle3d_deg(tree, &embedding.positions_mm);
    let mut found: Vec<Worst> = Vec::new();
    for (losses, least) in [(&angle_deg, LEAST_DEG), (&length_share, LEAST_SHARE), (&angle3d_deg, LEAST_DEG)]
    {
        let mut order: Vec<usize> = (0..losses.len()).filter(|&node| losses[node] >= least).collect();
        order.sort_by(|&a, &b| losses[b].total_cmp(&losses[a]).then(a.cmp(&b)));
        for node in order.into_iter().take(N_EACH) {
            if found.iter().all(|known| known.node != node) {
                found.push(Worst {
                    id: found.len() + 1,
                    node,
                    angle_deg: angle_deg[node],
                    length_share: length_share[node],
                    angle3d_deg: angle3d_deg[node],
                });
            }
        }
    }
    found
}

pub(crate) fn body(facts: &Facts<'_>) -> Markup {
    let found = worst(facts);
    if found.is_empty() {
        return absent(nothing_lost(facts.embedding));
    }
    let branches = facts.tree.branches();
    let head = |name, meaning, is_number| Head { name, meaning, is_number };
    let heads = [
        head("mark", "its number on the map", true),
        head("node", "as in nodes.tsv", true),
        head("branch", "as in branches.tsv", true),
        head("angle loss", "against its target", true),
        head("length loss", "of the edge to its parent", true),
        head("angle error in space", "the angle at its parent, in the map against in space", true),
        head("where (R, A, S mm)", "in space", false),
    ];
    let rows: Vec<Vec<Markup>> = found
        .iter()
        .map(|worst| {
            let place = facts.tree.position_mm(worst.node).to_array().map(|value| number(value, 4)).join(", ");
            vec![
                html! { a id={ "row-" (worst.id) } href={ "#at-" (worst.id) } { (worst.id) } },
                html! { (worst.node) },
                html! { (branches.of_node(worst.node).map_or_else(String::new, |branch| branch.to_string())) },
                html! { (degrees(worst.angle_deg)) },
                html! { (percent(worst.length_share)) },
                html! { (degrees(worst.angle3d_deg)) },
                html! { (place) },
            ]
        })
        .collect();
    html! {
        p.note { "Where the map is furthest from the tree: by angle, by length, by angle in space, " (N_EACH) " each at most. The numbers lead to their marks on the map." }
        (table("sortable", &heads, &rows))
    }
}

fn nothing_lost(embedding: &Embedding) -> &'static str {
    if embedding.certificate.holds() {
        "No node loses as much as a degree or half a percent of length."
    } else {
        "No node loses a degree or half a percent of length; but branches cross."
    }
}
