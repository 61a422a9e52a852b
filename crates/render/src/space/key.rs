//! What stands below the panels: the scale bar, and what the colours mean.

use glam::DVec2;

use super::{Artist, LEADING, NOTE};
use crate::drawing::{Group, Mark};
use crate::furniture;
use crate::page::Page;
use crate::palette::Palette;
use crate::params::ColorBy;

/// Height of the key in layout units.
const KEY: f64 = 5.0;
/// Colours in the key; what is more is counted.
const MOST_SWATCHES: usize = 21;

impl Artist<'_> {
    /// Scale bar and what the colours mean, and their height.
    pub(super) fn key(&self, page: &Page, at: DVec2) -> (Vec<Group>, f64) {
        let unit = page.unit_px;
        let mut groups = Vec::new();
        groups.extend(furniture::scale_bar(page, at, self.params, &self.colors));
        let mut marks = Vec::new();
        let left = at.x + 14.0 * unit;
        let right = f64::from(page.width) - Page::margin_px(page.width);
        let mut pen = DVec2::new(left, at.y + 2.9 * unit);
        for (color, text) in self.swatches() {
            let width = f64::from(self.face.width(&text, (NOTE * unit) as f32)) + 3.2 * unit;
            if pen.x + width > right && pen.x > left {
                pen = DVec2::new(left, pen.y + LEADING * 1.2 * NOTE * unit);
            }
            if let Some(palette) = color {
                let corner = pen - DVec2::new(0.0, 0.95 * unit);
                marks.push(Mark::Bar { corner, size: DVec2::splat(1.1 * unit), palette });
            }
            let indent = if marks.is_empty() { 0.0 } else { 1.6 * unit };
            marks.push(self.text(pen + DVec2::new(indent, 0.0), (NOTE, false), self.colors.soft, &text));
            pen.x += width;
        }
        groups.push(Group { name: "key", marks });
        (groups, (pen.y - at.y - 2.9 * unit) + KEY * unit)
    }

    /// What the key says of the colours.
    fn swatches(&self) -> Vec<(Option<Palette>, String)> {
        let Some(scale) = &self.coloring.scale else { return Vec::new() };
        let swatch = |position: f64| Some(self.coloring.palette.only(position as f32));
        let mut list: Vec<_> = scale
            .ticks
            .iter()
            .take(MOST_SWATCHES)
            .map(|tick| (swatch(tick.position), tick.text.clone()))
            .collect();
        if let (Some((_, first)), ColorBy::Generation) = (list.first_mut(), self.params.color_by) {
            *first = format!("{} {first}", scale.caption);
        }
        if scale.ticks.len() > MOST_SWATCHES {
            list.push((None, format!("… and {} more", scale.ticks.len() - MOST_SWATCHES)));
        }
        list
    }
}
