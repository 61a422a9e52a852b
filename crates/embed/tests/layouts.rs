//! The whole stage on random trees: what it promises, for every tree.

#![allow(clippy::expect_used, reason = "a test that cannot go on says why")]

mod common;

use common::{random_tree, tree_of, views_along};
use espalier_embed::{
    CrossingWeight, Embedded, Error, Freedom, MarinoParams, Method, Params, PoseMode, PsoParams, Pull,
    SolverParams, Start, TargetMode, certify, embed,
};
use espalier_model::diagnose::{Class, Diagnose};
use espalier_model::{Comparison, Embedding, MethodRow, Termination, Tree, compare_columns};
use glam::{DVec2, DVec3};

fn with_pso(pso: PsoParams) -> Params {
    Params { pso, ..Params::default() }
}

fn with_marino(towards_camera: [f64; 3], up: [f64; 3]) -> Params {
    Params { marino: MarinoParams { towards_camera, up, ..MarinoParams::default() }, ..Params::default() }
}

fn small() -> Params {
    let solver = SolverParams { effort: 0.02, ..SolverParams::default() };
    Params { solver, ..with_pso(PsoParams { particles: 24, iterations: 8, ..PsoParams::default() }) }
}

fn laid_flat(tree: &Tree, params: &Params) -> Embedded {
    embed(tree, &views_along(tree, DVec3::Z), params, 7, &|_| {}).expect("a certified layout")
}

#[test]
fn the_result_is_certified_and_never_worse() {
    let mut n_improved = 0;
    for key in 0..96 {
        let tree = random_tree(key as usize % 8, 10 + key as usize, 2.0, false, key);
        let (freedom, pull, start) = match key % 4 {
            0 => (Freedom::S, Pull::Uniform, Start::Paper),
            1 => (Freedom::B, Pull::Subtree, Start::Relaxed),
            2 => (Freedom::N, Pull::Uniform, Start::Relaxed),
            _ => (Freedom::N, Pull::Subtree, Start::Relaxed),
        };
        let mut params = Params { pso: PsoParams { freedom, pull, start, ..small().pso }, ..small() };
        params.solver.mirrors = key % 3 == 0;
        let embedding = laid_flat(&tree, &params).embedding;
        assert!(embedding.certificate.holds());
        let energy = embedding.energy.total();
        for row in &embedding.methods {
            // A second swarm has the sides that the planes show, where others were searched.
            let is_same = row.targets == embedding.targets.kind;
            assert!(is_same || (row.method.starts_with("pso") && params.solver.mirrors));
            let is_constructed = ["radial", "cone", "marino"].contains(&row.method.as_str());
            assert!(!is_constructed || row.crossings == 0, "{} of tree {key}", row.method);
            assert!(
                !is_same || row.crossings > 0 || energy <= row.energy.total() + 1e-12,
                "{} of tree {key}",
                row.method
            );
        }
        // Nor worse than what each constructive method gives when it runs alone, where the targets are the same.
        for method in
            [Method::Radial, Method::Cone, Method::Marino].into_iter().filter(|_| !params.solver.mirrors)
        {
            let params = Params { method, methods: Vec::new(), ..params.clone() };
            let alone = laid_flat(&tree, &params).embedding;
            assert_eq!(alone.method, method.name());
            assert!(energy <= alone.energy.total() + 1e-12, "{} of tree {key} alone", alone.method);
        }
        assert_eq!(certify(&tree, &embedding.positions_mm), embedding.certificate);
        let constructed = embedding.methods[1].energy.total().min(embedding.methods[2].energy.total());
        n_improved += usize::from(energy < constructed);
        let energies: Vec<f64> = embedding.trace.iter().map(|point| point.energy).collect();
        assert!(energies.windows(2).all(|pair| pair[1] <= pair[0]), "{energies:?}");
    }
    assert!(n_improved > 70, "{n_improved}");
}

