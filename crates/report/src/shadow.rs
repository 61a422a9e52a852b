//! The shadow of a mask: how thick it is along a line of sight, as a picture that is laid under the tree.
//!
//! **Input** a mask, a plane of the body, a frame. **Output** a PNG of one grey whose opacity is the square root of the
//! thickness, so that thin parts are seen beside thick ones; on dark and on light pages.
//! **Steps** 1. Each voxel covers the pixels of its box, seen along the plane's normal. 2. The thickness over the largest.
//! **Cost** O(foreground · pixels of a voxel).

use espalier_model::Mask;
use glam::DVec2;
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::Error;
use crate::layout::Frame;
use crate::panels::{Plane, center_mm};

/// Pixels along the longer side.
const LONG_SIDE_PX: f64 = 420.0;
/// The grey, in the middle between paper and night.
const GREY: u8 = 128;
/// The opacity of the thickest part.
const MOST: f64 = 235.0;

/// Units of a frame per pixel, and the picture that fills the frame.
pub(crate) fn shadow(mask: &Mask, plane: Plane, frame: &Frame) -> Result<Vec<u8>, Error> {
    let longest = frame.size[0].max(frame.size[1]) as f64;
    let units_per_px = longest / LONG_SIDE_PX;
    let [width, height] = frame.size.map(|side| ((side as f64 / units_per_px) as usize).max(1));
    let mut thickness = vec![0.0_f64; width * height];
    let half = half_voxel(mask, plane);
    let at_px = |point: DVec2| frame.offset(point) / units_per_px;
    for voxel in mask.bits().voxels() {
        let center = plane.project(center_mm(mask.grid(), voxel));
        let upper_left = at_px(center + DVec2::new(-half.x, half.y));
        let lower_right = at_px(center + DVec2::new(half.x, -half.y));
        for (row, part_of_row) in covered([upper_left.y, lower_right.y], height) {
            for (column, part) in covered([upper_left.x, lower_right.x], width) {
                thickness[row * width + column] += part_of_row * part;
            }
        }
    }
    let most = thickness.iter().copied().fold(0.0, f64::max);
    let opacity = |value: f64| if most > 0.0 { (MOST * (value / most).sqrt() + 0.5) as u8 } else { 0 };
    let pixels: Vec<u8> = thickness.iter().flat_map(|&value| [GREY, opacity(value)]).collect();
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(&pixels, width as u32, height as u32, ExtendedColorType::La8)?;
    Ok(bytes)
}

/// The pixels on a line that a stretch covers, and how much of each.
fn covered([low, high]: [f64; 2], n_pixels: usize) -> impl Iterator<Item = (usize, f64)> {
    // A cast saturates: what begins before the picture begins with its first pixel.
    let (first, last) = (low as usize, (high.max(0.0) as usize + 1).min(n_pixels));
    (first..last).map(move |pixel| {
        let at = pixel as f64;
        (pixel, (high.min(at + 1.0) - low.max(at)).max(0.0))
    })
}

/// Half of a voxel's box as the plane shows it, mm.
fn half_voxel(mask: &Mask, plane: Plane) -> DVec2 {
    let axes = mask.grid().world_from_voxel().matrix3;
    let sides = [axes.x_axis, axes.y_axis, axes.z_axis].map(|side| plane.project(side).abs());
    0.5 * (sides[0] + sides[1] + sides[2])
}
