//! Sines and cosines of many angles at once, for the swarm.
//!
//! **Input** angles in radians, below 10⁶ in size. **Output** their sines and cosines, off by less than 3e-16.
//! **Steps** 1. k = the nearest whole number of quarter turns, r the rest, π/2 in three parts. 2. Polynomials for
//! sin r and cos r on [−π/4, π/4]. 3. Swap and sign by k.
//! **Guarantees** the same bits on every machine: additions and multiplications only, which IEEE 754 rounds alike, and
//! no branches, so that the loop becomes vector instructions.
//! **Source** coefficients and parts of π/2: FreeBSD msun `k_sin.c`, `k_cos.c`, `e_rem_pio2.c`, as in `libm`.
//! **Differs from the source** without its case for large angles and its branches. The paper's swarm takes a
//! tenth less time with it.

const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];
/// π/2 in three parts: the first two have 33 bits each, so that their products with k are exact.
const QUARTER: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
/// 1.5 · 2⁵²: what is added to it is rounded to a whole number, which stands in the last bits.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Sine and cosine of each angle.
pub(crate) fn sin_cos(angle_rad: &[f64], sin: &mut [f64], cos: &mut [f64]) {
    for ((&angle_rad, sin), cos) in angle_rad.iter().zip(sin).zip(cos) {
        let shifted = angle_rad * std::f64::consts::FRAC_2_PI + WHOLE;
        let (k, bits) = (shifted - WHOLE, shifted.to_bits());
        let r = ((angle_rad - k * QUARTER[0]) - k * QUARTER[1]) - k * QUARTER[2];
        let z = r * r;
        let s = r + r * z * (SIN[0] + z * (SIN[1] + z * (SIN[2] + z * (SIN[3] + z * (SIN[4] + z * SIN[5])))));
        let c = (1.0 - 0.5 * z)
            + z * z * (COS[0] + z * (COS[1] + z * (COS[2] + z * (COS[3] + z * (COS[4] + z * COS[5])))));
        let is_odd = bits & 1 == 1;
        let (swapped_sin, swapped_cos) = if is_odd { (c, s) } else { (s, c) };
        // Sines change sign after half a turn, cosines a quarter before.
        *sin = f64::from_bits(swapped_sin.to_bits() ^ ((bits & 2) << 62));
        *cos = f64::from_bits(swapped_cos.to_bits() ^ ((bits.wrapping_add(1) & 2) << 62));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::stream;
    use espalier_geom::math;

    #[test]
    fn as_libm_to_the_last_bits() {
        let mut stream = stream(6000);
        for scale in [1e-9, 0.1, 1.0, 3.0, 30.0, 1e3, 1e6] {
            let angles: Vec<f64> = (0..20_000).map(|_| stream.uniform(-scale, scale)).collect();
            let (mut sin, mut cos) = (vec![0.0; angles.len()], vec![0.0; angles.len()]);
            sin_cos(&angles, &mut sin, &mut cos);
            for (idx, &angle) in angles.iter().enumerate() {
                let (expected_sin, expected_cos) = math::sin_cos(angle);
                let off = (sin[idx] - expected_sin).abs().max((cos[idx] - expected_cos).abs());
                assert!(off < 3e-16, "{angle}: {off:e}");
            }
        }
    }

    #[test]
    fn quarters_of_a_turn() {
        let angles: Vec<f64> = (-8..=8).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_2).collect();
        let (mut sin, mut cos) = (vec![0.0; angles.len()], vec![0.0; angles.len()]);
        sin_cos(&angles, &mut sin, &mut cos);
        for (idx, k) in (-8..=8_i32).enumerate() {
            let expected = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][k.rem_euclid(4) as usize];
            assert!((sin[idx] - expected.0).abs() < 2e-15 && (cos[idx] - expected.1).abs() < 2e-15, "{k}");
        }
        assert_eq!((sin[8], cos[8]), (0.0, 1.0));
    }
}
