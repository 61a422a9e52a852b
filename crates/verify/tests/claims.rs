//! What the embedding says of itself holds; what is changed in it does not.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

#[path = "../../embed/tests/common/mod.rs"]
mod common;

use espalier_embed::{Method, Params, PsoParams, TargetMode, WeightRule, embed};
use espalier_model::{Embedding, Phase, Termination, TracePoint, Tree, ViewHierarchy};
use espalier_verify::{
    Claim, Outcome, Rule, Weights, check_compare_table, check_embedding, check_nodes_table,
};
use glam::{DVec2, DVec3};

fn quick() -> Params {
    Params { pso: PsoParams { particles: 12, iterations: 3, ..PsoParams::default() }, ..Params::default() }
}

fn weights(params: &Params) -> Weights {
    let rule = |rule: &WeightRule| Rule {
        generations: rule.generations.map(|[first, last]| (first, last)),
        depth_mm: rule.depth_mm.map(|[least, most]| (least, most)),
        branches: rule.branches.clone(),
        nodes: rule.nodes.clone(),
        length: rule.w_length,
        angle: rule.w_angle,
    };
    Weights {
        length: params.w_length,
        angle: params.w_angle,
        side: params.w_side,
        placement: params.w_placement,
        crossing: None,
        rules: params.weights.iter().map(rule).collect(),
    }
}

fn made(tree: &Tree, params: &Params) -> (ViewHierarchy, Embedding) {
    let views =
        espalier_views::find_views(tree, &espalier_views::Params::default(), 0).expect("views").hierarchy;
    let embedding = embed(tree, &views, params, 0, &|_| {}).expect("an embedding").embedding;
    (views, embedding)
}

/// The names of the claims that do not hold.
fn failures(tree: &Tree, (views, embedding): (&ViewHierarchy, &Embedding), params: &Params) -> Vec<String> {
    let must_be_best = params.method.is_optimiser();
    let weights = weights(params);
    let claim = Claim { tree, views: Some(views), embedding, weights: &weights, must_be_best };
    let mut checks = check_embedding(&claim);
    checks.push(check_nodes_table(&embedding.nodes_tsv(tree), tree, embedding));
    let compare = espalier_model::MethodRow::to_tsv(&embedding.methods);
    checks.push(check_compare_table(&compare, &embedding.methods));
    // The rotation was that of a layout that is not written.
    let may_be = |name: &str| ["never worse", "pose: rotation"].contains(&name);
    let untested = checks.iter().find(|check| check.outcome == Outcome::Untested && !may_be(&check.name));
    assert!(untested.is_none(), "{untested:?}");
    checks
        .iter()
        .filter(|check| check.fails())
        .map(|check| format!("{}: {} | {}", check.name, check.stated, check.found))
        .collect()
}

#[test]
fn whatever_embed_says_holds() {
    let rule = |rule: WeightRule| vec![rule];
    let variants: [Params; 6] = [
        quick(),
        Params { targets: TargetMode::Projected, ..quick() },
        Params { method: Method::Radial, ..quick() },
        Params { w_side: 3.0, w_placement: 1.0, method: Method::Pso, ..quick() },
        Params { w_length: 0.0, w_angle: 0.0, ..quick() },
        Params {
            weights: [
                rule(WeightRule { generations: Some([0, 1]), w_length: Some(9.0), ..WeightRule::default() }),
                rule(WeightRule {
                    depth_mm: Some([0.0, 5.0]),
                    nodes: Some(vec![1, 2, 3]),
                    w_angle: Some(0.5),
                    ..WeightRule::default()
                }),
            ]
            .concat(),
            ..quick()
        },
    ];
    for key in 0..48 {
        let tree =
            common::random_tree(key as usize % 8, 4 + (key as usize * 13) % 60, 1.0, key % 5 == 0, key);
        let params = &variants[key as usize / 8];
        let (views, embedding) = made(&tree, params);
        let failures = failures(&tree, (&views, &embedding), params);
        assert_eq!(failures, Vec::<String>::new(), "key {key}, {params:?}");
    }
}

#[test]
fn small_and_odd_trees() {
    for tree in [
        common::tree_of(&[(1.0, 2.0, 3.0, None)]),
        common::tree_of(&[(0.0, 0.0, 0.0, None), (0.0, 0.0, 1.0, Some(0))]),
        common::tree_of(&[(0.0, 0.0, 0.0, None), (0.0, 0.0, 1.0, Some(0)), (0.0, 0.0, 0.5, Some(1))]),
    ] {
        let (views, embedding) = made(&tree, &quick());
        assert_eq!(failures(&tree, (&views, &embedding), &quick()), Vec::<String>::new());
    }
}

