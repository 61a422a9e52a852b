//! Tests that hold two ways of computing the same thing against each other.

use espalier_geom::plane::{Segment, intersect, overlap_beyond_hub};
use espalier_geom::random::Stream;
use espalier_model::Tree;
use glam::{DVec2, DVec3};

use crate::batch::{BatchEnergy, CpuEnergy, DofMap};
use crate::choices::{CrossingWeight, Freedom, TargetMode};
use crate::common::{FAMILIES, random_tree, stream, tree_of, views_along};
use crate::layout::{cone, radial};
use crate::params::Params;
use crate::problem::Problem;
use crate::{certify, crossing, energy, place, targets};

fn problem<'a>(tree: &'a Tree, params: &Params) -> Problem<'a> {
    let views = views_along(tree, DVec3::Z);
    let branches = tree.branches();
    let targets = targets::targets(tree, &branches, &views, params.targets).expect("targets");
    Problem::new(tree, branches, targets, params)
}

/// Every pair, by the definition.
fn brute_force(parent: &[u32], positions: &[DVec2]) -> Vec<(usize, usize)> {
    let mut pairs = Vec::new();
    let ends = |node: usize| [parent[node] as usize, node];
    for a in 1..positions.len() {
        for b in a + 1..positions.len() {
            let shared = ends(a).into_iter().find(|node| ends(b).contains(node));
            let meets = match shared {
                Some(hub) => {
                    let tip = |node: usize| if ends(node)[0] == hub { ends(node)[1] } else { ends(node)[0] };
                    overlap_beyond_hub(positions[hub], positions[tip(a)], positions[tip(b)])
                }
                None => {
                    let segment =
                        |node: usize| Segment { a: positions[ends(node)[0]], b: positions[ends(node)[1]] };
                    intersect(&segment(a), &segment(b))
                }
            };
            if meets {
                pairs.push((a, b));
            }
        }
    }
    pairs
}

#[test]
fn certificate_equals_brute_force() {
    let mut n_crossing = 0;
    for key in 0..300 {
        let tree = random_tree(key as usize % 8, 4 + key as usize % 40, 1.0, false, key);
        let parent: Vec<u32> =
            (0..tree.n_nodes()).map(|node| tree.parent(node).unwrap_or(0) as u32).collect();
        let mut stream = stream(1000 + key);
        // Whole coordinates on a small grid: touching, collinear and coincident edges are the rule.
        let width = if key % 3 == 0 { 4 } else { 30 };
        let mut coordinate = || f64::from(stream.below(width));
        let positions: Vec<DVec2> =
            (0..tree.n_nodes()).map(|_| DVec2::new(coordinate(), coordinate())).collect();
        let expected = brute_force(&parent, &positions);
        let found = certify::certify(&tree, &positions);
        assert_eq!(found.crossings, expected.len(), "tree {key}");
        assert_eq!(found.pairs, expected[..expected.len().min(100)], "tree {key}");
        n_crossing += usize::from(!found.holds());
    }
    assert!(n_crossing > 100);
}

#[test]
fn swarm_count_is_as_strict_as_the_certificate() {
    let params = Params::default();
    for key in 0..300 {
        let tree = random_tree(key as usize % 8, 4 + key as usize % 60, 1.0, false, key);
        let problem = problem(&tree, &params);
        let mut stream = stream(2000 + key);
        let mut coordinate = || 6.0 * stream.normal();
        let positions: Vec<DVec2> =
            (0..tree.n_nodes()).map(|_| DVec2::new(coordinate(), coordinate())).collect();
        let x: Vec<f64> = positions.iter().map(|p| p.x).collect();
        let y: Vec<f64> = positions.iter().map(|p| p.y).collect();
        let exact = certify::certify(&tree, &positions).crossings;
        let mut scratch = crossing::Scratch::default();
        // In general position both see the same pairs.
        assert_eq!(crossing::count(&problem, &x, &y, usize::MAX, &mut scratch), exact, "tree {key}");
        assert_eq!(crossing::count(&problem, &x, &y, exact, &mut scratch), exact, "at the limit");
        if exact > 0 {
            assert!(crossing::count(&problem, &x, &y, 0, &mut scratch) > 0, "beyond the limit");
        }
    }
}

