//! Matching and alignment, in turn.
//!
//! **Input** the limbs of both trees. **Output** the alignment and the matching.
//! **Steps** 1. A few ways to begin: as it is; first forks on each other with the axis from there to the rest of the tree,
//! at [`N_TWISTS`] twists about it; and what matches by lengths along the tree and distances from the root, which no
//! rotation changes. Each is improved for [`N_COARSE_ROUNDS`] rounds on the [`N_COARSE`] largest limbs. 2. The cheapest
//! goes on with all limbs, until a round matches as the one before; so does the first, and the cheaper one is kept. 3. A round fits the motion to the forks that match,
//! moves what hangs from a fork along with it, and matches anew: so that an organ that bends or breathes is compared
//! fork by fork.
//! **Guarantees** of equal costs the first way to begin wins, so trees in one frame stay in it.
//! **Cost** O(rounds · pairs).

use std::f64::consts::TAU;

use espalier_geom::math;
use espalier_geom::space::plane_axes;
use espalier_model::Alignment;
use glam::{DMat3, DVec3};

use crate::frame;
use crate::limbs::Limbs;
use crate::matching::{Chain, Matching, Unlike, match_limbs};
use crate::params::{Align, Params};

/// Twists about the axis that are tried: the matching bears half a step of 15°.
const N_TWISTS: usize = 24;
/// Limbs that the ways to begin are tried on: three or four generations of an airway.
const N_COARSE: usize = 64;
const N_COARSE_ROUNDS: usize = 3;
/// Rounds with all limbs; three were enough in all trees tried.
const MOST_ROUNDS: usize = 8;
/// A way to begin must be cheaper by this share of both lengths to be preferred.
const LEAST_GAIN: f64 = 1e-6;
/// What a distance between ends costs, against the same length without a partner: over 1, or a tip that lost its last
/// branch would be told as one that became shorter.
const END_WEIGHT: f64 = 1.25;

/// Aligns and matches two trees.
pub(crate) fn align_and_match(limbs: [&Limbs; 2], params: &Params) -> (Alignment, Matching) {
    let mut best = settle(limbs, params, Alignment::IDENTITY);
    let start = beginning(limbs, params);
    if start != Alignment::IDENTITY {
        let other = settle(limbs, params, start);
        if other.1.cost_mm < best.1.cost_mm - LEAST_GAIN * (limbs[0].length_mm() + limbs[1].length_mm()) {
            best = other;
        }
    }
    // The motion that the matching itself asks for.
    let alignment = frame::fit(&places(limbs, &best.1.chains), params.align, &best.0);
    (alignment, best.1)
}

/// Rounds with all limbs until one matches as the one before.
fn settle(limbs: [&Limbs; 2], params: &Params, start: Alignment) -> (Alignment, Matching) {
    let mut state = State::new(limbs, params, start);
    let mut best = state.round();
    for _ in 1..MOST_ROUNDS {
        let next = state.round();
        let is_settled = next.1.chains == best.1.chains;
        if is_settled || next.1.cost_mm <= best.1.cost_mm {
            best = next;
        }
        if is_settled {
            break;
        }
    }
    best
}

/// The motion to begin with.
fn beginning([base, follow]: [&Limbs; 2], params: &Params) -> Alignment {
    let identity = Alignment::IDENTITY;
    if params.align == Align::AsIs || base.len() == 0 || follow.len() == 0 {
        return identity;
    }
    // One threshold for both, or what one has more of would look lost.
    let threshold_mm = base.threshold_mm(N_COARSE).max(follow.threshold_mm(N_COARSE));
    let (base, follow) = (base.larger_than(threshold_mm), follow.larger_than(threshold_mm));
    if base.len() == 0 || follow.len() == 0 {
        return identity;
    }
    let limbs = [&base, &follow];
    let mut ways = vec![identity];
    let by_length = match_limbs(limbs, &ByLength::new(limbs, params));
    ways.push(frame::fit(&places(limbs, &by_length.chains), params.align, &identity));
    ways.extend(twists(limbs));
    let least_gain = LEAST_GAIN * (base.length_mm() + follow.length_mm());
    let mut best = (f64::INFINITY, identity);
    for way in ways {
        let mut state = State::new(limbs, params, way);
        for _ in 0..N_COARSE_ROUNDS {
            let (alignment, matching) = state.round();
            if matching.cost_mm < best.0 - least_gain {
                best = (matching.cost_mm, alignment);
            }
        }
    }
    best.1
}

