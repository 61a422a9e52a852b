//! Small line charts of numbers against a setting, in one figure.
//!
//! **Input** values by chart, series and place on the x axis. **Output** PNG and SVG.
//! **Steps** charts stand in rows of three under one heading; every y axis begins at 0 and ends a little above the
//! largest value, with ticks at round numbers; each series has one colour in all charts, named below. A value that is
//! missing leaves a gap in its line.
//! **Cost** O(values).

use std::fmt::Write as _;

use glam::DVec2;

use crate::drawing::{Group, Mark};
use crate::furniture::{self, Heading};
use crate::page::{MAX_PIXELS, Page};
use crate::paint::Canvas;
use crate::palette::{PageColors, Palette, Rgb, hex};
use crate::params::Params;
use crate::side_by_side::SideBySide;
use crate::text::{Anchor, Face};
use crate::{Error, svg, unit};

/// Charts in a row.
const N_COLUMNS: usize = 3;
/// In layout units: font sizes, height of a chart, room to its left and below, space between charts.
const TITLE: f64 = 1.4;
const SMALL: f64 = 1.1;
const HEIGHT: f64 = 17.0;
const LEFT: f64 = 4.6;
const BELOW: f64 = 5.6;
const GAP: f64 = 2.4;
/// Line height over font size.
const LEADING: f64 = 1.5;
/// The most ticks on an x axis.
const MOST_TICKS: usize = 8;

/// Charts with one x axis and the same series.
#[derive(Clone, Debug)]
pub struct Charts {
    /// The heading.
    pub title: String,
    /// What the x axis is.
    pub x_label: String,
    /// The places on the x axis, from 0 (left) to 1 (right), with their texts.
    pub ticks: Vec<(f64, String)>,
    /// The names of the series; a single series needs none.
    pub series: Vec<String>,
    /// The charts.
    pub charts: Vec<Chart>,
}

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What its y axis is.
    pub title: String,
    /// By series, by place: the value, at least 0, if there is one.
    pub values: Vec<Vec<Option<f64>>>,
}

/// Draws charts.
///
/// # Errors
/// [`Error`] if a parameter is out of range or the figure would be over 2²⁷ pixels.
pub fn charts(charts: &Charts, params: &Params) -> Result<SideBySide, Error> {
    params.validate()?;
    let artist = Artist {
        unit: Page::unit_px(params.width_px),
        width: f64::from(params.width_px),
        margin: Page::margin_px(params.width_px),
        colors: PageColors::of(params.theme),
        names: Palette::names(),
        face: Face::built_in()?,
    };
    let (groups, height_px) = artist.lay_out(charts, params.width_px);
    let (width, height) = (params.width_px, height_px as u32);
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(Error::TooLarge { width, height, limit: MAX_PIXELS });
    }
    let mut canvas = Canvas::new([width, height], artist.colors.background)?;
    canvas.mark(&groups, &artist.face);
    let png = canvas.png();
    Ok(SideBySide { png, svg: artist.svg(charts, &groups, [width, height]) })
}

struct Artist {
    unit: f64,
    width: f64,
    margin: f64,
    colors: PageColors,
    names: Palette,
    face: Face,
}

impl Artist {
    fn lay_out(&self, charts: &Charts, width: u32) -> (Vec<Group>, f64) {
        let said = Heading { title: Some(charts.title.clone()), ..Heading::default() };
        let (heading, heading_px) = furniture::heading(&self.face, &said, width, &self.colors);
        let mut groups = vec![heading];
        let mut top = self.margin + heading_px + self.unit;
        let n_columns = N_COLUMNS.min(charts.charts.len()).max(1);
        let chart_px = (self.width - 2.0 * self.margin + GAP * self.unit) / n_columns as f64;
        for row in charts.charts.chunks(n_columns) {
            for (column, chart) in row.iter().enumerate() {
                let low = DVec2::new(
                    self.margin + column as f64 * chart_px + LEFT * self.unit,
                    top + LEADING * TITLE * self.unit,
                );
                let size = DVec2::new(chart_px - (LEFT + GAP) * self.unit, HEIGHT * self.unit);
                groups.push(self.chart(charts, chart, [low, low + size]));
            }
            top += (LEADING * TITLE + HEIGHT + BELOW) * self.unit;
        }
        if charts.series.len() > 1 {
            let (legend, below) = self.legend(&charts.series, top);
            groups.push(legend);
            top = below;
        }
        (groups, top + self.margin)
    }

    fn color(&self, series: usize) -> Rgb {
        self.names.at(self.names.value_of(series))
    }

