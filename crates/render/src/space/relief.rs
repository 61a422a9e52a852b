//! Light on the surface of an organ.
//!
//! **Input** what each ray meets, the colour of each branch. **Output** pixels: colour and coverage.
//! **Notation** h the height of a ray's surface, h̄ its mean over a window of rays that meet something.
//! **Steps** 1. The light of the pseudo-surface by the mean normal around (see [`crate::shade`]). 2. Crevices: a place that lies below
//! the mean height around it is darkened by (h̄ − h) over the window's width, so that what passes in front stands out from
//! what lies behind. 3. Distance: what is far takes on some of the paper's colour. 4. The rays of a pixel are averaged.
//! **Source** step 2 [Luft2006]: unsharp masking of the depth, without its highlights.
//! **Cost** O(rays).

use glam::Vec3;
use rayon::prelude::*;

use super::cast::Hit;
use crate::palette::{PageColors, Rgb, to_byte};
use crate::params::Style;
use crate::raster::Pixel;
use crate::shade::{self, Place};

/// Half the width of the window, in pixels of a figure 1600 wide: a few tubes.
pub(crate) const WINDOW_UNITS: f64 = 0.45;
/// How often the window is drawn over itself: three times is near a bell.
const N_PASSES: usize = 3;
/// How dark a crevice gets, and how deep it is then, in half widths of the window.
const CREVICE: f32 = 0.62;
const DEEP: f32 = 2.5;
/// How much of the paper's colour the farthest place takes.
const FAR: f32 = 0.30;
/// Normals are averaged over as many by as many rays, so many voxels apart, as far as heights differ by less than so many
/// voxels: a tilted wall is a stair in the mask, and its light should not show that.
const NORMAL_TAPS: i64 = 5;
const NORMAL_STEP: f64 = 0.9;
const NORMAL_HEIGHT: f32 = 2.0;
/// What has no branch.
const NO_BRANCH: Rgb = [0.66, 0.67, 0.69];

/// A lattice of hits as it becomes a picture.
pub(crate) struct Relief<'a> {
    /// What the rays meet, row by row.
    pub hits: &'a [Hit],
    /// How many along and down: multiples of `n`.
    pub size: [usize; 2],
    /// Rays of a pixel along an axis.
    pub n: usize,
    /// From one ray to the next.
    pub step_mm: f64,
    /// The size of a voxel.
    pub voxel_mm: f64,
    /// Half the width of the window, in rays.
    pub window: usize,
    /// By branch.
    pub branch_colors: &'a [Rgb],
    pub colors: PageColors,
}

