//! Where a NIfTI volume lies in the world.
//!
//! **Input** the header's fields. **Output** `world_from_voxel`, RAS+ mm.
//! **Steps** the ladder: 1. the sform where its code is above 0; 2. else the qform where its code is above 0;
//! 3. else the space that the caller assumes; 4. else an error that says how others would read the file. Where
//! sform and qform are both set and disagree, the sform is used, and a warning records both.
//! **Guarantees** the numbers are finite. That they make a grid is checked by [`Grid`](espalier_model::Grid).
//! **Source** `nifti1.h` and `nifti2.h`: methods 1 to 3 of orienting a volume, and quaternions to rotations.

use espalier_model::Report;
use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::fields::Fields;
use crate::{AssumedSpace, ReadError};

/// What is made of a header without a place.
const READINGS: &str = "neither sform nor qform is set; by the NIfTI standard the axes are then RAS, many programs \
                        read LAS, which mirrors left and right";
/// Two affines that put no corner of the volume farther apart than this are the same.
const AGREE_MM: f64 = 0.01;
/// How far b² + c² + d² may exceed 1 by rounding in other programs.
const MAX_EXCESS: f64 = 1e-3;
/// Below this, a² is rounding only, so that the rotation is by 180° (as in `nifti1_io.c`).
const MIN_REAL_SQUARED: f64 = 1e-7;

/// The affine, and the name of the fields that it comes from.
pub(crate) fn world_from_voxel(
    fields: &Fields,
    shape: [usize; 3],
    unit_mm: f64,
    assumed: Option<AssumedSpace>,
    report: &mut Report,
) -> Result<(DAffine3, &'static str), ReadError> {
    let in_mm = |affine: DAffine3| DAffine3 {
        matrix3: affine.matrix3 * unit_mm,
        translation: affine.translation * unit_mm,
    };
    if fields.sform_code > 0 {
        let affine = in_mm(sform(fields)?);
        if fields.qform_code > 0 {
            warn_if_forms_disagree(&affine, &qform(fields).map(in_mm), fields, shape, report);
        }
        warn_if_pixdim_disagrees(&affine, fields, unit_mm, report);
        return Ok((affine, "sform"));
    }
    if fields.qform_code > 0 {
        return Ok((in_mm(qform(fields)?), "qform"));
    }
    let spacing_mm = pixdim("pixdim", fields)? * unit_mm;
    let signs = assumed.ok_or(ReadError::NoSpace { spacing_mm, readings: READINGS })?.ras_signs();
    report.warn("W-VOLUME-ASSUMED-SPACE", "neither sform nor qform is set: the axes are as assumed");
    Ok((DAffine3::from_mat3(DMat3::from_diagonal(spacing_mm * signs)), "pixdim"))
}

fn sform(fields: &Fields) -> Result<DAffine3, ReadError> {
    let column = |i: usize| DVec3::from_array(fields.srow.map(|row| row[i]));
    let affine = DAffine3::from_cols(column(0), column(1), column(2), column(3));
    if affine.is_finite() {
        Ok(affine)
    } else {
        Err(ReadError::Form { form: "sform", problem: "it holds a number that is not finite".to_owned() })
    }
}

fn qform(fields: &Fields) -> Result<DAffine3, ReadError> {
    let fault = |problem: String| ReadError::Form { form: "qform", problem };
    let spacing = pixdim("qform", fields)?;
    let [b, c, d] = fields.quatern;
    let origin = DVec3::from_array(fields.qoffset);
    let imaginary_squared = b * b + c * c + d * d;
    if !origin.is_finite() || !imaginary_squared.is_finite() {
        return Err(fault("it holds a number that is not finite".to_owned()));
    }
    if imaginary_squared > 1.0 + MAX_EXCESS {
        return Err(fault(format!("the quaternion parts {b}, {c}, {d} are longer than 1")));
    }
    let real_squared = 1.0 - imaginary_squared;
    let real = if real_squared < MIN_REAL_SQUARED { 0.0 } else { real_squared.sqrt() };
    let rotation = DMat3::from_quat(DQuat::from_xyzw(b, c, d, real).normalize());
    // Only a negative pixdim[0] means left-handed; 0 is common and means 1.
    let qfac = if fields.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
    let scale = DMat3::from_diagonal(spacing * DVec3::new(1.0, 1.0, qfac));
    Ok(DAffine3::from_mat3_translation(rotation * scale, origin))
}

