//! One round cone: the hull of two spheres, seen from above.
//!
//! **Input** two spheres in pixels (x right, y down, z towards the viewer). **Output** at any pixel the height of
//! the surface, the place along the axis, and the signed distance to the outline.
//! **Notation** a, b centres; r_a, r_b radii; L length, u unit axis, m = |u_xy|, k = (r_b − r_a)/L;
//! w = p − a_xy, x = w · u_xy/m.
//! **Steps** The hull is the union of the spheres c(s) = a + s u, r(s) = r_a + k s, 0 ≤ s ≤ L. Above p the sphere
//! s reaches z(s) = a_z + s u_z + √g(s), g(s) = r(s)² − |w − s u_xy|² = −A s² + 2 B s + C with A = m² − k²,
//! B = r_a k + m x, C = r_a² − |w|². √g is concave where B² + A C > 0, so z(s) has one peak,
//! s* = (B + u_z q)/A, q = √((B² + A C)/(1 − k²)), clamped to [0, L]. A flat cone has u_z = 0, s* = B/A, and is
//! then exactly z = √(r² − d²) over its centreline when it does not taper.
//! Normals turn with the chain: at a joint both cones lean half way to each other, in between linearly, so that a
//! bent or unevenly tapering tube is lit without rings at its nodes.
//! **Guarantees** only basic arithmetic and square roots: the same bits on every machine.
//! **Cost** O(1) for a pixel.

mod joint;
mod outline;

use glam::{DVec3, Vec2, Vec3};

pub(crate) use joint::Joint;
use joint::{Bend, LitEnd, axis};
use outline::Outline;

/// Below this tilt a cone counts as flat.
const FLAT: f32 = 1e-6;
/// How far beyond its outline a cone may fill the corner that it makes with another, in its radii: the fillet of two
/// equal tubes reaches 0.1 to 0.2 of them, that of a thin one on a thick one 0.3, and fades before it ends.
const FILLET_REACH: f64 = 0.5;

/// A sphere at a node, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    /// Centre.
    pub center: DVec3,
    /// Radius, over 0.
    pub radius: f64,
}

/// A round cone in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    start: Vec3,
    end: Vec3,
    radii: [f32; 2],
    /// Unit axis in the picture plane; (1, 0) where the cone points at the viewer.
    along: Vec2,
    /// The share of the length that is seen, and the signed share towards the viewer.
    m: f32,
    uz: f32,
    length: f32,
    k: f32,
    /// The range of x that this cone must fill; beyond it another cone of the chain does.
    range: [f32; 2],
    /// What light sees at either end.
    lit: [LitEnd; 2],
    /// The box that holds the cone: low and high corner.
    bounds: (Vec2, Vec2),
    outline: Outline,
}

/// A place on a cone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Height of the surface towards the viewer.
    pub z: f32,
    /// Height of the surface over the axis; 0 just outside the outline.
    pub height: f32,
    /// The square of the height; outside of the outline what it would be, under 0. Smooth across the outline.
    pub level: f32,
    /// From the axis point to the pixel.
    pub offset: Vec2,
    /// The radius there.
    pub radius: f32,
    /// The place along the axis: 0 at the start, 1 at the end.
    pub share: f32,
    /// Distance to the outline, negative inside.
    pub outside: f32,
}

impl Hit {
    /// No place.
    pub(crate) const NOTHING: Self = Self {
        z: 0.0,
        height: 0.0,
        level: 0.0,
        offset: Vec2::ZERO,
        radius: 0.0,
        share: 0.0,
        outside: f32::INFINITY,
    };
}

