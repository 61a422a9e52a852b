//! The map against closed forms.

use espalier_geom::math;
use espalier_model::Node;

use super::*;

fn node(x: f64, y: f64, z: f64, parent: Option<usize>) -> Node {
    Node { position_mm: DVec3::new(x, y, z), radius_mm: 2.0, parent, kind: 0 }
}

/// A fork in a tilted plane of space, and the same drawn flat; with bends, by (along, across) of that plane.
fn tilted(points: &[(f64, f64, Option<usize>)]) -> (Tree, Vec<DVec2>, DVec3, DVec3) {
    let right = DVec3::new(0.6, 0.0, 0.8);
    let up = DVec3::new(-0.48, 0.8, 0.36);
    let at = |&(u, v, parent): &(f64, f64, Option<usize>)| Node {
        position_mm: DVec3::new(3.0, -5.0, 7.0) + right * u + up * v,
        radius_mm: 2.0,
        parent,
        kind: 0,
    };
    let nodes: Vec<Node> = points.iter().map(at).collect();
    (
        Tree::new(&nodes).expect("a tree"),
        points.iter().map(|&(u, v, _)| DVec2::new(u, v)).collect(),
        right,
        up,
    )
}

const FLAT: [(f64, f64, Option<usize>); 8] = [
    (0.0, 0.0, None),
    (0.0, -10.0, Some(0)),
    (1.0, -20.0, Some(1)),
    (6.0, -26.0, Some(2)),
    (9.0, -35.0, Some(3)),
    (-5.0, -27.0, Some(2)),
    (-8.0, -36.0, Some(5)),
    (-8.0, -46.0, Some(6)),
];

#[test]
fn of_a_flat_tree_the_map_is_its_plane() {
    let (tree, positions, right, up) = tilted(&FLAT);
    let map = PlanarMap::new(&tree, &positions, DVec3::Y);
    for x in -14..14 {
        for y in -50..5 {
            let point = DVec2::new(f64::from(x) + 0.3, f64::from(y) + 0.1);
            let expected = DVec3::new(3.0, -5.0, 7.0) + right * point.x + up * point.y;
            let edge = map.owner_in_plane(point);
            let there = map.from_plane(edge, point);
            assert!(there.patient_mm.distance(expected) < 1e-9, "{point} {} {expected}", there.patient_mm);
            let back = map.from_patient(edge, there.patient_mm);
            assert!(back.plane_mm.distance(point) < 1e-9 && back.out_of_plane_mm.abs() < 1e-9, "{point}");
            assert_eq!(map.owner_in_patient(there.patient_mm), edge, "{point}");
        }
    }
}

#[test]
fn a_reflected_picture_is_the_same_plane_from_behind() {
    let (tree, positions, right, up) = tilted(&FLAT);
    let mirrored: Vec<DVec2> = positions.iter().map(|p| DVec2::new(-p.x, p.y)).collect();
    let map = PlanarMap::new(&tree, &mirrored, DVec3::Y);
    let there = map.from_plane(2, DVec2::new(1.5, -14.0)).patient_mm;
    let expected = DVec3::new(3.0, -5.0, 7.0) - right * 1.5 - up * 14.0;
    assert!(there.distance(expected) < 1e-9, "{there} {expected}");
}

/// A branch between two forks whose planes are at right angles.
fn twisted() -> (Tree, Vec<DVec2>) {
    let mut nodes =
        vec![node(-8.0, 0.0, 9.0, None), node(0.0, 0.0, 0.0, Some(0)), node(8.0, 0.0, 9.0, Some(1))];
    let mut flat = vec![DVec2::new(-8.0, 9.0), DVec2::ZERO, DVec2::new(8.0, 9.0)];
    for i in 1..=10 {
        nodes.push(node(0.0, 0.0, -3.0 * f64::from(i), Some(if i == 1 { 1 } else { nodes.len() - 1 })));
        flat.push(DVec2::new(0.0, -3.0 * f64::from(i)));
    }
    for side in [-1.0, 1.0] {
        nodes.push(node(0.0, side * 8.0, -39.0, Some(12)));
        flat.push(DVec2::new(side * 8.0, -39.0));
    }
    let (tree, order) = Tree::with_order(&nodes).expect("a tree");
    (tree, order.iter().map(|&old| flat[old]).collect())
}