#[test]
fn near_misses_count_in_the_swarm() {
    let tree = tree_of(&[
        (0.0, 0.0, 0.0, None),
        (1.0, 0.0, 0.0, Some(0)),
        (2.0, 1.0, 0.0, Some(1)),
        (0.0, 1.0, 0.0, Some(2)),
    ]);
    let problem = problem(&tree, &Params::default());
    let count = |gap: f64| {
        let mut scratch = crossing::Scratch::default();
        crossing::count(&problem, &[0.0, 1.0, 2.0, 0.5], &[0.0, 0.0, 1.0, gap], usize::MAX, &mut scratch)
    };
    assert_eq!(count(1e-3), 0);
    assert_eq!(count(1e-7), 1);
    assert_eq!(count(-1e-7), 1);
    assert_eq!(count(-0.2), 1);
}

#[test]
fn cone_and_radial_never_cross() {
    let params = Params::default();
    for key in 0..2000 {
        let family = key as usize % 8;
        let n_nodes = 2 + (key as usize * 7) % 90;
        let tree = random_tree(family, n_nodes, f64::from(key % 7), false, key);
        let problem = problem(&tree, &params);
        for (name, heading_rad) in
            [("radial", radial::headings(&problem)), ("cone", cone::headings(&problem))]
        {
            let positions = place::from_headings(&problem, &heading_rad);
            let certificate = certify::certify(&tree, &positions);
            assert!(certificate.holds(), "{name} of {} {key}: {:?}", FAMILIES[family], certificate.pairs);
        }
    }
}

#[test]
fn cone_keeps_sides() {
    let params = Params::default();
    for key in 0..200 {
        let tree = random_tree(key as usize % 8, 60, 1.0, false, key);
        let problem = problem(&tree, &params);
        let heading_rad = cone::headings(&problem);
        let turn_rad = place::turns(&problem, &heading_rad);
        for (node, parent) in tree.edges().filter(|&(_, parent)| parent != 0) {
            let turns_to_side = turn_rad[node] * problem.side[node];
            let is_single = tree.children(parent).len() == 1;
            assert!(turns_to_side > 0.0 || (is_single && turns_to_side == 0.0), "tree {key}, node {node}");
        }
        // So it is a particle, but for what the range of r_a takes off at crowded forks.
        let dofs = DofMap::new(&problem, Freedom::N);
        let ratios = place::angle_ratios(&problem, &heading_rad);
        assert!(ratios.iter().all(|&ratio| ratio <= 1.0), "tree {key}");
        let particle = dofs.particle(&problem, &vec![0.0; tree.n_nodes()], &ratios);
        if ratios.iter().all(|&ratio| ratio >= -0.97) {
            let swarm = CpuEnergy { problem: &problem, dofs: &dofs };
            let positions = place::from_headings(&problem, &heading_rad);
            let off = |(a, b): (&DVec2, DVec2)| a.distance(b);
            let worst = positions.iter().zip(swarm.positions(&particle)).map(off).fold(0.0, f64::max);
            assert!(worst < 1e-9, "tree {key}: {worst}");
        }
    }
}

#[test]
fn combs_stars_and_chains_of_any_size() {
    let params = Params::default();
    let comb = random_tree(2, 20_001, 1.0, false, 1);
    let star = random_tree(3, 501, 2.0, false, 2);
    let chain: Vec<_> = (0..50_000_usize)
        .map(|i| (i as f64, f64::from(i as u32 % 2), f64::from(i as u32 % 3), i.checked_sub(1)))
        .collect();
    for (name, tree) in [("comb", comb), ("star", star), ("chain", tree_of(&chain))] {
        let problem = problem(&tree, &params);
        for heading_rad in [radial::headings(&problem), cone::headings(&problem)] {
            let positions = place::from_headings(&problem, &heading_rad);
            let certificate = certify::certify(&tree, &positions);
            assert!(certificate.holds(), "{name}: {:?}", certificate.pairs.first());
        }
    }
}

