//! Two trees on one map: what is drawn where.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

mod common;

use espalier_model::{Alignment, BranchChange, Embedding, Fate, Juxtaposition, Node, SharedNode, Tree};
use espalier_render::{ChangeOf, Params, SideBySide, juxtaposed};
use glam::DVec3;

fn small() -> Params {
    Params { width_px: 500, exr: false, ..Params::default() }
}

/// A Y whose left arm narrowed, whose right arm is gone, and which has a new arm in the middle.
fn sample() -> (Juxtaposition, Embedding) {
    let node =
        |x: f64, z: f64, parent| Node { position_mm: DVec3::new(x, 0.0, z), radius_mm: 2.0, parent, kind: 0 };
    let shared = Tree::new(&[
        node(0.0, 30.0, None),
        node(0.0, 0.0, Some(0)),
        node(-20.0, -20.0, Some(1)),
        node(20.0, -20.0, Some(1)),
        node(0.0, -30.0, Some(1)),
    ])
    .expect("a tree");
    let info = |fate, row, baseline: Option<f64>, followup: Option<f64>| SharedNode {
        baseline_node: None,
        followup_node: None,
        baseline_radius_mm: baseline,
        followup_radius_mm: followup,
        fate,
        row,
    };
    let nodes = vec![
        info(Fate::Matched, None, Some(2.0), Some(2.0)),
        info(Fate::Matched, Some(0), Some(2.0), Some(2.0)),
        info(Fate::Matched, Some(1), Some(2.0), Some(1.0)),
        info(Fate::Lost, Some(2), Some(2.0), None),
        info(Fate::New, Some(3), None, Some(1.0)),
    ];
    let row = |fate, length_mm, radius_mm| BranchChange {
        fate,
        baseline_branches: vec![0],
        followup_branches: vec![0],
        generation: 0,
        length_mm,
        compared_mm: 1.0,
        radius_mm,
        narrowest_percent: if fate == Fate::Matched { -50.0 } else { f64::NAN },
        narrowest_at_mm: 1.0,
        angle_deg: [f64::NAN; 2],
        heading_change_deg: 0.0,
        end_offset_mm: 0.0,
    };
    let rows = vec![
        row(Fate::Matched, [30.0, 30.0], [2.0, 2.0]),
        row(Fate::Matched, [28.0, 14.0], [2.0, 1.0]),
        row(Fate::Lost, [28.0, f64::NAN], [2.0, f64::NAN]),
        row(Fate::New, [f64::NAN, 30.0], [f64::NAN, 1.0]),
    ];
    let embedding = common::flat(&shared);
    let trees = [String::new(), String::new()];
    (Juxtaposition { trees, alignment: Alignment::IDENTITY, shared, nodes, rows }, embedding)
}

fn draw(found: &Juxtaposition, embedding: &Embedding, params: &Params) -> SideBySide {
    juxtaposed((found, embedding), ChangeOf::Radius, ["before", "after"], params).expect("a figure")
}

#[test]
fn each_panel_has_its_own_tree_and_threads_for_the_rest() {
    let (found, embedding) = sample();
    let svg = draw(&found, &embedding, &small()).svg;
    let count = |what: &str| svg.matches(what).count();
    for (panel, fate, present, expected) in [
        ("baseline", "matched", true, 2),
        ("baseline", "lost", true, 1),
        ("baseline", "new", false, 1),
        ("follow-up", "matched", true, 2),
        ("follow-up", "new", true, 1),
        ("follow-up", "lost", false, 1),
    ] {
        let lines = svg.lines().filter(|line| {
            line.starts_with(&format!("<path id=\"{panel}-"))
                && line.contains(&format!("data-fate=\"{fate}\" data-present=\"{present}\""))
        });
        assert_eq!(lines.count(), expected, "{panel} {fate}");
    }
    assert_eq!(count(">before<"), 1);
    assert!(
        count("lost: baseline only") == 1 && count("radius change (%)") == 1 && count("−60<") == 1,
        "{svg}"
    );
    assert!(svg.contains("2 matched (58 mm), 1 lost (28 mm), 1 new (30 mm)"), "{svg}");
}

#[test]
fn odd_numbers_and_sizes_draw() {
    let (mut found, embedding) = sample();
    for (width_px, radius_mm) in [(240, 1e9), (1700, 0.0), (500, 1e-9)] {
        for node in &mut found.nodes {
            node.baseline_radius_mm = node.baseline_radius_mm.map(|_| radius_mm);
        }
        let made = draw(&found, &embedding, &Params { width_px, ..small() });
        assert!(!made.svg.contains("NaN") && !made.svg.contains("inf"), "{width_px}");
    }
    for change in [ChangeOf::Radius, ChangeOf::Length] {
        let made = juxtaposed((&found, &embedding), change, ["a", "b"], &small()).expect("a figure");
        assert!(made.png.len() > 1000);
    }
    let short = Embedding { positions_mm: Vec::new(), ..embedding };
    assert!(juxtaposed((&found, &short), ChangeOf::Radius, ["a", "b"], &small()).is_err());
}

#[test]
fn the_figure_does_not_depend_on_the_number_of_threads() {
    let (found, embedding) = sample();
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| draw(&found, &embedding, &small()))
    };
    assert_eq!(by(1), by(3));
}
