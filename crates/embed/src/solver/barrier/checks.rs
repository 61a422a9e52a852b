//! Tests of the barrier as a whole.

use glam::DVec2;

use super::*;
use crate::common::{FAMILIES, random_tree, stream, tree_of, views_along};
use crate::layout::cone;
use crate::params::Params;
use crate::{certify, energy, targets};
use espalier_model::Tree;
use glam::DVec3;

fn problem<'a>(tree: &'a Tree, params: &Params) -> Problem<'a> {
    let views = views_along(tree, DVec3::Z);
    let branches = tree.branches();
    let targets = targets::targets(tree, &branches, &views, params.targets).expect("targets");
    Problem::new(tree, branches, targets, params)
}

fn cone_shape(problem: &Problem) -> Shape {
    Shape::from_headings(problem, &cone::headings(problem))
}

/// E as it is scored.
fn scored(problem: &Problem, shape: &Shape) -> f64 {
    energy::score(problem, &shape.positions(problem), 0.0, 0).energy.total()
}

fn plain(separation: &Separation, reach_mm: f64) -> Clearance<'_> {
    Clearance { separation, reach_mm, near: Vec::new() }
}

#[test]
fn gradient_equals_differences() {
    let params = Params { w_placement: 0.3, ..Params::default() };
    let mut n_pushed = 0;
    for key in 0..48 {
        let tree = random_tree(key as usize % 8, 12 + key as usize % 30, 1.0, false, key);
        let problem = problem(&tree, &params);
        let separation = Separation::new(&problem, 0.0);
        let mut stream = stream(5200 + key);
        let mut shape = cone_shape(&problem);
        shape.length_ratio.iter_mut().for_each(|r| *r = stream.uniform(-0.3, 0.3));
        shape.angle_ratio.iter_mut().for_each(|r| *r = (*r + stream.uniform(-0.02, 0.02)).clamp(-0.95, 0.99));
        let mut x: Vec<f64> = shape.length_ratio.iter().chain(&shape.angle_ratio).copied().collect();
        // Near straight targets a turn has two slopes close together.
        x.iter_mut().filter(|r| r.abs() < 1e-3).for_each(|r| *r = 1e-3);
        let spacing = plain(&separation, 3.0 * problem.scale_mm);
        let mut field = Field::new(&problem, &separation.paths, spacing, 0.5);
        let mut work = Work::up_to(u64::MAX);
        let value = field.value(&x, &mut work);
        if !value.total.is_finite() {
            continue;
        }
        n_pushed += usize::from(value.total > value.loss);
        let mut gradient = vec![0.0; x.len()];
        field.gradient(&x, &mut gradient);
        let mut at = |dim: usize, step: f64| {
            let mut moved = x.clone();
            moved[dim] += step;
            field.value(&moved, &mut work).total
        };
        for dim in (0..x.len()).filter(|&dim| dim != shape.length_ratio.len()) {
            let step = 1e-6;
            let difference = (at(dim, step) - at(dim, -step)) / (2.0 * step);
            let off = (gradient[dim] - difference).abs();
            assert!(
                off < 2e-4 * difference.abs().max(1.0),
                "tree {key}, {dim}: {} {difference}",
                gradient[dim]
            );
        }
    }
    assert!(n_pushed > 20, "{n_pushed}");
}

#[test]
fn at_a_target_the_gradient_is_that_of_the_falling_side() {
    // A hook whose tip lies too near its foot; all at target.
    let tree = tree_of(&[
        (0.0, 0.0, 0.0, None),
        (4.0, 0.0, 0.0, Some(0)),
        (4.0, 2.0, 0.0, Some(1)),
        (2.0, 2.0, 0.0, Some(2)),
        (1.5, 0.5, 0.0, Some(3)),
    ]);
    let problem = problem(&tree, &Params { w_placement: 0.0, ..Params::default() });
    let separation = Separation::new(&problem, 0.0);
    let mut x = vec![0.0; problem.branches.list().len() + 5];
    let spacing = plain(&separation, 3.0);
    let mut field = Field::new(&problem, &separation.paths, spacing, 1.0);
    let mut work = Work::up_to(u64::MAX);
    let here = field.value(&x, &mut work).total;
    let mut gradient = vec![0.0; x.len()];
    field.gradient(&x, &mut gradient);
    let falling: Vec<usize> = (0..x.len()).filter(|&dim| gradient[dim] != 0.0).collect();
    assert!(falling.len() > 1);
    for dim in falling {
        let step = -1e-7 * gradient[dim].signum();
        x[dim] = step;
        let difference = (field.value(&x, &mut work).total - here) / step;
        x[dim] = 0.0;
        assert!((gradient[dim] - difference).abs() < 1e-4 * difference.abs().max(1.0), "{dim}");
        assert!(difference * step <= 0.0, "{dim}");
    }
}

