//! Radii: a mask and its curve skeleton in, the inscribed sphere at each skeleton voxel out.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `nearest` | exact anisotropic distance of any place to the background, from the mask's bits |
//! | 2 | `tangent` | which way the skeleton runs at each of its voxels |
//! | 3 | `ridge` | from the voxel to the axis of the branch, and the radius there |
//! | 4 | `section` | area and centroid of the mask's cross-section |
//! | 5 | `boundary` | where the section is not round: the ridge of the distance between voxels |
//! | 6 | `gap` | the wall lies between the last voxels inside and the first outside |
//! | 7 | `wall/*` | where the scan shows the wall, which is not where a threshold has ended the mask |
//! | – | `distance` | the distance of every foreground voxel, for those who ask for the whole field |
//!
//! **Spaces** inside this crate points are *grid mm*: voxel coordinates times spacing. Spheres come out in RAS+ mm.

mod boundary;
mod distance;
mod error;
mod gap;
mod nearest;
mod params;
mod ridge;
mod section;
mod tangent;
mod wall;

use espalier_model::{InscribedSpheres, Mask, Report, Skeleton, Sphere, Volume};
use glam::DVec3;
use rayon::prelude::*;

pub use distance::{DistanceField, distance_field, distance_field_within};
pub use error::Error;
pub use params::{Params, Rule, Wall};

use nearest::Background;
use ridge::OnAxis;

/// Voxels may be so many times as long as wide: the search for sections grows with the square of it.
const MOST_UNEVEN: f64 = 1000.0;
/// The share of places that must show a wall; with fewer the scan is too noisy, or another's, and what it shows is chance.
const LEAST_SEEN: f64 = 0.5;

/// The inscribed spheres of a skeleton and what their making did.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// One sphere for each skeleton voxel, in the same order.
    pub spheres: InscribedSpheres,
    /// Counts `spheres`, `cut_spheres`, `sections_without_direction`; of the mask `radius_min_mm`, `radius_max_mm`,
    /// `center_shift_mean_mm`; a warning where the border of the scan cuts spheres.
    pub report: Report,
}

/// The inscribed sphere at each voxel of `skeleton` in `mask`.
///
/// # Errors
/// [`Error::GridMismatch`] if the two have different grids, [`Error::EmptySkeleton`], and [`Error::OutsideMask`]
/// at the first skeleton voxel that is background.
pub fn inscribed_spheres(mask: &Mask, skeleton: &Skeleton, params: &Params) -> Result<Measured, Error> {
    check_spacing(mask)?;
    let distances_mm = distances_mm(mask, skeleton)?;
    let tangents = tangent::along(skeleton, &tangent::neighbors(skeleton), &distances_mm);
    let spheres: Vec<Sphere> = (0..skeleton.voxels().len())
        .into_par_iter()
        .map(|i| measure(mask, skeleton.voxels()[i], (distances_mm[i], tangents[i]), params))
        .collect();
    let report = report(skeleton, &spheres);
    Ok(Measured { spheres: InscribedSpheres(spheres), report })
}

/// The spheres of a mask, as [`inscribed_spheres`] has measured them, with the wall where `scan` shows it.
///
/// The report counts `walls` (places that show one), `wall_beyond_mean_mm`, and what the scan's thick branches say:
/// `lumen_value`, `wall_value` (of dark lumina; of bright ones what is around them), `blur_mm`. Where fewer than half of the
/// places show a wall the radii keep to the mask, with a warning.
///
/// # Errors
/// As [`inscribed_spheres`].
pub fn walls(
    (mask, skeleton): (&Mask, &Skeleton),
    spheres: &InscribedSpheres,
    scan: &Volume,
    params: &Params,
) -> Result<Measured, Error> {
    let distances_mm = distances_mm(mask, skeleton)?;
    let neighbors = tangent::neighbors(skeleton);
    let tangents = tangent::along(skeleton, &neighbors, &distances_mm);
    let background = Background::of(mask);
    let grid_mm =
        |point_mm: DVec3| mask.grid().voxel_from_world().transform_point3(point_mm) * background.spacing_mm();
    let place = |(sphere, tangent): (&Sphere, &Option<DVec3>)| {
        let tangent = (*tangent)?;
        Some(wall::Place { center: grid_mm(sphere.center_mm), tangent, radius_mm: sphere.radius_mm })
    };
    let places: Vec<Option<wall::Place>> = spheres.0.iter().zip(&tangents).map(place).collect();
    let found = wall::Scan::new((background, mask.grid()), scan).walls(&places, &neighbors);
    let is_seen = found.n_seen as f64 >= LEAST_SEEN * spheres.0.len() as f64;
    // The wall in the scan is where it is, whatever was added to the mask's radii.
    let offset_mm = params.offset_voxels * background.spacing_mm().min_element();
    let with_wall = |(sphere, beyond_mm): (&Sphere, &f64)| {
        let wall_mm = if is_seen { (beyond_mm - offset_mm).max(-sphere.radius_mm) } else { 0.0 };
        Sphere { wall_mm, ..*sphere }
    };
    let spheres: Vec<Sphere> = spheres.0.iter().zip(&found.beyond_mm).map(with_wall).collect();
    let report = report_of_walls(&found, (is_seen, &spheres));
    Ok(Measured { spheres: InscribedSpheres(spheres), report })
}

