//! Trees whose best views are known.

use crate::trees::{comb, moved, random_tree, rotation, tree};
use espalier_geom::angle::between;
use espalier_geom::space::half_sphere;
use espalier_geom::{math, random};
use espalier_model::{Tree, View, ViewHierarchy};
use espalier_views::{Metric, Mirror, Params, Search, find_views};
use glam::DVec3;

/// Both metrics and both searches; the swarm small.
fn all_ways() -> impl Iterator<Item = Params> {
    let ways = [Search::Fibonacci, Search::Pso].into_iter();
    ways.flat_map(|search| {
        let params = Params { search, particles: 64, iterations: 30, ..Params::default() };
        [Metric::Ukl, Metric::Kl].map(|metric| Params { metric, ..params.clone() })
    })
}

fn views_of(tree: &Tree, params: &Params) -> ViewHierarchy {
    find_views(tree, params, 1).expect("views").hierarchy
}

fn is_sound(view: &View) -> bool {
    let axes = [view.towards_camera, view.up];
    axes.iter().all(|axis| (axis.length() - 1.0).abs() < 1e-12)
        && view.up.dot(view.towards_camera).abs() < 1e-12
        && view.center_mm.is_finite()
        && view.radius_mm.is_finite()
        && view.loss.is_finite()
        && view.loss >= 0.0
}

fn all_views(views: &ViewHierarchy) -> impl Iterator<Item = &View> {
    let planes = views.chains.iter().chain(views.forks.iter().flatten()).map(|plane| &plane.view);
    std::iter::once(&views.global).chain(views.subtrees.iter().map(|subtree| &subtree.view)).chain(planes)
}

/// Degrees between two lines.
fn axes_apart_deg(a: DVec3, b: DVec3) -> f64 {
    let angle = between(a, b).to_degrees();
    angle.min(180.0 - angle)
}

#[test]
fn a_planar_tree_is_seen_along_its_normal_from_the_side_in_front() {
    for (i, normal) in half_sphere(6).enumerate() {
        let turn = rotation(DVec3::new(0.3, -0.7, 0.2), i as f64)
            * glam::DMat3::from_quat(glam::DQuat::from_rotation_arc(DVec3::Z, normal));
        let flat = moved(&random_tree(60, 4, true, i as u64), |p| turn * p + DVec3::splat(40.0));
        for params in all_ways() {
            let views = views_of(&flat, &params);
            let normal = turn * DVec3::Z;
            assert!(axes_apart_deg(views.global.towards_camera, normal) < 0.1, "{params:?}");
            assert!(views.global.loss < 1e-9 && views.global.towards_camera.y > -1e-9);
            for fork in views.forks.iter().flatten() {
                assert!(axes_apart_deg(fork.view.towards_camera, normal) < 0.1, "{params:?}");
            }
            for (chain, branch) in views.chains.iter().zip(flat.branches().list()) {
                // One edge lies in many planes: the one nearest to the global view is the tree's own.
                let tolerance = if branch.nodes.len() == 1 { 0.2 } else { 0.1 };
                assert!(axes_apart_deg(chain.view.towards_camera, normal) < tolerance, "{params:?}");
            }
        }
    }
}

#[test]
fn a_planar_tree_recovers_its_angles_and_its_headings() {
    let flat = moved(&random_tree(200, 4, true, 5), |p| rotation(DVec3::new(1.0, 2.0, 3.0), 1.1) * p);
    for metric in [Metric::Kl, Metric::Ukl] {
        let report = find_views(&flat, &Params { metric, ..Params::default() }, 0).expect("views").report;
        assert!(report.get("heading_mismatch").expect("counted") < 1e-6);
        assert!(report.get("chain_angle_error_mean_deg").expect("counted") < 1e-3);
        assert!(report.get("fork_angle_error_mean_deg").expect("counted") < 1e-3);
        assert_eq!(report.get("chains_mirrored"), Some(0.0));
        assert_eq!(report.get("forks_mirrored"), Some(0.0));
    }
}

