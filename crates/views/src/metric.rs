//! What a view of a part of a tree loses.
//!
//! **Input** a [`Part`] as an enhanced tree; a unit direction v towards the camera.
//! **Output** its loss, at least 0; 0 if the view shows all there is.
//! **Notation** for each edge, real or imaginary: w its share of the total length, s ∈ [0, 1] its projected
//! length over its length; S = Σ w s, the share of length that the view shows.
//! **Steps** `kl`: I = Σ p(o|v) ln(p(o|v) / p(o)) with p(o) = w and p(o|v) = w s / S, which is
//! (Σ w s ln s) / S − ln S. `ukl`: Σ w (s ln s − s + 1), the same distance between lengths that are not normalised.
//! **Guarantees** v and −v have the same loss; a planar part has loss 0 along its normal; never NaN, never infinite.
//! **Source** [Hu2022] Eq. 1 with its argmin, orthographic.
//! **Differs from the source** `ukl`: `kl` cannot see a foreshortening that all edges share, so it is blind on a
//! straight chain. A view along such a chain, where Eq. 1 has 0/0, loses [`NOTHING_SHOWN`].
//! **Cost** O(edges) per direction; sums in edge order.

use espalier_geom::math;
use espalier_model::Tree;
use glam::DVec3;

use crate::enhanced::Part;
use crate::params::Metric;

/// The `kl` loss of a view that projects every edge to a point: above any distance that two distributions of
/// shares can have in double precision, about ln(2^2098) = 1454.
pub(crate) const NOTHING_SHOWN: f64 = 1e6;

/// The edges of a part, as far as a view metric sees them.
#[derive(Clone, Debug)]
pub(crate) struct Edges {
    /// Unit direction and share of the total length of each edge, real ones first; edges of no length left out.
    list: Vec<(DVec3, f64)>,
}

/// What one view shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Seen {
    /// The loss.
    pub(crate) loss: f64,
    /// S, the share of the length that the view shows, in [0, 1]; 1 for a part without edges.
    pub(crate) shown: f64,
}

impl Edges {
    /// The edges of a part.
    pub(crate) fn of(tree: &Tree, part: &Part) -> Self {
        let vectors = part.real.iter().chain(&part.imaginary);
        let vectors = vectors.map(|&(a, b)| tree.position_mm(a) - tree.position_mm(b));
        let mut list: Vec<_> = vectors.filter_map(direction_and_length).collect();
        let total: f64 = list.iter().map(|&(_, length)| length).sum();
        for (_, share) in &mut list {
            *share /= total;
        }
        Self { list }
    }

    /// The number of edges.
    pub(crate) fn len(&self) -> usize {
        self.list.len()
    }

    /// The unit directions.
    pub(crate) fn directions(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.list.iter().map(|&(direction, _)| direction)
    }

    /// The direction of the longest edge, the first of equally long ones; `None` without edges.
    pub(crate) fn longest(&self) -> Option<DVec3> {
        let longest = self.list.iter().reduce(|best, edge| if edge.1 > best.1 { edge } else { best });
        longest.map(|&(direction, _)| direction)
    }

    /// About the same loss from any direction, with at most 3 n² edges: those of nearly one direction become one.
    ///
    /// Cells are n × n on each face of a cube, one face for both ends of an axis; an edge stands for its cell with
    /// the sum of the shares and their mean direction.
    pub(crate) fn gathered(&self, n: usize) -> Self {
        let mut cells = vec![(DVec3::ZERO, 0.0); 3 * n * n];
        for &(direction, share) in &self.list {
            let (cell, direction) = cell_of(direction, n);
            cells[cell].0 += share * direction;
            cells[cell].1 += share;
        }
        let full = cells.into_iter().filter(|&(_, share)| share > 0.0);
        Self { list: full.map(|(sum, share)| (sum.normalize_or_zero(), share)).collect() }
    }

    /// What the view from `towards_camera`, a unit vector, shows and loses.
    pub(crate) fn seen_from(&self, towards_camera: DVec3, metric: Metric) -> Seen {
        let (mut shown, mut entropy) = (0.0, 0.0);
        for &(direction, share) in &self.list {
            // The sine by the cross product keeps its digits where the edge points at the camera.
            let s = direction.cross(towards_camera).length().min(1.0);
            shown += share * s;
            entropy += if s > 0.0 { share * s * math::ln(s) } else { 0.0 };
        }
        if self.list.is_empty() {
            return Seen { loss: 0.0, shown: 1.0 };
        }
        let loss = match metric {
            Metric::Kl if shown > 0.0 => entropy / shown - math::ln(shown),
            Metric::Kl => NOTHING_SHOWN,
            Metric::Ukl => entropy - shown + 1.0,
        };
        // Rounding can leave a zero loss a few 1e-17 below zero.
        Seen { loss: loss.clamp(0.0, NOTHING_SHOWN), shown }
    }
}