/// First forks on each other, and the axes from there to the middle of what lies behind.
fn twists([base, follow]: [&Limbs; 2]) -> Vec<Alignment> {
    let ((to, to_axis), (from, from_axis)) = (axis(base), axis(follow));
    let frame_of = |axis: DVec3| {
        let (right, up) = plane_axes(axis, if axis.z.abs() < 0.9 { DVec3::Z } else { DVec3::Y });
        DMat3::from_cols(right, up, axis)
    };
    let (to_frame, from_frame) = (frame_of(to_axis), frame_of(from_axis));
    let twist = |step: usize| {
        let (sine, cosine) = math::sin_cos(TAU * step as f64 / N_TWISTS as f64);
        let about = DMat3::from_cols(DVec3::new(cosine, sine, 0.0), DVec3::new(-sine, cosine, 0.0), DVec3::Z);
        let rotation = to_frame * about * from_frame.transpose();
        Alignment { rotation, translation_mm: to - rotation * from, ..Alignment::IDENTITY }
    };
    (0..N_TWISTS).map(twist).collect()
}

/// The first fork and the direction to the middle of the length behind it.
fn axis(limbs: &Limbs) -> (DVec3, DVec3) {
    let first = match limbs.roots[..] {
        [only] => limbs.lines[only].end_mm(),
        _ => limbs.lines[0].start_mm(),
    };
    let (mut moment, mut total) = (DVec3::ZERO, 0.0);
    for line in &limbs.lines {
        for (points, arcs) in line.points_mm.windows(2).zip(line.arcs_mm.windows(2)) {
            let length = arcs[1] - arcs[0];
            moment += length * (0.5 * (points[0] + points[1]) - first);
            total += length;
        }
    }
    (first, (moment / total).try_normalize().unwrap_or(DVec3::Z))
}

/// Rounds under way.
struct State<'a> {
    limbs: [&'a Limbs; 2],
    params: &'a Params,
    alignment: Alignment,
    /// By limb of the follow-up: by how much the fork that it hangs from is off, in mm of the baseline.
    shift_mm: Vec<DVec3>,
}

