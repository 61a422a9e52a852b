//! Grown trees: anatomy, Murray's law, clearance, topology of their masks.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use espalier_geom::space::distance_to_segment;
use espalier_model::{Mask, Tree};
use espalier_phantom::{Kind, Params, Phantom, generate, grow_tree};
use glam::DVec3;

mod common;

const SEEDS: [u64; 3] = [0, 1, 7];

fn make(kind: Kind, seed: u64) -> Phantom {
    generate(kind, &Params::default(), seed).expect("a legal phantom")
}

/// The cube of the parent's radius over the sum of its children's, at every fork.
fn murray_ratios(tree: &Tree) -> Vec<f64> {
    let cube = |node: usize| {
        let r = tree.nodes()[node].radius_mm;
        r * r * r
    };
    (0..tree.n_nodes())
        .filter(|&node| tree.children(node).len() > 1)
        .map(|fork| cube(fork) / tree.children(fork).iter().map(|&child| cube(child)).sum::<f64>())
        .collect()
}

#[test]
fn forks_keep_murrays_law() {
    for kind in [Kind::Vessel, Kind::Airway] {
        for seed in SEEDS {
            let ratios = murray_ratios(&grow_tree(kind, &Params::default(), seed).expect("legal"));
            assert!(ratios.len() > 50, "{kind:?}: {} forks", ratios.len());
            // Radii are rounded to 0.0001 mm.
            assert!(
                ratios.iter().all(|ratio| (ratio - 1.0).abs() < 1e-3),
                "{kind:?} seed {seed}: {ratios:?}"
            );
        }
    }
}

#[test]
fn the_airway_is_an_airway() {
    for seed in SEEDS {
        let tree = grow_tree(Kind::Airway, &Params::default(), seed).expect("legal");
        let branches = tree.branches();
        let of_generation = |generation: u32| {
            branches.list().iter().enumerate().filter(move |(_, branch)| branch.generation == generation)
        };
        let radius = |node: usize| tree.nodes()[node].radius_mm;

        // The trachea: 100–120 mm long, 18 mm wide, upwards from the carina at the origin.
        let trachea = &branches.list()[0];
        assert!((100.0..120.0).contains(&branches.length_mm(&tree, 0)));
        assert_eq!(2.0 * radius(trachea.end()), 18.0);
        assert!(tree.position_mm(0).z > 95.0 && tree.position_mm(trachea.end()).length() < 1e-3);

        // The right main bronchus: at +x, shorter, wider, steeper.
        let mains: Vec<usize> = of_generation(1).map(|(branch, _)| branch).collect();
        assert_eq!(mains.len(), 2);
        let ends = mains.iter().map(|&branch| tree.position_mm(branches.list()[branch].end()));
        let [right, left] = ends.collect::<Vec<_>>()[..] else { panic!("two mains") };
        assert!(right.x > 5.0 && left.x < -20.0);
        assert!(branches.length_mm(&tree, mains[0]) < 0.7 * branches.length_mm(&tree, mains[1]));
        assert!(radius(branches.list()[mains[0]].end()) > radius(branches.list()[mains[1]].end()));
        let steepness = |v: DVec3| -v.z / v.length();
        assert!(steepness(right) > steepness(left) + 0.1);
        // Each lung's airways stay on their side, once they have left the midline.
        for (main, sign) in [(mains[0], 1.0), (mains[1], -1.0)] {
            let subtree = tree.subtree(branches.list()[main].end());
            assert!(subtree.into_iter().all(|node| sign * tree.position_mm(node).x > 0.0));
        }

        // Weibel: a generation is about 2^(−1/3) as wide as the one above, at most twice as numerous.
        let mut last = (f64::INFINITY, 1);
        for generation in 0..=8 {
            let n = of_generation(generation).count();
            let mean = of_generation(generation).map(|(_, b)| 2.0 * radius(b.end())).sum::<f64>() / n as f64;
            let weibel = 18.0 * espalier_geom::math::pow(2.0, -f64::from(generation) / 3.0);
            assert!(mean < last.0, "generation {generation}: {mean} mm");
            assert!((0.75..1.45).contains(&(mean / weibel)), "generation {generation}: {mean} mm, {weibel}");
            assert!(n > 0 && n <= 2 * last.1, "generation {generation}: {n}");
            last = (mean, n);
        }
        assert_eq!(of_generation(9).count(), 0);
        assert!((120..=256).contains(&tree.n_tips()), "{} tips", tree.n_tips());
        let is_early = |branch: &&espalier_model::Branch| {
            branch.generation < 5 && tree.children(branch.end()).is_empty()
        };
        assert_eq!(branches.list().iter().filter(is_early).count(), 0, "seed {seed}: stumps");
    }
}