impl Cone {
    /// The cone from `start` to `end`, where the chain goes on as `joints` say.
    pub(crate) fn new(start: Ball, end: Ball, joints: [Joint; 2]) -> Self {
        let (unit, length, k) = axis(start, end);
        let seen = unit.truncate().length();
        let along = if seen > 1e-9 { unit.truncate() / seen } else { glam::DVec2::X };
        let [before, after] = Bend::of([start, end], joints);
        // The surface at axis place s lies at x = s m − k r, shifted by up to |u_z| r where the axis is tilted:
        // this much on either side of an end even where the chain goes straight on.
        let lean = |radius: f64| (k.abs() + unit.z.abs()).min(1.0) * radius + 1.0;
        let slack = |radius: f64, bend: &Bend| {
            (bend.reach + k.abs() + unit.z.abs()).min(1.0) * (1.0 + FILLET_REACH) * radius + 1.0
        };
        let range = [
            (-slack(start.radius, &before)).min(length * seen - lean(end.radius)),
            (length * seen + slack(end.radius, &after)).max(lean(start.radius)),
        ];
        let radii = [start.radius as f32, end.radius as f32];
        let [from, to] = [start.center.as_vec3(), end.center.as_vec3()];
        let [a, b] = [from.truncate(), to.truncate()];
        Self {
            start: from,
            end: to,
            radii,
            along: along.as_vec2(),
            m: seen as f32,
            uz: unit.z as f32,
            length: length as f32,
            k: k as f32,
            range: range.map(|bound| bound as f32),
            lit: [before.lit(), after.lit()],
            bounds: ((a - radii[0]).min(b - radii[1]), (a + radii[0]).max(b + radii[1])),
            outline: Outline::new(length as f32 * seen as f32, radii),
        }
    }

    /// The unit normal that light sees at a place, towards the viewer.
    pub(crate) fn normal(&self, hit: &Hit) -> Vec3 {
        let exact = hit.offset.extend(hit.height).normalize_or(Vec3::Z);
        let (from, to) = (self.lit[0], self.lit[1]);
        let on_ball = (hit.share <= 0.0 && from.is_end) || (hit.share >= 1.0 && to.is_end);
        if on_ball {
            return exact;
        }
        let axis = (from.axis + hit.share * (to.axis - from.axis)).normalize_or(Vec3::X);
        let taper = (from.taper + hit.share * (to.taper - from.taper)).clamp(-0.95, 0.95);
        let across = (exact - axis * exact.dot(axis)).normalize_or(exact);
        (across * (1.0 - taper * taper).sqrt() - axis * taper).normalize_or(exact)
    }

    /// The smaller of its radii.
    pub(crate) fn least_radius(&self) -> f32 {
        self.radii[0].min(self.radii[1])
    }

    /// How far beyond its outline the cone may fill a corner.
    pub(crate) fn fillet_px(&self) -> f32 {
        FILLET_REACH as f32 * self.radii[0].max(self.radii[1])
    }

    /// How much of a say the cone has in what others do at a place, 0 to 1: it fades towards where the cone ends for
    /// good, so that nothing jumps there.
    pub(crate) fn say(&self, hit: &Hit) -> f32 {
        let x = hit.share * self.length * self.m + hit.offset.dot(self.along);
        let seen = self.length * self.m;
        let beyond = |over: f32, slack: f32| (1.0 - over.max(0.0) / slack.max(1e-6)).clamp(0.0, 1.0);
        let along = beyond(-x, -self.range[0]).min(beyond(x - seen, self.range[1] - seen));
        along * beyond(hit.outside, self.fillet_px())
    }

    /// How far to the left of the axis a place lies, y down; under 0 to the right.
    pub(crate) fn across(&self, hit: &Hit) -> f32 {
        hit.offset.perp_dot(self.along)
    }

    /// The box that holds the cone: low and high corner.
    pub(crate) fn bounds(&self) -> (Vec2, Vec2) {
        self.bounds
    }

    /// About how many pixels the cone must look at when it is `margin` wider: its box, or its strip of the chain.
    pub(crate) fn area(&self, margin: f32) -> f64 {
        let (low, high) = self.bounds();
        let bounds = (high - low + 2.0 * margin).as_dvec2();
        let along = f64::from(self.range[1] - self.range[0]);
        let wide = f64::from(self.radii[0].max(self.radii[1]) + margin);
        (bounds.x * bounds.y).min(along * 2.0 * wide)
    }

    /// About how many pixels of a box (low and high corner) the cone looks at when it is `margin` wider.
    pub(crate) fn area_within(&self, (low, high): (Vec2, Vec2), margin: f32) -> f64 {
        let (own_low, own_high) = self.bounds();
        let shared = (own_high + margin).min(high) - (own_low - margin).max(low);
        let shared = shared.max(Vec2::ZERO).as_dvec2();
        let wide = 2.0 * f64::from(self.radii[0].max(self.radii[1]) + margin);
        let along = f64::from(self.range[1] - self.range[0]).min(shared.length());
        (shared.x * shared.y).min(along * wide)
    }

