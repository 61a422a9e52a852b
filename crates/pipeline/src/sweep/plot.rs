//! The plot of a sweep: losses against the first key, one line for each combination of the others.
//!
//! **Steps** the x axis is logarithmic if all values are numbers over 0 that span a factor of five, linear if they are
//! numbers, else one place each in the order given.
//! **Source** the parameter analysis of [Hu2022]: geometry loss against w_l and w_a.

use espalier_geom::math;
use espalier_model::MethodRow;
use espalier_render::{Chart, Charts, Error, Params, SideBySide, charts};

use super::{Axis, Combination};

/// The largest over the smallest value from which on an axis is logarithmic.
const LOGARITHMIC: f64 = 5.0;

/// A quantity to plot.
type Plotted = (&'static str, fn(&MethodRow) -> f64);

const PLOTTED: [Plotted; 6] = [
    ("length loss, mean (%)", |row| 100.0 * row.losses.length_loss_mean),
    ("angle loss, mean (%)", |row| 100.0 * row.losses.angle_loss_mean),
    ("energy", |row| row.energy.total()),
    ("length loss, largest (%)", |row| 100.0 * row.losses.length_loss_max),
    ("angle loss, largest (%)", |row| 100.0 * row.losses.angle_loss_max),
    ("stress", |row| row.losses.stress),
];

/// Draws the plot.
pub(super) fn draw(
    title: &str,
    axes: &[Axis],
    done: &[Combination],
    params: &Params,
) -> Result<SideBySide, Error> {
    let Some((x_axis, others)) = axes.split_first() else {
        return charts(
            &Charts {
                title: title.to_owned(),
                x_label: String::new(),
                ticks: vec![],
                series: vec![],
                charts: vec![],
            },
            params,
        );
    };
    let places = places(&x_axis.values);
    // Lines go from left to right, whatever the order in which the values were given.
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|&a, &b| places[a].total_cmp(&places[b]).then(a.cmp(&b)));
    // The last axis is the fastest, so combinations of equal x are next to each other.
    let n_series = done.len() / x_axis.values.len().max(1);
    let name = |series: usize| {
        let values = done[series].values[1..].iter();
        let pairs = others.iter().zip(values).map(|(axis, value)| format!("{} = {value}", axis.key));
        pairs.collect::<Vec<_>>().join(", ")
    };
    let value = |series: usize, x: usize, of: fn(&MethodRow) -> f64| {
        done.get(x * n_series + series).and_then(|combination| combination.outcome.as_ref().ok()).map(of)
    };
    let chart = |(title, of): &Plotted| Chart {
        title: (*title).to_owned(),
        values: (0..n_series).map(|s| order.iter().map(|&x| value(s, x, *of)).collect()).collect(),
    };
    let figure = Charts {
        title: format!("{title}: losses against {}", x_axis.key),
        x_label: x_axis.key.clone(),
        ticks: order.iter().map(|&x| (places[x], x_axis.values[x].clone())).collect(),
        series: (0..n_series).map(name).collect(),
        charts: PLOTTED.iter().map(chart).collect(),
    };
    charts(&figure, params)
}

/// The place of each value on the axis, from 0 to 1.
fn places(values: &[String]) -> Vec<f64> {
    let numbers: Option<Vec<f64>> =
        values.iter().map(|text| text.parse::<f64>().ok().filter(|number| number.is_finite())).collect();
    let numbers = numbers.unwrap_or_else(|| (0..values.len()).map(|idx| idx as f64).collect());
    let least = numbers.iter().copied().fold(f64::INFINITY, f64::min);
    let most = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let is_logarithmic = least > 0.0 && most >= LOGARITHMIC * least;
    let scale = |number: f64| if is_logarithmic { math::ln(number) } else { number };
    let (low, high) = (scale(least), scale(most));
    numbers.into_iter().map(|n| if high > low { (scale(n) - low) / (high - low) } else { 0.5 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_by_number_or_by_order() {
        let places = |values: &[&str]| places(&values.iter().map(|v| (*v).to_owned()).collect::<Vec<_>>());
        assert_eq!(places(&["0", "1", "4"]), [0.0, 0.25, 1.0]);
        assert_eq!(places(&["radial", "cone", "pso"]), [0.0, 0.5, 1.0]);
        let log = places(&["1", "10", "100"]);
        assert!((log[1] - 0.5).abs() < 1e-12 && log[2] == 1.0, "{log:?}");
        assert_eq!(places(&["2"]), [0.5]);
    }
}
