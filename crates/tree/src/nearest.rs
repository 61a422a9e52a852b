//! The sphere whose surface is nearest to another sphere.
//!
//! **Input** samples; a sample to look from. **Output** the index of the sample with the least gap, and that gap in mm.
//! **Notation** the *gap* of two samples is the distance of their spheres' surfaces, 0 if they meet.
//! **Steps** 1. Halve the samples by the median along the longest side of their box, again and again, down to
//! [`LEAF`] samples; note box, largest radius and lowest index of each part. 2. From the whole down, look into the nearer half
//! first, and into none that cannot hold a better one.
//! **Guarantees** the same answer as looking at all of them: of equal gaps the lower index. No recursion.
//! **Cost** O(n log² n) to build; O(log n) a look where samples lie along curves.
//! **Source** the k-d tree of [Bentley1975].

use glam::DVec3;

use crate::graph::Sample;

/// So many samples are looked at one by one.
const LEAF: usize = 8;

/// Samples by place.
pub(crate) struct NearestSphere {
    /// (index, sample), those of a part side by side.
    samples: Vec<(usize, Sample)>,
    /// The parts; both halves of a part stand after it.
    parts: Vec<Part>,
}

/// Samples that lie near to each other.
struct Part {
    first: usize,
    end: usize,
    low: DVec3,
    high: DVec3,
    largest_mm: f64,
    lowest: usize,
    /// Its halves; none for a leaf.
    halves: Option<[usize; 2]>,
}

impl NearestSphere {
    /// Sorts samples by place.
    pub(crate) fn of(samples: impl Iterator<Item = Sample>) -> Self {
        let mut nearest = Self { samples: samples.enumerate().collect(), parts: Vec::new() };
        let mut open = Vec::new();
        if !nearest.samples.is_empty() {
            nearest.parts.push(Part::of(&nearest.samples, 0));
            open.push(0);
        }
        while let Some(part) = open.pop() {
            let (first, end) = (nearest.parts[part].first, nearest.parts[part].end);
            if end - first <= LEAF {
                continue;
            }
            let extent = nearest.parts[part].high - nearest.parts[part].low;
            let axis = (0..3).fold(0, |best, axis| if extent[axis] > extent[best] { axis } else { best });
            let middle = (end - first) / 2;
            nearest.samples[first..end].select_nth_unstable_by(middle, |a, b| {
                a.1.position_mm[axis].total_cmp(&b.1.position_mm[axis]).then(a.0.cmp(&b.0))
            });
            let halves = [nearest.parts.len(), nearest.parts.len() + 1];
            nearest.parts.push(Part::of(&nearest.samples[first..first + middle], first));
            nearest.parts.push(Part::of(&nearest.samples[first + middle..end], first + middle));
            nearest.parts[part].halves = Some(halves);
            open.extend(halves);
        }
        nearest
    }

    /// The index of the sample with the least gap from one, and the gap; only one of less than `limit_mm` counts.
    pub(crate) fn look(&self, from: Sample, limit_mm: f64) -> Option<(usize, f64)> {
        let mut best: Option<(f64, usize)> = None;
        let mut open = vec![0];
        while let Some(part) = open.pop().and_then(|part| self.parts.get(part)) {
            let bound = (part.least_gap_mm(from), part.lowest);
            if bound.0 >= limit_mm || best.is_some_and(|best| bound >= best) {
                continue;
            }
            let Some([one, other]) = part.halves else {
                for &(index, sample) in &self.samples[part.first..part.end] {
                    let found = (gap_mm(from, sample), index);
                    if found.0 < limit_mm && best.is_none_or(|best| found < best) {
                        best = Some(found);
                    }
                }
                continue;
            };
            // The nearer half is looked at first, so it is pushed last.
            let is_other_nearer = self.parts[other].least_gap_mm(from) < self.parts[one].least_gap_mm(from);
            open.extend(if is_other_nearer { [one, other] } else { [other, one] });
        }
        best.map(|(gap_mm, index)| (index, gap_mm))
    }
}

/// The distance of two spheres' surfaces, 0 if they meet.
pub(crate) fn gap_mm(from: Sample, to: Sample) -> f64 {
    (from.position_mm.distance(to.position_mm) - from.radius_mm - to.radius_mm).max(0.0)
}

impl Part {
    /// The part of samples that begin at a place among all.
    fn of(samples: &[(usize, Sample)], first: usize) -> Self {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut largest_mm, mut lowest) = (0.0_f64, usize::MAX);
        for (index, sample) in samples {
            (low, high) = (low.min(sample.position_mm), high.max(sample.position_mm));
            largest_mm = largest_mm.max(sample.radius_mm);
            lowest = lowest.min(*index);
        }
        Self { first, end: first + samples.len(), low, high, largest_mm, lowest, halves: None }
    }

    /// No sample of the part has a smaller gap. Rounded in the same order as a gap, whose terms are no smaller, so that a
    /// bound is never above it.
    fn least_gap_mm(&self, from: Sample) -> f64 {
        let nearest = from.position_mm.clamp(self.low, self.high);
        (from.position_mm.distance(nearest) - from.radius_mm - self.largest_mm).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    #[test]
    fn equals_looking_at_all() {
        let mut stream = Stream::new(9, Purpose::Test, 0, 0);
        for n in [0, 1, 2, 8, 9, 40, 700] {
            // Many at equal places, and many spheres that meet.
            let mut sample = |radius: f64| Sample {
                position_mm: DVec3::new(
                    stream.below(30).into(),
                    stream.below(9).into(),
                    stream.below(4).into(),
                ),
                radius_mm: radius * stream.unit(),
            };
            for radius in [0.0, 0.4, 3.0] {
                let samples: Vec<Sample> = (0..n).map(|_| sample(radius)).collect();
                let nearest = NearestSphere::of(samples.iter().copied());
                for limit_mm in [f64::INFINITY, 2.0, 0.0] {
                    let from = sample(1.0);
                    let all = samples.iter().enumerate().map(|(index, &to)| (gap_mm(from, to), index));
                    let least =
                        all.filter(|(gap, _)| *gap < limit_mm).reduce(|a, b| if b < a { b } else { a });
                    assert_eq!(nearest.look(from, limit_mm), least.map(|(gap, index)| (index, gap)), "{n}");
                }
            }
        }
    }
}
