//! How the ends of a cone lie in their chain.
//!
//! **Input** the balls at both ends of a cone and those beyond. **Output** how far the cone must reach beyond its ends, and
//! the direction of the surface there as light sees it: half way between both cones.

use glam::{DVec3, Vec3};

use super::Ball;

/// How a chain goes on beyond an end of a cone.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Joint {
    /// A tip, a fork or the root: the end is a whole ball.
    End,
    /// One more edge follows, to or from the ball given.
    Chain(Ball),
}

/// The direction of the surface at an end of a cone, as light sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct LitEnd {
    pub axis: Vec3,
    pub taper: f32,
    /// Whether the end is a whole ball, round to the last.
    pub is_end: bool,
}

/// An end of a cone.
pub(super) struct Bend {
    /// How far, in radii, the cones must reach beyond it: tan(turn/2) fills the wedge on the outer side, and the
    /// change of taper moves the borders of their surfaces.
    pub reach: f64,
    /// The axis and the taper half way between the two cones.
    pub axis: DVec3,
    pub taper: f64,
    /// Whether nothing follows.
    pub is_end: bool,
}

impl Bend {
    /// Both ends of the cone from `start` to `end`, where the chain goes on as `joints` say.
    pub(super) fn of([start, end]: [Ball; 2], joints: [Joint; 2]) -> [Self; 2] {
        let (axis, _, taper) = axis(start, end);
        let bend = |joint: Joint, chain: &dyn Fn(Ball) -> [Ball; 3]| match joint {
            Joint::Chain(ball) => Self::between(chain(ball)),
            Joint::End => Self { reach: 1.0, axis, taper, is_end: true },
        };
        [bend(joints[0], &|ball| [ball, start, end]), bend(joints[1], &|ball| [start, end, ball])]
    }

    fn between([before, joint, after]: [Ball; 3]) -> Self {
        let (p, p_length, p_taper) = axis(before, joint);
        let (q, q_length, q_taper) = axis(joint, after);
        let cos = if p_length > 0.0 && q_length > 0.0 { p.dot(q) } else { -1.0 };
        // tan(turn/2) = √((1 − cos)/(1 + cos)); a sharp turn takes the whole ball.
        let tan_half = if cos > 0.0 { ((1.0 - cos).max(0.0) / (1.0 + cos)).sqrt() } else { 1.0 };
        Self {
            reach: (tan_half + (q_taper - p_taper).abs()).min(1.0),
            axis: (p + q).normalize_or(q),
            taper: 0.5 * (p_taper + q_taper),
            is_end: false,
        }
    }

    /// As light sees it.
    pub(super) fn lit(&self) -> LitEnd {
        LitEnd { axis: self.axis.as_vec3(), taper: self.taper as f32, is_end: self.is_end }
    }
}

/// Unit axis, length and taper from one ball to the next.
pub(super) fn axis(start: Ball, end: Ball) -> (DVec3, f64, f64) {
    let axis = end.center - start.center;
    let length = axis.length();
    if length > 0.0 {
        (axis / length, length, (end.radius - start.radius) / length)
    } else {
        (DVec3::Z, 0.0, 0.0)
    }
}
