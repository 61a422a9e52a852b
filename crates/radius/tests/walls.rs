//! Tubes in scans whose wall is known: radii reach to it, wherever the mask ends.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use espalier_geom::math::erf;
use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Grid, InscribedSpheres, Mask, Skeleton, Volume, Voxels};
use espalier_radius::{Params, inscribed_spheres, walls};
use glam::DVec3;
use ndarray::Array3;

/// A scanner's blur in voxels, the voxels' own with it.
const SIGMA: f64 = 0.6;
const NOISE: f64 = 20.0;
const N: usize = 36;

/// Lumen, wall, surroundings, and how thick the wall is.
#[derive(Clone, Copy)]
struct Tissue {
    lumen: f64,
    wall: f64,
    around: f64,
    thickness: f64,
}

const BRONCHUS: Tissue = Tissue { lumen: -1000.0, wall: 0.0, around: -850.0, thickness: 0.6 };
const TRACHEA: Tissue = Tissue { lumen: -1000.0, wall: 0.0, around: -30.0, thickness: 2.0 };
const VESSEL: Tissue = Tissue { lumen: 250.0, wall: 90.0, around: 90.0, thickness: 0.0 };

/// A tree of two tubes side by side, a thick one and a thin one, along a direction.
struct Scene {
    grid: Grid,
    direction: DVec3,
    /// Centre, radius, tissue.
    tubes: [(DVec3, f64, Tissue); 2],
}

impl Scene {
    fn new(direction: DVec3, spacing: DVec3, [thick, thin]: [(f64, Tissue); 2]) -> Self {
        let grid = Grid::axis_aligned([2 * N, N, N], spacing, DVec3::ZERO).expect("a grid");
        let middle = 0.5 * (N - 1) as f64 * DVec3::ONE * spacing + DVec3::new(0.2, 0.1, 0.3);
        let aside = DVec3::new(N as f64 * spacing.x, 0.0, 0.0);
        Self {
            grid,
            direction: direction.normalize(),
            tubes: [(middle, thick.0, thick.1), (middle + aside, thin.0, thin.1)],
        }
    }

    fn point(&self, voxel: [usize; 3]) -> DVec3 {
        self.grid.world_from_voxel().transform_point3(DVec3::from_array(voxel.map(|c| c as f64)))
    }

    /// The nearer tube, and the distance from its axis.
    fn nearer(&self, point: DVec3) -> (usize, f64) {
        let off_axis = |(center, ..): (DVec3, f64, Tissue)| {
            (point - center).reject_from_normalized(self.direction).length()
        };
        let [a, b] = self.tubes.map(off_axis);
        if a <= b { (0, a) } else { (1, b) }
    }

    fn scan(&self) -> Volume {
        let noise = std::cell::RefCell::new(Stream::new(3, Purpose::Test, 0, 0));
        let step = |at: f64| 0.5 * (1.0 + erf(at / (SIGMA * std::f64::consts::SQRT_2)));
        let values = Array3::from_shape_fn((N, N, 2 * N), |(z, y, x)| {
            let (tube, rho) = self.nearer(self.point([x, y, z]));
            let (_, radius, Tissue { lumen, wall, around, thickness }) = self.tubes[tube];
            let value = lumen
                + (wall - lumen) * step(rho - radius)
                + (around - wall) * step(rho - radius - thickness);
            (value + NOISE * noise.borrow_mut().normal()) as f32
        });
        Volume::new(self.grid.clone(), Voxels::F32(values), 1.0, 0.0)
    }

