//! Panels in rows and columns, all at one scale.
//!
//! **Input** the sizes of what the panels show, the width of the page, the room for text. **Output** the number of
//! columns and the scale.
//! **Notation** c columns, s pixels per mm. **Steps** for each c: the widest panel limits s, and so does the height that
//! the page may have, of which each row takes its highest panel and its text. The c with the largest s is taken.
//! **Cost** O(panels²).

use glam::DVec2;

/// What the panels have to fit into, in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    /// Width of the page between its margins.
    pub width_px: f64,
    /// Height that all rows together may take.
    pub height_px: f64,
    /// The least width of a panel.
    pub least_px: f64,
    /// Space between columns.
    pub gap_px: f64,
    /// Height of a row beside its trees: title, notes, space.
    pub text_px: f64,
    /// Space around a tree inside of its panel.
    pub rim_px: f64,
    /// What the first panel needs beside its tree, left and right together.
    pub first_px: f64,
}

/// The columns and the scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tiling {
    /// Panels in a row.
    pub n_columns: usize,
    /// Width of a panel.
    pub panel_px: f64,
    /// The scale of all panels.
    pub px_per_mm: f64,
}

/// The least height of all trees together, as a share of the width.
const LEAST_SHARE: f64 = 0.1;
/// A tree smaller than this has no scale of its own, mm.
const SMALLEST_MM: f64 = 1e-12;

impl Tiling {
    /// The tiling with the largest scale for panels of these sizes.
    pub(crate) fn of(sizes_mm: &[DVec2], room: &Room) -> Self {
        let n_panels = sizes_mm.len().max(1);
        let most = ((room.width_px + room.gap_px) / (room.least_px + room.gap_px)) as usize;
        let tilings = (1..=most.clamp(1, n_panels)).map(|n_columns| Self::with(n_columns, sizes_mm, room));
        let largest = |a: Self, b: Self| if b.px_per_mm > a.px_per_mm { b } else { a };
        tilings.reduce(largest).unwrap_or(Self { n_columns: 1, panel_px: room.width_px, px_per_mm: 1.0 })
    }

    fn with(n_columns: usize, sizes_mm: &[DVec2], room: &Room) -> Self {
        let n = n_columns as f64;
        let panel_px = (room.width_px + room.gap_px) / n - room.gap_px;
        let by_width = sizes_mm.iter().enumerate().map(|(idx, size)| {
            let beside_px = 2.0 * room.rim_px + if idx == 0 { room.first_px } else { 0.0 };
            (panel_px - beside_px).max(1.0) / size.x.max(SMALLEST_MM)
        });
        let by_width = by_width.fold(f64::INFINITY, f64::min);
        let (mut rows_mm, mut text_px) = (0.0, 0.0);
        for row in sizes_mm.chunks(n_columns) {
            rows_mm += highest_mm(row);
            text_px += room.text_px + 2.0 * room.rim_px;
        }
        // Where text takes the height, the trees still get a share of the width.
        let for_trees_px = (room.height_px - text_px).max(LEAST_SHARE * room.width_px);
        let by_height = for_trees_px / f64::max(rows_mm, SMALLEST_MM);
        Self { n_columns, panel_px, px_per_mm: by_width.min(by_height) }
    }

    /// The height of the trees' area in a row of panels of these sizes.
    pub(crate) fn row_px(&self, row_mm: &[DVec2], room: &Room) -> f64 {
        highest_mm(row_mm) * self.px_per_mm + 2.0 * room.rim_px
    }
}

fn highest_mm(row: &[DVec2]) -> f64 {
    row.iter().fold(0.0, |highest, size| highest.max(size.y))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROOM: Room = Room {
        width_px: 1000.0,
        height_px: 1000.0,
        least_px: 200.0,
        gap_px: 0.0,
        text_px: 0.0,
        rim_px: 0.0,
        first_px: 0.0,
    };

    #[test]
    fn wide_trees_stand_in_rows_and_high_ones_in_columns() {
        let wide = [DVec2::new(10.0, 2.0); 4];
        assert_eq!(Tiling::of(&wide, &ROOM), Tiling { n_columns: 1, panel_px: 1000.0, px_per_mm: 100.0 });
        let high = [DVec2::new(2.0, 8.0); 4];
        assert_eq!(Tiling::of(&high, &ROOM), Tiling { n_columns: 4, panel_px: 250.0, px_per_mm: 125.0 });
        let square = [DVec2::ONE; 4];
        assert_eq!(Tiling::of(&square, &ROOM).n_columns, 2);
    }

    #[test]
    fn there_is_always_a_scale() {
        for sizes in [vec![], vec![DVec2::ZERO; 3], vec![DVec2::new(0.0, 5.0); 200]] {
            for room in [
                ROOM,
                Room { first_px: 5000.0, ..ROOM },
                Room { text_px: 900.0, ..ROOM },
                Room { width_px: 10.0, ..ROOM },
            ] {
                let tiling = Tiling::of(&sizes, &room);
                assert!(tiling.px_per_mm.is_finite() && tiling.px_per_mm > 0.0, "{tiling:?}");
            }
        }
    }
}
