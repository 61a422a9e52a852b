//! The sweep against all pairs, and against the certificate of the embedding.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use espalier_geom::math::unit_vector;
use espalier_geom::plane::{Segment, intersect, overlap_beyond_hub};
use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Node, Tree};
use espalier_verify::meetings;
use glam::{DVec2, DVec3};

/// A random tree in which the parent of a node is one of the `reach` nodes before it.
fn tree(n_nodes: usize, reach: u32, stream: &mut Stream) -> Tree {
    let parent = |node: usize| node - 1 - stream.below(reach.min(node as u32)) as usize;
    tree_of(&std::iter::once(None).chain((1..n_nodes).map(parent).map(Some)).collect::<Vec<_>>())
}

/// A tree by the parent of each node; where its nodes are in space does not matter here.
fn tree_of(parents: &[Option<usize>]) -> Tree {
    let node = |(node, &parent): (usize, &Option<usize>)| Node {
        position_mm: DVec3::new(node as f64, 0.0, 0.0),
        radius_mm: 0.1,
        parent,
        kind: 0,
    };
    Tree::new(&parents.iter().enumerate().map(node).collect::<Vec<_>>()).expect("a tree")
}

/// Every pair by its definition.
fn by_all_pairs(tree: &Tree, p: &[DVec2]) -> Vec<(usize, usize)> {
    let edges: Vec<(usize, usize)> = tree.edges().collect();
    let mut found = Vec::new();
    for (place, &(a, parent_a)) in edges.iter().enumerate() {
        for &(b, parent_b) in &edges[place + 1..] {
            let meet = if parent_b == a {
                overlap_beyond_hub(p[a], p[parent_a], p[b])
            } else if parent_a == parent_b {
                overlap_beyond_hub(p[parent_a], p[a], p[b])
            } else {
                intersect(&Segment { a: p[a], b: p[parent_a] }, &Segment { a: p[b], b: p[parent_b] })
            };
            if meet {
                found.push((a, b));
            }
        }
    }
    found
}

#[track_caller]
fn check(tree: &Tree, positions: &[DVec2], what: &str) -> usize {
    let mut found = meetings(tree, positions);
    assert!(found.is_complete && found.count == found.pairs.len());
    found.pairs.sort_unstable();
    assert_eq!(found.pairs, by_all_pairs(tree, positions), "{what}: {positions:?}");
    found.count
}

#[test]
fn small_integer_grids_where_everything_touches() {
    let mut n_planar = 0;
    for key in 0..12_000 {
        let mut stream = Stream::new(1, Purpose::Test, 4600, key);
        let n_nodes = 2 + stream.below(11) as usize;
        let tree = tree(n_nodes, 1 + key % 5, &mut stream);
        let (columns, rows) = (1 + stream.below(5), 1 + stream.below(5));
        let mut point = || DVec2::new(f64::from(stream.below(columns)), f64::from(stream.below(rows)));
        let positions: Vec<DVec2> = (0..n_nodes).map(|_| point()).collect();
        n_planar += usize::from(check(&tree, &positions, &format!("key {key}")) == 0);
    }
    assert!(n_planar > 100, "{n_planar} of the layouts had no meeting");
}

#[test]
fn concurrent_lines_away_from_nodes_and_near_misses() {
    for key in 0..3000 {
        let mut stream = Stream::new(1, Purpose::Test, 4601, key);
        let n_nodes = 4 + 2 * stream.below(8) as usize;
        let tree = tree(n_nodes, 2, &mut stream);
        let center = DVec2::new(1.0 / 3.0, 0.1);
        // Nodes opposite each other: many edges pass through the centre, or nearly.
        let mut positions = Vec::new();
        for place in 0..n_nodes {
            let offset =
                DVec2::new(f64::from(stream.below(7)) - 3.0, f64::from(stream.below(7)) - 3.0) * 0.125;
            let opposite = positions.last().map(|&last: &DVec2| center - (last - center));
            positions.push(if place % 2 == 1 { opposite.unwrap_or(offset) } else { center + offset });
        }
        check(&tree, &positions, &format!("key {key}"));
    }
}

#[test]
fn decimal_coordinates_of_any_size() {
    for key in 0..1500 {
        let mut stream = Stream::new(1, Purpose::Test, 4602, key);
        let n_nodes = 3 + stream.below(60) as usize;
        let tree = tree(n_nodes, 4, &mut stream);
        let decimals = stream.below(6) as usize;
        let scale = [1e-60, 1e-6, 1.0, 1e9, 1e60][key as usize % 5];
        let mut at = DVec2::ZERO;
        let positions: Vec<DVec2> = (0..n_nodes)
            .map(|_| {
                at += DVec2::new(stream.normal(), stream.normal());
                let round = |value: f64| format!("{value:.decimals$}").parse::<f64>().expect("a number");
                DVec2::new(round(at.x), round(at.y)) * scale
            })
            .collect();
        check(&tree, &positions, &format!("key {key}"));
    }
}

#[test]
fn stars_combs_and_spirals_without_meetings() {
    let star: Vec<Option<usize>> =
        std::iter::once(None).chain(std::iter::repeat_n(Some(0), 10_000)).collect();
    let tree = tree_of(&star);
    let mut positions: Vec<DVec2> = (0..10_001).map(|node| unit_vector(6e-4 * f64::from(node))).collect();
    positions[0] = DVec2::ZERO;
    check_count(&tree, &positions, 0);
    // Two rays of one direction.
    positions[1] = 0.5 * positions[2];
    assert_eq!(meetings(&tree, &positions).pairs, [(1, 2)]);

    // Odd nodes are the comb's back, even ones its teeth.
    let comb = |node: usize| node.checked_sub(if node % 2 == 1 { 2 } else { 1 }).or((node == 1).then_some(0));
    let tree = tree_of(&(0..20_001).map(comb).collect::<Vec<_>>());
    let tooth = |node: usize| {
        let height = if node.is_multiple_of(2) { node.min(1) } else { 0 };
        DVec2::new(node.div_ceil(2) as f64, height as f64)
    };
    // In preorder a tooth comes before the rest of the back.
    let order: Vec<usize> = tree.nodes().iter().map(|node| node.position_mm.x as usize).collect();
    check_count(&tree, &order.into_iter().map(tooth).collect::<Vec<_>>(), 0);

    let tree = tree_of(&(0..100_000_usize).map(|node| node.checked_sub(1)).collect::<Vec<_>>());
    let spiral = |node: usize| unit_vector(0.05 * node as f64) * (1.0 + 0.01 * node as f64);
    check_count(&tree, &(0..100_000).map(spiral).collect::<Vec<_>>(), 0);
}

fn check_count(tree: &Tree, positions: &[DVec2], expected: usize) {
    let found = meetings(tree, positions);
    assert_eq!((found.count, found.is_complete), (expected, true), "{:?}", found.pairs.first());
}

#[test]
fn everything_at_one_point_stops_in_time() {
    let mut stream = Stream::new(1, Purpose::Test, 4603, 0);
    let tree = tree(6000, 3, &mut stream);
    let found = meetings(&tree, &vec![DVec2::ONE; 6000]);
    assert!(!found.is_complete && found.count >= 10_000_000);
}
