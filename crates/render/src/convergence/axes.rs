//! The axes of the chart: both logarithmic, since energies fall and work grows by factors.
//!
//! **Input** the methods, the corners of the chart. **Output** places, and round values along the axes.
//! **Guarantees** what is below the chart (an energy of 0, no work) or no number stands on its edge.

use espalier_geom::math;
use espalier_model::TracePoint;
use glam::DVec2;

use super::Searched;
use crate::unit;

/// The most decades of energy that are shown: nobody needs to tell 1e-9 of the start from 0.
const MOST_DECADES: f64 = 8.0;

/// Two logarithmic axes in pixels.
pub(super) struct Axes {
    pub corners: [DVec2; 2],
    /// Decades of work and of energy at the ends of the axes.
    pub work: [f64; 2],
    pub energy: [f64; 2],
}

impl Axes {
    pub(super) fn of(methods: &[Searched<'_>], corners: [DVec2; 2]) -> Self {
        let decade = |value: f64| math::log10(value);
        let work = methods.iter().flat_map(|method| method.trace).map(|point| point.evaluations as f64);
        let (least_work, most_work) = work
            .filter(|&work| work > 1.0)
            .fold((f64::INFINITY, 10.0), |(least, most), work| (f64::min(least, work), f64::max(most, work)));
        let energies = methods.iter().flat_map(|method| {
            let row = std::iter::once(method.row.energy.total());
            row.chain(method.trace.iter().map(|point| point.energy))
        });
        let shown: Vec<f64> = energies.filter(|energy| *energy > 0.0 && energy.is_finite()).collect();
        let top = shown.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let bottom = shown.iter().copied().fold(f64::INFINITY, f64::min);
        let energy = if shown.is_empty() {
            [-1.0, 0.0]
        } else {
            let high = decade(top) + 0.15;
            [(decade(bottom) - 0.15).max(high - MOST_DECADES), high]
        };
        let first = if least_work.is_finite() { (decade(least_work) - 0.3).max(0.0) } else { 0.0 };
        Self { corners, work: [first, decade(most_work) + 0.05], energy }
    }

    pub(super) fn x(&self, work: f64) -> f64 {
        let [from, to] = self.work;
        let share = (math::log10(work.max(1.0)) - from) / (to - from);
        self.corners[0].x + share.clamp(0.0, 1.0) * (self.corners[1].x - self.corners[0].x)
    }

    pub(super) fn y(&self, energy: f64) -> f64 {
        let [from, to] = self.energy;
        // Nothing, or a number that is none, stands at the bottom.
        let share = if energy > 0.0 { (math::log10(energy) - from) / (to - from) } else { 0.0 };
        self.corners[1].y - share.clamp(0.0, 1.0) * (self.corners[1].y - self.corners[0].y)
    }

    pub(super) fn at(&self, point: &TracePoint) -> DVec2 {
        DVec2::new(self.x(point.evaluations as f64), self.y(point.energy))
    }

    /// Round values inside an axis: powers of ten, with 2 and 5 where there are few decades.
    pub(super) fn ticks([from, to]: [f64; 2]) -> Vec<f64> {
        let all = unit::ladder(math::pow(10.0, from), math::pow(10.0, to));
        let is_power = |value: &f64| (math::log10(*value) - math::log10(*value).round()).abs() < 1e-9;
        if to - from < 2.5 { all } else { all.into_iter().filter(is_power).collect() }
    }
}
