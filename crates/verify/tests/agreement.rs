//! The sweep and the certificate that the embedding carries are two algorithms with one answer.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

#[path = "../../embed/tests/common/mod.rs"]
mod common;

use espalier_embed::certify;
use espalier_geom::math;
use espalier_model::Tree;
use espalier_verify::meetings;
use glam::DVec2;

/// A layout in which most edges are in order and some fold over, rounded like a written one.
fn layout(tree: &Tree, key: u32) -> Vec<DVec2> {
    let mut stream = common::stream(7000 + key);
    let bend = [0.02, 0.3, 1.0, 3.0][key as usize % 4];
    let step = |length: f64| format!("{length:.3}").parse::<f64>().expect("a number");
    let mut heading = vec![0.0; tree.n_nodes()];
    let mut positions = vec![DVec2::ZERO; tree.n_nodes()];
    for (node, parent) in tree.edges() {
        heading[node] = heading[parent] + bend * stream.normal();
        let end = positions[parent] + tree.edge_length_mm(node) * math::unit_vector(heading[node]);
        positions[node] = DVec2::new(step(end.x), step(end.y));
    }
    positions
}

#[test]
fn two_thousand_random_layouts() {
    let (mut n_planar, mut n_crossing) = (0, 0);
    for key in 0..2000 {
        let n_nodes = 2 + (key as usize * 37) % 90;
        let tree = common::random_tree(key as usize % 8, n_nodes, 1.0, false, key);
        let positions = layout(&tree, key);
        let certificate = certify(&tree, &positions);
        let mut found = meetings(&tree, &positions);
        assert_eq!(found.count, certificate.crossings, "key {key}");
        found.pairs.sort_unstable();
        found.pairs.truncate(certificate.pairs.len());
        assert_eq!(found.pairs, certificate.pairs, "key {key}");
        if certificate.holds() { n_planar += 1 } else { n_crossing += 1 }
    }
    assert!(n_planar > 100 && n_crossing > 1000, "{n_planar} planar, {n_crossing} crossing");
}
