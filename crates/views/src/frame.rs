//! The frame of a picture: which side of a plane faces the viewer, and what is up.
//!
//! **Input** a direction, up to its sign; a reference [`Frame`].
//! **Output** a unit `towards_camera` and a unit `up` perpendicular to it.
//! **Steps** 1. Of v and −v take the one that faces the reference camera; where the plane stands on edge, the one
//! seen from the reference's below, then from its right. 2. Up is the reference's up, projected; looking along
//! it, the direction towards the reference's camera.
//! **Guarantees** with the reference [`Frame::ANTERIOR`] a coronal picture has the patient's right on the viewer's
//! left and cranial up, an axial one is seen from the feet with anterior up, a sagittal one from the left with
//! anterior on the left: the radiological conventions.
//! **Source** ours: the loss of [Hu2022] does not change with the sign of v, and its cameras' up is free.

use espalier_geom::space::plane_axes;
use espalier_model::View;
use glam::DVec3;

/// Cosine below which a direction counts as perpendicular to another.
const ON_EDGE: f64 = 1e-9;

/// A camera's direction and what is up in its picture: two perpendicular unit vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub(crate) towards_camera: DVec3,
    pub(crate) up: DVec3,
}

impl Frame {
    /// The camera in front of a standing patient: +A towards the camera, +S up.
    pub(crate) const ANTERIOR: Self = Self { towards_camera: DVec3::Y, up: DVec3::Z };

    /// The frame of a view.
    pub(crate) fn of(view: &View) -> Self {
        Self { towards_camera: view.towards_camera, up: view.up }
    }

    /// The frame for looking from `towards_camera`, with this frame's up as far as that goes.
    pub(crate) fn seen_from(self, towards_camera: DVec3) -> Self {
        let looks_along_up = towards_camera.cross(self.up).length() < ON_EDGE;
        let up_hint = if looks_along_up { self.towards_camera } else { self.up };
        Self { towards_camera, up: plane_axes(towards_camera, up_hint).1 }
    }

    /// The one of `direction` and its opposite that faces this frame's camera.
    pub(crate) fn facing(self, direction: DVec3) -> DVec3 {
        let from_the_right = self.up.cross(self.towards_camera);
        let sides = [self.towards_camera, -self.up, from_the_right];
        let cosine = sides.map(|side| direction.dot(side)).into_iter().find(|cosine| cosine.abs() > ON_EDGE);
        if cosine.is_some_and(|cosine| cosine < 0.0) { -direction } else { direction }
    }

    /// The direction perpendicular to `along` that is nearest to this frame's camera; where `along` points at the
    /// camera, the one nearest to its up.
    pub(crate) fn nearest_across(self, along: DVec3) -> DVec3 {
        let points_at_camera = along.cross(self.towards_camera).length() < ON_EDGE;
        let hint = if points_at_camera { self.up } else { self.towards_camera };
        plane_axes(along, hint).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radiological_conventions() {
        let right_and_up = |direction: DVec3| {
            let frame = Frame::ANTERIOR.seen_from(Frame::ANTERIOR.facing(direction));
            (frame.up.cross(frame.towards_camera), frame.up)
        };
        for sign in [1.0, -1.0] {
            assert_eq!(right_and_up(DVec3::Y * sign), (DVec3::NEG_X, DVec3::Z), "coronal");
            assert_eq!(right_and_up(DVec3::Z * sign), (DVec3::NEG_X, DVec3::Y), "axial");
            assert_eq!(right_and_up(DVec3::X * sign), (DVec3::NEG_Y, DVec3::Z), "sagittal");
        }
    }

    #[test]
    fn nearest_across_is_across() {
        for along in espalier_geom::space::half_sphere(40).chain([DVec3::Y, DVec3::NEG_Y, DVec3::Z]) {
            let across = Frame::ANTERIOR.nearest_across(along);
            assert!(across.dot(along).abs() < 1e-12 && (across.length() - 1.0).abs() < 1e-12);
            assert!(across.dot(DVec3::Y) >= -1e-12);
        }
    }
}
