//! Slices of a scan through its mask.
//!
//! **Input** the values of a volume as they are read, and the mask that was made of it. **Output** a strip of grey
//! pictures for each plane of the body.
//! **Steps** 1. A value at each pixel, between voxels linearly: each row of voxels adds its share to the pixels beside
//! it. 2. A window from the first to the last percentile of what is seen. 3. PNG.
//! **Guarantees** nothing of the scan but its values and where they lie; no more of it is held than the pixels.
//! **Cost** O(voxels) time; memory some 24 bytes a pixel, whatever the volume.

use espalier_model::{Grid, Mask};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use crate::Error;
use crate::panels::{Plane, Strip, strips};

/// The shares of the pixels that are darker than black and brighter than white.
const WINDOW: [f64; 2] = [0.01, 0.99];

/// How many rows before a row of voxels, along z and along y, the pixels between them have as theirs.
const BACK: [[usize; 2]; 4] = [[0, 0], [0, 1], [1, 0], [1, 1]];

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

/// Slices of a scan that is being read.
pub struct Mosaic {
    grid: Grid,
    strips: [Strip; 3],
    /// The pixels inside of the volume by the row of voxels just below them: the row, and the pixel counted over all
    /// strips.
    by_row: Vec<(usize, u32)>,
    /// For each of [`BACK`] how many of them lie below the row that is being read.
    n_passed: [usize; BACK.len()],
    /// For each strip row by row what its pixels have come to so far; `NaN` outside of the volume.
    sampled: [Vec<f64>; 3],
    range: [f64; 2],
}

impl Mosaic {
    /// The slices to be drawn of a volume on `grid`; none for a mask without foreground.
    #[must_use]
    pub fn new(grid: &Grid, mask: &Mask) -> Option<Self> {
        let strips = strips(mask)?;
        let sampled = strips.each_ref().map(|strip| vec![f64::NAN; strip.total_px().iter().product()]);
        let range = [f64::INFINITY, f64::NEG_INFINITY];
        let mut mosaic =
            Self { grid: grid.clone(), strips, by_row: Vec::new(), n_passed: [0; 4], sampled, range };
        let mut by_row = Vec::new();
        for (number, (strip, index)) in mosaic.pixels().enumerate() {
            if let Some(place) = mosaic.place(strip, index) {
                // A strip has some hundred thousand pixels.
                by_row.push((mosaic.row(place.low[1], place.low[2]), number as u32));
            }
        }
        by_row.sort_unstable();
        for &(_, number) in &by_row {
            let (strip, index) = mosaic.pixel(number);
            mosaic.sampled[strip][index] = 0.0;
        }
        mosaic.by_row = by_row;
        Some(mosaic)
    }

    /// Takes the scaled values of the voxels from the flat index `start` on (x fastest). To be called in the order of the
    /// voxels, with all of them.
    pub fn see(&mut self, start: usize, values: &[f64]) {
        for &value in values.iter().filter(|value| value.is_finite()) {
            self.range = [self.range[0].min(value), self.range[1].max(value)];
        }
        let nx = self.grid.shape()[0];
        let mut n_done = 0;
        while n_done < values.len() {
            let (row, first) = ((start + n_done) / nx, (start + n_done) % nx);
            let n_now = (nx - first).min(values.len() - n_done);
            self.see_row(row, first, &values[n_done..n_done + n_now]);
            n_done += n_now;
        }
    }

    /// Takes voxels of a row from x = `first` on: adds them to the pixels between it and the rows before it.
    fn see_row(&mut self, row: usize, first: usize, values: &[f64]) {
        let ny = self.grid.shape()[1];
        let (y, z) = (row % ny, row / ny);
        for (back, [back_z, back_y]) in BACK.into_iter().enumerate() {
            if back_z > z || back_y > y {
                continue;
            }
            let below = self.row(y - back_y, z - back_z);
            let rest = &self.by_row[self.n_passed[back]..];
            self.n_passed[back] += rest.iter().take_while(|(row, _)| *row < below).count();
            let mut next = self.n_passed[back];
            while let Some(&(_, number)) = self.by_row.get(next).filter(|(row, _)| *row == below) {
                self.add(number, (row, first), values);
                next += 1;
            }
        }
    }

    /// Adds to a pixel what voxels of a row, from x = `first` on, are to it.
    fn add(&mut self, number: u32, (row, first): (usize, usize), values: &[f64]) {
        let (strip, index) = self.pixel(number);
        let Some(place) = self.place(strip, index) else { return };
        for (voxel, weight) in place.corners() {
            let is_here = self.row(voxel[1], voxel[2]) == row && weight > 0.0;
            let value = voxel[0].checked_sub(first).and_then(|at| values.get(at));
            if let Some(value) = value.filter(|_| is_here) {
                self.sampled[strip][index] += weight * value;
            }
        }
    }

    /// Draws what was seen.
    ///
    /// # Errors
    /// [`Error::Picture`] if a picture cannot be packed.
    pub fn draw(self) -> Result<Slices, Error> {
        let window = window(self.sampled.iter().flatten().copied());
        let [axial, coronal, sagittal] =
            [0, 1, 2].map(|strip| png(&self.sampled[strip], self.strips[strip].total_px(), window));
        Ok(Slices { range: self.range, window, png: [axial?, coronal?, sagittal?] })
    }