#[test]
fn branches_keep_their_distance() {
    for kind in [Kind::Airway, Kind::Vessel] {
        let params = Params::default();
        let tree = grow_tree(kind, &params, 1).expect("legal");
        let branches = tree.branches();
        let hub_or_end = |b: &espalier_model::Branch| [b.hub, b.end()];
        for (s_idx, s) in branches.list().iter().enumerate() {
            for t in &branches.list()[..s_idx] {
                // Neighbours share a hub. The template of the airways is laid by hand and not held to it.
                let are_neighbours = hub_or_end(s).iter().any(|node| hub_or_end(t).contains(node));
                if are_neighbours || (kind == Kind::Airway && s.generation <= 3 && t.generation <= 3) {
                    continue;
                }
                // From the first own node, which stands where the hub's ball ends.
                let gap = surface_gap(&tree, s.nodes.clone(), t.nodes.clone());
                assert!(gap > params.clearance_mm - 0.01, "{kind:?}: {gap} mm between {s:?} and {t:?}");
            }
        }
    }
}

/// The smallest gap between the surfaces of two chains, measured from the nodes of the one to the edges of the other.
fn surface_gap(tree: &Tree, s: std::ops::Range<usize>, t: std::ops::Range<usize>) -> f64 {
    let ball = |node: usize| (tree.position_mm(node), tree.nodes()[node].radius_mm);
    let mut gap = f64::INFINITY;
    for (one, other) in [(s.clone(), t.clone()), (t, s)] {
        for (node, start) in one.flat_map(|node| other.clone().skip(1).map(move |end| (node, end - 1))) {
            let ((at, radius), (a, radius_a), (b, radius_b)) = (ball(node), ball(start), ball(start + 1));
            gap = gap.min(distance_to_segment(at, a, b) - radius - radius_a.max(radius_b));
        }
    }
    gap
}

#[test]
fn masks_are_balls_to_a_topologist() {
    for kind in [Kind::Airway, Kind::Vessel] {
        for seed in SEEDS {
            let phantom = make(kind, seed);
            let mask: &Mask = phantom.mask.as_ref().expect("a mask");
            assert_eq!(common::n_components(mask), 1, "{kind:?} seed {seed}");
            assert_eq!(common::euler_number(mask), 1, "{kind:?} seed {seed}");
            let (low, high) = mask.bounding_box().expect("foreground");
            let shape = mask.grid().shape();
            assert!(
                (0..3).all(|axis| low[axis] > 2 && high[axis] + 3 < shape[axis]),
                "{kind:?} {low:?} {high:?}"
            );
        }
    }
}

#[test]
fn anatomy_scales() {
    let at = |size: f64| grow_tree(Kind::Airway, &Params { size, ..Params::default() }, 3).expect("legal");
    let (small, large) = (at(0.5), at(2.0));
    assert_eq!(small.n_nodes(), large.n_nodes());
    assert!((large.length_mm() / small.length_mm() - 4.0).abs() < 1e-3);
}

#[test]
fn generations_bound_the_airway() {
    for generations in [1, 2, 3, 6, 11] {
        let params = Params { generations, min_radius_mm: 0.5, ..Params::default() };
        let tree = grow_tree(Kind::Airway, &params, 0).expect("legal");
        let deepest = tree.branches().list().iter().map(|branch| branch.generation).max();
        assert_eq!(deepest, Some(generations));
    }
}

#[test]
fn a_neuron_has_exactly_its_nodes() {
    for n_nodes in [2, 3, 7, 50, 235, 1000, 5000] {
        for seed in SEEDS {
            let tree =
                grow_tree(Kind::Neuron, &Params { n_nodes, ..Params::default() }, seed).expect("legal");
            assert_eq!(tree.n_nodes(), n_nodes);
            assert!((1..n_nodes).all(|node| tree.children(node).len() <= 2), "binary forks");
            assert_eq!(tree.nodes()[0].kind, 1, "the root is the soma");
        }
    }
}

#[test]
fn a_neuron_spreads_and_does_not_touch_itself() {
    for (n_nodes, extent_mm) in [(235, 0.08..0.4), (2000, 0.15..0.8)] {
        let tree = grow_tree(Kind::Neuron, &Params { n_nodes, ..Params::default() }, 2).expect("legal");
        assert!(extent_mm.contains(&tree.extent_mm()), "{} mm", tree.extent_mm());
        let positions: Vec<DVec3> = tree.nodes().iter().map(|node| node.position_mm).collect();
        for (node_idx, p) in positions.iter().enumerate() {
            for q in &positions[..node_idx] {
                assert!(p.distance(*q) > 0.000_9, "two nodes within a micrometre");
            }
        }
        let n_tips = tree.n_tips();
        assert!(n_tips > 12 && n_tips < n_nodes / 8, "{n_tips} tips of {n_nodes} nodes");
    }
}

#[test]
fn a_neuron_of_thirty_thousand_nodes_is_grown_at_once() {
    let tree = grow_tree(Kind::Neuron, &Params { n_nodes: 30_000, ..Params::default() }, 0).expect("legal");
    assert_eq!(tree.n_nodes(), 30_000);
    assert!(tree.n_tips() > 300);
}