#[test]
fn planar_trees_come_out_exactly() {
    let mut n_planar = 0;
    for key in 0..200 {
        let tree = random_tree(key as usize % 8, 4 + key as usize % 12, 1.0, true, key);
        let embedded = laid_flat(&tree, &Params { method: Method::Pso, ..small() });
        let embedding = &embedded.embedding;
        let projection = &embedding.methods[0];
        if projection.crossings > 0 || !has_wide_angles(&tree) {
            continue;
        }
        n_planar += 1;
        // Projection and swarm are equally good: the method asked for is used, and nothing is said.
        assert!(embedding.method.starts_with("pso"), "tree {key}: {}", embedding.method);
        assert!(embedded.report.warnings.is_empty(), "tree {key}: {:?}", embedded.report.warnings);
        // The plane is its own best layout: every distance is kept.
        assert!(projection.energy.total() < 1e-20, "tree {key}: {:?}", projection.energy);
        assert_eq!(embedding.termination, Termination::Optimal, "tree {key}");
        assert_eq!(embedding.energy.length + embedding.energy.angle + embedding.energy.crossing, 0.0);
        assert!(embedding.losses.stress < 1e-9 && embedding.losses.angle3d_error_max_deg < 1e-6);
        // In the pose of the view, so it lies where the view shows it.
        for (node, flat) in embedding.positions_mm.iter().enumerate() {
            let seen = tree.position_mm(node) - tree.position_mm(0);
            assert!(flat.distance(DVec2::new(seen.x, seen.y)) < 1e-9, "tree {key}, node {node}");
        }
    }
    assert!(n_planar > 50, "{n_planar}");
}

/// Whether no target has to move for siblings that are too near, or edges that fold back.
fn has_wide_angles(tree: &Tree) -> bool {
    let heading = |node: usize, hub: usize| {
        let edge = tree.position_mm(node) - tree.position_mm(hub);
        espalier_geom::angle::heading(DVec2::new(edge.x, edge.y))
    };
    (0..tree.n_nodes()).all(|hub| {
        let mut around: Vec<f64> = tree.children(hub).iter().map(|&child| heading(child, hub)).collect();
        around.extend(tree.parent(hub).map(|parent| heading(parent, hub)));
        around.sort_by(f64::total_cmp);
        let gaps = around.windows(2).map(|pair| pair[1] - pair[0]);
        gaps.chain(around.first().map(|first| first + std::f64::consts::TAU - around[around.len() - 1]))
            .all(|gap| gap > 0.06)
    })
}

#[test]
fn same_bytes_for_any_number_of_threads() {
    let tree = random_tree(0, 120, 1.0, false, 5);
    let with_threads = |n_threads: usize, params: &Params| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("a pool");
        pool.install(|| laid_flat(&tree, params).embedding.to_json())
    };
    for params in [
        small(),
        Params { pso: PsoParams { particles: 60, iterations: 5, ..PsoParams::paper() }, ..Params::paper() },
    ] {
        let one = with_threads(1, &params);
        assert_eq!(one, with_threads(2, &params));
        assert_eq!(one, with_threads(3, &params));
    }
}

#[test]
fn the_seed_matters_and_is_kept() {
    let tree = random_tree(0, 120, 1.0, false, 5);
    let views = views_along(&tree, DVec3::Z);
    let params = Params { method: Method::Pso, methods: Vec::new(), ..small() };
    let with_seed = |seed: u64| embed(&tree, &views, &params, seed, &|_| {}).expect("a layout").embedding;
    let (one, other) = (with_seed(1), with_seed(2));
    assert_eq!((one.seed, other.seed), (1, 2));
    assert_ne!(one.positions_mm, other.positions_mm);
}

#[test]
fn the_smallest_trees() {
    let single = laid_flat(&tree_of(&[(5.0, 5.0, 5.0, None)]), &small()).embedding;
    assert_eq!(single.positions_mm, [DVec2::ZERO]);
    assert_eq!(single.termination, Termination::Optimal);

    let pair = laid_flat(&tree_of(&[(0.0, 0.0, 0.0, None), (0.0, 3.0, 0.0, Some(0))]), &small()).embedding;
    assert_eq!(pair.positions_mm[1], DVec2::new(0.0, 3.0));
    assert_eq!(pair.energy.total(), 0.0);

    // Seen end-on: no heading is known, the length still is.
    let end_on = laid_flat(&tree_of(&[(0.0, 0.0, 0.0, None), (0.0, 0.0, 3.0, Some(0))]), &small()).embedding;
    assert!((end_on.positions_mm[1].length() - 3.0).abs() < 1e-11);
}

#[test]
fn deep_chains_need_no_stack() {
    let nodes: Vec<_> = (0..50_000_usize)
        .map(|i| (i as f64, f64::from(i as u32 % 2), f64::from(i as u32 % 3), i.checked_sub(1)))
        .collect();
    let params = Params { method: Method::Cone, methods: vec![Method::Radial], ..small() };
    let embedding = laid_flat(&tree_of(&nodes), &params).embedding;
    assert_eq!(embedding.method, "cone");
    assert!(embedding.certificate.holds());
}

