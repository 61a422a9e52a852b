//! Errors of trees and grids that no reader lets through, so that only the library can meet them.
#![allow(clippy::expect_used, clippy::panic, reason = "this is how a test speaks")]

use espalier_model::{Diagnose, Grid, Mask, Node, Tree, nifti_out};
use glam::{DAffine3, DVec3};

/// A fork of this size at this place.
fn fork(origin_mm: DVec3, size_mm: f64) -> Tree {
    let node = |at: [f64; 3], parent| Node {
        position_mm: origin_mm + size_mm * DVec3::from_array(at),
        radius_mm: 0.0,
        parent,
        kind: 0,
    };
    let nodes = vec![
        node([0.0, 0.0, 0.0], None),
        node([0.0, 3.0, 0.0], Some(0)),
        node([-2.0, 5.0, 1.0], Some(1)),
        node([2.0, 5.0, 0.0], Some(1)),
    ];
    Tree::new(&nodes).expect("a tree")
}

/// The code and the exit code of an error.
fn told<T>(result: Result<T, impl Diagnose>) -> (&'static str, u8) {
    match result {
        Err(error) => (error.code(), error.class().exit_code()),
        Ok(_) => panic!("no error"),
    }
}

#[test]
fn trees_beyond_all_measure() {
    let far = fork(DVec3::ZERO, 1e91);
    assert_eq!(told(espalier_views::find_views(&far, &Default::default(), 0)), ("E-VIEWS-TOO-FAR", 3));
    let large = fork(DVec3::ZERO, 1e70);
    let views = espalier_views::find_views(&large, &Default::default(), 0).expect("views");
    let embedded = espalier_embed::embed(&large, &views.hierarchy, &Default::default(), 0, &|_| {});
    assert_eq!(told(embedded), ("E-EMBED-SCALE", 3));
    let usual = fork(DVec3::ZERO, 1.0);
    let juxtaposed = espalier_juxtapose::juxtapose(&usual, &large, &Default::default());
    assert_eq!(told(juxtaposed), ("E-JUXTAPOSE-FAR", 3));
}

#[test]
fn trees_that_cannot_be_held_against_each_other() {
    let leaf = |index: u32| Node {
        position_mm: DVec3::new(f64::from(index), 1.0, 0.0),
        radius_mm: 0.0,
        parent: Some(0),
        kind: 0,
    };
    let root = Node { position_mm: DVec3::ZERO, radius_mm: 0.0, parent: None, kind: 0 };
    let star =
        Tree::new(&std::iter::once(root).chain((0..4200).map(leaf)).collect::<Vec<_>>()).expect("a tree");
    let juxtaposed = espalier_juxtapose::juxtapose(&star, &star, &Default::default());
    assert_eq!(told(juxtaposed), ("E-JUXTAPOSE-PAIRS", 5));
}

#[test]
fn places_that_single_precision_cannot_hold() {
    let affine = DAffine3::from_translation(DVec3::new(1e300, 0.0, 0.0));
    let mask = Mask::from_voxels(Grid::new([2, 2, 2], affine).expect("a grid"), &[true; 8]);
    assert_eq!(told(nifti_out::mask(&mask)), ("E-NIFTI-OUT-GRID", 3));
}
