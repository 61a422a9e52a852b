//! Which branch a voxel belongs to: tubes that touch, slabs across a gap, islands.
#![allow(clippy::expect_used, reason = "helpers of tests only")]

use espalier_geom::space::{distance_to_segment, nearest_parameter};
use espalier_model::{Grid, Mask, Node, Tree};
use espalier_tree::branch_voxels;
use glam::{DAffine3, DMat3, DVec3};

fn node(position: [f64; 3], radius_mm: f64, parent: Option<usize>) -> Node {
    Node { position_mm: DVec3::from_array(position), radius_mm, parent, kind: 0 }
}

fn grid(shape: [usize; 3]) -> Grid {
    Grid::axis_aligned(shape, DVec3::ONE, DVec3::ZERO).expect("a grid")
}

fn center(grid: &Grid, voxel: [usize; 3]) -> DVec3 {
    grid.world_from_voxel().transform_point3(DVec3::from_array(voxel.map(|coordinate| coordinate as f64)))
}

/// The voxels whose centres lie in the round cones of a tree; a branch begins with its own radius.
fn body(tree: &Tree, grid: &Grid) -> Mask {
    let cone = |(node, parent): (usize, usize)| {
        let (a, b) = (tree.position_mm(parent), tree.position_mm(node));
        let end = tree.nodes()[node].radius_mm;
        let start = if tree.children(parent).len() > 1 { end } else { tree.nodes()[parent].radius_mm };
        (a, b, start, end)
    };
    let cones: Vec<_> = tree.edges().map(cone).collect();
    Mask::from_fn(grid.clone(), |voxel| {
        let point = center(grid, voxel);
        cones.iter().any(|&(a, b, start, end)| {
            let share = nearest_parameter(point, a, b);
            distance_to_segment(point, a, b) <= start + share * (end - start)
        })
    })
}

/// A trunk of radius 6 up z, a daughter straight on, and one of radius 2 that leaves, turns, and runs along the other's
/// wall.
fn touching() -> (Tree, Mask) {
    let nodes = [
        node([20.0, 20.0, 8.0], 6.0, None),
        node([20.0, 20.0, 30.0], 6.0, Some(0)),
        node([20.0, 20.0, 90.0], 6.0, Some(1)),
        node([32.0, 20.0, 42.0], 2.0, Some(1)),
        node([28.0, 20.0, 50.0], 2.0, Some(3)),
        node([28.0, 20.0, 90.0], 2.0, Some(4)),
    ];
    let tree = Tree::new(&nodes).expect("a tree");
    let mask = body(&tree, &grid([44, 40, 100]));
    (tree, mask)
}

#[test]
fn tubes_that_touch_keep_their_voxels() {
    let (tree, mask) = touching();
    let values = branch_voxels(&mask, &tree);
    assert_eq!(values.len(), mask.n_foreground());
    assert!(values.iter().all(|value| (1..=3).contains(value)));
    for (voxel, value) in mask.voxels().zip(&values) {
        let point = center(mask.grid(), voxel);
        if !(52.0..88.0).contains(&point.z) {
            continue;
        }
        let to_axis = |x: f64| (point - DVec3::new(x, 20.0, point.z)).length();
        // Clearly inside of one tube, by half a voxel.
        if to_axis(20.0) < 5.5 {
            assert_eq!(*value, 2, "{voxel:?}");
        } else if to_axis(28.0) < 1.5 {
            assert_eq!(*value, 3, "{voxel:?}");
        }
    }
}

#[test]
fn branches_meet_at_the_fork_and_each_is_one_piece() {
    let (tree, mask) = touching();
    let values = branch_voxels(&mask, &tree);
    let of = |wanted: u32| {
        let mut own = Mask::empty(mask.grid().clone());
        let voxels = mask.voxels().zip(&values).filter(|(_, value)| **value == wanted);
        voxels.for_each(|(voxel, _)| own.bits_mut().set(voxel));
        own
    };
    assert!(of(1).contains([20, 20, 29]) && of(2).contains([20, 20, 32]) && of(1).contains([25, 20, 29]));
    for branch in 1..=3 {
        assert_eq!(n_pieces(&of(branch)), 1, "branch {branch}");
    }
}

