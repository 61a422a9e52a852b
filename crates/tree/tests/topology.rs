//! Graph, components, loops, spurs and roots on hand-made skeletons.

mod common;

use common::{Places, inputs, tree_of};
use espalier_model::diagnose::Class;
use espalier_model::{Diagnose, InscribedSpheres, LedgerKind, Mask, Skeleton};
use espalier_tree::{Components, Error, Loops, Params, Root, Tips, build};
use glam::DVec3;

const SHAPE: [usize; 3] = [60, 60, 9];

fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A straight run of voxels, both ends included; steps along the largest difference.
fn run(from: [i64; 3], to: [i64; 3], radius: f64) -> Places {
    let n = (0..3).map(|axis| (to[axis] - from[axis]).abs()).max().unwrap_or(0);
    (0..=n)
        .map(|i| {
            let voxel = [0, 1, 2].map(|axis| {
                let share = if n == 0 { 0.0 } else { i as f64 / n as f64 };
                (from[axis] as f64 + share * (to[axis] - from[axis]) as f64).round() as u32
            });
            (voxel, radius)
        })
        .collect()
}

/// A Y in the plane z = 4: stem up the y axis, arms to both sides; radii fall outwards.
fn y_shape() -> Places {
    let mut places = run([30, 5, 4], [30, 30, 4], 3.0);
    places.extend(run([30, 30, 4], [10, 50, 4], 2.0));
    places.extend(run([30, 30, 4], [50, 50, 4], 2.0));
    places
}

#[test]
fn one_and_two_voxels_are_trees() {
    let one = tree_of(&vec![([3, 3, 3], 1.0)], SHAPE, &Params::default()).expect("a tree");
    assert_eq!((one.tree.n_nodes(), one.tree.n_tips()), (1, 0));
    assert_eq!(one.tree.position_mm(0), at(3.0, 3.0, 3.0));

    let two = tree_of(&run([3, 3, 3], [4, 3, 3], 0.0), SHAPE, &Params::default()).expect("a tree");
    assert_eq!((two.tree.n_nodes(), two.tree.n_tips()), (2, 1));
}

#[test]
fn line_ends_where_its_last_sphere_is_or_at_the_surface() {
    let places = run([5, 30, 4], [45, 30, 4], 3.0);
    let keep = Params { tips: Tips::Keep, ..Params::default() };
    let kept = tree_of(&places, SHAPE, &keep).expect("a tree").tree;
    assert_eq!(kept.n_nodes(), 2, "a straight line needs two nodes");
    assert!((kept.length_mm() - 40.0).abs() < 1e-9);

    // The ends are centres of spheres of radius 3, as far as voxels can tell.
    let whole = tree_of(&places, SHAPE, &Params::default()).expect("a tree");
    assert!((whole.tree.length_mm() - 40.0).abs() < 1.0, "{}", whole.tree.length_mm());
    let surface = Params { tips: Tips::Surface, ..Params::default() };
    let grown = tree_of(&places, SHAPE, &surface).expect("a tree");
    assert!((grown.tree.length_mm() - 46.0).abs() < 1.0, "{}", grown.tree.length_mm());
    assert_eq!(grown.ledger.n_of(LedgerKind::TipExtended), 2);
    assert_eq!(grown.report.get("tips_extended"), Some(2.0));
}

#[test]
fn tip_cut_off_by_the_scan_goes_to_its_border() {
    let tree = tree_of(&run([30, 0, 4], [30, 40, 4], 3.0), SHAPE, &Params::default()).expect("a tree").tree;
    let lowest = tree.nodes().iter().map(|node| node.position_mm.y).fold(f64::INFINITY, f64::min);
    assert!((lowest + 0.5).abs() < 0.2, "the scan ends at y = -0.5, the tree at {lowest}");
}

#[test]
fn tips_that_follow_the_surface_are_set_back() {
    // The last three voxels bend to a corner while their spheres shrink.
    let mut places = run([5, 30, 4], [45, 30, 4], 4.0);
    places.extend([([46, 31, 4], 3.0), ([47, 32, 4], 2.0), ([48, 33, 4], 1.0)]);
    let tree = tree_of(&places, SHAPE, &Params::default()).expect("a tree").tree;
    let end = tree.position_mm(tree.n_nodes() - 1);
    let start = tree.position_mm(0);
    let far = if end.x > start.x { end } else { start };
    assert!((far.x - 45.0).abs() < 1.0 && (far.y - 30.0).abs() < 0.5, "{far}");
    assert!(tree.nodes().iter().all(|node| node.radius_mm > 3.5));
}

