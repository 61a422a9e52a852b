//! Centrelines that run side by side in one vessel: daughters in a wide parent, twins and stubs in a lumen.
#![allow(clippy::expect_used, reason = "helpers of tests only")]

mod common;

use common::{Places, inputs, tree_of};
use espalier_model::{LedgerKind, Tree};
use espalier_tree::{Built, Params, build};
use glam::DVec3;

/// A chain of straight runs of voxels of one radius.
fn chain(corners: &[[i64; 3]], radius: f64) -> Places {
    let mut places = Places::new();
    for pair in corners.windows(2) {
        let n = (0..3).map(|axis| (pair[1][axis] - pair[0][axis]).abs()).max().unwrap_or(0);
        places.extend((0..=n).map(|i| {
            let share = i as f64 / n.max(1) as f64;
            let along = |axis: usize| pair[0][axis] as f64 + share * (pair[1][axis] - pair[0][axis]) as f64;
            ([0, 1, 2].map(|axis| along(axis).round() as u32), radius)
        }));
    }
    places
}

fn built(places: &Places, shape: [usize; 3]) -> Built {
    tree_of(places, shape, &Params::default()).expect("a tree")
}

fn fork_of(tree: &Tree) -> usize {
    (0..tree.n_nodes()).find(|&node| tree.children(node).len() > 1).expect("a fork")
}

/// The polylines that leave a fork, its parent's among them.
fn arms(tree: &Tree, fork: usize) -> Vec<Vec<DVec3>> {
    let place = |node: usize| tree.position_mm(node);
    tree.branches()
        .list()
        .iter()
        .filter_map(|branch| {
            let mut polyline: Vec<DVec3> = branch.polyline().map(place).collect();
            if branch.end() == fork {
                polyline.reverse();
            }
            (branch.end() == fork || branch.hub == fork).then_some(polyline)
        })
        .collect()
}

/// A trunk of radius 8 along y whose daughters of radius 4 part at 30°; their axes meet at y = 47, but leave the
/// trunk's axis as the skeleton does, at y = 60 and with a step of voxels in z just before.
fn iliacs() -> Places {
    let mut places = chain(&[[40, 5, 12], [40, 57, 12], [40, 60, 14]], 8.0);
    for side in [-1, 1] {
        places.extend(chain(&[[40, 60, 14], [40 + side * 5, 66, 12], [40 + side * 16, 107, 12]], 4.0));
    }
    places
}

#[test]
fn fork_of_a_wide_parent_moves_by_no_more_than_its_radius() {
    let tree = built(&iliacs(), [80, 115, 25]).tree;
    let fork = fork_of(&tree);
    let y = tree.position_mm(fork).y;
    assert!((51.5..=61.0).contains(&y), "the fork is at y = {y}");
}

/// Two forks 6 mm apart in spheres of radius 4, and between them a staircase of voxels.
fn linked_forks() -> Places {
    let mut places = chain(&[[40, 10, 12], [40, 50, 12], [40, 53, 15], [40, 56, 12]], 4.0);
    places.extend(chain(&[[40, 50, 12], [70, 80, 12]], 4.0));
    places.extend(chain(&[[40, 56, 12], [14, 82, 12]], 4.0));
    places.extend(chain(&[[40, 56, 12], [40, 100, 12]], 4.0));
    places
}

#[test]
fn no_short_edge_at_a_fork_is_kinked() {
    for (places, n_forks) in [(iliacs(), 1), (linked_forks(), 2)] {
        let tree = built(&places, [80, 115, 25]).tree;
        let forks: Vec<usize> = (0..tree.n_nodes()).filter(|&node| tree.children(node).len() > 1).collect();
        assert_eq!(forks.len(), n_forks);
        for (fork, arm) in
            forks.iter().flat_map(|&fork| arms(&tree, fork).into_iter().map(move |a| (fork, a)))
        {
            // A straight branch has no turn, however short it is.
            let [from, through, to, ..] = arm[..] else { continue };
            let (length_mm, radius_mm) = (from.distance(through), tree.nodes()[fork].radius_mm);
            assert!(length_mm >= 0.9 * radius_mm, "first edge of {length_mm} mm, radius {radius_mm} mm");
            let turn = (through - from).angle_between(to - through).to_degrees();
            assert!(turn < 20.0, "a turn of {turn}° after {length_mm} mm");
        }
    }
}

