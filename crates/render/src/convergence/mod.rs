//! The energy against the work of each method of a run, in one chart.
//!
//! **Input** for each method its row of the table and its convergence curve. **Output** PNG and SVG.
//! **Steps** 1. Both axes are logarithmic, since energies fall and work grows by factors; what is below the chart (an
//! energy of 0, no work) stands on its edge. 2. A method that searches is a staircase, for the best so far stays until a
//! better one is found; its points have dots, and a few of them say what had been done. 3. A method that constructs
//! its layout is a broken line at its energy. 4. Names stand at the right, moved apart where they would overlap.
//! 5. A ring marks a layout that crosses. Those that search have colours, those that construct a grey.
//! **Guarantees** work is counted, not timed, so that the figure is the same on every machine.
//! **Cost** O(points).

mod axes;

use axes::Axes;
use espalier_model::{MethodRow, TracePoint};
use glam::DVec2;

use crate::drawing::{Group, Mark};
use crate::furniture::{self, Heading};
use crate::page::{MAX_PIXELS, Page};
use crate::paint::Canvas;
use crate::palette::{PageColors, Palette, Rgb};
use crate::params::Params;
use crate::side_by_side::SideBySide;
use crate::text::{Anchor, Face};
use crate::{Error, svg, unit};

/// In layout units: font sizes, height of the chart, room to its left, to its right and below.
const SMALL: f64 = 1.15;
const TINY: f64 = 0.95;
const HEIGHT: f64 = 40.0;
const LEFT: f64 = 8.0;
const RIGHT: f64 = 24.0;
const BELOW: f64 = 5.0;
/// Line height over font size.
const LEADING: f64 = 1.45;
/// Curves with more points have neither dots nor words.
const MOST_DOTS: usize = 40;

/// A method as the figure shows it.
#[derive(Clone, Copy, Debug)]
pub struct Searched<'a> {
    /// Its row of the table.
    pub row: &'a MethodRow,
    /// Its convergence curve; empty if it does not search.
    pub trace: &'a [TracePoint],
    /// Whether its layout became the embedding.
    pub is_chosen: bool,
}

/// Draws the energy of each method against its work.
///
/// # Errors
/// [`Error`] if a parameter is out of range or the figure would be over 2²⁷ pixels.
pub fn convergence(methods: &[Searched<'_>], params: &Params) -> Result<SideBySide, Error> {
    params.validate()?;
    let (face, colors, names) = (Face::built_in()?, PageColors::of(params.theme), Palette::names());
    let unit = Page::unit_px(params.width_px);
    let said = heading(params, methods);
    let (group, heading_px) = furniture::heading(&face, &said, params.width_px, &colors);
    let margin = Page::margin_px(params.width_px);
    let low = DVec2::new(margin + LEFT * unit, margin + heading_px + 1.5 * unit);
    let high = DVec2::new(f64::from(params.width_px) - margin - RIGHT * unit, low.y + HEIGHT * unit);
    let chart = Chart { axes: Axes::of(methods, [low, high]), unit, colors, names };
    let groups =
        [vec![group, chart.grid()], chart.methods(methods), vec![chart.labels(methods, &face)]].concat();

    let (width, height) = (params.width_px, (high.y + BELOW * unit + margin) as u32);
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(Error::TooLarge { width, height, limit: MAX_PIXELS });
    }
    let mut canvas = Canvas::new([width, height], colors.background)?;
    canvas.mark(&groups, &face);
    let png = canvas.png();
    let title = said.title.unwrap_or_else(|| "convergence".to_owned());
    Ok(SideBySide { png, svg: svg::plot("convergence", &title, &groups, ([width, height], &colors)) })
}