#[test]
fn between_two_planes_the_twist_is_spread_evenly() {
    let (tree, positions) = twisted();
    let map = PlanarMap::new(&tree, &positions, DVec3::Y);
    let mut last: Option<DVec3> = None;
    // Nearer to the fork the point belongs to one of its arms.
    for i in 2..=58 {
        let along = f64::from(i) * 0.5;
        let point = DVec2::new(1.5, -along);
        let edge = map.owner_in_plane(point);
        let there = map.from_plane(edge, point).patient_mm;
        // From x towards ±y in equal steps: a helix, at the pace of the branch.
        assert!((there.z + along).abs() < 1e-9 && (there.truncate().length() - 1.5).abs() < 1e-9, "{there}");
        let angle = math::atan2(there.y.abs(), there.x).to_degrees();
        assert!((angle - 3.0 * along).abs() < 0.5, "{along} {angle}");
        assert!(last.is_none_or(|last| last.distance(there) < 0.51), "a jump at {there}");
        last = Some(there);
    }
}

#[test]
fn a_carried_frame_does_not_twist_of_itself() {
    // A spiral in space, drawn straight: the smallest rotation from edge to edge leaves no component about the edges.
    let n = 200;
    let helix = |i: usize| {
        let (sin, cos) = math::sin_cos(0.1 * i as f64);
        node(10.0 * cos, 10.0 * sin, 0.3 * i as f64, i.checked_sub(1))
    };
    let tree = Tree::new(&(0..n).map(helix).collect::<Vec<_>>()).expect("a tree");
    let positions: Vec<DVec2> = (0..n).map(|i| DVec2::new(0.0, -1.05 * i as f64)).collect();
    let map = PlanarMap::new(&tree, &positions, DVec3::Z);
    for i in 1..n - 1 {
        let frame = |node: usize, share: f64| map.frame_at(Place { node, share });
        let turn = frame(i, 1.0).inverse() * frame(i + 1, 1.0);
        // About the plane's own downward axis, which lies along the branch.
        assert!(turn.y.abs() < 2e-4, "{i} {turn}");
    }
}

#[test]
fn trees_without_a_plane_have_a_map_all_the_same() {
    for points in [
        vec![node(1.0, 2.0, 3.0, None)],
        vec![node(0.0, 0.0, 0.0, None), node(0.0, 9.0, 0.0, Some(0))],
        // A fork whose branches leave in line, and a fold back.
        vec![
            node(0.0, 0.0, 0.0, None),
            node(0.0, 0.0, -9.0, Some(0)),
            node(0.0, 0.0, -18.0, Some(1)),
            node(0.0, 0.0, -19.0, Some(1)),
        ],
        vec![node(0.0, 0.0, 0.0, None), node(0.0, 0.0, -9.0, Some(0)), node(0.0, 0.0, -1.0, Some(1))],
    ] {
        let tree = Tree::new(&points).expect("a tree");
        let positions: Vec<DVec2> = (0..tree.n_nodes()).map(|i| DVec2::new(0.0, -9.0 * i as f64)).collect();
        let map = PlanarMap::new(&tree, &positions, DVec3::Y);
        for edge in usize::from(tree.n_nodes() > 1)..tree.n_nodes() {
            let there = map.from_plane(edge, DVec2::new(1.0, -4.0));
            assert!(there.patient_mm.is_finite(), "{there:?}");
            let share = map.frame_at(there.place);
            assert!((share.length() - 1.0).abs() < 1e-9);
        }
        let here = tree.position_mm(0);
        assert_eq!(map.from_patient(map.owner_in_patient(here), here).plane_mm, DVec2::ZERO);
    }
}

#[test]
fn inside_of_two_tubes_it_is_the_one_that_is_seen() {
    assert!(reach(3.0, 9.0) < reach(1.0, 2.0), "deep in the wide one");
    assert!(reach(8.9, 9.0) > reach(0.0, 2.0), "at the rim of the wide one");
    assert!(reach(2.0, 2.0).abs() < 1e-12 && reach(3.0, 2.0) > 0.9);
}