#[test]
fn long_stub_in_the_lumen_of_its_trunk_goes_and_one_beside_it_stays() {
    let trunk = chain(&[[30, 6, 9], [30, 62, 9]], 6.0);
    for (offset, n_branches) in [(4, 1), (11, 3)] {
        let mut places = trunk.clone();
        places.extend(chain(&[[30, 48, 9], [30 - offset, 48 - offset, 9], [30 - offset, 12, 9]], 4.0));
        let built = built(&places, [60, 70, 19]);
        assert_eq!(built.tree.branches().list().len(), n_branches, "at a distance of {offset} mm");
        let pruned: Vec<_> = built.ledger.0.iter().filter(|e| e.kind == LedgerKind::SpurPruned).collect();
        assert_eq!(pruned.len(), usize::from(n_branches == 1), "{pruned:?}");
        assert!(pruned.iter().all(|e| e.reason.contains("in the lumen of others") && e.length_mm > 30.0));
    }
}

/// Two lines of radius 5 along y, `apart` voxels from each other, one a stub that leaves the other near its end. The mask is
/// the spheres, and what `is_filled` or `is_cleared` says of the voxels (x from the first line on, y).
fn two_lines(
    apart: i64,
    is_filled: impl Fn(i64, i64) -> bool,
    is_cleared: impl Fn(i64, i64) -> bool,
) -> Built {
    let mut places = chain(&[[20, 6, 9], [20, 80, 9]], 5.0);
    places.extend(chain(&[[20, 70, 9], [20 + apart, 70 - apart, 9], [20 + apart, 8, 9]], 5.0));
    let shape = [60, 90, 19];
    let (mut mask, skeleton, spheres) = inputs(&places, shape);
    for [x, y, z] in (0..60 * 90 * 19).map(|i| [i % 60, i / 60 % 90, i / 5400]) {
        let (across, along) = (x as i64 - 20, y as i64);
        if is_filled(across, along) && (z as i64 - 9).abs() <= 5 {
            mask.bits_mut().set([x, y, z]);
        }
        if is_cleared(across, along) {
            mask.bits_mut().clear([x, y, z]);
        }
    }
    build(&mask, &skeleton, &spheres, &Params::default()).expect("a tree")
}

#[test]
fn a_line_beside_another_in_a_flat_lumen_goes() {
    // More than both radii apart, so that neither is in the other's spheres.
    let is_between = |across: i64, along: i64| (-5..=17).contains(&across) && (2..=85).contains(&along);
    let built = two_lines(12, is_between, |_, _| false);
    assert_eq!(built.tree.branches().list().len(), 1);
    let pruned = built.ledger.0.iter().find(|entry| entry.kind == LedgerKind::SpurPruned).expect("the stub");
    assert!(pruned.reason.contains("beside them with no wall between"), "{}", pruned.reason);
}

#[test]
fn vessels_side_by_side_stay_where_a_wall_or_a_waist_parts_them() {
    let is_between = |across: i64, along: i64| (-5..=17).contains(&across) && (2..=85).contains(&along);
    // A wall of one voxel, below the place where they part.
    let walled = two_lines(12, is_between, |across, along| across == 6 && along < 56);
    assert_eq!(walled.tree.branches().list().len(), 3, "a wall");
    // Two round tubes that touch: between them the body is as wide as they overlap.
    let waist = two_lines(8, |_, _| false, |_, _| false);
    assert_eq!(waist.tree.branches().list().len(), 3, "a waist");
}

#[test]
fn no_branch_is_redundant_where_pruning_is_off() {
    let mut places = chain(&[[30, 6, 9], [30, 62, 9]], 6.0);
    places.extend(chain(&[[30, 48, 9], [26, 44, 9], [26, 12, 9]], 4.0));
    let params = Params { prune_factor: 0.0, ..Params::default() };
    let tree = tree_of(&places, [60, 70, 19], &params).expect("a tree").tree;
    assert_eq!(tree.branches().list().len(), 3);
}

#[test]
fn twin_of_the_root_goes_though_the_scan_cuts_it_off() {
    let mut places = chain(&[[30, 0, 9], [30, 62, 9]], 6.0);
    places.extend(chain(&[[34, 0, 9], [34, 10, 9], [30, 14, 9]], 6.0));
    let built = built(&places, [60, 70, 19]);
    assert_eq!((built.tree.branches().list().len(), built.tree.n_tips()), (1, 1));
    assert_eq!(built.ledger.n_of(LedgerKind::SpurPruned), 1);

    // So it does where thinning ended before both, inside of the sphere of their fork.
    let mut places = chain(&[[27, 5, 9], [30, 12, 9], [30, 62, 9]], 8.0);
    places.extend(chain(&[[33, 5, 9], [30, 12, 9]], 8.0));
    assert_eq!(self::built(&places, [60, 70, 19]).tree.branches().list().len(), 1);

    // Two vessels that the scan cuts off side by side are both there.
    let mut places = chain(&[[20, 0, 9], [20, 10, 9], [30, 20, 9], [30, 62, 9]], 6.0);
    places.extend(chain(&[[40, 0, 9], [40, 10, 9], [30, 20, 9]], 6.0));
    assert_eq!(self::built(&places, [60, 70, 19]).tree.branches().list().len(), 3);
}
