//! The cones of one branch that come near a sample, joined into one tube.
//!
//! **Input** the cones in the order of the branch. **Output** the level of the tube, and the highest cone.
//! **Steps** each cone joins what those before it have come to, as [`fillet::of_bend`] says: corners inside bends become
//! round, and where a tube runs straight on nothing is added. A cone that fades, or lies far along the branch, joins less.

use glam::Vec2;

use super::fillet;
use super::near::kinship;
use super::surface::{facing, is_before};
use crate::cone::Hit;
use crate::raster::{Drawn, NOTHING};

/// A branch at a sample.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube {
    /// The highest cone, and where on it.
    pub index: u32,
    pub hit: Hit,
    /// Of the tube.
    pub level: f32,
    pub radius: f32,
    pub offset: Vec2,
    arc_px: f32,
    say: f32,
}

impl Tube {
    pub(super) const NOTHING: Self = Self {
        index: NOTHING,
        hit: Hit::NOTHING,
        level: 0.0,
        radius: 0.0,
        offset: Vec2::ZERO,
        arc_px: 0.0,
        say: 0.0,
    };

    /// Takes in the next cone, whose level is `level` as measured from the axis of the highest cone of all.
    pub(super) fn take(&mut self, edge: &Drawn, (index, hit): (u32, Hit), level: f32) {
        let (radius, offset, say) = (hit.radius, hit.offset, edge.cone.say(&hit));
        let arc_px = edge.arc_px[0] + hit.share * (edge.arc_px[1] - edge.arc_px[0]);
        if self.index == NOTHING {
            *self = Self { index, hit, level, radius, offset, arc_px, say };
            return;
        }
        if is_before(&hit, &self.hit) {
            (self.index, self.hit) = (index, hit);
        }
        let radii = [self.radius, radius];
        if self.level - level >= fillet::widest(radii) {
            self.say = self.say.max(say);
            return;
        }
        let kin = kinship((arc_px - self.arc_px).abs(), self.radius + radius);
        let cosine = facing(self.offset, self.level, self.radius).dot(facing(offset, level, radius));
        let k = fillet::of_bend(radii, cosine) * kin * say * self.say;
        let (level, share) = fillet::smooth_max(self.level, level, k);
        self.level = level;
        self.radius += share * (radius - self.radius);
        self.offset += share * (offset - self.offset);
        self.arc_px += share * (arc_px - self.arc_px);
        self.say = self.say.max(say);
    }
}
