//! Manual edits: what they do, what they leave alone, and what they refuse.

#![allow(clippy::expect_used, reason = "a test that cannot go on says why")]

mod common;

use common::{random_tree, stream, tree_of, views_along};
use espalier_embed::{Embedded, Error, Method, Params, PsoParams, certify, embed, embed_edited};
use espalier_geom::angle::{heading, wrap};
use espalier_model::diagnose::{Class, Diagnose};
use espalier_model::{Edit, Edits, Embedding, Termination, Tree};
use glam::DVec3;

fn small() -> Params {
    let pso = PsoParams { particles: 24, iterations: 8, ..PsoParams::default() };
    Params { pso, methods: vec![Method::Pso], ..Params::default() }
}

fn base(tree: &Tree) -> Embedding {
    embed(tree, &views_along(tree, DVec3::Z), &small(), 7, &|_| {}).expect("a layout").embedding
}

fn edited(tree: &Tree, list: &[Edit]) -> Result<Embedded, Error> {
    let edits = Edits::new(tree, list.to_vec()).expect("edits");
    embed_edited((tree, &views_along(tree, DVec3::Z)), &edits, &small(), 7, &|_| {})
}

/// The turn of a node's edge against its parent's, as the picture shows it; that of the root's children against 0.
fn turn_rad(tree: &Tree, embedding: &Embedding, node: usize) -> f64 {
    let at = |node: usize| embedding.positions_mm[node];
    let parent = tree.parent(node).expect("not the root");
    let back = tree.parent(parent).map_or(0.0, |above| heading(at(parent) - at(above)));
    wrap(heading(at(node) - at(parent)) - back)
}

/// Whether every pinned turn is as it was, the first of them turned by the edit, and the length of the branch kept.
#[track_caller]
fn assert_kept(tree: &Tree, before: &Embedding, after: &Embedding, edit: &Edit) {
    let nodes = tree.branches().list()[edit.branch].nodes.clone();
    let joint = if nodes.contains(&edit.node) { edit.node + 1 } else { nodes.start };
    for node in joint..nodes.end {
        let asked = if node == joint { edit.angle_deg.to_radians() } else { 0.0 };
        let off = wrap(turn_rad(tree, after, node) - turn_rad(tree, before, node) - asked);
        assert!(off.abs() < 1e-9, "the turn of node {node} is off by {off}");
    }
    for node in nodes {
        let length = |embedding: &Embedding| {
            let parent = tree.parent(node).expect("not the root");
            embedding.positions_mm[node].distance(embedding.positions_mm[parent])
        };
        assert!(
            (length(before) - length(after)).abs() < 1e-9 * tree.length_mm(),
            "the length of node {node}"
        );
    }
}

/// A stem that forks into two long branches of three edges, which lie 40° apart.
fn fork() -> Tree {
    tree_of(&[
        (0.0, 0.0, 0.0, None),
        (0.0, 10.0, 0.0, Some(0)),
        (-3.0, 18.0, 0.0, Some(1)),
        (-7.0, 26.0, 0.0, Some(2)),
        (-12.0, 34.0, 0.0, Some(3)),
        (3.0, 18.0, 0.0, Some(1)),
        (7.0, 26.0, 0.0, Some(5)),
        (12.0, 34.0, 0.0, Some(6)),
    ])
}

#[test]
fn an_edit_without_crossings_moves_what_it_turns_and_nothing_else() {
    let tree = fork();
    let before = base(&tree);
    assert_eq!(before.termination, Termination::Optimal);
    // The right branch, outwards: clockwise.
    for (node, first_moved) in [(1, 5), (5, 6), (6, 7)] {
        let edit = Edit { branch: 2, node, angle_deg: -25.0 };
        let after = edited(&tree, &[edit]).expect("a layout").embedding;
        let record = after.edits[0];
        assert_eq!((record.crossings_introduced, record.crossings_removed), (0, 0));
        assert!((record.angle_reached_deg + 25.0).abs() < 1e-9, "{record:?}");
        assert_eq!(record.energy_before, before.energy.total());
        assert!(record.energy_after > record.energy_before);
        assert_eq!(record.energy_after, after.energy.total());
        assert_kept(&tree, &before, &after, &edit);
        let turn = glam::DVec2::from_angle(-25.0_f64.to_radians());
        for moved in 0..tree.n_nodes() {
            let (was, pivot) = (before.positions_mm[moved], before.positions_mm[node]);
            let expected = if moved >= first_moved { pivot + turn.rotate(was - pivot) } else { was };
            assert!(after.positions_mm[moved].distance(expected) < 1e-9, "edit about {node}: node {moved}");
        }
        assert_eq!(after.termination, Termination::Converged);
        let row = after.methods.last().expect("a row");
        assert_eq!((&row.method, row.energy), (&after.method, after.energy));
        assert!(after.method.ends_with(", edited"), "{}", after.method);
    }
}