#[test]
fn y_has_one_fork_at_the_junction() {
    let built = tree_of(&y_shape(), SHAPE, &Params::default()).expect("a tree");
    let tree = &built.tree;
    assert_eq!((tree.n_tips(), tree.branches().list().len()), (2, 3));
    let fork = (0..tree.n_nodes()).find(|&node| tree.children(node).len() == 2).expect("a fork");
    assert!(tree.position_mm(fork).distance(at(30.0, 30.0, 4.0)) < 1.0, "{}", tree.position_mm(fork));
    assert!(tree.position_mm(0).y < 6.0, "the root is the thickest tip, the foot");
    assert_eq!(built.report.get("generations"), Some(2.0));
    assert!(built.report.get("root_runner_up_y_mm").expect("a runner-up") > 45.0);
}

#[test]
fn roots_by_policy() {
    let by_point = Params { root_mm: Some([12.0, 48.0, 0.0]), ..Params::default() };
    let tree = tree_of(&y_shape(), SHAPE, &by_point).expect("a tree").tree;
    assert!(tree.position_mm(0).distance(at(10.0, 50.0, 4.0)) < 3.0, "{}", tree.position_mm(0));

    let mut leaning = run([5, 5, 1], [30, 30, 4], 2.0);
    leaning.extend(run([30, 30, 4], [50, 30, 7], 2.0));
    leaning.extend(run([30, 30, 4], [30, 55, 4], 3.0));
    let superior = Params { root: Root::Superior, ..Params::default() };
    let tree = tree_of(&leaning, SHAPE, &superior).expect("a tree").tree;
    assert!(tree.position_mm(0).distance(at(50.0, 30.0, 7.0)) < 3.0, "{}", tree.position_mm(0));
    let built = tree_of(&leaning, SHAPE, &Params::default()).expect("a tree");
    assert!(built.tree.position_mm(0).distance(at(30.0, 55.0, 4.0)) < 5.0, "{}", built.tree.position_mm(0));
    let chosen = built.ledger.0.iter().find(|e| e.kind == LedgerKind::RootChosen).expect("an entry");
    assert!((chosen.length_mm - 1.0).abs() < 1e-9, "the lead in calibre: {chosen:?}");
    assert!(chosen.reason.contains("calibre: 3.000 mm; runner-up 2.000 mm at"), "{}", chosen.reason);
    assert_eq!(built.report.get("root_lead_mm"), Some(1.0));

    // A thin apical branch that reaches higher than the trachea is not its end.
    let mut apical = run([5, 5, 1], [30, 30, 4], 3.0);
    apical.extend(run([30, 30, 4], [50, 30, 8], 1.0));
    apical.extend(run([30, 30, 4], [30, 55, 4], 2.0));
    let tree = tree_of(&apical, SHAPE, &superior).expect("a tree").tree;
    assert!(tree.position_mm(0).distance(at(30.0, 55.0, 4.0)) < 5.0, "{}", tree.position_mm(0));
}

#[test]
fn a_close_choice_of_root_is_told() {
    let warnings = |foot_radius| {
        let mut places = run([30, 5, 4], [30, 30, 4], foot_radius);
        places.extend(run([30, 30, 4], [10, 50, 4], 2.0));
        places.extend(run([30, 30, 4], [50, 50, 4], 1.5));
        tree_of(&places, SHAPE, &Params::default()).expect("a tree").report.warnings
    };
    assert_eq!(warnings(2.1)[0].code, "W-TREE-ROOT-CLOSE");
    assert_eq!(warnings(2.5), []);
}

