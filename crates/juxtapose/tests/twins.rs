//! Known answers: a phantom and its diseased twin.
#![allow(clippy::expect_used, clippy::panic, reason = "a test says what it expects")]

use espalier_juxtapose::{Align, Params, juxtapose};
use espalier_model::{BranchChange, Fate, Juxtaposition, Node, Tree};
use espalier_phantom::{Disease, Growth, Kind, grow_tree, twin};
use glam::{DMat3, DVec3};

fn airway(generations: u32) -> Tree {
    let params = espalier_phantom::Params { generations, ..espalier_phantom::Params::default() };
    grow_tree(Kind::Airway, &params, 7).expect("an airway")
}

fn neuron(n_nodes: usize) -> Tree {
    let params = espalier_phantom::Params { n_nodes, ..espalier_phantom::Params::default() };
    grow_tree(Kind::Neuron, &params, 3).expect("a neuron")
}

fn compared(baseline: &Tree, followup: &Tree) -> Juxtaposition {
    let found = juxtapose(baseline, followup, &Params::default()).expect("a comparison").juxtaposition;
    check_invariants(&found, baseline, followup);
    found
}

/// What holds for any two trees.
fn check_invariants(found: &Juxtaposition, baseline: &Tree, followup: &Tree) {
    assert_eq!(found.nodes.len(), found.shared.n_nodes());
    let mut seen = vec![0; baseline.n_nodes()];
    for (node, info) in found.nodes.iter().enumerate() {
        assert_eq!(info.row.is_none(), node == 0, "only the root has no row");
        if let Some(own) = info.baseline_node {
            seen[own] += 1;
            assert_eq!(found.shared.position_mm(node), baseline.position_mm(own));
        }
        match info.fate {
            Fate::Matched => assert!(info.baseline_radius_mm.is_some()),
            Fate::Lost => {
                assert!(info.baseline_radius_mm.is_some() && info.followup_radius_mm.is_none() || node == 0);
            }
            Fate::New => assert!(info.baseline_radius_mm.is_none() && info.followup_radius_mm.is_some()),
        }
    }
    assert!(seen.iter().all(|&n| n == 1), "every node of the baseline is there once");
    // Every branch of either tree is in one row.
    for (tree, of) in [
        (baseline, (|row| &row.baseline_branches) as fn(&BranchChange) -> &Vec<usize>),
        (followup, |row| &row.followup_branches),
    ] {
        let mut branches: Vec<usize> = found.rows.iter().flat_map(|row| of(row).clone()).collect();
        branches.sort_unstable();
        assert!(branches.into_iter().eq(0..tree.branches().list().len()));
    }
}

fn turned() -> (DMat3, DVec3) {
    (DMat3::from_axis_angle(DVec3::new(0.3, -1.0, 0.5).normalize(), 2.1), DVec3::new(140.0, -33.0, 820.0))
}

/// Branches with nothing behind them, by falling length.
fn tips(tree: &Tree) -> Vec<usize> {
    let branches = tree.branches();
    let mut tips: Vec<usize> = (0..branches.list().len())
        .filter(|&branch| tree.children(branches.list()[branch].end()).is_empty())
        .collect();
    tips.sort_by(|&a, &b| branches.length_mm(tree, b).total_cmp(&branches.length_mm(tree, a)));
    tips
}

#[test]
fn a_tree_is_itself() {
    for tree in [airway(4), airway(6), neuron(235)] {
        for moved in [(DMat3::IDENTITY, DVec3::ZERO), turned()] {
            let followup = twin(&tree, &Disease { moved, ..Disease::default() }, 0).expect("a twin");
            let found = compared(&tree, &followup);
            assert!(found.rows.iter().all(|row| row.fate == Fate::Matched), "{} rows", found.rows.len());
            for row in &found.rows {
                assert_eq!(row.baseline_branches, row.followup_branches);
                for change in [
                    row.length_change_percent(),
                    row.radius_change_percent(),
                    row.narrowest_percent,
                    row.heading_change_deg,
                    row.end_offset_mm,
                ] {
                    assert!(change.abs() < 1e-4, "{row:?}");
                }
            }
            assert_eq!(found.shared, tree, "the shared tree is the baseline");
            assert!(found.alignment.residual_max_mm < 1e-4);
            assert!(!found.to_json().contains("\"length_mm\":-"), "nothing lost is 0 mm, not -0");
        }
    }
}