#[test]
fn a_straight_chain_is_seen_whole_and_as_far_from_the_front_as_it_allows() {
    for along in half_sphere(20).chain([DVec3::X, DVec3::Y, DVec3::Z]) {
        let chain = tree(&[0.0, 1.0, 3.0, 3.5].map(|t| along * t), &[0, 1, 2]);
        for params in all_ways() {
            let views = views_of(&chain, &params);
            let camera = views.global.towards_camera;
            assert!(camera.dot(along).abs() < 2e-3, "{along} {camera} {params:?}");
            let across = DVec3::Y - along * along.y;
            if across.length() > 1e-6 {
                assert!(between(camera, across) < 2e-3, "{along} {camera} {params:?}");
            }
            assert!(all_views(&views).all(is_sound));
            assert!(
                between(views.chains[0].view.towards_camera, camera) < 1e-6,
                "{along} {camera} {:?} {params:?}",
                views.chains[0]
            );
        }
    }
}

#[test]
fn one_node_and_two_nodes() {
    for params in all_ways() {
        let single = views_of(&tree(&[DVec3::new(1.0, 2.0, 3.0)], &[]), &params);
        assert_eq!((single.chains.len(), single.forks.len(), single.subtrees.len()), (0, 1, 1));
        let View { towards_camera, up, center_mm, radius_mm, loss } = single.global;
        assert_eq!((towards_camera, up), (DVec3::Y, DVec3::Z));
        assert_eq!((center_mm, radius_mm, loss), (DVec3::new(1.0, 2.0, 3.0), 0.0, 0.0));

        let pair = views_of(&tree(&[DVec3::ZERO, DVec3::X * 4.0], &[0]), &params);
        assert_eq!((pair.global.center_mm, pair.global.radius_mm), (DVec3::X * 2.0, 2.0));
        assert!(between(pair.global.towards_camera, DVec3::Y) < 1e-9);
    }
}

#[test]
fn stars_with_hundreds_of_arms() {
    let mut positions = vec![DVec3::ZERO];
    positions.extend(half_sphere(700).map(|d| d * 3.0));
    for (max_siblings, search) in [(8, Search::Fibonacci), (1000, Search::Fibonacci), (1, Search::Pso)] {
        let params = Params { max_siblings, search, particles: 32, iterations: 10, ..Params::default() };
        let views = views_of(&tree(&positions, &[0; 700]), &params);
        assert!(all_views(&views).all(is_sound));
        assert_eq!((views.chains.len(), views.forks.iter().flatten().count()), (700, 1));
    }
}

#[test]
fn the_search_finds_the_optimum_of_a_dense_search() {
    for seed in 0..4 {
        let tree = random_tree(80, 5, false, seed);
        for metric in [Metric::Ukl, Metric::Kl] {
            let loss = |params: &Params| views_of(&tree, params).global.loss;
            let default = Params { metric, max_levels: 0, ..Params::default() };
            let dense = Params { directions: 5000, refine_starts: 20, ..default.clone() };
            let swarm = Params { search: Search::Pso, ..default.clone() };
            let (ours, densely, by_swarm) = (loss(&default), loss(&dense), loss(&swarm));
            assert!(ours <= densely + 1e-3, "seed {seed}: {ours} against {densely}");
            assert!(ours <= by_swarm + 1e-3, "seed {seed}: {ours} against {by_swarm}");
            assert!(densely > 1e-4, "seed {seed}: a random tree loses something");
        }
    }
}

#[test]
fn subtree_views_look_at_subtrees() {
    let tree = random_tree(600, 4, false, 2);
    let views = views_of(&tree, &Params { max_levels: 3, ..Params::default() });
    assert_eq!(views.subtrees[0].view, views.global);
    let levels: Vec<u32> = views.subtrees.iter().map(|subtree| subtree.level).collect();
    assert!(levels.is_sorted() && levels.first() == Some(&0) && levels.last() == Some(&3), "{levels:?}");
    for subtree in &views.subtrees[1..] {
        let n_forks_above = std::iter::successors(tree.parent(subtree.root), |&node| tree.parent(node))
            .filter(|&node| tree.children(node).len() > 1)
            .count();
        assert_eq!(n_forks_above, subtree.level as usize);
        let View { center_mm, radius_mm, .. } = subtree.view;
        let farthest = tree.subtree(subtree.root).chain(tree.parent(subtree.root));
        let farthest = farthest.map(|node| tree.position_mm(node).distance(center_mm)).fold(0.0, f64::max);
        assert!((farthest - radius_mm).abs() < 1e-12 * radius_mm);
    }
}

