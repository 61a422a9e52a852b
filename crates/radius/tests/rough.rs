//! Tubes whose surface has flipped voxels, as segmenters leave them: the axis and the radius are still the tube's.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Grid, Mask, Skeleton};
use espalier_radius::{Params, inscribed_spheres};
use glam::DVec3;

/// The share of the voxels next to the surface that are flipped.
const SHARE: f64 = 0.15;

/// Mean distance of the centres from the axis, and mean and mean absolute error of the radius, in voxels.
fn errors(radius: f64, direction: DVec3) -> [f64; 3] {
    let (length, direction) = (60.0, direction.normalize());
    let extent = direction.abs() * length + 2.0 * radius + 6.0;
    let center = 0.5 * extent + DVec3::new(0.3, 0.1, 0.37);
    let shape = extent.ceil().to_array().map(|n| n as usize + 1);
    let grid = Grid::axis_aligned(shape, DVec3::ONE, DVec3::ZERO).expect("a grid");
    let off_axis = |point: DVec3| (point - center).reject_from_normalized(direction).length();
    let stream = std::cell::RefCell::new(Stream::new(5, Purpose::Test, 0, 0));
    let mask = Mask::from_fn(grid.clone(), |voxel| {
        let point = DVec3::from_array(voxel.map(|c| c as f64));
        let is_inside = off_axis(point) <= radius && (point - center).dot(direction).abs() <= 0.5 * length;
        let is_flipped = (off_axis(point) - radius).abs() < 0.5 && stream.borrow_mut().unit() < SHARE;
        is_inside != is_flipped
    });
    // The curve runs beside the axis, as thinning leaves it.
    let steps = (0..=400).map(|i| center + direction * length * (f64::from(i) / 400.0 - 0.5));
    let voxels = steps.filter_map(|point| grid.voxel_at(point)).map(|[x, y, z]| [x + 1, y, z]);
    let voxels: Vec<[u32; 3]> =
        voxels.filter(|&voxel| mask.bits().get(voxel)).map(|voxel| voxel.map(|c| c as u32)).collect();
    let skeleton = Skeleton::new(grid.clone(), voxels);
    let spheres = inscribed_spheres(&mask, &skeleton, &Params::default()).expect("measured").spheres.0;
    let is_inner = |center_mm: DVec3| (center_mm - center).dot(direction).abs() < 0.5 * length - 2.0 * radius;
    let inner: Vec<_> = spheres.iter().filter(|sphere| is_inner(sphere.center_mm)).collect();
    assert!(inner.len() > 25, "{} spheres", inner.len());
    let mean = |value: &dyn Fn(&espalier_model::Sphere) -> f64| {
        inner.iter().map(|sphere| value(sphere)).sum::<f64>() / inner.len() as f64
    };
    let error = |sphere: &espalier_model::Sphere| sphere.radius_mm - radius;
    [mean(&|s| off_axis(s.center_mm)), mean(&error), mean(&|s| error(s).abs())]
}

#[test]
fn a_rough_surface_moves_neither_axis_nor_radius() {
    let directions =
        [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE, DVec3::new(1.0, -0.3, 0.2), DVec3::new(0.2, 0.5, 1.0)];
    for radius in [2.0, 3.0, 4.3, 8.0] {
        let all = directions.map(|direction| errors(radius, direction));
        let [off_axis, bias, absolute] =
            [0, 1, 2].map(|i| all.iter().map(|errors| errors[i]).sum::<f64>() / all.len() as f64);
        let found = format!("radius {radius}: off axis {off_axis:.3}, bias {bias:.3}, MAE {absolute:.3}");
        assert!(off_axis <= 0.25 && bias.abs() <= 0.15 && absolute <= 0.25, "{found}");
    }
}
