//! Bodies whose axis and radius are known.
//!
//! The skeleton given is the row of voxels that the true axis passes through, moved off it as far as thinning
//! does, so that the figures are those of this crate alone.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]

use espalier_model::{Grid, InscribedSpheres, Mask, Skeleton};
use espalier_radius::{Error, Params, Rule, inscribed_spheres};
use glam::DVec3;

/// A curve of voxels through the points of a path, 26-connected, shifted by whole voxels where that stays inside.
fn skeleton_along(mask: &Mask, path: impl Iterator<Item = DVec3>, shift: [i64; 3]) -> Skeleton {
    let grid = mask.grid();
    let voxels = path
        .filter_map(|point| grid.voxel_at(grid.voxel_from_world().transform_point3(point)))
        .map(|voxel| [0, 1, 2].map(|axis| voxel[axis] as i64 + shift[axis]))
        .filter(|&voxel| mask.contains(voxel))
        .map(|voxel| voxel.map(|c| c as u32))
        .collect();
    Skeleton::new(grid.clone(), voxels)
}

/// What a measurement is off by, over the spheres away from the ends.
#[derive(Debug, Default)]
struct Errors {
    n: f64,
    bias: f64,
    mean_absolute: f64,
    worst: f64,
    off_axis: f64,
    n_areas: f64,
    area_absolute: f64,
}

impl Errors {
    fn add(&mut self, spheres: &InscribedSpheres, radius: f64, off_axis: impl Fn(DVec3) -> Option<f64>) {
        for sphere in &spheres.0 {
            let Some(off_axis) = off_axis(sphere.center_mm) else { continue };
            let error = sphere.radius_mm - radius;
            if error.abs() > 0.5 {
                println!("{sphere:?} off {off_axis} r {radius}");
            }
            self.n += 1.0;
            self.bias += error;
            self.mean_absolute += error.abs();
            self.worst = self.worst.max(error.abs());
            self.off_axis += off_axis;
            if !sphere.area_radius_mm.is_nan() {
                self.n_areas += 1.0;
                self.area_absolute += (sphere.area_radius_mm - radius).abs();
            }
        }
    }

    fn finish(mut self, name: &str) -> Self {
        assert!(self.n > 50.0, "{name}: only {} spheres", self.n);
        self.bias /= self.n;
        self.mean_absolute /= self.n;
        self.off_axis /= self.n;
        self.area_absolute /= self.n_areas;
        println!(
            "{name}: n {} bias {:.3} MAE {:.3} worst {:.3} off axis {:.3} mm, area MAE {:.3} of {}",
            self.n,
            self.bias,
            self.mean_absolute,
            self.worst,
            self.off_axis,
            self.area_absolute,
            self.n_areas
        );
        self
    }
}

fn grid_about(extent: DVec3, spacing: DVec3) -> Grid {
    let shape = (extent / spacing).ceil().to_array().map(|n| n as usize + 1);
    Grid::axis_aligned(shape, spacing, DVec3::ZERO).expect("grid")
}

fn fill(grid: Grid, is_inside: impl Fn(DVec3) -> bool) -> Mask {
    let to_world = grid.world_from_voxel();
    Mask::from_fn(grid, |voxel| {
        is_inside(to_world.transform_point3(DVec3::from_array(voxel.map(|c| c as f64))))
    })
}

/// Straight tubes in eight directions, at three places relative to the voxels.
fn tubes(radius: f64, spacing: DVec3, rule: Rule, directions: &[[f64; 3]]) -> Errors {
    let mut errors = Errors::default();
    let length = 2.0 * radius + 24.0;
    for direction in directions.iter().map(|&d| DVec3::from_array(d).normalize()) {
        for place in [[0.0; 3], [0.5; 3], [0.3, 0.1, 0.37]].map(DVec3::from_array) {
            let extent = (direction.abs() * length + 2.0 * radius + 2.0 * spacing).ceil();
            let center = ((0.5 * extent / spacing).floor() + place) * spacing;
            let mask = fill(grid_about(extent, spacing), |p| {
                let along = (p - center).dot(direction);
                (p - center - direction * along).length() <= radius && along.abs() <= 0.5 * length
            });
            let steps = (0..=400).map(|i| center + direction * length * (f64::from(i) / 400.0 - 0.5));
            let skeleton = skeleton_along(&mask, steps, [1, 0, 0]);
            let params = Params { rule, ..Params::default() };
            let measured = inscribed_spheres(&mask, &skeleton, &params).expect("measured");
            errors.add(&measured.spheres, radius, |p| {
                let along = (p - center).dot(direction);
                let is_inner = along.abs() <= 0.5 * length - 1.3 * radius;
                is_inner.then(|| (p - center - direction * along).length())
            });
        }
    }
    errors.finish(&format!("tube of radius {radius} at {spacing}, {rule:?}"))
}

const DIRECTIONS: [[f64; 3]; 8] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
    [1.0, -0.3, 0.2],
    [0.2, 0.5, 1.0],
];