    /// The mask that ends so many voxels before the wall, with a skeleton beside its axes.
    fn mask(&self, before: f64) -> (Mask, Skeleton) {
        let mask = Mask::from_fn(self.grid.clone(), |voxel| {
            let (tube, rho) = self.nearer(self.point(voxel));
            rho <= self.tubes[tube].1 - before
        });
        let mut voxels: Vec<[u32; 3]> = self
            .tubes
            .iter()
            .flat_map(|&(center, ..)| {
                (-400..=400).map(move |i| center + self.direction * f64::from(i) * 0.05)
            })
            .filter_map(|point| self.grid.voxel_at(self.grid.voxel_from_world().transform_point3(point)))
            .filter(|&voxel| mask.bits().get(voxel))
            .map(|voxel| voxel.map(|c| c as u32))
            .collect();
        voxels.sort_by_key(|&[x, y, z]| [z, y, x]);
        voxels.dedup();
        (mask, Skeleton::new(self.grid.clone(), voxels))
    }

    /// The spheres of the mask, and with the scan's walls; those far from the border.
    fn measured(&self, before: f64) -> Vec<[(usize, f64); 2]> {
        let (mask, skeleton) = self.mask(before);
        let of_mask = inscribed_spheres(&mask, &skeleton, &Params::default()).expect("spheres").spheres;
        let found = walls((&mask, &skeleton), &of_mask, &self.scan(), &Params::default()).expect("walls");
        let InscribedSpheres(spheres) = found.spheres;
        let last = self.point([2 * N - 1, N - 1, N - 1]);
        spheres
            .iter()
            .filter(|s| s.center_mm.min(last - s.center_mm).min_element() > 8.0)
            .map(|s| {
                let tube = self.nearer(s.center_mm).0;
                let of = |radius: f64| (tube, radius - self.tubes[tube].1);
                [of(s.radius_mm), of(s.radius_mm + s.wall_mm)]
            })
            .collect()
    }
}

/// The mean error of a tube's radius.
fn mean(errors: &[[(usize, f64); 2]], tube: usize, which: usize) -> f64 {
    let of_tube: Vec<f64> = errors.iter().map(|e| e[which]).filter(|e| e.0 == tube).map(|e| e.1).collect();
    assert!(of_tube.len() >= 10, "{} spheres", of_tube.len());
    of_tube.iter().sum::<f64>() / of_tube.len() as f64
}

#[test]
fn radii_reach_to_the_wall_wherever_the_mask_ends() {
    for direction in [DVec3::Z, DVec3::new(0.3, 1.0, 0.8)] {
        for (name, tissues) in
            [("airways", [(7.0, TRACHEA), (2.5, BRONCHUS)]), ("vessels", [(6.0, VESSEL), (2.2, VESSEL)])]
        {
            let scene = Scene::new(direction, DVec3::ONE, tissues);
            for before in [0.7, 0.0, -0.4] {
                let errors = scene.measured(before);
                for tube in [0, 1] {
                    let (of_mask, of_wall) = (mean(&errors, tube, 0), mean(&errors, tube, 1));
                    let found =
                        format!("{name} {direction} {before} tube {tube}: {of_mask:+.3}, {of_wall:+.3}");
                    assert!((of_mask + before).abs() <= 0.25, "the mask alone: {found}");
                    assert!(of_wall.abs() <= 0.15, "{found}");
                }
            }
        }
    }
}

/// What is added to the mask's radii does not move the wall in the scan.
#[test]
fn an_offset_of_the_mask_is_not_the_walls() {
    let scene = Scene::new(DVec3::Z, DVec3::ONE, [(7.0, TRACHEA), (2.5, BRONCHUS)]);
    let (mask, skeleton) = scene.mask(0.5);
    let scan = scene.scan();
    let radii = |offset_voxels: f64| -> Vec<f64> {
        let params = Params { offset_voxels, ..Params::default() };
        let of_mask = inscribed_spheres(&mask, &skeleton, &params).expect("spheres").spheres;
        let found = walls((&mask, &skeleton), &of_mask, &scan, &params).expect("walls").spheres.0;
        found.iter().map(|sphere| sphere.radius_mm + sphere.wall_mm).collect()
    };
    let (plain, moved) = (radii(0.0), radii(0.5));
    assert!(plain.iter().zip(&moved).all(|(a, b)| (a - b).abs() < 0.1), "{plain:?} {moved:?}");
}

