//! Lengths that a reader can take in: the fitting unit, round numbers, few digits.
//!
//! **Input** lengths in mm. **Output** numbers on a 1-2-5 ladder and their text.
//! **Guarantees** texts hold a point as decimal sign in every locale, and no exponent.

use espalier_geom::math;

use crate::params::Unit;

/// A unit of length with its sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LengthUnit {
    /// How it is written.
    pub sign: &'static str,
    /// How many mm it has.
    pub mm: f64,
}

const METRE: LengthUnit = LengthUnit { sign: "m", mm: 1e3 };
const CENTIMETRE: LengthUnit = LengthUnit { sign: "cm", mm: 10.0 };
const MILLIMETRE: LengthUnit = LengthUnit { sign: "mm", mm: 1.0 };
const MICROMETRE: LengthUnit = LengthUnit { sign: "µm", mm: 1e-3 };
const NANOMETRE: LengthUnit = LengthUnit { sign: "nm", mm: 1e-6 };

impl LengthUnit {
    /// The unit asked for; if automatic, the one in which `typical_mm` reads best.
    pub(crate) fn choose(unit: Unit, typical_mm: f64) -> Self {
        match unit {
            Unit::M => METRE,
            Unit::Cm => CENTIMETRE,
            Unit::Mm => MILLIMETRE,
            Unit::Um => MICROMETRE,
            Unit::Nm => NANOMETRE,
            // Clinicians say 0.4 mm, anatomists of neurons 40 µm: change below a tenth.
            Unit::Auto if typical_mm >= 1e3 => METRE,
            Unit::Auto if typical_mm >= 0.1 || typical_mm == 0.0 => MILLIMETRE,
            Unit::Auto if typical_mm >= 1e-4 => MICROMETRE,
            Unit::Auto => NANOMETRE,
        }
    }
}

/// The largest 1, 2 or 5 times a power of ten that is at most `value`; 1 for a value that is not over 0.
pub(crate) fn round_down(value: f64) -> f64 {
    if value <= 0.0 || !value.is_finite() {
        return 1.0;
    }
    let power = math::pow(10.0, math::floor(math::log10(value)));
    // The logarithm may be a hair off at powers of ten, so the ladder starts one step below.
    [10.0, 5.0, 2.0, 1.0, 0.5]
        .into_iter()
        .map(|step| step * power)
        .find(|&candidate| candidate <= value * (1.0 + 1e-9))
        .unwrap_or(power)
}

/// All 1, 2, 5 × 10ⁿ in [low, high], ascending; `low` must be over 0.
pub(crate) fn ladder(low: f64, high: f64) -> Vec<f64> {
    let first = math::floor(math::log10(low)) as i32;
    let last = math::ceil(math::log10(high)) as i32;
    (first..=last)
        .flat_map(|exponent| [1.0, 2.0, 5.0].map(|step| step * math::pow(10.0, f64::from(exponent))))
        .filter(|&value| value >= low * (1.0 - 1e-9) && value <= high * (1.0 + 1e-9))
        .collect()
}

/// Multiples of a round step in [low, high], about `n_wanted` of them, ascending.
pub(crate) fn multiples(low: f64, high: f64, n_wanted: usize) -> Vec<f64> {
    if high <= low {
        return vec![low];
    }
    let step = round_down((high - low) / n_wanted.max(1) as f64);
    let first = math::ceil(low / step - 1e-9) as i64;
    let last = math::floor(high / step + 1e-9) as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// A number in at most `digits` significant digits, without trailing zeros and without an exponent.
pub(crate) fn text(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return "0".to_owned();
    }
    let exponent = math::floor(math::log10(value.abs()) + 1e-9) as i32;
    let n_decimals = (digits - 1 - exponent).clamp(0, 12) as usize;
    let fixed = format!("{value:.n_decimals$}");
    if fixed.contains('.') { fixed.trim_end_matches('0').trim_end_matches('.').to_owned() } else { fixed }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers() {
        for (value, expected) in
            [(1.0, 1.0), (0.999, 0.5), (19.9, 10.0), (20.0, 20.0), (1000.0, 1000.0), (7e-6, 5e-6), (0.0, 1.0)]
        {
            assert!((round_down(value) / expected - 1.0).abs() < 1e-9, "{value} gives {}", round_down(value));
        }
        let close = |a: &[f64], b: &[f64]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-9 * b.abs())
        };
        assert!(close(&ladder(0.7, 12.0), &[1.0, 2.0, 5.0, 10.0]));
        assert!(close(&multiples(0.0, 9.0, 4), &[0.0, 2.0, 4.0, 6.0, 8.0]));
        assert_eq!(multiples(3.0, 3.0, 4), [3.0]);
    }

    #[test]
    fn texts() {
        for (value, expected) in [
            (1.0, "1"),
            (0.1 + 0.2, "0.3"),
            (1234.6, "1235"),
            (0.000_123_4, "0.000123"),
            (9.999, "10"),
            (-2.5, "-2.5"),
            (0.0, "0"),
        ] {
            assert_eq!(text(value, 3), expected);
        }
    }

    #[test]
    fn units() {
        for (typical_mm, sign) in [(5e3, "m"), (30.0, "mm"), (0.2, "mm"), (0.05, "µm"), (2e-5, "nm")] {
            assert_eq!(LengthUnit::choose(Unit::Auto, typical_mm).sign, sign);
        }
        assert_eq!(LengthUnit::choose(Unit::Cm, 5e3).sign, "cm");
    }
}
