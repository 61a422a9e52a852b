//! Hand-made skeletons, their spheres and the masks that the spheres fill.
#![allow(clippy::expect_used, reason = "a helper of tests only")]

use espalier_model::{Grid, InscribedSpheres, Mask, Skeleton, Sphere};
use espalier_tree::{Built, Error, Params, build};
use glam::DVec3;

/// Voxels with the radius of their sphere, in voxels of a 1 mm grid.
pub(crate) type Places = Vec<([u32; 3], f64)>;

/// The three inputs of the stage: the mask is the union of the spheres (at least the voxels themselves).
pub(crate) fn inputs(places: &Places, shape: [usize; 3]) -> (Mask, Skeleton, InscribedSpheres) {
    let grid = Grid::axis_aligned(shape, DVec3::ONE, DVec3::ZERO).expect("a grid");
    let mut mask = Mask::empty(grid.clone());
    for &(voxel, radius) in places {
        let reach = radius.ceil() as i64;
        for dz in -reach..=reach {
            for dy in -reach..=reach {
                for dx in -reach..=reach {
                    if ((dx * dx + dy * dy + dz * dz) as f64) > radius * radius {
                        continue;
                    }
                    let near = [voxel[0] as i64 + dx, voxel[1] as i64 + dy, voxel[2] as i64 + dz];
                    if (0..3).all(|axis| near[axis] >= 0 && near[axis] < shape[axis] as i64) {
                        mask.bits_mut().set(near.map(|v| v as usize));
                    }
                }
            }
        }
    }
    let skeleton = Skeleton::new(grid, places.iter().map(|p| p.0).collect());
    let spheres = skeleton
        .voxels()
        .iter()
        .map(|voxel| {
            let radius_mm = places.iter().filter(|p| p.0 == *voxel).map(|p| p.1).fold(0.0, f64::max);
            let center_mm = DVec3::new(f64::from(voxel[0]), f64::from(voxel[1]), f64::from(voxel[2]));
            Sphere {
                center_mm,
                radius_mm,
                distance_mm: radius_mm,
                area_radius_mm: radius_mm,
                wall_mm: 0.0,
                is_cut: false,
            }
        })
        .collect();
    (mask, skeleton, InscribedSpheres(spheres))
}

/// The tree of hand-made places.
pub(crate) fn tree_of(places: &Places, shape: [usize; 3], params: &Params) -> Result<Built, Error> {
    let (mask, skeleton, spheres) = inputs(places, shape);
    build(&mask, &skeleton, &spheres, params)
}