#[test]
fn an_edit_that_crosses_is_freed_and_keeps_its_turn() {
    let tree = fork();
    let before = base(&tree);
    // The right branch turns to the left, through the left one.
    let edit = Edit { branch: 2, node: 5, angle_deg: 80.0 };
    let after = edited(&tree, &[edit]).expect("a layout").embedding;
    let record = after.edits[0];
    assert!(record.crossings_introduced > 0, "{record:?}");
    assert_eq!(record.crossings_removed, record.crossings_introduced);
    assert!(after.certificate.holds() && certify(&tree, &after.positions_mm).holds());
    assert_kept(&tree, &before, &after, &edit);
    // The pinned turn is on the other side of its target, and is scored as such.
    assert!(after.angle_ratio[6] > 1.0, "{:?}", after.angle_ratio);
}

#[test]
fn a_turn_of_nothing_pins() {
    let tree = random_tree(1, 31, 1.0, false, 4);
    let before = base(&tree);
    let edit = Edit { branch: 3, node: tree.branches().list()[3].hub, angle_deg: 0.0 };
    let after = edited(&tree, &[edit]).expect("a layout").embedding;
    assert_kept(&tree, &before, &after, &edit);
    assert!(after.energy.total() <= before.energy.total() * (1.0 + 1e-9));
}

#[test]
fn edits_of_random_trees() {
    let (mut n_crossing, mut n_conflicts) = (0, 0);
    for key in 0..40 {
        let tree = random_tree(key as usize % 8, 10 + key as usize / 2, 1.0, false, key);
        let before = base(&tree);
        let mut stream = stream(key);
        let branches = tree.branches();
        let branch = stream.below(branches.list().len() as u32) as usize;
        let way: Vec<usize> = branches.list()[branch].polyline().collect();
        let node = way[stream.below(way.len() as u32 - 1) as usize];
        let edit = Edit { branch, node, angle_deg: stream.uniform(-120.0, 120.0) };
        match edited(&tree, &[edit]) {
            Ok(embedded) => {
                let after = embedded.embedding;
                assert!(certify(&tree, &after.positions_mm).holds());
                assert_kept(&tree, &before, &after, &edit);
                assert_eq!(after.pose, before.pose);
                n_crossing += usize::from(after.edits[0].crossings_introduced > 0);
            }
            Err(Error::Edits { holding, .. }) => {
                assert_eq!(holding, [0], "tree {key}");
                n_conflicts += 1;
            }
            Err(error) => panic!("tree {key}: {error}"),
        }
    }
    assert!(n_crossing > 5, "{n_crossing}");
    assert!(n_conflicts <= 3, "{n_conflicts}");
}

#[test]
fn counter_clockwise_is_that_of_the_picture() {
    let radial = Params { method: Method::Radial, methods: Vec::new(), ..Params::default() };
    let mut n_reflected = 0;
    for key in 0..16 {
        let tree = random_tree(0, 20, 1.0, false, key);
        let views = views_along(&tree, DVec3::Z);
        let before = embed(&tree, &views, &radial, 0, &|_| {}).expect("a layout").embedding;
        let branch = tree.branches().list().len() - 1;
        let edit = Edit { branch, node: tree.branches().list()[branch].hub, angle_deg: 12.0 };
        let edits = Edits::new(&tree, vec![edit]).expect("edits");
        let after = embed_edited((&tree, &views), &edits, &radial, 0, &|_| {}).expect("a layout").embedding;
        assert_eq!(after.pose, before.pose);
        assert_kept(&tree, &before, &after, &edit);
        assert!((after.edits[0].angle_reached_deg - 12.0).abs() < 1e-7);
        n_reflected += usize::from(after.pose.is_reflected);
    }
    assert!(n_reflected > 2, "{n_reflected}");
}

#[test]
fn later_edits_follow_on_earlier_ones() {
    let tree = fork();
    let first = Edit { branch: 2, node: 5, angle_deg: 80.0 };
    let second = Edit { branch: 1, node: 1, angle_deg: 30.0 };
    let again = Edit { branch: 2, node: 5, angle_deg: -50.0 };
    let one = edited(&tree, &[first]).expect("a layout").embedding;
    let two = edited(&tree, &[first, second]).expect("a layout").embedding;
    for energy in [two.edits[0].energy_after, two.edits[1].energy_before] {
        assert!((energy - one.energy.total()).abs() < 1e-9, "{energy}");
    }
    assert_kept(&tree, &one, &two, &second);
    // What the first edit has pinned, the second leaves.
    assert_kept(&tree, &one, &two, &Edit { angle_deg: 0.0, ..first });

    let three = edited(&tree, &[first, second, again]).expect("a layout").embedding;
    let reached: Vec<f64> = three.edits.iter().map(|record| record.angle_reached_deg).collect();
    for (reached, asked) in reached.iter().zip([80.0, 30.0, -50.0]) {
        assert!((reached - asked).abs() < 1e-7, "{reached}");
    }
    assert_kept(&tree, &base(&tree), &three, &Edit { angle_deg: 30.0, ..first });
}

