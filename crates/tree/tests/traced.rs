//! Traced structures: roots, duplicates, radii, and resampling.

use espalier_geom::random::{Purpose, Stream};
use espalier_model::diagnose::Class;
use espalier_model::swc::{Traced, TracedNode};
use espalier_model::{Diagnose, LedgerKind};
use espalier_tree::{Built, Error, MissingRadii, Params, Resample, Roots, from_traced};
use glam::DVec3;

/// Nodes on the x axis and off it: (x, y, radius, parent).
fn traced(nodes: &[(f64, f64, f64, Option<usize>)]) -> Traced {
    let node = |(i, &(x, y, radius_mm, parent)): (usize, &(f64, f64, f64, Option<usize>))| TracedNode {
        id: 10 + i as i64,
        kind: 3,
        position_mm: DVec3::new(x, y, 0.0),
        radius_mm,
        parent,
        line: 1 + i,
    };
    Traced { nodes: nodes.iter().enumerate().map(node).collect() }
}

/// A main tree of length 4, an island of length 1 whose root comes first in the file.
fn two_roots() -> Traced {
    traced(&[
        (9.0, 1.0, 1.0, None),
        (0.0, 0.0, 1.0, None),
        (2.0, 0.0, 1.0, Some(1)),
        (4.0, 0.0, 1.0, Some(2)),
        (9.0, 2.0, 1.0, Some(0)),
    ])
}

#[test]
fn nodes_stay_as_annotated() {
    let chain = traced(&[(0.0, 0.0, 1.0, None), (1.0, 0.0, 1.0, Some(0)), (2.0, 0.0, 1.0, Some(1))]);
    let built = from_traced(&chain, &Params::default()).expect("a tree");
    assert_eq!(built.tree.n_nodes(), 3);
    assert!(built.ledger.0.is_empty());
    assert_eq!(built.tree.nodes()[1].kind, 3);
    let shape = Params { resample: Resample::Shape, ..Params::default() };
    assert_eq!(from_traced(&chain, &shape).expect("a tree").tree.n_nodes(), 2);
    let step = Params { resample: Resample::Step, step_mm: 0.25, ..Params::default() };
    let fine = from_traced(&chain, &step).expect("a tree").tree;
    assert_eq!(fine.n_nodes(), 9);
    assert!((1..9).all(|node| (fine.edge_length_mm(node) - 0.25).abs() < 1e-12));
}

#[test]
fn shape_keeps_corners_and_steps_of_radius() {
    let corner = traced(&[
        (0.0, 0.0, 1.0, None),
        (5.0, 0.0, 1.0, Some(0)),
        (10.0, 0.05, 1.0, Some(1)),
        (10.0, 5.0, 1.0, Some(2)),
        (10.0, 10.0, 2.0, Some(3)),
        (10.0, 15.0, 1.0, Some(4)),
    ]);
    let shape = Params { resample: Resample::Shape, ..Params::default() };
    let tree = from_traced(&corner, &shape).expect("a tree").tree;
    // The second node errs by 0.025 mm, below a tenth of the radius.
    let x_y: Vec<_> = tree.nodes().iter().map(|n| (n.position_mm.x, n.position_mm.y)).collect();
    assert_eq!(x_y, [(0.0, 0.0), (10.0, 0.05), (10.0, 5.0), (10.0, 10.0), (10.0, 15.0)]);
}

/// A branch out to x = 2 µm and back.
fn fold_back(radius_mm: f64) -> Traced {
    let way = [0.0, 0.001, 0.002, 0.001, 0.0];
    let node = |(i, x): (usize, f64)| (x, 0.0, radius_mm, i.checked_sub(1));
    traced(&way.into_iter().enumerate().map(node).collect::<Vec<_>>())
}

