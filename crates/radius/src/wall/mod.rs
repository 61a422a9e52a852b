//! Where the wall is in the scan, at the places where a mask has been measured.
//!
//! A mask that a threshold made ends where its values do. Of an airway grown to the last threshold that does not leak that
//! is up to a voxel before the wall, and of one voxel's noise it can be on either side. The scan knows better.
//!
//! **Input** a mask, a scan, and at each skeleton voxel the axis of the branch. **Output** [`Walls`]: how far beyond the mask's
//! surface the wall lies at each.
//! **Steps** 1. `rays`: the values along rays across the axis, a mean over planes and neighbouring rays, and where each ray
//! leaves the mask. 2. `calibrate`: from the thickest branches the lumen's value, that of its wall, and the scanner's blur. 3.
//! `fit`: at each ray the radius of a blurred tube (`disc`) that has such values. 4. The wall is the root mean square of the
//! radii, less that of the mask's along the same rays. 5. Places without an answer take their neighbours'; all are smoothed
//! along the skeleton.
//! **Guarantees** the same bits at any number of threads and in any order of a file's axes; a wall that is seen is never
//! farther than [`NEAR`] from the mask's surface, nor nearer to the axis than [`LEAST_LEFT`] of its radius.
//! **Why not the half maximum?** Between an airway and a lung nearly as dark the wall is a thin bright line, blurred to the
//! width of the blur, and the half of its height lies up to a voxel before it. On phantom airways at 1 mm the band's mask has
//! a bias of −0.40 voxel, half maxima −0.27, the fit +0.04; at 0.5 mm −1.09, −0.51 and −0.17.
//! **Source** the fit of a blurred model to rays across the airway: [Reinhardt1997].
//! **Limits** where slices are thick only rays within them count. Lumina narrower than the blur are taken for that wide.
//! **Cost** O(skeleton voxels · rays · (radius + 4 voxels)).

mod calibrate;
mod disc;
mod fit;
mod rays;

use espalier_model::{Grid, Volume};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::nearest::Background;
use calibrate::Calibration;
use disc::Disc;
use rays::{Ray, Section};

/// How far from the mask's surface the wall may be, inside and beyond, in voxels.
const NEAR: [f64; 2] = [1.5, 3.0];
/// The least share of the mask's radius that a wall inside of it leaves: what leaves less has lost a thin vessel in its blur.
const LEAST_LEFT: f64 = 0.5;
/// Rays may differ by so many voxels from their median: what differs more has met another branch.
const MAX_OFF_MEDIAN: f64 = 1.0;
/// Rays along which voxels are longer than so many times the shortest say nothing: across thick slices a thin branch is a
/// part of one voxel.
const MOST_UNEVEN: f64 = 2.0;
/// Rays that must meet a wall: so many, and this share of those that say something.
const LEAST_RAYS: usize = 3;
const LEAST_SHARE: f64 = 0.5;
/// Points are rounded to such parts of a voxel: of numbers of single precision the weighted sum is then exact, and the same in
/// whatever order a file stores its axes.
const PARTS: f64 = 256.0;
/// Lengths of voxels are rounded to such parts of a millimetre, for the same reason.
const ROUNDING: f64 = 1_048_576.0;
/// How often the walls are smoothed along the skeleton.
const N_SMOOTHINGS: usize = 2;

/// A place on the axis of a branch, in grid mm.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub(crate) center: DVec3,
    pub(crate) tangent: DVec3,
    pub(crate) radius_mm: f64,
}

/// A scan, and the mask in it.
pub(crate) struct Scan<'a> {
    background: Background<'a>,
    volume: &'a Volume,
    /// How long a voxel is along each axis of the mask's grid: the mask's or the scan's, whichever is longer. A mask on thick
    /// slices has others in between, which the scan has not.
    spacing: DVec3,
    /// From grid mm of the mask to voxels of the scan.
    voxel_from_mm: DAffine3,
}

/// What a scan says of the wall.
pub(crate) struct Walls {
    /// How far beyond the mask's surface it lies at each place, in mm; 0 everywhere where no place has shown one.
    pub(crate) beyond_mm: Vec<f64>,
    /// At how many places it was seen.
    pub(crate) n_seen: usize,
    /// The values of lumen and wall, and the standard deviation of the scanner's blur in mm.
    pub(crate) lumen: f64,
    pub(crate) wall: f64,
    pub(crate) blur_mm: f64,
}

