//! The inscribed sphere at each skeleton voxel.

use glam::DVec3;

/// The largest sphere inside the mask about a skeleton voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre: the sub-voxel ridge of the distance field near the voxel, RAS+ mm.
    pub center_mm: DVec3,
    /// Its radius in mm.
    pub radius_mm: f64,
    /// The exact distance from the voxel's own centre to the nearest background centre, in mm.
    pub distance_mm: f64,
    /// The radius of the circle with the area of the mask's cross-section here, in mm; `NaN` where the section
    /// has no clear direction.
    pub area_radius_mm: f64,
    /// Whether the sphere touches the border of the scan, so that its radius is a lower bound.
    pub is_cut: bool,
}

/// The inscribed spheres of a skeleton, one for each of its voxels, in the same order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InscribedSpheres(pub Vec<Sphere>);
