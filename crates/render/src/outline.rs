//! The outline of a branch as one closed path.
//!
//! **Input** a chain of discs in pixels, y down. **Output** lines and arcs; as SVG path data with 2 decimals.
//! **Steps** along the left side, round the tip, back along the other side, round the start. Bends are rounded on
//! the outer side and pivot through the axis on the inner side, so that the nonzero rule fills them.
//! **Cost** O(discs).

use std::fmt::Write as _;

use glam::DVec2;

/// Turns with a smaller sine than this are drawn as one mitred corner.
const GENTLE: f64 = 0.2;

/// A piece of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Piece {
    /// Begins here.
    Move(DVec2),
    /// A straight line to here.
    Line(DVec2),
    /// Round a disc, at most half of it, clockwise as seen with y down, to a point.
    Arc {
        /// The disc's centre.
        center: DVec2,
        /// Its radius.
        radius: f64,
        /// Where the arc ends.
        to: DVec2,
    },
}

/// The closed outline of a chain of discs.
pub(crate) fn outline(points: &[(DVec2, f64)]) -> Vec<Piece> {
    // Directions need points apart: drop those that a picture cannot tell from the one before.
    let mut chain: Vec<(DVec2, f64)> = Vec::with_capacity(points.len());
    for &(point, radius) in points {
        match chain.last() {
            Some(&(last, _)) if last.distance(point) < 1e-3 => {}
            _ => chain.push((point, radius)),
        }
    }
    let Some(&(first, radius)) = chain.first() else { return Vec::new() };
    if chain.len() == 1 {
        return disc(first, radius);
    }
    let mut path = Vec::with_capacity(2 * chain.len() + 4);
    side(&mut path, &chain);
    let backwards: Vec<(DVec2, f64)> = chain.iter().rev().copied().collect();
    round_to_other_side(&mut path, &backwards);
    side(&mut path, &backwards);
    round_to_other_side(&mut path, &chain);
    path
}

/// A whole disc.
pub(crate) fn disc(center: DVec2, radius: f64) -> Vec<Piece> {
    let (left, right) = (center - radius * DVec2::X, center + radius * DVec2::X);
    vec![Piece::Move(left), Piece::Arc { center, radius, to: right }, Piece::Arc { center, radius, to: left }]
}

/// The line through the middles of the discs.
pub(crate) fn polyline(points: &[(DVec2, f64)]) -> Vec<Piece> {
    let piece = |(i, &(point, _)): (usize, &(DVec2, f64))| {
        if i == 0 { Piece::Move(point) } else { Piece::Line(point) }
    };
    points.iter().enumerate().map(piece).collect()
}

/// SVG path data, open.
pub(crate) fn svg_data(pieces: &[Piece]) -> String {
    let mut data = String::with_capacity(16 * pieces.len());
    for piece in pieces {
        // Writing to a string cannot fail.
        let _ = match piece {
            Piece::Move(to) => write!(data, "M{:.2} {:.2}", to.x, to.y),
            Piece::Line(to) => write!(data, "L{:.2} {:.2}", to.x, to.y),
            Piece::Arc { radius, to, .. } => {
                write!(data, "A{radius:.2} {radius:.2} 0 0 1 {:.2} {:.2}", to.x, to.y)
            }
        };
    }
    data
}

/// The left side of a chain, from its start to its end, in the direction of travel with y down. The first side moves to
/// its start; the second is there already.
fn side(path: &mut Vec<Piece>, chain: &[(DVec2, f64)]) {
    let left = |i: usize| {
        let along = (chain[i + 1].0 - chain[i].0).normalize();
        DVec2::new(along.y, -along.x)
    };
    let n_spans = chain.len() - 1;
    if path.is_empty() {
        path.push(Piece::Move(chain[0].0 + chain[0].1 * left(0)));
    }
    for (i, &(center, radius)) in chain.iter().enumerate().take(n_spans).skip(1) {
        let (before, after) = (left(i - 1), left(i));
        let turn = before.perp_dot(after);
        let (p, q) = (center + radius * before, center + radius * after);
        if turn.abs() < GENTLE && before.dot(after) > 0.0 {
            path.push(Piece::Line(center + radius * (before + after).normalize()));
        } else if turn > 0.0 {
            // The chain turns right, away from this side: round the corner.
            path.extend([Piece::Line(p), Piece::Arc { center, radius, to: q }]);
        } else {
            path.extend([p, center, q].map(Piece::Line));
        }
    }
    path.push(Piece::Line(chain[n_spans].0 + chain[n_spans].1 * left(n_spans - 1)));
}

/// From the end of one side round the disc to where the other side, along `next`, starts.
fn round_to_other_side(path: &mut Vec<Piece>, next: &[(DVec2, f64)]) {
    let (center, radius) = next[0];
    let along = (next[1].0 - center).normalize();
    path.push(Piece::Arc { center, radius, to: center + radius * DVec2::new(along.y, -along.x) });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_tube_is_two_sides_and_two_half_circles() {
        let path = svg_data(&outline(&[(DVec2::new(10.0, 20.0), 3.0), (DVec2::new(30.0, 20.0), 2.0)]));
        assert_eq!(
            path,
            "M10.00 17.00L30.00 18.00A2.00 2.00 0 0 1 30.00 22.00L10.00 23.00A3.00 3.00 0 0 1 10.00 17.00"
        );
    }

    #[test]
    fn bends_are_round_outside_and_pivot_inside() {
        let at = |x: f64, y: f64| (DVec2::new(x, y), 1.0);
        let path = svg_data(&outline(&[at(0.0, 0.0), at(10.0, 0.0), at(10.0, 10.0)]));
        assert_eq!(path.matches('A').count(), 3, "{path}");
        assert!(path.contains("L10.00 -1.00A1.00 1.00 0 0 1 11.00 0.00"), "{path}");
        assert!(path.contains("L9.00 0.00L10.00 0.00L10.00 1.00"), "{path}");
    }
}
