//! The picture as bytes: the raster on its paper, the marks over it.
//!
//! **Input** rasters and marks. **Output** RGBA pixels, packed as PNG.
//! **Guarantees** the same bytes for any number of threads: bands are drawn in parallel into rows of their own.
//! **Cost** 4 bytes a pixel.

use rayon::prelude::*;
use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PixmapMut, Rect, Stroke, Transform,
};

use crate::drawing::{Group, Mark};
use crate::page::MAX_PIXELS;
use crate::palette::{Rgb, to_byte};
use crate::raster::{Brush, Pixel, Raster, TILE};
use crate::text::Face;
use crate::{Error, png};

/// How much bolder strong text is, as a share of its size.
pub(crate) const STRONG: f32 = 0.045;
/// Ordinary text is a light face; a hair more weight makes it as dark as the lines.
pub(crate) const PLAIN: f32 = 0.012;

/// A picture in the making.
pub(crate) struct Canvas {
    pixmap: Pixmap,
}

impl Canvas {
    /// Blank paper.
    pub(crate) fn new([width, height]: [u32; 2], background: Rgb) -> Result<Self, Error> {
        let too_large = || Error::TooLarge { width, height, limit: MAX_PIXELS };
        if u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(too_large());
        }
        let mut pixmap = Pixmap::new(width, height).ok_or_else(too_large)?;
        let [r, g, b] = background.map(to_byte);
        pixmap.fill(tiny_skia::Color::from_rgba8(r, g, b, 255));
        Ok(Self { pixmap })
    }

    /// Draws a raster with its upper left corner at a pixel. Gives what `look` makes of each band, from the top; it
    /// is told the band's first row.
    pub(crate) fn surface<T: Send>(
        &mut self,
        raster: &Raster<'_>,
        [left, top]: [usize; 2],
        look: impl Fn(usize, &[Pixel]) -> T + Sync,
    ) -> Vec<T> {
        let draw = |brush: &mut Brush, band: usize| {
            let pixels = raster.band(band, brush);
            let seen = look(band * TILE, &pixels);
            (pixels, seen)
        };
        self.bands((raster.size(), [left, top]), Brush::new, draw)
    }

    /// The same of whatever draws bands of [`TILE`] rows: of a picture of this size, at a pixel.
    pub(crate) fn bands<B, T: Send>(
        &mut self,
        ([width, height], [left, top]): ([usize; 2], [usize; 2]),
        brush: impl Fn() -> B + Sync + Send,
        draw: impl Fn(&mut B, usize) -> (Vec<Pixel>, T) + Sync + Send,
    ) -> Vec<T> {
        let stride = 4 * self.pixmap.width() as usize;
        let rows = self.pixmap.data_mut().get_mut(top * stride..).unwrap_or_default();
        let bands = rows.par_chunks_mut(stride * TILE).take(height.div_ceil(TILE)).enumerate();
        let paint = |brush: &mut B, (band, rows): (usize, &mut [u8])| {
            let (pixels, seen) = draw(brush, band);
            for (line, row) in pixels.chunks(width).zip(rows.chunks_mut(stride)) {
                for (pixel, target) in line.iter().zip(row.chunks_exact_mut(4).skip(left)) {
                    put(pixel, target);
                }
            }
            seen
        };
        bands.map_init(brush, paint).collect()
    }

    /// Lays pixels, rows of a width, with their upper left corner at a pixel.
    pub(crate) fn lay(&mut self, pixels: &[Pixel], width: usize, [left, top]: [usize; 2]) {
        let stride = 4 * self.pixmap.width() as usize;
        let rows = self.pixmap.data_mut().get_mut(top * stride..).unwrap_or_default();
        for (line, row) in pixels.chunks(width.max(1)).zip(rows.chunks_mut(stride)) {
            line.iter()
                .zip(row.chunks_exact_mut(4).skip(left))
                .for_each(|(pixel, target)| put(pixel, target));
        }
    }

    /// Draws marks over everything.
    pub(crate) fn mark(&mut self, groups: &[Group], face: &Face) {
        for mark in groups.iter().flat_map(|group| &group.marks) {
            draw(&mut self.pixmap.as_mut(), mark, face);
        }
    }

    /// The rows as the zlib stream of a PNG.
    pub(crate) fn stream(&self) -> Vec<u8> {
        png::stream(self.pixmap.data(), self.pixmap.width(), self.pixmap.height()).concat()
    }

    /// The picture as PNG with at most 256 colours.
    pub(crate) fn small_png(&self) -> Vec<u8> {
        png::encode_in_few_colors(self.pixmap.data(), self.pixmap.width(), self.pixmap.height())
    }

    /// The picture as PNG.
    pub(crate) fn png(&self) -> Vec<u8> {
        png::encode(self.pixmap.data(), self.pixmap.width(), self.pixmap.height())
    }
}