    fn chart(&self, charts: &Charts, chart: &Chart, [low, high]: [DVec2; 2]) -> Group {
        let known = chart.values.iter().flatten().flatten().copied().filter(|value| value.is_finite());
        let most = known.fold(0.0, f64::max);
        let ticks = unit::multiples(0.0, if most > 0.0 { 1.05 * most } else { 1.0 }, 4);
        let top = if most > 0.0 { 1.05 * most } else { 1.0 };
        let y_of = |value: f64| high.y - (high.y - low.y) * (value / top).clamp(0.0, 1.0);
        // Half a unit inside, so that the first dot does not stand on the axis.
        let x_of = |place: f64| low.x + self.unit + (high.x - low.x - 2.0 * self.unit) * place;

        let at = DVec2::new(low.x - LEFT * self.unit, low.y - 0.5 * TITLE * self.unit);
        let mut marks = vec![self.text(at, TITLE, Anchor::Start, true, &chart.title)];
        for tick in ticks {
            let y = y_of(tick);
            marks.push(self.line(DVec2::new(low.x, y), DVec2::new(high.x, y), 0.04, self.colors.soft));
            let at = DVec2::new(low.x - 0.5 * self.unit, y + 0.36 * SMALL * self.unit);
            marks.push(self.text(at, SMALL, Anchor::End, false, &unit::text(tick, 3)));
        }
        marks.push(self.line(DVec2::new(low.x, low.y), DVec2::new(low.x, high.y), 0.1, self.colors.ink));
        marks.push(self.line(DVec2::new(low.x, high.y), high, 0.1, self.colors.ink));
        let every = charts.ticks.len().div_ceil(MOST_TICKS).max(1);
        let mut free_from = f64::NEG_INFINITY;
        for (place, text) in charts.ticks.iter().step_by(every) {
            let x = x_of(*place);
            // A label that would run into the one before it is left out, and its tick with it.
            let half_px = 0.5 * f64::from(self.face.width(text, (SMALL * self.unit) as f32));
            if x - half_px < free_from {
                continue;
            }
            free_from = x + half_px + 0.5 * self.unit;
            let tick = DVec2::new(0.0, 0.5 * self.unit);
            let foot = DVec2::new(x, high.y);
            marks.push(self.line(foot, foot + tick, 0.1, self.colors.ink));
            let at = foot + DVec2::new(0.0, 0.5 * self.unit + SMALL * self.unit);
            marks.push(self.text(at, SMALL, Anchor::Middle, false, text));
        }
        let at = DVec2::new(0.5 * (low.x + high.x), high.y + (0.6 + 2.5 * SMALL) * self.unit);
        marks.push(self.text(at, SMALL, Anchor::Middle, false, &charts.x_label));
        for (series, values) in chart.values.iter().enumerate() {
            let point = |place: usize| {
                let value = values.get(place).copied().flatten().filter(|value| value.is_finite())?;
                Some(DVec2::new(x_of(charts.ticks.get(place)?.0), y_of(value)))
            };
            let color = self.color(series);
            for place in 0..values.len() {
                if let (Some(from), Some(to)) = (point(place), point(place + 1)) {
                    marks.push(self.line(from, to, 0.22, color));
                }
                if let Some(center) = point(place) {
                    let (radius_px, width_px) = (0.2 * self.unit, 0.4 * self.unit);
                    marks.push(Mark::Ring { center, radius_px, width_px, color });
                }
            }
        }
        Group { name: "chart", marks }
    }

    /// The names of the series, and where they end.
    fn legend(&self, series: &[String], top: f64) -> (Group, f64) {
        let size_px = (SMALL * self.unit) as f32;
        let mut marks = Vec::new();
        let mut at = DVec2::new(self.margin, top + SMALL * self.unit);
        for (idx, name) in series.iter().enumerate() {
            let width = 3.0 * self.unit + f64::from(self.face.width(name, size_px)) + 2.0 * self.unit;
            if at.x + width > self.width - self.margin && at.x > self.margin {
                at = DVec2::new(self.margin, at.y + LEADING * SMALL * self.unit);
            }
            let middle = at - DVec2::new(0.0, 0.36 * SMALL * self.unit);
            marks.push(self.line(middle, middle + DVec2::new(2.4 * self.unit, 0.0), 0.3, self.color(idx)));
            let text_at = at + DVec2::new(3.0 * self.unit, 0.0);
            marks.push(self.text(text_at, SMALL, Anchor::Start, false, name));
            at.x += width;
        }
        (Group { name: "legend", marks }, at.y + SMALL * self.unit)
    }

    fn text(&self, at: DVec2, size: f64, anchor: Anchor, is_strong: bool, text: &str) -> Mark {
        let color = self.colors.ink;
        Mark::Text { at, size_px: size * self.unit, anchor, is_strong, color, text: text.to_owned() }
    }

    fn line(&self, from: DVec2, to: DVec2, width: f64, color: Rgb) -> Mark {
        Mark::Line { from, to, width_px: width * self.unit, color }
    }

    fn svg(&self, charts: &Charts, groups: &[Group], [width, height]: [u32; 2]) -> String {
        let mut out = String::new();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" version=\"1.1\" \
             width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             data-format=\"espalier-charts-svg\" data-version=\"1\">\n<title>{}</title>\n\
             <rect id=\"background\" width=\"{width}\" height=\"{height}\" fill=\"{}\"/>",
            espalier_model::xml::escape(&charts.title),
            hex(self.colors.background)
        );
        svg::write_groups(&mut out, groups);
        out.push_str("</svg>\n");
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_lone_points_are_drawn() {
        let figure = |values: Vec<Vec<Option<f64>>>, n_places: usize| Charts {
            title: "a sweep".to_owned(),
            x_label: "embed.w_length".to_owned(),
            ticks: (0..n_places).map(|i| (i as f64 / n_places.max(2) as f64, i.to_string())).collect(),
            series: (0..values.len()).map(|i| format!("series {i}")).collect(),
            charts: vec![Chart { title: "energy".to_owned(), values }],
        };
        let params = Params { width_px: 400, ..Params::default() };
        let n_rings = |figure: &Charts| {
            let svg = charts(figure, &params).expect("a figure").svg;
            svg.matches("<circle").count()
        };
        let with_gap =
            figure(vec![vec![Some(1.0), None, Some(3.0)], vec![Some(0.0), Some(f64::NAN), None]], 3);
        assert_eq!(n_rings(&with_gap), 3);
        assert_eq!(n_rings(&figure(vec![vec![Some(0.0)]], 1)), 1);
        assert_eq!(n_rings(&figure(vec![], 0)), 0);
        assert_eq!(n_rings(&figure(vec![vec![Some(1e300), Some(1e-300)]; 40], 2)), 80);
    }
}