#[test]
fn a_branch_that_comes_back_keeps_its_turn_and_no_edge_without_length() {
    let xs = |built: &Built| built.tree.nodes().iter().map(|n| n.position_mm.x).collect::<Vec<_>>();
    let resampled = |resample, step_mm, radius_mm| {
        let params = Params { resample, step_mm, ..Params::default() };
        from_traced(&fold_back(radius_mm), &params).expect("a tree")
    };
    // Steps of 4/3 µm put two samples at one place on the way out and the way back.
    let thirds = resampled(Resample::Step, 0.001_333_3, 1e-4);
    assert_eq!((thirds.tree.n_nodes(), thirds.ledger.n_of(LedgerKind::NodesMerged)), (3, 1));
    assert!(thirds.ledger.0[0].length_mm < 1e-12 && xs(&thirds)[1] > 0.001_333);
    // One step, or a radius beside which the way is nothing: only the ends would be left, at one place.
    for built in [resampled(Resample::Step, 1.0, 1e-4), resampled(Resample::Shape, 1.0, 1.0)] {
        assert_eq!(xs(&built), [0.0, 0.002, 0.0]);
        assert!(built.ledger.0.is_empty());
    }
    let kept = resampled(Resample::None, 1.0, 1.0);
    assert_eq!((kept.tree.n_nodes(), kept.ledger.0.len()), (5, 0));
}

#[test]
fn random_walks_on_a_lattice_have_no_edge_without_length() {
    let mut stream = Stream::new(1, Purpose::Test, 0, 0);
    for _ in 0..200 {
        let n_nodes = 2 + stream.below(30) as usize;
        let mut nodes = vec![(0.0, 0.0, 0.1, None)];
        for i in 1..n_nodes {
            let parent = i - 1 - stream.below(2.min(i as u32)) as usize;
            let (x, y, ..) = nodes[parent];
            let step = if stream.below(2) == 0 { 1.0 } else { -1.0 };
            let (dx, dy) = if stream.below(2) == 0 { (step, 0.0) } else { (0.0, step) };
            nodes.push((x + dx, y + dy, stream.uniform(0.0, 30.0), Some(parent)));
        }
        for resample in [Resample::Step, Resample::Shape] {
            for step_mm in [0.25, 0.7, 4.0 / 3.0, 2.0, 100.0] {
                let params = Params { resample, step_mm, ..Params::default() };
                let tree = from_traced(&traced(&nodes), &params).expect("a tree").tree;
                let least_mm = 1e-7 * tree.extent_mm();
                assert!((1..tree.n_nodes()).all(|node| tree.edge_length_mm(node) > least_mm), "{nodes:?}");
            }
        }
    }
}

#[test]
fn the_smallest_structures_are_trees() {
    let point = [(1.0, 1.0, 2.0, None)];
    let edge = [(1.0, 1.0, 2.0, None), (1.0, 1.001, 2.0, Some(0))];
    let one_place = [(1.0, 1.0, 2.0, None), (1.0, 1.0, 2.0, Some(0)), (1.0, 1.0, 3.0, Some(0))];
    for resample in [Resample::Auto, Resample::Shape, Resample::Step, Resample::None] {
        let params = Params { resample, ..Params::default() };
        let n_nodes = |nodes: &[_]| from_traced(&traced(nodes), &params).expect("a tree").tree.n_nodes();
        assert_eq!((n_nodes(&point), n_nodes(&edge), n_nodes(&one_place)), (1, 2, 1), "{resample:?}");
    }
}

#[test]
fn a_tiny_step_does_not_eat_the_memory() {
    let star: Vec<_> = (0..50).map(|i| (f64::from(i), 1.0, 1.0, (i > 0).then_some(0))).collect();
    let params = Params { resample: Resample::Step, step_mm: 1e-9, ..Params::default() };
    let n_nodes = from_traced(&traced(&star), &params).expect("a tree").tree.n_nodes();
    assert!((900_000..1_100_000).contains(&n_nodes), "{n_nodes}");
}

