//! The cells of a square grid through which a segment passes: who may be near whom.
//!
//! **Input** a segment, in units of a cell, and a margin. **Output** the cells, row by row; the hash of a cell.
//! **Guarantees** two segments nearer than the margin have a cell in common if one is visited with the margin and the
//! other with 0; each cell of a segment is visited once.
//! **Cost** O(cells).

use glam::DVec2;

/// Visits the cells within `margin` of a segment, all in units of a cell, until `visit` says no; whether it never
/// did.
pub(super) fn each_cell(a: DVec2, b: DVec2, margin: f64, mut visit: impl FnMut((i32, i32)) -> bool) -> bool {
    let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
    let (first_row, last_row) = (floor(low.y - margin), floor(high.y + margin));
    let slope = if high.y > low.y { (high.x - low.x) / (high.y - low.y) } else { 0.0 };
    for row in first_row..=last_row {
        // The piece of the segment that is within the margin of this row.
        let (from, to) = if slope == 0.0 || first_row == last_row {
            (low.x, high.x)
        } else {
            let at = |y: f64| low.x + slope * (y.clamp(low.y, high.y) - low.y);
            (at(f64::from(row) - margin), at(f64::from(row) + 1.0 + margin))
        };
        for column in floor(from.min(to) - margin)..=floor(from.max(to) + margin) {
            if !visit((column, row)) {
                return false;
            }
        }
    }
    true
}

/// The hash of a cell.
pub(super) fn mix((column, row): (i32, i32)) -> usize {
    // Two odd constants near 2³² / golden ratio and its square spread neighbours over the table.
    let mixed = (column as u32).wrapping_mul(0x9E37_79B1) ^ (row as u32).wrapping_mul(0x85EB_CA77);
    (mixed ^ (mixed >> 15)) as usize
}

/// The largest whole number that is not above x; a cast is much faster than the library's.
fn floor(x: f64) -> i32 {
    let towards_zero = x as i32;
    towards_zero.saturating_sub(i32::from(f64::from(towards_zero) > x))
}

#[cfg(test)]
mod tests {
    use espalier_geom::plane::{Segment, segment_distance};

    use super::*;
    use crate::common::stream;

    fn cells((a, b): (DVec2, DVec2), margin: f64) -> Vec<(i32, i32)> {
        let mut cells = Vec::new();
        assert!(each_cell(a, b, margin, |cell| {
            cells.push(cell);
            true
        }));
        cells
    }

    #[test]
    fn near_segments_have_a_cell_in_common() {
        let mut stream = stream(4100);
        let mut n_near = 0;
        for round in 0..20_000 {
            let mut point = |scale: f64| DVec2::new(stream.normal(), stream.normal()) * scale;
            let (a, c, margin) = (point(3.0), point(3.0), point(0.5).x.abs());
            // Some edges are level, upright or of no length.
            let b = match round % 7 {
                0 => a + DVec2::new(3.0, 0.0),
                1 => a + DVec2::new(0.0, 3.0),
                2 => a,
                _ => a + point(1.0),
            };
            let d = c + point(2.0);
            let (own, near) = (cells((a, b), 1e-9), cells((d, c), margin + 1e-9));
            for visited in [&own, &near] {
                let mut distinct = visited.clone();
                distinct.sort_unstable();
                distinct.dedup();
                assert_eq!(distinct.len(), visited.len(), "round {round}: a cell is visited twice");
            }
            if segment_distance(&Segment { a, b }, &Segment { a: c, b: d }) < margin {
                n_near += 1;
                assert!(own.iter().any(|cell| near.contains(cell)), "round {round}");
            }
        }
        assert!(n_near > 500, "{n_near}");
    }

    #[test]
    fn floors() {
        let values = [0.0, -0.0, 0.3, -0.3, 1.0, -1.0, 2.999, -2.001, -7.0, 1e9, -1e9 - 0.5, 1e300, -1e300];
        for x in values {
            assert_eq!(floor(x), espalier_geom::math::floor(x) as i32, "{x}");
        }
    }

    #[test]
    fn a_visit_ends_when_it_is_told_to() {
        let mut n_visits = 0;
        assert!(!each_cell(DVec2::ZERO, DVec2::new(9.0, 4.0), 0.5, |_| {
            n_visits += 1;
            n_visits < 3
        }));
        assert_eq!(n_visits, 3);
    }
}