#[test]
fn what_happened_is_told() {
    let tree = airway(6);
    let branches = tree.branches();
    let list = branches.list();
    let tips = tips(&tree);
    let inner = (0..list.len()).find(|&b| list[b].generation == 3 && list[b].strahler > 1).expect("inner");
    let lost = [tips[2], inner];
    let is_lost = |branch: usize| {
        let start = list[branch].nodes.start;
        lost.iter().any(|&gone| tree.subtree(list[gone].nodes.start).contains(&start))
    };
    let narrowed: Vec<usize> =
        (1..list.len()).filter(|&b| !is_lost(b) && branches.length_mm(&tree, b) > 10.0).step_by(5).collect();
    let stem =
        (0..list.len()).rev().find(|&b| !is_lost(b) && branches.length_mm(&tree, b) > 20.0).expect("a stem");
    let disease = Disease {
        lost: lost.to_vec(),
        narrowed: narrowed.iter().map(|&branch| (branch, 0.5)).collect(),
        grown: vec![Growth {
            branch: stem,
            share: 0.5,
            direction: DVec3::new(0.2, 1.0, 0.1),
            length_mm: 18.0,
        }],
        jitter_mm: 0.05,
        moved: turned(),
    };
    let found = compared(&tree, &twin(&tree, &disease, 9).expect("a twin"));
    for row in &found.rows {
        let name = format!("{row:?}");
        let gone = row.baseline_branches.iter().filter(|&&branch| is_lost(branch)).count();
        match row.fate {
            Fate::Lost => assert_eq!(gone, 1, "{name}"),
            Fate::New => assert!((row.length_mm[1] - 18.0).abs() < 0.5, "{name}"),
            Fate::Matched => {
                assert_eq!(gone, 0, "{name}");
                assert!(row.length_change_percent().abs() < 3.0, "{name}");
                let is_narrowed = row.baseline_branches.iter().any(|branch| narrowed.contains(branch));
                assert_eq!(row.radius_change_percent() < -10.0, is_narrowed, "{name}");
                if is_narrowed {
                    assert!(row.narrowest_percent < -35.0, "{name}");
                }
            }
        }
    }
    assert_eq!(found.of_fate(Fate::New).count(), 1);
    let n_lost = (0..list.len()).filter(|&branch| is_lost(branch)).count();
    assert_eq!(found.of_fate(Fate::Lost).count(), n_lost);
    // Where a branch lost its sister, two of the baseline are one of the follow-up; where one grew, it is the other way.
    assert!(found.rows.iter().any(|row| row.baseline_branches.len() == 2));
    assert!(found.rows.iter().any(|row| row.followup_branches.len() == 2 && row.baseline_branches == [stem]));
    assert!(found.alignment.residual_max_mm < 0.2, "{:?}", found.alignment);
}

#[test]
fn lost_and_new_change_places_when_the_trees_do() {
    let tree = airway(6);
    let tips = tips(&tree);
    let disease = Disease { lost: tips[1..6].to_vec(), moved: turned(), ..Disease::default() };
    let followup = twin(&tree, &disease, 1).expect("a twin");
    let (there, back) = (compared(&tree, &followup), compared(&followup, &tree));
    let branches = |found: &Juxtaposition, fate: Fate, tree: usize| {
        let mut list: Vec<Vec<usize>> = found
            .of_fate(fate)
            .map(|row| [&row.baseline_branches, &row.followup_branches][tree].clone())
            .collect();
        list.sort();
        list
    };
    assert_eq!(there.of_fate(Fate::Lost).count(), 5);
    for (fate, other) in [(Fate::Lost, Fate::New), (Fate::New, Fate::Lost), (Fate::Matched, Fate::Matched)] {
        for tree in [0, 1] {
            assert_eq!(branches(&there, fate, tree), branches(&back, other, 1 - tree), "{fate:?}");
        }
    }
    assert!((there.alignment.angle_deg() - back.alignment.angle_deg()).abs() < 1e-3);
}

#[test]
fn a_comb_that_lost_its_teeth_still_matches() {
    let params = espalier_phantom::Params { n_teeth: 40, ..espalier_phantom::Params::default() };
    let comb = grow_tree(Kind::Comb, &params, 0).expect("a comb");
    let branches = comb.branches();
    let is_tooth = |b: &usize| comb.children(branches.list()[*b].end()).is_empty();
    let teeth: Vec<usize> = (0..branches.list().len()).filter(is_tooth).collect();
    let lost: Vec<usize> = teeth[..teeth.len() - 2].iter().copied().filter(|b| b % 3 > 0).collect();
    let found = compared(
        &comb,
        &twin(&comb, &Disease { lost: lost.clone(), ..Disease::default() }, 0).expect("a twin"),
    );
    let mut gone: Vec<usize> =
        found.of_fate(Fate::Lost).flat_map(|row| row.baseline_branches.clone()).collect();
    gone.sort_unstable();
    assert_eq!(gone, lost);
    assert_eq!(found.of_fate(Fate::New).count(), 0);
}

