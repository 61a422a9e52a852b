//! The figure of several layouts: what stands in it, for every tree.
#![allow(clippy::expect_used, reason = "a test that cannot go on must fail")]

mod common;

use common::{fern, flat, front, node, tube};
use espalier_model::{Embedding, Energy, Losses, MethodRow, TargetKind, Tree, ViewHierarchy};
use espalier_render::{Compass, Panel, Params, Section, SideBySide, Theme, side_by_side};
use glam::DVec2;

fn row(method: &str, crossings: usize, stress: f64) -> MethodRow {
    MethodRow {
        method: method.to_owned(),
        crossings,
        overlaps: 0,
        energy: Energy { angle: stress, ..Energy::default() },
        losses: Losses { stress, ..Losses::default() },
        evaluations: 0,
        targets: TargetKind::Intrinsic,
    }
}

fn small() -> Params {
    Params { width_px: 640, exr: false, ..Params::default() }
}

/// A figure of two layouts: one that lies as the tree does, one with two edges said to cross.
fn figure(tree: &Tree, views: &ViewHierarchy, embedding: &Embedding, params: &Params) -> SideBySide {
    let rows = [row("straight", 0, 0.25), row("folded", 1, 0.125)];
    let turned: Vec<DVec2> = embedding.positions_mm.iter().map(|p| p.perp()).collect();
    let panel = |idx: usize| Panel {
        row: &rows[idx],
        positions_mm: if idx == 0 { &embedding.positions_mm } else { &turned },
        crossings: if idx == 1 && tree.n_nodes() > 2 { vec![(1, 2)] } else { Vec::new() },
        is_chosen: idx == 0,
    };
    let panels = vec![panel(0), panel(1)];
    let section = Section { name: None, tree, view: &views.global, compass: Compass::Axes, panels };
    side_by_side(&[section], params).expect("a figure")
}

#[test]
fn every_panel_has_its_branches_its_title_and_its_notes() {
    let tree = fern(3, 4, 1.0);
    let made = figure(&tree, &front(&tree), &flat(&tree), &small());
    let document = roxmltree::Document::parse_with_options(
        &made.svg,
        roxmltree::ParsingOptions { allow_dtd: false, ..Default::default() },
    )
    .expect("XML");
    let ids: Vec<&str> = document.descendants().filter_map(|node| node.attribute("id")).collect();
    let is_branch = |panel: usize| {
        let prefix = format!("panel-{panel}-branch-");
        ids.iter().filter(|id| id.starts_with(&prefix)).count()
    };
    let n_branches = tree.branches().list().len();
    assert_eq!([0, 1, 2].map(is_branch), [n_branches; 3]);
    // A branch has one colour in all panels, and not all have the same.
    let fill = |panel: usize, branch: usize| {
        let id = format!("panel-{panel}-branch-{branch}");
        let path = document.descendants().find(|node| node.attribute("id") == Some(&id));
        path.and_then(|path| path.attribute("fill")).expect("a filled branch")
    };
    for branch in 0..n_branches {
        assert_eq!(fill(0, branch), fill(1, branch));
        assert_eq!(fill(0, branch), fill(2, branch));
    }
    assert!((1..n_branches).any(|branch| fill(0, branch) != fill(0, 0)));
    for text in ["straight  (the map)", "folded", "1 crossing", "no crossings, energy 0.25", "stress 0.125"] {
        assert!(made.svg.contains(text), "{text}");
    }
    // Bold is what is best without crossings: the stress of 0.25, not that of 0.125.
    let stress = |value: &str| {
        let text = document.descendants().find(|node| node.text().is_some_and(|t| t.contains(value)));
        text.and_then(|text| text.attribute("font-weight"))
    };
    assert_eq!((stress("stress 0.250"), stress("stress 0.125")), (Some("bold"), None));
}

#[test]
fn a_layout_for_other_targets_is_not_the_best() {
    let tree = fern(3, 3, 1.0);
    let (views, embedding) = (front(&tree), flat(&tree));
    let other = MethodRow { targets: TargetKind::IntrinsicMirrored, ..row("other", 0, 0.125) };
    let rows = [row("own", 0, 0.25), other];
    let panel = |idx: usize| Panel {
        row: &rows[idx],
        positions_mm: &embedding.positions_mm,
        crossings: Vec::new(),
        is_chosen: idx == 0,
    };
    let panels = vec![panel(0), panel(1)];
    let section = Section { name: None, tree: &tree, view: &views.global, compass: Compass::None, panels };
    let svg = side_by_side(&[section], &small()).expect("a figure").svg;
    let is_bold = |value: &str| {
        let line = svg.lines().find(|line| line.contains(value)).expect("a note");
        line.contains("font-weight=\"bold\"")
    };
    assert_eq!((is_bold("stress 0.250"), is_bold("stress 0.125")), (true, false));
}

#[test]
fn trees_of_all_shapes_have_a_figure() {
    let point = Tree::new(&[node(0.0, 0.0, 0.0, 1.0, None)]).expect("a tree");
    let thick =
        Tree::new(&[node(0.0, 0.0, 0.0, 1e4, None), node(1.0, 0.0, 0.0, 1e4, Some(0))]).expect("a tree");
    for tree in [point, tube(10.0, [1.0, 2.0]), thick] {
        let (views, embedding) = (front(&tree), flat(&tree));
        for width_px in [240, 700] {
            let params = Params { width_px, theme: Theme::Dark, ..small() };
            let made = figure(&tree, &views, &embedding, &params);
            let picture = image::load_from_memory(&made.png).expect("a PNG");
            assert_eq!(picture.width(), width_px);
        }
    }
}

#[test]
fn several_trees_are_sections_and_too_many_are_refused() {
    let tree = fern(3, 3, 1.0);
    let (views, embedding, rows) = (front(&tree), flat(&tree), [row("radial", 0, 0.5)]);
    let section = |name: &'static str| Section {
        name: Some(name),
        tree: &tree,
        view: &views.global,
        compass: Compass::None,
        panels: vec![Panel {
            row: &rows[0],
            positions_mm: &embedding.positions_mm,
            crossings: Vec::new(),
            is_chosen: true,
        }],
    };
    let made = side_by_side(&[section("first"), section("second")], &small()).expect("a figure");
    assert!(made.svg.contains(">first</text>") && made.svg.contains(">second</text>"));
    let many: Vec<Section<'_>> = (0..60).map(|_| section("one")).collect();
    let error = side_by_side(&many, &Params { width_px: 16_384, ..small() }).expect_err("too large");
    assert!(error.to_string().contains("over the limit"), "{error}");
    let short = vec![DVec2::ZERO];
    let mut wrong = section("wrong");
    wrong.panels[0].positions_mm = &short;
    assert!(side_by_side(&[wrong], &small()).is_err());
}
