//! Pairs of boxes that meet.
//!
//! **Input** boxes of edges. **Output** a visit to each pair of boxes that have a point in common, each once, but for
//! edges from one node: their boxes always do.
//! **Notation** along is the axis on which the whole is longer.
//! **Steps** 1. Cut the whole into strips along that axis, twice as wide as the mean box. 2. Enter each box in every
//! strip that it reaches. 3. Sweep each strip from end to end. Of the strips that two boxes share the last to begin
//! for both counts.
//! **Guarantees** the order of the visits depends on the boxes only.
//! Why strips? A sweep over the whole alone looks at every pair that meets along one axis: a twentieth of all 2 billion
//! pairs of a complete binary tree of depth 16.
//! **Cost** O(N log N + pairs within a strip whose extents along it meet), at most half as many entries again as boxes.
//! A star is one strip, and all its pairs are passed over, in a nanosecond each.

use std::ops::Range;

use glam::DVec2;

/// How wide a strip is, in mean extents of a box.
const STRIP_WIDTH: f64 = 2.0;

/// A box around an edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeBox {
    pub(crate) low: DVec2,
    pub(crate) high: DVec2,
    /// The lower node of the edge.
    pub(crate) node: u32,
    /// Its upper node.
    pub(crate) parent: u32,
}

impl EdgeBox {
    /// Of an edge between two points, grown by a margin to all sides.
    pub(crate) fn around((a, b): (DVec2, DVec2), margin: f64, (node, parent): (usize, usize)) -> Self {
        Self { low: a.min(b) - margin, high: a.max(b) + margin, node: node as u32, parent: parent as u32 }
    }

    /// With x and y changed.
    fn turned(self) -> Self {
        Self { low: DVec2::new(self.low.y, self.low.x), high: DVec2::new(self.high.y, self.high.x), ..self }
    }
}

/// Visits the pairs of boxes that meet, by node, until `visit` says no; whether it never did.
pub(crate) fn each_meeting(mut boxes: Vec<EdgeBox>, mut visit: impl FnMut(usize, usize) -> bool) -> bool {
    let low = boxes.iter().fold(DVec2::INFINITY, |low, b| low.min(b.low));
    let high = boxes.iter().fold(DVec2::NEG_INFINITY, |high, b| high.max(b.high));
    if (high - low).y > (high - low).x {
        boxes.iter_mut().for_each(|b| *b = b.turned());
    }
    boxes.sort_unstable_by(|a, b| a.low.x.total_cmp(&b.low.x).then(a.node.cmp(&b.node)));
    let strips = Strips::new(&boxes);
    let (starts, entries) = strips.enter(&boxes);
    let mut members: Vec<EdgeBox> = Vec::new();
    for strip in 0..strips.count {
        members.clear();
        members.extend(entries[starts[strip]..starts[strip + 1]].iter().map(|&idx| boxes[idx as usize]));
        for (idx, a) in members.iter().enumerate() {
            for b in members[idx + 1..].iter().take_while(|b| b.low.x <= a.high.x) {
                if a.parent != b.parent
                    && a.low.y <= b.high.y
                    && b.low.y <= a.high.y
                    && strips.of(a.low.y.max(b.low.y)) == strip
                    && !visit(a.node.min(b.node) as usize, a.node.max(b.node) as usize)
                {
                    return false;
                }
            }
        }
    }
    true
}

/// Strips of equal width.
struct Strips {
    low: f64,
    per_width: f64,
    count: usize,
}

impl Strips {
    fn new(boxes: &[EdgeBox]) -> Self {
        let low = boxes.iter().map(|b| b.low.y).fold(f64::INFINITY, f64::min);
        let high = boxes.iter().map(|b| b.high.y).fold(f64::NEG_INFINITY, f64::max);
        let mean = boxes.iter().map(|b| b.high.y - b.low.y).sum::<f64>() / boxes.len().max(1) as f64;
        let count = ((high - low) / (STRIP_WIDTH * mean)).min(boxes.len() as f64);
        // What is no number, as of boxes without extent, is one strip.
        let count = if count >= 1.0 { count as usize } else { 1 };
        let per_width = if count > 1 { count as f64 / (high - low) } else { 0.0 };
        Self { low, per_width, count }
    }

    /// The strip of a height.
    fn of(&self, height: f64) -> usize {
        (((height - self.low) * self.per_width) as usize).min(self.count - 1)
    }

    fn reached(&self, b: &EdgeBox) -> Range<usize> {
        self.of(b.low.y)..self.of(b.high.y) + 1
    }

    /// The boxes of each strip, in their order: where each begins, and all of them.
    fn enter(&self, boxes: &[EdgeBox]) -> (Vec<usize>, Vec<u32>) {
        let mut starts = vec![0; self.count + 1];
        for strip in boxes.iter().flat_map(|b| self.reached(b)) {
            starts[strip + 1] += 1;
        }
        for strip in 0..self.count {
            starts[strip + 1] += starts[strip];
        }
        let (mut next, mut entries) = (starts.clone(), vec![0; starts[self.count]]);
        for (idx, b) in boxes.iter().enumerate() {
            for strip in self.reached(b) {
                entries[next[strip]] = idx as u32;
                next[strip] += 1;
            }
        }
        (starts, entries)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::stream;

    #[test]
    fn every_pair_that_meets_is_visited_once() {
        let mut stream = stream(6100);
        for round in 0..200 {
            let n_boxes = round % 60;
            let (wide, flat) = (if round % 3 == 0 { 30.0 } else { 3.0 }, round % 7 == 0);
            let mut boxes = Vec::new();
            for node in 0..n_boxes {
                let a = DVec2::new(stream.normal() * wide, if flat { 0.0 } else { stream.normal() * 9.0 });
                // Some touch: whole numbers.
                let a = if round % 2 == 0 { a.round() } else { a };
                let size = DVec2::new(stream.unit() * 4.0, if flat { 0.0 } else { stream.unit() * 2.0 });
                let size = if round % 2 == 0 { size.round() } else { size };
                boxes.push(EdgeBox::around((a, a + size), 0.0, (node, stream.below(40) as usize)));
            }
            let meet = |a: &EdgeBox, b: &EdgeBox| {
                a.parent != b.parent && a.low.cmple(b.high).all() && b.low.cmple(a.high).all()
            };
            let mut expected: Vec<(usize, usize)> = Vec::new();
            for (a, first) in boxes.iter().enumerate() {
                expected.extend((a + 1..n_boxes).filter(|&b| meet(first, &boxes[b])).map(|b| (a, b)));
            }
            let mut found = Vec::new();
            assert!(each_meeting(boxes, |a, b| {
                found.push((a, b));
                true
            }));
            found.sort_unstable();
            assert_eq!(found, expected, "round {round}");
        }
    }

    #[test]
    fn a_visit_ends_when_it_is_told_to() {
        let same = |node: usize| EdgeBox::around((DVec2::ZERO, DVec2::ONE), 0.0, (node, 100 + node));
        let mut n_visits = 0;
        assert!(!each_meeting((0..9).map(same).collect(), |_, _| {
            n_visits += 1;
            n_visits < 5
        }));
        assert_eq!(n_visits, 5);
    }
}
