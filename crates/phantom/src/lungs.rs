//! Where the lungs lie: two domes, less the mediastinum, the heart, the spine and the diaphragm.
//!
//! **Spaces** RAS mm at size 1 with the carina at the origin; +x is the patient's right.
//! **Guarantees** `depth_mm` is positive inside, negative outside, and near a wall about the distance to it.

use espalier_geom::math;
use glam::DVec3;

/// One of the two lungs, or one side of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Right,
    Left,
}

/// The part of a lung that one lobar bronchus serves; the lingula counts as one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lobe {
    RightUpper,
    RightMiddle,
    RightLower,
    LeftUpper,
    Lingula,
    LeftLower,
}

impl Side {
    /// The corners of the box about this lung.
    pub(crate) fn bounds(self) -> (DVec3, DVec3) {
        match self {
            Self::Right => (DVec3::new(0.0, -82.0, -142.0), DVec3::new(132.0, 82.0, 98.0)),
            Self::Left => (DVec3::new(-130.0, -82.0, -142.0), DVec3::new(0.0, 82.0, 94.0)),
        }
    }
}

/// About how deep `p` lies in an ellipsoid; exact on its surface.
pub(crate) fn ellipsoid_depth(p: DVec3, center: DVec3, semi_axes: DVec3) -> f64 {
    (1.0 - ((p - center) / semi_axes).length()) * semi_axes.min_element()
}

/// About how deep `p` lies in an upright elliptical cylinder.
pub(crate) fn cylinder_depth(p: DVec3, center: [f64; 2], semi_axes: [f64; 2]) -> f64 {
    let across = math::hypot((p.x - center[0]) / semi_axes[0], (p.y - center[1]) / semi_axes[1]);
    (1.0 - across) * semi_axes[0].min(semi_axes[1])
}

/// About how deep `p` lies in the heart.
pub(crate) fn heart_depth(p: DVec3) -> f64 {
    ellipsoid_depth(p, DVec3::new(-15.0, 27.0, -68.0), DVec3::new(49.0, 38.0, 42.0))
}

/// About how deep `p` lies in the tissue between the lungs, the heart apart.
pub(crate) fn mediastinum_depth(p: DVec3) -> f64 {
    // Narrow at the apex, wider at the hila.
    let half_width = 15.0 + 9.0 * math::exp(-((p.z + 20.0) / 60.0) * ((p.z + 20.0) / 60.0));
    cylinder_depth(p, [0.0, 0.0], [half_width, 92.0]).max(cylinder_depth(p, [0.0, -72.0], [27.0, 27.0]))
}

/// How deep `p` lies below the diaphragm of one side.
pub(crate) fn diaphragm_depth(side: Side, p: DVec3) -> f64 {
    let dome = match side {
        Side::Right => DVec3::new(66.0, 8.0, -186.0),
        Side::Left => DVec3::new(-68.0, 8.0, -196.0),
    };
    98.0 - p.distance(dome)
}

/// How deep `p` lies in a lung.
pub(crate) fn depth_mm(side: Side, p: DVec3) -> f64 {
    let (center, semi_axes) = match side {
        Side::Right => (DVec3::new(67.0, 0.0, -22.0), DVec3::new(63.0, 80.0, 118.0)),
        Side::Left => (DVec3::new(-67.0, 0.0, -24.0), DVec3::new(61.0, 78.0, 116.0)),
    };
    ellipsoid_depth(p, center, semi_axes)
        .min(-mediastinum_depth(p))
        .min(-heart_depth(p))
        .min(-diaphragm_depth(side, p))
}

/// The lobe that a point of a lung belongs to.
pub(crate) fn lobe(side: Side, p: DVec3) -> Lobe {
    // The oblique fissure falls from high behind to low in front; the horizontal one parts the middle lobe.
    let is_below_oblique = p.z < 30.0 - 0.9 * (p.y + 75.0);
    match side {
        Side::Right if is_below_oblique => Lobe::RightLower,
        Side::Right if p.z < -14.0 => Lobe::RightMiddle,
        Side::Right => Lobe::RightUpper,
        Side::Left if is_below_oblique => Lobe::LeftLower,
        Side::Left if p.z < -16.0 => Lobe::Lingula,
        Side::Left => Lobe::LeftUpper,
    }
}