#[test]
fn a_fixed_view_is_taken_as_it_is() {
    let tree = random_tree(50, 4, false, 3);
    for fixed in [DVec3::new(0.0, -2.0, 0.0), DVec3::new(1e200, 1e200, 0.0), DVec3::new(0.0, 0.0, -1e-200)] {
        let views = views_of(&tree, &Params { fixed_view: Some(fixed.to_array()), ..Params::default() });
        let expected = (fixed / fixed.abs().max_element()).normalize();
        assert!(views.global.towards_camera.distance(expected) < 1e-15);
        assert!(views.global.loss > views_of(&tree, &Params::default()).global.loss);
        assert!(views.chains.iter().all(|c| c.is_mirrored == (c.view.towards_camera.dot(expected) < 0.0)));
    }
}

#[test]
fn parameters_and_coordinates_out_of_range_are_refused() {
    let pair = tree(&[DVec3::ZERO, DVec3::X], &[0]);
    let message = |params: Params| find_views(&pair, &params, 0).expect_err("refused").to_string();
    let default = Params::default;
    for (params, expected) in [
        (Params { directions: 7, ..default() }, "directions: must be 8 to 100000, is 7"),
        (Params { beta: f64::NAN, ..default() }, "beta: must be 1 to 1000, is NaN"),
        (Params { fixed_view: Some([0.0; 3]), ..default() }, "fixed_view: must be three finite numbers"),
        (Params { refine_step_rad: 0.0, ..default() }, "refine_step_rad"),
        (Params { iterations: 0, ..default() }, "iterations"),
    ] {
        let message = message(params);
        assert!(message.contains(expected), "{message}");
    }
    let far = tree(&[DVec3::ZERO, DVec3::X * 1e91], &[0]);
    let error = find_views(&far, &default(), 0).expect_err("refused").to_string();
    assert!(error.contains("node 1 lies 1e91 mm"), "{error}");
    assert!(default().validate().is_ok() && Params::paper().validate().is_ok());
}

#[test]
fn extreme_scales_keep_their_views() {
    let tree = random_tree(60, 4, false, 4);
    let usual = views_of(&tree, &Params::default()).global;
    for scale in [1e-100, 1e-9, 1e9, 1e80] {
        let scaled = views_of(&moved(&tree, |p| p * scale), &Params::default());
        assert!(all_views(&scaled).all(is_sound), "{scale}");
        assert!(scaled.global.towards_camera.distance(usual.towards_camera) < 1e-3, "{scale}");
    }
}

#[test]
fn large_trees_take_bounded_work() {
    // Without a bound on the levels a comb would have one view of half the tree per tooth, on average.
    for (tree, max_views) in [(comb(5000), 9), (random_tree(10_000, 6, false, 6), 400)] {
        let params = Params { directions: 20, refine_starts: 1, refine_step_rad: 1e-2, ..Params::default() };
        let found = find_views(&tree, &params, 0).expect("views");
        assert!(found.hierarchy.subtrees.len() <= max_views);
        assert!(all_views(&found.hierarchy).all(is_sound));
    }
}

#[test]
fn deep_and_wide_without_a_stack() {
    let mut stream = random::Stream::new(1, random::Purpose::Test, 0, 0);
    let wiggle: Vec<DVec3> =
        (0..50_000).map(|i| DVec3::new(f64::from(i), stream.normal(), math::sin(f64::from(i)))).collect();
    let chain = tree(&wiggle, &(0..49_999).collect::<Vec<_>>());
    let params = Params { directions: 8, refine_starts: 1, refine_step_rad: 0.1, ..Params::default() };
    for mirror in [Mirror::ClosedLoop, Mirror::Parent, Mirror::Global] {
        let views = views_of(&chain, &Params { mirror, ..params.clone() });
        assert!(all_views(&views).all(is_sound));
    }
}