    /// The pixels x of a row at height `y` that the cone can reach when it is `margin` wider: low and high.
    pub(crate) fn span(&self, y: f32, margin: f32) -> Option<(f32, f32)> {
        self.span_between([y, y], margin)
    }

    /// The same for all rows from one height to another.
    pub(crate) fn span_between(&self, [top, bottom]: [f32; 2], margin: f32) -> Option<(f32, f32)> {
        let (low, high) = self.bounds();
        let mut span = (low.x - margin, high.x + margin);
        let wide = self.radii[0].max(self.radii[1]) + margin;
        let across = Vec2::new(-self.along.y, self.along.x);
        let rows = [top - self.start.y, bottom - self.start.y];
        // along · (x, y) within the range, across · (x, y) within the width: two strips cut by the rows.
        for (normal, [from, to]) in [(self.along, self.range), (across, [-wide, wide])] {
            let [p, q] = rows.map(|row| normal.y * row);
            let (least, most) = (p.min(q), p.max(q));
            if normal.x.abs() < 1e-4 {
                // The rows run nearly along the strip: a pixel of slack covers the tilt over any page.
                if most < from - 4.0 || least > to + 4.0 {
                    return None;
                }
                continue;
            }
            let cut = |bound: f32| self.start.x + bound / normal.x;
            let (p, q) = (cut(from - most), cut(to - least));
            span = (span.0.max(p.min(q)), span.1.min(p.max(q)));
        }
        (span.0 <= span.1).then_some(span)
    }

    /// The cone at a pixel; `None` where it is more than `margin` outside its outline, or another's to fill.
    pub(crate) fn at(&self, pixel: Vec2, margin: f32) -> Option<Hit> {
        let w = pixel - self.start.truncate();
        let x = w.dot(self.along);
        if x < self.range[0] || x > self.range[1] {
            return None;
        }
        let from_end = pixel - self.end.truncate();
        let outside = self.outline.outside([w, from_end], [x, w.perp_dot(self.along).abs()]);
        if outside > margin {
            return None;
        }
        let s = self.peak(w, x);
        let center = self.start.truncate() + self.along * (s * self.m);
        let offset = pixel - center;
        let radius = self.radii[0] + self.k * s;
        let level = radius * radius - offset.length_squared();
        let height = level.max(0.0).sqrt();
        let share = if self.length > 0.0 { s / self.length } else { 0.0 };
        Some(Hit { z: self.start.z + s * self.uz + height, height, level, offset, radius, share, outside })
    }

    /// s*: the place along the axis whose sphere is highest above the pixel.
    fn peak(&self, w: Vec2, x: f32) -> f32 {
        let Self { radii: [radius, _], m, uz, length, k, .. } = *self;
        let a = m * m - k * k;
        let b = radius * k + m * x;
        if uz.abs() < FLAT && a > 0.0 {
            return (b / a).clamp(0.0, length);
        }
        let c = radius * radius - w.length_squared();
        let e = 1.0 - k * k;
        let inner = if e > 0.0 {
            // A ray just outside the outline misses the cone: q = 0 then gives the place that it passes closest.
            let q = ((b * b + a * c).max(0.0) / e).sqrt();
            // Two forms of the same root; the second survives A → 0, where the axis points at the viewer.
            let other = e * (b - uz * q);
            if a.abs() > 0.05 {
                (b + uz * q) / a
            } else if other != 0.0 {
                (b * b - uz * uz * c) / other
            } else {
                0.0
            }
        } else if k > 0.0 {
            length
        } else {
            0.0
        };
        if a > 0.05 {
            return inner.clamp(0.0, length);
        }
        // Nearly end on, g may be positive on two stretches: ask the ends too.
        let top = |s: f32| {
            let g = (radius + k * s) * (radius + k * s) - (w - self.along * (s * m)).length_squared();
            if g >= 0.0 { s * uz + g.sqrt() } else { f32::NEG_INFINITY }
        };
        [inner.clamp(0.0, length), 0.0, length]
            .into_iter()
            .reduce(|p, q| if top(q) > top(p) { q } else { p })
            .unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests;