#[test]
fn a_one_sided_comb_survives_ten_thousand_teeth() {
    // Spine and teeth turn to the same side at every fork: what the other side keeps must not add up.
    let mut nodes = vec![(0.0, 0.0, 0.0, None), (1.0, 0.0, 0.0, Some(0))];
    for tooth in 0..10_000_usize {
        let spine = if tooth == 0 { 1 } else { 2 * tooth };
        let (x, bend) = (2.0 + tooth as f64, 1e-3 * tooth as f64);
        nodes.push((x, -bend - 1e-4 * x, 0.0, Some(spine)));
        nodes.push((x, -1.0 - bend - 1e-4 * x, 0.0, Some(spine)));
    }
    let tree = tree_of(&nodes);
    let problem = problem(&tree, &Params::default());
    let positions = place::from_headings(&problem, &cone::headings(&problem));
    assert!(certify::certify(&tree, &positions).holds());
}

fn random_particle(dofs: &DofMap, stream: &mut Stream) -> Vec<f64> {
    (0..dofs.dims())
        .map(|dim| {
            let (low, high) = dofs.range(dim);
            stream.uniform(low, high)
        })
        .collect()
}

#[test]
fn swarm_energy_equals_the_one_energy() {
    for (key, freedom) in [Freedom::S, Freedom::B, Freedom::N].into_iter().cycle().take(120).enumerate() {
        let targets = if key % 2 == 0 { TargetMode::Intrinsic } else { TargetMode::Projected };
        let params = Params { targets, w_placement: 0.3, w_length: 1.5, ..Params::default() };
        let tree = random_tree(key % 8, 5 + key % 30, 1.0, false, key as u32);
        let problem = problem(&tree, &params);
        let dofs = DofMap::new(&problem, freedom);
        let swarm = CpuEnergy { problem: &problem, dofs: &dofs };
        let particle = random_particle(&dofs, &mut stream(3000 + key as u32));
        let mut scores = [None];
        swarm.evaluate(&particle, &[f64::INFINITY], &mut scores);
        let score = scores[0].expect("no limit");
        let positions = swarm.positions(&particle);
        let scored = energy::score(&problem, &positions, 0.0, score.crossings);
        let (fast, slow) = (score.energy, scored.energy.total());
        assert!((fast - slow).abs() < 1e-9 * slow.max(1.0), "tree {key}: {fast} {slow}");
        // The inverse of equation 3 gives the ratios back.
        let angle_ratio = place::angle_ratios(&problem, &place::headings(&problem, &positions));
        let back = dofs.particle(&problem, &scored.length_ratio, &angle_ratio);
        // Straight targets have no share of a bend to tell.
        let is_told = |dim: usize| {
            let mut of_dim = (1..tree.n_nodes()).filter(|&node| dofs.angle[node] as usize == dim).peekable();
            dim < dofs.n_lengths || (of_dim.peek().is_some() && of_dim.all(|node| problem.bend[node] > 1e-6))
        };
        for (dim, (a, b)) in particle.iter().zip(&back).enumerate() {
            assert!(!is_told(dim) || (a - b).abs() < 1e-6, "tree {key}, ratio {dim}: {a} {b}");
        }
        // Limits change nothing but whether there is an answer.
        swarm.evaluate(&particle, &[score.energy], &mut scores);
        assert_eq!(scores[0], None);
        swarm.evaluate(&particle, &[score.energy * (1.0 + 1e-12) + 1e-12], &mut scores);
        assert_eq!(scores[0], Some(score));
    }
}