impl Relief<'_> {
    /// The picture.
    pub(crate) fn pixels(&self) -> Vec<Pixel> {
        let mean_mm = self.mean_heights();
        let heights = self.hits.iter().filter(|hit| hit.is_something()).map(|hit| hit.height_mm);
        let [least, most] =
            heights.fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], height| [a.min(height), b.max(height)]);
        let [width, height] = self.size.map(|n| n / self.n);
        let mut pixels = vec![Pixel::EMPTY; width * height];
        pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, line)| {
            for (column, pixel) in line.iter_mut().enumerate() {
                *pixel = self.pixel([column, row], &mean_mm, [least, most]);
            }
        });
        pixels
    }

    fn pixel(&self, [column, row]: [usize; 2], mean_mm: &[f32], range_mm: [f32; 2]) -> Pixel {
        let n = self.n;
        let rays = (0..n * n).map(|i| (row * n + i / n) * self.size[0] + column * n + i % n);
        let (mut sum, mut n_hit) = ([0.0_f32; 3], 0.0_f32);
        for ray in rays.filter(|&ray| self.hits[ray].is_something()) {
            let hit = Hit { normal: self.normal(ray), ..self.hits[ray] };
            let lit = self.lit(&hit, mean_mm[ray], range_mm);
            sum = std::array::from_fn(|k| sum[k] + lit[k]);
            n_hit += 1.0;
        }
        if n_hit == 0.0 {
            return Pixel::EMPTY;
        }
        let color = sum.map(|part| to_byte(part / n_hit));
        Pixel { coverage: n_hit / (n * n) as f32, node: 0, color, ..Pixel::EMPTY }
    }

    /// The mean normal of the surface around a ray's, as far as it goes on without a step.
    fn normal(&self, ray: usize) -> [f32; 3] {
        let [width, height] = self.size;
        let spacing = ((NORMAL_STEP * self.voxel_mm / self.step_mm + 0.5) as i64).clamp(1, width as i64);
        let own = &self.hits[ray];
        let place = [(ray % width) as i64, (ray / width) as i64];
        let mut sum = Vec3::ZERO;
        for i in 0..NORMAL_TAPS * NORMAL_TAPS {
            let offset = [i % NORMAL_TAPS, i / NORMAL_TAPS].map(|k| spacing * (k - NORMAL_TAPS / 2));
            let [x, y] = [place[0] + offset[0], place[1] + offset[1]];
            if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
                let other = &self.hits[y as usize * width + x as usize];
                if (other.height_mm - own.height_mm).abs() <= NORMAL_HEIGHT * self.voxel_mm as f32 {
                    sum += Vec3::from_array(other.normal);
                }
            }
        }
        sum.try_normalize().unwrap_or(Vec3::from_array(own.normal)).to_array()
    }

    fn lit(&self, hit: &Hit, mean_mm: f32, [least_mm, most_mm]: [f32; 2]) -> Rgb {
        let own = (hit.branch as usize).checked_sub(1).and_then(|branch| self.branch_colors.get(branch));
        // The outline is drawn by the rim alone: a surface has no distance to it.
        let place = Place { normal: Vec3::from_array(hit.normal), outside_px: -1e3, radius_px: 1e3 };
        let lit = shade::shade(*own.unwrap_or(&NO_BRANCH), &place, &self.colors, Style::PseudoSurface);
        let deep_mm = DEEP * (self.window.max(1) as f64 * self.step_mm) as f32;
        let crevice = ((mean_mm - hit.height_mm) / deep_mm).clamp(0.0, 1.0);
        let lit = shade::mix(lit, self.colors.rim, CREVICE * crevice);
        let far = (most_mm - hit.height_mm) / (most_mm - least_mm).max(f32::MIN_POSITIVE);
        shade::mix(lit, self.colors.background, FAR * far.clamp(0.0, 1.0))
    }

    /// By ray: the mean height of what is around it.
    fn mean_heights(&self) -> Vec<f32> {
        let weight = |hit: &Hit| if hit.is_something() { 1.0 } else { 0.0 };
        let height = |hit: &Hit| if hit.is_something() { hit.height_mm } else { 0.0 };
        let weights = self.smoothed(self.hits.iter().map(weight).collect());
        let heights = self.smoothed(self.hits.iter().map(height).collect());
        let mean = |(height, weight): (f32, f32)| if weight > 0.0 { height / weight } else { 0.0 };
        heights.into_iter().zip(weights).map(mean).collect()
    }

    /// Running means along rows, then along columns, several times over.
    fn smoothed(&self, mut values: Vec<f32>) -> Vec<f32> {
        let mut size = self.size;
        for _ in 0..N_PASSES {
            for _axis in 0..2 {
                values.par_chunks_mut(size[0].max(1)).for_each(|line| running_mean(line, self.window));
                values = turned(&values, size);
                size = [size[1], size[0]];
            }
        }
        values
    }
}

/// The mean of each value and `reach` on either side; what lies beyond the ends counts 0.
fn running_mean(line: &mut [f32], reach: usize) {
    let own = line.to_vec();
    let width = (2 * reach + 1) as f64;
    let mut sum: f64 = own.iter().take(reach).map(|&value| f64::from(value)).sum();
    for (i, value) in line.iter_mut().enumerate() {
        sum += own.get(i + reach).copied().map_or(0.0, f64::from);
        *value = (sum / width) as f32;
        sum -= i.checked_sub(reach).map_or(0.0, |first| f64::from(own[first]));
    }
}

/// Rows as columns.
fn turned(values: &[f32], [width, height]: [usize; 2]) -> Vec<f32> {
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(height.max(1)).enumerate().for_each(|(column, line)| {
        line.iter_mut().enumerate().for_each(|(row, value)| *value = values[row * width + column]);
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_run_along_both_axes() {
        let mut line = [0.0, 0.0, 3.0, 0.0, 0.0, 6.0];
        running_mean(&mut line, 1);
        assert_eq!(line, [0.0, 1.0, 1.0, 1.0, 2.0, 2.0]);
        assert_eq!(turned(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [3, 2]), [1.0, 4.0, 2.0, 5.0, 3.0, 6.0]);
    }
}
