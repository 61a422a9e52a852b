//! What is seen at a sample: the highest cone, and the surface of all that join there.

use glam::{Vec2, Vec3};

use super::fillet;
use crate::cone::Hit;
use crate::palette::Rgb;
use crate::raster::{Drawn, Job, NOTHING};

/// Within this level of the outline, as a share of the square of the radius, normals are turned gradually.
const OUTLINE_SOFT: f32 = 0.1;

/// The best cone at a sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Best {
    /// Where on the cone.
    pub hit: Hit,
    /// Which; [`NOTHING`] where none comes near.
    pub index: u32,
    /// Distance to the outline of all cones.
    pub(super) outside: f32,
    /// How many cones come near.
    pub(super) n_near: u32,
}

impl Best {
    pub(super) const NOTHING: Self =
        Self { hit: Hit::NOTHING, index: NOTHING, outside: f32::INFINITY, n_near: 0 };

    pub(super) fn offer(&mut self, index: u32, hit: Hit) {
        self.n_near += 1;
        if self.index == NOTHING || is_before(&hit, &self.hit) {
            (self.hit, self.index) = (hit, index);
        }
        self.outside = self.outside.min(hit.outside);
    }
}

/// Inside goes before outside; there the higher is seen, beyond the outlines the nearer joins first.
pub(super) fn is_before(a: &Hit, b: &Hit) -> bool {
    let rank = |hit: &Hit| if hit.level >= 0.0 { (1, hit.z) } else { (0, hit.level) };
    rank(a) > rank(b)
}

/// A branch at a sample, all its cones joined.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub level: f32,
    pub radius: f32,
    /// From the axis to the sample.
    pub offset: Vec2,
    /// What light sees beside the bare shape.
    pub bend: Vec3,
}

/// The surface at a sample, of all cones that join there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// The square of its height.
    pub level: f32,
    /// The radius.
    pub radius: f32,
    /// From the axis to the sample.
    offset: Vec2,
    /// What light sees beside the bare shape: a chain of cones turns like one tube.
    bend: Vec3,
    /// The say of what has joined so far; 0 where nothing has.
    say: f32,
    /// Offset and bend of the highest cone's branch, and how many of its cones have a say in them.
    own_offset: Vec2,
    own_bend: Vec3,
    n_chained: f32,
    color: Rgb,
    weight: f32,
    /// How much of the paper's colour is seen in the gap beside a branch that passes in front.
    pub gap: f32,
    /// How dark a seam is, 0 to 1.
    pub seam: f32,
    /// Distance to the outline, under 0 inside.
    pub outside: f32,
}

impl Surface {
    pub(super) const NOTHING: Self = Self {
        level: 0.0,
        radius: 0.0,
        offset: Vec2::ZERO,
        bend: Vec3::ZERO,
        say: 0.0,
        own_offset: Vec2::ZERO,
        own_bend: Vec3::ZERO,
        n_chained: 1.0,
        color: [0.0; 3],
        weight: 0.0,
        gap: 0.0,
        seam: 0.0,
        outside: f32::INFINITY,
    };

    /// That of the highest cone alone.
    pub(super) fn of(job: &Job<'_>, best: &Best) -> Self {
        let edge = &job.drawn[best.index as usize];
        let hit = &best.hit;
        let bend = bend(edge, hit);
        Self {
            level: hit.level,
            radius: hit.radius,
            offset: hit.offset,
            bend,
            own_offset: hit.offset,
            own_bend: bend,
            color: color(job, edge, hit),
            weight: 1.0,
            outside: best.outside,
            ..Self::NOTHING
        }
    }

    /// The mean colour.
    pub(crate) fn base(&self) -> Rgb {
        self.color.map(|part| part / self.weight.max(f32::MIN_POSITIVE))
    }

    /// The unit normal that light sees.
    pub(crate) fn normal(&self) -> Vec3 {
        (shape(self.offset, self.level) + self.bend).normalize_or(Vec3::Z)
    }

    /// Adds a colour by its weight.
    pub(super) fn tint(&mut self, color: Rgb, weight: f32) {
        self.color = std::array::from_fn(|k| self.color[k] + weight * color[k]);
        self.weight += weight;
    }

    /// Takes another cone of the highest one's branch into what light sees of it.
    pub(super) fn chain(&mut self, edge: &Drawn, hit: &Hit, weight: f32) {
        self.n_chained += weight;
        let share = weight / self.n_chained;
        self.own_offset += share * (hit.offset - self.own_offset);
        self.own_bend += share * (bend(edge, hit) - self.own_bend);
    }

    /// Joins the highest cone's own branch, whose cones are one tube of this level.
    pub(super) fn join_own(&mut self, level: f32, radius: f32) {
        let own = Part { level, radius, offset: self.own_offset, bend: self.own_bend };
        self.join(&own, 1.0);
    }

    /// Joins a branch; `say` of a whole fillet.
    pub(super) fn join(&mut self, part: &Part, say: f32) {
        if self.say <= 0.0 {
            (self.level, self.radius) = (part.level, part.radius);
            (self.offset, self.bend, self.say) = (part.offset, part.bend, say);
            return;
        }
        let cosine =
            facing(self.offset, self.level, self.radius).dot(facing(part.offset, part.level, part.radius));
        let k = fillet::of_branches([self.radius, part.radius], cosine) * say * self.say;
        let (level, share) = fillet::smooth_max(self.level, part.level, k);
        self.level = level;
        self.radius += share * (part.radius - self.radius);
        self.offset += share * (part.offset - self.offset);
        self.bend += share * (part.bend - self.bend);
        self.say = self.say.max(say);
    }

    /// Moves the outline by what joining has added to the highest cone. That is not always the nearest one, for a thin
    /// cone's level falls less steeply beside it: what was added moves the highest cone's outline, not the nearest's.
    pub(super) fn widen(&mut self, best: &Best) {
        let edge_of = |level: f32, radius: f32| (radius * radius - level).max(0.0).sqrt() - radius;
        if self.level > best.hit.level {
            let moved = edge_of(best.hit.level, best.hit.radius) - edge_of(self.level, self.radius);
            self.outside = self.outside.min(best.hit.outside - moved.max(0.0));
        }
    }
}

/// The unit normal of a bare shape; outside of the outline it lies in the plane.
pub(super) fn shape(offset: Vec2, level: f32) -> Vec3 {
    offset.extend(level.max(0.0).sqrt()).normalize_or(Vec3::Z)
}

/// The same, but that beyond the outline it turns into the plane gradually: the height falls ever more steeply towards
/// the outline, and a join whose width follows it would have a crease there.
pub(super) fn facing(offset: Vec2, level: f32, radius: f32) -> Vec3 {
    let soft = OUTLINE_SOFT * radius * radius;
    let level = 0.5 * (level + (level * level + soft * soft).sqrt());
    offset.extend(level.sqrt()).normalize_or(Vec3::Z)
}

/// What light sees beside the bare cone; nothing outside of the outline.
pub(super) fn bend(edge: &Drawn, hit: &Hit) -> Vec3 {
    if hit.level > 0.0 { edge.cone.normal(hit) - shape(hit.offset, hit.level) } else { Vec3::ZERO }
}

pub(super) fn color(job: &Job<'_>, edge: &Drawn, hit: &Hit) -> Rgb {
    job.palette.at(edge.values[0] + hit.share * (edge.values[1] - edge.values[0]))
}
