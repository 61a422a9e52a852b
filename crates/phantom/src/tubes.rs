//! The closed forms: straight, bent and helical tubes, Y, torus, comb.
//!
//! **Input** [`Params`]. **Output** [`Shape`] and [`Truth`].
//! **Notation** a the axis, b the side to which bends and branches go; L `length_mm`, r `radius_mm`,
//! R `ring_radius_mm` or `bend_radius_mm`, β an angle, s arc length.
//! **Guarantees** a node at every corner, fork and end; nodes at most `step_mm` apart.
//! **Cost** O(nodes).

use std::f64::consts::{PI, TAU};

use espalier_geom::math;
use glam::DVec3;

use crate::shape::{Frame, Shape};
use crate::{Error, Kind, Params, Truth};

/// The shape of a closed form and what is known about it. `kind` must be one of the closed forms.
pub(crate) fn shape(kind: Kind, params: &Params) -> Result<(Shape, Truth), Error> {
    match kind {
        Kind::Bent => bent(params),
        Kind::Helix => helix(params),
        Kind::Y => fork(params),
        Kind::Torus => torus(params),
        Kind::Comb => comb(params),
        Kind::Straight | Kind::Airway | Kind::Vessel | Kind::Neuron => straight(params),
    }
}

/// From −L/2 to L/2 along the axis.
fn straight(params: &Params) -> Result<(Shape, Truth), Error> {
    let (frame, length) = (Frame::of(params), params.length_mm);
    let mut shape = Shape::default();
    let start = -0.5 * length * frame.axis;
    let root = shape.push(None, start, params.radius_mm);
    let radius = tapered(params, length);
    shape.trace(root, (length, params.step_mm), |s| start + s * frame.axis, &radius)?;
    Ok((shape, Truth { volume_mm3: tube_volume(params, length), ..truth(params, length, 1) }))
}

/// A leg of length L along the axis to the origin, an arc of radius R that turns by β, and a leg of length L.
fn bent(params: &Params) -> Result<(Shape, Truth), Error> {
    let (frame, leg, bend) = (Frame::of(params), params.length_mm, params.bend_radius_mm);
    let beta = params.bend_angle_deg.to_radians();
    let arc = bend * beta;
    let total = 2.0 * leg + arc;
    let radius = tapered(params, total);
    let center = bend * frame.side;
    let on_arc = |s: f64| {
        let turned = math::unit_vector(s / bend);
        center - bend * turned.x * frame.side + bend * turned.y * frame.axis
    };
    let bend_end = if arc > 0.0 { on_arc(arc) } else { DVec3::ZERO };

    let mut shape = Shape::default();
    let root = shape.push(None, -leg * frame.axis, params.radius_mm);
    let mut last = shape.trace(root, (leg, params.step_mm), |s| (s - leg) * frame.axis, &radius)?;
    if arc > 0.0 {
        last = shape.trace(last, (arc, params.step_mm), on_arc, |s| radius(leg + s))?;
    }
    let out = frame.turned(beta);
    shape.trace(last, (leg, params.step_mm), |s| bend_end + s * out, |s| radius(leg + arc + s))?;

    // A sharp bend overlaps itself inside the corner; a round one has no closed form if it is tighter than the
    // tube is thick.
    let volume_mm3 = if bend >= params.radius_mm || beta == 0.0 { tube_volume(params, total) } else { None };
    let bend_angle_deg = Some(params.bend_angle_deg);
    Ok((shape, Truth { volume_mm3, bend_angle_deg, ..truth(params, total, 1) }))
}

/// A helix of radius R about the axis, right-handed.
fn helix(params: &Params) -> Result<(Shape, Truth), Error> {
    let (frame, ring) = (Frame::of(params), params.ring_radius_mm);
    let per_turn = math::hypot(TAU * ring, params.pitch_mm);
    let length = params.turns * per_turn;
    let radius = tapered(params, length);
    let curve = |s: f64| {
        let turns = s / per_turn;
        let around = math::unit_vector(TAU * turns);
        let height = (turns - 0.5 * params.turns) * params.pitch_mm;
        ring * around.x * frame.side + ring * around.y * frame.depth + height * frame.axis
    };
    let mut shape = Shape::default();
    let root = shape.push(None, curve(0.0), params.radius_mm);
    shape.trace(root, (length, params.step_mm), curve, &radius)?;

    // By Pappus, if the tube nowhere meets itself: the curvature radius (R² + (p/2π)²)/R and the gap between
    // turns, about p·2πR/per_turn, must both leave room for the radius.
    let rise = params.pitch_mm / TAU;
    let curvature_radius = (ring * ring + rise * rise) / ring;
    let gap = params.pitch_mm * TAU * ring / per_turn;
    let is_embedded =
        curvature_radius > params.radius_mm && (gap > 2.0 * params.radius_mm || params.turns < 0.5);
    let volume_mm3 = if is_embedded { tube_volume(params, length) } else { None };
    Ok((shape, Truth { volume_mm3, ..truth(params, length, 1) }))
}

