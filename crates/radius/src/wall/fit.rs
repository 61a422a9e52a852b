//! A tube with a wall, or without, fitted to the values along a ray.
//!
//! **Input** a ray; what is known beforehand. **Output** [`Tube`].
//! **Notation** D(r) a blurred disc of radius r (`disc`). Dark tubes have a wall of thickness t and value W, and a lumen of
//! the known value L: I = L·D(r) + W·(D(r + t) − D(r)) + P·(1 − D(r + t)). Bright ones have none, and L is fitted, since
//! contrast is not the same everywhere: I = L·D(r) + P·(1 − D(r)).
//! **Steps** least squares of r, t or L, P, and σ where it is wanted, by Levenberg's and Marquardt's method from the mask's
//! surface, with differences for derivatives.
//! **Source** [Reinhardt1997]; that the values of lumen and wall must be known where the wall is thinner than the blur, as
//! there.
//! **Cost** some ten rounds of four looks at each sample.

use glam::{DMat4, DVec4};

use super::disc::Disc;
use super::rays::Ray;

/// How far the fit looks from the mask's surface, inside and beyond, in voxels.
const WINDOW: [f64; 2] = [3.0, 2.5];
/// The fewest samples that tell anything.
const LEAST_SAMPLES: usize = 8;
const MOST_ROUNDS: usize = 20;
/// How often a step is shortened before the round is the last.
const MOST_TRIES: usize = 4;
/// A round that gains less than this share is the last.
const LEAST_GAIN: f64 = 1e-6;
/// Steps of the differences, in voxels, and as a share of the contrast.
const STEP_VOXELS: f64 = 0.05;
const STEP_SHARE: f64 = 0.01;
/// How far the radius may go from the mask's surface, in voxels.
const REACH: [f64; 2] = [2.0, 4.0];
/// How much more a bright lumen stands out than those of thick branches: without a limit a vessel thinner than the blur can be
/// as thin as one likes, if it is bright enough.
const MOST_CONTRAST: f64 = 1.25;
/// The least radius, and what a blur may be, in voxels.
const LEAST_RADIUS: f64 = 0.2;
const BLUR: [f64; 2] = [0.2, 3.0];

/// What a fit takes as known.
#[derive(Clone, Copy)]
pub(super) struct Known {
    /// Whether the lumen is darker than what is around it.
    pub(super) is_dark: bool,
    pub(super) lumen: f64,
    pub(super) wall: f64,
    /// The standard deviation of the blur along the ray, in mm: where the fit begins if it is to find it.
    pub(super) sigma_mm: f64,
    pub(super) is_sigma_free: bool,
}

/// A tube as a ray has it.
#[derive(Clone, Copy)]
pub(super) struct Tube {
    pub(super) radius_mm: f64,
    pub(super) sigma_mm: f64,
    /// How much the wall, or what is around a bright tube, differs from the lumen.
    pub(super) contrast: f64,
    /// The root mean square of what is left.
    pub(super) residual: f64,
}

/// A tube about to be fitted. Parameters: r; t of a dark one, L of a bright one; P; σ.
struct Fit<'a> {
    known: Known,
    disc: &'a Disc,
    ray: &'a Ray,
    step_mm: f64,
    /// The samples looked at.
    range: std::ops::Range<usize>,
    /// Steps of the differences; 0 for what is not free.
    steps: DVec4,
}

/// The tube that a ray shows; none where it is too short to show one.
pub(super) fn fit(ray: &Ray, step_mm: f64, known: Known, disc: &Disc) -> Option<Tube> {
    let first = ((ray.surface_mm - WINDOW[0] * ray.voxel_mm).max(0.0) / step_mm).ceil() as usize;
    let end = (((ray.surface_mm + WINDOW[1] * ray.voxel_mm) / step_mm) as usize + 1).min(ray.values.len());
    if end < first + LEAST_SAMPLES {
        return None;
    }
    let scale = (known.wall - known.lumen).abs().max(f64::MIN_POSITIVE);
    let length = STEP_VOXELS * ray.voxel_mm;
    let second = if known.is_dark { length } else { STEP_SHARE * scale };
    let steps =
        DVec4::new(length, second, STEP_SHARE * scale, if known.is_sigma_free { length } else { 0.0 });
    let fit = Fit { known, disc, ray, step_mm, range: first..end, steps };
    let begin = DVec4::new(
        ray.surface_mm,
        if known.is_dark { 0.5 * ray.voxel_mm } else { ray.values[first] },
        ray.values[end - 1],
        known.sigma_mm,
    );
    let found = fit.descend(fit.bounded(begin));
    Some(Tube {
        radius_mm: found.x,
        sigma_mm: found.w,
        contrast: if known.is_dark { known.wall - known.lumen } else { found.y - found.z }.abs(),
        residual: (fit.squares(found) / fit.range.len() as f64).sqrt(),
    })
}

