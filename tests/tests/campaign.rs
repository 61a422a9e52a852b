//! Random trees of eight families: certified, and every claim checked by other means. `scripts/campaign` is the same
//! for ten thousand trees of up to 5,000 nodes.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

#[path = "../../crates/embed/tests/common/mod.rs"]
mod common;

use espalier_embed::{Method, Params, SolverParams, embed};
use espalier_model::Tree;
use espalier_verify::{Claim, Weights, check_comparison, check_embedding};
use glam::DVec3;

/// The solver with the constructive methods, and little work.
fn params(mirrors: bool) -> Params {
    Params {
        method: Method::Solver,
        methods: vec![Method::Projection],
        solver: SolverParams { effort: 0.01, mirrors, ..SolverParams::default() },
        ..Params::default()
    }
}

/// Lays a tree flat, and checks everything that is said about the result.
#[track_caller]
fn check(tree: &Tree, params: &Params, what: &str) {
    let views = common::views_along(tree, DVec3::new(0.6, 0.0, 0.8));
    let made = embed(tree, &views, params, 0, &|_| {}).expect(what);
    let weights = Weights {
        length: params.w_length,
        angle: params.w_angle,
        side: params.w_side,
        placement: params.w_placement,
        ..Weights::default()
    };
    let claim = Claim {
        tree,
        views: Some(&views),
        embedding: &made.embedding,
        weights: &weights,
        must_be_best: true,
    };
    let mut checks = check_embedding(&claim);
    checks.extend(check_comparison(&claim, &made.comparison));
    let failed: Vec<_> = checks.iter().filter(|check| check.fails()).collect();
    assert!(failed.is_empty(), "{what}: {failed:?}");
}

#[test]
fn every_family_at_every_size() {
    for key in 0..96 {
        let (family, n_nodes) = (key as usize % 8, 1 + (key as usize * 29) % 70);
        let decades = [0.0, 0.5, 2.0, 6.0][key as usize / 8 % 4];
        let tree = common::random_tree(family, n_nodes, decades, key % 5 == 0, 90_000 + key);
        let what = format!("{} of {n_nodes} nodes, key {}", common::FAMILIES[family], 90_000 + key);
        check(&tree, &params(key % 3 != 0), &what);
    }
}

#[test]
fn three_hundred_nodes_of_each_family() {
    for family in 0..8 {
        let key = 91_000 + family as u32;
        let tree = common::random_tree(family, 300, 1.0, false, key);
        check(&tree, &params(true), &format!("{} of 300 nodes, key {key}", common::FAMILIES[family]));
    }
}