impl<'a> Scan<'a> {
    pub(crate) fn new((background, grid): (Background<'a>, &Grid), volume: &'a Volume) -> Self {
        let voxel_from_mm = volume.grid().voxel_from_world()
            * grid.world_from_voxel()
            * DAffine3::from_scale(background.spacing_mm().recip());
        // Rounded, so that the order of a file's axes makes no difference.
        let spacing_mm = |axis: DVec3| {
            let length_mm = voxel_from_mm.transform_vector3(axis).length().recip();
            (length_mm * ROUNDING).round() / ROUNDING
        };
        let of_scan = DVec3::new(spacing_mm(DVec3::X), spacing_mm(DVec3::Y), spacing_mm(DVec3::Z));
        Self { background, volume, spacing: background.spacing_mm().max(of_scan), voxel_from_mm }
    }

    /// The walls at `places`, those without a direction among them; `neighbors` tells which follow each other.
    pub(crate) fn walls(&self, places: &[Option<Place>], neighbors: &[Vec<usize>]) -> Walls {
        let sections: Vec<Option<Section>> =
            places.par_iter().map(|place| place.and_then(|place| self.section(place))).collect();
        let disc = Disc::new();
        let calibration = Calibration::of(&sections, self.noise(places), &disc);
        let seen: Vec<Option<f64>> = sections
            .par_iter()
            .map(|section| section.as_ref().and_then(|section| beyond_mm(section, &calibration, &disc)))
            .collect();
        Walls {
            n_seen: seen.iter().flatten().count(),
            beyond_mm: smoothed(filled(&seen, neighbors), neighbors),
            lumen: calibration.lumen,
            wall: calibration.wall,
            blur_mm: calibration.blur_mm,
        }
    }

    /// The standard deviation of a voxel's noise: what places two voxels apart along an axis differ by.
    fn noise(&self, places: &[Option<Place>]) -> f64 {
        /// The standard deviation over the median of the difference's absolute value, of two normal values.
        const PER_MEDIAN: f64 = 1.048;
        let step_mm = 2.0 * self.spacing.max_element();
        let difference = |place: &Place| {
            Some((self.value(place.center)? - self.value(place.center + place.tangent * step_mm)?).abs())
        };
        let differences = places.iter().flatten().filter_map(difference).collect();
        PER_MEDIAN * median(differences).unwrap_or(0.0)
    }

    /// The scan's value at a point in grid mm. On the scan's very face there is none: from one side it would be inside.
    fn value(&self, point: DVec3) -> Option<f64> {
        let voxel = (self.voxel_from_mm.transform_point3(point) * PARTS).round() / PARTS;
        let last = DVec3::from_array(self.volume.grid().shape().map(|extent| (extent - 1) as f64));
        let is_inside = voxel.cmpgt(DVec3::splat(-0.5)).all() && voxel.cmplt(last + 0.5).all();
        if is_inside { self.volume.between(voxel) } else { None }
    }
}

/// How far beyond the mask's surface the wall of a section lies, in mm.
fn beyond_mm(section: &Section, calibration: &Calibration, disc: &Disc) -> Option<f64> {
    /// A ray that has met the wall.
    struct Met {
        voxels: f64,
        wall_mm: f64,
        surface_mm: f64,
    }
    let least_mm = section.rays.iter().flatten().map(|ray| ray.voxel_mm).fold(f64::INFINITY, f64::min);
    let is_fine = |ray: &&Ray| ray.voxel_mm <= MOST_UNEVEN * least_mm;
    let fine: Vec<&Ray> = section.rays.iter().flatten().filter(is_fine).collect();
    let met = fine.iter().filter_map(|ray| {
        let wall_mm = calibration.radius_mm(ray, section, disc)?;
        let voxels = (wall_mm - ray.surface_mm) / ray.voxel_mm;
        (-NEAR[0]..=NEAR[1]).contains(&voxels).then_some(Met { voxels, wall_mm, surface_mm: ray.surface_mm })
    });
    let mut met: Vec<Met> = met.collect();
    if met.len() < LEAST_RAYS || (met.len() as f64) < LEAST_SHARE * fine.len() as f64 {
        return None;
    }
    let middle = median(met.iter().map(|met| met.voxels).collect())?;
    met.retain(|met| (met.voxels - middle).abs() <= MAX_OFF_MEDIAN);
    let mean_square = |length_mm: &dyn Fn(&Met) -> f64| {
        met.iter().map(|met| length_mm(met) * length_mm(met)).sum::<f64>() / met.len() as f64
    };
    let [wall_mm, surface_mm] =
        [mean_square(&|met| met.wall_mm).sqrt(), mean_square(&|met| met.surface_mm).sqrt()];
    (wall_mm >= LEAST_LEFT * surface_mm).then_some(wall_mm - surface_mm)
}

/// Each place with what it has seen, else the mean of those that lie nearest along the skeleton, else of all.
fn filled(seen: &[Option<f64>], neighbors: &[Vec<usize>]) -> Vec<f64> {
    let mut walls = seen.to_vec();
    let mut open: Vec<usize> = (0..walls.len()).filter(|&i| walls[i].is_none()).collect();
    loop {
        let mean_of = |i: usize| {
            let near: Vec<f64> = neighbors[i].iter().filter_map(|&other| walls[other]).collect();
            (!near.is_empty()).then(|| (i, near.iter().sum::<f64>() / near.len() as f64))
        };
        let found: Vec<(usize, f64)> = open.iter().filter_map(|&i| mean_of(i)).collect();
        if found.is_empty() {
            break;
        }
        found.into_iter().for_each(|(i, wall)| walls[i] = Some(wall));
        open.retain(|&i| walls[i].is_none());
    }
    let known: Vec<f64> = walls.iter().flatten().copied().collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    walls.into_iter().map(|wall| wall.unwrap_or(mean)).collect()
}

/// The mean of each place and its neighbours, again and again.
fn smoothed(mut walls: Vec<f64>, neighbors: &[Vec<usize>]) -> Vec<f64> {
    for _ in 0..N_SMOOTHINGS {
        let mean = |(i, near): (usize, &Vec<usize>)| {
            (walls[i] + near.iter().map(|&other| walls[other]).sum::<f64>()) / (1 + near.len()) as f64
        };
        walls = neighbors.iter().enumerate().map(mean).collect();
    }
    walls
}

/// The middle value, of an even number the larger; none of none.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
