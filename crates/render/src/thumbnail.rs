//! The map as a small square without words, to be seen beside many others.
//!
//! **Input** a tree with its embedding, the side of the square. **Output** PNG, and how many mm the square is wide.
//! **Steps** each branch is a bent line as wide as its mean radius, at least a pixel, in the colour of the branch's radius
//! against the mean of the tree, on a dark rim; thin branches lie over thick ones.
//! **Guarantees** what cannot be drawn (numbers that are none, a tree without size) is left out.
//! **Cost** O(nodes).

use espalier_model::{Branch, Embedding, Tree};
use glam::DVec2;

use crate::coloring::mean_radius_mm;
use crate::drawing::{Group, Mark};
use crate::paint::Canvas;
use crate::palette::{PageColors, Rgb};
use crate::params::{ColorBy, Params, Theme};
use crate::text::Face;
use crate::{Error, color_table};

/// Room at each edge, as a share of the side.
const MARGIN: f64 = 0.04;
/// The least width of a line and what its rim adds, in pixels.
const LEAST_PX: f64 = 0.9;
const RIM_PX: f64 = 0.7;
/// The largest width, as a share of the side: radii in a wrong unit must not fill the square.
const MOST: f64 = 0.12;

/// A small picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Thumbnail {
    /// The picture.
    pub png: Vec<u8>,
    /// How many mm of the map it is wide and high.
    pub side_mm: f64,
}

/// Draws a map as a square of so many pixels, 16 to 1024.
///
/// # Errors
/// [`Error`] if the embedding is another tree's.
pub fn thumbnail(tree: &Tree, embedding: &Embedding, side_px: u32) -> Result<Thumbnail, Error> {
    let side_px = side_px.clamp(16, 1024);
    let params = Params { color_by: ColorBy::BranchRadius, theme: Theme::Light, ..Params::default() };
    let table = color_table(tree, embedding, &params)?;
    let colors = PageColors::of(Theme::Light);
    let known = || embedding.positions_mm.iter().filter(|position| position.is_finite());
    let low = known().copied().reduce(DVec2::min).unwrap_or_default();
    let high = known().copied().reduce(DVec2::max).unwrap_or_default();
    let extent_mm = (high - low).max_element();
    let side_mm = if extent_mm > 0.0 { extent_mm / (1.0 - 2.0 * MARGIN) } else { 1.0 };
    let px_per_mm = f64::from(side_px) / side_mm;
    let middle = 0.5 * (low + high);
    let at = |node: usize| {
        let offset = (embedding.positions_mm[node] - middle) * px_per_mm;
        DVec2::new(offset.x, -offset.y) + 0.5 * f64::from(side_px)
    };

    let branches = tree.branches();
    let width_px = |branch: &Branch| {
        (2.0 * mean_radius_mm(tree, branch) * px_per_mm).clamp(LEAST_PX, MOST * f64::from(side_px))
    };
    let mut order: Vec<(&Branch, f64)> = branches.list().iter().map(|b| (b, width_px(b))).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let bent = |branch: &Branch, width_px: f64, color: Rgb| {
        let points: Vec<DVec2> = branch.polyline().map(at).filter(|point| point.is_finite()).collect();
        (points.len() > 1).then_some(Mark::Bent { points, width_px, color })
    };
    let own = |branch: &Branch| {
        let [r, g, b] = table.colors[usize::from(table.bins[branch.end()])];
        [r, g, b].map(|part| f32::from(part) / 255.0)
    };
    let rims = order.iter().filter_map(|(branch, width)| bent(branch, width + 2.0 * RIM_PX, colors.rim));
    let tubes = order.iter().filter_map(|(branch, width)| bent(branch, *width, own(branch)));
    let marks = rims.chain(tubes).collect();
    let mut canvas = Canvas::new([side_px; 2], colors.background)?;
    canvas.mark(&[Group { name: "map", marks }], &Face::built_in()?);
    Ok(Thumbnail { png: canvas.small_png(), side_mm })
}

#[cfg(test)]
mod tests {
    #[test]
    fn few_colors_are_near_what_was_drawn() {
        // 17 × 15 pixels of 4,096 and more colours.
        let pixels: Vec<u8> = (0..17 * 15_u32)
            .flat_map(|i| [(i * 37 % 256) as u8, (i * 91 % 256) as u8, (i % 256) as u8, 255])
            .collect();
        let png = crate::png::encode_in_few_colors(&pixels, 17, 15);
        let pixmap = tiny_skia::Pixmap::decode_png(&png).expect("a PNG");
        assert_eq!((pixmap.width(), pixmap.height()), (17, 15));
        for (drawn, read) in pixels.chunks_exact(4).zip(pixmap.data().chunks_exact(4)) {
            let off = drawn.iter().zip(read).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(off <= Some(16), "{drawn:?} {read:?}");
        }
    }
}