#[test]
fn short_gaps_are_bridged() {
    // A vessel lost over three voxels; then one that begins beside the middle of another.
    let mut lost = run([5, 30, 4], [25, 30, 4], 2.0);
    lost.extend(run([29, 30, 4], [45, 30, 4], 1.0));
    let built = tree_of(&lost, SHAPE, &Params::default()).expect("a tree");
    let bridge = built.ledger.0.iter().find(|e| e.kind == LedgerKind::GapBridged).expect("a bridge");
    assert!(bridge.position_mm.distance(at(27.0, 30.0, 4.0)) < 1e-9 && bridge.length_mm == 4.0, "{bridge:?}");
    assert!(bridge.reason.contains("16.000 mm joined over a gap of 1.000 mm"), "{}", bridge.reason);
    assert_eq!((built.tree.n_tips(), built.tree.branches().list().len()), (1, 1));
    assert_eq!(built.ledger.n_of(LedgerKind::ComponentDropped), 0);

    let mut beside = run([5, 30, 4], [55, 30, 4], 2.0);
    beside.extend(run([30, 34, 4], [30, 55, 4], 1.0));
    beside.extend(run([15, 34, 4], [15, 55, 4], 1.0));
    let built = tree_of(&beside, SHAPE, &Params::default()).expect("a tree");
    assert_eq!(built.report.get("gaps_bridged"), Some(2.0));
    assert_eq!((built.tree.n_tips(), built.tree.branches().list().len()), (3, 5));

    // What has less than a tenth of the longest's length is joined over short gaps only.
    let mut small = run([5, 30, 4], [55, 30, 4], 2.0);
    small.extend(run([30, 34, 4], [30, 38, 4], 0.5));
    assert_eq!(tree_of(&small, SHAPE, &Params::default()).expect("a tree").tree.n_tips(), 2);
    let none = Params { bridge_mm: 0.5, ..Params::default() };
    assert_eq!(tree_of(&small, SHAPE, &none).expect("a tree").tree.n_tips(), 1);
    let largest = Params { components: Components::Largest, ..Params::default() };
    assert_eq!(tree_of(&beside, SHAPE, &largest).expect("a tree").tree.n_tips(), 1);
}

#[test]
fn what_is_no_vessel_is_not_bridged_to() {
    // A blob as long as it is wide, beside the tree, and a twig farther away than it is long.
    let mut places = run([5, 30, 4], [55, 30, 4], 2.0);
    places.extend(run([20, 37, 4], [22, 37, 4], 3.0));
    places.extend(run([40, 36, 4], [40, 38, 4], 0.5));
    let wide = Params { bridge_mm: 10.0, ..Params::default() };
    let built = tree_of(&places, SHAPE, &wide).expect("a tree");
    assert_eq!(built.ledger.n_of(LedgerKind::GapBridged), 0);
    assert_eq!(built.ledger.n_of(LedgerKind::ComponentDropped), 2);
}

/// Trees of their own are in the picture, over whatever gap, and the report says so; a twig far away is not, unless asked.
#[test]
fn a_forest_becomes_one_tree() {
    let mut forest = run([5, 5, 4], [55, 5, 4], 2.0);
    forest.extend(run([5, 30, 4], [45, 30, 4], 1.5));
    forest.extend(run([30, 50, 4], [50, 50, 4], 1.0));
    forest.extend(run([10, 55, 4], [14, 55, 4], 0.5));
    let has_warning = |built: &espalier_tree::Built, code: &str| {
        built.report.warnings.iter().any(|warning| warning.code == code)
    };
    let kept = tree_of(&forest, SHAPE, &Params::default()).expect("a tree");
    assert_eq!(kept.ledger.n_of(LedgerKind::GapBridged), 2);
    assert_eq!(kept.ledger.n_of(LedgerKind::ComponentDropped), 1);
    assert!(kept.tree.length_mm() > 50.0 + 40.0 + 20.0 + 40.0);
    assert!(has_warning(&kept, "W-TREE-FOREST") && !has_warning(&kept, "W-TREE-DROPPED"));

    let all = Params { components: Components::All, ..Params::default() };
    let built = tree_of(&forest, SHAPE, &all).expect("a tree");
    assert_eq!(built.ledger.n_of(LedgerKind::GapBridged), 3);
    assert_eq!(built.ledger.n_of(LedgerKind::ComponentDropped), 0);
    assert!(!has_warning(&built, "W-TREE-FOREST"), "as asked");

    let largest = Params { components: Components::Largest, ..Params::default() };
    let built = tree_of(&forest, SHAPE, &largest).expect("a tree");
    assert_eq!(built.ledger.n_of(LedgerKind::ComponentDropped), 3);
    assert!(has_warning(&built, "W-TREE-DROPPED"));
}

