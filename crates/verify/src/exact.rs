//! Exact comparisons of segments at a vertical line.
//!
//! **Input** two segments that are not vertical, a point. **Output** at which of them the point is higher.
//! **Notation** a number is a sum of doubles that do not overlap, smallest first (an expansion); its sign is that
//! of its last part.
//! **Steps** 1. In doubles, with a bound of the error. 2. Where the bound does not decide, by expansions.
//! **Guarantees** exact as long as nothing under- or overflows: coordinates from 1e-80 to 1e65 in size.
//! **Source** Shewchuk, Adaptive Precision Floating-Point Arithmetic (1997): two-sum, two-product, grow-expansion.

use std::cmp::Ordering;

use espalier_geom::plane::Segment;
use glam::DVec2;

/// Bound of the relative error of step 1: eight roundings, doubled to be safe.
const ERROR: f64 = 16.0 * f64::EPSILON;

/// Compares the heights of `p` above two segments, measured straight up; both have `a.x < b.x`.
pub(crate) fn compare_heights(p: DVec2, s: &Segment, t: &Segment) -> Ordering {
    // The height above s is orientation(s, p) / width(s); the widths are positive and change sides.
    let rough = |s: &Segment| {
        let (plus, minus) = ((s.b.x - s.a.x) * (p.y - s.a.y), (s.b.y - s.a.y) * (p.x - s.a.x));
        (plus - minus, plus.abs() + minus.abs())
    };
    let ((s_area, s_size), (t_area, t_size)) = (rough(s), rough(t));
    let (s_width, t_width) = (s.b.x - s.a.x, t.b.x - t.a.x);
    let difference = s_area * t_width - t_area * s_width;
    if difference.abs() > ERROR * (s_size * t_width + t_size * s_width) {
        return difference.total_cmp(&0.0);
    }
    let exact = |s: &Segment| {
        let plus = product(&less(s.b.x, s.a.x), &less(p.y, s.a.y));
        let minus = product(&less(s.b.y, s.a.y), &less(p.x, s.a.x));
        sum(plus, &negated(&minus))
    };
    let (above_s, above_t) =
        (product(&exact(s), &less(t.b.x, t.a.x)), product(&exact(t), &less(s.b.x, s.a.x)));
    sign(&sum(above_s, &negated(&above_t)))
}

/// a − b.
fn less(a: f64, b: f64) -> Vec<f64> {
    let (difference, rest) = two_sum(a, -b);
    vec![rest, difference]
}

fn negated(e: &[f64]) -> Vec<f64> {
    e.iter().map(|part| -part).collect()
}

fn product(e: &[f64], f: &[f64]) -> Vec<f64> {
    let mut result = Vec::new();
    for &a in e {
        for &b in f {
            let (product, rest) = two_product(a, b);
            grow(&mut result, rest);
            grow(&mut result, product);
        }
    }
    result
}

fn sum(mut e: Vec<f64>, f: &[f64]) -> Vec<f64> {
    f.iter().for_each(|&part| grow(&mut e, part));
    e
}

/// Adds one double to an expansion.
fn grow(e: &mut Vec<f64>, addend: f64) {
    let mut carry = addend;
    for part in e.iter_mut() {
        (carry, *part) = two_sum(carry, *part);
    }
    e.push(carry);
    e.retain(|&part| part != 0.0);
}

fn sign(e: &[f64]) -> Ordering {
    e.last().map_or(Ordering::Equal, |largest| largest.total_cmp(&0.0))
}

/// a + b as the rounded sum and what rounding took away.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_part = sum - a;
    let a_part = sum - b_part;
    (sum, (a - a_part) + (b - b_part))
}

/// a · b as the rounded product and what rounding took away.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    let ((a_high, a_low), (b_high, b_low)) = (split(a), split(b));
    let rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
    (product, rest)
}