/// A stem along the axis to the origin, and two branches that share the angle β between them.
fn fork(params: &Params) -> Result<(Shape, Truth), Error> {
    let (frame, length) = (Frame::of(params), params.length_mm);
    let beta = params.branch_angle_deg.to_radians();
    let radius = tapered(params, 2.0 * length);
    let mut shape = Shape::default();
    let root = shape.push(None, -length * frame.axis, params.radius_mm);
    let hub = shape.trace(root, (length, params.step_mm), |s| (s - length) * frame.axis, &radius)?;
    for angle in [params.branch_share * beta, (params.branch_share - 1.0) * beta] {
        let out = frame.turned(angle);
        shape.trace(hub, (length, params.step_mm), |s| s * out, |s| radius(length + s))?;
    }
    let branch_angle_deg = Some(params.branch_angle_deg);
    Ok((shape, Truth { branch_angle_deg, ..truth(params, 3.0 * length, 2) }))
}

/// A ring of radius R about the axis; its tree leaves out the last step, back to the root.
fn torus(params: &Params) -> Result<(Shape, Truth), Error> {
    let (frame, ring) = (Frame::of(params), params.ring_radius_mm);
    let around = |s: f64| {
        let at = math::unit_vector(s / ring);
        ring * at.x * frame.side + ring * at.y * frame.depth
    };
    // At least a triangle; the last step, back to the root, is the one that the tree leaves out.
    let n_nodes = (TAU * ring / params.step_mm).ceil().max(3.0);
    let step = TAU * ring / n_nodes;
    let mut shape = Shape::default();
    let root = shape.push(None, around(0.0), params.radius_mm);
    let opened = TAU * ring - step;
    let last = shape.trace(root, (opened, step * (1.0 + 1e-9)), around, |_| params.radius_mm)?;
    shape.closing.push((last, root));

    let tube = params.radius_mm;
    let volume_mm3 = (ring >= tube).then_some(2.0 * PI * PI * ring * tube * tube);
    let radius_range_mm = [tube, tube];
    Ok((shape, Truth { volume_mm3, n_loops: 1, radius_range_mm, ..truth(params, TAU * ring, 1) }))
}

/// A stem along the axis with teeth to one side, evenly spaced, the ends of the stem free.
fn comb(params: &Params) -> Result<(Shape, Truth), Error> {
    let (frame, pitch, tooth) = (Frame::of(params), params.tooth_pitch_mm, params.tooth_length_mm);
    let stem = pitch * (params.n_teeth + 1) as f64;
    let radius = tapered(params, stem + tooth);
    let start = -0.5 * stem * frame.axis;
    let mut shape = Shape::default();
    let mut hub = shape.push(None, start, params.radius_mm);
    for tooth_idx in 0..=params.n_teeth {
        let from = pitch * tooth_idx as f64;
        let along = |s: f64| start + (from + s) * frame.axis;
        hub = shape.trace(hub, (pitch, params.step_mm), along, |s| radius(from + s))?;
        if tooth_idx < params.n_teeth {
            let foot = along(pitch);
            shape.trace(
                hub,
                (tooth, params.step_mm),
                |s| foot + s * frame.side,
                |s| radius(from + pitch + s),
            )?;
        }
    }
    Ok((shape, truth(params, stem + tooth * params.n_teeth as f64, params.n_teeth + 1)))
}

/// The radius at arc length s of a path of `length_mm`, linear from the root's to the tip's.
fn tapered(params: &Params, length_mm: f64) -> impl Fn(f64) -> f64 + use<> {
    let (root, tip) = (params.radius_mm, params.radius_mm * params.taper);
    move |s| root + (tip - root) * s / length_mm
}

/// The volume of a tube of constant radius with round ends that nowhere meets itself.
fn tube_volume(params: &Params, length_mm: f64) -> Option<f64> {
    let r = params.radius_mm;
    (params.taper == 1.0).then_some(PI * r * r * length_mm + 4.0 / 3.0 * PI * r * r * r)
}

fn truth(params: &Params, length_mm: f64, n_tips: usize) -> Truth {
    Truth {
        length_mm,
        volume_mm3: None,
        bend_angle_deg: None,
        branch_angle_deg: None,
        radius_range_mm: [params.radius_mm * params.taper, params.radius_mm],
        n_tips,
        n_loops: 0,
        segmentation: None,
    }
}