#[test]
fn the_same_bytes_again() {
    let tree = random_tree(0, 60, 1.0, false, 11);
    let edits: Vec<Edit> = [(2, 40.0), (5, -70.0)]
        .map(|(branch, angle_deg)| Edit { branch, node: tree.branches().list()[branch].hub, angle_deg })
        .into();
    let with_threads = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("a pool");
        pool.install(|| edited(&tree, &edits).expect("a layout").embedding.to_json())
    };
    let once = with_threads(1);
    assert_eq!(once, with_threads(1));
    assert_eq!(once, with_threads(3));
    // No edits: the run without them.
    assert_eq!(edited(&tree, &[]).expect("a layout").embedding.to_json(), base(&tree).to_json());
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let tree = fork();
    // Back onto the stem: nothing lies between the stem and the edge that could move.
    let folded = |before: &Embedding| 180.0 - turn_rad(&tree, before, 5).to_degrees();
    let edit = Edit { branch: 2, node: 1, angle_deg: folded(&base(&tree)) };
    let harmless = Edit { branch: 1, node: 2, angle_deg: 5.0 };
    let error = edited(&tree, &[harmless, edit]).expect_err("refused");
    assert!(matches!(&error, Error::Edits { holding, can_move: false, .. } if *holding == [1]), "{error:?}");
    assert_eq!(error.class(), Class::Uncertified);
    let message = error.to_string();
    assert!(
        message.starts_with("with edits[1] pinned ") && message.contains("nothing that is free"),
        "{message}"
    );

    let other = random_tree(0, 9, 1.0, false, 1);
    let edits = Edits::new(&tree, vec![harmless]).expect("edits");
    let error = embed_edited((&other, &views_along(&other, DVec3::Z)), &edits, &small(), 0, &|_| {});
    assert_eq!(error.expect_err("refused"), Error::EditsOfOtherTree);
}

#[test]
fn a_fold_that_nobody_could_see_is_refused() {
    // The last edge is shorter than the one before it: folded back it meets nothing else.
    let tree = tree_of(&[
        (0.0, 0.0, 0.0, None),
        (0.0, 10.0, 0.0, Some(0)),
        (-3.0, 18.0, 0.0, Some(1)),
        (3.0, 18.0, 0.0, Some(1)),
        (7.0, 26.0, 0.0, Some(3)),
        (9.0, 29.0, 0.0, Some(4)),
    ]);
    let before = base(&tree);
    let straight = 180.0 - turn_rad(&tree, &before, 5).to_degrees();
    let refused = |short_of_it_deg: f64| {
        let edit = Edit { branch: 2, node: 4, angle_deg: wrap_deg(straight - short_of_it_deg) };
        edited(&tree, &[edit]).err()
    };
    // Exactly back onto itself the edges meet; within rounding of that they would not.
    assert!(refused(0.0).is_some());
    let fold = refused(1e-3).expect("a fold");
    assert!(matches!(fold, Error::Fold { edit: 0, branch: 2, .. }), "{fold}");
    assert_eq!((fold.code(), fold.class()), ("E-EMBED-EDIT-FOLD", Class::Input));
    assert!(!matches!(refused(0.5), Some(Error::Fold { .. })));
}

fn wrap_deg(angle_deg: f64) -> f64 {
    wrap(angle_deg.to_radians()).to_degrees()
}

#[test]
fn trees_with_little_to_edit() {
    let edge = tree_of(&[(0.0, 0.0, 0.0, None), (1.0, 2.0, 3.0, Some(0))]);
    let edit = Edit { branch: 0, node: 0, angle_deg: 90.0 };
    assert_eq!(edited(&edge, &[edit]).expect("a layout").embedding.edits.len(), 1);
    let star = random_tree(3, 300, 1.0, false, 2);
    let after = edited(&star, &[edit]).expect("a layout").embedding;
    assert!(after.certificate.holds());
    assert_kept(&star, &base(&star), &after, &edit);
}

#[test]
fn large_and_odd_trees() {
    // A comb of a thousand teeth, and a chain; an edit near the root moves nearly all of it.
    let solver = Params { methods: Vec::new(), ..Params::default() };
    for family in [2, 5] {
        let tree = random_tree(family, 2000, 0.0, false, 3);
        let edits = Edits::new(&tree, vec![Edit { branch: 0, node: 0, angle_deg: 20.0 }]).expect("edits");
        let views = views_along(&tree, DVec3::Z);
        let quick = Params {
            solver: espalier_embed::SolverParams { mirrors: false, effort: 0.02, ..solver.solver.clone() },
            ..solver.clone()
        };
        match embed_edited((&tree, &views), &edits, &quick, 0, &|_| {}) {
            Ok(embedded) => assert!(embedded.embedding.certificate.holds()),
            Err(error) => assert!(matches!(error, Error::Edits { .. }), "{error}"),
        }
    }
}