/// The upper and the lower half of the digits of a double.
fn split(a: f64) -> (f64, f64) {
    /// 2²⁷ + 1.
    const SPLITTER: f64 = 134_217_729.0;
    let large = SPLITTER * a;
    let high = large - (large - a);
    (high, a - high)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(a: (f64, f64), b: (f64, f64)) -> Segment {
        Segment { a: DVec2::new(a.0, a.1), b: DVec2::new(b.0, b.1) }
    }

    #[test]
    fn the_last_bit_decides() {
        // Through (1/3, 1/3) as a double, at slopes 1 and 1/2 and one unit in the last place beside it.
        let third = 1.0 / 3.0;
        let s = segment((0.0, 0.0), (3.0, 3.0));
        let t = segment((third - 1.0, third - 0.5), (third + 1.0, third + 0.5));
        for (p, expected) in [
            (DVec2::new(third, 9.0), compare_in_integers(third, 9.0, &s, &t)),
            (DVec2::new(third.next_up(), 9.0), compare_in_integers(third.next_up(), 9.0, &s, &t)),
            (DVec2::new(third.next_down(), -9.0), compare_in_integers(third.next_down(), -9.0, &s, &t)),
        ] {
            assert_eq!(compare_heights(p, &s, &t), expected, "{p}");
            assert_eq!(compare_heights(p, &t, &s), expected.reverse(), "{p}");
        }
    }

    /// The same in integers: every number here is a multiple of 2⁻⁵⁴ below 2⁴, and the degree is three, so the
    /// comparison is one of differences of products that are taken apart by hand into (high, low) limbs.
    fn compare_in_integers(x: f64, y: f64, s: &Segment, t: &Segment) -> Ordering {
        let whole = |value: f64| (value * 18_014_398_509_481_984.0) as i128;
        let area = |s: &Segment| {
            (whole(s.b.x) - whole(s.a.x)) * (whole(y) - whole(s.a.y))
                - (whole(s.b.y) - whole(s.a.y)) * (whole(x) - whole(s.a.x))
        };
        let width = |s: &Segment| whole(s.b.x) - whole(s.a.x);
        wide_product(area(s), width(t)).cmp(&wide_product(area(t), width(s)))
    }

    /// a · b for b > 0 as (high, low) with base 2⁶⁴, ordered like the product.
    fn wide_product(a: i128, b: i128) -> (i128, i128) {
        let base = 1_i128 << 64;
        let (a_high, a_low) = (a.div_euclid(base), a.rem_euclid(base));
        // b is below 2⁶⁰, so a_low · b fits once more split.
        let (b_high, b_low) = (b >> 32, b & 0xffff_ffff);
        let (l0, l1) = (a_low & 0xffff_ffff, a_low >> 32);
        let mid = l1 * b_low + l0 * b_high + ((l0 * b_low) >> 32);
        let low = ((mid & 0xffff_ffff) << 32) | ((l0 * b_low) & 0xffff_ffff);
        (a_high * b + l1 * b_high + (mid >> 32), low)
    }

    #[test]
    fn equals_integers_on_small_grids() {
        let mut state = 1_u64;
        let mut below = |n: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % n
        };
        for _ in 0..20_000 {
            let mut point = || DVec2::new(below(9) as f64, below(9) as f64);
            let (s, t, p) = (Segment { a: point(), b: point() }, Segment { a: point(), b: point() }, point());
            if s.a.x >= s.b.x || t.a.x >= t.b.x {
                continue;
            }
            // Far from the origin, where doubles lose the digits that decide.
            let moved = |s: &Segment| Segment { a: s.a + 1e14, b: s.b + 1e14 };
            let area = |s: &Segment| (s.b.x - s.a.x) * (p.y - s.a.y) - (s.b.y - s.a.y) * (p.x - s.a.x);
            let expected = (area(&s) * (t.b.x - t.a.x)).total_cmp(&(area(&t) * (s.b.x - s.a.x)));
            let is_tie = area(&s) * (t.b.x - t.a.x) == area(&t) * (s.b.x - s.a.x);
            let expected = if is_tie { Ordering::Equal } else { expected };
            assert_eq!(compare_heights(p + 1e14, &moved(&s), &moved(&t)), expected);
        }
    }
}
