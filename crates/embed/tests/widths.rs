//! Layouts at the widths of their tubes: what is counted, proven, avoided and stretched.
#![allow(clippy::expect_used, reason = "a test that cannot go on says why")]

#[path = "common/mod.rs"]
mod common;

use common::{FAMILIES, random_tree, tree_of, views_along};
use espalier_embed::{Embedded, Method, Params, WidthsMode, WidthsParams, embed, embed_edited};
use espalier_geom::math;
use espalier_model::{Edit, Edits, Termination, Tree, WidthMode};
use glam::DVec3;

/// The cone, and what is asked for about its widths.
fn laid_flat(tree: &Tree, mode: WidthsMode) -> Embedded {
    let widths = WidthsParams { mode };
    let params = Params { method: Method::Cone, methods: Vec::new(), widths, ..Params::default() };
    embed(tree, &views_along(tree, DVec3::Z), &params, 0, &|_| {}).expect("a certified layout")
}

/// The solver, without the search for sides, so that targets are those of the plane.
fn solved(tree: &Tree, mode: WidthsMode) -> Embedded {
    let mut params = Params { methods: Vec::new(), widths: WidthsParams { mode }, ..Params::default() };
    params.solver.mirrors = false;
    embed(tree, &views_along(tree, DVec3::Z), &params, 0, &|_| {}).expect("a certified layout")
}

fn with_radius(tree: &Tree, radius_mm: impl Fn(usize) -> f64) -> Tree {
    let mut nodes = tree.nodes().to_vec();
    nodes.iter_mut().enumerate().for_each(|(node, data)| data.radius_mm = radius_mm(node));
    Tree::new(&nodes).expect("a tree")
}

/// A hairpin of two long parallel arms, 4 mm apart.
fn hairpin(radius_mm: f64) -> Tree {
    let nodes = tree_of(&[
        (0.0, 0.0, 0.0, None),
        (30.0, 0.0, 0.0, Some(0)),
        (60.0, 0.0, 0.0, Some(1)),
        (60.0, 4.0, 0.0, Some(2)),
        (30.0, 4.0, 0.0, Some(3)),
        (0.0, 4.0, 0.0, Some(4)),
    ]);
    with_radius(&nodes, |_| radius_mm)
}

#[test]
fn parallel_tubes_overlap_from_half_their_distance_on() {
    for (radius_mm, overlaps, radius_scale) in [(1.9, 0, 1.0), (2.1, 1, 2.0 / 2.1), (2.5, 1, 0.8)] {
        let widths = solved(&hairpin(radius_mm), WidthsMode::Report).embedding.widths;
        // The arms next to the bend part only within the junction discs there; the far ones do not.
        assert_eq!(widths.overlaps > 0, overlaps > 0, "{radius_mm}: {widths:?}");
        assert!((widths.radius_scale - radius_scale).abs() < 1e-9, "{radius_mm}: {widths:?}");
        assert!(widths.is_complete && widths.length_scale == 1.0 && widths.mode == WidthMode::Report);
    }
}

#[test]
fn a_fork_merges_as_far_as_its_disc() {
    // Two long straight arms at 40°, in edges of 1 mm: tubes of radius 1 part 1 / sin 20° = 2.92 mm from the fork.
    let (sin, cos) = math::sin_cos(20_f64.to_radians());
    let mut nodes = vec![(0.0, 0.0, 0.0, None), (10.0, 0.0, 0.0, Some(0))];
    for side in [1.0, -1.0] {
        for step in 1..=40 {
            let parent = if step == 1 { 1 } else { nodes.len() - 1 };
            let along = f64::from(step);
            nodes.push((10.0 + along * cos, side * along * sin, 0.0, Some(parent)));
        }
    }
    let tree = tree_of(&nodes);
    for (radius_mm, expected) in [(1.0, 0), (3.0, 0), (6.0, 0)] {
        let widths = solved(&with_radius(&tree, |_| radius_mm), WidthsMode::Report).embedding.widths;
        assert_eq!(widths.overlaps, expected, "{radius_mm}: {widths:?}");
    }
    // Bent back towards each other far out, beyond the disc, they do overlap.
    let mut bent = nodes.clone();
    let last = [41, 81].map(|tip: usize| (bent[tip].0, bent[tip].1));
    for (tip, (x, y)) in [41, 81].into_iter().zip(last) {
        bent.push((x + 1.0, 0.1 * y.signum(), 0.0, Some(tip)));
    }
    let tree = with_radius(&tree_of(&bent), |_| 1.0);
    assert!(solved(&tree, WidthsMode::Report).embedding.widths.overlaps > 0);
}

/// So many straight arms in two edges each, all around a point.
fn star(n_arms: usize, length_mm: f64, radius_mm: f64) -> Tree {
    let mut nodes = vec![(0.0, 0.0, 0.0, None)];
    for arm in 0..n_arms {
        let turn = std::f64::consts::TAU * arm as f64 / n_arms as f64;
        let (sin, cos) = math::sin_cos(turn);
        let lift = if arm % 2 == 0 { 0.3 } else { -0.3 };
        for step in 1..=10 {
            let along = 0.1 * length_mm * f64::from(step);
            let parent = if step == 1 { 0 } else { nodes.len() - 1 };
            nodes.push((along * cos, along * sin, lift * along, Some(parent)));
        }
    }
    with_radius(&tree_of(&nodes), |_| radius_mm)
}

