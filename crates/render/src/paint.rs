//! The picture as PNG: the raster on its paper, the marks over it.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PixmapMut, PremultipliedColorU8, Rect,
    Stroke, Transform,
};

use crate::Error;
use crate::drawing::{Group, Mark};
use crate::page::Page;
use crate::palette::{Rgb, to_byte};
use crate::raster::Pixel;
use crate::shade::mix;
use crate::text::Face;

/// How much bolder strong text is, as a share of its size.
const STRONG: f32 = 0.045;
/// Ordinary text is a light face; a hair more weight makes it as dark as the lines.
const PLAIN: f32 = 0.012;

/// Paints the page.
pub(crate) fn png(
    page: &Page,
    pixels: &[Pixel],
    groups: &[Group],
    (background, face): (Rgb, &Face),
) -> Result<Vec<u8>, Error> {
    let (width, height) = (page.width, page.height);
    let too_large = || Error::TooLarge { width, height, limit: crate::page::MAX_PIXELS };
    let mut pixmap = Pixmap::new(width, height).ok_or_else(too_large)?;
    for (target, pixel) in pixmap.pixels_mut().iter_mut().zip(pixels) {
        let color = pixel.color.map(|part| f32::from(part) / 255.0);
        let [r, g, b] = mix(background, color, pixel.coverage).map(to_byte);
        *target = PremultipliedColorU8::from_rgba(r, g, b, 255).unwrap_or(PremultipliedColorU8::TRANSPARENT);
    }
    for mark in groups.iter().flat_map(|group| &group.marks) {
        draw(&mut pixmap.as_mut(), mark, face);
    }
    encode(&pixmap)
}

fn encode(pixmap: &Pixmap) -> Result<Vec<u8>, Error> {
    let opaque: Vec<u8> = pixmap.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive).write_image(
        &opaque,
        pixmap.width(),
        pixmap.height(),
        ExtendedColorType::Rgb8,
    )?;
    Ok(bytes)
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