#[test]
fn isotropic_tubes() {
    for radius in [2.0, 3.0, 4.3, 6.0] {
        let errors = tubes(radius, DVec3::ONE, Rule::Ridge, &DIRECTIONS);
        assert!(errors.bias.abs() <= 0.15 && errors.mean_absolute <= 0.18 && errors.worst <= 0.5);
        assert!(errors.off_axis <= 0.15 && errors.area_absolute <= 0.2);
    }
}

#[test]
fn anisotropic_tubes() {
    for (radius, spacing) in [(10.0, DVec3::new(1.0, 1.0, 5.0)), (13.0, DVec3::new(1.0, 1.0, 5.0))] {
        let errors = tubes(radius, spacing, Rule::Ridge, &DIRECTIONS);
        assert!(errors.bias.abs() <= 0.15 && errors.mean_absolute <= 0.2 && errors.worst <= 0.5);
        assert!(errors.off_axis <= 0.25 && errors.area_absolute <= 0.5);
    }
}

#[test]
fn the_ridge_beats_the_voxels() {
    for (radius, spacing) in [(4.3, DVec3::ONE), (10.0, DVec3::new(1.0, 1.0, 5.0))] {
        let directions = &DIRECTIONS[3..6];
        let [ridge, maximum, voxel] = [Rule::Ridge, Rule::NeighborhoodMax, Rule::Voxel]
            .map(|rule| tubes(radius, spacing, rule, directions).mean_absolute);
        assert!(ridge < maximum && maximum < voxel, "{ridge}, {maximum}, {voxel}");
    }
}

#[test]
fn rings_and_helices() {
    for spacing in [DVec3::ONE, DVec3::new(1.0, 1.0, 5.0)] {
        let radius = 2.0 * spacing.max_element() + 0.3;
        let (bend, pitch) = (4.0 * radius, 4.5 * radius);
        let center = DVec3::new(bend + radius + 3.2, bend + radius + 3.4, radius + 6.0);
        for rise in [0.0, pitch / std::f64::consts::TAU] {
            let axis = |turn: f64| {
                let (sin, cos) = espalier_geom::math::sin_cos(turn);
                center + DVec3::new(bend * cos, bend * sin, rise * turn)
            };
            let path: Vec<DVec3> = (0..=1500).map(|i| axis(f64::from(i) * 5.5 / 1500.0)).collect();
            let nearest = |p: DVec3| {
                let squared = path.iter().map(|q| q.distance_squared(p)).enumerate();
                squared.min_by(|a, b| a.1.total_cmp(&b.1)).expect("path")
            };
            let extent = DVec3::new(2.0 * center.x, 2.0 * center.y, 2.0 * center.z + rise * 5.5);
            let mask = fill(grid_about(extent, spacing), |p| nearest(p).1 <= radius * radius);
            let skeleton = skeleton_along(&mask, path.iter().copied(), [0, 1, 0]);
            let measured = inscribed_spheres(&mask, &skeleton, &Params::default()).expect("measured");
            let mut errors = Errors::default();
            errors.add(&measured.spheres, radius, |p| {
                let (place, squared) = nearest(p);
                (150..1350).contains(&place).then(|| squared.sqrt())
            });
            let errors = errors.finish(&format!("rise {rise:.2} at {spacing}"));
            assert!(errors.bias.abs() <= 0.2 && errors.mean_absolute <= 0.3, "{errors:?}");
            assert!(errors.off_axis <= 0.2 * spacing.max_element(), "{errors:?}");
        }
    }
}

#[test]
fn balls() {
    for (radius, spacing) in [(4.0, DVec3::ONE), (7.3, DVec3::ONE), (12.0, DVec3::new(1.0, 1.0, 5.0))] {
        for place in [DVec3::ZERO, DVec3::splat(0.5)] {
            let grid = grid_about(DVec3::splat(2.0 * radius + 8.0), spacing);
            let center = ((DVec3::splat(radius + 4.0) / spacing).floor() + place) * spacing;
            let mask = fill(grid, |p| p.distance(center) <= radius);
            let skeleton = skeleton_along(&mask, std::iter::once(center), [1, 0, 0]);
            let sphere =
                inscribed_spheres(&mask, &skeleton, &Params::default()).expect("measured").spheres.0[0];
            let error = sphere.radius_mm - radius;
            println!("ball of radius {radius} at {spacing}, place {place}: error {error:.3}");
            assert!(error.abs() <= 0.5 * spacing.min_element(), "{error}");
            assert!(sphere.center_mm.distance(center) <= 0.5 * spacing.max_element());
            assert!(sphere.area_radius_mm.is_nan() && !sphere.is_cut, "a single voxel has no direction");
        }
    }
}