#[test]
fn a_star_too_thick_to_fit_is_proven_impossible() {
    let thin = laid_flat(&star(20, 100.0, 1.0), WidthsMode::Report);
    assert!(!thin.embedding.widths.are_impossible() && thin.report.warnings.is_empty());

    // 1000 arms: what is picked of each covers at least a seventh of its 200 mm², the disc has 32,044 mm².
    let thick = laid_flat(&star(1000, 100.0, 1.0), WidthsMode::Report);
    let widths = thick.embedding.widths;
    let exact_mm = (1.0 + 0.3 * 0.3_f64).sqrt() * 100.0;
    let disc_mm2 = std::f64::consts::PI * (exact_mm + 1.0) * (exact_mm + 1.0);
    assert!((widths.area_available_mm2 - disc_mm2).abs() < 1e-6 * disc_mm2, "{widths:?}");
    assert!(widths.area_needed_mm2 < 1000.0 * 2.0 * exact_mm);
    assert!(widths.are_impossible(), "{widths:?}");
    let warning =
        thick.report.warnings.iter().find(|warning| warning.code == "W-EMBED-NO-ROOM").expect("said");
    assert!(warning.message.contains(&format!("{:.0} mm²", widths.area_needed_mm2)), "{}", warning.message);
}

#[test]
fn nothing_overlaps_after_stretching() {
    let mut n_overlapping = 0;
    for key in 0..24 {
        let family = key as usize % 8;
        let tree = random_tree(family, 40, 1.0, false, key);
        let thick = with_radius(&tree, |node| 0.3 + 0.02 * node as f64);
        let found = laid_flat(&thick, WidthsMode::Report).embedding;
        let stretched = laid_flat(&thick, WidthsMode::Stretch).embedding;
        let name = FAMILIES[family];
        assert_eq!(stretched.widths.overlaps, 0, "{name} {key}: {:?}", stretched.widths);
        assert!(stretched.certificate.holds() && stretched.widths.mode == WidthMode::Stretch);
        if found.widths.overlaps == 0 {
            assert_eq!(stretched.positions_mm, found.positions_mm, "{name} {key}");
            continue;
        }
        assert!(stretched.widths.length_scale >= 1.0 && stretched.method == "cone-stretch");
        n_overlapping += 1;
        // Both rows are in the table, and the drawn one is the last.
        assert_eq!(stretched.methods.last().expect("rows").method, stretched.method);
        assert!(stretched.methods.iter().any(|row| row.method == "cone" && row.overlaps > 0));
    }
    assert!(n_overlapping > 5, "{n_overlapping}");
}

#[test]
fn avoiding_leaves_fewer_overlaps_and_no_crossings() {
    let (mut n_avoided, mut n_overlapping) = (0, 0);
    for key in 0..16 {
        let tree = random_tree(key as usize % 8, 40, 0.5, false, key);
        let thick = with_radius(&tree, |_| 0.15);
        let found = solved(&thick, WidthsMode::Report).embedding.widths;
        let avoided = solved(&thick, WidthsMode::Avoid).embedding;
        assert!(avoided.certificate.holds(), "tree {key}");
        assert!(avoided.widths.overlaps <= found.overlaps, "tree {key}");
        assert_eq!(avoided.widths.length_scale, 1.0);
        // What gave way is not called optimal, even if what it was made of is.
        let is_lossless = avoided.energy.length + avoided.energy.angle == 0.0;
        assert_eq!(avoided.termination == Termination::Optimal, is_lossless, "tree {key}");
        n_overlapping += usize::from(found.overlaps > 0);
        n_avoided += usize::from(found.overlaps > 0 && avoided.widths.overlaps == 0);
    }
    assert!(2 * n_avoided > n_overlapping && n_overlapping > 2, "{n_avoided} of {n_overlapping}");
}

#[test]
fn what_avoids_overlaps_avoids_them_after_an_edit_too() {
    let (mut n_avoided, mut n_kept) = (0, 0);
    for key in 0..24 {
        let tree = random_tree(key as usize % 8, 40, 1.0, false, key);
        let thick = with_radius(&tree, |_| 0.12);
        let last = thick.branches().list().len() - 1;
        let node = thick.parent(thick.branches().list()[last].nodes.start).expect("it hangs from a node");
        let edits = Edits::new(&thick, vec![Edit { branch: last, node, angle_deg: 12.0 }]).expect("an edit");
        for mode in [WidthsMode::Avoid, WidthsMode::Stretch] {
            let params = Params { methods: Vec::new(), widths: WidthsParams { mode }, ..Params::default() };
            let views = views_along(&thick, DVec3::Z);
            let before = embed(&thick, &views, &params, 0, &|_| {}).expect("a certified layout").embedding;
            let Ok(after) = embed_edited((&thick, &views), &edits, &params, 0, &|_| {}) else { continue };
            let (widths, warnings) = (after.embedding.widths, after.report.warnings);
            let is_told = warnings.iter().any(|warning| warning.code == "W-EMBED-OVERLAPS");
            assert_eq!(is_told, widths.overlaps > 0, "tree {key}: {widths:?}");
            assert!(mode == WidthsMode::Avoid || widths.overlaps == 0, "tree {key}: {widths:?}");
            if before.widths.overlaps == 0 {
                n_avoided += 1;
                n_kept += usize::from(widths.overlaps == 0);
            }
        }
    }
    assert!(n_avoided > 20 && 10 * n_kept >= 9 * n_avoided, "{n_kept} of {n_avoided}");
}