/// The voxel's size by `pixdim`, in the file's unit.
fn pixdim(form: &'static str, fields: &Fields) -> Result<DVec3, ReadError> {
    let spacing = DVec3::new(fields.pixdim[1], fields.pixdim[2], fields.pixdim[3]);
    if spacing.is_finite() && spacing.min_element() > 0.0 {
        return Ok(spacing);
    }
    let problem = format!("pixdim says a spacing of {} x {} x {}", spacing.x, spacing.y, spacing.z);
    Err(ReadError::Form { form, problem })
}

fn warn_if_forms_disagree(
    sform: &DAffine3,
    qform: &Result<DAffine3, ReadError>,
    fields: &Fields,
    shape: [usize; 3],
    report: &mut Report,
) {
    let qform = match qform {
        Ok(qform) => qform,
        Err(problem) => {
            report.warn("W-NIFTI-QFORM", format!("{problem}; the sform is used"));
            return;
        }
    };
    let far = DVec3::from_array(shape.map(|extent| extent as f64 - 1.0));
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * far;
    let distance = |i: u32| sform.transform_point3(corner(i)).distance(qform.transform_point3(corner(i)));
    let distance_mm = (0..8).map(distance).fold(0.0, f64::max);
    let origins_mm = sform.translation.distance(qform.translation);
    let turned_mm = (sform.matrix3 * far).length() * quaternion_rounding(fields);
    let is_mirrored = sform.matrix3.determinant() * qform.matrix3.determinant() < 0.0;
    if is_mirrored || origins_mm > AGREE_MM || distance_mm > AGREE_MM + turned_mm {
        report.count("forms_disagree_mm", distance_mm);
        report.warn(
            "W-NIFTI-FORMS",
            format!(
                "sform and qform disagree by up to {distance_mm:.3} mm{}: sform is used ({}), not qform ({})",
                if is_mirrored { " and in handedness" } else { "" },
                shown(sform),
                shown(qform)
            ),
        );
    }
}

/// The angle by which a rotation may be off because b, c and d are stored in few digits and a is computed
/// from them: near half a turn a is small, and the error of its square weighs heavily.
fn quaternion_rounding(fields: &Fields) -> f64 {
    let [b, c, d] = fields.quatern;
    let real = (1.0 - b * b - c * c - d * d).max(MIN_REAL_SQUARED).sqrt();
    2.0 * fields.precision / real
}

fn shown(affine: &DAffine3) -> String {
    let column = |v: DVec3| format!("[{:.4} {:.4} {:.4}]", v.x, v.y, v.z);
    let axes = affine.matrix3;
    [axes.x_axis, axes.y_axis, axes.z_axis, affine.translation].map(column).join(" ")
}

/// The sform decides, but programs that take the spacing from `pixdim` would see another volume.
fn warn_if_pixdim_disagrees(affine: &DAffine3, fields: &Fields, unit_mm: f64, report: &mut Report) {
    let axes = affine.matrix3;
    let lengths = [axes.x_axis.length(), axes.y_axis.length(), axes.z_axis.length()];
    let stated = [1, 2, 3].map(|axis| fields.pixdim[axis] * unit_mm);
    let agrees = (0..3).all(|axis| (lengths[axis] - stated[axis]).abs() <= 1e-3 * lengths[axis]);
    if !agrees {
        let [x, y, z] = lengths;
        report.warn(
            "W-NIFTI-PIXDIM",
            format!(
                "pixdim {stated:?} is not the spacing {x:.4} x {y:.4} x {z:.4} mm of the sform, which is used"
            ),
        );
    }
}
