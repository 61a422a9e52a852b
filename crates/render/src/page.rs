//! The page: how large the tree is drawn, and where the key finds room.
//!
//! **Input** the box of the drawn tree, the heights of heading and key. **Output** size, scale, places.
//! **Steps** 1. The tree fills the width; the height follows from its shape within limits. 2. The key takes the
//! first corner of the tree's area that no branch enters. 3. If there is none, the tree leaves a column at the
//! right for it.
//! **Cost** O(edges).

use espalier_geom::math;
use espalier_model::Tree;
use glam::DVec2;

use crate::Error;
use crate::params::Style;
use crate::scene::Scene;

/// How many pixels a picture may have: at 4 bytes each, half a gigabyte.
pub(crate) const MAX_PIXELS: u64 = 1 << 27;
/// Bounds of height over width of the tree's area.
const ASPECT: [f64; 2] = [0.42, 1.35];
/// The least layout unit in pixels: small text is then 7 pixels high.
const LEAST_UNIT_PX: f64 = 6.0;
/// Narrower pictures are thumbnails: they show the tree, the verdict and the scale bar, and no more.
const THUMBNAIL_PX: u32 = 480;
/// A tree smaller than this in every direction has no scale of its own, mm.
const SMALLEST_MM: f64 = 1e-12;

/// Room that the marks need, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Needs {
    /// Height of the heading.
    pub heading_px: f64,
    /// Size of the key.
    pub key_px: DVec2,
    /// Room around the tree for marks at its edges.
    pub rim_px: f64,
    /// Height of the page over its width; if nobody says, the tree's shape does.
    pub aspect: Option<f64>,
}

/// A page in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Page {
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
    /// The unit of the layout: a hundredth of the width, but never so small that text cannot be read.
    pub unit_px: f64,
    /// The scale.
    pub px_per_mm: f64,
    /// The pixel of the scene's origin.
    pub origin_px: DVec2,
    /// The area of the tree: upper left and lower right corner.
    pub area: [DVec2; 2],
    /// The upper left corner of the key.
    pub key_at: DVec2,
    /// How wide branches are drawn.
    pub pen: Pen,
}

/// A page with a map on it: which point of the map's plane a pixel is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Paper<'a> {
    /// The page.
    pub page: &'a Page,
    /// Where the plane's right lies on the page, y up: it may be turned as a whole.
    right: DVec2,
}

impl<'a> Paper<'a> {
    /// The page of a map that was turned by so many degrees counter-clockwise.
    pub(crate) fn new(page: &'a Page, turn_deg: u32) -> Self {
        Self { page, right: math::unit_vector(f64::from(turn_deg).to_radians()) }
    }

    /// The point of the plane at a place on the page, in pixels, mm.
    pub(crate) fn plane_mm(&self, at_px: DVec2) -> DVec2 {
        let away = (at_px - self.page.origin_px) / self.page.px_per_mm;
        self.turned(DVec2::new(away.x, -away.y))
    }

    /// A direction on the page, y up, in the plane.
    pub(crate) fn turned(&self, on_page: DVec2) -> DVec2 {
        DVec2::new(self.right.x, -self.right.y).rotate(on_page)
    }
}

/// How wide branches are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pen {
    /// The least width; the width of every branch in the line style.
    pub min_width_px: f64,
    /// True radii or lines.
    pub style: Style,
}

