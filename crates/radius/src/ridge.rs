//! From a skeleton voxel to the axis of the branch, and the radius there.
//!
//! **Input** a mask's background, a skeleton voxel, the skeleton's direction there. **Output** a point in grid mm, the
//! radius in mm, and the cross-section.
//! **Notation** D the distance to the nearest background centre, t the direction; *gap* the room between the last voxels
//! inside of the sphere and D, which a mask says nothing about (see [`gap`]).
//! **Steps** 1. The section across t. If it is round, its centroid is the centre, and the radius is that of the circle of
//! its area. A section is round if that circle reaches beyond D by [`MAX_EXCESS`] at most and is not cut by the border.
//! 2. If it is an ellipse whose edge is rough, its centroid is the centre too, and the radius is the ellipse's least.
//! 3. Otherwise climb across t to the ridge of D, a few times at most; the radius is the middle of the gap.
//! 4. Without a direction climb any way; the radius is D.
//! **Guarantees** with a direction, the centre moves across it only, so that neighbouring voxels of a curve do not run
//! into one another; a centre is inside of the mask.
//! **Why both?** On thin tubes D is a coarse measure. Over whole phantom trees with radii from 1.2 voxels, the ridge and
//! the middle of the gap alone came out 0.17 voxel off the axis, radii 0.17 too large (mean absolute error 0.17); a round
//! section averages over all of its voxels: 0.14, 0.06 and 0.08 voxel. In flat or merged lumina the area is not that of a
//! tube, and D is what remains. Of a rough mask one missing voxel decides D: radii came out 0.28 voxel too small, those of
//! ellipses 0.05.
//! **Cost** a few look-ups of O((r/s)²) words.

use glam::DVec3;

use crate::boundary::{Boundary, REACH};
use crate::gap;
use crate::nearest::Background;
use crate::section::{self, Section};

/// A section is round if its circle exceeds the distance at its centroid by no more than this share of the spacing.
const MAX_EXCESS: f64 = 0.25;
/// So far, in spacings, may the circle of a round section stay behind the farthest voxels within the distance: they are
/// inside, but their cells are not all of them. Without a limit, slices five times as thick as wide gave 0.5 mm too little
/// for a radius of 10 mm; with a limit of 0 thin tubes came out 0.1 voxel too thick.
const MAX_DEFICIT: f64 = 0.25;
/// A section is an ellipse if the one with its second moments is larger than the one with its area by no more than this share
/// of the spacing: flipped voxels spread it a little, other branches and flat lumina much. On phantoms with 15 % of the
/// surface flipped at 0.8 mm, shares of 0, 0.25, 0.4 and 0.6 put the centreline 0.40, 0.28, 0.24 and 0.24 voxel off the axis.
const MAX_SPREAD: f64 = 0.5;
/// The longest semi-axis of such an ellipse, as a multiple of the shortest: the start of a fork is longer.
const MAX_ASPECT: f64 = 1.5;
/// A wall is rough from this share of pits on. Where it is smooth, D is the distance to it: an aorta's sections, nearly
/// round, have the inscribed radius that a centreline of VMTK has.
const LEAST_PITS: f64 = 0.02;
/// Shares of the spacing that count as having reached the limit of a climb.
const AT_LIMIT: f64 = 0.9;

/// A place on the axis of a branch.
pub(crate) struct OnAxis {
    /// In grid mm.
    pub(crate) center: DVec3,
    /// In mm; infinite in a mask without background.
    pub(crate) radius_mm: f64,
    /// The cross-section, where there is a direction and a tube.
    pub(crate) section: Option<Section>,
}

/// The place on the axis that belongs to `voxel`, whose distance is `distance_mm`.
pub(crate) fn on_axis(
    background: Background<'_>,
    voxel: [i64; 3],
    (distance_mm, tangent): (f64, Option<DVec3>),
    climb_steps: u32,
) -> OnAxis {
    let start = background.position_mm(voxel);
    let round = tangent.and_then(|tangent| in_round_section(background, voxel, distance_mm, tangent));
    if let Some(found) = round {
        return found;
    }
    let (center, distance_mm) = climbed(background, (start, distance_mm), tangent, climb_steps);
    let Some(tangent) = tangent.filter(|_| distance_mm.is_finite()) else {
        return OnAxis { center, radius_mm: distance_mm, section: None };
    };
    let gap_mm = gap::gap_mm(center, tangent, distance_mm, background.spacing_mm());
    let at_center = background.voxel_at(center);
    let section = background
        .is_foreground(at_center)
        .then(|| section::through(background, (at_center, center), tangent, distance_mm))
        .flatten();
    OnAxis { center, radius_mm: distance_mm - 0.5 * gap_mm, section }
}

/// The centre and radius that a round section says; `None` if it is not round or the scan's border cuts it.
fn in_round_section(
    background: Background<'_>,
    voxel: [i64; 3],
    voxel_mm: f64,
    tangent: DVec3,
) -> Option<OnAxis> {
    let section = section::through(background, (voxel, background.position_mm(voxel)), tangent, voxel_mm)?;
    let center = section.centroid;
    let distance_mm = if background.is_foreground(background.voxel_at(center)) {
        background.distance_at_mm(center)
    } else {
        0.0
    };
    // Beyond the outermost voxel centres a point may be, but not a section that is whole.
    let is_beyond = center != center.clamp(DVec3::ZERO, background.last_mm());
    let is_cut = is_beyond || background.border_mm(center) < distance_mm;
    if !distance_mm.is_finite() {
        return None;
    }
    let excess_mm = section.area_radius_mm - distance_mm;
    let is_round = excess_mm <= MAX_EXCESS * background.spacing_mm().min_element();
    let inner_mm = distance_mm - gap::gap_mm(center, tangent, distance_mm, background.spacing_mm());
    let least_mm = inner_mm - MAX_DEFICIT * background.spacing_mm().min_element();
    if is_cut {
        return None;
    }
    let radius_mm = match is_round {
        true => section.area_radius_mm.max(least_mm),
        false => rough_radius_mm(&section, background.spacing_mm().min_element())?,
    };
    Some(OnAxis { center, radius_mm, section: Some(section) })
}

/// The radius of a section that is an ellipse but for its rough edge: where voxels of it are missing, D is the distance to
/// such a pit, not to the wall. `None` if it is no such ellipse.
fn rough_radius_mm(section: &Section, spacing_mm: f64) -> Option<f64> {
    let [large_mm, small_mm] = section.semi_axes_mm;
    let spread_mm = (large_mm * small_mm).sqrt() - section.area_radius_mm;
    let is_ellipse = spread_mm <= MAX_SPREAD * spacing_mm && large_mm <= MAX_ASPECT * small_mm;
    (is_ellipse && section.pit_share >= LEAST_PITS)
        .then(|| section.area_radius_mm * (small_mm / large_mm).sqrt())
}

/// The ridge of the distance near a point, and the distance there.
fn climbed(
    background: Background<'_>,
    (start, start_mm): (DVec3, f64),
    tangent: Option<DVec3>,
    climb_steps: u32,
) -> (DVec3, f64) {
    let (mut center, mut distance_mm) = (start, start_mm);
    let limit = AT_LIMIT * REACH * background.spacing_mm().min_element();
    for _ in 0..=climb_steps {
        let boundary = Boundary::around(background, center, distance_mm);
        let (next, next_mm) = boundary.highest_near(center, tangent, background.last_mm());
        let moved = next.distance(center);
        (center, distance_mm) = (next, next_mm);
        if moved < limit {
            break;
        }
    }
    (center, distance_mm)
}