/// Of airways whose walls are all thinner than the blur no wall shows its value; that they are tissue is known.
#[test]
fn thin_walls_alone_are_measured_too() {
    let thin = |thickness: f64| Tissue { thickness, ..BRONCHUS };
    let scene = Scene::new(DVec3::Z, DVec3::ONE, [(6.0, thin(0.8)), (3.0, thin(0.5))]);
    let errors = scene.measured(0.5);
    for tube in [0, 1] {
        assert!(mean(&errors, tube, 1).abs() <= 0.2, "{}", mean(&errors, tube, 1));
    }
}

/// Between a thin bronchus and the lung the wall is a line as wide as the blur: its half lies well inside of the lumen.
#[test]
fn a_wall_thinner_than_the_blur_is_no_thicker_for_it() {
    let thin = Tissue { thickness: 0.35, ..BRONCHUS };
    let scene = Scene::new(DVec3::new(0.2, 0.1, 1.0), DVec3::ONE, [(7.0, TRACHEA), (3.0, thin)]);
    let error = mean(&scene.measured(0.6), 1, 1);
    assert!(error.abs() <= 0.2, "{error}");
}

#[test]
fn thick_slices_are_measured_within_them() {
    let spacing = DVec3::new(0.7, 0.7, 2.5);
    let scene = Scene::new(DVec3::Z, spacing, [(5.0, TRACHEA), (3.0, BRONCHUS)]);
    let errors = scene.measured(0.5);
    for tube in [0, 1] {
        assert!(mean(&errors, tube, 1).abs() <= 0.15, "{}", mean(&errors, tube, 1));
    }
}

#[test]
fn where_nothing_stands_out_radii_are_the_masks() {
    let flat = Tissue { lumen: 40.0, wall: 45.0, around: 45.0, thickness: 0.0 };
    let scene = Scene::new(DVec3::Z, DVec3::ONE, [(6.0, flat), (3.0, flat)]);
    let (mask, skeleton) = scene.mask(0.0);
    let of_mask = inscribed_spheres(&mask, &skeleton, &Params::default()).expect("spheres").spheres;
    let found = walls((&mask, &skeleton), &of_mask, &scene.scan(), &Params::default()).expect("walls");
    assert!(found.spheres.0.iter().all(|sphere| sphere.wall_mm == 0.0));
    assert_eq!(found.report.get("walls"), Some(0.0));
    assert_eq!(found.report.warnings[0].code, "W-RADIUS-WALL");

    // So are they where a scan has no numbers, and where it ends.
    let nowhere = Grid::axis_aligned([4, 4, 4], DVec3::ONE, DVec3::splat(900.0)).expect("a grid");
    for (grid, value) in [(scene.grid, f32::NAN), (nowhere, 7.0)] {
        let [nx, ny, nz] = grid.shape();
        let scan = Volume::new(grid, Voxels::F32(Array3::from_elem((nz, ny, nx), value)), 1.0, 0.0);
        let found = walls((&mask, &skeleton), &of_mask, &scan, &Params::default()).expect("walls").spheres;
        assert!(found.0.iter().all(|sphere| sphere.wall_mm == 0.0));
    }
}

#[test]
fn the_number_of_threads_does_not_matter() {
    let scene = Scene::new(DVec3::new(0.3, 1.0, 0.8), DVec3::ONE, [(6.0, VESSEL), (2.2, VESSEL)]);
    let (mask, skeleton) = scene.mask(0.3);
    let of_mask = inscribed_spheres(&mask, &skeleton, &Params::default()).expect("spheres").spheres;
    let scan = scene.scan();
    let with = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool");
        pool.install(|| {
            walls((&mask, &skeleton), &of_mask, &scan, &Params::default()).expect("walls").spheres.to_tsv()
        })
    };
    assert_eq!(with(1), with(3));
}