#[test]
fn a_constructive_method_is_used_as_asked() {
    // Two arms that cross in the view but not in space.
    let crossing = tree_of(&[
        (0.0, 0.0, 0.0, None),
        (1.0, 0.0, 0.0, Some(0)),
        (3.0, 2.0, 1.0, Some(1)),
        (3.0, -2.0, 1.0, Some(2)),
        (2.0, -1.0, -1.0, Some(1)),
        (4.0, 1.0, -1.0, Some(4)),
    ]);
    for method in [Method::Radial, Method::Cone] {
        let params = Params { method, methods: Vec::new(), ..small() };
        let embedded = laid_flat(&crossing, &params);
        assert_eq!(embedded.embedding.method, method.name());
        assert_eq!(embedded.embedding.termination, Termination::Constructed);
        assert!(embedded.report.warnings.is_empty());
    }
    let params = Params { method: Method::Projection, methods: Vec::new(), ..small() };
    let embedded = laid_flat(&crossing, &params);
    assert_eq!(embedded.embedding.methods[0].crossings, 1);
    assert_ne!(embedded.embedding.method, "projection");
    assert_eq!(embedded.report.warnings[0].code, "W-EMBED-OTHER-METHOD");
    assert!(embedded.report.warnings[0].message.contains("projection has 1 crossings"));
}

#[test]
fn overlaps_are_those_of_thick_tubes() {
    let two_arms = |radius_mm: f64| {
        let mut nodes = tree_of(&[
            (0.0, 0.0, 0.0, None),
            (0.0, 10.0, 0.0, Some(0)),
            (10.0, 10.0, 0.0, Some(1)),
            (10.0, 1.0, 0.0, Some(2)),
            (1.0, 1.0, 0.0, Some(3)),
        ])
        .nodes()
        .to_vec();
        for node in &mut nodes {
            node.radius_mm = radius_mm;
        }
        let tree = Tree::new(&nodes).expect("a tree");
        laid_flat(&tree, &small()).embedding.methods[0].overlaps
    };
    // A spiral whose tip comes within 1 mm of its first edge: tubes of 0.4 mm pass, tubes of 0.6 mm meet there.
    assert_eq!(two_arms(0.4), 0);
    assert_eq!(two_arms(0.6), 1);
}

#[test]
fn json_and_tables() {
    let tree = random_tree(0, 60, 2.0, false, 3);
    let Embedded { embedding, comparison, .. } = laid_flat(&tree, &small());
    // All layouts are there, the embedding among them, and the digest of what they were scored against.
    assert_eq!(Comparison::from_json(&comparison.to_json(), &tree).expect("our own file"), comparison);
    assert_eq!(comparison.targets, embedding.targets.digest());
    let rows: Vec<MethodRow> = comparison.layouts.iter().map(|layout| layout.row.clone()).collect();
    assert_eq!(rows, embedding.methods);
    let chosen = &comparison.layouts[comparison.chosen];
    assert_eq!((&chosen.row.method, &chosen.positions_mm), (&embedding.method, &embedding.positions_mm));
    for layout in &comparison.layouts {
        assert_eq!(certify(&tree, &layout.positions_mm).crossings, layout.row.crossings);
    }
    let json = embedding.to_json();
    let back = Embedding::from_json(&json, &tree).expect("our own file");
    assert_eq!(back.to_json(), json);
    assert_eq!(back.positions_mm, embedding.positions_mm);
    assert!(json.starts_with("{\"format\":\"espalier-embedding\",\"version\":3,"));

    let smaller = random_tree(0, 59, 2.0, false, 3);
    let error = Embedding::from_json(&json, &smaller).expect_err("another tree");
    assert!(error.to_string().contains("made for another tree"), "{error}");
    let x = format!("{:?}", embedding.positions_mm[1].x);
    let off = json.replacen(&x, &format!("{x}00001"), 1);
    assert!(Embedding::from_json(&off, &tree).expect_err("not rounded").to_string().contains("not rounded"));
    assert!(Embedding::from_json(&json.replacen("version\":3", "version\":4", 1), &tree).is_err());

    let nodes = embedding.nodes_tsv(&tree);
    let lines: Vec<&str> = nodes.lines().collect();
    assert_eq!(lines.len(), 61);
    assert!(
        lines[0].starts_with("node\tparent\tx_mm\ty_mm\tz_mm\tradius_mm\tu_mm\tv_mm\tbranch\tgeneration")
    );
    for (line, position) in lines[1..].iter().zip(&embedding.positions_mm) {
        let cells: Vec<&str> = line.split('\t').collect();
        assert_eq!(cells[6].parse(), Ok(position.x), "the table holds the very number");
        assert_eq!(cells[7].parse(), Ok(position.y));
    }
    let compare = MethodRow::to_tsv(&embedding.methods);
    let lines: Vec<&str> = compare.lines().collect();
    assert_eq!(lines.len(), embedding.methods.len() + 1);
    assert_eq!(lines[0].split('\t').count(), compare_columns().len());
    assert!(lines[4].starts_with("marino\t0\t"), "{compare}");
    assert!(lines[5].starts_with("pso 24x8 n\t0\t"), "{compare}");
}