fn report_of_walls(found: &wall::Walls, (is_seen, spheres): (bool, &[Sphere])) -> Report {
    let (mut report, n) = (Report::default(), spheres.len());
    report.count_usize("walls", found.n_seen);
    report.count("wall_beyond_mean_mm", spheres.iter().map(|sphere| sphere.wall_mm).sum::<f64>() / n as f64);
    report.count("lumen_value", found.lumen);
    report.count("wall_value", found.wall);
    report.count("blur_mm", found.blur_mm);
    if !is_seen {
        let message = format!(
            "the scan shows a wall at {} of {n} places of the skeleton only: the radii keep to the mask",
            found.n_seen
        );
        report.warn("W-RADIUS-WALL", message);
    }
    report
}

/// The exact distance from each voxel of `skeleton` to the nearest background centre of `mask`, in mm; infinite in a
/// mask without background.
///
/// # Errors
/// As [`inscribed_spheres`].
pub fn distances_mm(mask: &Mask, skeleton: &Skeleton) -> Result<Vec<f64>, Error> {
    check(mask, skeleton)?;
    let background = Background::of(mask);
    let distance_mm = |voxel: &[u32; 3]| background.distance_mm(voxel.map(i64::from));
    Ok(skeleton.voxels().par_iter().map(distance_mm).collect())
}

fn check(mask: &Mask, skeleton: &Skeleton) -> Result<(), Error> {
    if mask.grid() != skeleton.grid() {
        return Err(Error::GridMismatch { mask: mask.grid().shape(), skeleton: skeleton.grid().shape() });
    }
    if skeleton.voxels().is_empty() {
        return Err(Error::EmptySkeleton);
    }
    match skeleton.voxels().iter().find(|voxel| !mask.contains(voxel.map(i64::from))) {
        Some(&voxel) => Err(Error::OutsideMask { voxel }),
        None => Ok(()),
    }
}

fn check_spacing(mask: &Mask) -> Result<(), Error> {
    let spacing = mask.grid().spacing_mm();
    let ratio = spacing.max_element() / spacing.min_element();
    if ratio <= MOST_UNEVEN { Ok(()) } else { Err(Error::Uneven { ratio, spacing_mm: spacing.to_array() }) }
}

/// The sphere of one skeleton voxel, whose own distance and direction are known.
fn measure(
    mask: &Mask,
    voxel: [u32; 3],
    (distance_mm, tangent): (f64, Option<DVec3>),
    params: &Params,
) -> Sphere {
    let background = Background::of(mask);
    let voxel = voxel.map(i64::from);
    let OnAxis { center, radius_mm, section } = match params.rule {
        Rule::Voxel => {
            let center = background.position_mm(voxel);
            let section = tangent
                .and_then(|tangent| section::through(background, (voxel, center), tangent, distance_mm));
            OnAxis { center, radius_mm: distance_mm, section }
        }
        Rule::NeighborhoodMax => OnAxis {
            radius_mm: background.neighborhood_max_mm(voxel),
            ..ridge::on_axis(background, voxel, (distance_mm, tangent), params.climb_steps)
        },
        Rule::Ridge => ridge::on_axis(background, voxel, (distance_mm, tangent), params.climb_steps),
    };
    let border_mm = background.border_mm(center);
    // Without any background the border of the scan is all there is to measure.
    let known = |distance_mm: f64| if distance_mm.is_finite() { distance_mm } else { border_mm };
    let offset_mm = params.offset_voxels * background.spacing_mm().min_element();
    let radius_mm = (known(radius_mm) + offset_mm).max(0.0);
    Sphere {
        center_mm: mask.grid().world_from_voxel().transform_point3(center / background.spacing_mm()),
        radius_mm,
        distance_mm: known(distance_mm),
        area_radius_mm: section.map_or(f64::NAN, |section| section.area_radius_mm),
        wall_mm: 0.0,
        is_cut: border_mm < radius_mm,
    }
}

fn report(skeleton: &Skeleton, spheres: &[Sphere]) -> Report {
    let mut report = Report::default();
    let n_cut = spheres.iter().filter(|sphere| sphere.is_cut).count();
    let world_from_voxel = skeleton.grid().world_from_voxel();
    let shift_mm: f64 = skeleton
        .voxels()
        .iter()
        .zip(spheres)
        .map(|(voxel, sphere)| {
            let start = world_from_voxel.transform_point3(DVec3::from_array(voxel.map(f64::from)));
            start.distance(sphere.center_mm)
        })
        .sum();
    let radii = || spheres.iter().map(|sphere| sphere.radius_mm);
    report.count_usize("spheres", spheres.len());
    report.count_usize("cut_spheres", n_cut);
    report.count_usize(
        "sections_without_direction",
        spheres.iter().filter(|sphere| sphere.area_radius_mm.is_nan()).count(),
    );
    report.count("radius_min_mm", radii().fold(f64::INFINITY, f64::min));
    report.count("radius_max_mm", radii().fold(0.0, f64::max));
    report.count("center_shift_mean_mm", shift_mm / spheres.len() as f64);
    if n_cut > 0 {
        report.warn(
            "W-RADIUS-CUT",
            format!(
                "{n_cut} of {} spheres touch the border of the scan: their radii are lower bounds",
                spheres.len()
            ),
        );
    }
    report
}
