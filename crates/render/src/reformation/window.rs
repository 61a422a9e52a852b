//! Which values are black and white, and the scale that says so.
//!
//! **Input** the scan, the map, the parameters. **Output** [`Greys`].
//! **Steps** 1. A scan with values under air's neighbour, −200, is taken to be in HU. 2. Values on the map: for each node
//! at nine places across the branch, as far as the scan is shown. 3. What fills the tree: the median of its centreline.
//! Air takes the lung window, contrast that of vessels. 4. Where that says nothing, percentiles, rounded outwards to
//! numbers that read well.
//! **Guarantees** white is above black, also where all values are one.
//! **Cost** O(nodes · log nodes + voxels).

use espalier_geom::math;
use espalier_model::{Tree, Volume};

use super::params::{VolumeParams, Window};
use super::sampler::Sampler;
use crate::coloring::{Coloring, Scale, Tick};
use crate::map::{Place, PlanarMap};
use crate::palette::Palette;
use crate::unit;

/// Only air, and what holds much of it, is below: a scan that has such values is in HU.
const AIRY: f64 = -200.0;
/// What fills the tree: below the first it is air, from the second on contrast, HU. Blood without is 30 to 60.
const AIR_HU: f64 = -500.0;
const CONTRAST_HU: f64 = 130.0;
/// Percentiles that are black and white.
const PERCENTILES: [f64; 2] = [0.01, 0.99];
/// Places across a branch that are looked at, on either side.
const N_ASIDE: i32 = 4;

/// The values that are black and white.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Greys {
    /// Black and white.
    pub range: [f64; 2],
    /// What the window is called.
    pub name: &'static str,
    /// The unit of the values, or what they are.
    pub unit: &'static str,
}

/// The window of a scan on a map.
pub(super) fn greys(
    (tree, map): (&Tree, &PlanarMap<'_>),
    (scan, sampler): (&Volume, &Sampler<'_>),
    params: &VolumeParams,
) -> Greys {
    let mut is_hu = false;
    scan.for_each_value(|value| is_hu |= value.is_finite() && value < AIRY);
    let unit = if is_hu { "HU" } else { "scan value" };
    let window = match params.window {
        Window::Auto if is_hu => by_filling(tree, sampler),
        Window::Auto => Window::Percentiles,
        window => window,
    };
    let (range, name) = match window {
        Window::Lung => ([-1000.0, 200.0], "lung window"),
        Window::SoftTissue => ([-160.0, 240.0], "soft tissue window"),
        Window::Vessel => ([-100.0, 700.0], "vessel window"),
        Window::Range(range) => (range, "window"),
        Window::Auto | Window::Percentiles => {
            (percentiles(tree, map, sampler, params), "window by percentiles")
        }
    };
    Greys { range, name, unit }
}

/// The window for what fills the tree.
fn by_filling(tree: &Tree, sampler: &Sampler<'_>) -> Window {
    let filling = sorted(tree.nodes().iter().filter_map(|node| sampler.at(node.position_mm)));
    match filling.get(filling.len() / 2) {
        Some(&median) if median < AIR_HU => Window::Lung,
        Some(&median) if median >= CONTRAST_HU => Window::Vessel,
        _ => Window::Percentiles,
    }
}

fn percentiles(tree: &Tree, map: &PlanarMap<'_>, sampler: &Sampler<'_>, params: &VolumeParams) -> [f64; 2] {
    let mut values = Vec::new();
    for node in 0..tree.n_nodes() {
        let place = Place { node, share: 1.0 };
        let radius_mm = map.radius_mm(place);
        let across = map.direction(node).perp() * (radius_mm + params.reach(radius_mm)) / f64::from(N_ASIDE);
        values.extend((-N_ASIDE..=N_ASIDE).filter_map(|i| {
            let aside = (across * f64::from(i)).extend(0.0);
            sampler.at(map.patient_at(place) + map.frame_at(place) * aside)
        }));
    }
    let values = sorted(values.into_iter());
    let Some(last) = values.len().checked_sub(1) else { return [0.0, 1.0] };
    let [low, high] = PERCENTILES.map(|share| values[(share * last as f64 + 0.5) as usize]);
    let span = high - low;
    if span <= 0.0 {
        let half = 0.5 * low.abs().max(1.0);
        return [low - half, low + half];
    }
    let step = unit::round_down(span / 20.0);
    [math::floor(low / step) * step, math::ceil(high / step) * step]
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

impl Greys {
    /// From 0, black, to 1, white.
    pub(super) fn share(&self, value: f64) -> f32 {
        let [low, high] = self.range;
        ((value - low) / (high - low)).clamp(0.0, 1.0) as f32
    }

    /// As a colouring of `n_nodes`, for the key.
    pub(crate) fn coloring(&self, n_nodes: usize) -> Coloring {
        Coloring {
            palette: Palette::greys(),
            ends: vec![[0.0; 2]; n_nodes],
            scale: Some(Scale { caption: self.unit.to_owned(), ticks: self.ticks() }),
        }
    }

    /// Black, white, and round numbers between them that do not crowd these.
    fn ticks(&self) -> Vec<Tick> {
        let [low, high] = self.range;
        let step = unit::round_down((high - low) / 3.0);
        let first = math::ceil(low / step);
        let between = (0..8).map(|i| (first + f64::from(i)) * step);
        let is_apart = |value: &f64| value - low > 0.4 * step && high - value > 0.4 * step;
        let values = std::iter::once(low).chain(between.filter(is_apart)).chain([high]);
        values
            .map(|value| Tick { position: (value - low) / (high - low), text: signed(value), is_mean: false })
            .collect()
    }
}

/// A value with a proper minus sign.
pub(crate) fn signed(value: f64) -> String {
    // To four digits, and whole numbers in full.
    let digits = if value.abs() >= 1e4 { 6 } else { 4 };
    unit::text(value, digits).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_between_black_and_white() {
        let texts = |range: [f64; 2]| -> Vec<String> {
            let greys = Greys { range, name: "window", unit: "HU" };
            greys.ticks().into_iter().map(|tick| tick.text).collect()
        };
        assert_eq!(texts([-1000.0, 200.0]), ["−1000", "−800", "−600", "−400", "−200", "0", "200"]);
        assert_eq!(texts([-100.0, 700.0]), ["−100", "0", "200", "400", "600", "700"]);
        assert_eq!(texts([0.0, 0.9]), ["0", "0.2", "0.4", "0.6", "0.8", "0.9"]);
    }
}