#[test]
fn bad_input_is_named() {
    let tree = random_tree(1, 30, 1.0, false, 3);
    let mut views = views_along(&tree, DVec3::Z);
    views.chains.pop();
    let error = embed(&tree, &views, &small(), 0, &|_| {}).expect_err("a plane is missing");
    assert!(matches!(error, Error::Views { .. }), "{error}");

    let other = random_tree(1, 30, 1.0, false, 4);
    let error =
        embed(&other, &views_along(&tree, DVec3::Z), &small(), 0, &|_| {}).expect_err("views of another");
    assert_eq!((&error, error.class()), (&Error::OtherTree, Class::Input));

    let views = views_along(&tree, DVec3::Z);
    let error_of = |params: Params| embed(&tree, &views, &params, 0, &|_| {}).expect_err("a bad parameter");
    for (params, key) in [
        (with_pso(PsoParams { particles: 2, ..small().pso }), "pso.particles"),
        (Params { w_angle: f64::NAN, ..small() }, "w_angle"),
        (with_pso(PsoParams { omega_g: -0.1, ..small().pso }), "pso.omega_g"),
        (Params { w_crossing: CrossingWeight::Fixed(0.0), ..small() }, "w_crossing"),
        (with_pso(PsoParams { memory_mib: 0, ..small().pso }), "pso.memory_mib"),
        (with_marino([0.0; 3], [0.0, 0.0, 1.0]), "marino.towards_camera"),
        (with_marino([0.0, 1.0, 0.0], [0.0, f64::NAN, 1.0]), "marino.up"),
        (with_marino([0.0, 1.0, 0.0], [0.0, -2.0, 0.0]), "marino.up"),
    ] {
        let error = error_of(params);
        assert_eq!(error.class(), Class::Usage);
        assert!(matches!(&error, Error::Param(param) if param.key == key), "{error}");
    }
    let huge = with_pso(PsoParams { particles: 1_000_000, memory_mib: 64, ..small().pso });
    assert_eq!(error_of(huge).class(), Class::Limit);

    // Lengths over sixteen decades: the shortest vanish in twelve digits.
    let nodes: Vec<_> = (0..20_usize)
        .map(|i| (if i == 0 { 1e9 } else { 1e-7 * i as f64 }, i as f64 * 1e-7, 0.0, i.checked_sub(1)))
        .collect();
    let tree = tree_of(&nodes);
    let error =
        embed(&tree, &views_along(&tree, DVec3::Z), &small(), 0, &|_| {}).expect_err("rounds to nothing");
    assert_eq!(error.class(), Class::Uncertified);
}

#[test]
fn params_read_and_write() {
    let written = serde_json::to_string(&Params::paper()).expect("plain numbers");
    assert!(written.contains("\"targets\":\"projected\"") && written.contains("\"w_crossing\":\"auto\""));
    assert_eq!(serde_json::from_str::<Params>(&written).expect("the same"), Params::paper());
    let set: Params = serde_json::from_str("{\"w_crossing\": 3, \"methods\": [\"radial\"]}").expect("legal");
    assert_eq!(set.w_crossing, CrossingWeight::Fixed(3.0));
    assert_eq!(set.methods, [Method::Radial]);
    let set: Params = serde_json::from_str("{\"pose\": \"root-on-top\"}").expect("legal");
    assert_eq!(set.pose, PoseMode::RootOnTop);
    let error = serde_json::from_str::<Params>("{\"w_crossing\": \"cheap\"}").expect_err("not auto");
    assert!(error.to_string().contains("expected \"auto\" or a number"), "{error}");
    assert!(serde_json::from_str::<Params>("{\"particels\": 3}").is_err());
    Params::paper().validate().expect("the paper's values are legal");
    assert_eq!(Params::paper().targets, TargetMode::Projected);
}

#[test]
fn absurd_radii_cost_no_more_than_their_limit() {
    let mut nodes = random_tree(7, 7000, 0.0, false, 4).nodes().to_vec();
    for node in &mut nodes {
        node.radius_mm = 1e4;
    }
    let params = Params { method: Method::Cone, methods: Vec::new(), ..small() };
    let embedded = laid_flat(&Tree::new(&nodes).expect("a tree"), &params);
    assert_eq!(embedded.report.warnings[0].code, "W-EMBED-THICK-TUBES");
    assert!(embedded.report.warnings[0].message.contains("the mean radius is 10000 mm, the median edge 1"));
}
