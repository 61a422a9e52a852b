//! What a scan's thick branches say of its lumen, its wall and its blur.
//!
//! **Input** the sections. **Output** [`Calibration`], with which the others are fitted.
//! **Steps** 1. Whether the lumen is darker than what is around it: the sum over all rays. 2. Of the sections whose rays are all
//! [`THICK`] voxels long the thickest few: of airways the trachea. 3. The medians: of their values about the axis the lumen's; of the most that their
//! rays reach beyond the surface the wall's, since the walls of thick airways are thicker than the blur; of fits in which the
//! blur is free the blur. Where nothing is thick, all sections give the lumen's value and the peaks, and the blur is
//! [`USUAL_BLUR`].
//! **Why HU?** Where even the thickest airways lie in lung their walls are thinner than the blur, and a measured value would be
//! too low. A lumen at [`AIR_HU`] says that values are HU; then a wall, which is soft tissue, has [`TISSUE_HU`] at least.
//! **Notation** σ² = b² + [`VOXEL_VARIANCE`] · v²: the scanner's blur b, and that of voxels of length v and of the lines between
//! their centres.

use rayon::prelude::*;

use super::disc::Disc;
use super::fit::{Known, fit};
use super::median;
use super::rays::{Ray, Section};

/// The variance of a box of one voxel, 1/12, and of the triangle by which values between centres are made, 1/6.
const VOXEL_VARIANCE: f64 = 0.25;
/// Voxels from the axis to the surface of a thick branch.
const THICK: f64 = 3.5;
/// Of all sections this share are the thickest, at least so many. With a tenth the main bronchi, whose walls the blur
/// lowers, were among them: at 0.5 mm radii had a bias of −0.28 voxel, with this −0.11, both without [`TISSUE_HU`].
const THICKEST: f64 = 0.04;
const LEAST_SECTIONS: usize = 20;
/// The blur where none can be measured, in voxels.
const USUAL_BLUR: f64 = 0.5;
/// Values of air in HU, with the offsets of scanners; and of soft tissue without fat.
const AIR_HU: std::ops::RangeInclusive<f64> = -1100.0..=-850.0;
const TISSUE_HU: f64 = 0.0;
/// A wall stands out from the lumen by this multiple of the noise.
const LEAST_CONTRAST: f64 = 3.0;
/// So does what is seen of it by this share of what a thick wall would show: a bronchus as bright as the lung around it, with no
/// wall that is seen, ends nowhere.
const LEAST_RISE: f64 = 0.15;
/// A tube explains a ray if the root mean square of what it leaves is at most this share of the contrast.
const MOST_RESIDUAL: f64 = 0.2;

/// What is known of a scan before a ray is fitted.
pub(super) struct Calibration {
    is_dark: bool,
    pub(super) lumen: f64,
    pub(super) wall: f64,
    /// The standard deviation of the scanner's blur, in mm.
    pub(super) blur_mm: f64,
    least_contrast: f64,
}

impl Calibration {
    pub(super) fn of(sections: &[Option<Section>], noise: f64, disc: &Disc) -> Self {
        let all: Vec<&Section> = sections.iter().flatten().collect();
        let thick = thickest(&all);
        let telling = if thick.is_empty() { &all } else { &thick };
        let is_dark = all.iter().map(|section| rise(section)).sum::<f64>() >= 0.0;
        let lumen = median(telling.iter().map(|section| section.lumen).collect()).unwrap_or(0.0);
        let peaks = telling.iter().flat_map(|section| peaks(section, is_dark)).collect();
        let wall = median(peaks).unwrap_or(lumen);
        let wall = if is_dark && AIR_HU.contains(&lumen) { wall.max(TISSUE_HU) } else { wall };
        let begin = Self { is_dark, lumen, wall, blur_mm: 0.0, least_contrast: LEAST_CONTRAST * noise };
        let of_section = |section: &&Section| begin.variances_mm2(section, disc);
        let variances: Vec<Vec<f64>> = thick.par_iter().map(of_section).collect();
        let blur_mm = median(variances.concat()).map_or_else(
            || USUAL_BLUR * all.first().map_or(0.0, |section| voxel_mm(section)),
            |variance| variance.max(0.0).sqrt(),
        );
        Self { blur_mm, ..begin }
    }

