//! Numbers that a reader can take in: the fitting unit of length, few digits, round steps.

use espalier_geom::math;
use espalier_model::Tree;

/// A unit of length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Unit {
    /// How it is written.
    pub(crate) sign: &'static str,
    /// How many mm it has.
    pub(crate) mm: f64,
}

impl Unit {
    /// The unit in which lengths about `typical_mm` read best: clinicians say 0.4 mm, anatomists of neurons 40 µm.
    pub(crate) fn fit(typical_mm: f64) -> Self {
        match typical_mm {
            mm if mm >= 1e3 => Self { sign: "m", mm: 1e3 },
            mm if mm >= 0.1 || mm <= 0.0 => Self { sign: "mm", mm: 1.0 },
            mm if mm >= 1e-4 => Self { sign: "µm", mm: 1e-3 },
            _ => Self { sign: "nm", mm: 1e-6 },
        }
    }

    /// The unit for all lengths and radii of a tree's branches, so that they can be compared at sight.
    pub(crate) fn of(tree: &Tree) -> Self {
        let radius_mm = tree.mean_radius_mm();
        Self::fit(if radius_mm > 0.0 { radius_mm } else { tree.extent_mm() })
    }

    /// A length with its unit.
    pub(crate) fn text(self, length_mm: f64, digits: i32) -> String {
        format!("{} {}", number(length_mm / self.mm, digits), self.sign)
    }
}

/// A number in at most `digits` significant digits, without trailing zeros and without an exponent; a dash for none.
pub(crate) fn number(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = math::floor(math::log10(value.abs()) + 1e-9) as i32;
    let n_decimals = (digits - 1 - exponent).clamp(0, 12) as usize;
    let fixed = format!("{value:.n_decimals$}");
    if fixed.contains('.') { fixed.trim_end_matches('0').trim_end_matches('.').to_owned() } else { fixed }
}

/// `1 branch`, `2 branches`.
pub(crate) fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{} {}", grouped(n), if n == 1 { one } else { many })
}

/// A whole number with thin spaces between thousands.
pub(crate) fn grouped(n: usize) -> String {
    let digits = n.to_string();
    if digits.len() <= 4 {
        return digits;
    }
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{2009}');
        }
        out.push(digit);
    }
    out
}

/// Round steps over [low, high], about `n_wanted` of them, ascending.
pub(crate) fn steps(low: f64, high: f64, n_wanted: usize) -> Vec<f64> {
    if high <= low || !(high - low).is_finite() {
        return vec![low];
    }
    let rough = (high - low) / n_wanted.max(1) as f64;
    let power = math::pow(10.0, math::floor(math::log10(rough)));
    let step = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power).into_iter().find(|&s| s >= rough * 0.999);
    let step = step.unwrap_or(10.0 * power);
    let first = math::ceil(low / step - 1e-9) as i64;
    let last = math::floor(high / step + 1e-9) as i64;
    (first..=last).take(100).map(|i| i as f64 * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_units() {
        assert_eq!(number(1234.6, 3), "1235");
        assert_eq!(number(0.1 + 0.2, 3), "0.3");
        assert_eq!(number(f64::NAN, 3), "–");
        assert_eq!(grouped(1_234_567), "1\u{2009}234\u{2009}567");
        assert_eq!(Unit::fit(0.04).text(0.04, 3), "40 µm");
        let close = steps(0.0, 9.0, 4).iter().zip([0.0, 5.0]).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(close, "{:?}", steps(0.0, 9.0, 4));
        assert_eq!(steps(3.0, 3.0, 4), [3.0]);
        assert!(steps(0.0, f64::INFINITY, 4).len() == 1);
    }
}
