//! Measures by generation, and Murray's exponent, as small plots.
//!
//! **Input** `branches.tsv`, `generations.tsv`. **Output** inline SVG: a point for each branch, mean and standard
//! deviation of each generation.
//! **Notation** at a fork with parent radius r₀ and children r_i, Murray's exponent is the k with r₀^k = Σ r_i^k.
//! **Steps** k by bisection between 0.5 and 8, where the fork has one: the largest child thinner than the parent.
//! **Source** [Murray1926]: 3 for least work at laminar flow; 2 keeps the area.

use espalier_geom::math;
use maud::{Markup, html};

use crate::facts::Facts;
use crate::length::{Unit, number, steps};
use crate::page::{Head, absent, table};
use crate::rows::Rows;

/// Size of a plot and of what stands beside its axes, in units.
pub(crate) const SIZE: [f64; 2] = [460.0, 250.0];
const LEFT: f64 = 58.0;
const RIGHT: f64 = 10.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 40.0;
/// Points of single branches in a plot.
const MAX_POINTS: usize = 1500;
/// The range in which Murray's exponent is looked for.
const EXPONENTS: [f64; 2] = [0.5, 8.0];

pub(crate) fn body(facts: &Facts<'_>) -> Markup {
    let (Some(branches), Some(generations)) = (&facts.branches, &facts.generations) else {
        return absent("This run has no tables of branches and generations.");
    };
    if generations.is_empty() {
        return absent("The tree has no branch.");
    }
    let unit = Unit::of(facts.tree);
    let plot = |title: String, column: &str, summary: [&str; 2], scale: f64| {
        let points = scattered(branches, column, scale);
        let means = summarised(generations, summary, scale);
        figure(&title, "generation", &points, &means)
    };
    let murray = murray(branches);
    html! {
        div.plots {
            (plot(format!("mean radius ({})", unit.sign), "radius_mean_mm", ["radius_mean_mm", "radius_sd_mm"], unit.mm))
            (plot(format!("length ({})", unit.sign), "length_mm", ["length_mean_mm", "length_sd_mm"], unit.mm))
            (plot("branching angle (°)".to_owned(), "branching_angle_deg", ["branching_angle_mean_deg", "branching_angle_sd_deg"], 1.0))
            (plot("tortuosity".to_owned(), "tortuosity", ["tortuosity_mean", "tortuosity_sd"], 1.0))
            (figure("Murray's exponent of forks", "generation of the parent", &thinned(&murray), &by_generation(&murray)))
        }
        p.note {
            "Points are branches, bars mean and standard deviation. "
            (said_of_murray(&murray))
        }
        (summary(generations, unit))
    }
}

fn said_of_murray(murray: &[[f64; 2]]) -> String {
    let mut exponents: Vec<f64> = murray.iter().map(|point| point[1]).collect();
    exponents.sort_by(f64::total_cmp);
    match exponents.get(exponents.len() / 2) {
        None => {
            "No fork of this tree has an exponent of Murray: that needs children thinner than their parent."
                .to_owned()
        }
        Some(median) => format!(
            "Murray's exponent (radius of the parent to the power k is the sum of its children's) has the median {} over {} forks; 3 means least work, 2 equal area.",
            number(*median, 3),
            exponents.len()
        ),
    }
}

fn scattered(branches: &Rows, column: &str, scale: f64) -> Vec<[f64; 2]> {
    let points: Vec<[f64; 2]> = (0..branches.len())
        .map(|row| [branches.number(row, "generation"), branches.number(row, column) / scale])
        .filter(|point| point.iter().all(|value| value.is_finite()))
        .collect();
    thinned(&points)
}

/// Every n-th point, so that few enough are left.
fn thinned(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    points.iter().step_by(points.len().div_ceil(MAX_POINTS).max(1)).copied().collect()
}

/// Generation, mean, standard deviation.
fn summarised(generations: &Rows, [mean, sd]: [&str; 2], scale: f64) -> Vec<[f64; 3]> {
    let row = |row| {
        [
            generations.number(row, "generation"),
            generations.number(row, mean) / scale,
            generations.number(row, sd) / scale,
        ]
    };
    (0..generations.len()).map(row).filter(|row| row[1].is_finite()).collect()
}