#[test]
fn loop_is_cut_at_its_thinnest_place() {
    // A square ring on a stem, thinnest at (40, 25).
    let mut places = run([30, 5, 4], [30, 20, 4], 2.0);
    places.extend(run([30, 20, 4], [20, 30, 4], 2.0));
    places.extend(run([20, 30, 4], [30, 40, 4], 2.0));
    places.extend(run([30, 20, 4], [40, 30, 4], 2.0));
    places.extend(run([40, 30, 4], [30, 40, 4], 2.0));
    places.extend(run([30, 40, 4], [30, 55, 4], 2.0));
    for place in &mut places {
        if place.0 == [37, 27, 4] || place.0 == [38, 28, 4] {
            place.1 = 1.0;
        }
    }
    let built = tree_of(&places, SHAPE, &Params::default()).expect("a tree");
    let cuts: Vec<_> = built.ledger.0.iter().filter(|e| e.kind == LedgerKind::LoopCut).collect();
    assert_eq!(cuts.len(), 1);
    assert!(cuts[0].position_mm.distance(at(37.5, 27.5, 4.0)) < 1e-9, "{:?}", cuts[0]);
    assert!((cuts[0].radius_mm - 1.0).abs() < 1e-9);
    // Both stubs are longer than spurs: stem, two arms that end at the cut or go on.
    assert_eq!(built.tree.n_tips(), 3);

    let refuse = Params { loops: Loops::Refuse, ..Params::default() };
    let error = tree_of(&places, SHAPE, &refuse).expect_err("a loop");
    assert!(matches!(error, Error::Loops { n_loops: 1, .. }), "{error}");
    assert_eq!(error.class(), Class::Topology);
}

#[test]
fn ring_without_any_junction_opens() {
    let mut ring = run([20, 10, 4], [30, 20, 4], 1.0);
    ring.extend(run([30, 20, 4], [20, 30, 4], 1.0));
    ring.extend(run([20, 30, 4], [10, 20, 4], 1.0));
    ring.extend(run([10, 20, 4], [20, 10, 4], 1.0));
    let built = tree_of(&ring, SHAPE, &Params::default()).expect("a tree");
    assert_eq!(built.ledger.n_of(LedgerKind::LoopCut), 1);
    assert_eq!((built.tree.n_tips(), built.tree.branches().list().len()), (1, 1));
    assert!(built.tree.length_mm() > 36.0 * std::f64::consts::SQRT_2);
}

#[test]
fn touching_voxels_are_no_loop() {
    // A 2 × 2 × 2 block in the middle of a line, and a triangle at its end.
    let mut places = run([5, 30, 4], [40, 30, 4], 1.0);
    for voxel in [[20, 31, 4], [21, 31, 4], [20, 30, 5], [21, 30, 5], [20, 31, 5], [21, 31, 5], [40, 31, 4]] {
        places.push((voxel, 1.0));
    }
    let built = tree_of(&places, SHAPE, &Params::default()).expect("a tree");
    assert_eq!(built.ledger.n_of(LedgerKind::LoopCut), 0);
    assert_eq!((built.tree.n_tips(), built.tree.branches().list().len()), (1, 1));
}

#[test]
fn spurs_go_and_teeth_stay() {
    // A thick spine; teeth of 4 voxels are spurs there (limit 1.5 × 4 mm), teeth of 12 are branches.
    let mut places = run([5, 30, 4], [55, 30, 4], 4.0);
    for (i, x) in (10..50).step_by(6).enumerate() {
        let tip = if i % 2 == 0 { 34 } else { 42 };
        places.extend(run([x, 31, 4], [x, tip, 4], 1.0));
    }
    let built = tree_of(&places, SHAPE, &Params::default()).expect("a tree");
    assert_eq!(built.ledger.n_of(LedgerKind::SpurPruned), 4);
    assert_eq!(built.tree.n_tips(), 3 + 1);
    let none = Params { prune_factor: 0.0, ..Params::default() };
    assert_eq!(tree_of(&places, SHAPE, &none).expect("a tree").tree.n_tips(), 7 + 1);
    let all = Params { prune_min_mm: 20.0, ..Params::default() };
    assert_eq!(tree_of(&places, SHAPE, &all).expect("a tree").tree.n_tips(), 1);
}

#[test]
fn pruning_looks_again_after_a_fork_dissolves() {
    // A twig of 8 voxels with a spur of 2 halfway: each half alone would be shorter than the limit of 6.
    let mut places = run([5, 30, 4], [55, 30, 4], 4.0);
    places.extend(run([30, 31, 4], [30, 39, 4], 2.5));
    places.extend(run([31, 35, 4], [32, 36, 4], 0.5));
    let built = tree_of(&places, SHAPE, &Params::default()).expect("a tree");
    assert_eq!(built.ledger.n_of(LedgerKind::SpurPruned), 1);
    assert_eq!(built.tree.n_tips(), 2);
}