#[test]
fn several_roots_by_policy() {
    let largest = from_traced(&two_roots(), &Params::default()).expect("a tree");
    assert_eq!(largest.tree.n_nodes(), 3);
    let entry = &largest.ledger.0[0];
    assert_eq!((entry.kind, entry.length_mm), (LedgerKind::RootResolved, 1.0));
    assert_eq!(largest.report.get("traced_roots"), Some(2.0));

    let join = Params { roots: Roots::Join, ..Params::default() };
    let joined = from_traced(&two_roots(), &join).expect("a tree");
    assert_eq!((joined.tree.n_nodes(), joined.tree.n_tips()), (5, 1));
    assert!((joined.tree.length_mm() - (5.0 + 26.0_f64.sqrt())).abs() < 1e-12);

    let refuse = Params { roots: Roots::Refuse, ..Params::default() };
    let error = from_traced(&two_roots(), &refuse).expect_err("two roots");
    assert!(matches!(error, Error::Roots { n_roots: 2, first_id: 10, second_line: 2, .. }), "{error}");
    assert_eq!(error.class(), Class::Topology);
}

#[test]
fn edges_without_length_collapse() {
    let doubled = traced(&[
        (0.0, 0.0, 1.0, None),
        (0.0, 0.0, 2.0, Some(0)),
        (1.0, 0.0, 1.0, Some(1)),
        (1.0 + 1e-9, 0.0, 1.0, Some(2)),
        (2.0, 0.0, 1.0, Some(3)),
        (1.0, 1.0, 1.0, Some(3)),
    ]);
    let built = from_traced(&doubled, &Params::default()).expect("a tree");
    assert_eq!(built.tree.n_nodes(), 4);
    assert_eq!(built.ledger.n_of(LedgerKind::NodesMerged), 2);
    assert_eq!(built.tree.nodes()[0].radius_mm, 2.0);

    let everything_at_one_place = traced(&[(1.0, 1.0, 0.0, None), (1.0, 1.0, 3.0, Some(0))]);
    assert_eq!(from_traced(&everything_at_one_place, &Params::default()).expect("a tree").tree.n_nodes(), 1);
}

#[test]
fn missing_radii_come_from_neighbours() {
    let nodes = [
        (0.0, 0.0, 0.0, None),
        (1.0, 0.0, 2.0, Some(0)),
        (2.0, 0.0, 0.0, Some(1)),
        (3.0, 0.0, 4.0, Some(2)),
        (4.0, 0.0, 0.0, Some(3)),
    ];
    let built = from_traced(&traced(&nodes), &Params::default()).expect("a tree");
    let radii: Vec<f64> = built.tree.nodes().iter().map(|n| n.radius_mm).collect();
    assert_eq!(radii, [2.0, 2.0, 3.0, 4.0, 4.0]);
    assert_eq!(built.ledger.n_of(LedgerKind::RadiusRepaired), 3);

    let keep = Params { missing_radii: MissingRadii::Keep, ..Params::default() };
    let kept = from_traced(&traced(&nodes), &keep).expect("a tree");
    assert_eq!(kept.tree.nodes()[2].radius_mm, 0.0);
    assert_eq!(kept.report.warnings[0].code, "W-TREE-NO-RADIUS");

    let unmeasured = traced(&nodes.map(|(x, y, _, parent)| (x, y, 0.0, parent)));
    let built = from_traced(&unmeasured, &Params::default()).expect("a tree");
    assert!(built.ledger.0.is_empty() && built.report.warnings.len() == 1);
}

#[test]
fn no_nodes_is_an_error() {
    let error = from_traced(&Traced::default(), &Params::default()).expect_err("nothing");
    assert_eq!((error.clone(), error.class()), (Error::EmptyTrace, Class::Input));
}

#[test]
fn deep_chains_and_wide_stars_need_no_stack() {
    let n = 100_000;
    let chain: Vec<_> = (0..n).map(|i: usize| (i as f64, (i % 7) as f64, 1.0, i.checked_sub(1))).collect();
    let shape = Params { resample: Resample::Shape, ..Params::default() };
    let tree = from_traced(&traced(&chain), &shape).expect("a tree").tree;
    assert!(tree.n_nodes() > n / 4);
    let star: Vec<_> = (0..n).map(|i| (i as f64, 1.0, 1.0, if i == 0 { None } else { Some(0) })).collect();
    assert_eq!(from_traced(&traced(&star), &Params::default()).expect("a tree").tree.n_tips(), n - 1);
}