impl Fit<'_> {
    /// The value of a tube at the i-th sample.
    fn value(&self, tube: DVec4, i: usize) -> f64 {
        let rho = i as f64 * self.step_mm;
        let inner = self.disc.at(rho, tube.x, tube.w);
        if !self.known.is_dark {
            return tube.y * inner + tube.z * (1.0 - inner);
        }
        let outer = self.disc.at(rho, tube.x + tube.y, tube.w);
        self.known.lumen * inner + self.known.wall * (outer - inner) + tube.z * (1.0 - outer)
    }

    fn squares(&self, tube: DVec4) -> f64 {
        let left = |i: usize| self.ray.values[i] - self.value(tube, i);
        self.range.clone().map(|i| left(i) * left(i)).sum()
    }

    fn bounded(&self, mut tube: DVec4) -> DVec4 {
        let Ray { surface_mm, voxel_mm, .. } = *self.ray;
        let least_mm = (surface_mm - REACH[0] * voxel_mm).max(LEAST_RADIUS * voxel_mm);
        tube.x = tube.x.clamp(least_mm, (surface_mm + REACH[1] * voxel_mm).max(least_mm));
        if self.known.is_dark {
            tube.y = tube.y.clamp(0.0, REACH[1] * voxel_mm);
        } else {
            let most = MOST_CONTRAST * (self.known.lumen - self.known.wall).abs();
            tube.y = tube.y.clamp(tube.z - most, tube.z + most);
        }
        tube.w = tube.w.clamp(BLUR[0] * voxel_mm, BLUR[1] * voxel_mm);
        tube
    }

    /// The least squares near a tube.
    fn descend(&self, mut tube: DVec4) -> DVec4 {
        let mut least = self.squares(tube);
        let mut damping = 0.01;
        for _ in 0..MOST_ROUNDS {
            let (normal, slope) = self.normal_equations(tube);
            let before = least;
            for _ in 0..MOST_TRIES {
                let next = self.bounded(tube + solved(normal, slope, damping) * self.steps);
                let squares = self.squares(next);
                if squares < least {
                    (tube, least) = (next, squares);
                    damping *= 0.3;
                    break;
                }
                damping *= 10.0;
            }
            if before - least <= LEAST_GAIN * before {
                break;
            }
        }
        tube
    }

    /// The normal equations of a step, in units of `steps`.
    fn normal_equations(&self, tube: DVec4) -> (DMat4, DVec4) {
        let (mut normal, mut slope) = (DMat4::ZERO, DVec4::ZERO);
        for i in self.range.clone() {
            let value = self.value(tube, i);
            let mut gradient = DVec4::ZERO;
            for parameter in (0..4).filter(|&parameter| self.steps[parameter] > 0.0) {
                let mut beside = tube;
                beside[parameter] += self.steps[parameter];
                gradient[parameter] = self.value(beside, i) - value;
            }
            normal += DMat4::from_cols(
                gradient * gradient.x,
                gradient * gradient.y,
                gradient * gradient.z,
                gradient * gradient.w,
            );
            slope += gradient * (self.ray.values[i] - value);
        }
        (normal, slope)
    }
}

/// The damped step; a parameter that nothing depends on stays.
fn solved(mut normal: DMat4, slope: DVec4, damping: f64) -> DVec4 {
    for parameter in 0..4 {
        let own = &mut normal.col_mut(parameter)[parameter];
        *own = if *own > 0.0 { *own * (1.0 + damping) } else { 1.0 };
    }
    let step = normal.inverse() * slope;
    if step.is_finite() { step } else { DVec4::ZERO }
}
