//! Boxes of edges in runs of eight, in single precision.
//!
//! **Input** intervals of coordinates. **Output** which of eight boxes meet a box, as bits.
//! **Guarantees** boxes are rounded outwards: what meets in double precision meets here.
//! **Cost** eight boxes in a few vector comparisons.

/// Edges in a run: eight single-precision borders are one or two vector registers.
pub(crate) const RUN: usize = 8;
/// Two units in the last place of single precision, by which a border is moved outwards.
const OUTWARDS: f32 = 2.4e-7;
/// Borders farther out than this are moved in to here: single precision ends at 3e38.
const FARTHEST: f64 = 1e30;
/// The hub of a run whose edges come from several nodes.
pub(crate) const MIXED: u32 = u32::MAX;

/// A box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UprightBox {
    pub(crate) x_low: f32,
    pub(crate) x_high: f32,
    pub(crate) y_low: f32,
    pub(crate) y_high: f32,
}

impl UprightBox {
    /// Without a point: it meets nothing.
    pub(crate) const EMPTY: Self = Self {
        x_low: f32::INFINITY,
        x_high: f32::NEG_INFINITY,
        y_low: f32::INFINITY,
        y_high: f32::NEG_INFINITY,
    };

    /// Around two points, grown by a margin to all sides.
    #[inline]
    pub(crate) fn around((ax, ay): (f64, f64), (bx, by): (f64, f64), margin: f64) -> Self {
        let (x_low, x_high) = grown(ax, bx, margin);
        let (y_low, y_high) = grown(ay, by, margin);
        Self { x_low, x_high, y_low, y_high }
    }

    /// Around two boxes.
    #[inline]
    pub(crate) fn joined(&self, other: &Self) -> Self {
        Self {
            x_low: self.x_low.min(other.x_low),
            x_high: self.x_high.max(other.x_high),
            y_low: self.y_low.min(other.y_low),
            y_high: self.y_high.max(other.y_high),
        }
    }

    /// Whether two boxes have a point in common.
    #[inline]
    pub(crate) fn meets(&self, other: &Self) -> bool {
        (self.x_low <= other.x_high)
            & (other.x_low <= self.x_high)
            & (self.y_low <= other.y_high)
            & (other.y_low <= self.y_high)
    }
}

/// The interval between two numbers, grown by a margin and rounded outwards.
#[inline]
fn grown(a: f64, b: f64, margin: f64) -> (f32, f32) {
    let low = (a.min(b) - margin).clamp(-FARTHEST, FARTHEST) as f32;
    let high = (a.max(b) + margin).clamp(-FARTHEST, FARTHEST) as f32;
    (low - low.abs() * OUTWARDS, high + high.abs() * OUTWARDS)
}

/// The boxes of up to eight edges; lanes without an edge meet nothing.
#[derive(Clone, Copy)]
pub(crate) struct Lanes {
    x_low: [f32; RUN],
    x_high: [f32; RUN],
    y_low: [f32; RUN],
    y_high: [f32; RUN],
}

impl Lanes {
    pub(crate) const EMPTY: Self = Self {
        x_low: [f32::INFINITY; RUN],
        x_high: [f32::NEG_INFINITY; RUN],
        y_low: [f32::INFINITY; RUN],
        y_high: [f32::NEG_INFINITY; RUN],
    };

    #[inline]
    pub(crate) fn set(&mut self, lane: usize, bounds: UprightBox) {
        self.x_low[lane] = bounds.x_low;
        self.x_high[lane] = bounds.x_high;
        self.y_low[lane] = bounds.y_low;
        self.y_high[lane] = bounds.y_high;
    }

    #[inline]
    pub(crate) fn get(&self, lane: usize) -> UprightBox {
        UprightBox {
            x_low: self.x_low[lane],
            x_high: self.x_high[lane],
            y_low: self.y_low[lane],
            y_high: self.y_high[lane],
        }
    }

    /// One bit for each lane whose box meets `bounds`.
    // Within a long loop the compiler forgets to use vectors.
    #[inline(never)]
    pub(crate) fn meeting(&self, bounds: UprightBox) -> u32 {
        // No branches and a fixed length: this becomes a few vector comparisons.
        let is_met: [u32; RUN] = std::array::from_fn(|lane| {
            u32::from(self.x_low[lane] <= bounds.x_high)
                & u32::from(bounds.x_low <= self.x_high[lane])
                & u32::from(self.y_low[lane] <= bounds.y_high)
                & u32::from(bounds.y_low <= self.y_high[lane])
        });
        is_met.iter().enumerate().fold(0, |bits, (lane, met)| bits | met << lane)
    }
}

/// Whether two runs are of edges from one node.
#[inline]
pub(crate) fn is_same_fan(hub: u32, other: u32) -> bool {
    hub != MIXED && hub == other
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::stream;

    #[test]
    fn what_meets_in_double_precision_meets_here() {
        let mut stream = stream(5700);
        let mut n_met = 0;
        for round in 0..20_000 {
            // Far from the origin single precision is coarse; some are out of its range.
            let far = [0.0, 1e3, 1e7, 1e300][round % 4];
            let mut point = || (far + stream.normal(), far - stream.normal());
            let (a, b, c, d) = (point(), point(), point(), point());
            let (first, second) = (UprightBox::around(a, b, 0.1), UprightBox::around(c, d, 0.2));
            let meets = |a: f64, b: f64, c: f64, d: f64| {
                a.min(b) - 0.1 <= c.max(d) + 0.2 && c.min(d) - 0.2 <= a.max(b) + 0.1
            };
            let mut lanes = Lanes::EMPTY;
            lanes.set(round % RUN, second);
            assert!(first.joined(&second).meets(&second));
            assert_eq!(lanes.meeting(first), u32::from(first.meets(&second)) << (round % RUN));
            if meets(a.0, b.0, c.0, d.0) && meets(a.1, b.1, c.1, d.1) {
                n_met += 1;
                assert!(first.meets(&second), "round {round}");
            }
        }
        assert!(n_met > 5000, "{n_met}");
    }
}
