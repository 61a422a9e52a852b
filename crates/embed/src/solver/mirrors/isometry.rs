//! Isometries of the plane: a rotation and a shift, after a reflection or not.
//!
//! **Notation** points and directions as complex numbers; p ↦ r p + s, or r p̄ + s for a mirror, |r| = 1.

use glam::DVec2;

/// An isometry of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Isometry {
    /// Whether it turns left into right.
    pub(super) is_mirror: bool,
    rotation: DVec2,
    shift: DVec2,
}

impl Isometry {
    pub(super) const IDENTITY: Self = Self { is_mirror: false, rotation: DVec2::X, shift: DVec2::ZERO };

    /// The one that carries a point and a direction there to others.
    pub(super) fn carrying(from: (DVec2, DVec2), to: (DVec2, DVec2), is_mirror: bool) -> Self {
        let rotation = unit(if is_mirror { from.1.rotate(to.1) } else { conjugate(from.1).rotate(to.1) });
        let turn_only = Self { is_mirror, rotation, shift: DVec2::ZERO };
        Self { shift: to.0 - turn_only.point(from.0), ..turn_only }
    }

    /// Where a point goes.
    #[inline]
    pub(super) fn point(&self, point: DVec2) -> DVec2 {
        self.direction(point) + self.shift
    }

    /// Where a direction goes.
    #[inline]
    pub(super) fn direction(&self, direction: DVec2) -> DVec2 {
        if self.is_mirror {
            conjugate(direction).rotate(self.rotation)
        } else {
            direction.rotate(self.rotation)
        }
    }

    /// This one after `first`.
    pub(super) fn after(&self, first: &Self) -> Self {
        Self {
            is_mirror: self.is_mirror != first.is_mirror,
            rotation: unit(self.direction(first.rotation)),
            shift: self.point(first.shift),
        }
    }

    /// The way back.
    pub(super) fn inverse(&self) -> Self {
        let rotation = if self.is_mirror { self.rotation } else { conjugate(self.rotation) };
        let turn_only = Self { is_mirror: self.is_mirror, rotation, shift: DVec2::ZERO };
        Self { shift: -turn_only.direction(self.shift), ..turn_only }
    }
}

/// x − iy of x + iy.
#[inline]
pub(super) fn conjugate(z: DVec2) -> DVec2 {
    DVec2::new(z.x, -z.y)
}

/// A direction whose length is 1 up to rounding, made 1 again: products of products would grow without bound.
fn unit(z: DVec2) -> DVec2 {
    z * (1.5 - 0.5 * z.length_squared())
}

#[cfg(test)]
mod tests {
    use espalier_geom::math::unit_vector;

    use super::*;
    use crate::common::stream;

    #[test]
    fn carries_composes_and_inverts() {
        let mut stream = stream(5100);
        for round in 0..200 {
            let mut place = || {
                let point = DVec2::new(stream.normal(), stream.normal());
                (point, unit_vector(stream.uniform(-3.0, 3.0)))
            };
            let (a, b, c, d) = (place(), place(), place(), place());
            let (first, second) =
                (Isometry::carrying(a, b, round % 2 == 0), Isometry::carrying(c, d, round % 3 == 0));
            let near = |p: DVec2, q: DVec2| assert!(p.distance(q) < 1e-12, "round {round}: {p} {q}");
            near(first.point(a.0), b.0);
            near(first.direction(a.1), b.1);
            near(second.after(&first).point(c.1), second.point(first.point(c.1)));
            near(second.after(&first).direction(c.1), second.direction(first.direction(c.1)));
            near(first.inverse().point(first.point(d.0)), d.0);
            near(first.inverse().direction(first.direction(d.1)), d.1);
        }
    }
}
