//! Distances to the edge of a mask within one slice.
//!
//! **Input** a slice of a mask. **Output** for each of its voxels the distance to the nearest centre on the other side of
//! the edge, positive inside, at most a limit, the slice's thickness, in mm.
//! **Steps** 1. Every voxel beside the edge offers its own distance to those of the other side within the limit. 2. Where
//! walls are rough, the limit is [`ROUGH_LIMIT`] voxels, and a Gaussian of [`SIGMA`] voxels smooths; thin branches that it would
//! take are given back with their own distances. 3. All lies
//! a little further inside ([`GAIN`]).
//! **Guarantees** exact but for the Gaussian: the nearest centre on the other side has one of its four neighbours on this
//! side.
//! **Cost** O(voxels + edge · limit²).

use espalier_geom::math;

/// By how much a body is made wider on each side, for each time that a slice is as thick as a voxel is wide, in voxels: where
/// the outlines of two slices differ, what lies between them comes out too thin, the more the further they are apart. On
/// phantoms it brings the bias of radii below 0.05 voxel, on slices of 2.5 and of 3.6 voxels.
const GAIN: f64 = 0.09;
/// The most that it is: less than a voxel, so that no slice of a smooth mask changes.
const MAX_GAIN: f64 = 0.5;
/// Standard deviation of the Gaussian, in voxels: of 0.85 to 1.2 the one with as many tips lost as false on phantoms with
/// 15 % of their surface flipped.
const SIGMA: f64 = 1.1;
/// The Gaussian ends after so many standard deviations.
const TRUNCATE: f64 = 3.0;
/// The largest distance that is smoothed, in voxels: further out a distance says nothing of the wall, and weighs too much.
const ROUGH_LIMIT: f64 = 1.4;
/// A wall is rough from this share of pits on: on phantoms smooth ones have 0.1 %, with 15 % of the surface flipped 8.5 %.
const LEAST_PITS: f64 = 0.02;

/// What the edge of a mask is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wall {
    Smooth,
    Rough,
}

impl Wall {
    /// The kind of a wall with so many pits among its voxels.
    pub(super) fn of(n_pits: usize, n_walls: usize) -> Self {
        if n_pits as f64 > (LEAST_PITS * n_walls as f64).max(1.0) { Self::Rough } else { Self::Smooth }
    }
}

/// How many voxels of a spacing about a body have distances that matter.
pub(super) fn margin(limit_mm: f64, spacing_mm: f64) -> usize {
    (limit_mm / spacing_mm).ceil() as usize + math::ceil(TRUNCATE * SIGMA) as usize
}

/// A part of a slice, first axis fastest.
pub(super) struct Section {
    extent: [usize; 2],
    spacing_mm: [f64; 2],
    pub(super) inside: Vec<bool>,
}

impl Section {
    pub(super) fn empty(extent: [usize; 2], spacing_mm: [f64; 2]) -> Self {
        Self { extent, spacing_mm, inside: vec![false; extent[0] * extent[1]] }
    }

    /// The voxels outside with foreground on three of their four sides or more, and those with any.
    pub(super) fn pits_and_walls(&self) -> [usize; 2] {
        let mut counts = [0; 2];
        for place in (0..self.inside.len()).filter(|&place| !self.inside[place]) {
            let n_sides = self.beside(place).filter(|&other| self.inside[other]).count();
            counts[0] += usize::from(n_sides >= 3);
            counts[1] += usize::from(n_sides >= 1);
        }
        counts
    }

    /// The distance at each voxel of a smooth slice, in mm.
    pub(super) fn distances(&self, limit_mm: f64) -> Vec<f32> {
        self.gained(self.exact(limit_mm), limit_mm)
    }

    /// The distance at each voxel of a rough slice, in mm.
    pub(super) fn smooth_distances(&self, limit_mm: f64) -> Vec<f32> {
        let distances = self.smoothed(self.exact(limit_mm.min(ROUGH_LIMIT * self.voxel_mm())));
        self.gained(distances, limit_mm)
    }

    fn gained(&self, mut distances: Vec<f32>, thickness_mm: f64) -> Vec<f32> {
        let gain_mm = (GAIN * thickness_mm).min(MAX_GAIN * self.voxel_mm());
        distances.iter_mut().for_each(|distance| *distance += gain_mm as f32);
        distances
    }

    fn voxel_mm(&self) -> f64 {
        self.spacing_mm[0].min(self.spacing_mm[1])
    }

    fn beside(&self, place: usize) -> impl Iterator<Item = usize> + use<> {
        let [nu, nv] = self.extent;
        let (u, v) = (place % nu, place / nu);
        let sides = [(u > 0, 1, false), (u + 1 < nu, 1, true), (v > 0, nu, false), (v + 1 < nv, nu, true)];
        sides
            .into_iter()
            .filter(|(is_in, ..)| *is_in)
            .map(move |(_, stride, is_up)| if is_up { place + stride } else { place - stride })
    }

