//! A disc of radius r and value 1, blurred by a Gaussian of standard deviation σ.
//!
//! **Input** the distance ρ from its middle, r and σ in one unit. **Output** the value there.
//! **Notation** u = (ρ − r) / σ, κ = σ / r.
//! **Steps** 1. Once: the integral of the Gaussian over chords, ∫ φ(x − ρ) erf(√(r² − x²) / √2) dx in units of σ, for a table
//! over u and κ. 2. Linear between the four entries around.
//! **Guarantees** good to 0.002 for κ up to [`MOST_KAPPA`]; narrower discs are taken for that wide, and |u| beyond
//! [`MOST_U`] for that.
//! **Cost** a few milliseconds for the table.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use espalier_geom::math::{erf, erfc, exp};

const N_U: usize = 81;
const MOST_U: f64 = 5.0;
const N_KAPPA: usize = 25;
const MOST_KAPPA: f64 = 1.5;
/// Steps of the integral, and the share of the Gaussian that it goes over, in σ on each side.
const N_STEPS: usize = 80;
const REACH: f64 = 6.0;

/// The table.
pub(super) struct Disc {
    values: Vec<f64>,
}

impl Disc {
    pub(super) fn new() -> Self {
        let place = |i: usize, n: usize| i as f64 / (n - 1) as f64;
        let kappas = (0..N_KAPPA).map(|k| MOST_KAPPA * place(k, N_KAPPA));
        let us = |kappa: f64| (0..N_U).map(move |u| exact(MOST_U * (2.0 * place(u, N_U) - 1.0), kappa));
        Self { values: kappas.flat_map(us).collect() }
    }

    /// The value at a distance from the middle of a disc of radius `r`.
    pub(super) fn at(&self, rho: f64, r: f64, sigma: f64) -> f64 {
        let kappa = (sigma / r).min(MOST_KAPPA) / MOST_KAPPA * (N_KAPPA - 1) as f64;
        let u = (((rho - r) / sigma).clamp(-MOST_U, MOST_U) / MOST_U + 1.0) * 0.5 * (N_U - 1) as f64;
        let (k, i) = ((kappa as usize).min(N_KAPPA - 2), (u as usize).min(N_U - 2));
        let (kappa, u) = (kappa - k as f64, u - i as f64);
        let of_row = |k: usize| (1.0 - u) * self.values[k * N_U + i] + u * self.values[k * N_U + i + 1];
        (1.0 - kappa) * of_row(k) + kappa * of_row(k + 1)
    }
}

/// The value at u for κ, in units of σ.
fn exact(u: f64, kappa: f64) -> f64 {
    if kappa <= 0.0 {
        return 0.5 * erfc(u * FRAC_1_SQRT_2);
    }
    let r = 1.0 / kappa;
    let rho = r + u;
    let (low, high) = ((rho - REACH).max(-r), (rho + REACH).min(r));
    let step = (high - low) / N_STEPS as f64;
    let chord = |i: usize| {
        let x = low + (i as f64 + 0.5) * step;
        exp(-0.5 * (x - rho) * (x - rho)) * erf((r * r - x * x).max(0.0).sqrt() * FRAC_1_SQRT_2)
    };
    (0..N_STEPS).map(chord).sum::<f64>() * step.max(0.0) / TAU.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_blurred_disc() {
        let disc = Disc::new();
        for (r, sigma) in [(1.0_f64, 0.9_f64), (2.0, 0.5), (9.0, 1.3), (30.0, 0.4)] {
            // In the middle the integral has a closed form.
            let middle = 1.0 - exp(-0.5 * (r / sigma) * (r / sigma));
            assert!(
                (disc.at(0.0, r, sigma) - middle).abs() < 0.002,
                "{r} {sigma}: {}",
                disc.at(0.0, r, sigma)
            );
            // Blur moves what is there, and loses nothing of it.
            let n = 4000;
            let step = (r + 6.0 * sigma) / f64::from(n);
            let rho = |i: i32| (f64::from(i) + 0.5) * step;
            let whole: f64 = (0..n).map(|i| TAU * rho(i) * disc.at(rho(i), r, sigma) * step).sum();
            assert!((whole / (0.5 * TAU * r * r) - 1.0).abs() < 0.01, "{r} {sigma}: {whole}");
            assert!((0..n).all(|i| disc.at(rho(i), r, sigma) >= disc.at(rho(i + 1), r, sigma)));
        }
    }
}