fn heading(params: &Params, methods: &[Searched<'_>]) -> Heading {
    let title = params.title.as_ref().map(|title| format!("{title}: convergence"));
    let mut verdict = vec!["the best energy so far against the work done for it".to_owned()];
    if let Some(chosen) = methods.iter().find(|method| method.is_chosen) {
        let energy = unit::text(chosen.row.energy.total(), 4);
        verdict.push(format!("the map is by {}, energy {energy}", chosen.row.method));
    }
    let facts = vec![
        "work is counted, not timed: evaluations of a particle for a swarm, edges looked at for the solver; \
         compare heights across methods, not widths"
            .to_owned(),
        "broken line = a method that constructs its layout".to_owned(),
        "ring = the layout has crossings".to_owned(),
    ];
    Heading { title, verdict, facts }
}

struct Chart {
    axes: Axes,
    unit: f64,
    colors: PageColors,
    names: Palette,
}

impl Chart {
    /// Those that search have a colour each, those that construct their layout share a grey.
    fn color(&self, methods: &[Searched<'_>], method: usize) -> Rgb {
        if methods[method].trace.is_empty() {
            return self.colors.soft;
        }
        let n_before = methods[..method].iter().filter(|before| !before.trace.is_empty()).count();
        self.names.at(self.names.value_of(n_before))
    }

    /// Axes, their ticks and what they are.
    fn grid(&self) -> Group {
        let [low, high] = self.axes.corners;
        let mut marks = Vec::new();
        for tick in Axes::ticks(self.axes.energy) {
            let y = self.axes.y(tick);
            marks.push(self.line(DVec2::new(low.x, y), DVec2::new(high.x, y), 0.05, self.colors.soft));
            let at = DVec2::new(low.x - 0.6 * self.unit, y + 0.36 * SMALL * self.unit);
            marks.push(self.text(at, SMALL, Anchor::End, &unit::text(tick, 1)));
        }
        for tick in Axes::ticks(self.axes.work) {
            let foot = DVec2::new(self.axes.x(tick), high.y);
            marks.push(self.line(foot, foot + DVec2::new(0.0, 0.5 * self.unit), 0.1, self.colors.ink));
            let at = foot + DVec2::new(0.0, (0.5 + SMALL) * self.unit);
            marks.push(self.text(at, SMALL, Anchor::Middle, &counted(tick)));
        }
        marks.push(self.line(low, DVec2::new(low.x, high.y), 0.1, self.colors.ink));
        marks.push(self.line(DVec2::new(low.x, high.y), high, 0.1, self.colors.ink));
        let below = DVec2::new(0.5 * (low.x + high.x), high.y + (1.2 + 2.4 * SMALL) * self.unit);
        marks.push(self.text(below, SMALL, Anchor::Middle, "work, in units of the method"));
        let above = DVec2::new(low.x, low.y - 0.7 * self.unit);
        marks.push(self.text(above, SMALL, Anchor::End, "energy"));
        Group { name: "axes", marks }
    }

    fn methods(&self, methods: &[Searched<'_>]) -> Vec<Group> {
        let group = |(idx, method): (usize, &Searched<'_>)| {
            let color = self.color(methods, idx);
            let is_constructed = method.trace.is_empty();
            let marks =
                if is_constructed { self.constructed(method, color) } else { self.curve(method, color) };
            Group { name: "method", marks }
        };
        methods.iter().enumerate().map(group).collect()
    }

    /// A broken line at the energy of a layout.
    fn constructed(&self, method: &Searched<'_>, color: Rgb) -> Vec<Mark> {
        let [low, high] = self.axes.corners;
        let y = self.axes.y(method.row.energy.total());
        let (dash, mut x, mut marks) = (0.9 * self.unit, low.x, Vec::new());
        while x < high.x {
            let to = DVec2::new((x + dash).min(high.x), y);
            marks.push(self.line(DVec2::new(x, y), to, 0.2, color));
            x += 1.7 * dash;
        }
        if method.row.crossings > 0 {
            marks.push(self.ring(DVec2::new(high.x, y)));
        }
        marks
    }

    /// The staircase of a search, on to the right end.
    fn curve(&self, method: &Searched<'_>, color: Rgb) -> Vec<Mark> {
        let right = self.axes.corners[1].x;
        let mut marks = Vec::new();
        for (here, next) in method.trace.iter().zip(method.trace.iter().skip(1).map(Some).chain([None])) {
            let from = self.axes.at(here);
            let to = next.map_or(DVec2::new(right, from.y), |next| self.axes.at(next));
            let corner = DVec2::new(to.x, from.y);
            // Beyond the last point nothing was done: a hairline leads to the name.
            marks.push(self.line(from, corner, if next.is_some() { 0.28 } else { 0.08 }, color));
            marks.push(self.line(corner, to, 0.28, color));
        }
        if method.trace.len() <= MOST_DOTS {
            marks.extend(self.dots(method.trace, color));
        }
        let crossing = method.trace.iter().filter(|point| point.crossings > 0);
        marks.extend(crossing.map(|point| self.ring(self.axes.at(point))));
        marks
    }

    /// A dot for each point; what had been done stands beside those that are clear of the one named before.
    fn dots(&self, trace: &[TracePoint], color: Rgb) -> Vec<Mark> {
        let mut marks = Vec::new();
        let mut last_named: Option<DVec2> = None;
        for point in trace {
            let center = self.axes.at(point);
            let (radius_px, width_px) = (0.22 * self.unit, 0.44 * self.unit);
            marks.push(Mark::Ring { center, radius_px, width_px, color });
            let clear = |last: DVec2| (center.y - last.y).abs() > LEADING * TINY * self.unit;
            if last_named.is_none_or(clear) {
                last_named = Some(center);
                let at = center + DVec2::new(0.7, -0.5) * self.unit;
                let mut mark = self.text(at, TINY, Anchor::Start, point.phase.name());
                if let Mark::Text { color, .. } = &mut mark {
                    *color = self.colors.soft;
                }
                marks.push(mark);
            }
        }
        marks
    }

    /// The names at the right, from the top down, each no nearer than a line to the one above it.
    fn labels(&self, methods: &[Searched<'_>], face: &Face) -> Group {
        let high = self.axes.corners[1];
        let mut order: Vec<(f64, usize)> = methods
            .iter()
            .enumerate()
            .map(|(idx, method)| (self.axes.y(method.row.energy.total()), idx))
            .collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let step = LEADING * SMALL * self.unit;
        let mut places: Vec<f64> = Vec::with_capacity(order.len());
        for &(y, _) in &order {
            places.push(places.last().map_or(y, |above: &f64| y.max(above + step)));
        }
        // What was pushed out at the bottom moves up again, and takes with it what stands in its way.
        let mut below = high.y + 0.5 * step;
        for place in places.iter_mut().rev() {
            *place = place.min(below);
            below = *place - step;
        }
        let mut marks = Vec::new();
        for (&(y, idx), place) in order.iter().zip(places) {
            let row = methods[idx].row;
            let (from, to) = (DVec2::new(high.x, y), DVec2::new(high.x + 1.6 * self.unit, place));
            marks.push(self.line(from, to, 0.08, self.color(methods, idx)));
            let at = to + DVec2::new(0.5 * self.unit, 0.36 * SMALL * self.unit);
            let room = (RIGHT - 2.4) * self.unit;
            let fitted = face.lines(&[label(methods, row)], (SMALL * self.unit) as f32, room as f32);
            let mark = self.text(at, SMALL, Anchor::Start, &fitted.first().cloned().unwrap_or_default());
            marks.push(if methods[idx].is_chosen { strong(mark) } else { mark });
        }
        Group { name: "names", marks }
    }

    fn ring(&self, center: DVec2) -> Mark {
        let (radius_px, width_px) = (0.6 * self.unit, 0.18 * self.unit);
        Mark::Ring { center, radius_px, width_px, color: self.colors.alarm }
    }

    fn text(&self, at: DVec2, size: f64, anchor: Anchor, text: &str) -> Mark {
        let (size_px, color) = (size * self.unit, self.colors.ink);
        Mark::Text { at, size_px, anchor, is_strong: false, color, text: text.to_owned() }
    }

    fn line(&self, from: DVec2, to: DVec2, width: f64, color: Rgb) -> Mark {
        Mark::Line { from, to, width_px: width * self.unit, color }
    }
}

fn strong(mark: Mark) -> Mark {
    match mark {
        Mark::Text { at, size_px, anchor, color, text, .. } => {
            Mark::Text { at, size_px, anchor, is_strong: true, color, text }
        }
        other => other,
    }
}

/// `solver 0.0123`, with its targets where they are not the embedding's, and its crossings if there are any.
fn label(methods: &[Searched<'_>], row: &MethodRow) -> String {
    let energy = unit::text(row.energy.total(), 3);
    let chosen = methods.iter().find(|method| method.is_chosen).map(|method| method.row.targets);
    let is_other = chosen.is_some_and(|chosen| chosen != row.targets);
    let targets = if is_other { format!(", targets {}", row.targets.name()) } else { String::new() };
    let crossings = match row.crossings {
        0 => String::new(),
        1 => ", 1 crossing".to_owned(),
        n => format!(", {n} crossings"),
    };
    format!("{}{targets} {energy}{crossings}", row.method)
}

/// A round number of things: 200, 5 k, 1 M.
fn counted(value: f64) -> String {
    let (factor, sign) = [(1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k")]
        .into_iter()
        .find(|&(factor, _)| value >= factor * (1.0 - 1e-9))
        .unwrap_or((1.0, ""));
    format!("{}{sign}", unit::text(value / factor, 3))
}

#[cfg(test)]
mod tests;
