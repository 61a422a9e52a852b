//! What a chart of a way shows, as marks.
//!
//! **Input** the way and its axes. **Output** groups of marks.
//! **Cost** O(rows).

use espalier_model::anatomy::{ProfileRow, Spread, Stenosis};
use glam::DVec2;

use super::{Axes, BODY, LEADING, LEFT, NAME_ROWS, SMALL, Stretch, Way};
use crate::drawing::{Group, Mark};
use crate::palette::{PageColors, Palette, Rgb};
use crate::params::{Params, Theme};
use crate::text::{Anchor, Face};
use crate::unit;

/// A dash of the broken line, and what it and its gap take together, in layout units.
const DASH: f64 = 0.7;
const DASH_STEP: f64 = 1.2;
/// Narrow places whose percentage is written: more would run into each other.
const MOST_NAMED: usize = 8;
/// The radius of a ring, in layout units.
const RING: f64 = 0.75;

pub(super) struct Artist<'a> {
    pub(super) axes: Axes,
    pub(super) unit: f64,
    pub(super) colors: PageColors,
    pub(super) face: &'a Face,
    pub(super) params: &'a Params,
}

impl Artist<'_> {
    /// The colours of the curves: blue and orange of the names, both clear of the page.
    fn curve_colors(&self) -> [Rgb; 2] {
        let names = Palette::names();
        let blue = if self.params.theme == Theme::Dark { 1 } else { 3 };
        [names.at(names.value_of(blue)), names.at(names.value_of(4))]
    }

    /// Between page and soft ink.
    fn tint(&self, share: f32) -> Rgb {
        std::array::from_fn(|k| {
            self.colors.background[k] + share * (self.colors.soft[k] - self.colors.background[k])
        })
    }

    /// Mean and standard deviation of the generations on the way.
    pub(super) fn usual(&self, way: &Way<'_>) -> Group {
        let mut marks = Vec::new();
        for ([from_mm, to_mm], stretch) in spans(way) {
            let Spread { mean, sd } = stretch.usual_mm;
            let place = |end_mm: f64, radius_mm: f64| self.axes.at(end_mm, radius_mm);
            if sd.is_finite() && mean.is_finite() {
                let (top, bottom) = (place(from_mm, mean + sd).y, place(from_mm, mean - sd).y);
                let y = 0.5 * (top + bottom);
                let ends = [from_mm, to_mm].map(|end_mm| DVec2::new(place(end_mm, 0.0).x, y));
                marks.push(Mark::Line {
                    from: ends[0],
                    to: ends[1],
                    width_px: bottom - top,
                    color: self.tint(0.16),
                });
            }
            if mean.is_finite() {
                marks.push(self.line(place(from_mm, mean), place(to_mm, mean), 0.12, self.tint(0.55)));
            }
        }
        Group { name: "generations", marks }
    }

    /// Axes, their ticks and what they are.
    pub(super) fn grid(&self) -> Group {
        let Axes { corners: [low, high], ends_mm, units } = &self.axes;
        let mut marks = Vec::new();
        for tick in unit::multiples(0.0, ends_mm[1] / units[1].mm, 5) {
            let y = self.axes.at(0.0, tick * units[1].mm).y;
            marks.push(self.line(DVec2::new(low.x, y), DVec2::new(high.x, y), 0.05, self.tint(0.5)));
            let at = DVec2::new(low.x - 0.6 * self.unit, y + 0.36 * SMALL * self.unit);
            marks.push(self.text(at, SMALL, Anchor::End, &unit::text(tick, 3)));
        }
        for tick in unit::multiples(0.0, ends_mm[0] / units[0].mm, 8) {
            let foot = DVec2::new(self.axes.at(tick * units[0].mm, 0.0).x, high.y);
            marks.push(self.line(foot, foot + DVec2::new(0.0, 0.5 * self.unit), 0.1, self.colors.ink));
            let at = foot + DVec2::new(0.0, (0.5 + SMALL) * self.unit);
            marks.push(self.text(at, SMALL, Anchor::Middle, &unit::text(tick, 3)));
        }
        marks.push(self.line(*low, DVec2::new(low.x, high.y), 0.1, self.colors.ink));
        marks.push(self.line(DVec2::new(low.x, high.y), *high, 0.1, self.colors.ink));
        let below = DVec2::new(0.5 * (low.x + high.x), high.y + (0.8 + 2.6 * SMALL) * self.unit);
        let along = format!("path length from the root ({})", units[0].sign);
        marks.push(self.text(below, BODY, Anchor::Middle, &along));
        let beside = DVec2::new(low.x - LEFT * self.unit, low.y + (2.0 * LEADING * BODY) * self.unit);
        marks.push(self.text(beside, BODY, Anchor::Start, "radius"));
        let under = beside + DVec2::new(0.0, LEADING * BODY * self.unit);
        marks.push(self.text(under, BODY, Anchor::Start, &format!("({})", units[1].sign)));
        Group { name: "axes", marks }
    }

    /// Where one branch ends and the next begins, and their names in the first row that has room.
    pub(super) fn borders(&self, way: &Way<'_>) -> Group {
        let [low, high] = self.axes.corners;
        let step = LEADING * SMALL * self.unit;
        let head = DVec2::new(low.x - LEFT * self.unit, low.y - 0.5 * self.unit);
        let mut marks = vec![
            self.text(head - DVec2::new(0.0, step), SMALL, Anchor::Start, "branch"),
            self.text(head, SMALL, Anchor::Start, "(gen.)"),
        ];
        let mut free_from = [low.x; NAME_ROWS];
        for ([from_mm, to_mm], stretch) in spans(way) {
            let x = self.axes.at(to_mm, 0.0).x;
            if x < high.x - 0.5 {
                marks.push(self.line(DVec2::new(x, low.y), DVec2::new(x, high.y), 0.06, self.tint(0.6)));
            }
            let text = format!("{} ({})", stretch.branch, stretch.generation);
            let half = 0.5 * f64::from(self.face.width(&text, (SMALL * self.unit) as f32));
            let middle = self.axes.at(0.5 * (from_mm + to_mm), 0.0).x;
            let Some(row) = (0..NAME_ROWS).find(|&row| middle - half >= free_from[row]) else { continue };
            free_from[row] = middle + half + 0.6 * self.unit;
            let at = DVec2::new(middle, low.y - 0.5 * self.unit - row as f64 * step);
            marks.push(self.text(at, SMALL, Anchor::Middle, &text));
        }
        Group { name: "branches", marks }
    }

    pub(super) fn curves(&self, way: &Way<'_>) -> Group {
        let [blue, orange] = self.curve_colors();
        let mut marks = Vec::new();
        for run in self.runs(way.rows, |row| row.reference_radius_mm) {
            marks.extend(self.dashes(&run, self.colors.soft));
        }
        let mut curve = |of: fn(&ProfileRow) -> f64, width: f64, color: Rgb| {
            for points in self.runs(way.rows, of) {
                let width_px = width * self.unit;
                marks.push(match points.as_slice() {
                    [only] => Mark::Ring { center: *only, radius_px: width_px, width_px, color },
                    _ => Mark::Bent { points, width_px, color },
                });
            }
        };
        curve(|row| row.area_radius_mm, 0.12, orange);
        curve(|row| row.radius_mm, 0.3, blue);
        Group { name: "curves", marks }
    }

    /// The points of a quantity in stretches without gaps.
    fn runs(&self, rows: &[ProfileRow], of: fn(&ProfileRow) -> f64) -> Vec<Vec<DVec2>> {
        let known = rows.chunk_by(|a, b| of(a).is_finite() == of(b).is_finite());
        let known = known.filter(|run| run.first().is_some_and(|row| of(row).is_finite()));
        known.map(|run| run.iter().map(|row| self.axes.at(row.from_root_mm, of(row))).collect()).collect()
    }

    /// A broken line.
    fn dashes(&self, points: &[DVec2], color: Rgb) -> Vec<Mark> {
        let (dash, step) = (DASH * self.unit, DASH_STEP * self.unit);
        let (mut marks, mut gone) = (Vec::new(), 0.0);
        for pair in points.windows(2) {
            let length = pair[0].distance(pair[1]);
            let first = (gone / step).floor() as usize;
            let last = ((gone + length) / step).floor() as usize;
            for i in first..=last {
                let [from, to] = [0.0, dash].map(|part| (i as f64 * step + part - gone).clamp(0.0, length));
                if to > from {
                    let at = |along: f64| pair[0].lerp(pair[1], along / length);
                    marks.push(self.line(at(from), at(to), 0.16, color));
                }
            }
            gone += length;
        }
        marks
    }

    /// Rings at the narrow places, the first of them with their percentages; where none is listed, at the narrowest place.
    pub(super) fn narrow_places(&self, way: &Way<'_>) -> Group {
        let (listed, ink) = (way.candidates.iter(), self.colors.ink);
        let listed = listed.enumerate().map(|(idx, place)| (place, self.colors.alarm, idx < MOST_NAMED));
        let other = way.narrowest.filter(|_| way.candidates.is_empty()).map(|place| (place, ink, true));
        let marks = listed.chain(other).flat_map(|(place, color, is_named)| {
            let center = self.axes.at(place.from_root_mm, place.radius_mm);
            let mut marks = vec![self.ring(center, color)];
            if is_named {
                marks.extend(self.shortfall(place, color));
            }
            marks
        });
        Group { name: "narrow-places", marks: marks.collect() }
    }

    /// The line from a ring up to the reference, and the percentage under the ring, where no curve is, unless that is below
    /// the axis.
    fn shortfall(&self, place: &Stenosis, color: Rgb) -> Vec<Mark> {
        let mut marks = Vec::new();
        let center = self.axes.at(place.from_root_mm, place.radius_mm);
        let reference = self.axes.at(place.from_root_mm, place.reference_radius_mm);
        let ring_top = center - DVec2::new(0.0, RING * self.unit);
        if reference.y < ring_top.y {
            marks.push(self.line(ring_top, reference, 0.12, color));
        }
        let [low, high] = self.axes.corners;
        let drop = (RING + 0.4 + SMALL) * self.unit;
        let is_low = center.y + drop + 0.5 * self.unit > high.y;
        let y = if is_low { reference.y - 0.6 * self.unit } else { center.y + drop };
        let text = format!("−{} %", unit::text(place.narrowing_percent, 3));
        let half = 0.5 * f64::from(self.face.width(&text, (BODY * self.unit) as f32));
        let x = center.x.max(low.x + half + 0.5 * self.unit).min(high.x - half);
        let (size_px, anchor, at) = (BODY * self.unit, Anchor::Middle, DVec2::new(x, y));
        marks.push(Mark::Text { at, size_px, anchor, is_strong: true, color, text });
        marks
    }

    /// What each line is, and where that ends.
    pub(super) fn legend(&self, way: &Way<'_>, top: f64) -> (Group, f64) {
        let [blue, orange] = self.curve_colors();
        let has = |of: fn(&ProfileRow) -> f64| way.rows.iter().any(|row| of(row).is_finite());
        let has_usual = way.stretches.iter().any(|stretch| stretch.usual_mm.mean.is_finite());
        let entries = [
            (Sample::Solid(0.3, blue), "inscribed sphere", true),
            (
                Sample::Solid(0.12, orange),
                "circle of the cross-section's area",
                has(|row| row.area_radius_mm),
            ),
            (Sample::Broken, "reference", has(|row| row.reference_radius_mm)),
            (Sample::Band, "branches of this generation, mean ± sd", has_usual),
            (Sample::Ring, "narrow place (stenoses.tsv)", !way.candidates.is_empty()),
        ];
        let size_px = (SMALL * self.unit) as f32;
        let (left, right) = (self.axes.corners[0].x, self.axes.corners[1].x);
        let mut at = DVec2::new(left, top + SMALL * self.unit);
        let mut marks = Vec::new();
        for (sample, name, _) in entries.into_iter().filter(|(.., is_there)| *is_there) {
            let width = 5.6 * self.unit + f64::from(self.face.width(name, size_px));
            if at.x + width > right && at.x > left {
                at = DVec2::new(left, at.y + LEADING * SMALL * self.unit);
            }
            let from = at - DVec2::new(0.0, 0.36 * SMALL * self.unit);
            marks.extend(self.sample(&sample, [from, from + DVec2::new(2.6 * self.unit, 0.0)]));
            marks.push(self.text(at + DVec2::new(3.2 * self.unit, 0.0), SMALL, Anchor::Start, name));
            at.x += width;
        }
        (Group { name: "legend", marks }, at.y + SMALL * self.unit)
    }

    fn sample(&self, sample: &Sample, [from, to]: [DVec2; 2]) -> Vec<Mark> {
        match sample {
            Sample::Solid(width, color) => vec![self.line(from, to, *width, *color)],
            Sample::Broken => self.dashes(&[from, to], self.colors.soft),
            Sample::Band => {
                vec![self.line(from, to, 1.1, self.tint(0.16)), self.line(from, to, 0.12, self.tint(0.55))]
            }
            Sample::Ring => vec![self.ring(0.5 * (from + to), self.colors.alarm)],
        }
    }

    fn ring(&self, center: DVec2, color: Rgb) -> Mark {
        Mark::Ring { center, radius_px: RING * self.unit, width_px: 0.2 * self.unit, color }
    }

    fn text(&self, at: DVec2, size: f64, anchor: Anchor, text: &str) -> Mark {
        let (size_px, color) = (size * self.unit, self.colors.ink);
        Mark::Text { at, size_px, anchor, is_strong: false, color, text: text.to_owned() }
    }

    fn line(&self, from: DVec2, to: DVec2, width: f64, color: Rgb) -> Mark {
        Mark::Line { from, to, width_px: width * self.unit, color }
    }
}

/// How an entry of the legend is drawn.
enum Sample {
    Solid(f64, Rgb),
    Broken,
    Band,
    Ring,
}

/// Where each branch on the way begins and ends, in mm from the root: it begins where the one before ends, at the fork.
fn spans<'a>(way: &Way<'a>) -> Vec<([f64; 2], &'a Stretch)> {
    let mut from_mm = 0.0;
    let of_branches = way.rows.chunk_by(|a, b| a.branch == b.branch);
    let spans = of_branches.zip(way.stretches).map(|(rows, stretch)| {
        let to_mm = rows.last().map_or(from_mm, |row| row.from_root_mm);
        let span = [from_mm, to_mm];
        from_mm = to_mm;
        (span, stretch)
    });
    spans.collect()
}