    /// Where a ray meets the wall, in mm from the axis; none where it shows no tube.
    pub(super) fn radius_mm(&self, ray: &Ray, section: &Section, disc: &Disc) -> Option<f64> {
        let variance = self.blur_mm * self.blur_mm + VOXEL_VARIANCE * ray.voxel_mm * ray.voxel_mm;
        // A scanner's kernel that sharpens makes thin lumina darker than the trachea.
        let lumen = if self.is_dark { self.lumen.min(section.lumen) } else { self.lumen };
        let known = Known { lumen, sigma_mm: variance.sqrt(), is_sigma_free: false, ..self.known(ray) };
        let tube = fit(ray, section.step_mm, known, disc)?;
        let rise =
            if self.is_dark { peak(ray, section.step_mm, f64::max) - section.lumen } else { tube.contrast };
        let is_seen = rise > self.least_contrast.max(LEAST_RISE * tube.contrast)
            && tube.residual <= MOST_RESIDUAL * tube.contrast;
        is_seen.then_some(tube.radius_mm)
    }

    fn known(&self, ray: &Ray) -> Known {
        let Self { is_dark, lumen, wall, .. } = *self;
        Known { is_dark, lumen, wall, sigma_mm: 0.7 * ray.voxel_mm, is_sigma_free: true }
    }

    /// The scanner's blur as the rays of a section have it, squared.
    fn variances_mm2(&self, section: &Section, disc: &Disc) -> Vec<f64> {
        let of_ray = |ray: &Ray| {
            let tube = fit(ray, section.step_mm, self.known(ray), disc)?;
            Some(tube.sigma_mm * tube.sigma_mm - VOXEL_VARIANCE * ray.voxel_mm * ray.voxel_mm)
        };
        section.rays.iter().flatten().filter_map(of_ray).collect()
    }
}

/// The thickest of those that are thick.
fn thickest<'s>(all: &[&'s Section]) -> Vec<&'s Section> {
    let is_thick = |section: &&&Section| {
        let known = || section.rays.iter().flatten();
        2 * known().count() > section.rays.len() && known().all(|ray| ray.surface_mm > THICK * ray.voxel_mm)
    };
    let mut thick: Vec<&Section> = all.iter().filter(is_thick).copied().collect();
    thick.sort_by(|a, b| b.girth_mm().total_cmp(&a.girth_mm()));
    thick.truncate(((THICKEST * all.len() as f64) as usize).max(LEAST_SECTIONS));
    thick
}

/// How much brighter it is a voxel and a half beyond the surface than in the lumen, over all rays.
fn rise(section: &Section) -> f64 {
    let beyond = |ray: &Ray| {
        let i = ((ray.surface_mm + 1.5 * ray.voxel_mm) / section.step_mm) as usize;
        ray.values.get(i).map(|value| value - section.lumen)
    };
    section.rays.iter().flatten().filter_map(beyond).sum()
}

/// What each ray reaches beyond the surface that is farthest from the lumen.
fn peaks(section: &Section, is_dark: bool) -> Vec<f64> {
    let farther = if is_dark { f64::max } else { f64::min };
    section.rays.iter().flatten().map(|ray| peak(ray, section.step_mm, farther)).collect()
}

/// What a ray reaches beyond the surface.
fn peak(ray: &Ray, step_mm: f64, farther: fn(f64, f64) -> f64) -> f64 {
    let first = ((ray.surface_mm / step_mm) as usize).min(ray.values.len() - 1);
    ray.values[first..].iter().copied().fold(ray.values[first], farther)
}

/// The length of a voxel across a section, in mm.
fn voxel_mm(section: &Section) -> f64 {
    section.rays.iter().flatten().map(|ray| ray.voxel_mm).fold(0.0, f64::max)
}