/// The cell of a direction, and of the direction and its opposite the one on the cell's side: they look alike.
fn cell_of(direction: DVec3, n: usize) -> (usize, DVec3) {
    let size = direction.abs();
    let face = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    let direction = if direction[face] < 0.0 { -direction } else { direction };
    // From −1 to 1 across the face; the cast truncates what is not negative.
    let place = |axis: usize| {
        let at = 0.5 * (direction[axis] / direction[face] + 1.0) * n as f64;
        (at as usize).min(n - 1)
    };
    let (column, row) = (place((face + 1) % 3), place((face + 2) % 3));
    ((face * n + row) * n + column, direction)
}

/// The direction and the length of a vector; `None` if it has no length.
fn direction_and_length(vector: DVec3) -> Option<(DVec3, f64)> {
    // Scaled first: the square of a very short vector would underflow.
    let scale = vector.abs().max_element();
    if scale == 0.0 {
        return None;
    }
    let scaled = vector / scale;
    let length = scaled.length();
    Some((scaled / length, length * scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges(vectors: &[DVec3]) -> Edges {
        let mut list: Vec<_> = vectors.iter().copied().filter_map(direction_and_length).collect();
        let total: f64 = list.iter().map(|edge| edge.1).sum();
        list.iter_mut().for_each(|edge| edge.1 /= total);
        Edges { list }
    }

    #[test]
    fn values_by_hand() {
        // One edge of length 2 seen whole, one of length 1 seen at half its length.
        let slanted = DVec3::new(0.5, 0.0, 0.75_f64.sqrt());
        let pair = edges(&[DVec3::X * 2.0, slanted]);
        let (w, s) = ([2.0 / 3.0, 1.0 / 3.0], [1.0, 0.5]);
        let shown = w[0] * s[0] + w[1] * s[1];
        let p = [w[0] * s[0] / shown, w[1] * s[1] / shown];
        let kl = p[0] * math::ln(p[0] / w[0]) + p[1] * math::ln(p[1] / w[1]);
        let ukl = w[1] * (0.5 * math::ln(0.5) - 0.5 + 1.0);
        let seen = |metric| pair.seen_from(DVec3::Z, metric);
        assert!((seen(Metric::Kl).loss - kl).abs() < 1e-15);
        assert!((seen(Metric::Ukl).loss - ukl).abs() < 1e-15);
        assert!((seen(Metric::Ukl).shown - shown).abs() < 1e-15);
        assert_eq!(pair.seen_from(DVec3::NEG_Z, Metric::Ukl), seen(Metric::Ukl));
    }

    #[test]
    fn kl_is_blind_to_a_common_foreshortening_and_ukl_is_not() {
        let chain = edges(&[DVec3::X, DVec3::X * 3.0]);
        let slanted = DVec3::new(1.0, 0.0, 1.0).normalize();
        assert!(chain.seen_from(slanted, Metric::Kl).loss < 1e-15);
        assert!(chain.seen_from(slanted, Metric::Ukl).loss > 0.04);
        assert_eq!(chain.seen_from(DVec3::X, Metric::Kl).loss, NOTHING_SHOWN);
        assert_eq!(chain.seen_from(DVec3::X, Metric::Ukl).loss, 1.0);
    }

    #[test]
    fn gathered_edges_lose_about_the_same() {
        let all =
            edges(&espalier_geom::space::half_sphere(5000).map(|v| v * (1.5 + v.x)).collect::<Vec<_>>());
        for (n, tolerance) in [(8, 5e-3), (32, 4e-4)] {
            let few = all.gathered(n);
            assert!(few.len() <= 3 * n * n);
            assert!((few.list.iter().map(|edge| edge.1).sum::<f64>() - 1.0).abs() < 1e-12);
            for view in espalier_geom::space::half_sphere(40) {
                let off = few.seen_from(view, Metric::Ukl).loss - all.seen_from(view, Metric::Ukl).loss;
                assert!(off.abs() < tolerance, "{n} {off}");
            }
        }
        let opposite = edges(&[DVec3::X, DVec3::NEG_X, DVec3::new(1.0, 1.0, 1.0), DVec3::NEG_ONE]);
        assert_eq!(opposite.gathered(4).len(), 2);
    }

    #[test]
    fn tiny_huge_and_no_edges() {
        assert_eq!(edges(&[]).seen_from(DVec3::X, Metric::Kl), Seen { loss: 0.0, shown: 1.0 });
        let mixed = edges(&[DVec3::splat(1e-300), DVec3::X * 1e90, DVec3::ZERO]);
        assert_eq!(mixed.len(), 2);
        assert!(mixed.list.iter().all(|edge| (edge.0.length() - 1.0).abs() < 1e-15));
    }
}
