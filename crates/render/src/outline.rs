//! The outline of a branch as one closed SVG path.
//!
//! **Input** a chain of discs in pixels, y down. **Output** path data with 2 decimals.
//! **Steps** along the left side, round the tip, back along the other side, round the start. Bends are rounded on
//! the outer side and pivot through the axis on the inner side, so that the nonzero rule fills them.
//! **Cost** O(discs).

use std::fmt::Write as _;

use glam::DVec2;

/// Turns with a smaller sine than this are drawn as one mitred corner.
const GENTLE: f64 = 0.2;

/// The closed outline of a chain of discs.
pub(crate) fn outline(points: &[(DVec2, f64)]) -> String {
    // Directions need points apart: drop those that a picture cannot tell from the one before.
    let mut chain: Vec<(DVec2, f64)> = Vec::with_capacity(points.len());
    for &(point, radius) in points {
        match chain.last() {
            Some(&(last, _)) if last.distance(point) < 1e-3 => {}
            _ => chain.push((point, radius)),
        }
    }
    let Some(&(first, radius)) = chain.first() else { return String::new() };
    if chain.len() == 1 {
        return format!(
            "M{0:.2} {1:.2}A{2:.2} {2:.2} 0 0 1 {3:.2} {1:.2}A{2:.2} {2:.2} 0 0 1 {0:.2} {1:.2}Z",
            first.x - radius,
            first.y,
            radius,
            first.x + radius
        );
    }
    let mut path = String::new();
    side(&mut path, &chain, 'M');
    let backwards: Vec<(DVec2, f64)> = chain.iter().rev().copied().collect();
    round_to_other_side(&mut path, &backwards);
    side(&mut path, &backwards, 'L');
    round_to_other_side(&mut path, &chain);
    path.push('Z');
    path
}

/// The left side of a chain, from its start to its end, in the direction of travel with y down.
fn side(path: &mut String, chain: &[(DVec2, f64)], first_command: char) {
    let left = |i: usize| {
        let along = (chain[i + 1].0 - chain[i].0).normalize();
        DVec2::new(along.y, -along.x)
    };
    let n_spans = chain.len() - 1;
    let start = chain[0].0 + chain[0].1 * left(0);
    if first_command == 'M' {
        let _ = write!(path, "M{:.2} {:.2}", start.x, start.y);
    }
    for (i, &(point, radius)) in chain.iter().enumerate().take(n_spans).skip(1) {
        let (before, after) = (left(i - 1), left(i));
        let turn = before.perp_dot(after);
        let (p, q) = (point + radius * before, point + radius * after);
        if turn.abs() < GENTLE && before.dot(after) > 0.0 {
            let corner = point + radius * (before + after).normalize();
            let _ = write!(path, "L{:.2} {:.2}", corner.x, corner.y);
        } else if turn > 0.0 {
            // The chain turns right, away from this side: round the corner.
            let _ =
                write!(path, "L{:.2} {:.2}A{radius:.2} {radius:.2} 0 0 1 {:.2} {:.2}", p.x, p.y, q.x, q.y);
        } else {
            let _ =
                write!(path, "L{:.2} {:.2}L{:.2} {:.2}L{:.2} {:.2}", p.x, p.y, point.x, point.y, q.x, q.y);
        }
    }
    let end = chain[n_spans].0 + chain[n_spans].1 * left(n_spans - 1);
    let _ = write!(path, "L{:.2} {:.2}", end.x, end.y);
}

/// From the end of one side round the disc to where the other side, along `next`, starts.
fn round_to_other_side(path: &mut String, next: &[(DVec2, f64)]) {
    let (point, radius) = next[0];
    let along = (next[1].0 - point).normalize();
    let to = point + radius * DVec2::new(along.y, -along.x);
    let _ = write!(path, "A{radius:.2} {radius:.2} 0 0 1 {:.2} {:.2}", to.x, to.y);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_tube_is_two_sides_and_two_half_circles() {
        let path = outline(&[(DVec2::new(10.0, 20.0), 3.0), (DVec2::new(30.0, 20.0), 2.0)]);
        assert_eq!(
            path,
            "M10.00 17.00L30.00 18.00A2.00 2.00 0 0 1 30.00 22.00L10.00 23.00A3.00 3.00 0 0 1 10.00 17.00Z"
        );
    }

    #[test]
    fn bends_are_round_outside_and_pivot_inside() {
        let at = |x: f64, y: f64| (DVec2::new(x, y), 1.0);
        let path = outline(&[at(0.0, 0.0), at(10.0, 0.0), at(10.0, 10.0)]);
        assert_eq!(path.matches('A').count(), 3, "{path}");
        assert!(path.contains("L10.00 -1.00A1.00 1.00 0 0 1 11.00 0.00"), "{path}");
        assert!(path.contains("L9.00 0.00L10.00 0.00L10.00 1.00"), "{path}");
    }
}