    /// All pixels: strip and index in it.
    fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..3).flat_map(|strip| (0..self.sampled[strip].len()).map(move |index| (strip, index)))
    }

    /// The pixel with a number in that order.
    fn pixel(&self, number: u32) -> (usize, usize) {
        let (mut strip, mut index) = (0, number as usize);
        while strip < 2 && index >= self.sampled[strip].len() {
            index -= self.sampled[strip].len();
            strip += 1;
        }
        (strip, index)
    }

    /// Where a pixel lies between the voxels; none outside of the volume.
    fn place(&self, strip: usize, index: usize) -> Option<Place> {
        let strip = &self.strips[strip];
        let [width, height] = strip.size_px;
        let (row, across) = (index / (width * strip.at_mm.len()), index % (width * strip.at_mm.len()));
        debug_assert!(row < height, "a pixel of the strip");
        let point_mm = strip.point_mm(across / width, [across % width, row]);
        let point = self.grid.voxel_from_world().transform_point3(point_mm);
        self.grid.voxel_at(point)?;
        let shape = self.grid.shape();
        let floor = point.floor();
        // Half a voxel at the rim has neighbours on one side only.
        let voxel = |axis: usize, step: f64| ((floor[axis] + step).max(0.0) as usize).min(shape[axis] - 1);
        let [low, high] = [0.0, 1.0].map(|step| [0, 1, 2].map(|axis| voxel(axis, step)));
        let share = |axis: usize| if low[axis] == high[axis] { 0.0 } else { point[axis] - floor[axis] };
        Some(Place { low, high, share: [0, 1, 2].map(share) })
    }

    fn row(&self, y: usize, z: usize) -> usize {
        z * self.grid.shape()[1] + y
    }
}

/// A point between eight voxels.
struct Place {
    low: [usize; 3],
    high: [usize; 3],
    /// How far it is from the low ones to the high ones.
    share: [f64; 3],
}

impl Place {
    /// The voxels, in storage order, and what each counts.
    fn corners(&self) -> impl Iterator<Item = ([usize; 3], f64)> + '_ {
        (0..8_usize).map(|corner| {
            let is_high = |axis: usize| corner >> axis & 1 == 1;
            let voxel = [0, 1, 2].map(|axis| if is_high(axis) { self.high[axis] } else { self.low[axis] });
            let weight = |axis: usize| if is_high(axis) { self.share[axis] } else { 1.0 - self.share[axis] };
            (voxel, weight(0) * weight(1) * weight(2))
        })
    }
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
    use espalier_model::{Volume, Voxels};
    use glam::DVec3;

    use super::*;

    #[test]
    fn slices_show_the_scan() {
        let grid = Grid::axis_aligned([20, 20, 20], DVec3::splat(2.0), DVec3::splat(-5.0)).expect("a grid");
        let mask = Mask::from_fn(grid.clone(), |voxel| voxel.iter().all(|v| (6..14).contains(v)));
        let mut values = vec![40_i16; 8000];
        mask.bits().voxels().for_each(|voxel| values[grid.index(voxel)] = -1000);
        let array = ndarray::Array3::from_shape_vec((20, 20, 20), values).expect("an array");
        let volume = Volume::new(grid.clone(), Voxels::I16(array), 1.0, 0.0);
        let mut mosaic = Mosaic::new(&grid, &mask).expect("some");
        volume.for_each_piece(|start, values| mosaic.see(start, values));
        let slices = mosaic.draw().expect("drawn");
        assert_eq!(slices.range, [-1000.0, 40.0]);
        let picture = image::load_from_memory(&slices.png[0]).expect("a picture").into_luma8();
        let [panel, height] = [picture.width() / 4, picture.height()];
        assert!(picture.get_pixel(panel / 2, height / 2).0[0] < 10, "the middle is dark");
        assert!(picture.get_pixel(2, 2).0[0] > 240, "the corner is bright");
        assert!(Mosaic::new(&grid, &Mask::empty(grid.clone())).is_none());
    }

    /// A pixel is what lies between the voxels about it, however the values come, up to the rim of the volume.
    #[test]
    fn pixels_are_interpolated_whatever_the_pieces() {
        let shape = [11, 9, 7];
        let grid = Grid::axis_aligned(shape, DVec3::new(0.7, 1.1, 2.3), DVec3::new(3.0, -8.0, 1.0));
        let grid = grid.expect("a grid");
        let mask = Mask::from_fn(grid.clone(), |[x, y, z]| x % 10 == 0 && y % 8 == 0 && z % 6 == 0);
        let values: Vec<f64> = (0..grid.n_voxels()).map(|i| (i * 7919 % 1013) as f64).collect();
        let drawn = |piece: usize| {
            let mut mosaic = Mosaic::new(&grid, &mask).expect("some");
            for (i, values) in values.chunks(piece).enumerate() {
                mosaic.see(i * piece, values);
            }
            mosaic
        };
        let mosaic = drawn(1000);
        let mut n_seen = 0;
        for (strip, index) in mosaic.pixels() {
            let Some(place) = mosaic.place(strip, index) else {
                assert!(mosaic.sampled[strip][index].is_nan());
                continue;
            };
            let wanted: f64 = place.corners().map(|(voxel, share)| share * values[grid.index(voxel)]).sum();
            assert!((mosaic.sampled[strip][index] - wanted).abs() < 1e-9, "{strip} {index}");
            n_seen += 1;
        }
        assert!(n_seen > 10_000, "{n_seen} pixels");
        let pictures = mosaic.draw().expect("drawn");
        for piece in [1, 4, 11, 99] {
            assert_eq!(drawn(piece).draw().expect("drawn"), pictures, "pieces of {piece}");
        }
    }
}
