//! The two-loop recursion: the last steps stand for the curvature.
//!
//! **Input** steps s and changes y of the gradient, a diagonal. **Output** the direction −H g.
//! **Guarantees** only pairs with s·y > 0 are kept, so H is positive definite.
//! **Source** [NocedalWright2006] algorithm 7.4; the diagonal stands where theirs has a multiple of the identity.
//! **Cost** O(dims · pairs kept).

/// How many steps are kept: an airway phantom ended at the energy 6.9 with 10, 10.3 with 20 and 8.9 with 5.
const MOST: usize = 10;
/// A step is kept if its curvature is above this share of what it could be.
const LEAST_CURVATURE: f64 = 1e-10;

/// The last steps, oldest first.
#[derive(Default)]
pub(super) struct Memory {
    steps: Vec<Step>,
}

struct Step {
    step: Vec<f64>,
    change: Vec<f64>,
    /// 1 / s·y.
    per_curvature: f64,
    alpha: f64,
}

impl Memory {
    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.steps.clear();
    }

    /// Whether there is nothing to tell of the curvature.
    pub(super) fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Keeps the step from `from` to `to`, where the gradient was and is.
    pub(super) fn keep(&mut self, (from, to): (&[f64], &[f64]), (was, is): (&[f64], &[f64])) {
        let (mut curvature, mut steps, mut changes) = (0.0, 0.0, 0.0);
        for dim in 0..from.len() {
            let (step, change) = (to[dim] - from[dim], is[dim] - was[dim]);
            curvature += step * change;
            steps += step * step;
            changes += change * change;
        }
        if !(curvature > LEAST_CURVATURE * (steps * changes).sqrt() && curvature.is_finite()) {
            return;
        }
        let mut kept = if self.steps.len() == MOST {
            self.steps.remove(0)
        } else {
            Step { step: Vec::new(), change: Vec::new(), per_curvature: 0.0, alpha: 0.0 }
        };
        kept.step.clear();
        kept.step.extend(from.iter().zip(to).map(|(from, to)| to - from));
        kept.change.clear();
        kept.change.extend(was.iter().zip(is).map(|(was, is)| is - was));
        kept.per_curvature = 1.0 / curvature;
        self.steps.push(kept);
    }

    /// Writes −H g to `direction`; ratios that may not move, where `is_free` is false, stay.
    pub(super) fn direction(
        &mut self,
        (gradient, diagonal): (&[f64], &[f64]),
        is_free: &[bool],
        direction: &mut [f64],
    ) {
        for dim in 0..gradient.len() {
            direction[dim] = if is_free[dim] { -gradient[dim] } else { 0.0 };
        }
        for Step { step, change, per_curvature, alpha } in self.steps.iter_mut().rev() {
            *alpha = *per_curvature * dot(step, direction);
            add(direction, -*alpha, change);
        }
        let scale = self.steps.last().map_or(1.0, |last| {
            let by_diagonal: f64 =
                (0..gradient.len()).map(|k| last.change[k] * last.change[k] / diagonal[k]).sum();
            1.0 / (last.per_curvature * by_diagonal)
        });
        direction.iter_mut().zip(diagonal).for_each(|(d, h)| *d *= scale / h);
        for Step { step, change, per_curvature, alpha } in &self.steps {
            let beta = per_curvature * dot(change, direction);
            add(direction, *alpha - beta, step);
        }
        direction.iter_mut().zip(is_free).filter(|(_, is_free)| !**is_free).for_each(|(d, _)| *d = 0.0);
    }
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(to: &mut [f64], factor: f64, what: &[f64]) {
    to.iter_mut().zip(what).for_each(|(to, what)| *to += factor * what);
}