/// Pieces by faces, edges and corners.
fn n_pieces(mask: &Mask) -> usize {
    let mut rest = mask.clone();
    let mut n_pieces = 0;
    loop {
        let Some(first) = rest.voxels().next() else { return n_pieces };
        n_pieces += 1;
        let mut stack = vec![first.map(|coordinate| coordinate as i64)];
        while let Some(voxel) = stack.pop() {
            if !rest.contains(voxel) {
                continue;
            }
            rest.bits_mut().clear(voxel.map(|coordinate| coordinate as usize));
            let steps = (0..27).map(|code| [code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1]);
            stack.extend(steps.map(|step| [0, 1, 2].map(|axis| voxel[axis] + step[axis])));
        }
    }
}

#[test]
fn nothing_leaks_across_a_gap() {
    // A slab whose inscribed spheres are far narrower than it is wide, and a tube along its far edge, 2 voxels away.
    let nodes = [
        node([5.0, 5.0, 2.0], 2.0, None),
        node([5.0, 5.0, 6.0], 2.0, Some(0)),
        node([5.0, 5.0, 60.0], 2.0, Some(1)),
        node([36.0, 5.0, 6.0], 2.0, Some(1)),
        node([36.0, 5.0, 60.0], 2.0, Some(3)),
    ];
    let tree = Tree::new(&nodes).expect("a tree");
    let grid = grid([45, 12, 66]);
    let tubes = body(&tree, &grid);
    let is_slab =
        |[x, y, z]: [usize; 3]| (5..=30).contains(&x) && (3..=7).contains(&y) && (20..=60).contains(&z);
    let mask = Mask::from_fn(grid, |voxel| is_slab(voxel) || tubes.bits().get(voxel));
    for (voxel, value) in mask.voxels().zip(branch_voxels(&mask, &tree)) {
        if is_slab(voxel) {
            assert_eq!(value, 2, "{voxel:?}");
        } else if voxel[0] >= 33 && voxel[2] >= 20 {
            assert_eq!(value, 3, "{voxel:?}");
        }
    }
}

#[test]
fn islands_have_no_branch_and_corners_connect() {
    let tree =
        Tree::new(&[node([5.0, 5.0, 3.0], 1.0, None), node([5.0, 5.0, 12.0], 1.0, Some(0))]).expect("a tree");
    let grid = grid([70, 12, 30]);
    let tube = body(&tree, &grid);
    // A diagonal of voxels from the tube's end, and an island.
    let is_diagonal = |[x, y, z]: [usize; 3]| x == y && (5..=10).contains(&x) && z + 5 == x + 13;
    let mask = Mask::from_fn(grid, |voxel| {
        tube.bits().get(voxel) || is_diagonal(voxel) || (voxel[0] >= 66 && voxel[2] > 20)
    });
    let values = branch_voxels(&mask, &tree);
    for (voxel, value) in mask.voxels().zip(&values) {
        assert_eq!(*value, u32::from(voxel[0] < 60), "{voxel:?}");
    }
    let single = Tree::new(&[node([5.0, 5.0, 3.0], 1.0, None)]).expect("a tree");
    assert!(branch_voxels(&mask, &single).iter().all(|&value| value == 0));
    assert!(branch_voxels(&Mask::empty(mask.grid().clone()), &tree).is_empty());
}

#[test]
fn every_voxel_of_an_oblique_thick_slice_body_has_a_branch() {
    let (tree, _) = touching();
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7);
    let affine = DAffine3 {
        matrix3: turn * DMat3::from_diagonal(DVec3::new(0.8, 0.8, 2.5)),
        translation: DVec3::new(-60.0, -20.0, -10.0),
    };
    let grid = Grid::new([150, 130, 60], affine).expect("a grid");
    let mask = body(&tree, &grid);
    let values = branch_voxels(&mask, &tree);
    let volume_mm3 = |branch: u32| {
        let n_voxels = values.iter().filter(|&&value| value == branch).count();
        n_voxels as f64 * mask.grid().voxel_volume_mm3()
    };
    assert_eq!(volume_mm3(0), 0.0);
    let cylinder_mm3 = |radius: f64, length: f64| std::f64::consts::PI * radius * radius * length;
    // The trunk with its round end, and the fork's sphere up to where the branches' own excess is less.
    let trunk = cylinder_mm3(6.0, 22.0) + cylinder_mm3(6.0, 4.0);
    assert!((volume_mm3(1) / trunk - 1.0).abs() < 0.15, "{} {trunk}", volume_mm3(1));
    let straight_on = cylinder_mm3(6.0, 60.0) + cylinder_mm3(6.0, 4.0);
    assert!((volume_mm3(2) / straight_on - 1.0).abs() < 0.1, "{} {straight_on}", volume_mm3(2));
}