#[test]
fn every_near_pair_is_listed() {
    for key in 0..40 {
        let tree = random_tree(key as usize % 8, 60, f64::from(key % 4), false, key);
        let problem = problem(&tree, &Params::default());
        let separation = Separation::new(&problem, 0.05);
        let mut stream = stream(5300 + key);
        let mut places: Vec<DVec2> =
            (0..tree.n_nodes()).map(|_| DVec2::new(stream.normal(), stream.normal()) * 8.0).collect();
        let mut spacing = plain(&separation, 3.0 * problem.scale_mm);
        let mut list = PairList::new(&problem);
        list.rebuild(&problem, &mut spacing, &places, &mut Work::up_to(u64::MAX));
        // Moved a little, the list still holds.
        let moved = 0.7 * list.skin_mm();
        places
            .iter_mut()
            .for_each(|p| *p += DVec2::new(stream.uniform(-moved, moved), stream.uniform(-moved, moved)));
        assert!(!list.is_stale(&places));
        let mut listed: Vec<_> =
            list.pairs.iter().map(|pair| (pair.first as usize, pair.second as usize)).collect();
        listed.sort_unstable();
        assert!(listed.windows(2).all(|pair| pair[0] != pair[1]), "tree {key}: twice");
        for b in 1..tree.n_nodes() {
            for a in 1..b {
                let Some(bounds) = spacing.bounds(a, b) else { continue };
                let (s, t) = (
                    crate::separation::segment(&problem, &places, a),
                    crate::separation::segment(&problem, &places, b),
                );
                let distance = espalier_geom::plane::segment_distance(&s, &t);
                let is_near = distance < bounds.floor_mm + bounds.width_mm;
                assert!(!is_near || listed.binary_search(&(a, b)).is_ok(), "tree {key}: {a} {b} {distance}");
            }
        }
    }
}

#[test]
fn never_crosses_never_worse_on_all_families() {
    let params = Params::default();
    let mut n_better = 0;
    for key in 0..64 {
        let family = key as usize % 8;
        let tree = random_tree(family, 2 + (key as usize * 11) % 90, f64::from(key % 4), false, key);
        let problem = problem(&tree, &params);
        let separation = Separation::new(&problem, 0.05);
        let mut shape = cone_shape(&problem);
        let before = scored(&problem, &shape);
        let start = shape.positions(&problem);
        let outcome = relax(&problem, &separation, &mut shape, (true, &mut Work::up_to(5_000_000)));
        let (after, positions) = (scored(&problem, &shape), shape.positions(&problem));
        let name = FAMILIES[family];
        assert!(after <= before * (1.0 + 1e-9) + 1e-12, "{name} {key}: {before} {after}");
        assert!(
            (outcome.loss_after - after).abs() <= 1e-6 * after.max(1.0),
            "{name} {key}: {outcome:?} {after}"
        );
        n_better += usize::from(after < 0.7 * before);
        if certify(&tree, &start).holds() {
            assert!(certify(&tree, &positions).holds(), "{name} {key}");
            let is_new = |a: usize, b: usize| {
                separation.too_near(&problem, &positions, a, b)
                    && !separation.too_near(&problem, &start, a, b)
            };
            for b in 1..tree.n_nodes() {
                assert!((1..b).all(|a| !is_new(a, b)), "{name} {key}: {b} came too near");
            }
        }
    }
    assert!(n_better > 30, "{n_better}");
}

#[test]
fn a_start_that_crosses_stays() {
    let tree = tree_of(&[
        (0.0, 0.0, 0.0, None),
        (4.0, 0.0, 0.0, Some(0)),
        (4.0, 2.0, 0.0, Some(1)),
        (2.0, 2.0, 0.0, Some(2)),
        (2.0, -2.0, 0.0, Some(3)),
    ]);
    let problem = problem(&tree, &Params::default());
    let separation = Separation::new(&problem, 0.05);
    let mut shape = Shape::targets(&problem);
    relax(&problem, &separation, &mut shape, (true, &mut Work::up_to(u64::MAX)));
    assert!(shape.angle_ratio.iter().chain(&shape.length_ratio).all(|&r| r == 0.0));
}

#[test]
fn hostile_sizes() {
    let params = Params::default();
    for (family, n_nodes) in [(0, 1), (0, 2), (3, 10_001), (5, 4001), (2, 20_001)] {
        let tree = random_tree(family, n_nodes, 1.0, false, 7);
        let problem = problem(&tree, &params);
        let separation = Separation::new(&problem, 0.05);
        let mut shape = cone_shape(&problem);
        let settings = Settings { reach_mm: problem.scale_mm, strength: 1e-2, iterations: 2 };
        let outcome = minimise(&problem, &separation, &mut shape, (&settings, &mut Work::up_to(10_000_000)));
        assert!(outcome.loss_after <= outcome.loss_before);
        assert!(certify(&tree, &shape.positions(&problem)).holds(), "{}", FAMILIES[family]);
    }
}

#[test]
fn pinned_ratios_stay() {
    let tree = random_tree(0, 60, 1.0, false, 3);
    let mut problem = problem(&tree, &Params::default());
    let mut shape = cone_shape(&problem);
    let was = shape.clone();
    for node in (1..60).step_by(3) {
        problem.free_angle[node] = false;
    }
    problem.free_length[1] = false;
    let separation = Separation::new(&problem, 0.05);
    let outcome = relax(&problem, &separation, &mut shape, (true, &mut Work::up_to(u64::MAX)));
    assert!(outcome.loss_after < outcome.loss_before);
    assert!((1..60).step_by(3).all(|node| shape.angle_ratio[node] == was.angle_ratio[node]));
    assert_eq!(shape.length_ratio[1], was.length_ratio[1]);
}
