//! Slices of a scan through its mask.
//!
//! **Input** a volume and the mask that was made of it. **Output** a strip of grey pictures for each plane of the body.
//! **Steps** 1. A value at each pixel, between voxels linearly. 2. A window from the first to the last percentile of what
//! is seen. 3. PNG.
//! **Guarantees** nothing of the scan but its values and where they lie.
//! **Cost** O(voxels) for the range, else O(pixels).

use espalier_model::{Mask, Volume};
use glam::DVec3;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::Error;
use crate::panels::{Plane, Strip, strips};

/// The shares of the pixels that are darker than black and brighter than white.
const WINDOW: [f64; 2] = [0.01, 0.99];

/// Slices of a scan, a strip for each plane of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Slices {
    /// The least and the largest value of the scan.
    pub range: [f64; 2],
    /// The values that are black and white.
    pub window: [f64; 2],
    /// Axial, coronal and sagittal, as PNG.
    pub png: [Vec<u8>; 3],
}

impl Slices {
    /// The names of the strips.
    #[must_use]
    pub fn names() -> [&'static str; 3] {
        Plane::ALL.map(Plane::name)
    }
}

/// Draws the slices; none for a mask without foreground.
///
/// # Errors
/// [`Error::Picture`] if a picture cannot be packed.
pub fn slices(volume: &Volume, mask: &Mask) -> Result<Option<Slices>, Error> {
    let Some(strips) = strips(mask) else { return Ok(None) };
    let sampled = strips.each_ref().map(|strip| sampled(volume, strip));
    let window = window(sampled.iter().flatten().copied());
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    volume.for_each_value(|value| {
        if value.is_finite() {
            range = [range[0].min(value), range[1].max(value)];
        }
    });
    let [axial, coronal, sagittal] =
        [0, 1, 2].map(|plane| png(&sampled[plane], strips[plane].total_px(), window));
    Ok(Some(Slices { range, window, png: [axial?, coronal?, sagittal?] }))
}

/// The values of a strip row by row; `NaN` outside of the volume.
fn sampled(volume: &Volume, strip: &Strip) -> Vec<f64> {
    let voxel_from_world = volume.grid().voxel_from_world();
    let ([width, height], n_panels) = (strip.size_px, strip.at_mm.len());
    let mut values = Vec::with_capacity(width * height * n_panels);
    for row in 0..height {
        for panel in 0..n_panels {
            values.extend((0..width).map(|column| {
                value_at(volume, voxel_from_world.transform_point3(strip.point_mm(panel, [column, row])))
            }));
        }
    }
    values
}

/// The value between the voxels around a point in voxel coordinates; `NaN` outside.
fn value_at(volume: &Volume, point: DVec3) -> f64 {
    let grid = volume.grid();
    if grid.voxel_at(point).is_none() {
        return f64::NAN;
    }
    let shape = grid.shape();
    let low = point.floor();
    let share = (point - low).to_array();
    let mut sum = 0.0;
    for corner in 0..8_usize {
        let (mut voxel, mut weight) = ([0; 3], 1.0);
        for axis in 0..3 {
            let is_upper = corner >> axis & 1;
            // Half a voxel at the rim has neighbours on one side only.
            let index = low[axis] + is_upper as f64;
            voxel[axis] = (index.max(0.0) as usize).min(shape[axis] - 1);
            weight *= if is_upper == 1 { share[axis] } else { 1.0 - share[axis] };
        }
        if weight > 0.0 {
            sum += weight * volume.value(grid.index(voxel));
        }
    }
    sum
}

fn window(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return [0.0, 1.0] };
    WINDOW.map(|share| values[(share * last as f64 + 0.5) as usize])
}

fn png(values: &[f64], [width, height]: [usize; 2], [black, white]: [f64; 2]) -> Result<Vec<u8>, Error> {
    let span = if white > black { white - black } else { 1.0 };
    // A cast saturates; what lies outside is black.
    let grey: Vec<u8> = values.iter().map(|value| (255.0 * (value - black) / span + 0.5) as u8).collect();
    let mut bytes = Vec::new();
    let encoder = PngEncoder::new(&mut bytes);
    encoder.write_image(&grey, width as u32, height as u32, ExtendedColorType::L8)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use espalier_model::{Grid, Voxels};

    use super::*;

    #[test]
    fn slices_show_the_scan() {
        let grid = Grid::axis_aligned([20, 20, 20], DVec3::splat(2.0), DVec3::splat(-5.0)).expect("a grid");
        let mask = Mask::from_fn(grid.clone(), |voxel| voxel.iter().all(|v| (6..14).contains(v)));
        let mut values = vec![40_i16; 8000];
        mask.bits().voxels().for_each(|voxel| values[grid.index(voxel)] = -1000);
        let array = ndarray::Array3::from_shape_vec((20, 20, 20), values).expect("an array");
        let volume = Volume::new(grid, Voxels::I16(array), 1.0, 0.0);
        let slices = super::slices(&volume, &mask).expect("drawn").expect("some");
        assert_eq!(slices.range, [-1000.0, 40.0]);
        let picture = image::load_from_memory(&slices.png[0]).expect("a picture").into_luma8();
        let [panel, height] = [picture.width() / 4, picture.height()];
        assert!(picture.get_pixel(panel / 2, height / 2).0[0] < 10, "the middle is dark");
        assert!(picture.get_pixel(2, 2).0[0] > 240, "the corner is bright");
        assert!(super::slices(&volume, &Mask::empty(mask.grid().clone())).expect("drawn").is_none());
    }
}