impl Page {
    /// Width and height in pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.width as usize, self.height as usize]
    }

    /// The area of the tree as a page of its own, in its own pixels: a panel of several.
    pub(crate) fn panel(&self) -> Self {
        let [low, high] = self.area;
        let size = (high - low).ceil().max(DVec2::ONE);
        Self {
            width: size.x as u32,
            height: size.y as u32,
            origin_px: self.origin_px - low,
            area: [DVec2::ZERO, size],
            ..*self
        }
    }

    /// The layout unit of a page of this width.
    pub(crate) fn unit_px(width: u32) -> f64 {
        (f64::from(width) / 100.0).max(LEAST_UNIT_PX)
    }

    /// Whether a page of this width has room for the essentials only.
    pub(crate) fn is_thumbnail(width: u32) -> bool {
        width < THUMBNAIL_PX
    }

    /// The empty border of a page.
    pub(crate) fn margin_px(width: u32) -> f64 {
        2.2 * Self::unit_px(width)
    }

    /// Lays out a page for a scene.
    pub(crate) fn lay_out(
        tree: &Tree,
        scene: &Scene,
        (width, pen): (u32, Pen),
        needs: &Needs,
    ) -> Result<Self, Error> {
        let wide = Self::fit(scene, (width, pen), needs, 0.0)?;
        if let Some(key_at) = wide.free_corner(tree, scene, needs.key_px) {
            return Ok(Self { key_at, ..wide });
        }
        let narrow = Self::fit(scene, (width, pen), needs, needs.key_px.x + wide.unit_px)?;
        let key_at = DVec2::new(f64::from(width) - Self::margin_px(width), narrow.area[1].y) - needs.key_px;
        Ok(Self { key_at: key_at.max(DVec2::new(0.0, needs.heading_px)), ..narrow })
    }

    /// The page with a column of `column_px` left free at the right.
    fn fit(scene: &Scene, (width, pen): (u32, Pen), needs: &Needs, column_px: f64) -> Result<Self, Error> {
        let unit_px = Self::unit_px(width);
        let margin = Self::margin_px(width);
        let (low, high) = scene.bounds_mm();
        let size_mm = (high - low).max(DVec2::splat(SMALLEST_MM));

        // The room for the tree itself, inside the rim and half a line all round.
        let rim = needs.rim_px + 0.5 * pen.min_width_px;
        let room_x = (f64::from(width) - 2.0 * margin - column_px - 2.0 * rim).max(unit_px);
        let room_y = match needs.aspect {
            Some(aspect) => f64::from(width) * aspect - 2.0 * (margin + rim) - needs.heading_px,
            None => room_x * (size_mm.y / size_mm.x).clamp(ASPECT[0], ASPECT[1]),
        };
        let room = DVec2::new(room_x, room_y.max(needs.key_px.y).max(unit_px));
        let px_per_mm = (room / size_mm).min_element();

        let area_low = DVec2::new(margin, margin + needs.heading_px);
        let area_high = area_low + room + 2.0 * rim;
        let height = (area_high.y + margin) as u32;
        if u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(Error::TooLarge { width, height, limit: MAX_PIXELS });
        }
        let center_mm = 0.5 * (low + high);
        let origin_px = 0.5 * (area_low + area_high) - px_per_mm * DVec2::new(center_mm.x, -center_mm.y);
        let area = [area_low, area_high];
        let key_at = area_low;
        Ok(Self { width, height, unit_px, px_per_mm, origin_px, area, key_at, pen })
    }

    /// The turn in whole degrees, counter-clockwise, with which a scene fills its page best: that draws it largest
    /// where the page's shape is given, else largest for the area of its page. The smallest of equals.
    pub(crate) fn best_turn(scene: &Scene, (width, pen): (u32, Pen), needs: &Needs) -> Result<u32, Error> {
        let mut best = (0, 0.0);
        for turn_deg in 0..360 {
            let page = Self::fit(&scene.turned(turn_deg), (width, pen), needs, 0.0)?;
            let size = if needs.aspect.is_some() { 1.0 } else { f64::from(page.height) };
            let fill = page.px_per_mm * page.px_per_mm / size;
            // Half a turn away the box is the same but for rounding.
            if fill > best.1 * (1.0 + 1e-6) {
                best = (turn_deg, fill);
            }
        }
        Ok(best.0)
    }

    /// The pixel of a scene point.
    pub(crate) fn px(&self, point_mm: DVec2) -> DVec2 {
        self.origin_px + self.px_per_mm * DVec2::new(point_mm.x, -point_mm.y)
    }

    /// The drawn radius of a node in pixels: never under half the least width.
    pub(crate) fn radius_px(&self, radius_mm: f64) -> f64 {
        let least = 0.5 * self.pen.min_width_px;
        match self.pen.style {
            Style::PseudoSurface | Style::Ribbon | Style::Volume => (radius_mm * self.px_per_mm).max(least),
            Style::Line => least,
        }
    }

    /// The first corner in which a box of `size` touches no branch.
    fn free_corner(&self, tree: &Tree, scene: &Scene, size: DVec2) -> Option<DVec2> {
        let [low, high] = self.area;
        let far = high - size;
        [far, DVec2::new(low.x, far.y), DVec2::new(far.x, low.y), low]
            .into_iter()
            .filter(|corner| corner.cmpge(low).all())
            .find(|&corner| self.is_free(tree, scene, [corner, corner + size]))
    }

    fn is_free(&self, tree: &Tree, scene: &Scene, [low, high]: [DVec2; 2]) -> bool {
        let gap = 0.8 * self.unit_px;
        let point = |node: usize| self.px(scene.points_mm[node].truncate());
        let reach = |node: usize| self.radius_px(scene.radii_mm[node]) + gap;
        let root_mark = 5.0 * self.unit_px;
        if meets_box(point(0), point(0), [low - root_mark, high + root_mark]) {
            return false;
        }
        !tree.edges().any(|(node, parent)| {
            let grow = reach(node).max(reach(parent));
            meets_box(point(node), point(parent), [low - grow, high + grow])
        })
    }
}

/// Whether the segment a–b meets a box: clip its parameter range by each side (Liang and Barsky).
fn meets_box(a: DVec2, b: DVec2, [low, high]: [DVec2; 2]) -> bool {
    let mut range = (0.0_f64, 1.0_f64);
    for axis in 0..2 {
        let (from, along) = (a[axis], b[axis] - a[axis]);
        if along == 0.0 {
            if from < low[axis] || from > high[axis] {
                return false;
            }
            continue;
        }
        let (p, q) = ((low[axis] - from) / along, (high[axis] - from) / along);
        range = (range.0.max(p.min(q)), range.1.min(p.max(q)));
    }
    range.0 <= range.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_and_segments() {
        let square = [DVec2::ZERO, DVec2::ONE];
        let p = |x, y| DVec2::new(x, y);
        for (a, b, expected) in [
            (p(-1.0, 0.5), p(2.0, 0.5), true),
            (p(0.2, 0.2), p(0.3, 0.3), true),
            (p(-1.0, 0.5), p(0.5, 2.1), false),
            (p(2.0, 0.5), p(2.0, -5.0), false),
            (p(0.5, 0.5), p(0.5, 0.5), true),
        ] {
            assert_eq!(meets_box(a, b, square), expected, "{a} {b}");
        }
    }
}