impl<'a> State<'a> {
    fn new(limbs: [&'a Limbs; 2], params: &'a Params, alignment: Alignment) -> Self {
        Self { limbs, params, alignment, shift_mm: vec![DVec3::ZERO; limbs[1].len()] }
    }

    /// Matches, and fits the motion to what matches; gives the motion that was matched with.
    fn round(&mut self) -> (Alignment, Matching) {
        let used = self.alignment;
        let matching = match_limbs(self.limbs, &InPlace::new(self));
        let places = places(self.limbs, &matching.chains);
        self.alignment = frame::fit(&places, self.params.align, &used);
        self.shift_mm = self.shifts(&matching.chains);
        (used, matching)
    }

    /// A limb moves with the nearest fork before it that matches.
    fn shifts(&self, chains: &[Chain]) -> Vec<DVec3> {
        let [base, follow] = self.limbs;
        let mut at_end: Vec<Option<DVec3>> = vec![None; follow.len()];
        for chain in chains {
            if let (Some(&c), Some(&d)) = (chain.baseline.last(), chain.followup.last()) {
                at_end[d] = Some(base.lines[c].end_mm() - self.alignment.apply(follow.lines[d].end_mm()));
            }
        }
        let mut shift_mm = vec![DVec3::ZERO; follow.len()];
        for limb in 0..follow.len() {
            if let Some(parent) = follow.parent[limb] {
                shift_mm[limb] = at_end[parent].unwrap_or(shift_mm[parent]);
            }
        }
        shift_mm
    }
}

/// The places to fit a motion to: matched forks; tips and roots too where they are fewer than three, and points on the way
/// where those are few.
pub(crate) fn places([base, follow]: [&Limbs; 2], chains: &[Chain]) -> Vec<(DVec3, DVec3)> {
    let ends = || chains.iter().filter_map(|chain| Some((*chain.baseline.last()?, *chain.followup.last()?)));
    let point = |(c, d): (usize, usize)| (base.lines[c].end_mm(), follow.lines[d].end_mm());
    let is_fork = |&(c, d): &(usize, usize)| !base.children[c].is_empty() && !follow.children[d].is_empty();
    let mut places: Vec<(DVec3, DVec3)> = ends().filter(is_fork).map(point).collect();
    if base.roots.len() > 1 && follow.roots.len() > 1 {
        places.push((base.lines[0].start_mm(), follow.lines[0].start_mm()));
    }
    if places.len() < 3 {
        places = ends().map(point).collect();
        if base.len() > 0 && follow.len() > 0 {
            places.push((base.lines[0].start_mm(), follow.lines[0].start_mm()));
        }
    }
    if places.len() < 4 {
        places.extend(ends().flat_map(|(c, d)| {
            let at = |line: &crate::line::Line, share: f64| line.point_mm(share * line.length_mm());
            [0.25, 0.5, 0.75].map(|share| (at(&base.lines[c], share), at(&follow.lines[d], share)))
        }));
    }
    places
}

/// What a difference of radius costs, in mm: weight · octaves · length, at most half the length.
fn by_radius([base, follow]: [&Limbs; 2], weight: f64, (c, d): (usize, usize)) -> f64 {
    let length = base.lines[c].length_mm().min(follow.lines[d].length_mm());
    let (a, b) = (base.radius_mm[c], follow.radius_mm[d]);
    if a > 0.0 && b > 0.0 { length * (weight * math::log2(a / b).abs()).min(0.5) } else { 0.0 }
}

/// Limbs that are unlike because they lie in different places.
struct InPlace<'a> {
    limbs: [&'a Limbs; 2],
    weight: f64,
    /// By limb: its end, in the frame of the baseline.
    ends_mm: [Vec<DVec3>; 2],
    alignment: Alignment,
}

impl<'a> InPlace<'a> {
    fn new(state: &State<'a>) -> Self {
        let [base, follow] = state.limbs;
        let of_base = base.lines.iter().map(|line| line.end_mm()).collect();
        let of_follow = follow
            .lines
            .iter()
            .zip(&state.shift_mm)
            .map(|(line, &shift)| state.alignment.apply(line.end_mm()) + shift)
            .collect();
        let weight = state.params.radius_weight;
        Self { limbs: state.limbs, weight, ends_mm: [of_base, of_follow], alignment: state.alignment }
    }
}

impl Unlike for InPlace<'_> {
    /// How far apart they are when the shorter one ends, had they set out from one point.
    fn at_start(&self, c: usize, d: usize) -> f64 {
        let (base, follow) = (&self.limbs[0].lines[c], &self.limbs[1].lines[d]);
        let scale = self.alignment.scale;
        let reach = base.length_mm().min(scale * follow.length_mm());
        let along_base = base.point_mm(reach) - base.start_mm();
        let along_follow = self.alignment.turn(follow.point_mm(reach / scale) - follow.start_mm());
        along_base.distance(along_follow) + by_radius(self.limbs, self.weight, (c, d))
    }

    fn at_end(&self, c: usize, d: usize) -> f64 {
        END_WEIGHT * self.ends_mm[0][c].distance(self.ends_mm[1][d])
    }
}

/// Limbs that are unlike because their ends are not as far from the root, along the tree or straight.
struct ByLength<'a> {
    limbs: [&'a Limbs; 2],
    weight: f64,
    /// By limb: the distances of its end.
    along_mm: [Vec<f64>; 2],
    straight_mm: [Vec<f64>; 2],
}

impl<'a> ByLength<'a> {
    fn new(limbs: [&'a Limbs; 2], params: &Params) -> Self {
        let along = |limbs: &Limbs| {
            let mut along_mm = vec![0.0; limbs.len()];
            for limb in 0..limbs.len() {
                along_mm[limb] =
                    limbs.lines[limb].length_mm() + limbs.parent[limb].map_or(0.0, |parent| along_mm[parent]);
            }
            along_mm
        };
        let straight = |limbs: &Limbs| {
            let root = limbs.lines.first().map(|line| line.start_mm()).unwrap_or_default();
            limbs.lines.iter().map(|line| line.end_mm().distance(root)).collect()
        };
        Self {
            limbs,
            weight: params.radius_weight,
            along_mm: limbs.map(along),
            straight_mm: limbs.map(straight),
        }
    }
}

impl Unlike for ByLength<'_> {
    fn at_start(&self, c: usize, d: usize) -> f64 {
        by_radius(self.limbs, self.weight, (c, d))
    }

    fn at_end(&self, c: usize, d: usize) -> f64 {
        let apart = |values: &[Vec<f64>; 2]| (values[0][c] - values[1][d]).abs();
        apart(&self.along_mm) + apart(&self.straight_mm)
    }
}