#[test]
fn energy_of_a_small_tree_by_hand() {
    // A stem of two edges, then a fork at ±60° whose left arm bends by 30° to the right, all in one plane.
    let (sin, cos) = espalier_geom::math::sin_cos(60_f64.to_radians());
    let (sin30, cos30) = espalier_geom::math::sin_cos(30_f64.to_radians());
    let tree = tree_of(&[
        (0.0, 0.0, 0.0, None),
        (1.0, 0.0, 0.0, Some(0)),
        (2.0, 0.0, 0.0, Some(1)),
        (2.0 + cos, sin, 0.0, Some(2)),
        (2.0 + cos + cos30, sin + sin30, 0.0, Some(3)),
        (2.0 + cos, -sin, 0.0, Some(2)),
    ]);
    let params = Params { w_placement: 0.0, ..Params::default() };
    let problem = problem(&tree, &params);
    let positions = place::from_headings(&problem, &radial::headings(&problem));
    let scored = energy::score(&problem, &positions, 1e-12, 0);
    // Two tips: the arms leave at ±90°, θ = 180° ± 90° against targets 180° ± 60°; the left arm goes straight
    // on. r_a of the arms (60° − 90°) / (180° − 60°) = −1/4, of the bend 1. Means: stem 0, left (1/16 + 1) / 2,
    // right 1/16.
    let expected = 2.0 * (0.5 * (1.0 / 16.0 + 1.0) + 1.0 / 16.0);
    assert!((scored.energy.angle - expected).abs() < 1e-12, "{:?}", scored.energy);
    assert_eq!(scored.energy.length, 0.0);
    assert_eq!(scored.angle_ratio[1], 0.0);

    // Half the length of the right arm: r_l = −1/2, alone in its segment.
    let mut shorter = positions.clone();
    shorter[5] = 0.5 * (shorter[5] + shorter[2]);
    let scored = energy::score(&problem, &shorter, 1e-12, 0);
    assert!((scored.energy.length - 2.0 * 0.25).abs() < 1e-12);
    // 1.5 · M · (w_l + 4 w_a) with three segments.
    assert!((problem.crossing_weight - 1.5 * 3.0 * 10.0).abs() < 1e-12);
    assert!((energy::score(&problem, &positions, 1e-12, 2).energy.crossing - 90.0).abs() < 1e-12);
}

#[test]
fn a_crossing_costs_more_than_any_layout_without() {
    let params = Params { w_placement: 0.5, ..Params::default() };
    assert_eq!(params.w_crossing, CrossingWeight::Auto);
    for key in 0..200 {
        let tree = random_tree(key as usize % 8, 40, 2.0, false, key);
        let problem = problem(&tree, &params);
        let mut stream = stream(4000 + key);
        // The worst headings that exact lengths can have.
        let heading_rad: Vec<f64> = (0..tree.n_nodes()).map(|_| stream.uniform(-9.0, 9.0)).collect();
        let positions = place::from_headings(&problem, &heading_rad);
        assert!(energy::score(&problem, &positions, 0.0, 0).energy.total() < problem.crossing_weight);
    }
}

#[test]
fn targets_are_exact_and_siblings_apart() {
    for key in 0..200 {
        let tree = random_tree(key as usize % 8, 50, 1.0, false, key);
        let problem = problem(&tree, &Params::default());
        for (node, parent) in tree.edges().filter(|&(_, parent)| parent != 0) {
            let interior = targets::interior_angle(&tree, node, parent);
            let target = std::f64::consts::PI - problem.bend[node];
            if tree.children(parent).len() == 1 {
                assert!((target - interior).abs() < 1e-12 || interior < 0.02, "{interior} {target}");
            }
        }
        for node in 0..tree.n_nodes() {
            let children = problem.children_by_target(node);
            let least = 0.05_f64.min(std::f64::consts::PI / (children.len() as f64 + 1.0));
            for pair in children.windows(2).filter(|_| node != 0) {
                let gap = problem.targets.angle_rad[pair[1]] - problem.targets.angle_rad[pair[0]];
                assert!(gap >= least - 1e-12, "tree {key}, fork {node}: {gap}");
            }
        }
    }
}