#[test]
fn trunk_cut_off_by_the_border_is_no_spur() {
    let mut places = run([30, 0, 4], [30, 4, 4], 4.0);
    places.extend(run([30, 4, 4], [10, 24, 4], 2.5));
    places.extend(run([30, 4, 4], [50, 24, 4], 2.5));
    let (mask, skeleton, mut spheres) = inputs(&places, SHAPE);
    let pruned = build(&mask, &skeleton, &spheres, &Params::default()).expect("a tree");
    assert_eq!(pruned.tree.branches().list().len(), 1, "far from the border it is a spur");
    for (sphere, voxel) in spheres.0.iter_mut().zip(skeleton.voxels()) {
        sphere.is_cut = voxel[1] <= 3;
    }
    let kept = build(&mask, &skeleton, &spheres, &Params::default()).expect("a tree");
    assert_eq!(kept.tree.branches().list().len(), 3);
    assert!(kept.tree.position_mm(0).y < 1.0);
}

#[test]
fn islands_are_dropped_or_refused() {
    let mut places = y_shape();
    places.extend(run([2, 2, 1], [8, 2, 1], 5.0));
    places.push(([55, 2, 1], 1.0));
    let built = tree_of(&places, SHAPE, &Params::default()).expect("a tree");
    let dropped: Vec<_> = built.ledger.0.iter().filter(|e| e.kind == LedgerKind::ComponentDropped).collect();
    assert_eq!(dropped.len(), 2);
    assert!((dropped[0].length_mm - 6.0).abs() < 1e-9 && dropped[1].length_mm == 0.0);
    assert_eq!(built.tree.n_tips(), 2);

    let refuse = Params { components: Components::Refuse, ..Params::default() };
    let error = tree_of(&places, SHAPE, &refuse).expect_err("islands");
    assert!(matches!(error, Error::Components { n_components: 3, .. }), "{error}");
    assert_eq!(error.class(), Class::Topology);
}

#[test]
fn input_that_does_not_belong_together_is_refused() {
    let (mask, skeleton, spheres) = inputs(&y_shape(), SHAPE);
    let params = Params::default();
    let nothing = Skeleton::new(skeleton.grid().clone(), Vec::new());
    let error = build(&mask, &nothing, &InscribedSpheres::default(), &params).expect_err("empty");
    assert!(matches!(error, Error::EmptySkeleton { .. }) && error.class() == Class::Input, "{error}");

    let fewer = InscribedSpheres(spheres.0[1..].to_vec());
    let error = build(&mask, &skeleton, &fewer, &params).expect_err("one sphere short");
    assert!(matches!(error, Error::SphereCount { .. }), "{error}");

    let elsewhere = Mask::empty(inputs(&y_shape(), [61, 60, 9]).0.grid().clone());
    let error = build(&elsewhere, &skeleton, &spheres, &params).expect_err("another grid");
    assert!(matches!(error, Error::Grids { .. }), "{error}");

    for (center_mm, radius_mm) in
        [(at(f64::NAN, 0.0, 0.0), 1.0), (at(0.0, 0.0, 0.0), -1.0), (at(1e9, 0.0, 0.0), 1.0)]
    {
        let mut bad = spheres.clone();
        bad.0[7].center_mm = center_mm;
        bad.0[7].radius_mm = radius_mm;
        let error = build(&mask, &skeleton, &bad, &params).expect_err("a bad sphere");
        assert!(matches!(error, Error::BadSphere { voxel: 7, .. }), "{error}");
    }
    for (key, params) in [
        ("prune_factor", Params { prune_factor: -1.0, ..Params::default() }),
        ("smooth_voxels", Params { smooth_voxels: f64::NAN, ..Params::default() }),
        ("tolerance", Params { tolerance: 0.0, ..Params::default() }),
        ("step_mm", Params { step_mm: -0.0, ..Params::default() }),
        ("root_mm", Params { root_mm: Some([0.0, f64::NAN, 0.0]), ..Params::default() }),
    ] {
        let error = build(&mask, &skeleton, &spheres, &params).expect_err(key);
        assert!(matches!(&error, Error::Param(e) if e.key == key), "{error}");
        assert_eq!(error.class(), Class::Usage);
    }
}
