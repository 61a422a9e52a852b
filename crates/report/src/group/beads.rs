//! How each measure is distributed: a bead for each run on a line.
//!
//! **Input** the group. **Output** inline SVG.
//! **Steps** 1. Beads stand at their values; where they would lie over each other they are stacked, up and down in turn,
//! in the order of the runs. 2. The median is a line, what lies between the limits a band; outliers are coloured, and a few
//! of them named.

use maud::{Markup, html};

use super::measures::{MEASURES, Measure};
use super::outliers::{LEAST_RUNS, Spread};
use super::{Group, Outlier};
use crate::length::steps;
use crate::page::absent;

/// Size of a plot, the room at its sides, the line of the values and the axis, in units.
const SIZE: [f64; 2] = [460.0, 104.0];
const SIDE: f64 = 16.0;
const MIDDLE: f64 = 40.0;
const AXIS: f64 = 80.0;
/// The radius of a bead, and how far apart stacked ones are.
const BEAD: f64 = 3.0;
const STEP: f64 = 4.6;
/// Beads are stacked so far from the line.
const MOST_OFF: f64 = 32.0;
/// Outliers that are named.
const MOST_NAMED: usize = 3;
/// Letters of a name.
const MOST_LETTERS: usize = 24;

pub(super) fn body(group: &Group<'_>) -> Markup {
    if group.n_mapped() == 0 {
        return absent("No run has a map.");
    }
    html! {
        div.beads {
            @for (index, measure) in MEASURES.iter().enumerate() {
                @if group.spreads[index].n > 0 { (plot(group, index, measure)) }
            }
        }
        p.note {
            "A bead is a run, the line the median"
            @if group.n_mapped() >= LEAST_RUNS { ", the band what is no outlier" }
            "."
        }
    }
}

fn plot(group: &Group<'_>, index: usize, measure: &Measure) -> Markup {
    let spread = &group.spreads[index];
    let [least, most] = spread.range;
    if spread.is_even() {
        return html! {
            figure.plot { h4 { (measure.heading) } p.note { "all " (spread.n) " runs: " (measure.text(most)) } }
        };
    }
    let outliers: Vec<&Outlier> = group.outliers.iter().filter(|outlier| outlier.measure == index).collect();
    let line = Line { least, most };
    let beads = beads(group, measure, &line);
    html! {
        figure.plot {
            h4 { (measure.heading) }
            svg viewBox={ "0 0 " (SIZE[0]) " " (SIZE[1]) } role="img" aria-label={ "distribution of " (measure.heading) } {
                @if spread.n >= LEAST_RUNS { (band(spread, &line)) }
                @let median = line.x(spread.median);
                line.median x1=(px(median)) x2=(px(median)) y1="4" y2=(AXIS) {}
                g.axes {
                    path d={ "M" (SIDE) " " (AXIS) "H" (SIZE[0] - SIDE) } {}
                    @for tick in steps(least, most, 4).into_iter().filter(|tick| *tick >= least && *tick <= most) {
                        text x=(px(line.x(tick))) y=(AXIS + 16.0) text-anchor="middle" { (measure.text(tick)) }
                    }
                }
                g.points {
                    @for (run, [x, y]) in beads {
                        circle.far[outliers.iter().any(|outlier| outlier.run == run)] cx=(px(x)) cy=(px(y)) r=(BEAD) {
                            title { (group.runs[run].label) }
                        }
                    }
                }
                @for (nth, outlier) in outliers.iter().take(MOST_NAMED).enumerate() {
                    @let x = line.x(outlier.value);
                    text.far x=(px(x)) y=(12 + 13 * nth) text-anchor=(if x > 0.5 * SIZE[0] { "end" } else { "start" }) {
                        (short(&group.runs[outlier.run].label))
                    }
                }
            }
        }
    }
}

/// The line of the values.
struct Line {
    least: f64,
    most: f64,
}

impl Line {
    fn x(&self, value: f64) -> f64 {
        let share = ((value - self.least) / (self.most - self.least)).clamp(0.0, 1.0);
        SIDE + share * (SIZE[0] - 2.0 * SIDE)
    }
}

fn band(spread: &Spread, line: &Line) -> Markup {
    let [low, high] = spread.limits().map(|limit| line.x(limit));
    html! { rect.band x=(px(low)) width=(px(high - low)) y="8" height=(AXIS - 8.0) {} }
}

/// Where the bead of each run stands.
fn beads(group: &Group<'_>, measure: &Measure, line: &Line) -> Vec<(usize, [f64; 2])> {
    let n_bins = (SIZE[0] / (2.0 * BEAD)) as usize + 1;
    let mut heights = vec![0_u32; n_bins];
    let mut beads = Vec::new();
    for (run, value) in group.runs.iter().enumerate() {
        let value = value.mapped().map_or(f64::NAN, |mapped| (measure.of)(&mapped.measured));
        if !value.is_finite() {
            continue;
        }
        let x = line.x(value);
        let bin = ((x / (2.0 * BEAD)) as usize).min(n_bins - 1);
        let nth = heights[bin];
        heights[bin] += 1;
        // 0, 1 up, 1 down, 2 up …; what would leave the plot begins anew.
        let off = f64::from(nth.div_ceil(2)) * STEP % MOST_OFF;
        beads.push((run, [x, if nth.is_multiple_of(2) { MIDDLE + off } else { MIDDLE - off }]));
    }
    beads
}

fn px(value: f64) -> String {
    format!("{value:.1}")
}

fn short(label: &str) -> String {
    if label.chars().count() <= MOST_LETTERS {
        return label.to_owned();
    }
    label.chars().take(MOST_LETTERS - 1).chain(['…']).collect()
}