/// Lays a pixel over an opaque one.
fn put(pixel: &Pixel, target: &mut [u8]) {
    if !pixel.is_covered() {
        return;
    }
    for (part, below) in pixel.color.iter().zip(target) {
        let (over, under) = (f32::from(*part) / 255.0, f32::from(*below) / 255.0);
        *below = to_byte(under + pixel.coverage * (over - under));
    }
}

fn draw(target: &mut PixmapMut<'_>, mark: &Mark, face: &Face) {
    match mark {
        Mark::Text { at, size_px, anchor, is_strong, color, text } => {
            let size = *size_px as f32;
            if let Some(path) = face.path(text, size, *anchor, (at.x as f32, at.y as f32)) {
                target.fill_path(&path, &ink(*color), FillRule::Winding, Transform::identity(), None);
                stroke(target, &path, size * if *is_strong { STRONG } else { PLAIN }, *color);
            }
        }
        Mark::Line { from, to, width_px, color } => {
            let mut builder = PathBuilder::new();
            builder.move_to(from.x as f32, from.y as f32);
            builder.line_to(to.x as f32, to.y as f32);
            if let Some(path) = builder.finish() {
                stroke(target, &path, *width_px as f32, *color);
            }
        }
        Mark::Bent { points, width_px, color } => {
            let mut builder = PathBuilder::new();
            for (idx, at) in points.iter().enumerate() {
                let (x, y) = (at.x as f32, at.y as f32);
                if idx == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
            }
            if let Some(path) = builder.finish() {
                stroke(target, &path, *width_px as f32, *color);
            }
        }
        Mark::Bar { corner, size, palette } => {
            let n_bands = if palette.is_continuous { size.y as usize } else { palette.len() }.max(1);
            let band = size.y / n_bands as f64;
            for i in 0..n_bands {
                let value = (i as f32 + 0.5) / n_bands as f32;
                let y = corner.y + size.y - (i + 1) as f64 * band;
                // Bands overlap downwards, so that no paper shines through between them.
                let overlap = if i == 0 { 0.0 } else { 0.5 };
                fill_box(target, [corner.x, y, size.x, band + overlap], palette.at(value));
            }
        }
        Mark::Ring { center, radius_px, width_px, color } => {
            if let Some(path) = PathBuilder::from_circle(center.x as f32, center.y as f32, *radius_px as f32)
            {
                stroke(target, &path, *width_px as f32, *color);
            }
        }
    }
}

fn fill_box(target: &mut PixmapMut<'_>, [x, y, width, height]: [f64; 4], color: Rgb) {
    if let Some(rect) = Rect::from_xywh(x as f32, y as f32, width as f32, height as f32) {
        target.fill_rect(rect, &ink(color), Transform::identity(), None);
    }
}

fn stroke(target: &mut PixmapMut<'_>, path: &Path, width: f32, color: Rgb) {
    let stroke = Stroke { width, line_cap: LineCap::Butt, line_join: LineJoin::Round, ..Stroke::default() };
    target.stroke_path(path, &ink(color), &stroke, Transform::identity(), None);
}

fn ink(color: Rgb) -> Paint<'static> {
    let [r, g, b] = color.map(to_byte);
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(r, g, b, 255);
    paint
}