#[test]
fn each_change_is_found_where_it_is() {
    let tree = common::random_tree(0, 60, 0.5, false, 3);
    let (views, embedding) = made(&tree, &quick());
    type Change = fn(&mut Embedding);
    let changes: [(&str, Change); 24] = [
        ("tree", |e| e.tree.replace_range(..1, "x")),
        ("coordinates", |e| e.positions_mm[7].x += 0.3 * e.quantum_mm),
        ("range of exact arithmetic", |e| {
            (e.quantum_mm, e.positions_mm[7].x) = (1e-90, 1e-90);
            e.positions_mm.iter_mut().for_each(|p| *p = p.round());
            e.positions_mm[7].x = 3e-90;
        }),
        ("length ratios", |e| e.positions_mm[7] = -e.positions_mm[7]),
        ("crossings", |e| e.positions_mm[7] = DVec2::ZERO),
        ("certificate", |e| e.certificate.crossings += 1),
        ("certificate's pairs", |e| e.certificate.pairs.push((1, 9))),
        ("target lengths", |e| e.targets.length_mm[5] *= 1.000_001),
        ("target headings", |e| e.targets.heading_rad[5] += 0.001),
        ("target angles", |e| e.targets.angle_rad[5] += 0.001),
        ("length ratios", |e| e.length_ratio[9] += 1e-6),
        ("angle ratios", |e| e.angle_ratio[20] += 1e-6),
        ("energy of placement", |e| e.energy.placement *= 1.001),
        ("row of the result", |e| e.losses.stress += 1e-5),
        ("stress", |e| e.losses.stress += 1e-5),
        ("never worse", |e| {
            let own = e.method.clone();
            let other = e.methods.iter_mut().find(|row| row.method != own && row.crossings == 0);
            other.expect("another method").energy = espalier_model::Energy::default();
        }),
        // Turned by a right angle, and the other side of the sheet.
        ("pose", |e| e.positions_mm.iter_mut().for_each(|p| *p = p.perp())),
        ("pose: side", |e| e.positions_mm.iter_mut().for_each(|p| p.x = -p.x)),
        // A sum of rounded numbers is not always one.
        ("pose: root", |e| e.positions_mm.iter_mut().for_each(|p| p.x = rounded(p.x + 1.0))),
        ("trace", |e| {
            let point = |iteration, energy| TracePoint {
                phase: Phase::Swarm,
                iteration,
                evaluations: 1,
                energy,
                crossings: 0,
            };
            e.trace = vec![point(0, 1.0), point(1, 2.0)];
        }),
        ("widths: overlaps", |e| e.widths.overlaps += 1),
        ("widths: radius scale", |e| e.widths.radius_scale *= 0.999),
        ("widths: length scale", |e| e.widths.length_scale = 1.5),
        ("termination", |e| {
            e.termination = Termination::Optimal;
            e.angle_ratio[20] += 0.1;
            e.energy.angle += 1.0;
        }),
    ];
    for (expected, change) in changes {
        let mut changed = embedding.clone();
        change(&mut changed);
        let found = failures(&tree, (&views, &changed), &quick());
        assert!(found.iter().any(|name| name.starts_with(&format!("{expected}:"))), "{expected}: {found:?}");
    }
}

/// A coordinate as it would be written.
fn rounded(mm: f64) -> f64 {
    format!("{mm:.11}").parse().expect("a number")
}

#[test]
fn tables_are_held_against_the_embedding() {
    let tree = common::random_tree(1, 15, 0.5, false, 4);
    let (_, embedding) = made(&tree, &quick());
    let nodes = embedding.nodes_tsv(&tree);
    let place = nodes.find("\n7\t").expect("node 7") + 5;
    let compare = espalier_model::MethodRow::to_tsv(&embedding.methods);
    for (nodes, compare) in [
        (nodes.replace("u_mm", "v_mm2"), compare.clone()),
        (nodes[..nodes.len() - 20].to_owned(), compare.clone()),
        ([&nodes[..place], "9", &nodes[place..]].concat(), compare.clone()),
        (nodes.clone(), compare.replace("\nradial\t0", "\nradial\t1")),
        (nodes.clone(), compare.lines().take(2).collect()),
    ] {
        let is_sound = !check_nodes_table(&nodes, &tree, &embedding).fails()
            && !check_compare_table(&compare, &embedding.methods).fails();
        assert!(!is_sound);
    }
    assert!(DVec3::ZERO.is_finite() && !check_nodes_table(&nodes, &tree, &embedding).fails());
}