#[test]
fn the_border_of_the_scan_is_not_background_but_flagged() {
    // A tube of radius 4 that leaves the scan at both ends.
    let grid = grid_about(DVec3::new(20.0, 14.0, 14.0), DVec3::ONE);
    let mask = fill(grid, |p| (p - DVec3::new(p.x, 7.0, 7.0)).length() <= 4.0);
    let skeleton = skeleton_along(&mask, (0..=20).map(|x| DVec3::new(f64::from(x), 7.0, 7.0)), [0; 3]);
    let measured = inscribed_spheres(&mask, &skeleton, &Params::default()).expect("measured");
    for (x, sphere) in measured.spheres.0.iter().enumerate() {
        assert!((sphere.radius_mm - 4.0).abs() < 0.3, "x = {x}: {}", sphere.radius_mm);
        assert_eq!(sphere.is_cut, !(4..=16).contains(&x), "x = {x}");
    }
    assert_eq!(measured.report.get("cut_spheres"), Some(8.0));
    assert_eq!(measured.report.warnings[0].code, "W-RADIUS-CUT");

    // No background at all: what the scan shows is all there is.
    let full = fill(grid_about(DVec3::splat(4.0), DVec3::ONE), |_| true);
    let skeleton = skeleton_along(&full, std::iter::once(DVec3::splat(2.0)), [0; 3]);
    let sphere = inscribed_spheres(&full, &skeleton, &Params::default()).expect("measured").spheres.0[0];
    assert!(sphere.radius_mm == 2.5 && sphere.distance_mm == 2.5, "{sphere:?}");
}

#[test]
fn spheres_lie_in_the_world() {
    let affine = glam::DAffine3::from_cols(
        DVec3::new(0.0, -0.5, 0.0),
        DVec3::new(0.0, 0.0, 0.5),
        DVec3::new(-2.0, 0.0, 0.0),
        DVec3::new(100.0, -50.0, 7.0),
    );
    let grid = Grid::new([25, 25, 21], affine).expect("grid");
    let axis = DVec3::new(80.0, -56.0, 13.0);
    let mask = fill(grid, |p| (p - axis).with_x(0.0).length() <= 4.0);
    let skeleton = skeleton_along(&mask, (0..=40).map(|i| axis + DVec3::X * f64::from(i - 20)), [0, 1, 0]);
    for sphere in inscribed_spheres(&mask, &skeleton, &Params::default()).expect("measured").spheres.0 {
        assert!((sphere.center_mm - axis).with_x(0.0).length() < 0.1, "{sphere:?}");
        assert!((sphere.radius_mm - 4.0).abs() < 0.25, "{sphere:?}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let mask = fill(grid_about(DVec3::splat(30.0), DVec3::ONE), |p| (p - 15.0).with_x(0.0).length() <= 5.2);
    let skeleton = skeleton_along(&mask, (0..=30).map(|x| DVec3::new(f64::from(x), 16.0, 14.0)), [0; 3]);
    let text = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("pool");
        let measured = pool.install(|| inscribed_spheres(&mask, &skeleton, &Params::default()));
        measured.expect("measured").spheres.to_tsv()
    };
    assert_eq!(text(1), text(4));
}

#[test]
fn bad_input_is_refused() {
    let grid = Grid::axis_aligned([3, 3, 3], DVec3::ONE, DVec3::ZERO).expect("grid");
    let other = Grid::axis_aligned([3, 3, 3], DVec3::ONE, DVec3::X).expect("grid");
    let mask = Mask::from_fn(grid.clone(), |voxel| voxel == [1, 1, 1]);
    let long = Grid::axis_aligned([9, 9, 9], DVec3::new(1e-3, 1e-3, 100.0), DVec3::ZERO).expect("a grid");
    let all = Mask::from_fn(long.clone(), |voxel| voxel.iter().all(|c| (3..6).contains(c)));
    let one = Skeleton::new(long, vec![[4, 4, 4]]);
    let error = inscribed_spheres(&all, &one, &Params::default()).expect_err("no scan's");
    assert!(matches!(error, Error::Uneven { .. }), "{error}");
    let measure = |skeleton| inscribed_spheres(&mask, &skeleton, &Params::default()).map(|_| ());
    assert_eq!(measure(Skeleton::new(grid.clone(), vec![[1, 1, 1]])), Ok(()));
    assert_eq!(measure(Skeleton::new(grid.clone(), vec![])), Err(Error::EmptySkeleton));
    let outside = Skeleton::new(grid, vec![[1, 1, 1], [0, 1, 2]]);
    assert_eq!(measure(outside), Err(Error::OutsideMask { voxel: [0, 1, 2] }));
    assert!(matches!(measure(Skeleton::new(other, vec![[1, 1, 1]])), Err(Error::GridMismatch { .. })));
}

#[test]
fn params_come_from_toml_and_know_their_ranges() {
    let params: Params = toml::from_str("rule = \"neighborhood-max\"\noffset_voxels = -0.5").expect("legal");
    assert_eq!((params.rule, params.offset_voxels, params.climb_steps), (Rule::NeighborhoodMax, -0.5, 3));
    assert!(params.validate().is_ok() && toml::from_str::<Params>("ofset = 1").is_err());
    for (bad, key) in [
        (Params { offset_voxels: f64::NAN, ..Params::default() }, "offset_voxels"),
        (Params { climb_steps: 11, ..Params::default() }, "climb_steps"),
    ] {
        assert_eq!(bad.validate().expect_err("out of range").key, key);
    }
}