#[test]
fn an_organ_that_bends_is_compared_fork_by_fork() {
    let tree = airway(6);
    // The lower it lies, the more it is drawn aside: up to 25 mm at the bases, more than most branches are long.
    let bent: Vec<Node> = tree
        .nodes()
        .iter()
        .map(|node| {
            let depth = (-node.position_mm.z).max(0.0) / 130.0;
            let position_mm = node.position_mm + 25.0 * depth * depth * DVec3::new(0.4, -0.8, 0.45);
            Node { position_mm, ..*node }
        })
        .collect();
    let followup = Tree::new(&bent).expect("a tree");
    let found = compared(&tree, &followup);
    let wrong = found.rows.iter().filter(|row| row.baseline_branches != row.followup_branches).count();
    assert_eq!(wrong, 0, "of {}", found.rows.len());
    assert!(found.alignment.residual_max_mm > 3.0, "{:?}", found.alignment);
}

#[test]
fn tips_end_earlier_or_later_and_roots_too() {
    let node =
        |x: f64, z: f64, parent| Node { position_mm: DVec3::new(x, 0.0, z), radius_mm: 1.0, parent, kind: 0 };
    let y = |top: f64, left: f64, right: f64| {
        Tree::new(&[
            node(0.0, top, None),
            node(0.0, 0.0, Some(0)),
            node(-0.6 * left, -0.8 * left, Some(1)),
            node(0.6 * right, -0.8 * right, Some(1)),
        ])
        .expect("a tree")
    };
    let found = compared(&y(30.0, 20.0, 20.0), &y(22.0, 12.0, 27.0));
    assert!(found.rows.iter().all(|row| row.fate == Fate::Matched));
    let compared_mm: Vec<f64> = found.rows.iter().map(|row| row.compared_mm).collect();
    for (compared_mm, expected) in compared_mm.into_iter().zip([22.0, 12.0, 20.0]) {
        assert!((compared_mm - expected).abs() < 1e-6, "{compared_mm} {expected}");
    }
    let length = |fate| {
        let nodes = (1..found.nodes.len()).filter(|&node| found.nodes[node].fate == fate);
        nodes.map(|node| found.shared.edge_length_mm(node)).sum::<f64>()
    };
    assert!((length(Fate::Lost) - 8.0).abs() < 1e-6, "what the left tip lost");
    assert!((length(Fate::New) - 7.0).abs() < 1e-6, "what the right tip gained");
    assert!(found.nodes[0].followup_radius_mm.is_none(), "the follow-up begins 8 mm further on");
    // A follow-up that sees more of the trunk shares the baseline's root.
    let longer = compared(&y(22.0, 12.0, 12.0), &y(30.0, 12.0, 12.0));
    assert!((longer.rows[0].compared_mm - 22.0).abs() < 1e-6 && longer.nodes.len() == 4);
}

#[test]
fn an_animal_that_grew_is_scaled_if_asked() {
    let tree = airway(4);
    let grown: Vec<Node> = tree
        .nodes()
        .iter()
        .map(|node| Node { position_mm: 1.3 * node.position_mm, radius_mm: 1.3 * node.radius_mm, ..*node })
        .collect();
    let followup = Tree::new(&grown).expect("a tree");
    let params = Params { align: Align::Similarity, ..Params::default() };
    let found = juxtapose(&tree, &followup, &params).expect("a comparison").juxtaposition;
    assert!((found.alignment.scale - 1.0 / 1.3).abs() < 1e-6 && found.alignment.residual_max_mm < 1e-5);
    for row in &found.rows {
        assert_eq!(row.baseline_branches, row.followup_branches);
        assert!(
            (row.length_change_percent() - 30.0).abs() < 1e-6
                && (row.radius_change_percent() - 30.0).abs() < 1e-6
        );
    }
}

#[test]
fn odd_trees_compare_without_panic() {
    let node =
        |x: f64, parent| Node { position_mm: DVec3::new(x, 0.0, 0.0), radius_mm: 0.0, parent, kind: 0 };
    let point = Tree::new(&[node(0.0, None)]).expect("a tree");
    let thread = Tree::new(&[node(0.0, None), node(1.0, Some(0)), node(3.0, Some(1))]).expect("a tree");
    let mut star = vec![node(0.0, None)];
    star.extend((1..300).map(|i| node(f64::from(i), Some(0))));
    let star = Tree::new(&star).expect("a tree");
    for baseline in [&point, &thread, &star] {
        for followup in [&point, &thread, &star] {
            let found = compared(baseline, followup);
            assert!(!found.to_tsv().contains("inf") && !found.to_json().contains("NaN"));
        }
    }
    let far = Tree::new(&[node(0.0, None), node(1e80, Some(0))]).expect("a tree");
    let error = juxtapose(&point, &far, &Params::default()).expect_err("too far");
    assert!(error.to_string().contains("1e80"), "{error}");
}