/// The same of points.
fn by_generation(points: &[[f64; 2]]) -> Vec<[f64; 3]> {
    let last = points.iter().map(|point| point[0]).fold(-1.0, f64::max) as i64;
    let of = |generation: i64| {
        let values: Vec<f64> =
            points.iter().filter(|point| point[0] as i64 == generation).map(|point| point[1]).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / (n - 1.0);
        [generation as f64, mean, if values.len() > 1 { variance.sqrt() } else { f64::NAN }]
    };
    (0..=last).map(of).filter(|row| row[1].is_finite()).collect()
}

/// Generation of the parent and Murray's exponent, for each fork that has one.
fn murray(branches: &Rows) -> Vec<[f64; 2]> {
    let radii = branches.numbers("radius_mean_mm");
    let fork = |row: usize| {
        let children: Vec<f64> = branches
            .text(row, "children")
            .split(',')
            .filter_map(|child| radii.get(child.parse::<usize>().ok()?).copied())
            .collect();
        let exponent = exponent(radii[row], &children)?;
        Some([branches.number(row, "generation"), exponent])
    };
    (0..branches.len()).filter_map(fork).collect()
}

/// The k with r₀^k = Σ r_i^k, if there is one in [`EXPONENTS`].
fn exponent(parent: f64, children: &[f64]) -> Option<f64> {
    let shares: Vec<f64> = children.iter().map(|radius| radius / parent).collect();
    if shares.len() < 2 || shares.iter().any(|share| !(*share > 0.0 && *share < 1.0)) {
        return None;
    }
    // Falls with k, since every share is below 1.
    let excess = |k: f64| shares.iter().map(|share| math::pow(*share, k)).sum::<f64>() - 1.0;
    let [mut low, mut high] = EXPONENTS;
    if excess(low) < 0.0 || excess(high) > 0.0 {
        return None;
    }
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if excess(middle) > 0.0 { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

/// The axes of a plot.
pub(crate) struct Axes {
    x: [f64; 2],
    y: [f64; 2],
}

impl Axes {
    /// Axes over these ranges, y from 0 unless it goes below.
    pub(crate) fn over(x: [f64; 2], y: [f64; 2]) -> Self {
        let widened = |[low, high]: [f64; 2]| if high > low { [low, high] } else { [low - 0.5, high + 0.5] };
        Self { x: widened(x), y: widened([y[0].min(0.0), y[1]]) }
    }

    pub(crate) fn place(&self, [x, y]: [f64; 2]) -> [String; 2] {
        let share = |value: f64, [low, high]: [f64; 2]| (value - low) / (high - low);
        let px = LEFT + share(x, self.x) * (SIZE[0] - LEFT - RIGHT);
        let py = SIZE[1] - BOTTOM - share(y, self.y) * (SIZE[1] - TOP - BOTTOM);
        [px, py].map(|value| format!("{value:.1}"))
    }

    /// Lines, marks and names.
    pub(crate) fn drawn(&self, title: &str, below: &str) -> Markup {
        let [left, bottom] = self.place([self.x[0], self.y[0]]);
        let [right, top] = self.place([self.x[1], self.y[1]]);
        let is_inside = |value: f64, [low, high]: [f64; 2]| value >= low && value <= high;
        html! {
            g.axes {
                @for tick in steps(self.y[0], self.y[1], 5).into_iter().filter(|tick| is_inside(*tick, self.y)) {
                    @let [_, y] = self.place([self.x[0], tick]);
                    line.grid x1=(left) x2=(right) y1=(y) y2=(y) {}
                    text x=(LEFT - 6.0) y=(y) dy="4" text-anchor="end" { (number(tick, 3)) }
                }
                @for tick in steps(self.x[0], self.x[1], 8).into_iter().filter(|tick| is_inside(*tick, self.x)) {
                    @let [x, _] = self.place([tick, self.y[0]]);
                    text x=(x) y=(SIZE[1] - BOTTOM + 16.0) text-anchor="middle" { (number(tick, 3)) }
                }
                path d={ "M" (left) " " (top) "V" (bottom) "H" (right) } {}
                text x=(0.5 * (LEFT + SIZE[0])) y=(SIZE[1] - 6.0) text-anchor="middle" { (below) }
                text transform={ "translate(13 " (0.5 * (TOP + SIZE[1] - BOTTOM)) ") rotate(-90)" } text-anchor="middle" { (title) }
            }
        }
    }
}

fn figure(title: &str, below: &str, points: &[[f64; 2]], means: &[[f64; 3]]) -> Markup {
    if points.is_empty() && means.is_empty() {
        return html! {};
    }
    let tops = points.iter().map(|point| point[1]).chain(means.iter().map(|[_, mean, _]| *mean));
    let high = tops.fold(0.0, f64::max);
    let last = points.iter().map(|point| point[0]).chain(means.iter().map(|row| row[0])).fold(0.0, f64::max);
    let axes = Axes::over([-0.5, last + 0.5], [0.0, 1.05 * high]);
    let ways: Vec<[String; 2]> = means.iter().map(|[x, mean, _]| axes.place([*x, *mean])).collect();
    let way: Vec<String> = ways.iter().map(|[x, y]| format!("{x} {y}")).collect();
    html! {
        figure.plot {
            svg viewBox={ "0 0 " (SIZE[0]) " " (SIZE[1]) } role="img" aria-label={ (title) " by " (below) } {
                (axes.drawn(title, below))
                g.points { @for point in points { @let [x, y] = axes.place(*point); circle cx=(x) cy=(y) r="2.2" {} } }
                g.means {
                    @if way.len() > 1 { path d={ "M" (way.join("L")) } {} }
                    @for [x, mean, sd] in means {
                        @let [px, y] = axes.place([*x, *mean]);
                        @if sd.is_finite() {
                            @let [_, low] = axes.place([*x, (mean - sd).max(0.0)]);
                            @let [_, high] = axes.place([*x, (mean + sd).min(1.05 * high)]);
                            path d={ "M" (px) " " (low) "V" (high) } {}
                        }
                        circle cx=(px) cy=(y) r="3.6" {}
                    }
                }
            }
        }
    }
}

fn summary(generations: &Rows, unit: Unit) -> Markup {
    let sign = |name: &str| format!("{name} ({})", unit.sign);
    let columns = [
        ("generation", "generation".to_owned(), 1.0),
        ("branches", "branches".to_owned(), 1.0),
        ("terminal", "ending in a tip".to_owned(), 1.0),
        ("total_length_mm", sign("total length"), unit.mm),
        ("length_mean_mm", sign("mean length"), unit.mm),
        ("radius_mean_mm", sign("mean radius"), unit.mm),
        ("radius_sd_mm", sign("± sd"), unit.mm),
        ("branching_angle_mean_deg", "mean branching angle (°)".to_owned(), 1.0),
        ("tortuosity_mean", "mean tortuosity".to_owned(), 1.0),
    ];
    let heads: Vec<Head<'_>> =
        columns.iter().map(|(_, name, _)| Head { name, meaning: "", is_number: true }).collect();
    let row = |row| {
        columns
            .iter()
            .map(|(column, _, scale)| html! { (number(generations.number(row, column) / scale, 4)) })
            .collect()
    };
    let cells: Vec<Vec<Markup>> = (0..generations.len()).map(row).collect();
    html! { details { summary { "The numbers by generation" } (table("sortable", &heads, &cells)) } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_of_known_forks() {
        let close = |found: Option<f64>, expected: f64| found.is_some_and(|k| (k - expected).abs() < 1e-9);
        let half: f64 = 0.5;
        assert!(close(exponent(1.0, &[math::cbrt(half); 2]), 3.0));
        assert!(close(exponent(2.0, &[2.0 * half.sqrt(); 2]), 2.0));
        for bad in [&[0.5][..], &[1.0, 0.5], &[0.1, 0.1], &[0.999, 0.999], &[f64::NAN, 0.5], &[]] {
            assert_eq!(exponent(1.0, bad), None, "{bad:?}");
        }
    }

    #[test]
    fn few_points_are_left() {
        let points = vec![[0.0, 1.0]; 4001];
        assert!(thinned(&points).len() <= MAX_POINTS);
        assert_eq!(thinned(&points[..3]).len(), 3);
    }
}