    fn exact(&self, limit_mm: f64) -> Vec<f32> {
        let [nu, nv] = self.extent;
        let reach = [0, 1].map(|axis| (limit_mm / self.spacing_mm[axis]) as usize);
        let mut squares = vec![limit_mm * limit_mm; self.inside.len()];
        for place in 0..self.inside.len() {
            let own = self.inside[place];
            if self.beside(place).all(|other| self.inside[other] == own) {
                continue;
            }
            let (u, v) = (place % nu, place / nu);
            for row in v.saturating_sub(reach[1])..(v + reach[1] + 1).min(nv) {
                let dv = row.abs_diff(v) as f64 * self.spacing_mm[1];
                for column in u.saturating_sub(reach[0])..(u + reach[0] + 1).min(nu) {
                    let du = column.abs_diff(u) as f64 * self.spacing_mm[0];
                    let other = row * nu + column;
                    if self.inside[other] != own {
                        squares[other] = squares[other].min(du * du + dv * dv);
                    }
                }
            }
        }
        let signed = |(square, &inside): (f64, &bool)| if inside { square.sqrt() } else { -square.sqrt() };
        squares.into_iter().zip(&self.inside).map(|pair| signed(pair) as f32).collect()
    }

    /// Blurs along both axes; beyond the border the edge goes on.
    fn smoothed(&self, mut distances: Vec<f32>) -> Vec<f32> {
        let reach = math::ceil(TRUNCATE * SIGMA) as i64;
        let bell = |i: i64| math::exp(-0.5 * (i as f64 / SIGMA) * (i as f64 / SIGMA));
        let total: f64 = (-reach..=reach).map(bell).sum();
        let kernel: Vec<(i64, f64)> = (-reach..=reach).map(|i| (i, bell(i) / total)).collect();
        for (axis, stride) in [(0, 1), (1, self.extent[0] as i64)] {
            let n = self.extent[axis] as i64;
            let blurred = |place: i64| {
                let at = place / stride % n;
                let tap = |&(step, weight): &(i64, f64)| {
                    let other = place + ((at + step).clamp(0, n - 1) - at) * stride;
                    weight * f64::from(distances[other as usize])
                };
                kernel.iter().map(tap).sum::<f64>() as f32
            };
            distances = (0..distances.len() as i64).map(blurred).collect();
        }
        distances
    }
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    fn noise(case: u32, extent: [usize; 2], percent: u32) -> Section {
        let mut stream = Stream::new(9, Purpose::Test, case, 0);
        let mut section = Section::empty(extent, [0.7, 0.9]);
        section.inside.iter_mut().for_each(|inside| *inside = stream.below(100) < percent);
        section
    }

    #[test]
    fn distances_are_those_to_the_nearest_voxel_of_the_other_kind() {
        for case in 0..30 {
            let section = noise(case, [17, 11], 5 + case * 3);
            for limit_mm in [0.8, 2.5, 40.0] {
                let found = section.exact(limit_mm);
                for (place, &inside) in section.inside.iter().enumerate() {
                    let away = |other: usize| {
                        let du = (place % 17).abs_diff(other % 17) as f64 * 0.7;
                        let dv = (place / 17).abs_diff(other / 17) as f64 * 0.9;
                        (du * du + dv * dv).sqrt()
                    };
                    let others = (0..17 * 11).filter(|&other| section.inside[other] != inside);
                    let nearest_mm = others.map(away).fold(limit_mm, f64::min);
                    let expected = if inside { nearest_mm } else { -nearest_mm };
                    assert!((f64::from(found[place]) - expected).abs() < 1e-6, "case {case} at {place}");
                }
            }
        }
    }

    /// The outline of a disc with a seventh of its edge flipped comes out nearer to the disc.
    #[test]
    fn smoothing_takes_bumps_and_pits_away() {
        let disc = |place: usize| (place % 31).abs_diff(15).pow(2) + (place / 31).abs_diff(15).pow(2) <= 130;
        let mut stream = Stream::new(3, Purpose::Test, 0, 0);
        let mut section = Section::empty([31, 31], [1.0; 2]);
        (0..31 * 31).for_each(|place| section.inside[place] = disc(place));
        let smooth = section.pits_and_walls();
        let edge: Vec<usize> =
            (0..31 * 31).filter(|&p| section.beside(p).any(|other| disc(other) != disc(p))).collect();
        edge.iter().for_each(|&place| section.inside[place] ^= stream.below(7) == 0);
        let rough = section.pits_and_walls();
        assert_eq!(
            (Wall::of(smooth[0], smooth[1]), Wall::of(rough[0], rough[1])),
            (Wall::Smooth, Wall::Rough)
        );

        let n_wrong = |inside: &dyn Fn(usize) -> bool| (0..31 * 31).filter(|&p| inside(p) != disc(p)).count();
        let before = n_wrong(&|place| section.inside[place]);
        let distances = section.smoothed(section.exact(ROUGH_LIMIT));
        let after = n_wrong(&|place| distances[place] > 0.0);
        assert!(before > 8 && after * 3 < before * 2, "{before} voxels wrong, then {after}");
    }

    #[test]
    fn a_smooth_slice_keeps_its_voxels() {
        for case in 0..20 {
            let section = noise(case, [23, 9], 50);
            let distances = section.distances(3.0);
            assert!(distances.iter().zip(&section.inside).all(|(&d, &inside)| (d > 0.0) == inside));
        }
    }
}
